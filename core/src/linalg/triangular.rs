//! Substitution with a lower triangular L, and its inverse.
//!
//! Only the lower triangle of L is read. Cost n²/2 multiply-adds a right-hand side, n³/6 for the inverse.

use super::view::{Mat, MatMut};
use super::{LinalgError, around, around_mut, axpy, dot, head, scale, subtract_four};
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
    for (i, row) in l.iter().enumerate() {
        let (solved, entry, _) = around_mut(b, i)?;
        let (row, &diagonal, _) = around(row, i)?;
        *entry = (*entry - dot(row, solved)) / diagonal;
    }
    Ok(())
}

/// Solves Lᵀ x = b in place of `b`.
pub fn back_transposed<T: Real>(l: Mat<'_, T>, b: &mut [T]) -> Result<(), LinalgError> {
    check(l, b.len())?;
    for i in (0..b.len()).rev() {
        let (open, entry, _) = around_mut(b, i)?;
        let (row, &diagonal, _) = around(l.row(i), i)?;
        *entry /= diagonal;
        axpy(open, -*entry, row);
    }
    Ok(())
}

/// Solves L Y = B in place of `b`, n × m, for all its columns at once.
pub fn forward_rows<T: Real>(l: Mat<'_, T>, b: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    check(l, b.rows())?;
    for i in 0..b.rows() {
        let (solved, target) = b.split_row(i);
        let (row, &diagonal, _) = around(l.row(i), i)?;
        let (fours, rest) = row.as_chunks::<4>();
        for (k, &l) in fours.iter().enumerate() {
            let sources = [solved.row(4 * k), solved.row(4 * k + 1), solved.row(4 * k + 2), solved.row(4 * k + 3)];
            subtract_four(target, l, sources);
        }
        for (&l, source) in rest.iter().zip(solved.iter().skip(4 * fours.len())) {
            axpy(target, -l, source);
        }
        scale(target, T::ONE / diagonal);
    }
    Ok(())
}

/// Solves Lᵀ X = B in place of `b`, n × m, for all its columns at once.
pub fn back_transposed_rows<T: Real>(l: Mat<'_, T>, b: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    check(l, b.rows())?;
    for i in (0..b.rows()).rev() {
        let (mut open, source) = b.split_row(i);
        let (row, &diagonal, _) = around(l.row(i), i)?;
        scale(source, T::ONE / diagonal);
        for (&l, target) in row.iter().zip(open.iter_mut()) {
            axpy(target, -l, source);
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
        let (above, row) = l.split_row(i);
        for (j, row_j) in above.iter().enumerate() {
            let (_, entry, _) = around_mut(row, j)?;
            let factor = *entry;
            *entry = T::ZERO;
            axpy(row, factor, head(row_j, j + 1));
        }
        let (before, diagonal, _) = around_mut(row, i)?;
        *diagonal = T::ONE / *diagonal;
        scale(before, -*diagonal);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{cholesky, spd};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_inverse_times_the_matrix_is_one((n, a) in spd::matrix(1..9usize)) {
            let mut l = a.clone();
            cholesky::factor(&mut MatMut::square(&mut l, n).unwrap()).unwrap();
            let mut inverse = l.clone();
            invert(&mut MatMut::square(&mut inverse, n).unwrap()).unwrap();
            let (l, inverse) = (spd::lower(n, &l), spd::lower(n, &inverse));
            let one = spd::product(n, &inverse, &l);
            for k in 0..n * n {
                let size: f64 = (0..n).map(|i| (inverse[k / n * n + i] * l[i * n + k % n]).abs()).sum();
                let expected = if k / n == k % n { 1.0 } else { 0.0 };
                prop_assert!((one[k] - expected).abs() <= 1e-12 * size);
            }
        }

        #[test]
        fn many_columns_are_solved_as_one((n, a) in spd::matrix(1..9usize), b in proptest::collection::vec(-1.0..1.0f64, 27)) {
            let mut l = a.clone();
            cholesky::factor(&mut MatMut::square(&mut l, n).unwrap()).unwrap();
            let l = Mat::square(&l, n).unwrap();
            for back in [false, true] {
                let mut many = b.clone();
                let mut many = MatMut::new(&mut many, n, 3, 3).unwrap();
                let solved = if back { back_transposed_rows(l, &mut many) } else { forward_rows(l, &mut many) };
                solved.unwrap();
                for column in 0..3 {
                    let mut single: Vec<f64> = (0..n).map(|i| b[i * 3 + column]).collect();
                    let solved = if back { back_transposed(l, &mut single) } else { forward(l, &mut single) };
                    solved.unwrap();
                    let size = single.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
                    for i in 0..n {
                        prop_assert!((many.at(i, column) - single[i]).abs() <= 1e-10 * size);
                    }
                }
            }
        }
    }

    #[test]
    fn by_hand() {
        let l = [2.0, f64::NAN, 1.0, 4.0];
        let l = Mat::square(&l, 2).unwrap();
        let mut y = [2.0, 9.0];
        forward(l, &mut y).unwrap();
        assert_eq!(y, [1.0, 2.0]);
        let mut x = [5.0, 8.0];
        back_transposed(l, &mut x).unwrap();
        assert_eq!(x, [1.5, 2.0]);
    }

    #[test]
    fn singular_and_misshapen_are_refused() {
        let l = [2.0, 0.0, 1.0, 0.0];
        let l = Mat::square(&l, 2).unwrap();
        assert_eq!(forward(l, &mut [1.0, 1.0]), Err(LinalgError::Singular { pivot: 1 }));
        assert_eq!(back_transposed(l, &mut [1.0; 3]), Err(LinalgError::Shape));
        let mut nan = [f64::NAN];
        assert_eq!(invert(&mut MatMut::square(&mut nan, 1).unwrap()), Err(LinalgError::Singular { pivot: 0 }));
    }
}
