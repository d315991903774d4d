//! What smoothing found out, in plain units.

use serde::Serialize;

/// A standard deviation, or the root of a spectral density, before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Learned {
    /// What it is: "phase noise G L1, constant part".
    pub name: String,
    /// Unit of the values: "m", "m/s^1.5".
    pub unit: &'static str,
    /// What smoothing started with.
    pub start: f64,
    /// What it ended with.
    pub end: f64,
    /// Whether it was learned from the data.
    pub learned: bool,
}

/// Innovations of one type of measurement in the last forward pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Consistency {
    /// "code", "phase" or "doppler".
    pub of: &'static str,
    /// Number of measurements (differences).
    pub count: usize,
    /// Mean of the squared innovations over their predicted variances; 1 if model and noise are right.
    pub mean: f64,
}

/// Ambiguities, counted by arcs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ArcCount {
    /// All arcs.
    pub total: usize,
    /// Those that cannot be fixed: half cycles, GLONASS, and those alone in their group.
    pub float_by_nature: usize,
    /// Those with known integers relative to another arc.
    pub fixed: usize,
    /// Those that might have been fixed and were not.
    pub refused: usize,
    /// Fixes left out because they contradict others.
    pub contradictory: usize,
}

/// What smoothing found out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// Noise of motion and measurements.
    pub parameters: Vec<Learned>,
    /// −ln likelihood of the innovations: each step of EM, with the integers of its time, then that of the last pass.
    pub negative_log_likelihood: Vec<f64>,
    /// Innovations by type.
    pub consistency: Vec<Consistency>,
    /// Ambiguities.
    pub arcs: ArcCount,
    /// Forward passes in all.
    pub passes: usize,
    /// How filtered densities were kept: "all epochs", "checkpoints" or "file".
    pub memory: &'static str,
}
