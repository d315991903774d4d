//! Streets between buildings: when, and what they hide.
//!
//! A stretch has buildings on either side, one after the other, each with the elevation M of its roof across the street.
//! In the direction δ from the street's, a long wall of that height hides what is below
//! ```text
//! atan(tan M · |sin δ|)
//! ```
//! which is M across the street and nothing along it.

use super::scenario::Scenario;
use crate::study::monte_carlo::stream;
use rand::Rng;

/// Streams of random numbers below this belong to stretches.
pub const STRETCHES: u64 = 1 << 16;

/// A stretch of time between buildings.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// When it begins, after the first epoch `[s]`.
    pub begin: f64,
    /// When it ends `[s]`.
    pub end: f64,
    /// Factor on the amplitude of reflections.
    pub severity: f64,
    /// Excess path of reflections `[m]`.
    pub delay: f64,
    /// Buildings to the left and to the right, in order of time.
    sides: [Vec<Building>; 2],
}

/// A building, or a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Building {
    /// When it is passed `[s]`.
    end: f64,
    /// tan M; 0 for a gap.
    slope: f64,
}

impl Stretch {
    /// Elevation `[rad]` below which all is hidden in the direction `azimuth` `[rad]`, `seconds` after the first epoch, in
    /// a street that leads to the azimuth `street` `[rad]`.
    pub fn mask(&self, seconds: f64, azimuth: f64, street: f64) -> f64 {
        let across = (azimuth - street).sin();
        let side = &self.sides[usize::from(across > 0.0)];
        let slope = side.iter().find(|building| seconds < building.end).map_or(0.0, |building| building.slope);
        (slope * across.abs()).atan()
    }
}

/// All stretches that begin within `length` `[s]` of the first epoch, in order.
pub fn stretches(scenario: &Scenario, length: f64) -> Vec<Stretch> {
    let canyons = &scenario.canyons;
    (0..STRETCHES)
        .map(|k| (k, canyons.start_s + k as f64 * canyons.period_s))
        .take_while(|&(_, begin)| begin <= length)
        .map(|(k, begin)| stretch(scenario, k, begin))
        .collect()
}

/// The stretch with the number `k`.
fn stretch(scenario: &Scenario, k: u64, begin: f64) -> Stretch {
    let (canyons, reflections) = (&scenario.canyons, &scenario.reflections);
    let mut rng = stream(scenario.seed, k);
    let mut draw = |[least, greatest]: [f64; 2]| rng.random_range(least..=greatest);
    let end = begin + draw(canyons.duration_s);
    let (severity, delay) = (draw(reflections.severity), draw(reflections.delay_m));
    let sides = std::array::from_fn(|_| {
        let (mut buildings, mut passed) = (Vec::new(), begin);
        while passed < end {
            passed += draw(canyons.building_s);
            let (roof, missing) = (draw(canyons.mask_deg), draw([0.0, 1.0]) < canyons.gap);
            buildings.push(Building { end: passed, slope: if missing { 0.0 } else { roof.to_radians().tan() } });
        }
        buildings
    });
    Stretch { begin, end, severity, delay, sides }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn stretches_are_as_configured_and_a_longer_run_only_adds() {
        let scenario = Scenario::default();
        let all = stretches(&scenario, 3000.0);
        assert_eq!(all.len(), 10); // 120, 420, …, 2820 s
        for (k, stretch) in all.iter().enumerate() {
            assert_eq!(stretch.begin, 120.0 + 300.0 * k as f64);
            assert!((60.0..=120.0).contains(&(stretch.end - stretch.begin)));
            assert!((0.5..=1.5).contains(&stretch.severity) && (5.0..=20.0).contains(&stretch.delay));
            assert!(stretch.sides.iter().all(|side| side.last().unwrap().end >= stretch.end));
        }
        assert_eq!(stretches(&scenario, 500.0), all[..2]);
        assert_ne!(stretches(&Scenario { seed: 2, ..scenario }, 500.0), all[..2]);
    }

    proptest! {
        /// Across the street a roof hides what the configuration says, along it nothing; in between, less.
        #[test]
        fn masks_lie_between_those_along_and_across(seed: u64, after in 0.0..60.0, street in 0.0..2.0 * PI, turn in 0.0..PI) {
            let mut scenario = Scenario { seed, ..Scenario::default() };
            scenario.canyons.gap = 0.0;
            let stretch = &stretches(&scenario, 120.0)[0];
            let seconds = stretch.begin + after;
            prop_assert!(stretch.mask(seconds, street, street) < 1e-9);
            let right = stretch.mask(seconds, street + FRAC_PI_2, street).to_degrees();
            prop_assert!((35.0 - 1e-9..=60.0 + 1e-9).contains(&right), "{right}");
            prop_assert!(stretch.mask(seconds, street + turn, street) <= right.to_radians() + 1e-9);
        }
    }
}
