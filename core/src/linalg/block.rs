//! Kalman update by m correlated measurements at once, and whitening them for sequential use.
//!
//! Measurement y = H x + e, e ~ (0, R), H m × n, innovation ν = y − H x̂:
//! ```text
//! V = H P,  S = V Hᵀ + R = L Lᵀ,  W = L⁻¹ V,  z = L⁻¹ ν
//! x̂ ← x̂ + Wᵀ z,   P ← P − Wᵀ W
//! ```
//! which is K = P Hᵀ S⁻¹ without forming K. Cost m n² + m² n multiply-adds (dense H). Whitening instead replaces
//! (H, ν, R) by (L⁻¹ H, L⁻¹ ν, I) with R = L Lᵀ, after which [`super::sequential`] takes the rows one by one.
//!
//! Like the plain scalar form the block form is for priors up to about 1e5 times the measurement noise.

use super::view::{Mat, MatMut};
use super::{LinalgError, axpy, cholesky, dot, head_mut, triangular};
use crate::real::Real;

/// What a block update found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockUpdate<T> {
    /// Normalised innovation squared νᵀ S⁻¹ ν, χ² with m degrees of freedom if model and noise are right `[1]`.
    pub normalized_innovation_squared: T,
    /// ln det S.
    pub log_determinant: f64,
}

/// Updates `mean` and the full symmetric `p` by m measurements.
///
/// `innovation` (m) returns z, `r` (m × m, lower triangle read) returns L of S in its lower triangle, `work` (m × n)
/// returns W. On an error `mean` and `p` are unchanged.
pub fn update_block<T: Real>(
    mean: &mut [T],
    p: &mut MatMut<'_, T>,
    h: Mat<'_, T>,
    innovation: &mut [T],
    r: &mut MatMut<'_, T>,
    work: &mut MatMut<'_, T>,
) -> Result<BlockUpdate<T>, LinalgError> {
    let (m, n) = (h.rows(), mean.len());
    let shapes = [(p.rows(), n), (p.cols(), n), (h.cols(), n), (innovation.len(), m)];
    let workspaces = [(r.rows(), m), (r.cols(), m), (work.rows(), m), (work.cols(), n)];
    if shapes.iter().chain(&workspaces).any(|(is, wanted)| is != wanted) {
        return Err(LinalgError::Shape);
    }
    for i in 0..m {
        let row = work.row_mut(i);
        row.fill(T::ZERO);
        for (k, &h) in h.row(i).iter().enumerate() {
            if h != T::ZERO {
                axpy(row, h, p.row(k));
            }
        }
        for (entry, h) in head_mut(r.row_mut(i), i + 1).iter_mut().zip(h.iter()) {
            *entry += dot(work.row(i), h);
        }
    }
    cholesky::factor(r)?;
    triangular::forward_rows(r.as_ref(), work)?;
    triangular::forward(r.as_ref(), innovation)?;
    if !(innovation.iter().all(|z| z.is_finite()) && work.as_ref().iter().flatten().all(|w| w.is_finite())) {
        return Err(LinalgError::NotFinite);
    }
    subtract_gram(p, work.as_ref());
    for (i, &z) in innovation.iter().enumerate() {
        axpy(mean, z, work.row(i));
    }
    Ok(BlockUpdate {
        normalized_innovation_squared: dot(innovation, innovation),
        log_determinant: cholesky::log_determinant(r.as_ref()),
    })
}

/// P ← P − Wᵀ W for a full symmetric P (n × n) and W (m × n); the lower triangle is computed and mirrored.
pub(crate) fn subtract_gram<T: Real>(p: &mut MatMut<'_, T>, w: Mat<'_, T>) {
    for (i, row) in p.iter_mut().enumerate() {
        let to_diagonal = head_mut(row, i + 1);
        for w in w.iter() {
            if let Some(&w_i) = w.get(i) {
                axpy(to_diagonal, -w_i, w);
            }
        }
    }
    p.mirror_lower();
}

/// Whitens m measurements in place: `h` (m × n) becomes L⁻¹ H, `innovation` (m) becomes L⁻¹ ν, the lower triangle of
/// `r` (m × m) becomes L, R = L Lᵀ. The rows then have independent noise of variance 1.
///
/// If R is not positive definite, `h` and `innovation` are unchanged.
pub fn whiten<T: Real>(h: &mut MatMut<'_, T>, innovation: &mut [T], r: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    if h.rows() != r.rows() || innovation.len() != r.rows() {
        return Err(LinalgError::Shape);
    }
    cholesky::factor(r)?;
    triangular::forward_rows(r.as_ref(), h)?;
    triangular::forward(r.as_ref(), innovation)
}

#[cfg(test)]
mod tests {
    use super::super::sequential::{Row, update_scalar};
    use super::super::spd;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// One block update is whitening followed by scalar updates.
        #[test]
        fn block_and_whitened_sequence_agree(
            (n, prior) in spd::matrix(1..7usize),
            (m, noise) in spd::matrix(1..5usize),
            h in proptest::collection::vec(-1.0..1.0f64, 24),
            y in proptest::collection::vec(-3.0..3.0f64, 4),
        ) {
            let h = &h[..m * n];
            let (mut mean, mut p, mut work) = (vec![0.0; n], prior.clone(), vec![0.0; m * n]);
            let (mut r, mut z) = (noise.clone(), y[..m].to_vec());
            let update = update_block(
                &mut mean,
                &mut MatMut::square(&mut p, n).unwrap(),
                Mat::new(h, m, n, n).unwrap(),
                &mut z,
                &mut MatMut::square(&mut r, m).unwrap(),
                &mut MatMut::new(&mut work, m, n, n).unwrap(),
            )
            .unwrap();

            let (mut sequential_mean, mut sequential_p, mut gain) = (vec![0.0; n], prior.clone(), vec![0.0; n]);
            let (mut h, mut r, mut z) = (h.to_vec(), noise.clone(), y[..m].to_vec());
            let mut h = MatMut::new(&mut h, m, n, n).unwrap();
            whiten(&mut h, &mut z, &mut MatMut::square(&mut r, m).unwrap()).unwrap();
            let mut nis = 0.0;
            for i in 0..m {
                let nu = z[i] - dot(h.row(i), &sequential_mean);
                let mut p = MatMut::square(&mut sequential_p, n).unwrap();
                let found = update_scalar(&mut sequential_mean, &mut p, Row::Dense(h.row(i)), nu, 1.0, &mut gain);
                nis += found.unwrap().normalized_innovation.powi(2);
            }
            prop_assert!((nis / update.normalized_innovation_squared - 1.0).abs() < 1e-6);
            for k in 0..n * n {
                let scale = (prior[k / n * (n + 1)] * prior[k % n * (n + 1)]).sqrt();
                prop_assert!((p[k] - sequential_p[k]).abs() < 1e-9 * scale);
            }
            for i in 0..n {
                prop_assert!((mean[i] - sequential_mean[i]).abs() < 1e-7 * prior[i * (n + 1)].sqrt());
            }
        }
    }

    #[test]
    fn refused_updates_change_nothing() {
        let try_update = |h: [f64; 2], y: f64, r: f64| {
            let (mut mean, mut p, mut work) = ([1.0, 2.0], [2.0, 1.0, 1.0, 2.0], [0.0; 2]);
            let error = update_block(
                &mut mean,
                &mut MatMut::square(&mut p, 2).unwrap(),
                Mat::new(&h, 1, 2, 2).unwrap(),
                &mut [y],
                &mut MatMut::square(&mut [r], 1).unwrap(),
                &mut MatMut::new(&mut work, 1, 2, 2).unwrap(),
            )
            .unwrap_err();
            assert_eq!((mean, p), ([1.0, 2.0], [2.0, 1.0, 1.0, 2.0]));
            error
        };
        assert_eq!(try_update([1.0, 0.0], f64::NAN, 1.0), LinalgError::NotFinite);
        assert_eq!(try_update([0.0, 0.0], 1.0, 0.0), LinalgError::NotPositiveDefinite { pivot: 0 });
        assert_eq!(try_update([f64::NAN, 0.0], 1.0, 1.0), LinalgError::NotPositiveDefinite { pivot: 0 });
        let (mut h, mut r) = ([1.0, 2.0], [-1.0]);
        let mut view = MatMut::new(&mut h, 1, 2, 2).unwrap();
        assert!(whiten(&mut view, &mut [1.0], &mut MatMut::square(&mut r, 1).unwrap()).is_err());
        assert!(whiten(&mut view, &mut [1.0; 2], &mut MatMut::square(&mut r, 1).unwrap()).is_err());
        assert_eq!(h, [1.0, 2.0]);
    }
}
