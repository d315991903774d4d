//! Smoothing of what the PPP engine recorded, with the noise of process and measurements learned by EM.
//!
//! X. Zhang et al., *Automatic Calibration of Process Noise Matrix and Measurement Noise Covariance for Multi-GNSS Precise
//! Point Positioning*, Remote Sensing 12 (2020): "the paper" in these modules. Its one variance for each measurement and
//! step is [`Measurements::Epoch`]; the default shares variances in pools and weights each measurement as Student-t
//! distributed errors deserve.
//!
//! * [`tape`]: what the engine used, epoch by epoch.
//! * [`model`]: states, steps and measurements of a tape.
//! * [`pools`], [`noise`]: which measurements share a variance, and the M-step of each scheme.
//! * [`learn`]: the iterations of EM; [`disturbances`]: what the steps say of their noise.
//! * [`answer`]: from densities to solutions; [`report`]: what was found out.
//! * [`held_out`]: how well a model predicts measurements that it has not seen.
//!
//! Cost of an iteration with K epochs of n states and m rows: K (2 n³ + 4 m n²) multiply-adds.

pub mod answer;
pub mod correlation;
pub mod disturbances;
pub mod held_out;
pub mod learn;
pub mod model;
pub mod noise;
pub mod pools;
pub mod report;
pub mod tape;
#[cfg(test)]
pub(super) mod tests;

use crate::smooth::history::Storage;
use crate::smooth::pass::{PassError, PassOptions, Passes};
use crate::smooth::progress::Progress;
use answer::State;
use learn::Learning;
use model::PppModel;
use noise::{Measurements, Process};
use report::Report;
use surefix_core::filter::update::Form;
use tape::{Tape, TapeError};
use thiserror::Error;

/// How the receiver moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// The position is a random walk, (2) of the paper; at rest with a walk of 0.
    Walk,
    /// The velocity is a random walk, (3).
    ConstantVelocity,
}

impl Motion {
    const fn unit(self) -> &'static str {
        match self {
            Self::Walk => "m/√s",
            Self::ConstantVelocity => "m/s^1.5",
        }
    }
}

/// States that share a variance of their process noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Position, or velocity; each axis (ECEF) has its own variance.
    Motion,
    /// Zenith wet delay.
    Zenith,
    /// Gradients of the troposphere.
    Gradients,
    /// Inter-system biases.
    Biases,
    /// Slant delays of the ionosphere.
    Ionosphere,
    /// Ambiguities.
    Ambiguities,
}

impl Class {
    /// In the order of their numbers.
    pub const ALL: [Self; 6] =
        [Self::Motion, Self::Zenith, Self::Gradients, Self::Biases, Self::Ionosphere, Self::Ambiguities];

    /// For people.
    pub const fn name(self) -> &'static str {
        ["motion", "zenith delay", "gradients", "inter-system biases", "ionosphere", "ambiguities"][self as usize]
    }
}

/// The random walk of a class of states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Its standard deviation after a second `[m/√s]`, of velocities `[m/s^1.5]`.
    pub sigma: f64,
    /// How its variance is learned.
    pub learned: Process,
}

/// Standard deviations of states when they are born `[m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Priors {
    /// Position, each axis.
    pub position: f64,
    /// Velocity, each axis `[m/s]`.
    pub velocity: f64,
    /// Receiver clock, in each epoch anew.
    pub clock: f64,
    /// Inter-system biases.
    pub bias: f64,
    /// Zenith wet delay.
    pub zenith: f64,
    /// Gradients.
    pub gradient: f64,
    /// Slant delays of the ionosphere.
    pub ionosphere: f64,
    /// Ambiguities, about [`tape::Arc::prior`].
    pub ambiguity: f64,
}

/// How to smooth.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How the receiver moves.
    pub motion: Motion,
    /// Whether gradients of the troposphere are estimated.
    pub gradients: bool,
    /// The states before anything was measured.
    pub priors: Priors,
    /// Process noise of each [`Class`], in their order.
    pub walks: [Walk; 6],
    /// Standard deviations of codes and phases with which EM starts `[m]`; those of the engine by default.
    pub start: Option<[f64; 2]>,
    /// How variances of measurements are learned.
    pub measurements: Measurements,
    /// Pools of less rows are put together, see [`pools`].
    pub minimum: usize,
    /// Least standard deviations of codes and phases `[m]`.
    pub floors: [f64; 2],
    /// Least variance (spectral density) of process noise that is learned, beside 0 itself.
    pub process_floor: f64,
    /// Iterations of EM.
    pub learning: Learning,
    /// Whether R is enlarged for errors that last, and process noise learned once more with that, [`correlation`].
    pub correlated: bool,
    /// How measurements are taken in; [`Form::Sequential`] only where no state is born, see [`PppModel::form`].
    pub form: Form,
    /// Memory for filtered densities, in bytes.
    pub budget: usize,
}

impl Options {
    /// A receiver at rest: position walks by 1 mm in 30 s at first, as in the paper, and the walk is learned.
    pub fn at_rest() -> Self {
        let fixed = |sigma| Walk { sigma, learned: Process::Fixed };
        let walks = [
            Walk { sigma: 1e-3 / 30f64.sqrt(), learned: Process::Pooled },
            // 5 mm/√h.
            Walk { sigma: 5e-3 / 60.0, learned: Process::Pooled },
            fixed(1e-3 / 60.0),
            fixed(3e-6),
            fixed(8e-3),
            fixed(0.0),
        ];
        Self {
            motion: Motion::Walk,
            gradients: false,
            priors: Priors {
                position: 100.0,
                velocity: 50.0,
                clock: 100.0,
                bias: 30.0,
                zenith: 0.5,
                gradient: 0.01,
                ionosphere: 30.0,
                ambiguity: 100.0,
            },
            walks,
            start: None,
            measurements: Measurements::StudentT(5.0),
            minimum: 30,
            floors: [0.1, 1e-3],
            process_floor: 1e-20,
            learning: Learning::default(),
            correlated: false,
            form: Form::Sequential,
            budget: 512 << 20,
        }
    }

    /// A receiver that moves: velocity walks by √10 m/s^1.5 at first, as in the paper, learned within ± 5 epochs.
    pub fn moving() -> Self {
        let mut options = Self { motion: Motion::ConstantVelocity, ..Self::at_rest() };
        options.walks[Class::Motion as usize] = Walk { sigma: 10f64.sqrt(), learned: Process::Window(5) };
        options.learning.scan.clear();
        options
    }

    /// The paper's scheme: one variance for each measurement and step.
    pub fn by_epoch(mut self) -> Self {
        self.measurements = Measurements::Epoch;
        for class in [Class::Motion, Class::Zenith] {
            self.walks[class as usize].learned = Process::Epoch;
        }
        self.learning.scan.clear();
        self
    }

    /// The walk of a class.
    pub fn walk(&self, class: Class) -> Walk {
        self.walks[class as usize]
    }

    /// Whether all that is learned is a function of few parameters, so that EM can be accelerated.
    pub fn is_pooled(&self) -> bool {
        let pooled = |walk: &Walk| matches!(walk.learned, Process::Fixed | Process::Pooled);
        self.measurements.is_pooled() && self.walks.iter().all(pooled)
    }

    /// Whether the M-step maximises the likelihood itself, so that ℓ never rises.
    pub fn is_likelihood(&self) -> bool {
        self.measurements.is_likelihood() && self.walks.iter().all(|walk| walk.learned.is_likelihood())
    }
}

/// A smoothed run.
#[derive(Clone, Debug)]
pub struct Smoothed {
    /// Given all measurements, one for each epoch of the tape.
    pub states: Vec<State>,
    /// Given those up to each epoch, with the same noise.
    pub filtered: Vec<State>,
    /// The tape, linearised about the smoothed trajectory where it has its geometry.
    pub tape: Tape,
    /// Smoothed residual of each row `[m]`.
    pub residuals: Vec<f64>,
    /// R of each row in the end `[m²]`.
    pub variances: Vec<f64>,
    /// What was found out.
    pub report: Report,
}

/// Why a tape cannot be smoothed.
#[derive(Debug, Error)]
pub enum PppError {
    /// It contradicts itself.
    #[error(transparent)]
    Tape(#[from] TapeError),
    /// The first pass failed, or it was stopped.
    #[error(transparent)]
    Pass(#[from] PassError),
}

/// Smooths a tape, and learns its noise as `options` say.
pub fn smooth(tape: &Tape, options: &Options, progress: Option<&Progress>) -> Result<Smoothed, PppError> {
    tape.check()?;
    let mut passes = Passes::new(PassOptions { budget: options.budget, storage: None, progress });
    let mut model = PppModel::new(tape.clone(), options.clone());
    let start = model.noise.clone();
    let mut learned = learn::learn(&mut model, &mut passes)?;
    if options.correlated {
        learn::correlate(&mut model, &mut passes, &mut learned)?;
    }
    Ok(conclude(&model, &start, learned, &mut passes)?)
}

/// The answer of a model whose noise was learned.
pub(super) fn conclude(
    model: &PppModel,
    start: &noise::Noise,
    learned: learn::Learned,
    passes: &mut Passes<'_>,
) -> Result<Smoothed, PassError> {
    let epochs = model.tape().epochs.len();
    passes.expect(model, 2);
    passes.forward(model)?;
    let (mut states, mut filtered) = (vec![State::default(); epochs], vec![State::default(); epochs]);
    let mut residuals = vec![f64::NAN; model.tape().rows.len()];
    passes.backward(model, |epoch| {
        states[epoch.k] = answer::state(model, epoch.k, epoch.smoothed);
        filtered[epoch.k] = answer::state(model, epoch.k, epoch.filtered);
        model.each_residual(epoch.k, epoch.smoothed, |i, residual, _| residuals[i] = residual);
    })?;
    let memory = match passes.storage() {
        Some(Storage::Checkpoints { .. }) => "checkpoints",
        Some(Storage::File) => "file",
        _ => "all epochs",
    };
    let variances = (0..residuals.len()).map(|i| model.noise.row(i)).collect();
    let report = Report::new(model, start, learned, memory);
    Ok(Smoothed { states, filtered, tape: model.tape().clone(), residuals, variances, report })
}
