//! Kalman update of the Cholesky factor of a covariance by one scalar measurement, by orthogonal rotations.
//!
//! With P = L Lᵀ, f = Lᵀ h and measurement noise r, a sequence of Givens rotations Θ makes the array lower triangular:
//! ```text
//! [ √r  fᵀ ]       [ √s   0  ]         s = hᵀ P h + r,   g = P h / √s,   L' L'ᵀ = P − g gᵀ
//! [ 0   L  ] Θ  =  [ g    L' ]         x̂ ← x̂ + g ν/√s
//! ```
//! N. A. Carlson, *Fast triangular formulation of the square root filter*, AIAA J. 11 (1973); T. Kailath, A. H. Sayed,
//! B. Hassibi, *Linear Estimation* (2000), sec. 12.3. Column n−1 is rotated first, so that L stays triangular; row by row
//! the same rotations apply, so that the loops run over contiguous rows.
//!
//! Nothing is subtracted, so that L' keeps its digits whatever the prior: at a prior of 10 km against 2 cm the means are
//! right to 1e-9 of their standard deviations. Cost 2.5 n² multiply-adds and n square roots.
//!
//! Panic contract: none.

use super::view::MatMut;
use super::{LinalgError, axpy, head_mut};
use crate::real::Real;

/// Updates the lower triangle of `l` by a measurement with row `h` and noise `variance` ≥ 0; returns s. `gain` returns
/// g = P h/√s. `cosines` and `sines` are workspace; all slices have n entries.
///
/// On an error `l` is unchanged: [`LinalgError::Shape`], or [`LinalgError::NotFinite`] for numbers that are not finite or
/// s = 0.
pub fn update<T: Real>(
    l: &mut MatMut<'_, T>,
    h: &[T],
    variance: T,
    gain: &mut [T],
    cosines: &mut [T],
    sines: &mut [T],
) -> Result<T, LinalgError> {
    let n = l.rows();
    if [l.cols(), h.len(), gain.len(), cosines.len(), sines.len()] != [n; 5] {
        return Err(LinalgError::Shape);
    }
    gain.fill(T::ZERO);
    for (i, &h) in h.iter().enumerate().filter(|(_, h)| **h != T::ZERO) {
        axpy(head_mut(gain, i + 1), h, l.row(i));
    }
    // Rotations from f, last column first; `length` grows from √r to √s.
    let mut square = variance;
    let mut length = variance.sqrt();
    for ((&f, cosine), sine) in gain.iter().zip(&mut *cosines).zip(&mut *sines).rev() {
        square += f * f;
        let longer = square.sqrt();
        (*cosine, *sine) = if longer > T::ZERO { (length / longer, f / longer) } else { (T::ONE, T::ZERO) };
        length = longer;
    }
    if !(square > T::ZERO && square.is_finite() && variance >= T::ZERO) {
        return Err(LinalgError::NotFinite);
    }
    for ((i, row), gain) in l.iter_mut().enumerate().zip(gain) {
        let mut carried = T::ZERO;
        for ((l, &c), &s) in head_mut(row, i + 1).iter_mut().zip(&*cosines).zip(&*sines).rev() {
            let rotated = c * *l - s * carried;
            carried = c * carried + s * *l;
            *l = rotated;
        }
        *gain = carried;
    }
    Ok(square)
}

#[cfg(test)]
mod tests {
    use super::super::sequential::{Row, update_scalar};
    use super::super::{cholesky, dot, spd, symmetric};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_the_plain_update(
            (n, prior) in spd::matrix(1..9usize),
            h in proptest::collection::vec(-1.0..1.0f64, 8),
            variance in 0.01..10.0f64,
        ) {
            let h = &h[..n];
            let (mut mean, mut plain, mut gain) = (vec![0.0; n], prior.clone(), vec![0.0; n]);
            let mut view = MatMut::square(&mut plain, n).unwrap();
            let expected = update_scalar(&mut mean, &mut view, Row::Dense(h), 1.5, variance, &mut gain).unwrap();

            let mut l = prior.clone();
            let mut view = MatMut::square(&mut l, n).unwrap();
            cholesky::factor(&mut view).unwrap();
            let (mut g, mut c, mut s) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
            let found = update(&mut view, h, variance, &mut g, &mut c, &mut s).unwrap();
            prop_assert!((found / expected.innovation_variance - 1.0).abs() < 1e-11);
            symmetric::square(&mut view);
            for i in 0..n {
                prop_assert!((g[i] * 1.5 / found.sqrt() - mean[i]).abs() < 1e-9 * prior[i * (n + 1)].sqrt().max(1.0));
                for j in 0..=i {
                    let scale = (prior[i * (n + 1)] * prior[j * (n + 1)]).sqrt();
                    prop_assert!((l[i * n + j] - plain[i * n + j]).abs() < 1e-11 * scale);
                }
            }
        }
    }

    /// The case that the plain form fails, see [`super::super::sequential`]: a prior of 10 km, 1 mm twice, to ten digits.
    #[test]
    fn a_wide_prior_costs_nothing() {
        let mut l = [1e8, 0.0, 0.9e8, 1e8];
        let mut l = MatMut::square(&mut l, 2).unwrap();
        cholesky::factor(&mut l).unwrap();
        let (mut g, mut c, mut s) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        for h in [[1.0, 0.1], [1.0, 0.1], [0.1, 1.0]] {
            update(&mut l, &h, 1e-6, &mut g, &mut c, &mut s).unwrap();
        }
        let h = [1.0, 0.1];
        let f = [h[0] * l.at(0, 0) + h[1] * l.at(1, 0), h[1] * l.at(1, 1)];
        assert!((dot(&f, &f) / 0.5e-6 - 1.0).abs() < 1e-10, "{}", dot(&f, &f));
    }

    #[test]
    fn refused_updates_change_nothing() {
        let refused = |h: [f64; 2], variance: f64| {
            let mut l = [2.0, 0.0, 1.0, 2.0];
            let (mut g, mut c, mut s) = ([0.0; 2], [0.0; 2], [0.0; 2]);
            let error = update(&mut MatMut::square(&mut l, 2).unwrap(), &h, variance, &mut g, &mut c, &mut s);
            assert_eq!(l, [2.0, 0.0, 1.0, 2.0]);
            error.unwrap_err()
        };
        assert_eq!(refused([f64::NAN, 0.0], 1.0), LinalgError::NotFinite);
        assert_eq!(refused([1.0, 0.0], -1.0), LinalgError::NotFinite);
        assert_eq!(refused([1.0, 0.0], f64::NAN), LinalgError::NotFinite);
        assert_eq!(refused([0.0, 0.0], 0.0), LinalgError::NotFinite);
        let mut l = [1.0];
        let shape =
            update(&mut MatMut::square(&mut l, 1).unwrap(), &[1.0, 0.0], 1.0, &mut [0.0], &mut [0.0], &mut [0.0]);
        assert_eq!(shape, Err(LinalgError::Shape));
    }
}
