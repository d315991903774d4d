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
use super::{LinalgError, around_mut, axpy, head_mut, scale};
use crate::real::Real;

/// Checks whether `pivot`, left of the diagonal entry `diagonal`, is more than rounding error.
fn check_pivot<T: Real>(pivot: T, diagonal: T, row: usize) -> Result<(), LinalgError> {
    if pivot > T::EPSILON * diagonal && pivot.is_finite() {
        Ok(())
    } else {
        Err(LinalgError::NotPositiveDefinite { pivot: row })
    }
}

/// Q = Lᵀ D L: the lower triangle of `q` becomes L, `d` the diagonal of D. On an error both are spoilt.
pub fn factor_ltdl<T: Real>(q: &mut MatMut<'_, T>, d: &mut [T]) -> Result<(), LinalgError> {
    start_ltdl(q, d)?;
    (0..d.len()).rev().try_for_each(|i| eliminate(q, d, i))
}

/// As [`factor_ltdl`], but each time the component of smallest conditional variance is taken next: d tends to rise
/// towards the first component. X.-W. Chang, X. Yang & T. Zhou, J. Geodesy 79 (2005), sec. 3.3.
///
/// Calls `exchanged` with the components that change places, in that order. A refused pivot is told by its place after
/// all exchanges.
pub fn factor_ltdl_sorted<T: Real>(
    q: &mut MatMut<'_, T>,
    d: &mut [T],
    mut exchanged: impl FnMut(usize, usize),
) -> Result<(), LinalgError> {
    start_ltdl(q, d)?;
    for i in (0..d.len()).rev() {
        let mut smallest = i;
        let mut variance = q.at(i, i);
        for (j, row) in q.iter().enumerate().take(i) {
            match row.get(j) {
                Some(&candidate) if candidate < variance => (smallest, variance) = (j, candidate),
                _ => {}
            }
        }
        if smallest != i {
            exchange(q, smallest, i);
            exchange_entries(d, smallest, i);
            exchanged(smallest, i);
        }
        eliminate(q, d, i)?;
    }
    Ok(())
}

/// Checks shapes and copies the diagonal of Q to `d`.
fn start_ltdl<T: Real>(q: &MatMut<'_, T>, d: &mut [T]) -> Result<(), LinalgError> {
    let n = q.rows();
    if q.cols() != n || d.len() != n {
        return Err(LinalgError::Shape);
    }
    for (i, d) in d.iter_mut().enumerate() {
        *d = q.at(i, i);
    }
    Ok(())
}

/// Takes component i out of those before it: row i becomes that of L, dᵢ, until then the variance of the component by
/// itself, the conditional one.
fn eliminate<T: Real>(q: &mut MatMut<'_, T>, d: &mut [T], i: usize) -> Result<(), LinalgError> {
    let (mut above, row) = q.split_row(i);
    let (before, diagonal, _) = around_mut(row, i)?;
    let (_, d, _) = around_mut(d, i)?;
    check_pivot(*diagonal, *d, i)?;
    *d = *diagonal;
    let inverse = T::ONE / *d;
    for ((j, row_j), &q_ij) in above.iter_mut().enumerate().zip(&*before) {
        axpy(head_mut(row_j, j + 1), -(q_ij * inverse), before);
    }
    scale(before, inverse);
    *diagonal = T::ONE;
    Ok(())
}

/// Exchanges components p < i of a symmetric matrix of which the lower triangle is held.
fn exchange<T: Real>(q: &mut MatMut<'_, T>, p: usize, i: usize) {
    let (mut above, row_i) = q.split_row(i);
    for (k, row_k) in above.iter_mut().enumerate().skip(p) {
        if k == p {
            for (a, b) in head_mut(row_k, p).iter_mut().zip(&mut *row_i) {
                core::mem::swap(a, b);
            }
            if let (Some(a), Some(b)) = (row_k.get_mut(p), row_i.get_mut(i)) {
                core::mem::swap(a, b);
            }
        } else if let (Some(a), Some(b)) = (row_k.get_mut(p), row_i.get_mut(k)) {
            core::mem::swap(a, b);
        }
    }
    for row_k in q.iter_mut().skip(i + 1) {
        exchange_entries(row_k, p, i);
    }
}

/// Exchanges two entries; nothing happens where one does not exist.
fn exchange_entries<T>(x: &mut [T], i: usize, j: usize) {
    if let Ok([a, b]) = x.get_disjoint_mut([i, j]) {
        core::mem::swap(a, b);
    }
}

/// A = L D Lᵀ: the lower triangle of `a` becomes L, `d` the diagonal of D. On an error both are spoilt.
pub fn factor_ldlt<T: Real>(a: &mut MatMut<'_, T>, d: &mut [T]) -> Result<(), LinalgError> {
    let n = a.rows();
    if a.cols() != n || d.len() != n {
        return Err(LinalgError::Shape);
    }
    for i in 0..n {
        let (above, row) = a.split_row(i);
        // First row i of L D, from the rows above, then divide by D.
        for (j, row_j) in above.iter().enumerate() {
            let (before, entry, _) = around_mut(row, j)?;
            for (&scaled, &l) in before.iter().zip(row_j) {
                *entry -= scaled * l;
            }
        }
        let (before, diagonal, _) = around_mut(row, i)?;
        let (d_before, d, _) = around_mut(d, i)?;
        *d = *diagonal;
        for (entry, &d_j) in before.iter_mut().zip(&*d_before) {
            let scaled = *entry;
            *entry = scaled / d_j;
            *d -= scaled * *entry;
        }
        check_pivot(*d, *diagonal, i)?;
        *diagonal = T::ONE;
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

        /// Sorting factors the matrix with its components in another order, the one of smallest variance last.
        #[test]
        fn sorting_is_another_order((n, a) in spd::matrix(1..9usize)) {
            let (mut l, mut d) = (a.clone(), vec![0.0; n]);
            let mut order: Vec<usize> = (0..n).collect();
            factor_ltdl_sorted(&mut MatMut::square(&mut l, n).unwrap(), &mut d, |i, j| order.swap(i, j)).unwrap();
            let back = assembled(n, &l, &d, true);
            for k in 0..n * n {
                let (i, j) = (order[k / n], order[k % n]);
                let scale = (a[i * (n + 1)] * a[j * (n + 1)]).sqrt();
                prop_assert!((back[k] - a[i * n + j]).abs() < 1e-13 * scale);
            }
            let variances: Vec<f64> = (0..n).map(|i| a[i * (n + 1)]).collect();
            prop_assert_eq!(variances[order[n - 1]], variances.iter().copied().fold(f64::INFINITY, f64::min));
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
