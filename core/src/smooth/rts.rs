//! One backward step of the Rauch–Tung–Striebel smoother.
//!
//! ```text
//! G = P Fᵀ (P⁻)⁻¹,   mˢ = m + G (mˢ⁺ − m⁻),   Pˢ = P + G (Pˢ⁺ − P⁻) Gᵀ,   cov(x⁺, x | Y) = Pˢ⁺ Gᵀ
//! ```
//! Greiff et al. (2023), eq. (4), with the index of the prediction put right (P⁻ is that of x⁺). Gᵀ comes from P⁻ = L Lᵀ by
//! two triangular solves. F may be rectangular: a state that was born at x⁺ has an empty row in F, hence a zero column in
//! G; a state that died is smoothed through those that lived on.
//!
//! Cost n⁺³/6 + n⁺² n + n⁺² n + n⁺ n²/2 multiply-adds. Lower triangles only. Panic contract: none.

use super::predict::map_rows;
use super::step::Step;
use super::{Moments, MomentsMut, SmoothError, shape};
use crate::linalg::{Mat, MatMut, axpy, cholesky, copy, head_mut, triangular};
use crate::real::Real;

/// Memory of a step from n to n⁺ states; after it, the gain.
#[derive(Debug)]
pub struct Work<'a, T> {
    /// Gᵀ, n⁺ × n.
    gain: MatMut<'a, T>,
    /// (Pˢ⁺ − P⁻) Gᵀ, n⁺ × n.
    product: MatMut<'a, T>,
    /// Pˢ⁺ − P⁻, n⁺ × n⁺.
    difference: MatMut<'a, T>,
}

/// How long a buffer [`Work`] needs for a step from `n` to `after` states.
pub const fn buffer_len(after: usize, n: usize) -> usize {
    after * (2 * n + after)
}

impl<'a, T: Real> Work<'a, T> {
    /// On a buffer of at least [`buffer_len`] numbers.
    pub fn new(buffer: &'a mut [T], after: usize, n: usize) -> Result<Self, SmoothError> {
        let (gain, rest) = buffer.split_at_mut_checked(after * n).ok_or(SmoothError::Shape)?;
        let (product, rest) = rest.split_at_mut_checked(after * n).ok_or(SmoothError::Shape)?;
        Ok(Self {
            gain: MatMut::new(gain, after, n, n)?,
            product: MatMut::new(product, after, n, n)?,
            difference: MatMut::square(rest, after)?,
        })
    }

    /// Gᵀ of the step that was taken, n⁺ × n.
    pub fn gain_transposed(&self) -> Mat<'_, T> {
        self.gain.as_ref()
    }

    /// `out` (n⁺ × n) ← cov(x⁺, x | Y) = Pˢ⁺ Gᵀ, after the step.
    pub fn lag_one(&self, next: Mat<'_, T>, out: &mut MatMut<'_, T>) -> Result<(), SmoothError> {
        let (after, n) = (self.gain.rows(), self.gain.cols());
        shape([next.rows(), next.cols(), out.rows(), out.cols()], [after, after, after, n])?;
        symmetric_times(next, self.gain.as_ref(), out);
        Ok(())
    }
}

/// Smooths x, given the filtered moments of x, the predicted and the smoothed ones of x⁺.
///
/// `predicted.covariance` returns L in its lower triangle. `smoothed` may be the buffers of a later use; it is spoilt if
/// an error is returned.
pub fn smooth<T: Real>(
    step: &Step<'_, T>,
    filtered: Moments<'_, T>,
    predicted: &mut MomentsMut<'_, T>,
    next: Moments<'_, T>,
    smoothed: &mut MomentsMut<'_, T>,
    work: &mut Work<'_, T>,
) -> Result<(), SmoothError> {
    let (n, after) = (step.map.columns, step.map.rows());
    filtered.fits(n)?;
    smoothed.as_ref().fits(n)?;
    predicted.as_ref().fits(after)?;
    next.fits(after)?;
    shape([work.gain.rows(), work.gain.cols()], [after, n])?;

    for ((to, next), predicted) in
        work.difference.iter_mut().zip(next.covariance.iter()).zip(predicted.covariance.iter())
    {
        for ((to, &next), &predicted) in to.iter_mut().zip(next).zip(predicted) {
            *to = next - predicted;
        }
    }
    cholesky::factor(&mut predicted.covariance)?;
    let factor = predicted.covariance.as_ref();
    map_rows(step, filtered.covariance, &mut work.gain);
    triangular::forward_rows(factor, &mut work.gain)?;
    triangular::back_transposed_rows(factor, &mut work.gain)?;
    symmetric_times(work.difference.as_ref(), work.gain.as_ref(), &mut work.product);

    for (i, (to, from)) in smoothed.covariance.iter_mut().zip(filtered.covariance.iter()).enumerate() {
        copy(head_mut(to, i + 1), from);
    }
    for (gain, product) in work.gain.iter().zip(work.product.iter()) {
        for ((i, row), &gain) in smoothed.covariance.iter_mut().enumerate().zip(gain) {
            axpy(head_mut(row, i + 1), gain, product);
        }
    }
    add_gain(work.gain.as_ref(), filtered.mean, predicted.mean, next.mean, smoothed.mean)
}

/// mˢ = m + G (mˢ⁺ − m⁻); refuses what is not finite.
#[inline(always)]
pub(super) fn add_gain<T: Real>(
    gain_transposed: Mat<'_, T>,
    filtered: &[T],
    predicted: &[T],
    next: &[T],
    smoothed: &mut [T],
) -> Result<(), SmoothError> {
    copy(smoothed, filtered);
    for ((gain, &next), &predicted) in gain_transposed.iter().zip(next).zip(predicted) {
        axpy(smoothed, next - predicted, gain);
    }
    if smoothed.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(SmoothError::NotFinite) }
}

/// `out` ← S A for the symmetric S of which the lower triangle counts.
fn symmetric_times<T: Real>(s: Mat<'_, T>, a: Mat<'_, T>, out: &mut MatMut<'_, T>) {
    out.fill(T::ZERO);
    for (i, row) in s.iter().enumerate() {
        for (j, &entry) in row.iter().enumerate().take(i + 1) {
            axpy(out.row_mut(i), entry, a.row(j));
            if j < i {
                axpy(out.row_mut(j), entry, a.row(i));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::problem;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Births, deaths, changes of reference, states without noise: the recursion is exact.
        #[test]
        fn equals_dense_batch_least_squares(problem in problem()) {
            let smoothed = problem.smooth(&problem.filter(), |_, _, _, _| {});
            problem.assert_batch(&smoothed, 1e-9);
        }

        #[test]
        fn lag_one_is_the_cross_covariance_of_the_batch(problem in problem()) {
            let (_, p) = problem.batch();
            let starts = problem.starts();
            problem.smooth(&problem.filter(), |k, predicted, next, work| {
                let (after, n) = (predicted.mean.len(), work.gain_transposed().cols());
                let mut lag = vec![f64::NAN; after * n];
                let mut lag = MatMut::new(&mut lag, after, n, n).unwrap();
                work.lag_one(next.covariance, &mut lag).unwrap();
                for i in 0..after {
                    for j in 0..n {
                        let (row, column) = (starts[k + 1] + i, starts[k] + j);
                        let sigmas = (p[(row, row)] * p[(column, column)]).sqrt();
                        assert!((lag.at(i, j) - p[(row, column)]).abs() < 1e-9 * sigmas);
                    }
                }
            });
        }
    }

    /// Random walk of two epochs, P = 1, Q = 1, x⁺ known to 1/2 after the next measurement (by hand): P⁻ = 2, G = 1/2,
    /// mˢ = 0 + (3 − 0)/2, Pˢ = 1 + (1/2 − 2)/4.
    #[test]
    fn by_hand() {
        use super::super::step::SparseMap;
        let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
        let step = Step { map, offset: &[0.0], noise: &[] };
        let (mut mean, mut p, mut buffer) = ([0.0], [2.0], [0.0; buffer_len(1, 1)]);
        let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
        let (mut smoothed_mean, mut smoothed_p) = ([0.0], [0.0]);
        let mut smoothed = MomentsMut::packed(&mut smoothed_mean, &mut smoothed_p).unwrap();
        let filtered = Moments::packed(&[0.0], &[1.0]).unwrap();
        let next = Moments::packed(&[3.0], &[0.5]).unwrap();
        let mut work = Work::new(&mut buffer, 1, 1).unwrap();
        smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut work).unwrap();
        assert!((work.gain_transposed().at(0, 0) - 0.5f64).abs() < 1e-15);
        assert!((smoothed_mean[0] - 1.5f64).abs() < 1e-15 && (smoothed_p[0] - 0.625f64).abs() < 1e-15);
        assert!((p[0] - 2f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn bad_input_is_refused() {
        use super::super::step::SparseMap;
        let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
        let step = Step { map, offset: &[0.0], noise: &[] };
        let attempt = |predicted: f64, next_mean: f64, states: usize| {
            let (mut mean, mut p, mut buffer) = ([0.0], [predicted], [0.0; 12]);
            let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
            let (mut smoothed_mean, mut smoothed_p) = ([0.0], [0.0]);
            let mut smoothed = MomentsMut::packed(&mut smoothed_mean, &mut smoothed_p).unwrap();
            let filtered = Moments::packed(&[0.0], &[1.0]).unwrap();
            let next_mean = [next_mean];
            let next = Moments::packed(&next_mean, &[0.5]).unwrap();
            let mut work = Work::new(&mut buffer, states, 1).unwrap();
            smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut work)
        };
        assert_eq!(attempt(0.0, 0.0, 1), Err(SmoothError::NotPositiveDefinite { state: 0 }));
        assert_eq!(attempt(f64::NAN, 0.0, 1), Err(SmoothError::NotPositiveDefinite { state: 0 }));
        assert_eq!(attempt(2.0, f64::NAN, 1), Err(SmoothError::NotFinite));
        assert_eq!(attempt(2.0, 0.0, 2), Err(SmoothError::Shape));
        assert!(Work::new(&mut [0.0; 2], 1, 1).is_err());
    }
}
