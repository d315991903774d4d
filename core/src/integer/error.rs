//! What integer estimation can refuse.

use core::fmt;

use crate::linalg::LinalgError;

/// Why no integers were estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegerError {
    /// Lengths, dimensions or indices do not fit together, or there is no ambiguity at all.
    Shape,
    /// More ambiguities than the workspace holds.
    Capacity,
    /// An ambiguity or a covariance is NaN or infinite.
    NotFinite,
    /// The covariance differs from its transpose by more than rounding, in row `row`.
    Asymmetric {
        /// Row of the first difference, from 0.
        row: usize,
    },
    /// The covariance is not positive definite to working precision.
    NotPositiveDefinite {
        /// Row of the offending pivot, from 0.
        pivot: usize,
    },
    /// Ambiguities or the transform outgrew the integers that can be represented exactly.
    Overflow,
}

impl fmt::Display for IntegerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape => f.write_str("dimensions do not fit together"),
            Self::Capacity => f.write_str("more ambiguities than the workspace holds"),
            Self::NotFinite => f.write_str("an ambiguity or covariance is not finite"),
            Self::Asymmetric { row } => write!(f, "covariance is not symmetric in row {row}"),
            Self::NotPositiveDefinite { pivot } => write!(f, "covariance is not positive definite at row {pivot}"),
            Self::Overflow => f.write_str("ambiguities or their transform are too large for exact integers"),
        }
    }
}

impl core::error::Error for IntegerError {}

impl From<LinalgError> for IntegerError {
    fn from(error: LinalgError) -> Self {
        match error {
            LinalgError::Shape => Self::Shape,
            LinalgError::NotPositiveDefinite { pivot } | LinalgError::Singular { pivot } => {
                Self::NotPositiveDefinite { pivot }
            }
            LinalgError::NotFinite => Self::NotFinite,
        }
    }
}
