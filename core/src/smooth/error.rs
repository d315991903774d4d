//! What a step of a smoother can refuse. No cost but its two words; nothing panics.

use core::fmt;

use crate::linalg::LinalgError;

/// Why a step was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SmoothError {
    /// Lengths or dimensions do not fit together.
    Shape,
    /// The predicted covariance, or the shape of a noise, is not positive definite.
    NotPositiveDefinite {
        /// State where that showed, from 0.
        state: usize,
    },
    /// A number is NaN or infinite.
    NotFinite,
}

impl From<LinalgError> for SmoothError {
    fn from(error: LinalgError) -> Self {
        match error {
            LinalgError::Shape => Self::Shape,
            LinalgError::NotPositiveDefinite { pivot } | LinalgError::Singular { pivot } => {
                Self::NotPositiveDefinite { state: pivot }
            }
            LinalgError::NotFinite => Self::NotFinite,
        }
    }
}

impl fmt::Display for SmoothError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape => f.write_str("dimensions do not fit together"),
            Self::NotPositiveDefinite { state } => write!(f, "covariance is not positive definite at state {state}"),
            Self::NotFinite => f.write_str("a number is not finite"),
        }
    }
}

impl core::error::Error for SmoothError {}
