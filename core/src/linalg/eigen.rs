//! Eigenvalues of a symmetric matrix by Jacobi rotations.
//!
//! Cyclic Jacobi, Golub & Van Loan, *Matrix Computations*, 4th ed., sec. 8.5: for each pair p < q the rotation that makes
//! a_pq zero,
//! ```text
//! θ = (a_qq − a_pp) / (2 a_pq),  t = sign θ / (|θ| + √(θ² + 1)),  c = 1/√(t² + 1),  s = t c,  A ← Jᵀ A J
//! ```
//! until |a_pq| ≤ ε √(a_pp a_qq) for all of them. By this criterion the small eigenvalues of a positive definite matrix
//! come out as precise as its scaling allows, not only as precise as the largest one (J. Demmel & K. Veselić, SIAM J.
//! Matrix Anal. Appl. 13, 1992). Cost about 4 n³ multiply-adds a sweep, of which six to ten are needed; no workspace.

use super::view::MatMut;
use super::{LinalgError, around_mut, at_mut};
use crate::real::Real;

/// Bound on sweeps over all pairs.
const MAX_SWEEPS: usize = 40;

/// Eigenvalues of the full symmetric n × n `a` into `values` (n), in no particular order; `a` is spoilt.
///
/// Fails with [`LinalgError::NotFinite`] for numbers that are not finite, [`LinalgError::Shape`] for shapes.
pub fn eigenvalues<T: Real>(a: &mut MatMut<'_, T>, values: &mut [T]) -> Result<(), LinalgError> {
    let n = values.len();
    if a.rows() != n || a.cols() != n {
        return Err(LinalgError::Shape);
    }
    if !a.iter().flatten().all(|entry| entry.is_finite()) {
        return Err(LinalgError::NotFinite);
    }
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                rotated |= rotate(a, p, q)?;
            }
        }
        if !rotated {
            break;
        }
    }
    for (i, value) in values.iter_mut().enumerate() {
        *value = a.at(i, i);
    }
    Ok(())
}

/// Makes a_pq zero, p < q. Returns whether it was not, as far as matters.
fn rotate<T: Real>(a: &mut MatMut<'_, T>, p: usize, q: usize) -> Result<bool, LinalgError> {
    let (a_pp, a_pq, a_qq) = (a.at(p, p), a.at(p, q), a.at(q, q));
    if a_pq.abs() <= T::EPSILON * a_pp.abs().sqrt() * a_qq.abs().sqrt() {
        return Ok(false);
    }
    let theta = (a_qq - a_pp) / (a_pq + a_pq);
    let size = T::ONE / (theta.abs() + (theta * theta + T::ONE).sqrt());
    let t = if theta < T::ZERO { -size } else { size };
    let c = T::ONE / (t * t + T::ONE).sqrt();
    let s = t * c;
    let (row_p, row_q) = a.two_rows_mut(p, q);
    for (x, y) in row_p.iter_mut().zip(row_q) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
    for row in a.iter_mut() {
        let (_, x, later) = around_mut(row, p)?;
        let y = at_mut(later, q - p - 1)?;
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
    // The closed form of the diagonal is the more precise one, and a_pq is zero by construction.
    a.set(p, p, a_pp - t * a_pq);
    a.set(q, q, a_qq + t * a_pq);
    a.set(p, q, T::ZERO);
    a.set(q, p, T::ZERO);
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::super::{cholesky, spd};
    use super::*;
    use proptest::prelude::*;

    fn sorted_eigenvalues(n: usize, a: &[f64]) -> Vec<f64> {
        let (mut a, mut values) = (a.to_vec(), vec![0.0; n]);
        eigenvalues(&mut MatMut::square(&mut a, n).unwrap(), &mut values).unwrap();
        values.sort_by(f64::total_cmp);
        values
    }

    /// Hand calculation: [[2, 1], [1, 2]] has 1 and 3; a graded matrix keeps its small eigenvalue, which is
    /// det/trace to first order: (1e8·1e-8 − 0.25)/1e8.
    #[test]
    fn by_hand() {
        let values = sorted_eigenvalues(2, &[2.0, 1.0, 1.0, 2.0]);
        assert!((values[0] - 1.0).abs() < 1e-15 && (values[1] - 3.0).abs() < 1e-15);
        let graded = sorted_eigenvalues(2, &[1e8, 0.5, 0.5, 1e-8]);
        assert!((graded[0] / 0.75e-8 - 1.0).abs() < 1e-14);
        assert_eq!(sorted_eigenvalues(3, &[0.0; 9]), [0.0; 3]);
        assert!(sorted_eigenvalues(0, &[]).is_empty());
        assert_eq!(sorted_eigenvalues(2, &[0.0, 1.0, 1.0, 0.0]), [-1.0, 1.0]);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let mut a = [1.0, f64::NAN, 0.0, 1.0];
        assert_eq!(eigenvalues(&mut MatMut::square(&mut a, 2).unwrap(), &mut [0.0; 2]), Err(LinalgError::NotFinite));
        assert_eq!(eigenvalues(&mut MatMut::square(&mut a, 2).unwrap(), &mut [0.0; 1]), Err(LinalgError::Shape));
    }

    proptest! {
        /// Trace, determinant and Frobenius norm are those of the matrix, and nalgebra finds the same.
        #[test]
        fn invariants_are_kept((n, a) in spd::matrix(1..9usize)) {
            let values = sorted_eigenvalues(n, &a);
            let trace: f64 = (0..n).map(|i| a[i * (n + 1)]).sum();
            prop_assert!((values.iter().sum::<f64>() / trace - 1.0).abs() < 1e-13);
            let squares: f64 = a.iter().map(|a| a * a).sum();
            prop_assert!((values.iter().map(|value| value * value).sum::<f64>() / squares - 1.0).abs() < 1e-12);
            let mut l = a.clone();
            let mut l = MatMut::square(&mut l, n).unwrap();
            cholesky::factor(&mut l).unwrap();
            let logs: f64 = values.iter().map(|value| value.ln()).sum();
            prop_assert!((logs - cholesky::log_determinant(l.as_ref())).abs() < 1e-6);
            let other = nalgebra::DMatrix::from_row_slice(n, n, &a).symmetric_eigenvalues();
            prop_assert!((values[n - 1] / other.max() - 1.0).abs() < 1e-12);
        }
    }
}
