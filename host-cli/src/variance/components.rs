//! Variance components σ_k of a linear problem with D{w} = Q = Q₀ + Σ σ_k Q_k, Zhang et al. (2020), Section 4.
//!
//! All four estimators are one step of weighted least squares on vec(Z − Q₀) = Σ σ_k vec(Q_k), repeated to its fixed point:
//!
//! | estimator | Z | weight | fixed point |
//! |---|---|---|---|
//! | maximum likelihood (32) | ê êᵀ | Q⁻¹ ⊗ Q⁻¹ | ML of σ and x together: loses the degrees of freedom of x |
//! | least-squares EM (31) | ê êᵀ + A (Aᵀ Q⁻¹ A)⁻¹ Aᵀ | Q⁻¹ ⊗ Q⁻¹ | REML |
//! | REML | y yᵀ, with M = Q⁻¹ − Q⁻¹ A (Aᵀ Q⁻¹ A)⁻¹ Aᵀ Q⁻¹ in place of Q⁻¹ | M ⊗ M | REML |
//! | LS-VCE (34) | t tᵀ, t = Bᵀ y, Bᵀ A = 0 | V ⊗ V; V = (Bᵀ Q B)⁻¹ gives REML | REML, or unbiased for any V |
//!
//! As meant, not as printed: (29) has ln |Q| for log Q, (30) no Z_ML, and the weight under (34) is inverse. The E-step (30) takes
//! x as unknown beforehand, so that the fixed point of (31) is that of REML and not, as the paper has it, that of maximum
//! likelihood; it equals maximum likelihood of the measurements alone, x integrated out, which is what EM on a state-space
//! model maximises. Cost p² m³: small problems only.

use super::linear::Linear;
use nalgebra::{DMatrix, DVector};

/// y = A x + w.
#[derive(Clone, Debug, PartialEq)]
pub struct Components {
    /// y, m entries.
    pub values: DVector<f64>,
    /// A, m × n of full column rank.
    pub design: DMatrix<f64>,
    /// Q₀, m × m.
    pub known: DMatrix<f64>,
    /// Q_k, m × m.
    pub cofactors: Vec<DMatrix<f64>>,
}

/// Which estimator.
#[derive(Clone, Debug, PartialEq)]
pub enum Estimator {
    /// (32).
    MaximumLikelihood,
    /// (29) to (31).
    Em,
    /// Restricted maximum likelihood.
    Reml,
    /// (33), (34) with V; `None` for the inverse covariance of the misclosures.
    LeastSquares(Option<DMatrix<f64>>),
}

impl Components {
    /// Q.
    pub fn covariance(&self, sigma: &[f64]) -> DMatrix<f64> {
        self.cofactors.iter().zip(sigma).fold(self.known.clone(), |sum, (q, sigma)| sum + q * *sigma)
    }

    /// x̂ and its covariance (Aᵀ Q⁻¹ A)⁻¹; `None` if Q or it is not positive definite.
    pub fn solve(&self, sigma: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let q = self.covariance(sigma).cholesky()?;
        let weighted = q.solve(&self.design);
        let covariance = (self.design.transpose() * &weighted).cholesky()?.inverse();
        Some((&covariance * (weighted.transpose() * &self.values), covariance))
    }

    /// −2 ln of the restricted likelihood without constants: ln |Q| + ln |Aᵀ Q⁻¹ A| + yᵀ M y.
    pub fn restricted_likelihood(&self, sigma: &[f64]) -> Option<f64> {
        let q = self.covariance(sigma).cholesky()?;
        let normal = (self.design.transpose() * q.solve(&self.design)).cholesky()?;
        let residual = &self.values - &self.design * self.solve(sigma)?.0;
        Some(q.ln_determinant() + normal.ln_determinant() + residual.dot(&q.solve(&residual)))
    }

    /// B: an orthonormal basis of what A cannot reach, m × (m − n).
    pub fn misclosures(&self) -> Option<DMatrix<f64>> {
        let (m, n) = self.design.shape();
        let inverse = (self.design.transpose() * &self.design).cholesky()?.inverse();
        let projector = DMatrix::identity(m, m) - &self.design * inverse * self.design.transpose();
        let eigen = projector.symmetric_eigen();
        let columns: Vec<_> = (0..m).filter(|&i| eigen.eigenvalues[i] > 0.5).collect();
        (columns.len() == m - n).then(|| eigen.eigenvectors.select_columns(&columns))
    }

    /// One step from σ.
    pub fn step(&self, estimator: &Estimator, sigma: &[f64]) -> Option<Vec<f64>> {
        let q = self.covariance(sigma).cholesky()?;
        let y = &self.values;
        match estimator {
            Estimator::MaximumLikelihood | Estimator::Em => {
                let (x, covariance) = self.solve(sigma)?;
                let residual = y - &self.design * x;
                let mut z = &residual * residual.transpose();
                if *estimator == Estimator::Em {
                    z += &self.design * covariance * self.design.transpose();
                }
                estimate(&q.inverse(), &z, &self.known, &self.cofactors)
            }
            Estimator::Reml => {
                let weighted = q.solve(&self.design);
                let m = q.inverse() - &weighted * self.solve(sigma)?.1 * weighted.transpose();
                estimate(&m, &(y * y.transpose()), &self.known, &self.cofactors)
            }
            Estimator::LeastSquares(weight) => {
                let b = self.misclosures()?;
                let project = |q: &DMatrix<f64>| b.transpose() * q * &b;
                let t = b.transpose() * y;
                let weight = match weight {
                    Some(weight) => weight.clone(),
                    None => project(&self.covariance(sigma)).cholesky()?.inverse(),
                };
                let cofactors: Vec<_> = self.cofactors.iter().map(project).collect();
                estimate(&weight, &(&t * t.transpose()), &project(&self.known), &cofactors)
            }
        }
    }

    /// Steps until no σ changes by more than 1e-12 of itself, at most so many.
    pub fn estimate(&self, estimator: &Estimator, start: &[f64], steps: usize) -> Option<Vec<f64>> {
        let mut sigma = start.to_vec();
        for _ in 0..steps {
            let next = self.step(estimator, &sigma)?;
            let change = next.iter().zip(&sigma).map(|(a, b)| (a - b).abs() / b.abs()).fold(0.0, f64::max);
            sigma = next;
            if change < 1e-12 {
                break;
            }
        }
        Some(sigma)
    }
}

/// σ of vec(Z − Q₀) = Σ σ_k vec(Q_k) with the weight W ⊗ W: vec(A)ᵀ (W ⊗ W) vec(B) = tr(A W B W).
fn estimate(w: &DMatrix<f64>, z: &DMatrix<f64>, known: &DMatrix<f64>, cofactors: &[DMatrix<f64>]) -> Option<Vec<f64>> {
    let weighted: Vec<_> = cofactors.iter().map(|q| w * q * w).collect();
    let p = cofactors.len();
    let normal = DMatrix::from_fn(p, p, |i, j| weighted[i].dot(&cofactors[j]));
    let right = DVector::from_fn(p, |i, _| weighted[i].dot(&(z - known)));
    Some(normal.cholesky()?.solve(&right).as_slice().to_vec())
}

/// (28): a state-space model as a problem of least squares in all its states x_0 … x_N, after a row for each state of x_0
/// by its prior (the paper has none). Components: one for all Q_t, one for all R_t, in units of what the model has.
pub fn least_squares(model: &Linear) -> Components {
    let (n, epochs) = (model.mean.len(), model.values.len());
    let rows = n + model.designs.iter().map(|h| n + h.nrows()).sum::<usize>();
    let mut design = DMatrix::zeros(rows, n * (epochs + 1));
    let mut values = DVector::zeros(rows);
    let [mut known, mut process, mut noise] = [(); 3].map(|()| DMatrix::zeros(rows, rows));
    design.view_mut((0, 0), (n, n)).fill_with_identity();
    values.rows_mut(0, n).copy_from(&model.mean);
    known.view_mut((0, 0), (n, n)).copy_from(&model.covariance);
    let mut row = n;
    for t in 0..epochs {
        let (f, h) = (&model.transitions[t], &model.designs[t]);
        let m = h.nrows();
        design.view_mut((row, n * t), (n, n)).copy_from(f);
        design.view_mut((row, n * (t + 1)), (n, n)).copy_from(&-DMatrix::identity(n, n));
        process.view_mut((row, row), (n, n)).copy_from(&model.process[t]);
        row += n;
        design.view_mut((row, n * (t + 1)), (m, n)).copy_from(h);
        values.rows_mut(row, m).copy_from(&model.values[t]);
        noise.view_mut((row, row), (m, m)).copy_from(&model.noise[t]);
        row += m;
    }
    Components { values, design, known, cofactors: vec![process, noise] }
}

#[cfg(test)]
mod tests {
    use super::super::linear::tests::drawn;
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// 40 measurements of 6 unknowns in two groups of variances 1 and 9, with a known part of 0.1.
    fn problem(seed: u64) -> Components {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (m, n) = (40, 6);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let design = DMatrix::from_fn(m, n, |_, _| normal());
        let group = |g: usize| DMatrix::from_fn(m, m, |i, j| f64::from(i == j && i % 2 == g));
        let values = DVector::from_fn(m, |i, _| normal() * if i % 2 == 0 { 1.05 } else { 3.02 });
        Components { values, design, known: DMatrix::identity(m, m) * 0.1, cofactors: vec![group(0), group(1)] }
    }

    fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance * b.abs())
    }

    /// Three ways to the same numbers, and they minimise the restricted likelihood.
    #[test]
    fn ls_vce_with_the_inverse_weight_and_em_are_reml() {
        for seed in 1..=5 {
            let problem = problem(seed);
            let of = |estimator: Estimator, steps| problem.estimate(&estimator, &[1.0, 1.0], steps).unwrap();
            let reml = of(Estimator::Reml, 200);
            assert!(close(&of(Estimator::LeastSquares(None), 200), &reml, 1e-10));
            assert!(close(&of(Estimator::Em, 5000), &reml, 1e-9));
            let best = problem.restricted_likelihood(&reml).unwrap();
            for k in 0..2 {
                for factor in [0.95, 1.05] {
                    let mut other = reml.clone();
                    other[k] *= factor;
                    assert!(problem.restricted_likelihood(&other).unwrap() > best);
                }
            }
        }
    }

    /// With one component and nothing known both have closed forms: êᵀ Q₁⁻¹ ê over m and over m − n.
    #[test]
    fn maximum_likelihood_loses_the_degrees_of_freedom_of_the_unknowns() {
        let mut problem = problem(7);
        let (m, n) = problem.design.shape();
        problem.known.fill(0.0);
        problem.cofactors = vec![DMatrix::identity(m, m)];
        let of = |estimator: Estimator| problem.estimate(&estimator, &[1.0], 2000).unwrap()[0];
        let (ml, reml, em) = (of(Estimator::MaximumLikelihood), of(Estimator::Reml), of(Estimator::Em));
        let residual = &problem.values - &problem.design * problem.solve(&[1.0]).unwrap().0;
        assert!((ml - residual.norm_squared() / m as f64).abs() < 1e-12 * ml);
        assert!((reml - residual.norm_squared() / (m - n) as f64).abs() < 1e-12 * reml);
        assert!((ml / reml - (m - n) as f64 / m as f64).abs() < 1e-12);
        assert!((em / reml - 1.0).abs() < 1e-9);
    }

    /// LS-VCE is unbiased whatever its weight: the mean of 400 estimates is within 4 of its standard errors.
    #[test]
    fn ls_vce_is_unbiased_with_unit_weight() {
        let (runs, size) = (400, 40 - 6);
        let estimator = Estimator::LeastSquares(Some(DMatrix::identity(size, size)));
        let estimates: Vec<f64> =
            (0..runs).map(|seed| problem(100 + seed).step(&estimator, &[1.0, 1.0]).unwrap()[0]).collect();
        let mean = estimates.iter().sum::<f64>() / runs as f64;
        let spread = estimates.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / runs as f64;
        // 1.05² less the known 0.1.
        assert!((mean - (1.05f64.powi(2) - 0.1)).abs() < 4.0 * (spread / runs as f64).sqrt(), "{mean}");
    }

    /// The smoother is the least-squares solution of (28), and EM on the state-space model ends where REML of (28) does.
    #[test]
    fn a_state_space_model_is_a_problem_of_least_squares() {
        let mut model = drawn(3, 12);
        let passes = model.passes().unwrap();
        let problem = least_squares(&model);
        let (x, covariance) = problem.solve(&[1.0, 1.0]).unwrap();
        for (t, (mean, p)) in passes.smoothed.iter().zip(&passes.smoothed_covariances).enumerate() {
            assert!((x.rows(2 * t, 2) - mean).amax() < 1e-11);
            assert!((covariance.view((2 * t, 2 * t), (2, 2)) - p).amax() < 1e-11);
        }
        let reml = problem.estimate(&Estimator::Reml, &[1.0, 1.0], 500).unwrap();
        // A step of EM with one scale for all Q_t and one for all R_t.
        let (q, r) = (model.process.clone(), model.noise.clone());
        let mut sigma = [1.0, 1.0];
        for _ in 0..20_000 {
            model.process = q.iter().map(|q| q * sigma[0]).collect();
            model.noise = r.iter().map(|r| r * sigma[1]).collect();
            let passes = model.passes().unwrap();
            let mean =
                |moments: &[DMatrix<f64>]| moments.iter().map(DMatrix::trace).sum::<f64>() / (2 * moments.len()) as f64;
            let next = [mean(&passes.process), mean(&passes.noise)];
            let change = (next[0] / sigma[0] - 1.0).abs().max((next[1] / sigma[1] - 1.0).abs());
            sigma = next;
            if change < 1e-13 {
                break;
            }
        }
        assert!(close(&sigma, &reml, 1e-8), "{sigma:?} {reml:?}");
    }
}
