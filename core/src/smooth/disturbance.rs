//! The disturbance smoother: an adjoint pair (r, N) runs backward instead of smoothed moments.
//!
//! ```text
//! mˢ = m⁻ + P⁻ r,   Pˢ = P⁻ − P⁻ N P⁻                                          (r, N before the measurement of an epoch)
//! measurement:  r ← h ν/s + (I − k hᵀ)ᵀ r,   N ← h hᵀ/s + (I − k hᵀ)ᵀ N (I − k hᵀ),   k = P h/s,  s = hᵀ P h + R
//! time step:    r ← Fᵀ r,   N ← Fᵀ N F                                         (from before x⁺ to after x)
//! noise:        E[q qᵀ | Y] = Q − Q N Q + (Q r)(Q r)ᵀ
//! ```
//! A. E. Bryson & M. Frazier (1963); P. de Jong, *Smoothing and interpolation with the state-space model* (1989);
//! S. J. Koopman, *Disturbance smoother for state space models* (1993). It starts from r = 0, N = 0 after the last measurement and
//! needs neither an inverse nor the smoothed covariance. After the measurement of an epoch the same pair gives
//! mˢ = m + P r, Pˢ = P − P N P.
//!
//! The rows of an epoch that were taken one after another go back in the opposite order. Cost of a row n², 1.5 n² if it is
//! dense, of a time step z n + z n⁺ for z entries in F. N is kept in its lower triangle. Panic contract: none.

use super::em::Sum;
use super::step::{BLOCK, Block, Step};
use super::{Moments, MomentsMut, SmoothError, shape};
use crate::linalg::{MatMut, axpy, dot, symmetric};
use crate::real::Real;

/// A row of no more entries than this is taken by its entries.
const FEW: usize = 12;

/// The pair (r, N) on buffers of the caller.
#[derive(Debug)]
pub struct Adjoint<'a, T> {
    /// r, n entries.
    pub score: &'a mut [T],
    /// N, n × n, of which the lower triangle counts.
    pub information: MatMut<'a, T>,
}

impl<'a, T: Real> Adjoint<'a, T> {
    /// On packed buffers: n numbers, and at least n².
    pub fn packed(score: &'a mut [T], information: &'a mut [T]) -> Result<Self, SmoothError> {
        let n = score.len();
        Ok(Self { score, information: MatMut::square(information, n)? })
    }

    /// Becomes (0, 0): there is nothing to learn from later epochs.
    pub fn clear(&mut self) {
        self.score.fill(T::ZERO);
        self.information.fill(T::ZERO);
    }

    /// Goes back through one measurement with row `h`, gain k, innovation ν and its variance s. `work` has n entries.
    pub fn measurement(
        &mut self,
        h: &[T],
        gain: &[T],
        innovation: T,
        variance: T,
        work: &mut [T],
    ) -> Result<(), SmoothError> {
        let n = self.score.len();
        let information = &mut self.information;
        shape([h.len(), gain.len(), work.len(), information.rows(), information.cols()], [n; 5])?;
        let score = innovation / variance - dot(gain, self.score);
        // With w = N k: N ← N − w hᵀ − h wᵀ + (kᵀ w + 1/s) h hᵀ = N − u hᵀ − h uᵀ, u = w − (kᵀ w + 1/s) h / 2.
        symmetric::multiply(information.as_ref(), gain, work);
        let half = T::from_f64(-0.5) * (dot(gain, work) + T::ONE / variance);
        if !(score.is_finite() && half.is_finite()) {
            return Err(SmoothError::NotFinite);
        }
        axpy(work, half, h);
        axpy(self.score, score, h);
        let mut few = [(0, T::ZERO); FEW];
        let entries = h.iter().copied().enumerate().filter(|(_, h)| *h != T::ZERO);
        let count = entries.clone().count();
        few.iter_mut().zip(entries).for_each(|(to, entry)| *to = entry);
        for ((row, (&h_i, &u_i)), i) in information.iter_mut().zip(h.iter().zip(work.iter())).zip(1..) {
            let row = row.get_mut(..i).unwrap_or_default();
            match few.get(..count) {
                Some(few) => few.iter().for_each(|&(j, h_j)| {
                    if let Some(entry) = row.get_mut(j) {
                        *entry -= u_i * h_j;
                    }
                }),
                None => axpy(row, -u_i, h),
            }
            if h_i != T::ZERO {
                axpy(row, -h_i, work);
            }
        }
        Ok(())
    }

    /// Goes back through a time step: `before` becomes the pair after the measurements of x, this one being that before
    /// the measurements of x⁺. `work` is n × n⁺.
    pub fn time_step(
        &self,
        step: &Step<'_, T>,
        before: &mut Adjoint<'_, T>,
        work: &mut MatMut<'_, T>,
    ) -> Result<(), SmoothError> {
        let (n, after) = (step.map.columns, step.map.rows());
        let (from, to) = (&self.information, &mut before.information);
        shape([self.score.len(), from.rows(), from.cols()], [after; 3])?;
        shape([before.score.len(), to.rows(), to.cols(), work.rows(), work.cols()], [n, n, n, n, after])?;
        before.score.fill(T::ZERO);
        work.fill(T::ZERO);
        for (i, &score) in self.score.iter().enumerate() {
            for &(column, coefficient) in step.map.row(i) {
                if let Some(entry) = before.score.get_mut(column) {
                    *entry += coefficient * score;
                }
                symmetric::add_row(from.as_ref(), i, coefficient, work.row_mut(column));
            }
        }
        to.iter_mut().enumerate().for_each(|(a, row)| row.get_mut(..=a).unwrap_or_default().fill(T::ZERO));
        for (a, (row, mapped)) in to.iter_mut().zip(work.iter()).enumerate() {
            for (i, &mapped) in mapped.iter().enumerate() {
                for &(column, coefficient) in step.map.row(i).iter().filter(|(column, _)| *column <= a) {
                    if let Some(entry) = row.get_mut(column) {
                        *entry += coefficient * mapped;
                    }
                }
            }
        }
        Ok(())
    }

    /// The smoothed moments, from those of the filter at the same side of the measurement. `work` is n × n.
    pub fn smooth(
        &self,
        filter: Moments<'_, T>,
        smoothed: &mut MomentsMut<'_, T>,
        work: &mut MatMut<'_, T>,
    ) -> Result<(), SmoothError> {
        let n = self.score.len();
        filter.fits(n)?;
        smoothed.as_ref().fits(n)?;
        shape([work.rows(), work.cols()], [n; 2])?;
        let p = filter.covariance;
        // N P, then P (N P) from the rows of P.
        for (i, row) in work.iter_mut().enumerate() {
            row.fill(T::ZERO);
            for k in 0..n {
                let information = self.information.at(i.max(k), i.min(k));
                if information != T::ZERO {
                    symmetric::add_row(p, k, information, row);
                }
            }
        }
        for (i, (row, mean)) in smoothed.covariance.iter_mut().zip(smoothed.mean.iter_mut()).enumerate() {
            let row = row.get_mut(..=i).unwrap_or_default();
            let mut shift = T::ZERO;
            for (entry, &p) in row.iter_mut().zip(p.row(i)) {
                *entry = p;
            }
            for (k, &score) in self.score.iter().enumerate() {
                let p = p.at(i.max(k), i.min(k));
                shift += p * score;
                axpy(row, -p, work.row(k));
            }
            *mean = filter.mean.get(i).copied().unwrap_or_default() + shift;
        }
        Ok(())
    }

    /// E[qᵀ shape⁻¹ q | Y] of a block of the noise of x⁺, this pair being that before the measurements of x⁺.
    pub fn noise(&self, block: &Block<T>) -> Result<Sum, SmoothError> {
        let states = block.states.get(..block.dim).ok_or(SmoothError::Shape)?;
        let mut score = [T::ZERO; BLOCK];
        let mut information = [[T::ZERO; BLOCK]; BLOCK];
        for (row, (score, &i)) in information.iter_mut().zip(score.iter_mut().zip(states)) {
            *score = *self.score.get(i).ok_or(SmoothError::Shape)?;
            for (entry, &j) in row.iter_mut().zip(states) {
                *entry = self.information.get(i.max(j), i.min(j)).ok_or(SmoothError::Shape)?;
            }
        }
        Ok(Sum::of_disturbance(block, &score, &information))
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::problem;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_dense_batch_least_squares(problem in problem()) {
            let smoothed = problem.smooth_by_disturbances(&problem.filter(), |_, _| {});
            problem.assert_batch(&smoothed, 1e-9);
        }
    }

    #[test]
    fn bad_input_is_refused() {
        let (mut r, mut n) = ([0.0], [0.0]);
        let mut adjoint = Adjoint::packed(&mut r, &mut n).unwrap();
        assert_eq!(adjoint.measurement(&[1.0], &[1.0], 1.0, 0.0, &mut [0.0]), Err(SmoothError::NotFinite));
        assert_eq!(adjoint.measurement(&[1.0], &[1.0; 2], 1.0, 1.0, &mut [0.0]), Err(SmoothError::Shape));
        let block = Block { states: [1, 0, 0], dim: 1, shape: [[1.0; 3]; 3], scale: 1.0, component: None };
        assert_eq!(adjoint.noise(&block), Err(SmoothError::Shape));
        assert_eq!(adjoint.noise(&Block { dim: 4, ..block }), Err(SmoothError::Shape));
        assert_eq!((r, n), ([0.0], [0.0]));
    }
}
