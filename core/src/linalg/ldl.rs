//! Square-root free factorisations of a symmetric positive definite matrix.
//!
//! * [`factor_ltdl`]: Q = Lᵀ D L, L unit lower triangular. dᵢ is the variance of component i given the components
//!   after it, the form of P. J. G. Teunissen, *The least-squares ambiguity decorrelation adjustment*, J. Geodesy 70
//!   (1995), eq. (4.6); algorithm from P. de Jonge & C. Tiberius, LGR 12 (1996), sec. 3.
//! * [`factor_ldlt`]: A = L D Lᵀ, dᵢ the variance of component i given the components before it.
//!
//! Both read and write the lower triangle only, unit diagonal included. Cost n³/6 multiply-adds. Pivots are refused
//! as in [`super::cholesky`].

use super::view::MatMut;
use super::{LinalgError, axpy, scale};
use crate::real::Real;

/// Checks shapes, then whether `pivot`, left of the diagonal entry `diagonal`, is more than rounding error.
fn check_pivot<T: Real>(pivot: T, diagonal: T, row: usize) -> Result<(), LinalgError> {
    if pivot > T::EPSILON * diagonal && pivot.is_finite() {
        Ok(())
    } else {
        Err(LinalgError::NotPositiveDefinite { pivot: row })
    }
}

/// Q = Lᵀ D L: the lower triangle of `q` becomes L, `d` the diagonal of D. On an error both are spoilt.
pub fn factor_ltdl<T: Real>(q: &mut MatMut<'_, T>, d: &mut [T]) -> Result<(), LinalgError> {
    let n = q.rows();
    if q.cols() != n || d.len() != n {
        return Err(LinalgError::Shape);
    }
    for (i, d) in d.iter_mut().enumerate() {
        *d = q.at(i, i);
    }
    for i in (0..n).rev() {
        let pivot = q.at(i, i);
        check_pivot(pivot, d[i], i)?;
        d[i] = pivot;
        let inverse = T::ONE / pivot;
        for j in 0..i {
            let (row_j, row_i) = q.row_pair(j, i);
            axpy(&mut row_j[..=j], -(row_i[j] * inverse), &row_i[..=j]);
        }
        let row = q.row_mut(i);
        scale(&mut row[..i], inverse);
        row[i] = T::ONE;
    }
    Ok(())
}

/// A = L D Lᵀ: the lower triangle of `a` becomes L, `d` the diagonal of D. On an error both are spoilt.
pub fn factor_ldlt<T: Real>(a: &mut MatMut<'_, T>, d: &mut [T]) -> Result<(), LinalgError> {
    let n = a.rows();
    if a.cols() != n || d.len() != n {
        return Err(LinalgError::Shape);
    }
    for i in 0..n {
        let mut pivot = a.at(i, i);
        let diagonal = pivot;
        // First row i of L D, from the rows above, then divide by D.
        for j in 0..i {
            let (row_i, row_j) = a.row_pair(i, j);
            for k in 0..j {
                row_i[j] -= row_i[k] * row_j[k];
            }
        }
        let row = a.row_mut(i);
        for j in 0..i {
            let scaled = row[j];
            row[j] = scaled / d[j];
            pivot -= scaled * row[j];
        }
        check_pivot(pivot, diagonal, i)?;
        row[i] = T::ONE;
        d[i] = pivot;
    }
    Ok(())
}
