//! What the runs of a configuration come to.

use super::super::statistics::{Estimate, Tally};
use super::trial::Snapshot;
use surefix_core::stats::chi_square;

/// Sums over the epochs of one run after the transient.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunTally {
    right: Tally,
    single: Tally,
    relaxed: PositionTally,
    constrained: PositionTally,
    false_alarms: Tally,
    detections: Tally,
    refused: usize,
}

/// Sums over one density.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct PositionTally {
    square: Tally,
    nees: Tally,
    inside: Tally,
    largest: f64,
}

/// Numbers of one density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionOutcome {
    /// Root mean square of the error, 3-D `[m]`.
    pub rmse: Estimate,
    /// Mean normalised error squared, expected 3.
    pub nees: Estimate,
    /// Fraction of epochs within the 95 % ellipsoid.
    pub inside: Estimate,
    /// Largest error `[m]`.
    pub largest: f64,
}

/// Numbers of a configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Fraction of epochs with all integers right.
    pub right: Estimate,
    /// Of the epochs that are not, the fraction with a single wrong integer.
    pub single: Estimate,
    /// Relaxed density.
    pub relaxed: PositionOutcome,
    /// Constrained density.
    pub constrained: PositionOutcome,
    /// Fraction of ambiguities flagged among those that did not jump.
    pub false_alarms: Estimate,
    /// Fraction of ambiguities flagged among those that jumped, by whatever size.
    pub detections: Estimate,
    /// Epochs refused by the filter.
    pub refused: usize,
}

impl RunTally {
    /// Takes in the next epoch of the run.
    pub fn add(&mut self, snapshot: &Snapshot) {
        self.refused += usize::from(snapshot.refused);
        if snapshot.transient {
            return;
        }
        let wrong = snapshot.wrong();
        self.right.add_case(wrong == 0);
        if wrong > 0 {
            self.single.add_case(wrong == 1);
        }
        for (tally, position) in
            [(&mut self.relaxed, &snapshot.relaxed), (&mut self.constrained, &snapshot.constrained)]
        {
            let nees = position.nees();
            tally.square.add(position.error.norm_squared());
            tally.nees.add(nees);
            tally.inside.add_case(nees <= chi_square::quantile(0.95, 3));
            tally.largest = tally.largest.max(position.error.norm());
        }
        for (&jump, &flag) in snapshot.jumps.iter().zip(&snapshot.flags) {
            if jump == 0 { &mut self.false_alarms } else { &mut self.detections }.add_case(flag);
        }
    }
}

impl Outcome {
    /// Of all runs.
    pub fn of(runs: &[RunTally]) -> Self {
        let ratio = |tally: fn(&RunTally) -> Tally| Estimate::ratio(runs.iter().map(tally));
        Self {
            right: ratio(|run| run.right),
            single: ratio(|run| run.single),
            relaxed: PositionOutcome::of(runs.iter().map(|run| run.relaxed)),
            constrained: PositionOutcome::of(runs.iter().map(|run| run.constrained)),
            false_alarms: ratio(|run| run.false_alarms),
            detections: ratio(|run| run.detections),
            refused: runs.iter().map(|run| run.refused).sum(),
        }
    }
}

impl PositionOutcome {
    fn of(runs: impl Iterator<Item = PositionTally> + Clone) -> Self {
        Self {
            rmse: Estimate::ratio(runs.clone().map(|run| run.square)).sqrt(),
            nees: Estimate::ratio(runs.clone().map(|run| run.nees)),
            inside: Estimate::ratio(runs.clone().map(|run| run.inside)),
            largest: runs.map(|run| run.largest).fold(0.0, f64::max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scenario::AMBIGUITIES;
    use super::super::trial::Position;
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn snapshot(transient: bool, error: f64, wrong: usize) -> Snapshot {
        let position = Position { error: Vector3::new(error, 0.0, 0.0), covariance: Matrix3::identity() };
        Snapshot {
            time: 0.0,
            relaxed: Position { error: 2.0 * position.error, ..position },
            constrained: position,
            float_errors: [0.0; AMBIGUITIES],
            integer_errors: std::array::from_fn(|i| i64::from(i < wrong)),
            jumps: std::array::from_fn(|i| i64::from(i == 0)),
            flags: std::array::from_fn(|i| i < 2),
            slip_estimates: [0.0; AMBIGUITIES],
            projections: [0.0; AMBIGUITIES],
            transient,
            refused: false,
        }
    }

    /// Two runs after a transient that would spoil everything; expectations by hand.
    #[test]
    fn numbers_are_those_of_the_epochs_after_the_transient() {
        let run = |epochs: &[(f64, usize)]| {
            let mut tally = RunTally::default();
            tally.add(&snapshot(true, 1e6, 12));
            epochs.iter().for_each(|&(error, wrong)| tally.add(&snapshot(false, error, wrong)));
            tally
        };
        let outcome = Outcome::of(&[run(&[(3.0, 0), (1.0, 1)]), run(&[(1.0, 0), (1.0, 2)])]);
        assert_eq!((outcome.right.value, outcome.single.value), (0.5, 0.5));
        assert_eq!((outcome.constrained.rmse.value, outcome.relaxed.rmse.value), (3.0_f64.sqrt(), 12.0_f64.sqrt()));
        assert_eq!((outcome.constrained.nees.value, outcome.constrained.largest), (3.0, 3.0));
        // χ²₃ has its 95 % quantile at 7.815.
        assert_eq!((outcome.constrained.inside.value, outcome.relaxed.inside.value), (0.75, 0.75));
        assert_eq!((outcome.false_alarms.value, outcome.detections.value), (1.0 / 11.0, 1.0));
    }
}
