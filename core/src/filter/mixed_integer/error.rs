//! Why a mixed-integer filter refused.

use core::fmt;

use super::super::linearize::LinearizeError;
use super::super::update::UpdateError;
use crate::integer::IntegerError;
use crate::linalg::LinalgError;
use crate::linalg::symmetric::Defect;

/// Why an epoch or an initial density was refused. The filter is then as it was before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterError {
    /// The model does not fit the state, or itself, or a slice is of the wrong length.
    Shape,
    /// More states, ambiguities or correlated rows than the filter has room for.
    Capacity,
    /// A mean, a measurement or an option is NaN or infinite.
    NotFinite,
    /// There are no measurements.
    NoRows,
    /// An initial covariance is unfit.
    Covariance(Defect),
    /// A covariance is not positive definite.
    NotPositiveDefinite {
        /// State where that showed, from 0.
        state: usize,
    },
    /// An ambiguity reached [`super::MAX_AMBIGUITY`].
    Ambiguity {
        /// Which, from 0.
        index: usize,
    },
    /// The rows with ambiguities do not determine all of them, so that slips cannot be looked for.
    Undetermined {
        /// The first ambiguity that depends on others or has no row.
        index: usize,
    },
    /// Linearisation failed.
    Linearize(LinearizeError),
    /// A measurement update failed.
    Update(UpdateError),
    /// Integer estimation failed.
    Integer(IntegerError),
}

impl fmt::Display for FilterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape => f.write_str("model, state and measurement do not fit together"),
            Self::Capacity => f.write_str("the filter has no room for this model"),
            Self::NotFinite => f.write_str("a number is not finite"),
            Self::NoRows => f.write_str("there are no measurements"),
            Self::Covariance(defect) => write!(f, "the initial covariance is {defect}"),
            Self::NotPositiveDefinite { state } => {
                write!(f, "the covariance is not positive definite at state {state}")
            }
            Self::Ambiguity { index } => write!(f, "ambiguity {index} is too large"),
            Self::Undetermined { index } => write!(f, "the measurements do not determine ambiguity {index}"),
            Self::Linearize(error) => write!(f, "linearisation: {error}"),
            Self::Update(error) => write!(f, "update: {error}"),
            Self::Integer(error) => write!(f, "integers: {error}"),
        }
    }
}

impl core::error::Error for FilterError {}

impl From<LinalgError> for FilterError {
    fn from(error: LinalgError) -> Self {
        match error {
            LinalgError::Shape => Self::Shape,
            LinalgError::NotPositiveDefinite { pivot } => Self::NotPositiveDefinite { state: pivot },
            LinalgError::Singular { pivot } => Self::Undetermined { index: pivot },
            LinalgError::NotFinite => Self::NotFinite,
        }
    }
}

impl From<LinearizeError> for FilterError {
    fn from(error: LinearizeError) -> Self {
        Self::Linearize(error)
    }
}

impl From<UpdateError> for FilterError {
    fn from(error: UpdateError) -> Self {
        Self::Update(error)
    }
}

impl From<IntegerError> for FilterError {
    fn from(error: IntegerError) -> Self {
        Self::Integer(error)
    }
}
