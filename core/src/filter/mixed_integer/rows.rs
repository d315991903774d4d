//! The rows of a model as the updates want them, and its innovations.

use core::ops::Range;

use super::super::update::{Rows, UpdateError};
use super::FilterError;
use crate::linalg::Mat;
use crate::model::partially_linear::{PartiallyLinear, Shape};
use crate::real::Real;

/// J = [∂g/∂u, L, G] row by row.
pub(super) struct ModelRows<'a, T, M: ?Sized> {
    pub model: &'a M,
    /// The statistical Jacobian of the correlated rows, c × d.
    pub slope: Mat<'a, T>,
    /// Where u is.
    pub nonlinear: Range<usize>,
    /// States of the density at hand; coefficients of others are left out.
    pub states: usize,
}

impl<T: Real, M: PartiallyLinear + ?Sized> Rows<T> for ModelRows<'_, T, M> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, T)) {
        for (state, &slope) in self.nonlinear.clone().zip(self.slope.row(row)) {
            entry(state, slope);
        }
        self.model.linear_row(row, &mut |state, coefficient| {
            if state < self.states {
                entry(state, T::from_f64(coefficient));
            }
        });
    }
}

/// y − ŷ of a row, with the nonlinear part of the prediction and the value of each linear state.
pub(super) fn innovation(
    model: &(impl PartiallyLinear + ?Sized),
    row: usize,
    y: f64,
    nonlinear: f64,
    value: impl Fn(usize) -> f64,
) -> f64 {
    let mut innovation = y - nonlinear;
    model.linear_row(row, &mut |state, coefficient| innovation -= coefficient * value(state));
    innovation
}

/// Checks that all rows of a model keep to its own shape, depend on something and have a noise.
pub(super) fn check(model: &(impl PartiallyLinear + ?Sized), shape: &Shape) -> Result<(), FilterError> {
    let u = model.nonlinear();
    for row in 0..shape.rows() {
        let with_ambiguities = (shape.unambiguous..shape.correlated).contains(&row);
        let end = if with_ambiguities { shape.states() } else { shape.real };
        let (mut fits, mut finite, mut empty) = (true, true, row >= shape.correlated || u.is_empty());
        model.linear_row(row, &mut |state, coefficient| {
            fits &= state < end && !u.contains(&state);
            finite &= coefficient.is_finite();
            empty &= coefficient == 0.0;
        });
        let variance = if row < shape.correlated { model.noise(row, row) } else { model.variance(row) };
        if !(variance > 0.0 && variance.is_finite()) {
            return Err(UpdateError::IndefiniteNoise { row }.into());
        }
        match (fits, finite, empty) {
            (false, ..) => return Err(FilterError::Shape),
            (_, false, _) => return Err(FilterError::NotFinite),
            (_, _, true) => return Err(UpdateError::EmptyRow { row }.into()),
            _ => (),
        }
    }
    Ok(())
}
