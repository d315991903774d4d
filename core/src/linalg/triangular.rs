//! Substitution with a lower triangular L, and its inverse.
//!
//! Only the lower triangle of L is read. Cost n²/2 multiply-adds a right-hand side, n³/6 for the inverse.

use super::view::{Mat, MatMut};
use super::{LinalgError, axpy, dot, scale};
use crate::real::Real;

/// Checks that `l` is square of dimension `n` and has a usable diagonal.
fn check<T: Real>(l: Mat<'_, T>, n: usize) -> Result<(), LinalgError> {
    if l.rows() != n || l.cols() != n {
        return Err(LinalgError::Shape);
    }
    match (0..n).find(|&i| l.at(i, i) == T::ZERO || !l.at(i, i).is_finite()) {
        Some(pivot) => Err(LinalgError::Singular { pivot }),
        None => Ok(()),
    }
}

/// Solves L y = b in place of `b`.
pub fn forward<T: Real>(l: Mat<'_, T>, b: &mut [T]) -> Result<(), LinalgError> {
    check(l, b.len())?;
    for i in 0..b.len() {
        let row = l.row(i);
        b[i] = (b[i] - dot(&row[..i], &b[..i])) / row[i];
    }
    Ok(())
}

/// Solves Lᵀ x = b in place of `b`.
pub fn back_transposed<T: Real>(l: Mat<'_, T>, b: &mut [T]) -> Result<(), LinalgError> {
    check(l, b.len())?;
    for i in (0..b.len()).rev() {
        let row = l.row(i);
        let x = b[i] / row[i];
        b[i] = x;
        axpy(&mut b[..i], -x, &row[..i]);
    }
    Ok(())
}

/// Solves L Y = B in place of `b`, n × m, for all its columns at once.
pub fn forward_rows<T: Real>(l: Mat<'_, T>, b: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    check(l, b.rows())?;
    for i in 0..b.rows() {
        for j in 0..i {
            let (target, source) = b.row_pair(i, j);
            axpy(target, -l.at(i, j), source);
        }
        scale(b.row_mut(i), T::ONE / l.at(i, i));
    }
    Ok(())
}

/// Solves Lᵀ X = B in place of `b`, n × m, for all its columns at once.
pub fn back_transposed_rows<T: Real>(l: Mat<'_, T>, b: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    check(l, b.rows())?;
    for i in (0..b.rows()).rev() {
        scale(b.row_mut(i), T::ONE / l.at(i, i));
        for j in 0..i {
            let (target, source) = b.row_pair(j, i);
            axpy(target, -l.at(i, j), source);
        }
    }
    Ok(())
}

/// Replaces the lower triangle of L by that of L⁻¹; the strict upper triangle is neither read nor written.
pub fn invert<T: Real>(l: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    let n = l.rows();
    check(l.as_ref(), n)?;
    for i in 0..n {
        // Row i of L⁻¹ is −(1/Lᵢᵢ) Σⱼ Lᵢⱼ (row j of L⁻¹); row j has entries up to column j.
        let inverse = T::ONE / l.at(i, i);
        for j in 0..i {
            let (row_i, row_j) = l.row_pair(i, j);
            let factor = row_i[j];
            row_i[j] = T::ZERO;
            axpy(&mut row_i[..=j], factor, &row_j[..=j]);
        }
        let row = l.row_mut(i);
        scale(&mut row[..i], -inverse);
        row[i] = inverse;
    }
    Ok(())
}
