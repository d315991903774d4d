//! Mean and covariance of some states given that some ambiguities are integers.
//!
//! ```text
//! x̂|ň = x̂ − Q_xn Q_nn⁻¹ (n̂ − ň)          P|ň = P_xx − Q_xn Q_nn⁻¹ Q_nx
//! ```
//! P. J. G. Teunissen (1995), eq. (2.6). With Q_nn = L Lᵀ, W = L⁻¹ Q_nx (m × s) and z = L⁻¹ (n̂ − ň) this is
//! x̂ − Wᵀ z and P_xx − Wᵀ W. Cost m³/3 + m² s + m s²; the joint density is not touched.
//!
//! For integer *combinations* of states use [`crate::linalg::block::update_block`] with the combinations as rows and
//! R = 0.

use super::IntegerError;
use crate::linalg::{Mat, MatMut, axpy, block, cholesky, dot, triangular};
use crate::real::Real;

/// The states `states` (s) of the density (`mean`, `covariance`) given that the states `ambiguities` (m) have the
/// `values`. Indices refer to `mean`.
///
/// `factor` (m × m), `cross` (m × s) and `residual` (m) are workspace; `conditional_mean` (s) and
/// `conditional_covariance` (s × s) return the result. Returns the squared norm (n̂ − ň)ᵀ Q_nn⁻¹ (n̂ − ň), χ² with m
/// degrees of freedom if the integers are right.
pub fn condition_on_integers<T: Real>(
    mean: &[T],
    covariance: Mat<'_, T>,
    states: &[usize],
    ambiguities: &[usize],
    values: &[T],
    factor: &mut MatMut<'_, T>,
    cross: &mut MatMut<'_, T>,
    residual: &mut [T],
    conditional_mean: &mut [T],
    conditional_covariance: &mut MatMut<'_, T>,
) -> Result<T, IntegerError> {
    let (n, s, m) = (mean.len(), states.len(), ambiguities.len());
    let fits = [covariance.rows(), covariance.cols()] == [n; 2]
        && [values.len(), factor.rows(), factor.cols(), cross.rows(), residual.len()] == [m; 5]
        && [cross.cols(), conditional_mean.len()] == [s; 2]
        && [conditional_covariance.rows(), conditional_covariance.cols()] == [s; 2]
        && states.iter().chain(ambiguities).all(|&i| i < n);
    if !fits {
        return Err(IntegerError::Shape);
    }
    for (i, &ambiguity) in ambiguities.iter().enumerate() {
        let row = covariance.row(ambiguity);
        for (entry, &column) in factor.row_mut(i).iter_mut().zip(ambiguities) {
            *entry = row[column];
        }
        for (entry, &state) in cross.row_mut(i).iter_mut().zip(states) {
            *entry = row[state];
        }
        residual[i] = mean[ambiguity] - values[i];
    }
    cholesky::factor(factor)?;
    triangular::forward_rows(factor.as_ref(), cross)?;
    triangular::forward(factor.as_ref(), residual)?;
    let norm = dot(residual, residual);
    if !norm.is_finite() {
        return Err(IntegerError::NotFinite);
    }
    for (i, &state) in states.iter().enumerate() {
        conditional_mean[i] = mean[state];
        for (entry, &column) in conditional_covariance.row_mut(i).iter_mut().zip(states) {
            *entry = covariance.at(state, column);
        }
    }
    for (i, &z) in residual.iter().enumerate() {
        axpy(conditional_mean, -z, cross.row(i));
    }
    block::subtract_gram(conditional_covariance, cross.as_ref());
    Ok(norm)
}
