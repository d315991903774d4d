//! A density with its mean in `f64`, its covariance in T, and how to go back to the last good one.

use crate::linalg::{LinalgError, Mat, MatMut, copy, head, head_mut, projection, symmetric, triangular};
use crate::real::Real;

/// N(m, P). Between epochs P is full and symmetric. Within an epoch its lower triangle is worked on, and the strict upper
/// one with `diagonal` and `last` are the last good density.
#[derive(Debug)]
pub(super) struct Density<T, const N: usize> {
    pub mean: [f64; N],
    pub covariance: [[T; N]; N],
    last: [f64; N],
    diagonal: [T; N],
    correction: [T; N],
}

/// A density cut to its dimension; code on it is compiled once for every N.
pub(super) struct Cut<'a, T> {
    pub mean: &'a mut [f64],
    pub p: MatMut<'a, T>,
    /// What the updates of this epoch add to the mean.
    pub correction: &'a mut [T],
    last: &'a mut [f64],
    diagonal: &'a mut [T],
}

impl<T: Real, const N: usize> Density<T, N> {
    pub const fn new() -> Self {
        let zero = [T::ZERO; N];
        Self { mean: [0.0; N], covariance: [zero; N], last: [0.0; N], diagonal: zero, correction: zero }
    }

    /// The first n states.
    pub fn cut(&mut self, n: usize) -> Result<Cut<'_, T>, LinalgError> {
        if n > N {
            return Err(LinalgError::Shape);
        }
        Ok(Cut {
            mean: head_mut(&mut self.mean, n),
            p: MatMut::new(self.covariance.as_flattened_mut(), n, n, N)?,
            correction: head_mut(&mut self.correction, n),
            last: head_mut(&mut self.last, n),
            diagonal: head_mut(&mut self.diagonal, n),
        })
    }

    /// What the updates of the latest epoch added to the mean.
    pub fn correction(&self) -> &[T] {
        &self.correction
    }

    /// Mean and covariance of the first n states, between epochs.
    pub fn view(&self, n: usize) -> (&[f64], Mat<'_, T>) {
        let covariance = Mat::new(self.covariance.as_flattened(), n, n, N);
        (head(&self.mean, n), covariance.unwrap_or(Mat::empty()))
    }
}

impl<T: Real> Cut<'_, T> {
    /// Sets mean and lower triangle.
    pub fn set(mut self, mean: &[f64], covariance: impl Fn(usize, usize) -> T) -> Self {
        copy(self.mean, mean);
        self.set_covariance(covariance);
        self
    }

    /// Sets the lower triangle.
    pub fn set_covariance(&mut self, covariance: impl Fn(usize, usize) -> T) {
        for (i, row) in self.p.iter_mut().enumerate() {
            for (j, entry) in head_mut(row, i + 1).iter_mut().enumerate() {
                *entry = covariance(i, j);
            }
        }
    }

    /// The density of the least-squares estimate Q x = b with the transpose of U from [`projection::orthogonalize`] in P's
    /// place: mean U⁻¹ Qᵀ b, covariance U⁻¹ U⁻ᵀ.
    pub fn solve(&mut self, q: Mat<'_, T>, b: &[T]) -> Result<(), LinalgError> {
        projection::solve(q, self.p.as_ref(), b, self.correction)?;
        triangular::invert(&mut self.p)?;
        symmetric::square_transposed(&mut self.p);
        self.mean.fill(0.0);
        self.correct();
        Ok(())
    }

    /// Starts an epoch: from here on [`Self::roll_back`] returns to this density.
    pub fn begin(&mut self) {
        copy(self.last, self.mean);
        symmetric::keep_diagonal(self.p.as_ref(), self.diagonal);
        self.correction.fill(T::ZERO);
    }

    /// Back to where the epoch began.
    pub fn roll_back(&mut self) {
        copy(self.mean, self.last);
        symmetric::restore(&mut self.p, self.diagonal);
    }

    /// Ends an epoch.
    pub fn commit(&mut self) {
        self.p.mirror_lower();
    }

    /// Adds the correction to the mean.
    pub fn correct(&mut self) {
        for (mean, correction) in self.mean.iter_mut().zip(&*self.correction) {
            *mean += correction.to_f64();
        }
    }
}
