//! Two vehicles under trees, after the dynamic experiment of L. Wang et al. (2022).
//!
//! The paper's data are not public; this is what it says of them, and what it leaves open is chosen:
//!
//! | item | choice |
//! |---|---|
//! | epochs | 2164 of 1 s, as in its Tables 3 and 4; the first 60 do not count |
//! | satellites | six planes of five at the radius of GPS and 55°, elevation mask 10°, two bands, eight to twelve in sight as in the paper: runs begin when that is so until their end |
//! | vehicles | baseline 6 to 13 km, relative speeds up to 20 m/s, relative accelerations up to 0.2 m/s² |
//! | trees | 600 to 800 s and 1100 to 1300 s: satellites below 45° come and go, 7 s gone and 8 s back in the mean; six remain |
//! | ambiguities | whole numbers, new ones at each return |
//! | receiver clocks | a ramp, common to all satellites |
//!
//! What the receivers measure is formed here from its definition and not by the filter's model. Noise: [`super::noise`].

use super::noise::{Noise, Noises};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{PI, TAU};
use surefix_core::filter::double_difference::{Options, Sight};

/// Epochs of the paper's experiment.
pub const EPOCHS: usize = 2164;
/// Epochs at the start that do not count.
pub const TRANSIENT: usize = 60;
/// Satellites that a receiver has room for, and those that are in sight without trees.
const MOST: usize = 12;
const IN_SIGHT: usize = 8;
/// Beginnings that are tried for that.
const BEGINNINGS: usize = 1000;
/// Satellites below are not used `[rad]`.
const MASK: f64 = 10.0 * PI / 180.0;
/// Satellites that trees leave.
const LEAST: usize = 6;
/// Where it is: latitude, longitude `[rad]`; Dongying.
pub const PLACE: [f64; 2] = [37.43 * PI / 180.0, 118.67 * PI / 180.0];
/// Radius of the Earth and of the orbits `[m]`.
const RADII: [f64; 2] = [6_371e3, 26_559.8e3];
/// Sidereal day, and period of the orbits `[s]`.
const PERIODS: [f64; 2] = [86_164.09, 43_082.05];
/// Inclination `[rad]`.
const INCLINATION: f64 = 55.0 * PI / 180.0;
/// Satellites below are hidden by trees `[rad]`.
const TREES: f64 = 45.0 * PI / 180.0;

/// One epoch: what is measured and what is true.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Measurements.
    pub sights: Vec<Sight>,
    /// The vector between the vehicles, east, north, up `[m]`.
    pub position: Vector3<f64>,
    /// Its velocity `[m/s]`.
    pub velocity: Vector3<f64>,
    /// Ambiguities of each satellite (by number) on both bands, rover minus base `[cycles]`.
    pub ambiguities: Vec<[i64; 2]>,
}

/// A run of the experiment.
#[derive(Clone, Debug)]
pub struct Record {
    /// All epochs.
    pub epochs: Vec<Epoch>,
    /// Position and velocity to begin with: the truth, off by 5 m and 2 m/s.
    pub start: [f64; 6],
}

/// Variances of that start.
pub const START: [f64; 6] = [25.0, 25.0, 25.0, 4.0, 4.0, 4.0];

/// Whether trees stand beside the road at a second.
pub fn in_trees(second: f64) -> bool {
    (600.0..800.0).contains(&second) || (1100.0..1300.0).contains(&second)
}

/// Positions of all satellites from the place, east, north, up `[m]`.
pub fn satellites(second: f64) -> Vec<Vector3<f64>> {
    let [latitude, longitude] = PLACE;
    let turned = TAU * second / PERIODS[0];
    let ((sin_lat, cos_lat), (sin_lon, cos_lon)) = (latitude.sin_cos(), longitude.sin_cos());
    (0..30)
        .map(|k| {
            let (plane, place) = (f64::from(k / 5), f64::from(k % 5));
            let u = TAU * (place / 5.0 + plane / 24.0 + second / PERIODS[1]);
            let node = TAU * plane / 6.0 - turned;
            let ((sin_u, cos_u), (sin_node, cos_node)) = (u.sin_cos(), node.sin_cos());
            let (sin_i, cos_i) = INCLINATION.sin_cos();
            let x = RADII[1] * (cos_u * cos_node - sin_u * cos_i * sin_node);
            let y = RADII[1] * (cos_u * sin_node + sin_u * cos_i * cos_node);
            let z = RADII[1] * sin_u * sin_i;
            let east = -sin_lon * x + cos_lon * y;
            let north = -sin_lat * (cos_lon * x + sin_lon * y) + cos_lat * z;
            let up = cos_lat * (cos_lon * x + sin_lon * y) + sin_lat * z - RADII[0];
            Vector3::new(east, north, up)
        })
        .collect()
}

/// Sine of an elevation.
pub fn sin_elevation(satellite: &Vector3<f64>) -> f64 {
    satellite.z / satellite.norm()
}

/// Position and velocity of one vehicle from the other.
fn vehicles(second: f64, phase: f64) -> (Vector3<f64>, Vector3<f64>) {
    let wave = |amplitude: f64, period: f64| {
        let (sin, cos) = (TAU * second / period + phase).sin_cos();
        (amplitude * sin, amplitude * TAU / period * cos)
    };
    let ((e, ve), (n, vn), (u, vu)) = (wave(3200.0, 1300.0), wave(1800.0, 870.0), wave(8.0, 400.0));
    (Vector3::new(8800.0 + e, 3000.0 + n, 3.0 + u), Vector3::new(ve, vn, vu))
}

/// Which satellites are in sight, epoch by epoch.
struct Sky {
    hidden: Vec<bool>,
}

impl Sky {
    fn visible(&mut self, positions: &[Vector3<f64>], second: f64, random: &mut ChaCha8Rng) -> Vec<usize> {
        let elevation = |k: usize| sin_elevation(&positions[k]).asin();
        let mut risen: Vec<usize> = (0..positions.len()).filter(|&k| elevation(k) > MASK).collect();
        risen.sort_by(|&a, &b| elevation(b).total_cmp(&elevation(a)));
        risen.truncate(MOST);
        for (k, hidden) in self.hidden.iter_mut().enumerate() {
            // Drawn whether it matters or not, so that the stream does not depend on the sky.
            let draw: f64 = random.random();
            let change = if *hidden { 1.0 / 7.0 } else { 1.0 / 8.0 };
            if in_trees(second) && elevation(k) < TREES {
                *hidden ^= draw < change;
            } else {
                *hidden = false;
            }
        }
        let free = risen.iter().filter(|&&k| !self.hidden[k]).count();
        let mut missing = LEAST.saturating_sub(free);
        risen.retain(|&k| {
            let kept = !self.hidden[k] || missing > 0;
            if self.hidden[k] && missing > 0 {
                (missing, self.hidden[k]) = (missing - 1, false);
            }
            kept
        });
        risen.sort_unstable();
        risen
    }
}

/// A second of the day from which on enough satellites are in sight for as many epochs; the last one tried, if there is none.
fn beginning(epochs: usize, random: &mut ChaCha8Rng) -> f64 {
    let enough = |second: f64| {
        let risen = satellites(second).iter().filter(|satellite| sin_elevation(satellite) > MASK.sin()).count();
        risen >= IN_SIGHT
    };
    let mut first = 0.0;
    for _ in 0..BEGINNINGS {
        first = random.random_range(0.0..PERIODS[0]);
        if (0..epochs).all(|k| enough(first + k as f64)) {
            break;
        }
    }
    first
}

impl Record {
    /// Draws a run.
    pub fn draw(noise: Noise, epochs: usize, random: &mut ChaCha8Rng) -> Self {
        let first = beginning(epochs, random);
        let phase = random.random_range(0.0..TAU);
        let count = satellites(0.0).len();
        let mut sky = Sky { hidden: vec![false; count] };
        let mut ambiguities = vec![[0i64; 2]; count];
        let mut seen = vec![false; count];
        let mut noises = Noises::new(noise, count, random);
        let (mut list, mut start) = (Vec::with_capacity(epochs), [0.0; 6]);
        for k in 0..epochs {
            let second = k as f64;
            let positions = satellites(first + second);
            let (position, velocity) = vehicles(second, phase);
            let visible = sky.visible(&positions, second, random);
            let errors = noises.next(&positions, second, position.norm(), random);
            let clock = 120.0 + 0.4 * second;
            let mut sights = Vec::with_capacity(visible.len());
            for satellite in 0..count {
                let draw = [(); 2].map(|()| random.random_range(-100i64..=100));
                let Ok(_) = visible.binary_search(&satellite) else {
                    seen[satellite] = false;
                    continue;
                };
                let new_lock = !seen[satellite];
                if new_lock {
                    ambiguities[satellite] = draw;
                }
                seen[satellite] = true;
                let s = positions[satellite];
                let range = (position - 2.0 * s).dot(&position) / ((s - position).norm() + s.norm()) + clock;
                let of = &errors[satellite];
                let wavelengths = Options::PAPER.wavelengths;
                let n = ambiguities[satellite].map(|n| n as f64);
                sights.push(Sight {
                    id: satellite as u8,
                    position: s,
                    sin_elevation: sin_elevation(&s),
                    code: [0, 1].map(|band| range + of.code[band]),
                    phase: [0, 1].map(|band| range + wavelengths[band] * n[band] + of.phase[band]),
                    new_lock,
                });
            }
            if k == 0 {
                let truth = [position.x, position.y, position.z, velocity.x, velocity.y, velocity.z];
                let off = |i: usize, random: &mut ChaCha8Rng| START[i].sqrt() * random.sample::<f64, _>(StandardNormal);
                start = std::array::from_fn(|i| truth[i] + off(i, random));
            }
            list.push(Epoch { sights, position, velocity, ambiguities: ambiguities.clone() });
        }
        Self { epochs: list, start }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::*;

    #[test]
    fn the_sky_is_as_described() {
        for trial in 0..3 {
            let record = Record::draw(Noise::Constant, 1400, &mut stream(1, trial));
            let counts: Vec<usize> = record.epochs.iter().map(|epoch| epoch.sights.len()).collect();
            assert!(counts.iter().all(|&count| (LEAST..=MOST).contains(&count)), "{counts:?}");
            let open = counts.iter().enumerate().filter(|(k, _)| !in_trees(*k as f64));
            assert!(open.clone().all(|(_, &count)| count >= IN_SIGHT), "{counts:?}");
            let mean =
                |range: std::ops::Range<usize>| counts[range.clone()].iter().sum::<usize>() as f64 / range.len() as f64;
            assert!(mean(600..800) < mean(0..600) - 0.5, "{} {}", mean(0..600), mean(600..800));
            let lengths = record.epochs.iter().map(|epoch| epoch.position.norm());
            assert!(lengths.clone().all(|length| (5.7e3..13.5e3).contains(&length)));
            // New ambiguities only come with a new lock.
            for pair in record.epochs.windows(2) {
                for sight in &pair[1].sights {
                    let k = usize::from(sight.id);
                    assert!(sight.new_lock || pair[0].ambiguities[k] == pair[1].ambiguities[k]);
                }
            }
            assert!(record.epochs.iter().skip(1).flat_map(|epoch| &epoch.sights).filter(|s| s.new_lock).count() > 30);
        }
    }

    /// Velocities are derivatives of positions.
    #[test]
    fn vehicles_move_as_they_say() {
        for second in [0.0, 333.0, 1000.5] {
            let [before, after] = [second - 0.5, second + 0.5].map(|at| vehicles(at, 0.3).0);
            assert!((after - before - vehicles(second, 0.3).1).norm() < 1e-3);
        }
    }
}
