//! Integer bootstrapping: round one ambiguity, condition the rest on it, go on.
//!
//! With Q = U D Uᵀ, U = Lᵀ unit upper triangular, the last component is fixed first:
//! ```text
//! â_{i|I} = â_i − Σ_{k>i} u_ik (â_{k|K} − ž_k),   ž_i = rint(â_{i|I}),   var(â_{i|I}) = d_i
//! ```
//! P. J. G. Teunissen, *Success probability of integer GPS ambiguity rounding and bootstrapping*, J. Geodesy 72
//! (1998), eq. (12). The squared norm of the result is Σ (â_{i|I} − ž_i)² / d_i. Cost n²/2 multiply-adds.
//!
//! Bootstrapping depends on the order and on the parametrisation; after [`super::decorrelate`] it is close to integer
//! least squares.

use super::IntegerError;
use super::decorrelate::to_integer;
use super::success_rate::{self, Probability};
use crate::linalg::{Mat, MatMut, dot, ldl};
use crate::real::Real;

/// Fixes all components of `a`, last first, given U (`factor`, n × n) and `variances` D.
///
/// `residual` returns â_{i|I} − ž_i. Returns the squared norm.
pub fn bootstrap<T: Real>(
    a: &[T],
    factor: Mat<'_, T>,
    variances: &[T],
    fixed: &mut [i64],
    residual: &mut [T],
) -> Result<T, IntegerError> {
    let n = a.len();
    if [factor.rows(), factor.cols(), variances.len(), fixed.len(), residual.len()] != [n; 5] {
        return Err(IntegerError::Shape);
    }
    let mut norm = T::ZERO;
    for i in (0..n).rev() {
        let conditional = a[i] - dot(&factor.row(i)[i + 1..], &residual[i + 1..]);
        let integer = conditional.round();
        fixed[i] = to_integer(integer)?;
        residual[i] = conditional - integer;
        norm += residual[i] * residual[i] / variances[i];
    }
    Ok(norm)
}

/// Fixes the components of `a` in the given `order` (indices into `a`, first fixed first), without decorrelation.
///
/// `work` (m × m), `variances` and `residual` (m, the length of `order`) are workspace; `fixed` (m) and `variances`
/// return the integers and conditional variances in that order. Returns the success rate, exact for this order.
pub fn bootstrap_ordered<T: Real>(
    a: &[T],
    q: Mat<'_, T>,
    order: &[usize],
    work: &mut MatMut<'_, T>,
    variances: &mut [T],
    residual: &mut [T],
    fixed: &mut [i64],
) -> Result<Probability, IntegerError> {
    let m = order.len();
    let n = a.len();
    let shapes = [work.rows(), work.cols(), variances.len(), residual.len(), fixed.len()] == [m; 5];
    if !shapes || [q.rows(), q.cols()] != [n; 2] || order.iter().any(|&i| i >= n) {
        return Err(IntegerError::Shape);
    }
    // L Dᵢ Lᵀ conditions on the components before, which is the given order.
    for (i, &row) in order.iter().enumerate() {
        for (j, &col) in order[..=i].iter().enumerate() {
            *work.at_mut(i, j) = q.at(row, col);
        }
    }
    ldl::factor_ldlt(work, variances)?;
    for (i, &index) in order.iter().enumerate() {
        let conditional = a[index] - dot(&work.row(i)[..i], &residual[..i]);
        let integer = conditional.round();
        fixed[i] = to_integer(integer)?;
        residual[i] = conditional - integer;
    }
    Ok(success_rate::bootstrapped(variances))
}
