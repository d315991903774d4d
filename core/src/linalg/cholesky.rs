//! Cholesky factorisation A = L Lᵀ in place.
//!
//! Golub & Van Loan, *Matrix Computations*, 4th ed., algorithm 4.2.2 in row order: row i of L needs only the rows
//! above it, all contiguous. Cost n³/3 multiply-adds, no workspace.
//!
//! A pivot is refused when it is not finite or not larger than ε times the diagonal entry it came from: it is then
//! rounding error and nothing else.

use super::view::{Mat, MatMut};
use super::{LinalgError, dot, triangular};
use crate::real::Real;

/// Replaces the lower triangle of the symmetric n × n `a` by L. Reads the lower triangle only and leaves the strict
/// upper one untouched. On an error the rows above the pivot hold L, the rest is as it was.
pub fn factor<T: Real>(a: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    if a.rows() != a.cols() {
        return Err(LinalgError::Shape);
    }
    for i in 0..a.rows() {
        for j in 0..i {
            let (row_i, row_j) = a.row_pair(i, j);
            row_i[j] = (row_i[j] - dot(&row_i[..j], &row_j[..j])) / row_j[j];
        }
        let row = a.row_mut(i);
        let diagonal = row[i];
        let pivot = diagonal - dot(&row[..i], &row[..i]);
        if !(pivot > T::EPSILON * diagonal && pivot.is_finite()) {
            return Err(LinalgError::NotPositiveDefinite { pivot: i });
        }
        row[i] = pivot.sqrt();
    }
    Ok(())
}

/// Solves A x = b in place of `b`, given L from [`factor`].
pub fn solve<T: Real>(l: Mat<'_, T>, b: &mut [T]) -> Result<(), LinalgError> {
    triangular::forward(l, b)?;
    triangular::back_transposed(l, b)
}

/// ln det A = 2 Σ ln Lᵢᵢ, given L from [`factor`].
pub fn log_determinant<T: Real>(l: Mat<'_, T>) -> f64 {
    (0..l.rows().min(l.cols())).map(|i| 2.0 * libm::log(l.at(i, i).to_f64())).sum()
}
