//! The measurement update in information form, for many rows of few coefficients on a state of tens.
//!
//! The rows of an epoch are gathered first, and P is updated once:
//! ```text
//! J = Hᵀ R⁻¹ H,   g = Hᵀ R⁻¹ ν
//! P⁻ = L Lᵀ,   I + Lᵀ J L = U Uᵀ (U upper),   P = (L U⁻ᵀ)(L U⁻ᵀ)ᵀ,   m ← m + P g
//! νᵀ S⁻¹ ν = νᵀ R⁻¹ ν − gᵀ P g,   ln det S = ln det R + 2 Σ ln U_ii
//! ```
//! which follows from P⁻¹ = (P⁻)⁻¹ + J (B. D. O. Anderson & J. B. Moore, *Optimal Filtering*, 1979, sec. 6.3) without
//! any inverse: U⁻ᵀ and L are both lower triangular, so is their product, a Cholesky factor of P. The cost of the update
//! does not depend on the number of rows: 4 n³/3 multiply-adds in tiles ([`crate::linalg::tiles`]). Against
//! [`super::Form::Sequential`] this pays from about as many rows as states.
//!
//! P is positive semidefinite by construction. The identity loses the digits that the largest eigenvalue of Lᵀ J L has: safe
//! for a prior/noise ratio of standard deviations of 1e5.
//!
//! Differences to one in common need no correlated rows here: their R⁻¹ is known in closed form, see
//! [`Information::differences`].
//!
//! Panic contract: none; states outside of the dimensions are ignored.

use core::ops::Range;

use heapless::Vec;

use super::{Gauge, Rows, UpdateError, not_positive_definite};
use crate::linalg::tiles::{self, Tiles};
use crate::linalg::{MatMut, axpy, cholesky, copy, dot, tail, tail_mut};
use crate::real::Real;

/// Most coefficients of a row.
pub const ENTRIES: usize = 32;

/// What the rows gathered so far say of n states.
#[derive(Debug)]
pub struct Information<'a, T> {
    /// J, n × n, lower triangle.
    matrix: MatMut<'a, T>,
    /// g, n entries.
    vector: &'a mut [T],
    /// Coefficients of a sum of rows, n entries.
    sum: &'a mut [T],
    work: &'a mut [T],
    /// νᵀ R⁻¹ ν and ln det R.
    gauge: Gauge<T>,
}

/// The entries of a row; an error where they are more than [`ENTRIES`].
#[inline(always)]
fn entries<T: Real>(rows: &impl Rows<T>, row: usize) -> Result<Vec<(usize, T), ENTRIES>, UpdateError> {
    let (mut entries, mut fit) = (Vec::new(), true);
    rows.for_each(row, &mut |state, coefficient| fit &= entries.push((state, coefficient)).is_ok());
    if fit { Ok(entries) } else { Err(UpdateError::Shape) }
}

/// How long a buffer [`Information`] needs for `n` states.
pub const fn buffer_len(n: usize) -> usize {
    n * n + 2 * n + 4 * tiles::buffer_len(n, n)
}

impl<'a, T: Real> Information<'a, T> {
    /// Nothing yet of `n` states, on a buffer of at least [`buffer_len`] numbers.
    pub fn new(buffer: &'a mut [T], n: usize) -> Result<Self, UpdateError> {
        if buffer.len() < buffer_len(n) {
            return Err(UpdateError::Shape);
        }
        let (matrix, rest) = buffer.split_at_mut_checked(n * n).ok_or(UpdateError::Shape)?;
        let (vector, rest) = rest.split_at_mut_checked(n).ok_or(UpdateError::Shape)?;
        let (sum, work) = rest.split_at_mut_checked(n).ok_or(UpdateError::Shape)?;
        matrix.fill(T::ZERO);
        vector.fill(T::ZERO);
        let gauge = Gauge { rows: 0, normalized_innovation_squared: T::ZERO, log_determinant: 0.0 };
        Ok(Self { matrix: MatMut::square(matrix, n)?, vector, sum, work, gauge })
    }

    /// Adds `range` of `rows`, whose noises are independent.
    #[inline(always)]
    pub fn independent(
        &mut self,
        rows: &impl Rows<T>,
        range: Range<usize>,
        innovation: impl Fn(usize) -> T,
        variance: impl Fn(usize) -> T,
    ) -> Result<(), UpdateError> {
        for row in range {
            let variance = variance(row);
            self.add(&entries(rows, row)?, innovation(row), T::ONE / variance);
            self.gauge.rows += 1;
            self.gauge.log_determinant += libm::log(variance.to_f64());
        }
        Ok(())
    }

    /// Adds `range` of `rows`, which are differences to one in common: their noise is variance · M Mᵀ, M Mᵀ = I + 11ᵀ.
    #[inline(always)]
    pub fn differences(
        &mut self,
        rows: &impl Rows<T>,
        range: Range<usize>,
        innovation: impl Fn(usize) -> T,
        variance: T,
    ) -> Result<(), UpdateError> {
        let count = range.len();
        let (weight, mut innovations) = (T::ONE / variance, T::ZERO);
        self.sum.fill(T::ZERO);
        for row in range {
            let (entries, innovation) = (entries(rows, row)?, innovation(row));
            self.add(&entries, innovation, weight);
            for &(state, coefficient) in &entries {
                if let Some(sum) = self.sum.get_mut(state) {
                    *sum += coefficient;
                }
            }
            innovations += innovation;
        }
        // (M Mᵀ)⁻¹ = I − 11ᵀ/(m + 1).
        let all = count as f64 + 1.0;
        let weight = weight / T::from_f64(all);
        for ((i, row), &sum) in self.matrix.iter_mut().enumerate().zip(self.sum.iter()) {
            if sum != T::ZERO {
                axpy(row.get_mut(..=i).unwrap_or_default(), -(weight * sum), self.sum);
            }
        }
        axpy(self.vector, -(weight * innovations), self.sum);
        self.gauge.normalized_innovation_squared -= weight * innovations * innovations;
        self.gauge.rows += count;
        self.gauge.log_determinant += count as f64 * libm::log(variance.to_f64()) + libm::log(all);
        Ok(())
    }

    /// J += w h hᵀ, g += w h ν.
    #[inline(always)]
    fn add(&mut self, row: &[(usize, T)], innovation: T, weight: T) {
        for &(i, h_i) in row {
            let weighted = weight * h_i;
            if let Some(entry) = self.vector.get_mut(i) {
                *entry += weighted * innovation;
            }
            let to_diagonal = self.matrix.row_mut(i).get_mut(..=i).unwrap_or_default();
            for &(j, h_j) in row {
                if let Some(entry) = to_diagonal.get_mut(j) {
                    *entry += weighted * h_j;
                }
            }
        }
        self.gauge.normalized_innovation_squared += weight * innovation * innovation;
    }

    /// Updates the lower triangle of `p`, n × n, and adds to the `correction` of the mean. Unchanged on an error.
    #[inline(always)]
    pub fn update(self, correction: &mut [T], p: &mut MatMut<'_, T>) -> Result<Gauge<T>, UpdateError> {
        let (n, mut gauge) = (self.vector.len(), self.gauge);
        if [correction.len(), p.rows(), p.cols()] != [n; 3] {
            return Err(UpdateError::Shape);
        }
        if gauge.rows == 0 {
            return Err(UpdateError::NoRows);
        }
        let (mut r, rest) = Tiles::split(self.work, n, n)?;
        let (mut l, rest) = Tiles::split(rest, n, n)?;
        let (mut first, rest) = Tiles::split(rest, n, n)?;
        let (mut second, _) = Tiles::split(rest, n, n)?;
        r.load_symmetric(n, T::ONE, |i, row| copy(row, p.row(i)));
        r.factor().map_err(not_positive_definite)?;
        l.copy_transposed_upper(&r);
        first.load_symmetric(n, T::ZERO, |i, row| copy(row, self.matrix.row(i)));
        second.product(&first, &l, true);
        // I + Lᵀ J L; U is the factor of what this is in opposite order, flipped.
        first.one_plus_lower(&l, &second);
        second.copy_reversed(&first);
        second.factor().map_err(|_| UpdateError::NotFinite)?;
        gauge.log_determinant += cholesky::log_determinant(second.view(tiles::padded(n), tiles::padded(n))?);
        first.copy_flipped(&second);
        // (L U⁻ᵀ)ᵀ = U⁻¹ Lᵀ.
        first.backward(&mut r, true);
        let mut explained = T::ZERO;
        for (i, along) in self.sum.iter_mut().enumerate() {
            *along = dot(tail(r.row(i), i), tail(self.vector, i));
            explained += *along * *along;
        }
        gauge.normalized_innovation_squared -= explained;
        if !gauge.normalized_innovation_squared.is_finite() {
            return Err(UpdateError::NotFinite);
        }
        for (i, &along) in self.sum.iter().enumerate() {
            axpy(tail_mut(correction, i), along, tail(r.row(i), i));
        }
        r.square_upper(p);
        Ok(gauge)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Form, update};
    use super::{Gauge, Information, UpdateError, buffer_len};
    use crate::linalg::{Mat, MatMut, spd};
    use proptest::prelude::*;

    /// Rows and their noise as [`update`] takes them: mean, covariance and gauge by the array form.
    fn reference(p: &[f64], h: &[f64], innovation: &[f64], noise: &[f64]) -> (Vec<f64>, Vec<f64>, Gauge<f64>) {
        let (m, n) = (innovation.len(), h.len() / innovation.len());
        let (mut mean, mut p) = (vec![0.0; n], p.to_vec());
        let mut buffer = vec![0.0; super::super::buffer_len(m, n)];
        let gauge = update(
            Form::Array,
            &mut mean,
            &mut MatMut::square(&mut p, n).unwrap(),
            &Mat::new(h, m, n, n).unwrap(),
            &mut innovation.to_vec(),
            &mut MatMut::square(&mut noise.to_vec(), m).unwrap(),
            &mut buffer,
        );
        (mean, p, gauge.unwrap())
    }

    fn assert_equal(p: &[f64], found: (&[f64], &[f64], Gauge<f64>), expected: (Vec<f64>, Vec<f64>, Gauge<f64>)) {
        let n = found.0.len();
        assert_eq!(found.2.rows, expected.2.rows);
        let [found_nis, expected_nis] = [found.2, expected.2].map(|gauge| gauge.normalized_innovation_squared);
        assert!((found_nis - expected_nis).abs() < 1e-7 * (1.0 + expected_nis), "{found_nis} {expected_nis}");
        assert!((found.2.log_determinant - expected.2.log_determinant).abs() < 1e-8);
        for i in 0..n {
            let sigma = |i: usize| p[i * (n + 1)].sqrt();
            assert!((found.0[i] - expected.0[i]).abs() < 1e-7 * sigma(i));
            for j in 0..=i {
                assert!((found.1[i * n + j] - expected.1[i * n + j]).abs() < 1e-9 * sigma(i) * sigma(j));
            }
        }
    }

    proptest! {
        #[test]
        fn equals_the_array_form(
            (n, p) in spd::matrix(1..20usize),
            m in 1..12usize,
            h in proptest::collection::vec(prop_oneof![Just(0.0), 0.1..1.0f64], 20 * 12),
            innovation in proptest::collection::vec(-3.0..3.0f64, 12),
        ) {
            let mut h = h[..m * n].to_vec();
            (0..m).for_each(|i| h[i * n + i % n] = 1.0);
            let noise: Vec<f64> = (0..m * m).map(|k| if k % (m + 1) == 0 { 0.5 + (k / m) as f64 } else { 0.0 }).collect();
            let (mut buffer, mut correction, mut q) = (vec![f64::NAN; buffer_len(n)], vec![0.0; n], p.clone());
            let mut information = Information::new(&mut buffer, n).unwrap();
            let rows = Mat::new(&h, m, n, n).unwrap();
            information.independent(&rows, 0..m, |i| innovation[i], |i| noise[i * (m + 1)]).unwrap();
            let gauge = information.update(&mut correction, &mut MatMut::square(&mut q, n).unwrap()).unwrap();
            assert_equal(&p, (&correction, &q, gauge), reference(&p, &h, &innovation[..m], &noise));
        }

        #[test]
        fn differences_have_the_noise_of_differences(
            (n, p) in spd::matrix(1..12usize),
            m in 1..9usize,
            h in proptest::collection::vec(prop_oneof![Just(0.0), 0.1..1.0f64], 12 * 9),
            innovation in proptest::collection::vec(-3.0..3.0f64, 9),
            variance in 0.01..4.0f64,
        ) {
            let mut h = h[..m * n].to_vec();
            (0..m).for_each(|i| h[i * n + i % n] = 1.0);
            let noise: Vec<f64> = (0..m * m).map(|k| variance * if k % (m + 1) == 0 { 2.0 } else { 1.0 }).collect();
            let (mut buffer, mut correction, mut q) = (vec![f64::NAN; buffer_len(n)], vec![0.0; n], p.clone());
            let mut information = Information::new(&mut buffer, n).unwrap();
            let rows = Mat::new(&h, m, n, n).unwrap();
            information.differences(&rows, 0..m, |i| innovation[i], variance).unwrap();
            let gauge = information.update(&mut correction, &mut MatMut::square(&mut q, n).unwrap()).unwrap();
            assert_equal(&p, (&correction, &q, gauge), reference(&p, &h, &innovation[..m], &noise));
        }
    }

    #[test]
    fn refused_updates_change_nothing() {
        let attempt = |p: [f64; 4], coefficient: f64, innovation: f64, variance: f64| {
            let (mut buffer, mut correction, mut q) = ([0.0; buffer_len(2)], [0.0; 2], p);
            let mut information = Information::new(&mut buffer, 2).unwrap();
            // The third coefficient is of a state that is not there.
            let h = [coefficient, 0.0, 1.0];
            let rows = Mat::new(&h, 1, 3, 3).unwrap();
            information.independent(&rows, 0..1, |_| innovation, |_| variance).unwrap();
            let outcome = information.update(&mut correction, &mut MatMut::square(&mut q, 2).unwrap());
            assert_eq!((correction, q.map(f64::to_bits)), ([0.0; 2], p.map(f64::to_bits)));
            outcome
        };
        let p = [2.0, 1.0, 1.0, 2.0];
        assert_eq!(attempt([1.0, 2.0, 2.0, 1.0], 1.0, 0.0, 1.0), Err(UpdateError::NotPositiveDefinite { state: 1 }));
        assert_eq!(attempt(p, 1.0, f64::NAN, 1.0), Err(UpdateError::NotFinite));
        assert_eq!(attempt(p, f64::NAN, 0.0, 1.0), Err(UpdateError::NotFinite));
        assert_eq!(attempt(p, 1.0, 0.0, 0.0), Err(UpdateError::NotFinite));
        let mut buffer = [0.0; buffer_len(2)];
        let mut q = p;
        let nothing = Information::new(&mut buffer, 2).unwrap();
        assert_eq!(nothing.update(&mut [0.0; 2], &mut MatMut::square(&mut q, 2).unwrap()), Err(UpdateError::NoRows));
        assert!(Information::new(&mut buffer, 9).is_err());
    }
}
