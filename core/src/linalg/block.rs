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
use super::{LinalgError, axpy, cholesky, dot, triangular};
use crate::real::Real;

/// What a block update found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockUpdate<T> {
    /// Normalised innovation squared νᵀ S⁻¹ ν, χ² with m degrees of freedom if model and noise are right [1].
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
        for j in 0..=i {
            *r.at_mut(i, j) += dot(work.row(i), h.row(j));
        }
    }
    cholesky::factor(r)?;
    triangular::forward_rows(r.as_ref(), work)?;
    triangular::forward(r.as_ref(), innovation)?;
    if !(innovation.iter().all(|z| z.is_finite()) && (0..m).all(|i| work.row(i).iter().all(|w| w.is_finite()))) {
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
    for i in 0..p.rows() {
        for k in 0..w.rows() {
            let row = w.row(k);
            axpy(&mut p.row_mut(i)[..=i], -row[i], &row[..=i]);
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
