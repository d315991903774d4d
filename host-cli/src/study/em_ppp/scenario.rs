//! Simulated, already linearised PPP: what the receiver measures, what is true, and with which noise it was drawn.
//!
//! | | at rest | moving |
//! |---|---|---|
//! | epochs | 200 × 30 s | 300 × 1 s, stop and go |
//! | satellites | 16 of two constellations | 10 of one |
//! | code at the zenith | 0.6 and 1.5 m | 0.6 m |
//! | phase at the zenith | 6 and 12 mm | 6 mm |
//!
//! Noise grows with 1/sin of the elevation; one measurement in a hundred is an outlier of ten times its standard deviation.
//! The clock is white (30 m), the zenith delay walks by 5 mm/√h. Axes are north, east, up.

use crate::smooth::ppp::tape::{Arc, Epoch, Group, Kind, Row, Tape};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;

/// Where satellites are used from: 7°.
const MASK: f64 = 0.122;
/// Share of outliers, and their factor on the standard deviation.
const OUTLIERS: (f64, f64) = (0.01, 10.0);
/// Walk of the zenith delay `[m/√s]`: 5 mm/√h.
pub const ZENITH: f64 = 5e-3 / 60.0;
/// A satellite turns about the Earth, seen from a receiver that turns too, in about half a day `[rad/s]`.
const TURN: f64 = TAU / 43_200.0;

/// What the receiver does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// It is at rest.
    Rest,
    /// It drives and stops by turns.
    Drive,
}

impl Motion {
    /// For people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rest => "static",
            Self::Drive => "kinematic",
        }
    }

    /// Seconds between epochs.
    pub const fn interval(self) -> f64 {
        match self {
            Self::Rest => 30.0,
            Self::Drive => 1.0,
        }
    }

    /// Epochs of a run.
    pub const fn epochs(self) -> usize {
        match self {
            Self::Rest => 200,
            Self::Drive => 300,
        }
    }
}

/// A run.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What was measured.
    pub tape: Tape,
    /// Positions `[m]`.
    pub truth: Vec<Vector3<f64>>,
    /// Variance that each measurement was drawn with, that of outliers included `[m²]`.
    pub variances: Vec<f64>,
    /// Accelerations `[m/s²]`.
    pub accelerations: Vec<Vector3<f64>>,
}

/// A satellite on its way: directions a cos + b sin.
struct Track {
    satellite: SatelliteId,
    a: Vector3<f64>,
    b: Vector3<f64>,
    ambiguity: f64,
}

impl Track {
    fn direction(&self, seconds: f64) -> Vector3<f64> {
        let (sin, cos) = (TURN * seconds).sin_cos();
        self.a * cos + self.b * sin
    }
}

/// Draws a run: satellites, motion, clock and zenith delay from `world`, noise of measurements from `noise`.
pub fn draw(motion: Motion, epochs: usize, world: &mut ChaCha8Rng, noise: &mut ChaCha8Rng) -> Scene {
    let groups: &[(Constellation, usize, [f64; 2])] = match motion {
        Motion::Rest => &[(Constellation::Gps, 8, [0.6, 0.006]), (Constellation::Galileo, 8, [1.5, 0.012])],
        Motion::Drive => &[(Constellation::Gps, 10, [0.6, 0.006])],
    };
    let group = |(i, (constellation, ..)): (usize, &(Constellation, usize, [f64; 2]))| Group {
        name: format!("{} IF", constellation.letter()),
        constellation: *constellation,
        isb: i.checked_sub(1),
    };
    let mut tape = Tape { groups: groups.iter().enumerate().map(group).collect(), ..Tape::default() };
    let span = motion.interval() * epochs as f64;
    let tracks: Vec<(usize, Track)> = groups
        .iter()
        .enumerate()
        .flat_map(|(g, (constellation, count, _))| (1..=*count).map(move |number| (g, *constellation, number as u8)))
        .filter_map(|(g, constellation, number)| {
            Some((g, track(SatelliteId::new(constellation, number)?, span, world)))
        })
        .collect();
    let (truth, accelerations) = trajectory(motion, epochs, world);
    let bias = 10.0 * normal(world);
    let mut zenith = 0.1 * normal(world);
    let mut variances = Vec::new();
    let mut arcs: Vec<Option<usize>> = vec![None; tracks.len()];
    for (k, position) in truth.iter().enumerate() {
        let seconds = motion.interval() * k as f64;
        let clock = 30.0 * normal(world);
        zenith += ZENITH * motion.interval().sqrt() * normal(world);
        let first = tape.rows.len();
        for ((g, track), arc) in tracks.iter().zip(&mut arcs) {
            let up = track.direction(seconds);
            let elevation = up.z.asin();
            if elevation < MASK {
                *arc = None;
                continue;
            }
            let arc = *arc.get_or_insert_with(|| {
                let new = Arc { satellite: track.satellite, group: *g as u16, first: k, last: k, prior: 0.0 };
                tape.arcs.push(new);
                tape.arcs.len() - 1
            });
            tape.arcs[arc].last = k;
            let wet = 1.0 / elevation.sin();
            let range = -up.dot(position) + clock + if *g > 0 { bias } else { 0.0 } + wet * zenith;
            for kind in Kind::ALL {
                let sigma = groups[*g].2[kind as usize] * wet;
                let outlier = noise.random_bool(OUTLIERS.0);
                let sigma = if outlier { OUTLIERS.1 * sigma } else { sigma };
                let ambiguity = if kind == Kind::Phase { track.ambiguity } else { 0.0 };
                variances.push(sigma * sigma);
                tape.rows.push(Row {
                    kind,
                    satellite: track.satellite,
                    group: *g as u16,
                    arc: arc as u32,
                    elevation,
                    direction: (-up).into(),
                    wet,
                    gradients: [0.0; 2],
                    ionosphere: 0.0,
                    value: range + ambiguity + sigma * normal(noise),
                    variance: [9.0, 9e-4][kind as usize],
                    shape: 1.0,
                });
            }
        }
        let time = GpsTime::from_week_tow(2100, seconds);
        tape.epochs.push(Epoch { time, rows: first..tape.rows.len(), clock: 0.0, position: Vector3::zeros() });
    }
    Scene { tape, truth, variances, accelerations }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

/// A satellite that is above 20° in the middle of the span.
fn track(satellite: SatelliteId, span: f64, random: &mut ChaCha8Rng) -> Track {
    let azimuth = random.random_range(0.0..TAU);
    let sin: f64 = random.random_range(0.342..1.0);
    let cos = (1.0 - sin * sin).sqrt();
    let middle = Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
    let mut other = Vector3::new(normal(random), normal(random), normal(random));
    other -= middle * middle.dot(&other);
    let along = other.normalize();
    let (sin, cos) = (0.5 * TURN * span).sin_cos();
    let (a, b) = (middle * cos - along * sin, middle * sin + along * cos);
    Track { satellite, a, b, ambiguity: 10.0 * normal(random) }
}

/// Positions and accelerations. A drive stops and goes every 30 s; while it goes its acceleration is a random walk
/// that is pulled back.
fn trajectory(motion: Motion, epochs: usize, random: &mut ChaCha8Rng) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let start = Vector3::new(2.0, -1.0, 3.0);
    if motion == Motion::Rest {
        return (vec![start; epochs], vec![Vector3::zeros(); epochs]);
    }
    let (mut position, mut velocity, mut acceleration) = (start, Vector3::zeros(), Vector3::zeros());
    let h = motion.interval();
    let (mut positions, mut accelerations) = (Vec::new(), Vec::new());
    for k in 0..epochs {
        positions.push(position);
        let before = velocity;
        if (k / 30) % 2 == 1 {
            let push = Vector3::new(normal(random), normal(random), 0.1 * normal(random));
            acceleration = 0.8 * acceleration + 0.5 * push - 0.05 * velocity;
            velocity += h * acceleration;
        } else {
            acceleration = Vector3::zeros();
            velocity *= 0.3;
            if velocity.norm() < 0.05 {
                velocity = Vector3::zeros();
            }
        }
        accelerations.push((velocity - before) / h);
        position += 0.5 * h * (before + velocity);
    }
    (positions, accelerations)
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::*;

    #[test]
    fn runs_are_sound_and_noise_is_apart_from_the_world() {
        for motion in [Motion::Rest, Motion::Drive] {
            let scene = |noise| draw(motion, motion.epochs(), &mut stream(1, 0), &mut stream(noise, 1));
            let (one, two) = (scene(1), scene(2));
            assert_eq!(one.tape.check(), Ok(()));
            assert_eq!(one.truth, two.truth);
            assert!(one.tape.rows.len() == two.tape.rows.len() && one.tape.rows != two.tape.rows);
            let in_sight = one.tape.rows.len() / (2 * motion.epochs());
            assert!((8..=16).contains(&in_sight), "{in_sight}");
        }
        let scene = draw(Motion::Drive, 300, &mut stream(1, 0), &mut stream(1, 1));
        // Stops: the first half minute, and at the end of each later one.
        assert!(scene.accelerations[..30].iter().all(|a| a.norm() == 0.0));
        assert!(scene.accelerations[31..60].iter().all(|a| a.norm() > 0.0));
        assert_eq!(scene.truth[88], scene.truth[89]);
    }
}
