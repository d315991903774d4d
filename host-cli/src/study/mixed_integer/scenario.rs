//! Synthetic data of Section V: a rover on a random walk in velocity, 13 satellites with three biases each, ambiguities
//! that jump.
//!
//! ```text
//! (p, v)⁺ by (39) with noise (40),  θ⁺ = θ + N(0, h β),  n⁺ = n + s,  sᵢ ~ 𝒥(a, b h)       (27)–(29)
//! y = (y_P, y_Φ, y^I, y^P, y^Φ) by (42)
//! ```
//! Where the paper says nothing or two things:
//!
//! | item | choice |
//! |---|---|
//! | jumps | b = 0.05 per second, so 0.005 an epoch; the text's b = 0.01 and Table I read per step are variants |
//! | epochs | 300, 30 s, of which the first 20 do not count |
//! | virtual measurements | the true biases and noise, exactly (42c) |
//! | initial biases and velocity | N(0, 1 m²), N(0, 1 m²/s²); the prior is the same |
//! | initial ambiguities | uniform on −10 … 10; prior N(0, 10²) |
//! | initial position | 10 km from the base; prior N(truth + N(0, 10² m²), 10² m²) |
//! | reference satellite | the highest |
//!
//! Measurements are formed here from their definition and not by the model that the filter uses, so that a wrong sign in
//! either shows. The number of random numbers drawn does not depend on the parameters: variants of a scenario see the
//! same noise.

use super::constellation::{Constellation, SATELLITES};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surefix_core::filter::jump::JumpProcess;
use surefix_core::model::virtual_bias::VirtualBiasParameters;

/// N − 1, the number of ambiguities.
pub const AMBIGUITIES: usize = SATELLITES - 1;
/// Real states: position, velocity and three biases per satellite.
pub const REAL: usize = 6 + 3 * SATELLITES;
/// Largest initial ambiguity `[cycles]`.
const LARGEST_INITIAL: i64 = 10;
/// Standard deviation of the ambiguities in the prior `[cycles]`.
const AMBIGUITY_SIGMA: f64 = 10.0;
/// Where the rover starts, from the base: distance `[m]` and azimuth `[°]`.
const START: (f64, f64) = (1e4, 30.0);

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Numbers of the model, of Table I by default.
    pub parameters: VirtualBiasParameters,
    /// Jumps per epoch.
    pub jumps: JumpProcess,
    /// K, the number of epochs.
    pub epochs: usize,
    /// Epochs at the start that do not count.
    pub transient: usize,
    /// Standard deviation of each coordinate of the position in the prior `[m]`.
    pub position_sigma: f64,
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            parameters: VirtualBiasParameters::default(),
            jumps: JumpProcess { largest: 10, probability: 0.005 },
            epochs: 300,
            transient: 20,
            position_sigma: 10.0,
        }
    }
}

/// What the filter knows before the first epoch: independent normal states (x, n).
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Mean.
    pub mean: Vec<f64>,
    /// Variances.
    pub variances: Vec<f64>,
}

/// The truth at an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// p `[m]`.
    pub position: Vector3<f64>,
    /// v `[m/s]`.
    pub velocity: Vector3<f64>,
    /// θ = (θᴵ, θᴾ, θᶲ) `[m]`.
    pub biases: [f64; 3 * SATELLITES],
    /// n `[cycles]`.
    pub ambiguities: [i64; AMBIGUITIES],
    /// s, by how much each ambiguity jumped since the epoch before `[cycles]`.
    pub jumps: [i64; AMBIGUITIES],
}

/// An epoch as the filter sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// Time since the start `[s]`.
    pub time: f64,
    /// Satellites relative to the base, reference first `[m]`.
    pub satellites: Vec<Vector3<f64>>,
    /// Measurements, in the order of the model's rows `[m]`.
    pub measurements: Vec<f64>,
}

/// A run of a scenario.
#[derive(Clone, Debug)]
pub struct Simulation<'a> {
    scenario: Scenario,
    constellation: &'a Constellation,
    random: ChaCha8Rng,
    truth: Truth,
    prior: Prior,
    epoch: usize,
}

impl<'a> Simulation<'a> {
    /// Draws the initial state and the prior.
    pub fn new(scenario: Scenario, constellation: &'a Constellation, mut random: ChaCha8Rng) -> Self {
        let truth = Truth {
            position: constellation.on_the_ground(START.0, START.1.to_radians()),
            velocity: normal_vector(&mut random),
            biases: std::array::from_fn(|_| normal(&mut random)),
            ambiguities: std::array::from_fn(|_| random.random_range(-LARGEST_INITIAL..=LARGEST_INITIAL)),
            jumps: [0; AMBIGUITIES],
        };
        let sigma = scenario.position_sigma;
        let position = truth.position + sigma * normal_vector(&mut random);
        let mut prior = Prior { mean: vec![0.0; REAL + AMBIGUITIES], variances: vec![1.0; REAL + AMBIGUITIES] };
        prior.mean[..3].copy_from_slice(position.as_slice());
        prior.variances[..3].fill(sigma * sigma);
        prior.variances[REAL..].fill(AMBIGUITY_SIGMA * AMBIGUITY_SIGMA);
        Self { scenario, constellation, random, truth, prior, epoch: 0 }
    }

    /// What is known before the first epoch.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// The next epoch with its truth, `None` after the last.
    pub fn next_epoch(&mut self) -> Option<(Epoch, &Truth)> {
        if self.epoch == self.scenario.epochs {
            return None;
        }
        self.epoch += 1;
        self.truth.advance(&self.scenario, &mut self.random);
        let time = self.epoch as f64 * self.scenario.parameters.interval;
        let satellites = self.constellation.at(time);
        let measurements = self.truth.measure(&self.scenario.parameters, &satellites, &mut self.random);
        Some((Epoch { time, satellites, measurements }, &self.truth))
    }
}

impl Truth {
    /// One step of (39), (40) and (29).
    fn advance(&mut self, scenario: &Scenario, random: &mut ChaCha8Rng) {
        let VirtualBiasParameters { interval: h, acceleration: alpha, bias_walk: beta, .. } = scenario.parameters;
        // The block of (40) has the Cholesky factor √(α h) [h/2 h/√12; 1 0] for (p, v).
        let kick: Vector3<f64> = (alpha * h).sqrt() * normal_vector(random);
        let wobble: Vector3<f64> = (alpha * h).sqrt() * normal_vector(random);
        self.position += h * self.velocity + h / 2.0 * kick + h / 12.0_f64.sqrt() * wobble;
        self.velocity += kick;
        self.biases.iter_mut().for_each(|bias| *bias += (h * beta).sqrt() * normal(random));
        for (ambiguity, jump) in self.ambiguities.iter_mut().zip(&mut self.jumps) {
            *jump = scenario.jumps.from_uniform(random.random());
            *ambiguity += *jump;
        }
    }

    /// (42).
    fn measure(
        &self,
        parameters: &VirtualBiasParameters,
        satellites: &[Vector3<f64>],
        random: &mut ChaCha8Rng,
    ) -> Vec<f64> {
        let (ionosphere, rest) = self.biases.split_at(SATELLITES);
        let (code, phase) = rest.split_at(SATELLITES);
        // Noise of a single difference has √2 times the standard deviation, that of double differences is M times it.
        let mut single_difference = |sign: f64, bias: &[f64], sigma: f64| -> Vec<f64> {
            let sigma = 2.0_f64.sqrt() * sigma;
            satellites
                .iter()
                .zip(ionosphere)
                .zip(bias)
                .map(|((s, ionosphere), bias)| {
                    range_difference(&self.position, s) + sign * ionosphere + bias + sigma * normal(random)
                })
                .collect()
        };
        let codes = single_difference(1.0, code, parameters.sigma_code);
        let phases = single_difference(-1.0, phase, parameters.sigma_phase);
        let mut measurements = Vec::with_capacity(2 * AMBIGUITIES + 3 * SATELLITES);
        measurements.extend((1..SATELLITES).map(|i| codes[0] - codes[i]));
        measurements.extend(
            (1..SATELLITES)
                .zip(self.ambiguities)
                .map(|(i, n)| phases[0] - phases[i] + parameters.wavelength * n as f64),
        );
        measurements.extend(self.biases.iter().map(|bias| bias + parameters.sigma_bias * normal(random)));
        measurements
    }
}

/// |p − s| − |s|, exact to a nanometre: (|p|² − 2 p·s) / (|p − s| + |s|).
fn range_difference(p: &Vector3<f64>, s: &Vector3<f64>) -> f64 {
    p.dot(&(p - 2.0 * s)) / ((p - s).norm() + s.norm())
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

fn normal_vector(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(random))
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::*;
    use surefix_core::model::partially_linear::{Nonlinear, PartiallyLinear};
    use surefix_core::model::virtual_bias::VirtualBiasModel;
    use surefix_core::stats::chi_square;

    /// Without noise the data are what the filter's model predicts at the truth, row for row.
    #[test]
    fn data_and_model_agree() {
        let parameters = VirtualBiasParameters {
            sigma_code: 0.0,
            sigma_phase: 0.0,
            sigma_bias: 0.0,
            ..VirtualBiasParameters::default()
        };
        let constellation = Constellation::new();
        let scenario = Scenario { parameters, ..Scenario::default() };
        let mut simulation = Simulation::new(scenario, &constellation, stream(1, 0));
        let (epoch, truth) = simulation.next_epoch().unwrap();
        let model = VirtualBiasModel { satellites: &epoch.satellites, parameters };
        let mut expected = vec![0.0; model.shape().rows()];
        model.evaluate(truth.position.as_slice(), &mut expected[..2 * AMBIGUITIES]);
        let mut state = truth.position.as_slice().to_vec();
        state.extend(truth.velocity.iter());
        state.extend(truth.biases);
        state.extend(truth.ambiguities.map(|n| n as f64));
        for (row, expected) in expected.iter_mut().enumerate() {
            model.linear_row(row, &mut |i, coefficient| *expected += coefficient * state[i]);
        }
        for (row, (y, expected)) in epoch.measurements.iter().zip(&expected).enumerate() {
            assert!((y - expected).abs() < 1e-9, "row {row}: {y} against {expected}");
        }
    }

    /// Plain differences of ranges of 2e7 m lose 4e-9 m each.
    #[test]
    fn the_stable_difference_is_the_difference() {
        let p = Vector3::new(5e3, 8e3, -8.0);
        for s in Constellation::new().at(0.0) {
            assert!((range_difference(&p, &s) - ((p - s).norm() - s.norm())).abs() < 2e-8);
        }
    }

    /// 60 000 steps against the mass of 𝒥(3, 0.3) by Pearson's χ² with 6 degrees of freedom: one seed in a thousand
    /// would fail. The moments lie within four of their standard errors.
    #[test]
    fn jumps_are_drawn_from_their_process() {
        let process = JumpProcess { largest: 3, probability: 0.3 };
        let scenario = Scenario { jumps: process, epochs: 5000, ..Scenario::default() };
        let constellation = Constellation::new();
        let mut simulation = Simulation::new(scenario, &constellation, stream(5, 0));
        let (mut counts, mut total, mut sum, mut square, mut fourth) = ([0.0; 7], 0.0, 0.0, 0.0, 0.0);
        while let Some((_, truth)) = simulation.next_epoch() {
            for jump in truth.jumps {
                counts[(jump + 3) as usize] += 1.0;
                total += 1.0;
                sum += jump as f64;
                square += (jump * jump) as f64;
                fourth += jump.pow(4) as f64;
            }
        }
        let statistic: f64 = (-3..=3)
            .zip(counts)
            .map(|(jump, count)| (count - total * process.mass(jump)).powi(2) / (total * process.mass(jump)))
            .sum();
        assert!(statistic < chi_square::quantile(0.999, 6), "{statistic}");
        let (mean, variance) = (sum / total, square / total);
        assert!((mean - process.mean()).abs() < 4.0 * (process.variance() / total).sqrt(), "{mean}");
        let spread = ((fourth / total - variance * variance) / total).sqrt();
        assert!((variance - process.variance()).abs() < 4.0 * spread, "{variance}");
    }

    /// (40) by the sample covariance of 20 000 steps of one axis each way, within 5 % (seven standard errors).
    #[test]
    fn motion_has_the_noise_of_the_model() {
        let scenario = Scenario::default();
        let VirtualBiasParameters { interval: h, acceleration: alpha, .. } = scenario.parameters;
        let constellation = Constellation::new();
        let simulation = Simulation::new(scenario, &constellation, stream(2, 0));
        let (mut truth, mut random) = (simulation.truth, simulation.random);
        let mut moments = [0.0; 3];
        for _ in 0..20_000 {
            (truth.position, truth.velocity) = (Vector3::zeros(), Vector3::zeros());
            truth.advance(&scenario, &mut random);
            let (p, v) = (truth.position, truth.velocity);
            for (moment, value) in moments.iter_mut().zip([p.dot(&p), p.dot(&v), v.dot(&v)]) {
                *moment += value / 60_000.0;
            }
        }
        let expected = [alpha * h.powi(3) / 3.0, alpha * h * h / 2.0, alpha * h];
        for (moment, expected) in moments.iter().zip(expected) {
            assert!((moment / expected - 1.0).abs() < 0.05, "{moment} against {expected}");
        }
    }

    #[test]
    fn runs_differ_and_repeat() {
        let constellation = Constellation::new();
        let first = |seed, run| {
            let mut simulation = Simulation::new(Scenario::default(), &constellation, stream(seed, run));
            simulation.next_epoch().unwrap().0
        };
        assert_eq!(first(1, 0), first(1, 0));
        assert_ne!(first(1, 0), first(1, 1));
        assert_ne!(first(1, 0), first(2, 0));
    }
}
