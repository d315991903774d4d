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
use crate::linalg::{Mat, MatMut, around_mut, dot, ldl, tail};
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
    if !variances.iter().all(|&d| d > T::ZERO) {
        return Err(IntegerError::NotFinite);
    }
    let mut norm = T::ZERO;
    let floats = a.iter().zip(variances).zip(fixed).enumerate().rev();
    for (i, ((&a, &variance), fixed)) in floats {
        let (_, residual, later) = around_mut(residual, i)?;
        let conditional = a - dot(tail(factor.row(i), i + 1), later);
        let integer = conditional.round();
        *fixed = to_integer(integer)?;
        *residual = conditional - integer;
        norm += *residual * *residual / variance;
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
    for (work, &row) in work.iter_mut().zip(order) {
        for (entry, &col) in work.iter_mut().zip(order) {
            *entry = q.at(row, col);
        }
    }
    ldl::factor_ldlt(work, variances)?;
    for (i, (&index, fixed)) in order.iter().zip(fixed).enumerate() {
        let (earlier, residual, _) = around_mut(residual, i)?;
        let a = *a.get(index).ok_or(IntegerError::Shape)?;
        let conditional = a - dot(work.row(i), earlier);
        let integer = conditional.round();
        *fixed = to_integer(integer)?;
        *residual = conditional - integer;
    }
    Ok(success_rate::bootstrapped(variances))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::spd;
    use proptest::prelude::*;

    /// U = [[1, ½], [0, 1]]: 0.6 rounds to 1 and moves the other by ½·0.4.
    #[test]
    fn by_hand() {
        let u = [1.0, 0.5, 0.0, 1.0];
        let (mut fixed, mut residual) = ([0; 2], [0.0; 2]);
        let u = Mat::square(&u, 2).unwrap();
        let norm = bootstrap(&[0.35, 0.6], u, &[0.5, 0.25], &mut fixed, &mut residual).unwrap();
        assert_eq!(fixed, [1, 1]);
        assert!((residual[0] + 0.45).abs() < 1e-15 && (residual[1] + 0.4).abs() < 1e-15);
        assert!((norm - (0.45 * 0.45 / 0.5 + 0.16 / 0.25)).abs() < 1e-14);
    }

    #[test]
    fn bad_arguments_are_refused() {
        let u = [1.0];
        let u = Mat::square(&u, 1).unwrap();
        let (mut fixed, mut residual) = ([0], [0.0]);
        let mut try_one = |a: &[f64], d: &[f64]| bootstrap(a, u, d, &mut fixed, &mut residual).unwrap_err();
        assert_eq!(try_one(&[0.0, 0.0], &[1.0]), IntegerError::Shape);
        assert_eq!(try_one(&[0.0], &[0.0]), IntegerError::NotFinite);
        assert_eq!(try_one(&[0.0], &[f64::NAN]), IntegerError::NotFinite);
        assert_eq!(try_one(&[f64::NAN], &[1.0]), IntegerError::Overflow);
        assert_eq!(try_one(&[1e300], &[1.0]), IntegerError::Overflow);
    }

    proptest! {
        /// Bootstrapping last first on Q = Lᵀ D L is bootstrapping in the order n…1.
        #[test]
        fn the_two_forms_agree((n, q) in spd::matrix(1..7usize), a in proptest::collection::vec(-9.0..9.0f64, 7)) {
            let a = &a[..n];
            let (mut u, mut d) = (q.clone(), vec![0.0; n]);
            let mut view = MatMut::square(&mut u, n).unwrap();
            ldl::factor_ltdl(&mut view, &mut d).unwrap();
            view.transpose();
            let (mut fixed, mut residual) = (vec![0; n], vec![0.0; n]);
            bootstrap(a, Mat::square(&u, n).unwrap(), &d, &mut fixed, &mut residual).unwrap();

            let order: Vec<usize> = (0..n).rev().collect();
            let (mut work, mut variances) = (vec![0.0; n * n], vec![0.0; n]);
            let (mut ordered, mut ordered_residual) = (vec![0; n], vec![0.0; n]);
            bootstrap_ordered(
                a,
                Mat::square(&q, n).unwrap(),
                &order,
                &mut MatMut::square(&mut work, n).unwrap(),
                &mut variances,
                &mut ordered_residual,
                &mut ordered,
            )
            .unwrap();
            prop_assume!(residual.iter().all(|r| r.abs() < 0.4999));
            for (k, &i) in order.iter().enumerate() {
                prop_assert_eq!(ordered[k], fixed[i]);
                prop_assert!((variances[k] / d[i] - 1.0).abs() < 1e-8);
            }
        }
    }
}
