//! Means over runs, and the recommended scheme as it is used.

use super::super::statistics::{Estimate, Tally};
use super::scenario::{Motion, Scene};
use super::trial::{self, LOOKS, Look, Trial};
use super::variant::start;
use crate::smooth::pass::{PassOptions, Passes};
use crate::smooth::ppp::Options;
use crate::smooth::ppp::learn::{self, Learning, Status};
use crate::smooth::ppp::model::PppModel;
use crate::smooth::ppp::tape::Tape;

/// The recommended scheme, with its scan and its acceleration.
#[derive(Clone, Debug, PartialEq)]
pub struct Recommended {
    /// What it came to.
    pub look: Look,
    /// The walk that the scan took `[m]`.
    pub taken: Option<f64>,
    /// How it ended.
    pub status: Status,
    /// Forward and backward passes.
    pub passes: [usize; 2],
}

impl Recommended {
    /// Runs it; none if it fails.
    pub fn run(scene: &Scene, other: &Tape, motion: Motion) -> Option<Self> {
        let learning = match motion {
            Motion::Rest => Learning::default(),
            Motion::Drive => Learning { scan: Vec::new(), ..Learning::default() },
        };
        let options = Options { learning, ..start(motion) };
        let mut model = PppModel::new(scene.tape.clone(), options);
        let mut passes = Passes::new(PassOptions::default());
        let learned = learn::learn(&mut model, &mut passes).ok()?;
        passes.forward(&model).ok()?;
        let look = trial::look(&model, &mut passes, scene, other, motion).ok()?;
        let taken = learned.scan.and_then(|scan| scan.taken);
        Some(Self { look, taken, status: learned.status, passes: learned.passes })
    }
}

/// The mean of a number over runs, with its standard error; NaN of no runs.
pub fn mean(numbers: impl Iterator<Item = f64> + Clone) -> Estimate {
    Estimate::ratio(numbers.map(|number| Tally { sum: number, count: 1.0 }))
}

/// The mean over the runs that came as far as a look, and how many did.
pub fn at(trials: &[Trial], iterations: usize, number: impl Fn(&Look) -> f64) -> (Estimate, usize) {
    let place = LOOKS.iter().position(|look| *look == iterations);
    let looks = trials.iter().filter_map(|trial| trial.looks.get(place?)?.as_ref());
    let numbers: Vec<f64> = looks.map(number).collect();
    (mean(numbers.iter().copied()), numbers.len())
}

/// The greatest rise of ℓ from one iteration to the next.
pub fn rise(trials: &[Trial]) -> f64 {
    let rises = trials.iter().flat_map(|trial| trial.likelihoods.windows(2).map(|pair| pair[1] - pair[0]));
    rises.fold(f64::NEG_INFINITY, f64::max)
}
