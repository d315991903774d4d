//! The measurement update, in three forms with one interface.
//!
//! Given the prior N(m, P), rows J, innovations ν and noise R, all forms compute
//! ```text
//! S = J P Jᵀ + R,   K = P Jᵀ S⁻¹,   m ← m + K ν,   P ← P − K S Kᵀ,   NIS = νᵀ S⁻¹ ν,   ln det S
//! ```
//! (B. D. O. Anderson & J. B. Moore, *Optimal Filtering*, 1979, sec. 6.1). After [`super::linearize`] J is the statistical
//! Jacobian and R includes Ω.
//!
//! | form | how | safe for a prior/noise ratio of | cost of m correlated rows |
//! |---|---|---|---|
//! | [`Form::Sequential`] | S = L Lᵀ, W = L⁻¹ J P, P − Wᵀ W; independent rows four at a time | 1e4 (100 m against 1 cm) in `f64` | m n²/2 + m² n/2 + sparse products |
//! | [`Form::Joseph`] | whitened, then (I − k h) P (I − k h)ᵀ + k kᵀ row by row | 1e6 | 3.5 m n² |
//! | [`Form::Array`] | whitened, then rotations of the Cholesky factor of P | any; P must be positive definite to working precision | 2.5 m n² + n³/2 |
//!
//! At a prior of 10 km against 2 cm the mean is wrong by 6e-3, 1e-4 and 1e-9 of its standard deviation, in this order.
//!
//! [`update`] is one call on a full covariance with one set of correlated rows. [`Stage`] is for those who have several
//! groups of rows, want sparse rows to stay sparse and keep the lower triangle alone.
//!
//! Panic contract: none. Errors leave mean and covariance unchanged ([`update`]).

pub mod information;
mod joseph;
mod sequential;
mod stage;

use core::fmt;

pub(crate) use sequential::{explain, project};
pub use stage::{Stage, VECTORS, Work};

use crate::linalg::symmetric::{self, Defect};
use crate::linalg::{LinalgError, Mat, MatMut, axpy, cholesky};
use crate::real::Real;

/// A form of the update, see the module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Form {
    /// P − Wᵀ W, rows sequentially by the Cholesky factor of their S. The cheapest.
    #[default]
    Sequential,
    /// Joseph's form, stable against rounding in K.
    Joseph,
    /// Square-root array by orthogonal rotations. The most accurate.
    Array,
}

/// How innovations of a group of rows compare with their predicted covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gauge<T> {
    /// Number of rows p.
    pub rows: usize,
    /// νᵀ S⁻¹ ν, χ² with p degrees of freedom if model and noise are right `[1]`.
    pub normalized_innovation_squared: T,
    /// ln det S.
    pub log_determinant: f64,
}

impl<T: Real> Gauge<T> {
    /// Joins that of further rows, given those before.
    pub fn add(&mut self, other: Self) {
        self.rows += other.rows;
        self.normalized_innovation_squared += other.normalized_innovation_squared;
        self.log_determinant += other.log_determinant;
    }
}

/// Measurement rows as few or as many coefficients.
pub trait Rows<T> {
    /// Calls `entry` with each state of `row` and its coefficient; a state may occur twice, the coefficients then add.
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, T));
}

impl<T: Real> Rows<T> for Mat<'_, T> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, T)) {
        for (state, &coefficient) in self.row(row).iter().enumerate().filter(|(_, c)| **c != T::ZERO) {
            entry(state, coefficient);
        }
    }
}

/// Why an update was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateError {
    /// Lengths do not fit together.
    Shape,
    /// There are no rows.
    NoRows,
    /// All coefficients of a row are zero.
    EmptyRow {
        /// Which, from 0.
        row: usize,
    },
    /// The covariance of the state is unfit.
    Covariance(Defect),
    /// The covariance of the state is not positive definite.
    NotPositiveDefinite {
        /// State where that showed, from 0.
        state: usize,
    },
    /// The noise covariance is unfit.
    Noise(Defect),
    /// The noise covariance, or that of the innovations, is not positive definite.
    IndefiniteNoise {
        /// Row where that showed, from 0.
        row: usize,
    },
    /// A coefficient, an innovation or a result is NaN or infinite.
    NotFinite,
}

impl fmt::Display for UpdateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape => f.write_str("dimensions do not fit together"),
            Self::NoRows => f.write_str("there are no measurements"),
            Self::EmptyRow { row } => write!(f, "measurement {row} depends on no state"),
            Self::Covariance(defect) => write!(f, "covariance of the state is {defect}"),
            Self::NotPositiveDefinite { state } => write!(f, "covariance is not positive definite at state {state}"),
            Self::Noise(defect) => write!(f, "noise covariance is {defect}"),
            Self::IndefiniteNoise { row } => write!(f, "noise is not positive definite at measurement {row}"),
            Self::NotFinite => f.write_str("a number is not finite"),
        }
    }
}

impl core::error::Error for UpdateError {}

impl From<LinalgError> for UpdateError {
    fn from(error: LinalgError) -> Self {
        match error {
            LinalgError::Shape => Self::Shape,
            LinalgError::NotPositiveDefinite { pivot } | LinalgError::Singular { pivot } => {
                Self::IndefiniteNoise { row: pivot }
            }
            LinalgError::NotFinite => Self::NotFinite,
        }
    }
}

/// Length of the buffer that [`update`] needs for m rows and n states.
pub const fn buffer_len(m: usize, n: usize) -> usize {
    (m + VECTORS + 2) * n
}

/// Updates `mean` (n) and the full symmetric `p` (n × n) by m correlated measurements.
///
/// `rows` are J, `innovation` (m) is y − ŷ, `noise` (m × m) is R + Ω; both are spoilt. `buffer` is workspace of
/// [`buffer_len`]. Everything is checked, at n³/6 multiply-adds; on an error `mean` and `p` are unchanged.
pub fn update<T: Real>(
    form: Form,
    mean: &mut [T],
    p: &mut MatMut<'_, T>,
    rows: &impl Rows<T>,
    innovation: &mut [T],
    noise: &mut MatMut<'_, T>,
    buffer: &mut [T],
) -> Result<Gauge<T>, UpdateError> {
    let (m, n) = (innovation.len(), mean.len());
    if [p.rows(), p.cols()] != [n; 2] || [noise.rows(), noise.cols()] != [m; 2] {
        return Err(UpdateError::Shape);
    }
    let (row_buffer, rest) = buffer.split_at_mut_checked(m * n).ok_or(UpdateError::Shape)?;
    let (vectors, rest) = rest.split_at_mut_checked(VECTORS * n).ok_or(UpdateError::Shape)?;
    let (correction, rest) = rest.split_at_mut_checked(n).ok_or(UpdateError::Shape)?;
    let diagonal = rest.get_mut(..n).ok_or(UpdateError::Shape)?;
    if m == 0 {
        return Err(UpdateError::NoRows);
    }
    symmetric::check(p.as_ref()).map_err(UpdateError::Covariance)?;
    symmetric::check(noise.as_ref()).map_err(UpdateError::Noise)?;
    check_rows(rows, m, n)?;
    if !(mean.iter().all(|m| m.is_finite()) && innovation.iter().all(|nu| nu.is_finite())) {
        return Err(UpdateError::NotFinite);
    }
    symmetric::keep_diagonal(p.as_ref(), diagonal);
    let definite = cholesky::factor(p);
    symmetric::restore(p, diagonal);
    definite.map_err(not_positive_definite)?;

    correction.fill(T::ZERO);
    let work = Work { rows: MatMut::new(row_buffer, m, n, n)?, vectors: MatMut::new(vectors, VECTORS, n, n)? };
    let outcome = Stage::begin(form, correction, p.reborrow(), work).and_then(|mut stage| {
        stage.correlated(rows, 0, innovation, noise)?;
        stage.finish()
    });
    match outcome {
        Ok(_) => {
            p.mirror_lower();
            axpy(mean, T::ONE, correction);
        }
        Err(_) => symmetric::restore(p, diagonal),
    }
    outcome
}

/// Checks that every row has a coefficient, and only finite ones, of states below n.
fn check_rows<T: Real>(rows: &impl Rows<T>, m: usize, n: usize) -> Result<(), UpdateError> {
    for row in 0..m {
        let (mut empty, mut finite, mut fits) = (true, true, true);
        rows.for_each(row, &mut |state, coefficient| {
            empty &= coefficient == T::ZERO;
            finite &= coefficient.is_finite();
            fits &= state < n;
        });
        match (fits, finite, empty) {
            (false, ..) => return Err(UpdateError::Shape),
            (_, false, _) => return Err(UpdateError::NotFinite),
            (_, _, true) => return Err(UpdateError::EmptyRow { row }),
            _ => (),
        }
    }
    Ok(())
}

/// A failed factorisation of P, rather than of a noise.
fn not_positive_definite(error: LinalgError) -> UpdateError {
    match error {
        LinalgError::NotPositiveDefinite { pivot } | LinalgError::Singular { pivot } => {
            UpdateError::NotPositiveDefinite { state: pivot }
        }
        other => other.into(),
    }
}

#[cfg(test)]
mod tests;
