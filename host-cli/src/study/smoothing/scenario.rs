//! Synthetic data of Appendix A: a rover, ten satellites with ionosphere, troposphere and clock, three bands of code, phase
//! and Doppler, ambiguities that jump. The truth moves exactly as the estimator supposes.
//!
//! ```text
//! z⁺ by (15), ξ⁺ by (16), n⁺ = n + s, sᵢ ~ 𝒥(10, b h);  y by Fig. 1 and (18) with virtual measurements of the biases
//! ```
//! What the paper leaves open:
//!
//! | item | choice |
//! |---|---|
//! | geometry | [`Sky`]: one whose covariances are the paper's, or a nominal one |
//! | jumps | b = 0.001 a second, so 0.005 an epoch, of each differenced ambiguity on its own; ±1 … ±10 |
//! | initial z and biases | from their prior: N(0, diag(1, 1, 1, 0.1)), N(0, 0.01) (variances) |
//! | initial ambiguities | [`Scenario::initial`] |
//! | true velocity of p^X, p^Y | 0 in Doppler: a random walk has none |
//! | virtual measurements | the true biases and noise; *all* satellite clocks |
//! | λ | c/f |
//!
//! Measurements are formed here from their definition, satellite by satellite and receiver by receiver, and not by the
//! model that the smoother uses, so that a wrong sign in either shows. The number of random numbers drawn depends neither
//! on the parameters nor on the differences: double and single differences of a run see the same noise of the rover.

use super::geometry::{Geometry, SATELLITES};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surefix_core::filter::jump::JumpProcess;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::model::multi_band::{BANDS, Component, MotionParameters, Satellite, Variances};

/// N_s − 1.
const DIFFERENCES: usize = SATELLITES - 1;
/// Ambiguities: of each band, each difference.
pub const AMBIGUITIES: usize = BANDS * DIFFERENCES;
/// Carrier frequencies `[Hz]`; that of L5 is the paper's.
pub const FREQUENCIES: [f64; BANDS] = [1575.42e6, 1227.6e6, 1176e6];
/// Variances of the initial state: p `[m²]`, v^Z `[m²/s²]`, biases and their rates `[m²]`, `[m²/s²]`.
pub const INITIAL_VARIANCES: [f64; 3] = [1.0, 0.1, 0.01];

/// Where the satellites are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sky {
    /// [`Geometry::g2`].
    G2,
    /// [`Geometry::nominal`].
    Nominal,
}

/// What is differenced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Differences {
    /// Satellites and receivers: the paper's DD-IF.
    Double,
    /// Satellites: the paper's SD-IF, with satellite clocks as states.
    Single,
}

impl Differences {
    /// As the paper calls the model.
    pub fn name(self) -> &'static str {
        match self {
            Self::Double => "DD-IF",
            Self::Single => "SD-IF",
        }
    }
}

/// How the ambiguities begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initial {
    /// Uniform on −a … a.
    Uniform(i64),
    /// N(0, 1), rounded.
    Rounded,
}

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Where the satellites are.
    pub sky: Sky,
    /// What is differenced.
    pub differences: Differences,
    /// K: there are epochs 0 to K.
    pub last: usize,
    /// How the ambiguities begin.
    pub initial: Initial,
    /// Jumps per epoch.
    pub jumps: JumpProcess,
    /// Motion; of its numbers those of the ambiguities do not matter here.
    pub motion: MotionParameters,
    /// Noise.
    pub noise: Variances,
}

impl Default for Scenario {
    /// Appendix A in geometry G2.
    fn default() -> Self {
        Self {
            sky: Sky::G2,
            differences: Differences::Double,
            last: 1000,
            initial: Initial::Uniform(10),
            jumps: JumpProcess { largest: 10, probability: 0.005 },
            motion: MotionParameters::default(),
            noise: Variances::default(),
        }
    }
}

/// The truth at an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// (p^X, p^Y, p^Z) `[m]`.
    pub position: Vector3<f64>,
    /// v^Z `[m/s]`.
    pub up_rate: f64,
    /// Ambiguities, band after band `[cycles]`.
    pub ambiguities: Vec<i64>,
    /// By how much each jumped since the epoch before `[cycles]`.
    pub jumps: Vec<i64>,
    /// I, T and c·dt of each satellite `[m]`, each with its rate `[m/s]`.
    pub biases: [[Drift; SATELLITES]; 3],
}

/// A bias and its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drift {
    /// Its value.
    pub value: f64,
    /// Its rate, a random walk.
    pub rate: f64,
}

/// A run: what was measured and what is true at epochs 0 to K.
#[derive(Clone, Debug)]
pub struct Record {
    /// The base relative to the linearisation point, in double differences `[m]`.
    pub base: Option<Vector3<f64>>,
    /// Satellites of each epoch.
    pub satellites: Vec<Vec<Satellite>>,
    /// Measurements of each epoch, in the order of the rows of the paper (18).
    pub measurements: Vec<Vec<f64>>,
    /// Truth of each epoch.
    pub truth: Vec<Truth>,
}

impl Record {
    /// Simulates a run.
    pub fn simulate(scenario: &Scenario, random: &mut ChaCha8Rng) -> Self {
        let geometry = match scenario.sky {
            Sky::G2 => Geometry::g2(),
            Sky::Nominal => Geometry::nominal(random),
        };
        let base = (scenario.differences == Differences::Double).then_some(geometry.base);
        let mut truth = Truth::initial(scenario.initial, random);
        let mut record = Self { base, satellites: vec![], measurements: vec![], truth: vec![] };
        for k in 0..=scenario.last {
            if k > 0 {
                truth.advance(scenario, random);
            }
            let satellites = geometry.satellites((k as f64 - scenario.last as f64 / 2.0) * scenario.motion.interval);
            record.measurements.push(truth.measure(base, &satellites, &scenario.noise, random));
            record.satellites.push(satellites);
            record.truth.push(truth.clone());
        }
        record
    }
}

impl Drift {
    /// x⁺ = A^CV x + q (14), with a variance σ² of the rate per second.
    fn advance(&mut self, interval: f64, variance: f64, random: &mut ChaCha8Rng) {
        // The inverse of M^CV is L Lᵀ with L = √h [h/2 h/√12; 1 0] for (value, rate).
        let kick = (variance * interval).sqrt() * normal(random);
        let wobble = (variance * interval).sqrt() * normal(random);
        self.value += interval * (self.rate + kick / 2.0 + wobble / 12.0_f64.sqrt());
        self.rate += kick;
    }
}

impl Truth {
    fn initial(initial: Initial, random: &mut ChaCha8Rng) -> Self {
        let [position, velocity, bias] = INITIAL_VARIANCES.map(f64::sqrt);
        let ambiguity = |random: &mut ChaCha8Rng| match initial {
            Initial::Uniform(largest) => random.random_range(-largest..=largest),
            Initial::Rounded => normal(random).round() as i64,
        };
        Self {
            position: Vector3::from_fn(|_, _| position * normal(random)),
            up_rate: velocity * normal(random),
            ambiguities: (0..AMBIGUITIES).map(|_| ambiguity(random)).collect(),
            jumps: vec![0; AMBIGUITIES],
            biases: std::array::from_fn(|_| {
                std::array::from_fn(|_| Drift { value: bias * normal(random), rate: bias * normal(random) })
            }),
        }
    }

    fn advance(&mut self, scenario: &Scenario, random: &mut ChaCha8Rng) {
        let MotionParameters { interval, variances, .. } = scenario.motion;
        let variance = |component: Component| variances[component as usize];
        for (axis, component) in [Component::X, Component::Y].into_iter().enumerate() {
            self.position[axis] += (interval * variance(component)).sqrt() * normal(random);
        }
        let mut up = Drift { value: self.position.z, rate: self.up_rate };
        up.advance(interval, variance(Component::Z), random);
        (self.position.z, self.up_rate) = (up.value, up.rate);
        let components = [Component::Ionosphere, Component::Troposphere, Component::Clock];
        for (drifts, component) in self.biases.iter_mut().zip(components) {
            drifts.iter_mut().for_each(|drift| drift.advance(interval, variance(component), random));
        }
        for (ambiguity, jump) in self.ambiguities.iter_mut().zip(&mut self.jumps) {
            *jump = scenario.jumps.from_uniform(random.random());
            *ambiguity += *jump;
        }
    }

    /// Fig. 1, differenced and combined as in (18), and the virtual measurements.
    fn measure(
        &self,
        base: Option<Vector3<f64>>,
        satellites: &[Satellite],
        noise: &Variances,
        random: &mut ChaCha8Rng,
    ) -> Vec<f64> {
        let [ionosphere, troposphere, clock] = &self.biases;
        let velocity = Vector3::new(0.0, 0.0, self.up_rate);
        let sigmas = [noise.code, noise.phase, noise.doppler].map(f64::sqrt);
        // [band][signal][satellite], of which the ambiguities are still missing.
        let mut signals = [[[0.0; SATELLITES]; 3]; BANDS];
        for (band, signals) in signals.iter_mut().enumerate() {
            let ratio = (FREQUENCIES[0] / FREQUENCIES[band]).powi(2);
            for (s, satellite) in satellites.iter().enumerate() {
                let (range, rate) = seen(&self.position, &velocity, satellite, base);
                let (i, t, dt) = (ionosphere[s], troposphere[s], clock[s]);
                let dt = if base.is_some() { Drift::default() } else { dt };
                let ideal = [
                    range - dt.value + t.value + ratio * i.value,
                    range - dt.value + t.value - ratio * i.value,
                    -rate + dt.rate - t.rate + ratio * i.rate,
                ];
                for ((signal, ideal), sigma) in signals.iter_mut().zip(ideal).zip(sigmas) {
                    let (rover, base_noise) = (normal(random), normal(random));
                    signal[s] = ideal + sigma * if base.is_some() { rover - base_noise } else { rover };
                }
            }
        }
        let mut measurements = Vec::with_capacity(9 * DIFFERENCES + 3 * SATELLITES);
        let difference = |band: usize, signal: usize, i: usize| {
            let values = &signals[band][signal];
            let wavelength = if signal == 1 { SPEED_OF_LIGHT / FREQUENCIES[band] } else { 0.0 };
            values[0] - values[i + 1] + wavelength * self.ambiguities[band * DIFFERENCES + i] as f64
        };
        for band in 0..BANDS {
            let alpha = (FREQUENCIES[band] / FREQUENCIES[0]).powi(2);
            for signal in 0..3 {
                measurements.extend((0..DIFFERENCES).map(|i| match band {
                    0 => difference(0, signal, i),
                    _ => difference(0, signal, i) - alpha * difference(band, signal, i),
                }));
            }
        }
        let sigmas = [noise.ionosphere, noise.troposphere, noise.clock].map(f64::sqrt);
        for (kind, (drifts, sigma)) in self.biases.iter().zip(sigmas).enumerate() {
            for drift in drifts {
                let measured = drift.value + sigma * normal(random);
                if kind < 2 || base.is_none() {
                    measurements.push(measured);
                }
            }
        }
        measurements
    }
}

/// Range `[m]` and range rate `[m/s]` of a satellite, less those of the base if there is one. The base stands still.
fn seen(p: &Vector3<f64>, v: &Vector3<f64>, satellite: &Satellite, base: Option<Vector3<f64>>) -> (f64, f64) {
    let s = &satellite.position;
    let rate = |p: &Vector3<f64>, v: Vector3<f64>| (p - s).normalize().dot(&(v - satellite.velocity));
    match base {
        // |p − s| − |b − s| without cancellation of 2e7 m.
        Some(b) => (
            (p - b).dot(&(p + b - 2.0 * s)) / ((p - s).norm() + (b - s).norm()),
            rate(p, *v) - rate(&b, Vector3::zeros()),
        ),
        None => ((p - s).norm(), rate(p, *v)),
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::*;
    use surefix_core::model::multi_band::{Bands, ClockRows, MultiBandModel};
    use surefix_core::model::partially_linear::Nonlinear;

    const SILENT: Variances =
        Variances { code: 0.0, phase: 0.0, doppler: 0.0, ionosphere: 0.0, troposphere: 0.0, clock: 0.0 };

    /// Without noise the data are what the smoother's model predicts at the truth, row for row.
    #[test]
    fn data_and_model_agree() {
        for (differences, sky) in [(Differences::Double, Sky::G2), (Differences::Single, Sky::Nominal)] {
            let scenario = Scenario { differences, sky, noise: SILENT, last: 3, ..Scenario::default() };
            let record = Record::simulate(&scenario, &mut stream(1, 0));
            for ((satellites, y), truth) in record.satellites.iter().zip(&record.measurements).zip(&record.truth) {
                let bands = Bands::new(FREQUENCIES).unwrap();
                let variances = Variances::default();
                let model =
                    MultiBandModel { satellites, base: record.base, bands, variances, clock_rows: ClockRows::All };
                assert_eq!(y.len(), model.rows());
                let mut x = vec![truth.position.x, truth.position.y, truth.position.z, truth.up_rate];
                x.extend(truth.ambiguities.iter().map(|&n| n as f64));
                for drifts in &truth.biases {
                    x.extend(drifts.iter().map(|drift| drift.value));
                    x.extend(drifts.iter().map(|drift| drift.rate));
                }
                let mut values = vec![0.0; model.outputs()];
                model.evaluate(&x[..4], &mut values);
                for (row, y) in y.iter().enumerate() {
                    let mut predicted = model.nonlinear_part(row, &values);
                    model.row(row, &mut |state, coefficient| predicted += coefficient * x[state]);
                    // Single differences are of ranges of 2e7 m, which have 4e-9 m each.
                    assert!((y - predicted).abs() < 3e-8, "{differences:?} row {row}: {y} against {predicted}");
                }
            }
        }
    }

    /// (14) by the sample covariance of 20 000 steps, within four standard errors of a variance, 4 √(2/20 000).
    #[test]
    fn drifts_have_the_noise_of_the_model() {
        let (h, variance, count) = (5.0_f64, 0.3, 20_000);
        let mut random = stream(2, 0);
        let mut moments = [0.0; 3];
        for _ in 0..count {
            let mut drift = Drift::default();
            drift.advance(h, variance, &mut random);
            let Drift { value, rate } = drift;
            for (moment, product) in moments.iter_mut().zip([value * value, value * rate, rate * rate]) {
                *moment += product / f64::from(count);
            }
        }
        let expected = [variance * h.powi(3) / 3.0, variance * h * h / 2.0, variance * h];
        for (moment, expected) in moments.iter().zip(expected) {
            assert!((moment / expected - 1.0).abs() < 0.04, "{moment} against {expected}");
        }
    }

    /// 1000 steps of 27 ambiguities with probability 0.005: 135 expected, with a standard deviation of 11.6.
    #[test]
    fn ambiguities_jump_as_often_as_in_the_paper() {
        let record = Record::simulate(&Scenario::default(), &mut stream(3, 0));
        let jumps: Vec<i64> = record.truth.iter().flat_map(|truth| truth.jumps.iter().copied()).collect();
        let count = jumps.iter().filter(|&&jump| jump != 0).count();
        assert!((90..180).contains(&count), "{count}");
        assert!(jumps.iter().all(|jump| jump.abs() <= 10));
        for pair in record.truth.windows(2) {
            let moved = pair[1].ambiguities.iter().zip(&pair[0].ambiguities).map(|(now, before)| now - before);
            assert!(moved.eq(pair[1].jumps.iter().copied()));
        }
    }

    /// Noise of L1 code in double differences: 2 σ² on each difference twice, hence 4 · 0.25 m²; of 1001 × 9 correlated
    /// samples the variance is known to some 3 %.
    #[test]
    fn noise_counts_twice_in_double_differences() {
        for (differences, expected) in [(Differences::Double, 1.0), (Differences::Single, 0.5)] {
            let noisy = Scenario { differences, ..Scenario::default() };
            let silent = Scenario { noise: SILENT, ..noisy };
            let [noisy, silent] = [noisy, silent].map(|scenario| Record::simulate(&scenario, &mut stream(4, 0)));
            let code = |record: &Record| -> Vec<f64> {
                record.measurements.iter().flat_map(|y| y[..DIFFERENCES].to_vec()).collect()
            };
            let (noisy, silent) = (code(&noisy), code(&silent));
            let variance = noisy.iter().zip(&silent).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / noisy.len() as f64;
            assert!((variance / expected - 1.0).abs() < 0.12, "{variance}");
        }
    }

    #[test]
    fn runs_differ_and_repeat() {
        let first = |seed, run| {
            let scenario = Scenario { last: 0, ..Scenario::default() };
            Record::simulate(&scenario, &mut stream(seed, run)).measurements
        };
        assert_eq!(first(1, 0), first(1, 0));
        assert_ne!(first(1, 0), first(1, 1));
        assert_ne!(first(1, 0), first(2, 0));
    }
}
