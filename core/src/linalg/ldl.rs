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

#[cfg(test)]
mod tests {
    use super::super::{LinalgError, spd};
    use super::*;
    use proptest::prelude::*;

    /// L or Lᵀ first, D between.
    fn assembled(n: usize, l: &[f64], d: &[f64], transposed_first: bool) -> Vec<f64> {
        let l = spd::lower(n, l);
        let lt = spd::transposed(n, &l);
        let (first, last) = if transposed_first { (lt, l) } else { (l, lt) };
        let scaled: Vec<f64> = (0..n * n).map(|k| first[k] * d[k % n]).collect();
        spd::product(n, &scaled, &last)
    }

    proptest! {
        #[test]
        fn the_matrix_comes_back((n, a) in spd::matrix(1..9usize), transposed_first: bool) {
            let (mut l, mut d) = (a.clone(), vec![0.0; n]);
            let mut view = MatMut::square(&mut l, n).unwrap();
            let factored = if transposed_first { factor_ltdl(&mut view, &mut d) } else { factor_ldlt(&mut view, &mut d) };
            factored.unwrap();
            let back = assembled(n, &l, &d, transposed_first);
            for k in 0..n * n {
                let scale = (a[k / n * (n + 1)] * a[k % n * (n + 1)]).sqrt();
                prop_assert!((back[k] - a[k]).abs() < 1e-13 * scale);
            }
            prop_assert!((0..n).all(|i| l[i * n + i] == 1.0 && d[i] > 0.0));
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        for mut q in [[1.0, 1.0, 1.0, 1.0], [f64::NAN, 0.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 1.0], [0.0; 4]] {
            let mut copy = q;
            let mut d = [0.0; 2];
            let error = factor_ltdl(&mut MatMut::square(&mut q, 2).unwrap(), &mut d).unwrap_err();
            assert!(matches!(error, LinalgError::NotPositiveDefinite { .. }));
            let error = factor_ldlt(&mut MatMut::square(&mut copy, 2).unwrap(), &mut d).unwrap_err();
            assert!(matches!(error, LinalgError::NotPositiveDefinite { .. }));
        }
        let mut q = [1.0; 4];
        assert_eq!(factor_ltdl(&mut MatMut::square(&mut q, 2).unwrap(), &mut [0.0]), Err(LinalgError::Shape));
        assert_eq!(factor_ldlt(&mut MatMut::square(&mut q, 2).unwrap(), &mut [0.0]), Err(LinalgError::Shape));
    }
}
