//! Plain and accelerated EM on pools by elevation: evaluations (a forward and a backward pass each) until ℓ is near its
//! best.

use super::super::monte_carlo;
use super::Settings;
use super::scenario::Motion;
use super::variant::start;
use crate::smooth::em::{self, EmOptions};
use crate::smooth::pass::{PassOptions, Passes};
use crate::smooth::ppp::model::PppModel;
use crate::smooth::ppp::noise::{Measurements, Process};
use crate::smooth::ppp::pools::Rule;
use crate::smooth::ppp::{Class, Options};
use indicatif::ProgressBar;

/// How near in ℓ.
pub const GAPS: [f64; 3] = [10.0, 1.0, 0.1];
/// Most evaluations.
pub const MOST: usize = 400;

/// Plain against accelerated.
#[derive(Clone, Debug, PartialEq)]
pub struct Speed {
    /// On what.
    pub motion: Motion,
    /// Evaluations to within [`GAPS`] of the best ℓ of both, plain and accelerated; none within what was allowed.
    pub evaluations: [[Option<usize>; 3]; 2],
}

impl Speed {
    /// Runs both on the first run at rest and of the drive.
    pub fn run(settings: &Settings, progress: &ProgressBar) -> Vec<Self> {
        let motions = [Motion::Rest, Motion::Drive];
        // (Of small studies: eight evaluations for each iteration that is asked for.)
        let most = MOST.min(8 * settings.iterations);
        let histories = monte_carlo::run(2 * motions.len(), progress, |job| {
            let (motion, accelerate) = (motions[job / 2], job % 2 == 1);
            let mut options = Options { measurements: Measurements::Pooled(Rule::Elevation), ..start(motion) };
            options.walks[Class::Motion as usize].learned = Process::Pooled;
            let [scene, _] = settings.scenes(motion, 0);
            let mut model = PppModel::new(scene.tape, options);
            let options = EmOptions { evaluations: most, decrease: 0.0, change: 0.0, accelerate, starts: Vec::new() };
            let report = em::learn(&mut model, &mut Passes::new(PassOptions::default()), &options);
            let history = report.map(|report| report.history).unwrap_or_default();
            history.iter().map(|step| 2.0 * step.negative_log_likelihood).collect::<Vec<f64>>()
        });
        let pairs = motions.into_iter().zip(histories.chunks(2));
        pairs
            .map(|(motion, pair)| {
                let best = pair.iter().flatten().copied().fold(f64::INFINITY, f64::min);
                let until = |history: &Vec<f64>, gap: f64| history.iter().position(|value| value - best <= gap);
                let of = |i: usize| GAPS.map(|gap| until(&pair[i], gap).map(|index| index + 1));
                Self { motion, evaluations: [of(0), of(1)] }
            })
            .collect()
    }
}
