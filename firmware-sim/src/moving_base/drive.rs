//! Two vehicles, and what the filter of double differences makes of them: once with the noise it was told, once with noise
//! that follows the data.
//!
//! Nine satellites of a fixed sky besides the reference, two bands, a vector of 8 km that turns. In the second half of the
//! drive half of the satellites are three times as noisy. One satellite hides for ten epochs of 61 each. Noise comes from a
//! linear congruential generator.
//!
//! This file needs nothing but the core and `random.rs`: the test that compares host and target includes both too.

use crate::random::Noise;
use heapless::Vec;
use nalgebra::Vector3;
use surefix_core::filter::double_difference::{
    Adaptation, Answer, DoubleDifference22, DoubleDifferenceError, Options, Sight,
};
use surefix_core::real::Real;

/// Epochs of the drive.
pub const EPOCHS: u32 = 120;
/// Satellites, the reference included.
const SATELLITES: usize = 10;
/// Standard deviations of code and phase, of one receiver `[m]`.
const SIGMAS: [f64; 2] = [0.3, 0.004];
/// Variances of position and velocity at the start.
const START: [f64; 6] = [25.0, 25.0, 25.0, 4.0, 4.0, 4.0];

/// Which filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Noise as configured.
    Plain,
    /// Noise that follows the data.
    Adaptive,
}

impl Kind {
    const fn options(self) -> Options {
        match self {
            Self::Plain => Options { adaptation: Adaptation::Off, ..Options::RECOMMENDED },
            Self::Adaptive => Options { warm_up: 10, ..Options::RECOMMENDED },
        }
    }
}

/// The drive and one filter; for a `static`.
pub struct Drive<T> {
    filter: DoubleDifference22<T>,
    noise: Noise,
    ambiguities: [[f64; 2]; SATELLITES],
    epoch: u32,
}

/// The vector between the vehicles at an epoch, and its velocity, ENU `[m]`, `[m/s]`.
pub fn vector(epoch: u32) -> (Vector3<f64>, Vector3<f64>) {
    let angle = 0.002 * f64::from(epoch);
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    (Vector3::new(8000.0 * sin, 8000.0 * cos, 20.0), Vector3::new(16.0 * cos, -16.0 * sin, 0.0))
}

/// The direction to a satellite, and the sine of its elevation.
fn sky(satellite: usize) -> Vector3<f64> {
    let (azimuth, elevation) = (2.4 * satellite as f64, 1.3 - 0.11 * satellite as f64);
    let plane = libm::cos(elevation);
    Vector3::new(plane * libm::sin(azimuth), plane * libm::cos(azimuth), libm::sin(elevation))
}

/// Whether a satellite is in view; the first one always is.
fn in_view(satellite: usize, epoch: u32) -> bool {
    satellite == 0 || (epoch as usize + 13 * satellite) % 61 >= 10
}

impl<T: Real> Drive<T> {
    /// At its start.
    pub const fn new(kind: Kind) -> Self {
        Self {
            filter: DoubleDifference22::new(kind.options()),
            noise: Noise::new(2022),
            ambiguities: [[0.0; 2]; SATELLITES],
            epoch: 0,
        }
    }

    /// What both receivers have in the next epoch.
    pub fn observe(&mut self) -> Vec<Sight, SATELLITES> {
        let (epoch, mut sights) = (self.epoch, Vec::new());
        let (r, _) = vector(epoch);
        for satellite in 0..SATELLITES {
            let to = sky(satellite);
            let new_lock = epoch == 0 || (in_view(satellite, epoch) && !in_view(satellite, epoch - 1));
            let worse = if epoch > EPOCHS / 2 && satellite % 2 == 1 { 3.0 } else { 1.0 };
            let draws: [f64; 4] = core::array::from_fn(|_| self.noise.normal() - self.noise.normal());
            let cycles: [f64; 2] = core::array::from_fn(|_| self.noise.cycles());
            if let (Some(own), true) = (self.ambiguities.get_mut(satellite), new_lock) {
                *own = cycles;
            }
            if !in_view(satellite, epoch) {
                continue;
            }
            let s = to * 2.2e7;
            let apart = s - r;
            let range = (r - s * 2.0).dot(&r) / (libm::sqrt(apart.dot(&apart)) + libm::sqrt(s.dot(&s)));
            let [code, phase] = SIGMAS.map(|sigma| worse * sigma);
            let own = self.ambiguities.get(satellite).copied().unwrap_or_default();
            let [first, second] = Options::PAPER.wavelengths;
            let _ = sights.push(Sight {
                id: satellite as u8,
                position: s,
                sin_elevation: to.z,
                code: [range + code * draws[0], range + code * draws[1]],
                phase: [range + first * own[0] + phase * draws[2], range + second * own[1] + phase * draws[3]],
                new_lock,
            });
        }
        sights
    }

    /// The filter's epoch.
    pub fn advance(&mut self, sights: &[Sight]) -> Result<Answer, DoubleDifferenceError> {
        if self.epoch == 0 {
            let (r, v) = vector(0);
            self.filter.start(&[r.x + 3.0, r.y - 2.0, r.z + 4.0, v.x + 1.0, v.y, v.z - 1.0], &START)?;
        }
        self.epoch += 1;
        self.filter.step(1.0, sights, None)
    }
}

/// Gives `sink` an answer as bytes: position, variances, levels, number of fixed ambiguities, as `f64`, little endian.
pub fn write<E>(answer: &Answer, mut sink: impl FnMut(&[u8]) -> Result<(), E>) -> Result<(), E> {
    let levels = answer.levels.map_or([0.0; 2], |levels| [levels.horizontal, levels.vertical]);
    let numbers = answer.position.iter().copied().chain((0..3).map(|i| answer.covariance[(i, i)]));
    let mut all = numbers.chain(levels).chain([answer.fixed as f64, answer.failure]);
    all.try_for_each(|number| sink(&number.to_le_bytes()))
}
