//! Sequential updates with measurements that share one free common term, exactly and without forming differences.
//!
//! ```text
//! yᵢ = hᵢ x + c + eᵢ,   eᵢ ~ N(0, σᵢ²) independent,   c free
//! ```
//!
//! Single differences of one constellation and band share their receiver clock c like this; eliminating it is what
//! double differencing does. With W = Σⱼ 1/σⱼ² and the weighted means ȳ, h̄ over the rows taken so far, the next row gives
//!
//! ```text
//! yᵢ − ȳ = (hᵢ − h̄) x + e,   e ~ N(0, σᵢ² + 1/W)
//! ```
//!
//! independent of the rows before (the Helmert form of whitening R = σ_ref² 11ᵀ + diag(σᵢ²)). The first row defines the
//! common term and updates nothing. Rows may be left out at will, and no satellite is special.
//!
//! Cost: O(n) a row besides the update. Panic contract: none.

use super::gaussian::{Gaussian, IndefiniteError};
use crate::real::Real;

/// The running weighted means of the rows that share a common term, and workspace.
#[derive(Clone, Debug)]
pub struct CommonTerm<T, const N: usize> {
    weight: T,
    measurement: T,
    row: [T; N],
    difference: [T; N],
    gain: [T; N],
}

impl<T: Real, const N: usize> Default for CommonTerm<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const N: usize> CommonTerm<T, N> {
    /// No rows yet; suits a `static`.
    pub const fn new() -> Self {
        let zero = [T::ZERO; N];
        Self { weight: T::ZERO, measurement: T::ZERO, row: zero, difference: zero, gain: zero }
    }

    /// Starts a new common term.
    pub fn reset(&mut self) {
        self.weight = T::ZERO;
        self.measurement = T::ZERO;
        self.row.fill(T::ZERO);
    }

    /// Updates `density` with the measurement `y` = h x + c + e, e ~ N(0, `variance`), whose row h has the given
    /// entries (index, value). Returns the innovation and its variance, or `None` for the first row.
    pub fn update(
        &mut self,
        density: &mut Gaussian<T, N>,
        entries: &[(usize, T)],
        y: T,
        variance: T,
    ) -> Result<Option<(T, T)>, IndefiniteError> {
        if !(variance > T::ZERO && variance.is_finite() && y.is_finite()) {
            return Err(IndefiniteError);
        }
        let n = density.dim();
        let weight = T::ONE / variance;
        let mut outcome = None;
        if self.weight > T::ZERO {
            let inverse = T::ONE / self.weight;
            for (d, &r) in self.difference[..n].iter_mut().zip(&self.row) {
                *d = -(r * inverse);
            }
            for &(i, value) in entries.iter().filter(|(i, _)| *i < n) {
                self.difference[i] += value;
            }
            let mut innovation = y - self.measurement * inverse;
            for (&d, &m) in self.difference[..n].iter().zip(density.mean()) {
                innovation -= d * m;
            }
            let s = density.update(&self.difference[..n], innovation, variance + inverse, &mut self.gain)?;
            outcome = Some((innovation, s));
        }
        for &(i, value) in entries.iter().filter(|(i, _)| *i < n) {
            self.row[i] += value * weight;
        }
        self.measurement += y * weight;
        self.weight += weight;
        Ok(outcome)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The batch update with explicit differences against the first row and their full covariance σ₁² 11ᵀ + diag(σᵢ²)
    /// gives the same density.
    #[test]
    fn equals_the_block_update_with_correlated_differences() {
        let h = DMatrix::from_row_slice(
            5,
            4,
            &[0.3, -0.5, 0.8, 0.0, 0.1, 0.9, -0.2, 1.0, -0.7, 0.4, 0.6, 0.0, 0.5, 0.5, -0.1, 0.0, -0.2, 0.1, 0.9, 2.0],
        );
        let y = [103.0, 101.5, 99.0, 102.2, 100.1];
        let variances = [0.5, 1.0, 0.25, 2.0, 0.7];
        let mut density = Gaussian::<f64, 6>::new();
        let prior = [4.0, 2.0, 3.0, 10.0];
        for variance in prior {
            density.push(0.1, variance).unwrap();
        }
        let mut common = CommonTerm::new();
        for i in 0..5 {
            let entries: Vec<(usize, f64)> = (0..4).map(|j| (j, h[(i, j)])).collect();
            let first = common.update(&mut density, &entries, y[i], variances[i]).unwrap().is_none();
            assert_eq!(first, i == 0);
        }

        let d = DMatrix::from_fn(4, 5, |i, j| if j == 0 { -1.0 } else { f64::from(u8::from(j == i + 1)) });
        let r = &d * DMatrix::from_diagonal(&DVector::from_row_slice(&variances)) * d.transpose();
        let p = DMatrix::from_diagonal(&DVector::from_row_slice(&prior));
        let m = DVector::from_element(4, 0.1);
        let hd = &d * &h;
        let s = &hd * &p * hd.transpose() + r;
        let k = &p * hd.transpose() * s.clone().try_inverse().unwrap();
        let mean = &m + &k * (&d * DVector::from_row_slice(&y) - &hd * &m);
        let covariance = &p - &k * s * k.transpose();
        for i in 0..4 {
            assert!((density.mean()[i] - mean[i]).abs() < 1e-12);
            for j in 0..4 {
                assert!((density.covariance(i, j) - covariance[(i, j)]).abs() < 1e-12);
                assert_eq!(density.covariance(i, j), density.covariance(j, i));
            }
        }
    }

    #[test]
    fn a_row_without_a_variance_is_refused_and_changes_nothing() {
        let mut density = Gaussian::<f64, 2>::new();
        density.push(1.0, 2.0).unwrap();
        let mut common = CommonTerm::new();
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(common.update(&mut density, &[(0, 1.0)], 1.0, bad), Err(IndefiniteError));
        }
        assert_eq!(common.update(&mut density, &[(0, 1.0)], 5.0, 1.0), Ok(None));
        assert_eq!((density.mean()[0], density.covariance(0, 0)), (1.0, 2.0));
    }
}
