//! One scheme on one run: plain EM, looked at after some iterations.

use super::scenario::{Motion, Scene};
use crate::smooth::pass::{PassError, PassOptions, Passes};
use crate::smooth::ppp::answer;
use crate::smooth::ppp::held_out::density;
use crate::smooth::ppp::learn::{self, likelihood};
use crate::smooth::ppp::model::PppModel;
use crate::smooth::ppp::noise::Measurements;
use crate::smooth::ppp::tape::Tape;
use crate::smooth::ppp::{Class, Options};
use nalgebra::Vector3;

/// Iterations after which a scheme is looked at.
pub const LOOKS: [usize; 4] = [0, 5, 10, 50];

/// What a scheme has come to after so many iterations.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Root mean square of the filter's errors in the second half, three axes together `[m]`.
    pub filter: f64,
    /// Of the smoother's errors in all epochs.
    pub smoother: f64,
    /// Mean of the smoother's normalised squared errors: 3 if its covariances are right.
    pub nees: f64,
    /// Mean standard deviation of the motion's walk: from epoch to epoch `[m]` at rest, `[m/s^1.5]` moving.
    pub walk: f64,
    /// ℓ for each measurement of other noise on the same truth.
    pub held_out: f64,
    /// The last 20 epochs of the filter: root mean square of errors north, east, up `[m]`.
    pub end: Vector3<f64>,
    /// Smoothed position of the last epoch `[m]`.
    pub last: Vector3<f64>,
    /// Walk of each step, mean of the axes; one number where it is pooled.
    pub walks: Vec<f64>,
}

/// What became of a scheme.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// By [`LOOKS`]; none after it failed.
    pub looks: Vec<Option<Look>>,
    /// ℓ of each iteration.
    pub likelihoods: Vec<f64>,
    /// In which iteration it failed.
    pub failed: Option<usize>,
}

/// Runs a scheme for as many iterations as there are looks to take; `other` has other noise on the same truth.
pub fn run(scene: &Scene, other: &Tape, motion: Motion, options: &Options, iterations: usize) -> Trial {
    let mut model = PppModel::new(scene.tape.clone(), options.clone());
    let mut passes = Passes::new(PassOptions::default());
    let mut trial = Trial { looks: Vec::new(), likelihoods: Vec::new(), failed: None };
    for iteration in 0..=iterations {
        if let Err(_error) = iterate(&mut model, &mut passes, scene, other, motion, iteration, &mut trial) {
            trial.failed = Some(iteration);
            break;
        }
    }
    let wanted = LOOKS.iter().filter(|look| **look <= iterations).count();
    trial.looks.resize(wanted, None);
    trial
}

fn iterate(
    model: &mut PppModel,
    passes: &mut Passes<'_>,
    scene: &Scene,
    other: &Tape,
    motion: Motion,
    iteration: usize,
    trial: &mut Trial,
) -> Result<(), PassError> {
    trial.likelihoods.push(likelihood(&passes.forward(model)?));
    if LOOKS.contains(&iteration) {
        let look = look(model, passes, scene, other, motion)?;
        trial.looks.push(Some(look));
    }
    let expectation = learn::expect(model, passes)?;
    learn::maximize(model, &expectation);
    Ok(())
}

/// Looks at a model after a forward pass.
pub fn look(
    model: &PppModel,
    passes: &mut Passes<'_>,
    scene: &Scene,
    other: &Tape,
    motion: Motion,
) -> Result<Look, PassError> {
    let epochs = scene.truth.len();
    let [mut filter, mut smoother, mut nees] = [0.0; 3];
    let (mut end, mut last) = (Vector3::zeros(), Vector3::zeros());
    passes.backward(model, |epoch| {
        let (k, truth) = (epoch.k, scene.truth[epoch.k]);
        let filtered = answer::state(model, k, epoch.filtered).position - truth;
        let smoothed = answer::state(model, k, epoch.smoothed);
        let error = smoothed.position - truth;
        if 2 * k >= epochs {
            filter += filtered.norm_squared();
        }
        if k + 20 >= epochs {
            end += filtered.component_mul(&filtered);
        }
        if k + 1 == epochs {
            last = smoothed.position;
        }
        smoother += error.norm_squared();
        nees += smoothed.covariance.try_inverse().map_or(f64::NAN, |inverse| error.dot(&(inverse * error)));
    })?;
    let axes = answer::walks(model, Class::Motion);
    let steps = axes.iter().map(Vec::len).max().unwrap_or(0);
    let scale = if motion == Motion::Rest { motion.interval().sqrt() } else { 1.0 };
    let mean = |step: usize| scale * axes.iter().filter_map(|axis| axis.get(step)).sum::<f64>() / axes.len() as f64;
    let walks: Vec<f64> = (0..steps).map(mean).collect();
    Ok(Look {
        filter: (filter / (epochs - epochs / 2) as f64).sqrt(),
        smoother: (smoother / epochs as f64).sqrt(),
        nees: nees / epochs as f64,
        walk: walks.iter().sum::<f64>() / steps.max(1) as f64,
        held_out: predict(model, other),
        end: (end / epochs.min(20) as f64).map(f64::sqrt),
        last,
        walks,
    })
}

/// ℓ for each measurement of other noise; of Student-t errors by their density and without weights, which belong to the errors
/// that they were learned from. Infinite where the filter fails.
fn predict(model: &PppModel, other: &Tape) -> f64 {
    let mut model = { PppModel::new(other.clone(), model.options().clone()).with_noise(model.noise.clone()) };
    let measurements = model.options().measurements;
    if matches!(measurements, Measurements::StudentT(_)) {
        model.noise.trust_all();
    }
    let Ok(fit) = Passes::new(PassOptions::default()).forward(&model) else { return f64::INFINITY };
    let sum = match measurements {
        Measurements::StudentT(_) => {
            let determinants: f64 = fit.gauges.iter().map(|gauge| gauge.log_determinant).sum();
            let squares = model.innovations();
            determinants + squares.iter().map(|square| density(measurements, square.sqrt(), 1.0)).sum::<f64>()
        }
        _ => likelihood(&fit),
    };
    sum / model.observations().max(1) as f64
}

/// ℓ for each measurement of a run under the variances that it was drawn with, the walk of the position 0 or as it was.
pub fn truth(scene: &Scene, options: &Options) -> f64 {
    let mut options = Options { measurements: Measurements::Fixed, ..options.clone() };
    options.walks[Class::Zenith as usize].sigma = super::scenario::ZENITH;
    if options.motion == crate::smooth::ppp::Motion::Walk {
        options.walks[Class::Motion as usize].sigma = 0.0;
    }
    let mut model = PppModel::new(scene.tape.clone(), options);
    model.noise.set_rows(&scene.variances);
    let fit = Passes::new(PassOptions::default()).forward(&model);
    fit.map_or(f64::NAN, |fit| likelihood(&fit) / model.observations() as f64)
}
