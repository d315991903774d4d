//! The backward step of [`super::rts`] for tens of states, in tiles of registers ([`crate::linalg::tiles`]).
//!
//! The same formulas and the same interface; the memory is larger, because dimensions are filled up to whole tiles. What
//! is inlined here can be compiled by the caller for the processor it finds. Cost n⁺³/6 + 2 n⁺² n + n⁺ n²/2 multiply-adds.
//! Lower triangles only. Panic contract: none.

use super::predict::map_rows;
use super::step::Step;
use super::{Moments, MomentsMut, SmoothError, shape};
use crate::linalg::tiles::{self, Tiles};
use crate::linalg::{Mat, axpy, copy};
use crate::real::Real;

/// Memory of a step from n to n⁺ states; after it, the gain.
#[derive(Debug)]
pub struct Work<'a, T> {
    after: usize,
    n: usize,
    /// Gᵀ, n⁺ × n.
    gain: Tiles<'a, T>,
    /// (Pˢ⁺ − P⁻) Gᵀ, n⁺ × n.
    product: Tiles<'a, T>,
    /// Pˢ⁺ − P⁻, n⁺ × n⁺.
    difference: Tiles<'a, T>,
    /// Lᵀ, n⁺ × n⁺.
    factor: Tiles<'a, T>,
}

/// How long a buffer [`Work`] needs for a step from `n` to `after` states.
pub const fn buffer_len(after: usize, n: usize) -> usize {
    2 * (tiles::buffer_len(after, n) + tiles::buffer_len(after, after))
}

impl<'a, T: Real> Work<'a, T> {
    /// On a buffer of at least [`buffer_len`] numbers, whatever is in it.
    pub fn new(buffer: &'a mut [T], after: usize, n: usize) -> Result<Self, SmoothError> {
        let (gain, rest) = Tiles::split(buffer, after, n)?;
        let (product, rest) = Tiles::split(rest, after, n)?;
        let (difference, rest) = Tiles::split(rest, after, after)?;
        let (factor, _) = Tiles::split(rest, after, after)?;
        Ok(Self { after, n, gain, product, difference, factor })
    }

    /// Gᵀ of the step that was taken, n⁺ × n.
    pub fn gain_transposed(&self) -> Mat<'_, T> {
        self.gain.view(self.after, self.n).unwrap_or(Mat::empty())
    }
}

/// Smooths x, given the filtered moments of x, the predicted and the smoothed ones of x⁺.
///
/// `predicted.covariance` returns L in its lower triangle. `smoothed` may be the buffers of a later use; it is spoilt if
/// an error is returned.
#[inline(always)]
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
    shape([work.n, work.after], [n, after])?;
    let Work { gain, product, difference, factor, .. } = work;

    factor.load_symmetric(after, T::ONE, |i, row| copy(row, predicted.covariance.row(i)));
    difference.load_symmetric(after, T::ZERO, |i, row| {
        for ((to, &next), &predicted) in row.iter_mut().zip(next.covariance.row(i)).zip(predicted.covariance.row(i)) {
            *to = next - predicted;
        }
    });
    factor.factor()?;
    gain.clear();
    map_rows(step, filtered.covariance, &mut gain.view_mut(after, n)?);
    factor.forward(gain);
    factor.backward(gain, false);
    product.product(difference, gain, false);
    Tiles::gram_lower(gain, product, filtered.covariance, &mut smoothed.covariance);

    copy(smoothed.mean, filtered.mean);
    for (i, (&next, &predicted)) in next.mean.iter().zip(predicted.mean.iter()).enumerate() {
        axpy(smoothed.mean, next - predicted, gain.row(i));
    }
    // The difference has been used: its place takes L.
    difference.copy_transposed_upper(factor);
    for i in 0..after {
        let row = predicted.covariance.row_mut(i).get_mut(..=i).unwrap_or_default();
        copy(row, difference.row(i));
    }
    if !smoothed.mean.iter().all(|x| x.is_finite()) {
        return Err(SmoothError::NotFinite);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::batch::problem;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Births, deaths, changes of reference, states without noise: as the plain step, factor and gain included.
        #[test]
        fn equals_the_plain_step(problem in problem()) {
            let pass = problem.filter();
            let mut tiled = pass.filtered.clone();
            let plain = problem.smooth(&pass, |k, factored, next, work| {
                let step = problem.transitions[k].step();
                let (n, after) = (step.map.columns, step.map.rows());
                let (mut mean, mut p) = pass.predicted[k + 1].clone();
                let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
                let filtered = Moments::packed(&pass.filtered[k].0, &pass.filtered[k].1).unwrap();
                let to = &mut tiled[k];
                let mut smoothed = MomentsMut::packed(&mut to.0, &mut to.1).unwrap();
                let mut buffer = vec![f64::NAN; buffer_len(after, n)];
                let mut tiles = Work::new(&mut buffer, after, n).unwrap();
                smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut tiles).unwrap();
                smoothed.covariance.mirror_lower();
                for i in 0..after {
                    for j in 0..=i {
                        let (factor, plain) = (predicted.covariance.at(i, j), factored.covariance.at(i, j));
                        assert!((factor - plain).abs() <= 1e-12 * factored.covariance.at(i, i).abs().max(plain.abs()));
                    }
                    let (gain, plain) = (tiles.gain_transposed(), work.gain_transposed());
                    assert!((0..n).all(|j| (gain.at(i, j) - plain.at(i, j)).abs() < 1e-9 * (1.0 + plain.at(i, j).abs())));
                }
            });
            problem.assert_batch(&tiled, 1e-9);
            problem.assert_batch(&plain, 1e-9);
        }
    }

    #[test]
    fn bad_input_is_refused() {
        use super::super::step::SparseMap;
        let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
        let step = Step { map, offset: &[0.0], noise: &[] };
        let attempt = |predicted: f64, next_mean: f64, states: usize| {
            let (mut mean, mut p, mut buffer) = ([0.0], [predicted], [0.0; buffer_len(2, 1)]);
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
