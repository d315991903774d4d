//! Four kinds of measurement noise.
//!
//! | kind | undifferenced noise of a receiver |
//! |---|---|
//! | constant | white, 0.3 m and 1 cm: eq. (9) of the paper exactly |
//! | varying | white, 4 times (code) and 3 times (phase) as large under trees |
//! | correlated | Gauss–Markov multipath of 30 s, 0.3 m and 5 mm over sin E, 4 and 2 times as large under trees; white 0.1 m and 3 mm; ionosphere 0.5 ppm of the baseline over sin E, of 1000 s |
//! | heavy | correlated; Student's t of three degrees of freedom for the white part; under trees a third of the satellites below 35° is seen by reflection only: a code too long by an exponential distribution of 5 m in the mean, a phase off by up to a quarter of a wave |
//!
//! Differences rover minus base of both receivers, each with noise of its own.

use super::scenario::{in_trees, sin_elevation};
use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Exp1, StandardNormal, StudentT};
use surefix_core::filter::double_difference::Options;

/// A kind of noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Noise {
    /// White, as the paper's filter has it.
    Constant,
    /// White, larger under trees.
    Varying,
    /// Multipath, correlated in time, and ionosphere.
    Correlated,
    /// That with outliers and reflections.
    Heavy,
}

impl Noise {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Constant, Self::Varying, Self::Correlated, Self::Heavy];

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Varying => "varying",
            Self::Correlated => "correlated",
            Self::Heavy => "heavy",
        }
    }
}

/// Errors of a satellite in an epoch, rover minus base `[m]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Code on both bands.
    pub code: [f64; 2],
    /// Phase on both bands.
    pub phase: [f64; 2],
}

/// Correlation times of multipath and ionosphere `[s]`.
const TIMES: [f64; 2] = [30.0, 1000.0];
/// Ionosphere for a baseline, per metre.
const IONOSPHERE: f64 = 0.5e-6;
/// Code and phase of the constant kind `[m]`.
const WHITE: [f64; 2] = [0.3, 0.01];
/// Multipath in the zenith, and what is white beside it `[m]`: code, phase.
const MULTIPATH: [f64; 2] = [0.3, 0.005];
const BESIDE: [f64; 2] = [0.1, 0.003];

/// Noise of all satellites as it goes on.
#[derive(Clone, Debug)]
pub struct Noises {
    kind: Noise,
    /// Gauss–Markov states of unit variance: for each satellite two receivers, two bands, code and phase.
    multipath: Vec<[[[f64; 2]; 2]; 2]>,
    ionosphere: Vec<f64>,
    /// Whether a satellite is seen by reflection only; excess of its code, and of its phase on both bands `[m]`.
    reflected: Vec<Option<(f64, [f64; 2])>>,
}

/// Standard normal.
pub(super) fn normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

impl Noises {
    /// Noise at the start, in its steady state.
    pub fn new(kind: Noise, satellites: usize, random: &mut ChaCha8Rng) -> Self {
        let multipath = (0..satellites).map(|_| [(); 2].map(|()| [(); 2].map(|()| [(); 2].map(|()| normal(random)))));
        Self {
            kind,
            multipath: multipath.collect(),
            ionosphere: (0..satellites).map(|_| normal(random)).collect(),
            reflected: vec![None; satellites],
        }
    }

    /// Errors of the next epoch, of all satellites whether in sight or not.
    pub fn next(
        &mut self,
        positions: &[Vector3<f64>],
        second: f64,
        baseline: f64,
        random: &mut ChaCha8Rng,
    ) -> Vec<Errors> {
        let trees = in_trees(second);
        let [keep, keep_slow] = TIMES.map(|time| (-1.0 / time).exp());
        let step = |state: &mut f64, keep: f64, draw: f64| *state = keep * *state + (1.0 - keep * keep).sqrt() * draw;
        positions
            .iter()
            .enumerate()
            .map(|(k, position)| {
                let sine = sin_elevation(position).max(0.1);
                let mut errors = Errors::default();
                step(&mut self.ionosphere[k], keep_slow, normal(random));
                for receiver in 0..2 {
                    let sign = if receiver == 0 { 1.0 } else { -1.0 };
                    for band in 0..2 {
                        for (kind, value) in [&mut errors.code[band], &mut errors.phase[band]].into_iter().enumerate() {
                            let state = &mut self.multipath[k][receiver][band][kind];
                            step(state, keep, normal(random));
                            let (white, heavy) = (normal(random), random.sample(student()));
                            *value += sign
                                * match self.kind {
                                    Noise::Constant => WHITE[kind] * white,
                                    Noise::Varying => WHITE[kind] * white * if trees { [4.0, 3.0][kind] } else { 1.0 },
                                    Noise::Correlated | Noise::Heavy => {
                                        let more = if trees { [4.0, 2.0][kind] } else { 1.0 };
                                        let beside = if self.kind == Noise::Heavy { heavy } else { white };
                                        MULTIPATH[kind] / sine * more * *state + BESIDE[kind] * beside
                                    }
                                };
                        }
                    }
                }
                if matches!(self.kind, Noise::Correlated | Noise::Heavy) {
                    let delay = IONOSPHERE * baseline / sine * self.ionosphere[k];
                    for band in 0..2 {
                        let wavelengths = Options::PAPER.wavelengths;
                        let on_band = delay * (wavelengths[band] / wavelengths[0]).powi(2);
                        errors.code[band] += on_band;
                        errors.phase[band] -= on_band;
                    }
                }
                self.reflect(k, trees && sine < 35f64.to_radians().sin(), random);
                if let (Noise::Heavy, Some((code, phase))) = (self.kind, self.reflected[k]) {
                    for band in 0..2 {
                        errors.code[band] += code;
                        errors.phase[band] += phase[band];
                    }
                }
                errors
            })
            .collect()
    }

    /// Reflections begin and end, of 10 s in the mean; a third of the time there is one.
    fn reflect(&mut self, satellite: usize, low: bool, random: &mut ChaCha8Rng) {
        let (draw, excess): (f64, f64) = (random.random(), random.sample(Exp1));
        let quarters = Options::PAPER.wavelengths.map(|wavelength| wavelength / 4.0 * random.random_range(-1.0..1.0));
        let reflected = &mut self.reflected[satellite];
        match reflected {
            _ if !low => *reflected = None,
            Some(_) if draw < 0.1 => *reflected = None,
            None if draw < 0.05 => *reflected = Some((5.0 * excess, quarters)),
            _ => (),
        }
    }
}

/// Student's t of three degrees of freedom.
fn student() -> StudentT<f64> {
    StudentT::new(3.0).expect("three degrees of freedom")
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::super::scenario::satellites;
    use super::*;

    fn deviation(kind: Noise, seconds: std::ops::Range<usize>, value: impl Fn(&Errors) -> f64) -> f64 {
        let mut random = stream(3, 0);
        let positions = satellites(0.0);
        let mut noises = Noises::new(kind, positions.len(), &mut random);
        let (mut sum, mut count) = (0.0, 0.0);
        for second in 0..seconds.end {
            let errors = noises.next(&positions, second as f64, 1e4, &mut random);
            for (error, position) in errors.iter().zip(&positions) {
                // High ones, so that elevation and reflections do not matter.
                if seconds.contains(&second) && sin_elevation(position) > 0.9 {
                    sum += value(error).powi(2);
                    count += 1.0;
                }
            }
        }
        (sum / count).sqrt()
    }

    /// √2 of the undifferenced figures of the table, within the scatter of a few hundred samples.
    #[test]
    fn noise_is_as_large_as_the_table_says() {
        let near = |a: f64, b: f64, share: f64| assert!((a / b - 1.0).abs() < share, "{a} {b}");
        let root = 2f64.sqrt();
        near(deviation(Noise::Constant, 0..600, |e| e.code[0]), 0.3 * root, 0.1);
        near(deviation(Noise::Constant, 600..800, |e| e.phase[1]), 0.01 * root, 0.15);
        near(deviation(Noise::Varying, 600..800, |e| e.code[1]), 1.2 * root, 0.15);
        near(deviation(Noise::Varying, 0..600, |e| e.phase[0]), 0.01 * root, 0.1);
        let multipath = (0.3f64 * 0.3 + 0.1 * 0.1).sqrt() * root;
        near(deviation(Noise::Correlated, 0..600, |e| e.code[0]), multipath, 0.35);
    }
}
