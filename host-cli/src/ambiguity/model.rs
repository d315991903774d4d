//! Float double-difference ambiguities as two receivers get them: their covariance follows from the geometry, the noise
//! and what is known of the ionosphere, and a draw of them from the covariance.
//!
//! One epoch, satellites s = 1…S of which the highest is the reference, bands f:
//! ```text
//! code   P_f = G b + μ_f ι + e           e ~ (0, σ_P² D C Dᵀ)      b baseline, free
//! phase  Φ_f = G b − μ_f ι + λ_f n + ε   ε ~ (0, σ_Φ² D C Dᵀ)      ι ionosphere on the first band, ~ (0, σ_ι² D Dᵀ)
//! ```
//! with G the double-differenced lines of sight, μ_f = (f₁/f)², D = [−1 I] and C = 2 diag(1/sin² elevation). The
//! covariance of n̂ is the ambiguity block of the inverse normal matrix; over K epochs in which the geometry hardly
//! changes it is 1/K of that. P. J. G. Teunissen, *A canonical theory for short GPS
//! baselines*, J. Geodesy 71 (1997).

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::linalg::{LinalgError, Mat, MatMut, block, cholesky, triangular};

/// GPS L1, L2 and L5 `[Hz]`.
pub const FREQUENCIES: [f64; 3] = [1_575.42e6, 1_227.60e6, 1_176.45e6];

/// Satellites below are not used `[rad]`.
const ELEVATION_MASK: f64 = 0.175;

/// What the receivers see and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Satellites in sight, the reference included.
    pub satellites: usize,
    /// Carrier frequencies `[Hz]`.
    pub frequencies: Vec<f64>,
    /// Standard deviation of a code in the zenith, not differenced `[m]`.
    pub code: f64,
    /// Standard deviation of a phase in the zenith, not differenced `[m]`.
    pub phase: f64,
    /// Standard deviation of the ionosphere of a satellite between the receivers `[m]`; 0 where there is none.
    pub ionosphere: f64,
    /// Epochs of the same geometry.
    pub epochs: u32,
}

impl Default for Model {
    /// Seven satellites on two bands, one epoch, a short baseline.
    fn default() -> Self {
        let frequencies = FREQUENCIES[..2].to_vec();
        Self { satellites: 7, frequencies, code: 0.3, phase: 0.003, ionosphere: 0.0, epochs: 1 }
    }
}

/// Float ambiguities.
#[derive(Clone, Debug, PartialEq)]
pub struct FloatAmbiguities {
    /// The integers they scatter around `[cycles]`.
    pub truth: Vec<i64>,
    /// n̂ `[cycles]`.
    pub float: Vec<f64>,
    /// Their covariance, n × n `[cycles²]`.
    pub covariance: Vec<f64>,
}

impl Model {
    /// As many double-difference ambiguities.
    pub fn dimension(&self) -> usize {
        self.satellites.saturating_sub(1) * self.frequencies.len()
    }

    /// A random sky and ambiguities drawn under it. The same seed gives the same.
    pub fn draw(&self, seed: u64) -> Result<FloatAmbiguities, LinalgError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let covariance = self.covariance(&self.sky(&mut random))?;
        let n = self.dimension();
        let mut factor = covariance.clone();
        let mut factor = MatMut::square(&mut factor, n)?;
        cholesky::factor(&mut factor)?;
        let truth: Vec<i64> = (0..n).map(|_| random.random_range(-100..=100)).collect();
        let noise: Vec<f64> = (0..n).map(|_| random.sample(StandardNormal)).collect();
        let scattered = |(i, &integer): (usize, &i64)| {
            let error: f64 = factor.row(i).iter().zip(&noise).take(i + 1).map(|(l, e)| l * e).sum();
            integer as f64 + error
        };
        let float = truth.iter().enumerate().map(scattered).collect();
        Ok(FloatAmbiguities { truth, float, covariance })
    }

    /// Azimuth and elevation of satellites spread evenly over the sky, the highest first.
    fn sky(&self, random: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
        let lowest = ELEVATION_MASK.sin();
        let mut direction = || [random.random_range(0.0..TAU), random.random_range(lowest..1.0_f64).asin()];
        let mut sky: Vec<[f64; 2]> = (0..self.satellites).map(|_| direction()).collect();
        sky.sort_by(|a, b| b[1].total_cmp(&a[1]));
        sky
    }

    /// Covariance of the ambiguities, band by band.
    fn covariance(&self, sky: &[[f64; 2]]) -> Result<Vec<f64>, LinalgError> {
        let differences = self.satellites.saturating_sub(1);
        let has_ionosphere = self.ionosphere > 0.0;
        let delays = if has_ionosphere { differences } else { 0 };
        let n = self.dimension();
        // Unknowns: ambiguities, ionosphere, baseline; the ambiguities come first so that their block is in the corner.
        let unknowns = n + delays + 3;
        let mut normal = vec![0.0; unknowns * unknowns];

        let line = |[azimuth, elevation]: [f64; 2]| {
            let horizontal = elevation.cos();
            [horizontal * azimuth.sin(), horizontal * azimuth.cos(), elevation.sin()]
        };
        let reference = line(sky[0]);
        let variance = |k: usize| 2.0 / sky[k][1].sin().powi(2);
        for (band, &frequency) in self.frequencies.iter().enumerate() {
            let delay = (self.frequencies[0] / frequency).powi(2);
            for (sigma, is_phase) in [(self.code, false), (self.phase, true)] {
                let mut rows = vec![0.0; differences * unknowns];
                let mut noise = vec![0.0; differences * differences];
                for i in 0..differences {
                    let row = &mut rows[i * unknowns..(i + 1) * unknowns];
                    for (axis, (at, from)) in line(sky[i + 1]).into_iter().zip(reference).enumerate() {
                        row[n + delays + axis] = from - at;
                    }
                    if has_ionosphere {
                        row[n + i] = if is_phase { -delay } else { delay };
                    }
                    if is_phase {
                        row[band * differences + i] = SPEED_OF_LIGHT / frequency;
                    }
                    for j in 0..differences {
                        let own = if i == j { variance(i + 1) } else { 0.0 };
                        noise[i * differences + j] = sigma * sigma * (variance(0) + own);
                    }
                }
                add_normal(&mut normal, &mut rows, &mut noise, differences, unknowns)?;
            }
        }
        if has_ionosphere {
            let mut rows = vec![0.0; differences * unknowns];
            let mut noise = vec![self.ionosphere * self.ionosphere; differences * differences];
            for i in 0..differences {
                rows[i * unknowns + n + i] = 1.0;
                noise[i * (differences + 1)] *= 2.0;
            }
            add_normal(&mut normal, &mut rows, &mut noise, differences, unknowns)?;
        }

        // N = L Lᵀ, so that N⁻¹ = L⁻ᵀ L⁻¹.
        let mut inverse = MatMut::square(&mut normal, unknowns)?;
        cholesky::factor(&mut inverse)?;
        triangular::invert(&mut inverse)?;
        let entry = |i: usize, j: usize| -> f64 {
            let terms = (i.max(j)..unknowns).map(|k| inverse.row(k)[i] * inverse.row(k)[j]);
            terms.sum::<f64>() / f64::from(self.epochs.max(1))
        };
        Ok((0..n * n).map(|k| entry(k / n, k % n)).collect())
    }
}

/// Adds Aᵀ R⁻¹ A to the normal matrix; spoils A (`rows`) and R (`noise`).
fn add_normal(
    normal: &mut [f64],
    rows: &mut [f64],
    noise: &mut [f64],
    m: usize,
    unknowns: usize,
) -> Result<(), LinalgError> {
    let mut no_innovation = vec![0.0; m];
    let mut whitened = MatMut::new(rows, m, unknowns, unknowns)?;
    block::whiten(&mut whitened, &mut no_innovation, &mut MatMut::square(noise, m)?)?;
    let whitened: Mat<'_, f64> = whitened.into_ref();
    for k in 0..m {
        let row = whitened.row(k);
        for (normal, &factor) in normal.chunks_mut(unknowns).zip(row).filter(|(_, factor)| **factor != 0.0) {
            normal.iter_mut().zip(row).for_each(|(entry, &value)| *entry += factor * value);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::integer::{Config, Method, Workspace, resolve};

    #[test]
    fn the_same_seed_gives_the_same() {
        let model = Model::default();
        assert_eq!(model.draw(3), model.draw(3));
        assert_ne!(model.draw(3), model.draw(4));
        let drawn = model.draw(3).unwrap();
        assert_eq!((drawn.truth.len(), drawn.float.len(), drawn.covariance.len()), (12, 12, 144));
    }

    /// Four satellites on one band leave the baseline to the codes: n̂ = (Φ − P)/λ, Q = (σ_P² + σ_Φ²) D C Dᵀ / λ².
    #[test]
    fn by_hand_without_redundancy() {
        let model = Model { satellites: 4, frequencies: vec![FREQUENCIES[0]], ..Model::default() };
        let sky = model.sky(&mut ChaCha8Rng::seed_from_u64(1));
        let q = model.covariance(&sky).unwrap();
        let wavelength = SPEED_OF_LIGHT / FREQUENCIES[0];
        let scale = (model.code.powi(2) + model.phase.powi(2)) / wavelength.powi(2);
        let cofactor = |k: usize| 2.0 / sky[k][1].sin().powi(2);
        for i in 0..3 {
            for j in 0..3 {
                let expected = scale * (cofactor(0) + if i == j { cofactor(i + 1) } else { 0.0 });
                assert!((q[3 * i + j] / expected - 1.0).abs() < 1e-9, "{i} {j}");
            }
        }
    }

    /// Models for which a search of 10 000 nodes, RTKLIB's limit, gives up in most cases: there is an answer each time,
    /// it says how it was found, and it is no farther away than the bootstrapped one.
    #[test]
    fn weak_models_are_answered() {
        let frequencies = FREQUENCIES[..2].to_vec();
        let model = Model { satellites: 21, frequencies, ionosphere: 0.3, ..Model::default() };
        let n = model.dimension();
        let mut workspace = Box::new(Workspace::<f64, 40>::new());
        let mut large = 0;
        for seed in 0..20 {
            let drawn = model.draw(seed).unwrap();
            let q = Mat::square(&drawn.covariance, n).unwrap();
            let bootstrapped = resolve(&drawn.float, q, &Config { budget: 0 }, &mut workspace).unwrap();
            assert_eq!(bootstrapped.method, Method::Bootstrapped);
            let limit = bootstrapped.best_norm;
            let found = resolve(&drawn.float, q, &Config::default(), &mut workspace).unwrap();
            large += usize::from(found.nodes > 10_000);
            assert!(found.nodes <= Config::default().budget && found.best_norm <= limit, "seed {seed}");
            assert!(found.success_rate.success < 0.5, "seed {seed}: {:?}", found.success_rate);
            match found.method {
                Method::LeastSquares => assert!(found.second_norm >= found.best_norm, "seed {seed}"),
                Method::Bootstrapped => assert_eq!(found.ratio, 1.0, "seed {seed}"),
            }
        }
        assert!(large > 10, "{large} of 20 need more than 10 000 nodes");
    }

    /// More epochs and a known ionosphere make the ambiguities better known.
    #[test]
    fn strength_follows_the_model() {
        let trace = |model: &Model| -> f64 {
            let q = model.draw(5).unwrap().covariance;
            (0..model.dimension()).map(|i| q[i * (model.dimension() + 1)]).sum()
        };
        let strong = Model::default();
        let weak = Model { ionosphere: 0.3, ..Model::default() };
        assert!(trace(&weak) > trace(&strong));
        let longer = Model { epochs: 10, ..Model::default() };
        assert!((trace(&longer) * 10.0 / trace(&strong) - 1.0).abs() < 1e-12);
        assert!(Model { satellites: 3, ..Model::default() }.draw(1).is_err(), "the baseline cannot be found");
    }
}
