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
//! common term and brings nothing else. Rows may be left out at will, and no satellite is special.
//!
//! Cost: O(n) a row besides the update. Panic contract: none.

use super::update::{Rows, Stage, UpdateError};
use crate::linalg::dot;
use crate::real::Real;

/// The running weighted means of the rows that share a common term.
#[derive(Clone, Debug)]
pub struct CommonTerm<T, const N: usize> {
    weight: T,
    measurement: T,
    row: [T; N],
    difference: [T; N],
}

/// A row without the common term: y = h x + e.
#[derive(Clone, Copy, Debug)]
pub struct Difference<'a, T> {
    /// h, a coefficient for each state.
    pub row: &'a [T],
    /// y.
    pub measurement: T,
    /// Variance of e, independent of the rows before.
    pub variance: T,
}

impl<T: Real> Difference<'_, T> {
    /// Takes it into the update of a density with the given mean.
    pub fn update(&self, stage: &mut Stage<'_, T>, mean: &[T]) -> Result<(), UpdateError> {
        stage.independent(self, 0..1, |_| self.measurement - dot(self.row, mean), |_| self.variance)
    }
}

impl<T: Real> Rows<T> for Difference<'_, T> {
    fn for_each(&self, _row: usize, entry: &mut dyn FnMut(usize, T)) {
        for (state, &coefficient) in self.row.iter().enumerate().filter(|(_, c)| **c != T::ZERO) {
            entry(state, coefficient);
        }
    }
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
        Self { weight: T::ZERO, measurement: T::ZERO, row: zero, difference: zero }
    }

    /// Starts a new common term.
    pub fn reset(&mut self) {
        self.weight = T::ZERO;
        self.measurement = T::ZERO;
        self.row.fill(T::ZERO);
    }

    /// Takes the measurement `y` = h x + c + e, e ~ N(0, `variance`), of a density with `n` states, whose row h has the
    /// given entries (index, value), and returns what it says of x. The first row says nothing; one that is not finite,
    /// or whose variance is not positive, is left out.
    pub fn difference(&mut self, n: usize, entries: &[(usize, T)], y: T, variance: T) -> Option<Difference<'_, T>> {
        if !(variance > T::ZERO && variance.is_finite() && y.is_finite()) {
            return None;
        }
        let n = n.min(N);
        let weight = T::ONE / variance;
        let known = (self.weight > T::ZERO).then(|| {
            let inverse = T::ONE / self.weight;
            for (d, &r) in self.difference[..n].iter_mut().zip(&self.row) {
                *d = -(r * inverse);
            }
            for &(i, value) in entries {
                if let Some(d) = self.difference[..n].get_mut(i) {
                    *d += value;
                }
            }
            (y - self.measurement * inverse, variance + inverse)
        });
        for &(i, value) in entries {
            if let Some(r) = self.row[..n].get_mut(i) {
                *r += value * weight;
            }
        }
        self.measurement += y * weight;
        self.weight += weight;
        known.map(|(measurement, variance)| Difference { row: &self.difference[..n], measurement, variance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::gaussian::{Gaussian, UpdateWork};
    use crate::filter::update::Form;
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
        let mut common = CommonTerm::<f64, 6>::new();
        let outcome = density.update(Form::Sequential, &mut UpdateWork::new(), |stage, mean| {
            for i in 0..5 {
                let entries: Vec<(usize, f64)> = (0..4).map(|j| (j, h[(i, j)])).collect();
                let difference = common.difference(4, &entries, y[i], variances[i]);
                assert_eq!(difference.is_none(), i == 0);
                difference.map_or(Ok(()), |difference| difference.update(stage, mean))?;
            }
            Ok(())
        });
        assert_eq!(outcome.unwrap().rows, 4);

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
    fn a_row_without_a_variance_is_left_out() {
        let mut common = CommonTerm::<f64, 2>::new();
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(common.difference(1, &[(0, 1.0)], 1.0, bad).is_none());
        }
        assert!(common.difference(1, &[(0, 1.0)], 5.0, 1.0).is_none(), "the first row");
        let difference = common.difference(1, &[(0, 3.0), (7, 1.0)], 6.0, 1.0).unwrap();
        assert_eq!((difference.row, difference.measurement, difference.variance), (&[2.0][..], 1.0, 2.0));
    }
}
