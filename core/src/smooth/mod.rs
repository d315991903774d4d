//! Smoothing: estimates of the past from all measurements, and what they say of the noise.
//!
//! One step of each recursion; the loops and the storage belong to the caller, so that the same steps serve a host with
//! a day of data and a target with a ring of a few epochs.
//!
//! * [`step`]: x⁺ = F x + b + q, rectangular where states are born or die.
//! * [`predict`]: the moments of x⁺ from those of x.
//! * [`rts`]: the moments of x given all measurements, from those of x⁺ (Rauch–Tung–Striebel).
//! * [`tiled`]: both of these steps, for tens of states on a host.
//! * [`disturbance`]: the same by an adjoint pair (r, N), without gains or inverses (Bryson–Frazier).
//! * [`em`]: the sums of which the M-step of EM is the quotient.
//! * [`fixed_lag`]: a ring of the latest epochs, smoothed on request.
//!
//! All matrices are views. Covariances are read and written in their lower triangles only; the strict upper ones may hold
//! anything and are left alone. Memory is the caller's, the cost of a step stands with each; nothing panics.

pub mod disturbance;
pub mod em;
mod error;
pub mod fixed_lag;
pub mod predict;
pub mod rts;
pub mod step;
pub mod tiled;

#[cfg(test)]
mod batch;

pub use error::SmoothError;

use crate::linalg::{Mat, MatMut};

/// A density N(m, P) to read.
#[derive(Clone, Copy, Debug)]
pub struct Moments<'a, T> {
    /// m, n entries.
    pub mean: &'a [T],
    /// P, n × n, of which the lower triangle counts.
    pub covariance: Mat<'a, T>,
}

/// A density N(m, P) to write.
#[derive(Debug)]
pub struct MomentsMut<'a, T> {
    /// m, n entries.
    pub mean: &'a mut [T],
    /// P, n × n, of which the lower triangle counts.
    pub covariance: MatMut<'a, T>,
}

impl<'a, T: Copy> Moments<'a, T> {
    /// Views packed buffers: n means, and at least n² numbers by rows.
    pub fn packed(mean: &'a [T], covariance: &'a [T]) -> Result<Self, SmoothError> {
        Ok(Self { mean, covariance: Mat::square(covariance, mean.len())? })
    }

    /// Whether P is n × n for n means.
    fn fits(&self, n: usize) -> Result<(), SmoothError> {
        shape([self.mean.len(), self.covariance.rows(), self.covariance.cols()], [n; 3])
    }
}

impl<'a, T: Copy> MomentsMut<'a, T> {
    /// Views packed buffers: n means, and at least n² numbers by rows.
    pub fn packed(mean: &'a mut [T], covariance: &'a mut [T]) -> Result<Self, SmoothError> {
        let n = mean.len();
        Ok(Self { mean, covariance: MatMut::square(covariance, n)? })
    }

    /// The same density to read.
    pub fn as_ref(&self) -> Moments<'_, T> {
        Moments { mean: self.mean, covariance: self.covariance.as_ref() }
    }
}

/// Refuses dimensions that are not those wanted.
fn shape<const N: usize>(are: [usize; N], wanted: [usize; N]) -> Result<(), SmoothError> {
    if are == wanted { Ok(()) } else { Err(SmoothError::Shape) }
}
