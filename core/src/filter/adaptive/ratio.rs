//! R* = D^½ R₀ D^½: how much larger the noise of a type of measurements, or of a channel, is than R₀ says.
//!
//! ```text
//! per type      s ← (1 − β) s + β tr(R₀⁻¹ E)/m        over the m measurements of the type
//! per channel   d ← (1 − β) d + β E_ii/(R₀)_ii         kept within bounds
//! ```
//! with E in the residual form of [`super`]. The correlation of double differences is that of R₀, and R* is positive
//! definite for any positive ratios. A channel that is new, or comes again, begins with 1.
//!
//! Cost: some operations for each measurement, m³/3 for a type with correlated measurements. No panics.

use crate::linalg::{LinalgError, Mat, MatMut, cholesky, dot, triangular};
use crate::real::Real;

/// (1 − β) ratio + β sample, within bounds; the ratio itself where the sample is not a number.
pub fn blend<T: Real>(ratio: T, beta: T, sample: T, [low, high]: [T; 2]) -> T {
    let blended = (T::ONE - beta) * ratio + beta * sample;
    if blended.is_finite() { within(blended, [low, high]) } else { ratio }
}

/// x, or the bound that it is beyond.
pub(super) fn within<T: Real>(x: T, [low, high]: [T; 2]) -> T {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

/// tr(R₀⁻¹ E)/m with E = ε εᵀ + `spread`, for the factor L of R₀ = L Lᵀ (m × m); `spread` = H P⁺ Hᵀ (m × m) and ε are
/// spoilt. 1 where there are no measurements.
pub fn mean_ratio<T: Real>(
    factor: Mat<'_, T>,
    residual: &mut [T],
    spread: &mut MatMut<'_, T>,
) -> Result<T, LinalgError> {
    let m = residual.len();
    if [factor.rows(), factor.cols(), spread.rows(), spread.cols()] != [m; 4] {
        return Err(LinalgError::Shape);
    }
    if m == 0 {
        return Ok(T::ONE);
    }
    triangular::forward(factor, residual)?;
    // tr(L⁻¹ S L⁻ᵀ) = tr(L⁻ᵀ L⁻¹ S).
    triangular::forward_rows(factor, spread)?;
    triangular::back_transposed_rows(factor, spread)?;
    let trace = (0..m).fold(T::ZERO, |sum, i| sum + spread.at(i, i));
    let ratio = (dot(residual, residual) + trace) / T::from_f64(m as f64);
    if ratio.is_finite() { Ok(ratio) } else { Err(LinalgError::NotFinite) }
}

/// `r` ← D^½ R₀ D^½ for the ratios D (m). `r` and R₀ are m × m.
pub fn scale<T: Real>(r: &mut MatMut<'_, T>, r0: Mat<'_, T>, ratios: &[T]) -> Result<(), LinalgError> {
    let m = ratios.len();
    if r.rows() != m || r.cols() != m {
        return Err(LinalgError::Shape);
    }
    r.copy_from(r0)?;
    for (row, &own) in r.iter_mut().zip(ratios) {
        for (entry, &other) in row.iter_mut().zip(ratios) {
            *entry *= (own * other).sqrt();
        }
    }
    Ok(())
}

/// R ← D^½ R D^½ for the roots of the ratios D.
pub fn rescale<T: Real>(r: &mut MatMut<'_, T>, roots: &[T]) {
    for (row, &own) in r.iter_mut().zip(roots) {
        for (entry, &other) in row.iter_mut().zip(roots) {
            *entry *= own * other;
        }
    }
}

/// The factor L of R₀ = L Lᵀ into `factor`, as [`mean_ratio`] wants it.
pub fn factor<T: Real>(r0: Mat<'_, T>, factor: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    factor.copy_from(r0)?;
    cholesky::factor(factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::spd;
    use proptest::prelude::*;

    /// R₀ = 4 and E = 3² + 7: ratio 4; of two independent measurements the mean.
    #[test]
    fn by_hand() {
        let ratio = |l: &[f64], e: &[f64], s: &[f64]| {
            let m = e.len();
            let (n, mut e, mut s) = (l.len().isqrt(), e.to_vec(), s.to_vec());
            mean_ratio(Mat::square(l, n).unwrap(), &mut e, &mut MatMut::square(&mut s, m).unwrap())
        };
        assert_eq!(ratio(&[2.0], &[3.0], &[7.0]), Ok(4.0));
        assert_eq!(ratio(&[2.0, 0.0, 0.0, 1.0], &[3.0, 1.0], &[7.0, 0.0, 0.0, 1.0]), Ok(3.0));
        assert_eq!(ratio(&[], &[], &[]), Ok(1.0));
        assert_eq!(ratio(&[2.0], &[f64::NAN], &[7.0]), Err(LinalgError::NotFinite));
        assert_eq!(ratio(&[2.0], &[1.0, 2.0], &[7.0, 0.0, 0.0, 7.0]), Err(LinalgError::Shape));
        assert_eq!(blend(1.0, 0.5, 5.0, [1.0, 400.0]), 3.0);
        assert_eq!(blend(1.0, 0.5, 0.0, [1.0, 400.0]), 1.0);
        assert_eq!(blend(300.0f32, 0.5, 1e9, [1.0, 400.0]), 400.0);
        assert_eq!(blend(2.0, 0.5, f64::NAN, [1.0, 400.0]), 2.0);
        assert_eq!(blend(2.0, 0.5, f64::INFINITY, [1.0, 400.0]), 2.0);
    }

    proptest! {
        /// For E = R₀ the ratio is 1 whatever R₀, and R* is positive definite for any ratios.
        #[test]
        fn right_noise_has_the_ratio_one((m, r0) in spd::matrix(1..9usize), ratios in prop::collection::vec(0.01..400.0, 8)) {
            let mut l = vec![0.0; m * m];
            let mut view = MatMut::square(&mut l, m).unwrap();
            factor(Mat::square(&r0, m).unwrap(), &mut view).unwrap();
            let mut spread = r0.clone();
            let ratio = mean_ratio(view.as_ref(), &mut vec![0.0; m], &mut MatMut::square(&mut spread, m).unwrap()).unwrap();
            prop_assert!((ratio - 1.0).abs() < 1e-6, "{}", ratio);
            let mut r = vec![0.0; m * m];
            let mut r = MatMut::square(&mut r, m).unwrap();
            scale(&mut r, Mat::square(&r0, m).unwrap(), &ratios[..m]).unwrap();
            for i in 0..m {
                prop_assert!((r.at(i, i) / (ratios[i] * r0[i * m + i]) - 1.0).abs() < 1e-14);
            }
            prop_assert!(cholesky::factor(&mut r).is_ok());
        }
    }
}
