//! Least squares by orthogonal columns: A = Q R, x̂ = R⁻¹ Qᵀ b minimises |A x − b|.
//!
//! Modified Gram–Schmidt, each column orthogonalised twice (L. Giraud et al., *The loss of orthogonality in the
//! Gram–Schmidt orthogonalization process*, 2005: "twice is enough"). A column with one entry keeps it exactly, so that
//! A = λ I gives x̂ = b/λ without rounding.
//!
//! A is m × n with m ≥ n. Cost 2 m n² multiply-adds. Panic contract: none.

use super::view::{Mat, MatMut};
use super::{LinalgError, axpy, triangular};
use crate::real::Real;

/// Replaces `a` (m × n) by Q and the *lower* triangle of `r` (n × n) by Rᵀ.
///
/// A column that depends on those before it is refused: [`LinalgError::Singular`]; then both matrices are spoilt.
pub fn orthogonalize<T: Real>(a: &mut MatMut<'_, T>, r: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    let (m, n) = (a.rows(), a.cols());
    if r.rows() != n || r.cols() != n || m < n {
        return Err(LinalgError::Shape);
    }
    for j in 0..n {
        let before = column_product(a, j, j).sqrt();
        for k in 0..j {
            r.set(j, k, T::ZERO);
        }
        for _ in 0..2 {
            for k in 0..j {
                let product = column_product(a, j, k);
                if product != T::ZERO {
                    r.add(j, k, product);
                    for row in a.iter_mut() {
                        if let Ok([entry, unit]) = row.get_disjoint_mut([j, k]) {
                            *entry -= product * *unit;
                        }
                    }
                }
            }
        }
        let after = column_product(a, j, j).sqrt();
        let negligible = T::EPSILON * T::from_f64(16.0) * before;
        if !(after > negligible && after.is_finite()) {
            return Err(LinalgError::Singular { pivot: j });
        }
        r.set(j, j, after);
        for entry in a.iter_mut().filter_map(|row| row.get_mut(j)) {
            *entry /= after;
        }
    }
    Ok(())
}

/// The scalar product of columns j and k.
fn column_product<T: Real>(a: &MatMut<'_, T>, j: usize, k: usize) -> T {
    a.iter().fold(T::ZERO, |sum, row| match (row.get(j), row.get(k)) {
        (Some(&j), Some(&k)) => sum + j * k,
        _ => sum,
    })
}

/// B ← (I − Q Qᵀ) B for B (m × k) and Q (m × n). `coefficients` (k) is workspace.
pub fn remove<T: Real>(b: &mut MatMut<'_, T>, q: Mat<'_, T>, coefficients: &mut [T]) {
    for j in 0..q.cols() {
        coefficients.fill(T::ZERO);
        for (row, q) in b.iter().zip(q.iter()) {
            axpy(coefficients, q.get(j).copied().unwrap_or_default(), row);
        }
        for (row, q) in b.iter_mut().zip(q.iter()) {
            axpy(row, -q.get(j).copied().unwrap_or_default(), coefficients);
        }
    }
}

/// x ← R⁻¹ Qᵀ b for Q (m × n) and the transpose of R from [`orthogonalize`].
pub fn solve<T: Real>(q: Mat<'_, T>, r: Mat<'_, T>, b: &[T], x: &mut [T]) -> Result<(), LinalgError> {
    if q.rows() != b.len() || q.cols() != x.len() {
        return Err(LinalgError::Shape);
    }
    x.fill(T::ZERO);
    for (&b, q) in b.iter().zip(q.iter()) {
        axpy(x, b, q);
    }
    triangular::back_transposed(r, x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    fn fit(m: usize, n: usize, a: &[f64], b: &[f64]) -> Result<Vec<f64>, LinalgError> {
        let (mut q, mut r, mut x) = (a.to_vec(), vec![0.0; n * n], vec![0.0; n]);
        let mut q = MatMut::new(&mut q, m, n, n).unwrap();
        let mut r = MatMut::square(&mut r, n).unwrap();
        orthogonalize(&mut q, &mut r)?;
        solve(q.as_ref(), r.as_ref(), b, &mut x)?;
        Ok(x)
    }

    proptest! {
        #[test]
        fn residuals_are_orthogonal_to_the_columns(
            n in 1..5usize, extra in 0..4usize,
            a in proptest::collection::vec(-1.0..1.0f64, 32), b in proptest::collection::vec(-1.0..1.0f64, 8),
        ) {
            let m = n + extra;
            let a = DMatrix::from_row_slice(m, n, &a[..m * n]) + DMatrix::identity(m, n) * 2.0;
            let rows: Vec<f64> = a.transpose().as_slice().to_vec();
            let x = fit(m, n, &rows, &b[..m]).unwrap();
            let residual = DVector::from_row_slice(&b[..m]) - &a * DVector::from_row_slice(&x);
            prop_assert!((a.transpose() * residual).amax() < 1e-12);
        }
    }

    #[test]
    fn scaled_unit_columns_are_exact() {
        assert_eq!(fit(3, 2, &[0.0, 0.0, 0.2, 0.0, 0.0, 0.19], &[7.0, 0.2, 0.38]).unwrap(), [1.0, 2.0]);
    }

    #[test]
    fn dependent_and_empty_columns_are_refused() {
        assert_eq!(fit(2, 2, &[1.0, 2.0, 1.0, 2.0], &[1.0, 1.0]), Err(LinalgError::Singular { pivot: 1 }));
        assert_eq!(fit(2, 1, &[0.0, 0.0], &[1.0, 1.0]), Err(LinalgError::Singular { pivot: 0 }));
        assert_eq!(fit(1, 1, &[f64::NAN], &[1.0]), Err(LinalgError::Singular { pivot: 0 }));
        assert_eq!(fit(1, 2, &[1.0, 2.0], &[1.0]), Err(LinalgError::Shape));
    }
}
