//! Operating characteristics of the slip detectors: false alarms and detections over the threshold d.
//!
//! Both detectors are watched open loop, in one filter whose flags are as good as always right: the weighted detector at
//! d = 0.5. Beside each sampled probability stands the analytic one, 2 Q(d/σ) and Q((d − |s|)/σ) of
//! [`surefix_core::filter::slip`], with σ = 0.345 cycles for the paper's detector and 0.170 for the weighted one.

use super::super::statistics::{Estimate, Tally};
use super::trial::Snapshot;

/// Thresholds d `[cycles]`.
pub const THRESHOLDS: [f64; 10] = [0.3, 0.5, 0.6, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0];
/// σ of the paper's estimate under Table I `[cycles]`, as published with the acceptance bands.
pub const SIGMA_PROJECTION: f64 = 0.345;
/// σ of the weighted estimate under Table I `[cycles]`, likewise.
pub const SIGMA_WEIGHTED: f64 = 0.170;

/// Sums of one detector over the epochs of one run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct DetectorTally {
    square: Tally,
    false_alarms: [Tally; THRESHOLDS.len()],
    /// By threshold: slips of one cycle, of two, of any size.
    detections: [[Tally; 3]; THRESHOLDS.len()],
}

/// Sums of both detectors over the epochs of one run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurveTally {
    projection: DetectorTally,
    weighted: DetectorTally,
}

/// A detector at one threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// d `[cycles]`.
    pub threshold: f64,
    /// Probability to flag an ambiguity that did not jump.
    pub false_alarms: Estimate,
    /// Probability to flag one that jumped by one cycle, by two, by any number.
    pub detections: [Estimate; 3],
}

/// A detector.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Standard deviation of δn where nothing jumped `[cycles]`.
    pub sigma: Estimate,
    /// By threshold.
    pub points: Vec<Point>,
}

impl DetectorTally {
    fn add(&mut self, jump: i64, estimate: f64) {
        if jump == 0 {
            self.square.add(estimate * estimate);
        }
        for ((threshold, false_alarms), detections) in
            THRESHOLDS.iter().zip(&mut self.false_alarms).zip(&mut self.detections)
        {
            let flagged = estimate.abs() > *threshold;
            match jump.abs() {
                0 => false_alarms.add_case(flagged),
                1 => detections[0].add_case(flagged),
                2 => detections[1].add_case(flagged),
                _ => {}
            }
            if jump != 0 {
                detections[2].add_case(flagged);
            }
        }
    }
}

impl CurveTally {
    /// Takes in the next epoch of the run, of a filter with the weighted detector.
    pub fn add(&mut self, snapshot: &Snapshot) {
        if snapshot.transient {
            return;
        }
        for (i, &jump) in snapshot.jumps.iter().enumerate() {
            self.projection.add(jump, snapshot.projections[i]);
            self.weighted.add(jump, snapshot.slip_estimates[i]);
        }
    }
}

impl Curve {
    /// The paper's detector and the weighted one.
    pub fn of(runs: &[CurveTally]) -> [Self; 2] {
        [Self::of_one(runs, |run| &run.projection), Self::of_one(runs, |run| &run.weighted)]
    }

    fn of_one(runs: &[CurveTally], detector: fn(&CurveTally) -> &DetectorTally) -> Self {
        let runs = runs.iter().map(detector);
        let point = |(k, &threshold): (usize, &f64)| Point {
            threshold,
            false_alarms: Estimate::ratio(runs.clone().map(|run| run.false_alarms[k])),
            detections: std::array::from_fn(|size| Estimate::ratio(runs.clone().map(|run| run.detections[k][size]))),
        };
        Self {
            sigma: Estimate::ratio(runs.clone().map(|run| run.square)).sqrt(),
            points: THRESHOLDS.iter().enumerate().map(point).collect(),
        }
    }
}
