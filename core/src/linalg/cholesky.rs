//! Cholesky factorisation A = L Lᵀ in place.
//!
//! Golub & Van Loan, *Matrix Computations*, 4th ed., algorithm 4.2.2 in row order: row i of L needs only the rows
//! above it, all contiguous. Cost n³/3 multiply-adds, no workspace.
//!
//! A pivot is refused when it is not finite or not larger than ε times the diagonal entry it came from: it is then
//! rounding error and nothing else.

use super::view::{Mat, MatMut};
use super::{LinalgError, around, around_mut, dot, triangular};
use crate::real::Real;

/// Replaces the lower triangle of the symmetric n × n `a` by L. Reads the lower triangle only and leaves the strict
/// upper one untouched. On an error the rows above the pivot hold L, the rest is as it was.
pub fn factor<T: Real>(a: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    if a.rows() != a.cols() {
        return Err(LinalgError::Shape);
    }
    for i in 0..a.rows() {
        let (above, row) = a.split_row(i);
        for (j, row_j) in above.iter().enumerate() {
            let (before, entry, _) = around_mut(row, j)?;
            let (before_j, &pivot, _) = around(row_j, j)?;
            *entry = (*entry - dot(before, before_j)) / pivot;
        }
        let (before, entry, _) = around_mut(row, i)?;
        let pivot = *entry - dot(before, before);
        if !(pivot > T::EPSILON * *entry && pivot.is_finite()) {
            return Err(LinalgError::NotPositiveDefinite { pivot: i });
        }
        *entry = pivot.sqrt();
    }
    Ok(())
}

/// Solves A x = b in place of `b`, given L from [`factor`].
pub fn solve<T: Real>(l: Mat<'_, T>, b: &mut [T]) -> Result<(), LinalgError> {
    triangular::forward(l, b)?;
    triangular::back_transposed(l, b)
}

/// ln det A = 2 Σ ln Lᵢᵢ, given L from [`factor`]. Logarithms are taken of products as long as these are of moderate size.
pub fn log_determinant<T: Real>(l: Mat<'_, T>) -> f64 {
    let (mut sum, mut product) = (0.0, 1.0);
    for i in 0..l.rows().min(l.cols()) {
        product *= l.at(i, i).to_f64();
        if !(1e-100..1e100).contains(&product) {
            sum += libm::log(product);
            product = 1.0;
        }
    }
    2.0 * (sum + libm::log(product))
}

#[cfg(test)]
mod tests {
    use super::super::spd;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_matrix_comes_back((n, a) in spd::matrix(1..9usize)) {
            let mut l = a.clone();
            factor(&mut MatMut::square(&mut l, n).unwrap()).unwrap();
            let l = spd::lower(n, &l);
            let back = spd::product(n, &l, &spd::transposed(n, &l));
            for k in 0..n * n {
                let scale = (a[k / n * (n + 1)] * a[k % n * (n + 1)]).sqrt();
                prop_assert!((back[k] - a[k]).abs() < 1e-14 * scale);
            }
        }

        #[test]
        fn solves_have_small_residuals((n, a) in spd::matrix(1..9usize), x in proptest::collection::vec(-1.0..1.0f64, 9)) {
            let mut l = a.clone();
            factor(&mut MatMut::square(&mut l, n).unwrap()).unwrap();
            let b: Vec<f64> = (0..n).map(|i| dot(&a[i * n..(i + 1) * n], &x[..n])).collect();
            let mut solution = b.clone();
            solve(Mat::square(&l, n).unwrap(), &mut solution).unwrap();
            for i in 0..n {
                let row = &a[i * n..(i + 1) * n];
                let size: f64 = row.iter().zip(&solution).map(|(a, x)| (a * x).abs()).sum();
                prop_assert!((dot(row, &solution) - b[i]).abs() < 1e-12 * size.max(b[i].abs()));
            }
        }
    }

    /// Hand calculation: [[4, 2], [2, 5]] = L Lᵀ with L = [[2, 0], [1, 2]], det = 16.
    #[test]
    fn by_hand_and_inside_a_larger_buffer() {
        let mut buffer = [4.0f32, -1.0, 9.0, 2.0, 5.0, 9.0];
        let mut a = MatMut::new(&mut buffer, 2, 2, 3).unwrap();
        factor(&mut a).unwrap();
        assert!((log_determinant(a.as_ref()) - 16f64.ln()).abs() < 1e-12);
        assert_eq!(buffer, [2.0, -1.0, 9.0, 1.0, 2.0, 9.0]);
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        let refused = |mut a: [f64; 4]| factor(&mut MatMut::square(&mut a, 2).unwrap()).unwrap_err();
        assert_eq!(refused([1.0, 2.0, 2.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 1 });
        assert_eq!(refused([1.0, 1.0, 1.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 1 });
        assert_eq!(refused([0.0, 0.0, 0.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 0 });
        assert_eq!(refused([f64::NAN, 0.0, 0.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 0 });
        assert_eq!(refused([f64::INFINITY, 0.0, 0.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 0 });
        assert_eq!(refused([1.0, 0.0, f64::NAN, 1.0]), LinalgError::NotPositiveDefinite { pivot: 1 });
        let mut wide = [1.0; 6];
        assert_eq!(factor(&mut MatMut::new(&mut wide, 2, 3, 3).unwrap()), Err(LinalgError::Shape));
    }
}
