//! One filter on one run.

use super::scenario::{Record, START, TRANSIENT};
use super::variant::Variant;
use nalgebra::Vector3;
use surefix_core::filter::double_difference::{DoubleDifference22, WholeNoise};
use surefix_core::integrity::protection::Basis;

/// What an epoch came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Error, east, north, up `[m]`.
    pub error: Vector3<f64>,
    /// HPL and VPL `[m]`; NaN without.
    pub levels: [f64; 2],
    /// The answer is a fixed one.
    pub fixed: bool,
    /// It is, and one of its integers is wrong.
    pub wrong: bool,
    /// Success rate of all ambiguities.
    pub success: f64,
}

impl Sample {
    /// Whether the horizontal, and the vertical error exceeds its level; without a level it does.
    pub fn beyond(&self) -> [bool; 2] {
        let errors = [self.error.xy().norm(), self.error.z.abs()];
        [0, 1].map(|k| errors[k].partial_cmp(&self.levels[k]).is_none_or(std::cmp::Ordering::is_gt))
    }
}

/// A run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// All epochs but the first [`TRANSIENT`].
    pub samples: Vec<Sample>,
    /// Epochs that the filter refused; it was started anew then.
    pub refused: usize,
    /// Epochs whose R* was not positive definite.
    pub indefinite: usize,
    /// The first epoch that was refused.
    pub first_refused: Option<usize>,
}

/// Runs a filter.
pub fn run(variant: &Variant, record: &Record) -> Run {
    let mut filter = Box::new(DoubleDifference22::<f64>::new(variant.options));
    let mut whole = Box::new(WholeNoise::new());
    let mut run = Run { samples: Vec::new(), refused: 0, indefinite: 0, first_refused: None };
    let mut started = filter.start(&record.start, &START).is_ok();
    for (k, epoch) in record.epochs.iter().enumerate() {
        if !started {
            // Where the state before was given up: from the truth, off as much as at the start.
            let off = |i: usize| record.start[i] - truth(&record.epochs[0], i);
            let state = std::array::from_fn(|i| truth(epoch, i) + off(i));
            started = filter.start(&state, &START).is_ok();
            *whole = WholeNoise::new();
        }
        let with = variant.is_whole().then_some(&mut *whole);
        let Ok(answer) = filter.step(1.0, &epoch.sights, with) else {
            run.refused += 1;
            run.first_refused.get_or_insert(k);
            started = false;
            continue;
        };
        let with = variant.is_whole().then_some(&*whole);
        run.indefinite += usize::from(!filter.noise_is_positive_definite(with));
        if k < TRANSIENT {
            continue;
        }
        let fixed = answer.basis != Basis::Float;
        run.samples.push(Sample {
            error: answer.position - epoch.position,
            levels: answer.levels.map_or([f64::NAN; 2], |levels| [levels.horizontal, levels.vertical]),
            fixed,
            wrong: fixed && !integers_are_right(&filter, &epoch.ambiguities),
            success: answer.full_success,
        });
    }
    run
}

/// Whether all integers of the latest epoch are those of the satellites' ambiguities, by number, on both bands.
pub fn integers_are_right(filter: &DoubleDifference22<f64>, ambiguities: &[[i64; 2]]) -> bool {
    let reference = filter.reference().map_or(0, usize::from);
    let satellites = filter.satellites();
    filter.integers().all(|(index, value)| {
        let (band, satellite) = (index / satellites.len(), usize::from(satellites[index % satellites.len()]));
        value == ambiguities[satellite][band] - ambiguities[reference][band]
    })
}

/// Position and velocity of an epoch.
fn truth(epoch: &super::scenario::Epoch, i: usize) -> f64 {
    if i < 3 { epoch.position[i] } else { epoch.velocity[i - 3] }
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::super::noise::Noise;
    use super::super::variant::{RECOMMENDED, VARIANTS};
    use super::*;
    use surefix_core::filter::double_difference::Options;

    /// With noise as the filter has it nearly every epoch is fixed and right, and within its levels.
    #[test]
    fn right_noise_gives_right_answers() {
        let record = Record::draw(Noise::Constant, 400, &mut stream(5, 0));
        for variant in VARIANTS.iter().filter(|variant| ["KF", RECOMMENDED].contains(&variant.name)) {
            let run = run(variant, &record);
            assert_eq!((run.samples.len(), run.refused, run.indefinite), (340, 0, 0), "{}", variant.name);
            let count = |of: &dyn Fn(&Sample) -> bool| run.samples.iter().filter(|sample| of(sample)).count();
            assert!(count(&|s| s.fixed) > 320 && count(&|s| s.wrong) == 0, "{}", variant.name);
            assert_eq!(count(&|s| s.beyond()[0] || s.beyond()[1]), 0);
        }
    }

    /// Eq. (25) as printed, without a guard, ends at the first epoch that it is used in.
    #[test]
    fn the_literal_form_without_a_floor_is_an_error() {
        let variant = VARIANTS.iter().find(|variant| variant.name == "AKF literal, floor").unwrap();
        let options = Options { bounds: None, ..variant.options };
        let record = Record::draw(Noise::Constant, 60, &mut stream(5, 1));
        let run = run(&Variant { options, ..*variant }, &record);
        assert_eq!(run.first_refused, Some(30));
    }
}
