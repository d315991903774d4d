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

/// A start of EM, and how it ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Start {
    /// Factor on the standard deviations of the motion's noise.
    pub motion: f64,
    /// Factor on those of the measurements' noise.
    pub measurements: f64,
    /// −ln likelihood where EM ended; `None` where it failed.
    pub negative_log_likelihood: Option<f64>,
    /// Whether this one was the likeliest, which counts.
    pub taken: bool,
}

impl Start {
    /// The start as configured and the further ones, with −ln likelihood at the end of each, NaN where it failed.
    pub fn list(further: &[[f64; 2]], ends: &[f64]) -> Vec<Self> {
        let sound = ends.iter().enumerate().filter(|(_, end)| !end.is_nan());
        let best = sound.min_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| i);
        let starts = std::iter::once(&[1.0; 2]).chain(further).zip(ends).enumerate();
        starts
            .map(|(i, (&[motion, measurements], &end))| Self {
                motion,
                measurements,
                negative_log_likelihood: (!end.is_nan()).then_some(end),
                taken: best == Some(i),
            })
            .collect()
    }
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

/// How heavy the tails of the noise of one type of measurement are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tail {
    /// What it is: "code G1", "Doppler".
    pub of: String,
    /// Degrees of freedom of Student's distribution; none for Gaussian noise.
    pub freedom: Option<f64>,
    /// For how long a signal keeps the same variance `[s]`; 0 for single epochs.
    pub window_s: f64,
    /// Number of measurements.
    pub count: usize,
    /// Those with less than a quarter of their weight.
    pub distrusted: usize,
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
    /// Starts of EM; empty if there was one or none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub starts: Vec<Start>,
    /// −ln likelihood of the innovations: each step of EM, with the integers of its time, then that of the last pass.
    pub negative_log_likelihood: Vec<f64>,
    /// Innovations by type.
    pub consistency: Vec<Consistency>,
    /// Tails of the noise, where measurements were weighed by them.
    pub tails: Vec<Tail>,
    /// Ambiguities.
    pub arcs: ArcCount,
    /// Forward passes in all.
    pub passes: usize,
    /// How filtered densities were kept: "all epochs", "checkpoints" or "file".
    pub memory: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_starts_the_likeliest_is_taken_and_failures_have_no_likelihood() {
        let taken = |ends: &[f64]| -> Vec<bool> {
            Start::list(&[[0.1, 10.0], [10.0, 0.1]], ends).iter().map(|start| start.taken).collect()
        };
        assert_eq!(taken(&[3.0, 2.0, 5.0]), [false, true, false]);
        assert_eq!(taken(&[2.0, 2.0, 5.0]), [true, false, false], "a draw is for the first");
        assert_eq!(taken(&[f64::NAN, 7.0, f64::INFINITY]), [false, true, false]);
        assert_eq!(taken(&[f64::NAN; 3]), [false; 3]);
        let list = Start::list(&[[0.1, 10.0]], &[1.0, f64::NAN]);
        assert_eq!([list[0].motion, list[0].measurements, list[1].motion, list[1].measurements], [1.0, 1.0, 0.1, 10.0]);
        assert_eq!(list.iter().map(|start| start.negative_log_likelihood).collect::<Vec<_>>(), [Some(1.0), None]);
    }

    #[test]
    fn the_summary_names_starts_only_where_there_were_some() {
        let json = serde_json::to_value(Report::default()).unwrap();
        assert!(json.get("starts").is_none() && json["arcs"]["float_by_nature"] == 0, "{json}");
        let starts = Start::list(&[[0.1, 10.0]], &[f64::NAN, 2.0]);
        let json = serde_json::to_value(Report { starts, ..Report::default() }).unwrap();
        assert!(json["starts"][0]["negative_log_likelihood"].is_null() && json["starts"][1]["taken"] == true, "{json}");
    }
}
