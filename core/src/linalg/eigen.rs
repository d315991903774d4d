//! Eigenvalues and eigenvectors of a symmetric matrix by Jacobi rotations.
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
    sweep(a, values, |_, _, _, _| ())
}

/// A = Vᵀ Λ V: as [`eigenvalues`], and the eigenvectors, of length 1, into the rows of `vectors` (n × n), in the order of
/// the values. Half as much work again.
pub fn decompose<T: Real>(
    a: &mut MatMut<'_, T>,
    values: &mut [T],
    vectors: &mut MatMut<'_, T>,
) -> Result<(), LinalgError> {
    let n = values.len();
    if vectors.rows() != n || vectors.cols() != n {
        return Err(LinalgError::Shape);
    }
    vectors.fill(T::ZERO);
    for i in 0..n {
        vectors.set(i, i, T::ONE);
    }
    sweep(a, values, |p, q, c, s| {
        let (row_p, row_q) = vectors.two_rows_mut(p, q);
        turn(row_p, row_q, c, s);
    })
}

/// Sweeps of rotations until none is needed; calls `rotated` with p, q, c and s of each.
fn sweep<T: Real>(
    a: &mut MatMut<'_, T>,
    values: &mut [T],
    mut rotated: impl FnMut(usize, usize, T, T),
) -> Result<(), LinalgError> {
    let n = values.len();
    if a.rows() != n || a.cols() != n {
        return Err(LinalgError::Shape);
    }
    if !a.iter().flatten().all(|entry| entry.is_finite()) {
        return Err(LinalgError::NotFinite);
    }
    for _ in 0..MAX_SWEEPS {
        let mut any = false;
        for p in 0..n {
            for q in p + 1..n {
                if let Some((c, s)) = rotate(a, p, q)? {
                    rotated(p, q, c, s);
                    any = true;
                }
            }
        }
        if !any {
            break;
        }
    }
    for (i, value) in values.iter_mut().enumerate() {
        *value = a.at(i, i);
    }
    Ok(())
}

/// (x, y) ← (c x − s y, s x + c y).
fn turn<T: Real>(x: &mut [T], y: &mut [T], c: T, s: T) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

/// Makes a_pq zero, p < q. Returns c and s, or none if it was zero as far as matters.
fn rotate<T: Real>(a: &mut MatMut<'_, T>, p: usize, q: usize) -> Result<Option<(T, T)>, LinalgError> {
    let (a_pp, a_pq, a_qq) = (a.at(p, p), a.at(p, q), a.at(q, q));
    if a_pq.abs() <= T::EPSILON * a_pp.abs().sqrt() * a_qq.abs().sqrt() {
        return Ok(None);
    }
    let theta = (a_qq - a_pp) / (a_pq + a_pq);
    let size = T::ONE / (theta.abs() + (theta * theta + T::ONE).sqrt());
    let t = if theta < T::ZERO { -size } else { size };
    let c = T::ONE / (t * t + T::ONE).sqrt();
    let s = t * c;
    let (row_p, row_q) = a.two_rows_mut(p, q);
    turn(row_p, row_q, c, s);
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
    Ok(Some((c, s)))
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
        /// V A Vᵀ = Λ and V Vᵀ = 1, to some rounding errors of the largest value.
        #[test]
        fn vectors_make_the_matrix_diagonal((n, a) in spd::matrix(1..9usize)) {
            let (mut spoilt, mut values, mut vectors) = (a.clone(), vec![0.0; n], vec![0.0; n * n]);
            let mut view = MatMut::square(&mut vectors, n).unwrap();
            decompose(&mut MatMut::square(&mut spoilt, n).unwrap(), &mut values, &mut view).unwrap();
            let largest = values.iter().copied().fold(0.0, f64::max);
            let v = |i: usize| &vectors[i * n..][..n];
            for i in 0..n {
                for j in 0..n {
                    let one: f64 = v(i).iter().zip(v(j)).map(|(x, y)| x * y).sum();
                    prop_assert!((one - f64::from(u8::from(i == j))).abs() < 1e-13);
                    let form: f64 = (0..n).map(|k| v(i)[k] * (0..n).map(|l| a[k * n + l] * v(j)[l]).sum::<f64>()).sum();
                    let expected = if i == j { values[i] } else { 0.0 };
                    prop_assert!((form - expected).abs() < 1e-12 * largest, "{} {} {}", i, j, form - expected);
                }
            }
            let mut large = [0.0; 100];
            let wrong = &mut MatMut::square(&mut large, 10).unwrap();
            let refused = decompose(&mut MatMut::square(&mut spoilt, n).unwrap(), &mut values, wrong);
            prop_assert_eq!(refused, Err(LinalgError::Shape));
        }

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
