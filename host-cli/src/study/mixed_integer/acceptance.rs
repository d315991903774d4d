//! Acceptance: the numbers that Section V must give, with their bands.
//!
//! The bands are those of an independent implementation of the same choices (see [`super::scenario`]), 60 runs of 300
//! epochs without the first 20. With fewer runs a number may leave its band by chance.

use super::super::statistics::Estimate;
use super::outcome::Outcome;

/// A number and where it must lie.
#[derive(Clone, Copy, Debug)]
pub struct Band {
    /// What it is.
    pub quantity: &'static str,
    /// Its unit, empty where it has none.
    pub unit: &'static str,
    /// Smallest value that is accepted.
    pub low: f64,
    /// Largest value that is accepted.
    pub high: f64,
    /// The number, in that unit.
    pub of: fn(&Outcome) -> Estimate,
}

/// All of them.
pub const BANDS: [Band; 7] = [
    Band { quantity: "all integers right", unit: "", low: 0.994, high: 0.998, of: |outcome| outcome.right },
    Band {
        quantity: "RMSE constrained",
        unit: "cm",
        low: 1.45,
        high: 1.70,
        of: |outcome| outcome.constrained.rmse.scale(100.0),
    },
    Band {
        quantity: "RMSE relaxed",
        unit: "cm",
        low: 7.0,
        high: 10.0,
        of: |outcome| outcome.relaxed.rmse.scale(100.0),
    },
    Band { quantity: "NEES constrained", unit: "", low: 2.9, high: 3.5, of: |outcome| outcome.constrained.nees },
    Band { quantity: "NEES relaxed", unit: "", low: 1.8, high: 2.6, of: |outcome| outcome.relaxed.nees },
    Band { quantity: "false alarms", unit: "", low: 0.003, high: 0.005, of: |outcome| outcome.false_alarms },
    Band { quantity: "detections, any size", unit: "", low: 0.92, high: 0.96, of: |outcome| outcome.detections },
];

impl Band {
    /// Whether a value lies in the band; NaN does not.
    pub fn accepts(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// How many numbers lie outside their bands.
pub fn missed(outcome: &Outcome) -> usize {
    BANDS.iter().filter(|band| !band.accepts((band.of)(outcome).value)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_closed_and_nothing_else_passes() {
        for band in &BANDS {
            assert!(band.low < band.high && band.accepts(band.low) && band.accepts(band.high), "{}", band.quantity);
            assert!(!band.accepts(band.low - 1e-6) && !band.accepts(band.high + 1e-6) && !band.accepts(f64::NAN));
        }
    }

    #[test]
    fn no_runs_are_not_accepted() {
        assert_eq!(missed(&Outcome::of(&[])), BANDS.len());
    }
}
