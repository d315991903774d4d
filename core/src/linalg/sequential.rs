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
use super::{LinalgError, axpy, dot};
use crate::real::Real;

/// What a scalar update found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarUpdate<T> {
    /// Innovation variance s = hᵀ P h + r, in squared units of the measurement.
    pub innovation_variance: T,
    /// ν / √s, standard normal if model and noise are right [1].
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
            Self::Sparse { indices, values } => {
                indices.iter().zip(*values).fold(T::ZERO, |sum, (&i, &value)| sum + value * x[i])
            }
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
    for i in 0..mean.len() {
        let k = gain[i] / update.innovation_variance;
        axpy(&mut p.row_mut(i)[..=i], -k, &gain[..=i]);
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
    for i in 0..mean.len() {
        let k = gain[i] / s;
        let row = p.row_mut(i);
        axpy(row, -k, gain);
        work[i] = variance * k - h.dot(row);
    }
    for i in 0..mean.len() {
        axpy(&mut p.row_mut(i)[..=i], work[i] / s, &gain[..=i]);
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
