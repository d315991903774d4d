//! Simulated drives for the filter of Section V of Greiff et al. (CCTA 2021), as device logs with their truth.
//!
//! Table I of the paper: 13 satellites, 10 Hz, DD code and phase with biases seen by virtual measurements, ambiguities
//! that jump with probability 0.005 a step by up to ±10 cycles. Satellites move on straight lines for the half minute
//! that a drive lasts. Everything follows from the seed.

use nalgebra::Vector3;
use surefix::log::LogWriter;
use surefix_core::filter::mixed_integer::Options;
use surefix_core::filter::section_v::{CONFIG_SCHEMA, Prior, SATELLITES, Setup};
use surefix_core::gnss::time::GpsTime;
use surefix_core::model::partially_linear::Nonlinear;
use surefix_core::model::virtual_bias::{VirtualBiasModel, VirtualBiasParameters};

/// Azimuth and elevation of the satellites `[°]`, the highest first: well spread, above 5°.
const SKY: [(f64, f64); SATELLITES] = [
    (310.0, 78.0),
    (45.0, 61.0),
    (170.0, 55.0),
    (250.0, 48.0),
    (95.0, 40.0),
    (340.0, 33.0),
    (205.0, 29.0),
    (20.0, 24.0),
    (140.0, 20.0),
    (280.0, 16.0),
    (65.0, 12.0),
    (230.0, 9.0),
    (120.0, 6.0),
];
/// Radii of the earth and of the orbits, speed of a satellite `[m]`, `[m/s]`.
const EARTH: f64 = 6_371e3;
const ORBIT: f64 = 26_560e3;
const SPEED: f64 = 3_000.0;
/// Probability that an ambiguity jumps in a step, and the largest jump `[cycles]`.
const JUMP: f64 = 0.005;
const LARGEST_JUMP: f64 = 10.0;

/// One epoch: what the filter is told, and the truth.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Time.
    pub time: GpsTime,
    /// Satellites relative to the base `[m]`.
    pub satellites: Vec<Vector3<f64>>,
    /// y.
    pub values: Vec<f64>,
    /// The rover relative to the base `[m]`.
    pub position: Vector3<f64>,
    /// True ambiguities `[cycles]`.
    pub integers: Vec<i64>,
}

/// A drive.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Model, prior and options.
    pub setup: Setup,
    /// Its epochs.
    pub epochs: Vec<Epoch>,
}

impl Drive {
    /// Simulates so many epochs.
    pub fn new(seed: u64, epochs: usize) -> Self {
        let parameters = VirtualBiasParameters::default();
        let mut random = Random(seed);
        let mut position = Vector3::new(800.0, -450.0, 20.0);
        let prior = Prior {
            position: (position + random.vector(10.0)).into(),
            sigma_position: 10.0,
            sigma_velocity: 1.0,
            sigma_bias: 1.0,
            sigma_ambiguity: 10.0,
        };
        let mut velocity = random.vector(1.0);
        let mut biases: [[f64; SATELLITES]; 3] = [(); 3].map(|()| [(); SATELLITES].map(|()| random.normal()));
        let mut integers: Vec<i64> = (1..SATELLITES).map(|_| random.integer(LARGEST_JUMP)).collect();
        let h = parameters.interval;
        let epochs = (0..epochs)
            .map(|k| {
                if k > 0 {
                    // Increments of the integrated and of the twice integrated white noise.
                    let (a, b) = (random.vector(1.0), random.vector(1.0));
                    let sigma = (parameters.acceleration * h).sqrt();
                    position += h * velocity + sigma * h * (a / 2.0 + b / 12f64.sqrt());
                    velocity += sigma * a;
                    let walk = (parameters.bias_walk * h).sqrt();
                    biases.iter_mut().flatten().for_each(|bias| *bias += walk * random.normal());
                    for integer in &mut integers {
                        if random.uniform() < JUMP {
                            *integer += random.integer(LARGEST_JUMP);
                        }
                    }
                }
                let satellites: Vec<_> = SKY.iter().map(|&place| satellite(place, h * k as f64)).collect();
                let values = measure(&parameters, &satellites, &position, &biases, &integers, &mut random);
                let time = GpsTime::from_week_tow(2147, 29_700.0).plus_seconds(h * k as f64);
                Epoch { time, satellites, values, position, integers: integers.clone() }
            })
            .collect();
        Self { setup: Setup { parameters, prior, options: Options::default() }, epochs }
    }

    /// The drive as a device log.
    pub fn log(&self) -> Vec<u8> {
        let mut log = LogWriter::new(Vec::new());
        let written = log.config(CONFIG_SCHEMA, &self.setup).and_then(|()| {
            self.epochs.iter().try_for_each(|epoch| log.measurements(epoch.time, &epoch.satellites, &epoch.values))
        });
        written.and_then(|()| log.finish()).expect("a vector takes everything, and the frames are short enough")
    }
}

/// Where a satellite is after some seconds, east, north, up of the base.
fn satellite((azimuth, elevation): (f64, f64), seconds: f64) -> Vector3<f64> {
    let (a, e) = (azimuth.to_radians(), elevation.to_radians());
    let up = Vector3::new(a.sin() * e.cos(), a.cos() * e.cos(), e.sin());
    let distance = (ORBIT * ORBIT - (EARTH * e.cos()).powi(2)).sqrt() - EARTH * e.sin();
    let across = up.cross(&Vector3::new(a.cos(), 0.5, -0.3)).normalize();
    distance * up + SPEED * seconds * across
}

/// (42a)–(42c) of the paper with noise.
fn measure(
    parameters: &VirtualBiasParameters,
    satellites: &[Vector3<f64>],
    position: &Vector3<f64>,
    [ionosphere, code, phase]: &[[f64; SATELLITES]; 3],
    integers: &[i64],
    random: &mut Random,
) -> Vec<f64> {
    let model = VirtualBiasModel { satellites, parameters: *parameters };
    let mut geometry = vec![0.0; model.outputs()];
    model.evaluate(position.as_slice(), &mut geometry);
    let mut undifferenced = |sigma: f64| [(); SATELLITES].map(|()| 2f64.sqrt() * sigma * random.normal());
    let (code_noise, phase_noise) = (undifferenced(parameters.sigma_code), undifferenced(parameters.sigma_phase));
    let codes = (1..SATELLITES).zip(&geometry).map(|(i, rho)| {
        let single = |j: usize| ionosphere[j] + code[j] + code_noise[j];
        rho + single(0) - single(i)
    });
    let phases = (1..SATELLITES).zip(&geometry).zip(integers).map(|((i, rho), &n)| {
        let single = |j: usize| -ionosphere[j] + phase[j] + phase_noise[j];
        rho + single(0) - single(i) + parameters.wavelength * n as f64
    });
    let mut values: Vec<f64> = codes.chain(phases).collect();
    let biases = [ionosphere, code, phase].into_iter().flatten();
    values.extend(biases.map(|bias| bias + parameters.sigma_bias * random.normal()));
    values
}

/// Random numbers: SplitMix64 (Steele, Lea & Flood, OOPSLA 2014), and the method of Box and Muller.
struct Random(u64);

impl Random {
    /// 0 ≤ x < 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.normal())
    }

    /// A whole number of −limit…limit.
    fn integer(&mut self, limit: f64) -> i64 {
        ((2.0 * limit + 1.0) * self.uniform()).floor() as i64 - limit as i64
    }
}
