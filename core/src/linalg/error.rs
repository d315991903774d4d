//! What a kernel can refuse.

use core::fmt;

/// Why a kernel of this room refused its arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinalgError {
    /// Lengths, dimensions or indices do not fit together.
    Shape,
    /// The matrix is not positive definite to working precision; `pivot` is the row where that showed.
    NotPositiveDefinite {
        /// Row of the offending pivot, from 0.
        pivot: usize,
    },
    /// A triangular matrix has a zero or non-finite diagonal entry.
    Singular {
        /// Row of the offending pivot, from 0.
        pivot: usize,
    },
    /// An input is NaN or infinite, or a result would be.
    NotFinite,
}

impl fmt::Display for LinalgError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape => f.write_str("dimensions do not fit together"),
            Self::NotPositiveDefinite { pivot } => write!(f, "matrix is not positive definite at row {pivot}"),
            Self::Singular { pivot } => write!(f, "triangular matrix is singular at row {pivot}"),
            Self::NotFinite => f.write_str("a number is not finite"),
        }
    }
}

impl core::error::Error for LinalgError {}
