//! What the runs of a filter come to.

use super::super::statistics::{Estimate, Tally};
use super::trial::{Run, Sample};
use nalgebra::Vector3;

/// Numbers of a filter under one kind of noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Runs.
    pub runs: usize,
    /// Mean of |mean error| over runs and components `[m]`, the "mean" of Table 3.
    pub mean: f64,
    /// Mean of the standard deviations of components over runs `[m]`.
    pub deviation: f64,
    /// rms of the three-dimensional error `[m]`.
    pub rms: f64,
    /// Share of epochs with a fixed answer.
    pub fixed: Estimate,
    /// Share of wrong ones among them.
    pub wrong: Estimate,
    /// Share of epochs whose error exceeds its level, horizontal and vertical.
    pub beyond: [Estimate; 2],
    /// Median of HPL and VPL `[m]`.
    pub levels: [f64; 2],
    /// Epochs refused, and with an indefinite R*, of all runs.
    pub refused: usize,
    /// See there.
    pub indefinite: usize,
}

fn samples(runs: &[Run]) -> impl Iterator<Item = &Sample> {
    runs.iter().flat_map(|run| &run.samples)
}

fn share(runs: &[Run], of: impl Fn(&Sample) -> Option<bool>) -> Estimate {
    let tally = |run: &Run| {
        let mut tally = Tally::default();
        run.samples.iter().filter_map(&of).for_each(|case| tally.add_case(case));
        tally
    };
    Estimate::ratio(runs.iter().map(tally).collect::<Vec<_>>().into_iter())
}

/// Mean and standard deviation of each component of a run's errors.
pub fn components(run: &Run) -> (Vector3<f64>, Vector3<f64>) {
    let n = run.samples.len().max(1) as f64;
    let mean = run.samples.iter().map(|sample| sample.error).sum::<Vector3<f64>>() / n;
    let square = |sample: &Sample| (sample.error - mean).map(|x| x * x);
    let variance = run.samples.iter().map(square).sum::<Vector3<f64>>() / n;
    (mean, variance.map(f64::sqrt))
}

impl Outcome {
    /// Of runs of one filter.
    pub fn of(runs: &[Run]) -> Self {
        let count = (3 * runs.len()) as f64;
        let parts: Vec<_> = runs.iter().map(components).collect();
        let squares = Estimate::ratio(runs.iter().map(|run| {
            let mut tally = Tally::default();
            run.samples.iter().for_each(|sample| tally.add(sample.error.norm_squared()));
            tally
        }));
        let median = |k: usize| {
            let mut levels: Vec<f64> = samples(runs).map(|sample| sample.levels[k]).filter(|l| l.is_finite()).collect();
            levels.sort_by(f64::total_cmp);
            levels.get(levels.len() / 2).copied().unwrap_or(f64::NAN)
        };
        Self {
            runs: runs.len(),
            mean: parts.iter().map(|(mean, _)| mean.abs().sum()).sum::<f64>() / count,
            deviation: parts.iter().map(|(_, deviation)| deviation.sum()).sum::<f64>() / count,
            rms: squares.value.sqrt(),
            fixed: share(runs, |sample| Some(sample.fixed)),
            wrong: share(runs, |sample| sample.fixed.then_some(sample.wrong)),
            beyond: [0, 1].map(|k| share(runs, |sample| Some(sample.beyond()[k]))),
            levels: [median(0), median(1)],
            refused: runs.iter().map(|run| run.refused).sum(),
            indefinite: runs.iter().map(|run| run.indefinite).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(error: [f64; 3], level: f64, fixed: bool, wrong: bool) -> Sample {
        Sample { error: Vector3::from(error), levels: [level; 2], fixed, wrong, success: 1.0 }
    }

    /// Errors (3, 4, 1) and (−3, −4, 1): means 0, 0, 1; deviations 3, 4, 0; rms √26. Level 2: both beyond in the plane.
    #[test]
    fn by_hand() {
        let samples = vec![sample([3.0, 4.0, 1.0], 2.0, true, true), sample([-3.0, -4.0, 1.0], 2.0, false, false)];
        let run = Run { samples, refused: 1, indefinite: 2, first_refused: None };
        let outcome = Outcome::of(&[run]);
        assert_eq!((outcome.mean, outcome.deviation), (1.0 / 3.0, 7.0 / 3.0));
        assert!((outcome.rms - 26f64.sqrt()).abs() < 1e-12);
        assert_eq!((outcome.fixed.value, outcome.wrong.value), (0.5, 1.0));
        assert_eq!((outcome.beyond[0].value, outcome.beyond[1].value), (1.0, 0.0));
        assert_eq!((outcome.refused, outcome.indefinite, outcome.levels[1]), (1, 2, 2.0));
    }
}
