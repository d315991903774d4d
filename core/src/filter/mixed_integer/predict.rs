//! Prediction of a density by a model that says its transition in elementary steps.

use super::super::density::Cut;
use super::FilterError;
use crate::linalg::symmetric;
use crate::model::partially_linear::{Elementary, PartiallyLinear};
use crate::real::Real;

impl<T: Real> Cut<'_, T> {
    /// m ← F m, P ← F P Fᵀ + W. Only the first `real` states may move.
    pub(super) fn predict(&mut self, model: &(impl PartiallyLinear + ?Sized), real: usize) -> Result<(), FilterError> {
        let mut fits = true;
        model.transition(&mut |step| match step {
            Elementary::Shear { to, from, factor } if to < real && from < real && to != from => {
                if let Ok([to, from]) = self.mean.get_disjoint_mut([to, from]) {
                    *to += factor * *from;
                }
                symmetric::shear(&mut self.p, to, from, T::from_f64(factor));
            }
            Elementary::Scale { state, factor } if state < real => {
                if let Some(mean) = self.mean.get_mut(state) {
                    *mean *= factor;
                }
                symmetric::scale_state(&mut self.p, state, T::from_f64(factor));
            }
            _ => fits = false,
        });
        model.process_noise(&mut |i, j, value| {
            fits &= i < real && j <= i;
            if i < real && j <= i {
                self.p.add(i, j, T::from_f64(value));
            }
        });
        if fits { Ok(()) } else { Err(FilterError::Shape) }
    }
}
