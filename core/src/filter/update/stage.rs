//! Several groups of measurement rows, one after another, on the lower triangle of one covariance.
//!
//! A stage collects the correction of the mean in the scalar T; the mean itself may be of higher precision and belongs to
//! the caller. The innovations given are those before the stage: what the correction has since explained is taken off
//! here. The strict upper triangle of P is neither read nor written, see [`crate::linalg::symmetric`]. After an error, P
//! and the correction are spoilt.

use core::ops::Range;

use super::{Form, Gauge, Rows, UpdateError, joseph, not_positive_definite, sequential};
use crate::linalg::{MatMut, axpy, block, cholesky, dot, scale, square_root, symmetric};
use crate::real::Real;

/// Rows of [`Work::vectors`].
pub const VECTORS: usize = 4;

/// Memory of a [`Stage`] for n states.
#[derive(Debug)]
pub struct Work<'a, T> {
    /// At least as many rows of n as there are correlated measurements at a time.
    pub rows: MatMut<'a, T>,
    /// [`VECTORS`] rows of n.
    pub vectors: MatMut<'a, T>,
}

/// An update in progress.
#[derive(Debug)]
pub struct Stage<'a, T> {
    pub(super) form: Form,
    pub(super) correction: &'a mut [T],
    /// The covariance; for [`Form::Array`] its Cholesky factor.
    pub(super) p: MatMut<'a, T>,
    pub(super) work: Work<'a, T>,
    pub(super) gauge: Gauge<T>,
}

/// Writes a row out.
fn expand<T: Real>(rows: &impl Rows<T>, row: usize, dense: &mut [T]) {
    dense.fill(T::ZERO);
    rows.for_each(row, &mut |state, coefficient| {
        if let Some(entry) = dense.get_mut(state) {
            *entry += coefficient;
        }
    });
}

impl<'a, T: Real> Stage<'a, T> {
    /// Starts on the lower triangle of `p`, n × n. `correction` (n) is added to, not cleared.
    pub fn begin(
        form: Form,
        correction: &'a mut [T],
        mut p: MatMut<'a, T>,
        work: Work<'a, T>,
    ) -> Result<Self, UpdateError> {
        let n = correction.len();
        if [p.rows(), p.cols(), work.rows.cols(), work.vectors.cols()] != [n; 4] || work.vectors.rows() < VECTORS {
            return Err(UpdateError::Shape);
        }
        if form == Form::Array {
            cholesky::factor(&mut p).map_err(not_positive_definite)?;
        }
        let gauge = Gauge { rows: 0, normalized_innovation_squared: T::ZERO, log_determinant: 0.0 };
        Ok(Self { form, correction, p, work, gauge })
    }

    /// Takes `range` of `rows`, whose noises are independent.
    pub fn independent(
        &mut self,
        rows: &impl Rows<T>,
        range: Range<usize>,
        innovation: impl Fn(usize) -> T,
        variance: impl Fn(usize) -> T,
    ) -> Result<(), UpdateError> {
        if self.form == Form::Sequential {
            return sequential::independent(self, rows, range, innovation, variance);
        }
        for row in range {
            let (h, vectors) = split_first(&mut self.work.vectors)?;
            expand(rows, row, h);
            scalar(
                self.form,
                self.correction,
                &mut self.p,
                h,
                vectors,
                innovation(row),
                variance(row),
                &mut self.gauge,
            )
            .map_err(|error| at_row(error, row))?;
        }
        Ok(())
    }

    /// Takes the rows from `first` on, as many as there are `innovation`s (m), with the noise covariance in the lower
    /// triangle of `noise` (m × m). Both are spoilt.
    pub fn correlated(
        &mut self,
        rows: &impl Rows<T>,
        first: usize,
        innovation: &mut [T],
        noise: &mut MatMut<'_, T>,
    ) -> Result<(), UpdateError> {
        let (m, n) = (innovation.len(), self.correction.len());
        if [noise.rows(), noise.cols()] != [m; 2] || self.work.rows.rows() < m {
            return Err(UpdateError::Shape);
        }
        if self.form == Form::Sequential {
            return sequential::correlated(self, rows, first, innovation, noise);
        }
        let mut whitened = self.work.rows.block_mut(0, 0, m, n)?;
        for i in 0..m {
            expand(rows, first + i, whitened.row_mut(i));
        }
        block::whiten(&mut whitened, innovation, noise)?;
        self.gauge.log_determinant += cholesky::log_determinant(noise.as_ref());
        for (i, &innovation) in innovation.iter().enumerate() {
            let (_, vectors) = split_first(&mut self.work.vectors)?;
            let h = self.work.rows.row(i);
            scalar(self.form, self.correction, &mut self.p, h, vectors, innovation, T::ONE, &mut self.gauge)
                .map_err(|error| at_row(error, first + i))?;
        }
        Ok(())
    }

    /// How the innovations of the rows taken so far compare with their predicted covariance.
    pub fn gauge(&self) -> Gauge<T> {
        self.gauge
    }

    /// Ends the stage: P is a covariance again.
    pub fn finish(mut self) -> Result<Gauge<T>, UpdateError> {
        if self.form == Form::Array {
            symmetric::square(&mut self.p);
        }
        symmetric::check_diagonal(self.p.as_ref()).map_err(not_positive_definite)?;
        if !(self.correction.iter().all(|c| c.is_finite()) && self.gauge.normalized_innovation_squared.is_finite()) {
            return Err(UpdateError::NotFinite);
        }
        Ok(self.gauge)
    }
}

/// Names the row of an innovation variance that is not positive.
fn at_row(error: UpdateError, row: usize) -> UpdateError {
    match error {
        UpdateError::IndefiniteNoise { .. } => UpdateError::IndefiniteNoise { row },
        other => other,
    }
}

/// The first of the vectors, and the other three.
fn split_first<'v, T: Real>(vectors: &'v mut MatMut<'_, T>) -> Result<(&'v mut [T], [&'v mut [T]; 3]), UpdateError> {
    vectors.rows_mut::<VECTORS>().map(|[h, rest @ ..]| (h, rest)).ok_or(UpdateError::Shape)
}

/// One row of Joseph's or the array form.
fn scalar<T: Real>(
    form: Form,
    correction: &mut [T],
    p: &mut MatMut<'_, T>,
    h: &[T],
    [gain, first, second]: [&mut [T]; 3],
    innovation: T,
    variance: T,
    gauge: &mut Gauge<T>,
) -> Result<(), UpdateError> {
    let innovation = innovation - dot(h, correction);
    let s = match form {
        Form::Array => square_root::update(p, h, variance, gain, first, second),
        _ => joseph::update(p, h, variance, gain, first, second),
    };
    // Finite rows and noises whose s is not positive and finite: P is not a covariance.
    let s = s.map_err(|_| UpdateError::IndefiniteNoise { row: 0 })?;
    if form == Form::Array {
        scale(gain, T::ONE / s.sqrt());
    }
    axpy(correction, innovation, gain);
    gauge.rows += 1;
    gauge.normalized_innovation_squared += innovation * innovation / s;
    gauge.log_determinant += libm::log(s.to_f64());
    Ok(())
}
