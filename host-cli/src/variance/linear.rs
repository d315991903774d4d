//! A linear state-space model by its matrices: filter, smoother, and a step of EM, Zhang et al. (2020), (7) to (27).
//!
//! ```text
//! x_t = F_t x_{t−1} + w_t,   y_t = H_t x_t + v_t,   w_t ~ N(0, Q_t),  v_t ~ N(0, R_t),  t = 1 … N
//! ```
//! As meant, not as printed: (24) has its third term transposed, and is taken in its centred form,
//! C = w wᵀ + P_t + F P_{t−1} Fᵀ − F Lᵀ − L Fᵀ with L = Cov(x_t, x_{t−1} | Y) = P_{t|N} J_{t−1}ᵀ (raw second moments lose 1e-2 m²
//! at the size of the Earth); R_t of (27) is (26); (21) is −2 ln p, to be minimised. Cost of an epoch about 10 n³ and
//! 4 m n²; nothing panics if the dimensions agree.

use nalgebra::{DMatrix, DVector};

/// The model and its measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// F_t, n × n.
    pub transitions: Vec<DMatrix<f64>>,
    /// H_t, m × n.
    pub designs: Vec<DMatrix<f64>>,
    /// Q_t, n × n.
    pub process: Vec<DMatrix<f64>>,
    /// R_t, m × m.
    pub noise: Vec<DMatrix<f64>>,
    /// μ₀.
    pub mean: DVector<f64>,
    /// P₀.
    pub covariance: DMatrix<f64>,
    /// y_t.
    pub values: Vec<DVector<f64>>,
}

/// Filter and smoother.
#[derive(Clone, Debug, PartialEq)]
pub struct Passes {
    /// x_{t|t}, t = 0 … N.
    pub filtered: Vec<DVector<f64>>,
    /// P_{t|t}.
    pub filtered_covariances: Vec<DMatrix<f64>>,
    /// x_{t|N}, t = 0 … N.
    pub smoothed: Vec<DVector<f64>>,
    /// P_{t|N}.
    pub smoothed_covariances: Vec<DMatrix<f64>>,
    /// P_{t,t−1|N} = Cov(x_t, x_{t−1} | Y), t = 1 … N.
    pub lag_one: Vec<DMatrix<f64>>,
    /// C_t = E[w_t w_tᵀ | Y], (24).
    pub process: Vec<DMatrix<f64>>,
    /// B_t = E[v_t v_tᵀ | Y], (26).
    pub noise: Vec<DMatrix<f64>>,
    /// ℓ, (21).
    pub likelihood: f64,
}

/// What the M-step estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pooling {
    /// One Q and one R for all epochs, instead of one for each.
    pub pooled: bool,
    /// Whether R is diagonal.
    pub diagonal: bool,
}

impl Linear {
    /// Filter and smoother; `None` if a covariance that has to be inverted is not positive definite.
    pub fn passes(&self) -> Option<Passes> {
        let n = self.mean.len();
        let mut filtered = vec![self.mean.clone()];
        let mut filtered_covariances = vec![self.covariance.clone()];
        let mut predictions = Vec::new();
        let mut likelihood = 0.0;
        for t in 0..self.values.len() {
            let (f, h) = (&self.transitions[t], &self.designs[t]);
            let mean = f * &filtered[t];
            let p = f * &filtered_covariances[t] * f.transpose() + &self.process[t];
            let innovation = &self.values[t] - h * &mean;
            let s = (h * &p * h.transpose() + &self.noise[t]).cholesky()?;
            let gain = s.solve(&(h * &p)).transpose();
            likelihood += s.ln_determinant() + innovation.dot(&s.solve(&innovation));
            filtered.push(&mean + &gain * innovation);
            let a = DMatrix::identity(n, n) - &gain * h;
            let updated = &a * &p * a.transpose() + &gain * &self.noise[t] * gain.transpose();
            filtered_covariances.push(0.5 * (&updated + updated.transpose()));
            predictions.push((mean, p));
        }
        let (mut smoothed, mut smoothed_covariances) = (filtered.clone(), filtered_covariances.clone());
        let [mut lag_one, mut process, mut noise] = [(); 3].map(|()| vec![DMatrix::zeros(0, 0); self.values.len()]);
        for t in (0..self.values.len()).rev() {
            let (f, h, (mean, p)) = (&self.transitions[t], &self.designs[t], &predictions[t]);
            let j = p.clone().cholesky()?.solve(&(f * &filtered_covariances[t])).transpose();
            let next = &smoothed_covariances[t + 1];
            let back = &filtered_covariances[t] + &j * (next - p) * j.transpose();
            let l = next * j.transpose();
            smoothed[t] = &filtered[t] + &j * (&smoothed[t + 1] - mean);
            let w = &smoothed[t + 1] - f * &smoothed[t];
            let fl = f * l.transpose();
            process[t] = &w * w.transpose() + next + f * &back * f.transpose() - &fl - fl.transpose();
            let e = &self.values[t] - h * &smoothed[t + 1];
            noise[t] = &e * e.transpose() + h * next * h.transpose();
            lag_one[t] = l;
            smoothed_covariances[t] = back;
        }
        Some(Passes {
            filtered,
            filtered_covariances,
            smoothed,
            smoothed_covariances,
            lag_one,
            process,
            noise,
            likelihood,
        })
    }

    /// The M-step (27) for Q and R; μ₀ and P₀ stay.
    pub fn maximize(&mut self, passes: &Passes, pooling: Pooling) {
        let of = |moments: &[DMatrix<f64>]| -> Vec<DMatrix<f64>> {
            match moments.first() {
                Some(first) if pooling.pooled => {
                    let zero = DMatrix::zeros(first.nrows(), first.ncols());
                    let mean = moments.iter().fold(zero, |sum, moment| sum + moment) / moments.len() as f64;
                    vec![mean; moments.len()]
                }
                _ => moments.to_vec(),
            }
        };
        self.process = of(&passes.process);
        self.noise = of(&passes.noise);
        if pooling.diagonal {
            self.noise.iter_mut().for_each(|r| *r = DMatrix::from_diagonal(&r.diagonal()));
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// A model of two states and two measurements over N epochs, and measurements drawn from it.
    pub fn drawn(seed: u64, epochs: usize) -> Linear {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |scale: f64| scale * rng.sample::<f64, _>(StandardNormal);
        let matrix = |a: [f64; 4]| DMatrix::from_row_slice(2, 2, &a);
        let f = matrix([0.9, 0.2, -0.1, 0.8]);
        let mut x = DVector::from_vec(vec![normal(1.0), normal(1.0)]);
        let (mut designs, mut values) = (Vec::new(), Vec::new());
        for _ in 0..epochs {
            x = &f * x + DVector::from_vec(vec![normal(0.7), normal(0.4)]);
            let h = DMatrix::from_fn(2, 2, |_, _| normal(1.0));
            values.push(&h * &x + DVector::from_vec(vec![normal(0.5), normal(1.2)]));
            designs.push(h);
        }
        Linear {
            transitions: vec![f; epochs],
            designs,
            process: vec![DMatrix::identity(2, 2); epochs],
            noise: vec![DMatrix::identity(2, 2); epochs],
            mean: DVector::zeros(2),
            covariance: DMatrix::identity(2, 2),
            values,
        }
    }

    /// ℓ never rises, and (15), (16) of the paper give the same lag-one covariances as P_{t|N} Jᵀ.
    #[test]
    fn em_never_raises_the_likelihood() {
        for (seed, pooled, diagonal) in [(1, true, false), (2, true, true), (3, false, true)] {
            let mut model = drawn(seed, 25);
            let mut last = f64::INFINITY;
            for _ in 0..30 {
                let passes = model.passes().unwrap();
                assert!(passes.likelihood <= last + 1e-9, "{} {last}", passes.likelihood);
                last = passes.likelihood;
                model.maximize(&passes, Pooling { pooled, diagonal });
            }
        }
    }

    #[test]
    fn lag_one_covariances_are_those_of_the_recursion() {
        let model = drawn(5, 12);
        let passes = model.passes().unwrap();
        let last = model.values.len() - 1;
        let predicted = |t: usize| {
            let f = &model.transitions[t];
            f * &passes.filtered_covariances[t] * f.transpose() + &model.process[t]
        };
        let j = |t: usize| {
            let f = &model.transitions[t];
            predicted(t).cholesky().unwrap().solve(&(f * &passes.filtered_covariances[t])).transpose()
        };
        // (15): (I − K H) = P_{N|N} (P_{N|N−1})⁻¹.
        let reduction = &passes.filtered_covariances[last + 1] * predicted(last).try_inverse().unwrap();
        let mut lag = reduction * &model.transitions[last] * &passes.filtered_covariances[last];
        for t in (0..=last).rev() {
            assert!((&lag - &passes.lag_one[t]).amax() < 1e-12);
            if t > 0 {
                let p = &passes.filtered_covariances[t];
                lag = p * j(t - 1).transpose() + j(t) * (&lag - &model.transitions[t] * p) * j(t - 1).transpose();
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_none() {
        let mut model = drawn(1, 4);
        model.noise[2] = -100.0 * DMatrix::identity(2, 2);
        assert_eq!(model.passes(), None);
    }
}
