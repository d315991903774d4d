//! Kalman update by one scalar measurement, in place.
//!
//! Measurement y = hᵀ x + e, e ~ (0, r), innovation ν = y − hᵀ x̂:
//! ```text
//! v = P h,  s = hᵀ v + r,  k = v / s,  x̂ ← x̂ + k ν,  P ← P − v vᵀ / s          (plain)
//!                                               P ← (I − k hᵀ) P (I − k hᵀ)ᵀ + r k kᵀ   (Joseph)
//! ```
//! B. D. O. Anderson & J. B. Moore, *Optimal Filtering* (1979), sec. 6.1; R. S. Bucy & P. D. Joseph (1968). Rows with
//! correlated noise are first whitened, [`super::block::whiten`].
//!
//! The plain form subtracts two numbers of the size of the prior. It is safe while the prior standard deviation of
//! what the row observes stays below about 1e5 times the measurement's (100 m against 1 mm): at 1 km and 2 cm the
//! variances are wrong by 3e-6 of themselves, at 10 km by 4e-4 (measured, f64). The Joseph form loses three to four
//! digits less and costs three times as much.
//!
//! P is full, symmetric on entry; the lower triangle is computed and mirrored, so that symmetry is exact. With z
//! nonzeros in h the plain update costs z·n + n²/2 multiply-adds, the Joseph form about (2z + 1.5 n)·n.

use super::view::MatMut;
use super::{LinalgError, axpy, dot, head_mut};
use crate::real::Real;

/// What a scalar update found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarUpdate<T> {
    /// Innovation variance s = hᵀ P h + r, in squared units of the measurement.
    pub innovation_variance: T,
    /// ν / √s, standard normal if model and noise are right `[1]`.
    pub normalized_innovation: T,
}

/// A measurement row h: all n coefficients, or the few that differ from zero.
#[derive(Clone, Copy, Debug)]
pub enum Row<'a, T> {
    /// One coefficient for every state.
    Dense(&'a [T]),
    /// Coefficients `values[k]` at states `indices[k]`; an index may occur twice, the coefficients then add.
    Sparse {
        /// States with a coefficient.
        indices: &'a [usize],
        /// Their coefficients.
        values: &'a [T],
    },
}

impl<T: Real> Row<'_, T> {
    /// Whether the row belongs to a state of dimension n.
    fn fits(&self, n: usize) -> bool {
        match self {
            Self::Dense(h) => h.len() == n,
            Self::Sparse { indices, values } => indices.len() == values.len() && indices.iter().all(|&i| i < n),
        }
    }

    /// hᵀ x.
    fn dot(&self, x: &[T]) -> T {
        match self {
            Self::Dense(h) => dot(h, x),
            Self::Sparse { indices, values } => indices
                .iter()
                .zip(*values)
                .fold(T::ZERO, |sum, (&i, &value)| sum + value * x.get(i).copied().unwrap_or(T::ZERO)),
        }
    }

    /// v ← P h for a symmetric P, by rows.
    fn times_symmetric(&self, p: &MatMut<'_, T>, v: &mut [T]) {
        match self {
            Self::Dense(h) => {
                for (i, v) in v.iter_mut().enumerate() {
                    *v = dot(p.row(i), h);
                }
            }
            Self::Sparse { indices, values } => {
                v.fill(T::ZERO);
                for (&i, &value) in indices.iter().zip(*values) {
                    axpy(v, value, p.row(i));
                }
            }
        }
    }
}

/// Plain update of `mean` and `p` by one measurement with row `h`, innovation ν and noise variance r. `gain`, of the
/// state's dimension, is workspace and returns k.
///
/// Nothing but `gain` has changed when an error is returned: [`LinalgError::Shape`], or [`LinalgError::NotFinite`]
/// for numbers that are not finite or an innovation variance that is not positive.
pub fn update_scalar<T: Real>(
    mean: &mut [T],
    p: &mut MatMut<'_, T>,
    h: Row<'_, T>,
    innovation: T,
    variance: T,
    gain: &mut [T],
) -> Result<ScalarUpdate<T>, LinalgError> {
    let update = prepare(mean, p, h, innovation, variance, gain)?;
    for ((i, row), &v) in p.iter_mut().enumerate().zip(&*gain) {
        axpy(head_mut(row, i + 1), -(v / update.innovation_variance), gain);
    }
    p.mirror_lower();
    finish(mean, innovation, &update, gain);
    Ok(update)
}

/// As [`update_scalar`] in Joseph's form, safe for wide priors. `work`, of the state's dimension, is workspace.
pub fn update_scalar_joseph<T: Real>(
    mean: &mut [T],
    p: &mut MatMut<'_, T>,
    h: Row<'_, T>,
    innovation: T,
    variance: T,
    gain: &mut [T],
    work: &mut [T],
) -> Result<ScalarUpdate<T>, LinalgError> {
    if work.len() != mean.len() {
        return Err(LinalgError::Shape);
    }
    let update = prepare(mean, p, h, innovation, variance, gain)?;
    // A = (I − k hᵀ) P, then A − (A h) kᵀ + r k kᵀ. The product A h, which is r k but for rounding, is computed from
    // A itself: this is what makes the form stable.
    let s = update.innovation_variance;
    for (row, (work, &v)) in p.iter_mut().zip(work.iter_mut().zip(&*gain)) {
        let k = v / s;
        axpy(row, -k, gain);
        *work = variance * k - h.dot(row);
    }
    for (i, (row, &work)) in p.iter_mut().zip(&*work).enumerate() {
        axpy(head_mut(row, i + 1), work / s, gain);
    }
    p.mirror_lower();
    finish(mean, innovation, &update, gain);
    Ok(update)
}

/// Checks everything and computes v = P h (into `gain`) and s.
fn prepare<T: Real>(
    mean: &[T],
    p: &MatMut<'_, T>,
    h: Row<'_, T>,
    innovation: T,
    variance: T,
    gain: &mut [T],
) -> Result<ScalarUpdate<T>, LinalgError> {
    let n = mean.len();
    if p.rows() != n || p.cols() != n || gain.len() != n || !h.fits(n) {
        return Err(LinalgError::Shape);
    }
    h.times_symmetric(p, gain);
    let s = h.dot(gain) + variance;
    let finite = s.is_finite() && innovation.is_finite() && gain.iter().all(|v| v.is_finite());
    if !(finite && s > T::ZERO && variance >= T::ZERO) {
        return Err(LinalgError::NotFinite);
    }
    Ok(ScalarUpdate { innovation_variance: s, normalized_innovation: innovation / s.sqrt() })
}

/// Turns v into k and updates the mean.
fn finish<T: Real>(mean: &mut [T], innovation: T, update: &ScalarUpdate<T>, gain: &mut [T]) {
    for v in gain.iter_mut() {
        *v /= update.innovation_variance;
    }
    axpy(mean, innovation, gain);
}

#[cfg(test)]
mod tests {
    use super::super::{Mat, spd};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sparse_and_dense_and_joseph_agree(
            (n, prior) in spd::matrix(2..9usize),
            values in proptest::collection::vec(-1.0..1.0f64, 2),
            variance in 0.01..10.0f64,
        ) {
            let indices = [0, n - 1];
            let mut h = vec![0.0; n];
            h[0] = values[0];
            h[n - 1] = values[1];
            let rows = [Row::Dense(&h), Row::Sparse { indices: &indices, values: &values }];
            let mut results = Vec::new();
            for row in rows {
                for joseph in [false, true] {
                    let (mut mean, mut p) = (vec![0.0; n], prior.clone());
                    let (mut gain, mut work) = (vec![0.0; n], vec![0.0; n]);
                    let mut view = MatMut::square(&mut p, n).unwrap();
                    let update = if joseph {
                        update_scalar_joseph(&mut mean, &mut view, row, 1.5, variance, &mut gain, &mut work)
                    } else {
                        update_scalar(&mut mean, &mut view, row, 1.5, variance, &mut gain)
                    };
                    let s = update.unwrap().innovation_variance;
                    prop_assert!((dot(&gain, &h) - (1.0 - variance / s)).abs() < 1e-12, "hᵀ k = hᵀ P h / s");
                    for i in 0..n {
                        for j in 0..n {
                            prop_assert_eq!(p[i * n + j], p[j * n + i]);
                        }
                        prop_assert!(p[i * n + i] <= prior[i * n + i]);
                    }
                    results.push((mean, p));
                }
            }
            let (mean, p) = &results[0];
            for (other_mean, other_p) in &results[1..] {
                for k in 0..n * n {
                    let scale = (prior[k / n * (n + 1)] * prior[k % n * (n + 1)]).sqrt();
                    prop_assert!((p[k] - other_p[k]).abs() < 1e-12 * scale);
                }
                for i in 0..n {
                    prop_assert!((mean[i] - other_mean[i]).abs() < 1e-12 * prior[i * n + i].sqrt().max(1.0) * 100.0);
                }
            }
        }
    }

    /// Two sensors of variance 1 and 3 on one state of variance 1: 1/P = 1/1 + 1/1 + 1/3, and the weighted mean.
    #[test]
    fn by_hand() {
        let (mut mean, mut p, mut gain) = ([0.0], [1.0], [0.0]);
        for (y, variance) in [(1.0, 1.0), (2.0, 3.0)] {
            let innovation = y - mean[0];
            let mut p = MatMut::square(&mut p, 1).unwrap();
            update_scalar(&mut mean, &mut p, Row::Dense(&[1.0]), innovation, variance, &mut gain).unwrap();
        }
        assert!((p[0] - 3.0 / 7.0f64).abs() < 1e-15);
        assert!((mean[0] - (1.0 + 2.0 / 3.0) * 3.0 / 7.0f64).abs() < 1e-15);
    }

    /// A prior of 10 km, a measurement of 1 mm, twice: the exact variance is r/2 to ten digits. The plain form has
    /// lost it, the Joseph form has not.
    #[test]
    fn joseph_survives_a_wide_prior() {
        let posterior = |joseph: bool| {
            let (mut mean, mut p) = ([0.0; 2], [1e8, 0.9e8, 0.9e8, 1e8]);
            let (mut gain, mut work) = ([0.0; 2], [0.0; 2]);
            for h in [[1.0, 0.1], [1.0, 0.1], [0.1, 1.0]] {
                let mut p = MatMut::square(&mut p, 2).unwrap();
                let row = Row::Dense(&h);
                if joseph {
                    update_scalar_joseph(&mut mean, &mut p, row, 0.0, 1e-6, &mut gain, &mut work).unwrap();
                } else if update_scalar(&mut mean, &mut p, row, 0.0, 1e-6, &mut gain).is_err() {
                    return f64::NAN;
                }
            }
            let p = Mat::square(&p, 2).unwrap();
            let h = [1.0, 0.1];
            (0..2).map(|i| h[i] * dot(p.row(i), &h)).sum::<f64>()
        };
        assert!((posterior(true) / 0.5e-6 - 1.0).abs() < 1e-3, "{}", posterior(true));
        assert!(posterior(false).is_nan() || (posterior(false) / 0.5e-6 - 1.0).abs() > 1e-3, "{}", posterior(false));
    }

    #[test]
    fn refused_updates_change_nothing() {
        let try_update = |h: Row<'_, f64>, innovation: f64, variance: f64| {
            let (mut mean, mut p, mut gain) = ([1.0, 2.0], [2.0, 1.0, 1.0, 2.0], [0.0; 2]);
            let mut work = [0.0; 2];
            let mut view = MatMut::square(&mut p, 2).unwrap();
            let plain = update_scalar(&mut mean, &mut view, h, innovation, variance, &mut gain);
            let joseph = update_scalar_joseph(&mut mean, &mut view, h, innovation, variance, &mut gain, &mut work);
            assert_eq!((mean, p), ([1.0, 2.0], [2.0, 1.0, 1.0, 2.0]));
            assert_eq!(plain, joseph);
            plain.unwrap_err()
        };
        let unit = Row::Dense(&[1.0, 0.0]);
        assert_eq!(try_update(unit, f64::NAN, 1.0), LinalgError::NotFinite);
        assert_eq!(try_update(unit, 0.0, f64::INFINITY), LinalgError::NotFinite);
        assert_eq!(try_update(unit, 0.0, -1.0), LinalgError::NotFinite);
        assert_eq!(try_update(Row::Dense(&[0.0, 0.0]), 0.0, 0.0), LinalgError::NotFinite);
        assert_eq!(try_update(Row::Dense(&[f64::NAN, 0.0]), 0.0, 1.0), LinalgError::NotFinite);
        assert_eq!(try_update(Row::Dense(&[1.0]), 0.0, 1.0), LinalgError::Shape);
        assert_eq!(try_update(Row::Sparse { indices: &[2], values: &[1.0] }, 0.0, 1.0), LinalgError::Shape);
        assert_eq!(try_update(Row::Sparse { indices: &[0], values: &[] }, 0.0, 1.0), LinalgError::Shape);
    }
}
