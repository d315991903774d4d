//! The scalar of filter algebra: `f32` or `f64`, with the few functions the kernels need, all from `libm` so that
//! every machine computes the same bits.
//!
//! Geometry, orbits and residuals are always `f64`: at 2.2e7 m an `f32` has steps of 2 m.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A floating-point scalar.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialEq
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Difference between 1 and the next larger number.
    const EPSILON: Self;

    /// The nearest value to `x`.
    fn from_f64(x: f64) -> Self;
    /// This value as `f64` (exact).
    fn to_f64(self) -> f64;
    /// Square root; NaN below zero.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Nearest whole number, ties away from zero.
    fn round(self) -> Self;
    /// Whether neither infinite nor NaN.
    fn is_finite(self) -> bool;
}

macro_rules! real {
    ($scalar:ty, $sqrt:path, $fabs:path, $round:path) => {
        impl Real for $scalar {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: Self = <$scalar>::EPSILON;

            fn from_f64(x: f64) -> Self {
                x as $scalar
            }
            fn to_f64(self) -> f64 {
                self as f64
            }
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            fn abs(self) -> Self {
                $fabs(self)
            }
            fn round(self) -> Self {
                $round(self)
            }
            fn is_finite(self) -> bool {
                <$scalar>::is_finite(self)
            }
        }
    };
}

real!(f32, libm::sqrtf, libm::fabsf, libm::roundf);
real!(f64, libm::sqrt, libm::fabs, libm::round);
