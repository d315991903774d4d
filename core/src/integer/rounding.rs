//! Rounding each ambiguity by itself.
//!
//! The simplest integer estimator, and the poorest: correlations are not used, so that it only serves after
//! [`super::decorrelate`], or where Q is nearly diagonal. P. J. G. Teunissen, J. Geodesy 72 (1998) 606–612; its success
//! rate is bounded by [`super::success_rate::rounding_lower`] and [`super::success_rate::rounding_upper`].

use super::IntegerError;
use super::decorrelate::to_integer;
use crate::real::Real;

/// ž_i = rint(â_i), ties away from zero. On an error `fixed` is unchanged.
pub fn round<T: Real>(a: &[T], fixed: &mut [i64]) -> Result<(), IntegerError> {
    if a.len() != fixed.len() {
        return Err(IntegerError::Shape);
    }
    a.iter().try_for_each(|a| to_integer(a.round()).map(|_| ()))?;
    for (fixed, a) in fixed.iter_mut().zip(a) {
        *fixed = to_integer(a.round())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let mut fixed = [0; 4];
        round(&[0.49, -0.5, 2.5, -7.6], &mut fixed).unwrap();
        assert_eq!(fixed, [0, -1, 3, -8]);
        assert_eq!(round(&[1.0f32], &mut fixed), Err(IntegerError::Shape));
        for bad in [f64::NAN, f64::INFINITY, -1e300] {
            assert_eq!(round(&[1.0, 2.0, 3.0, bad], &mut fixed), Err(IntegerError::Overflow));
        }
        assert_eq!(fixed, [0, -1, 3, -8]);
    }
}
