//! The plain form: m rows at once,
//! ```text
//! V = J P,  S = V Jᵀ + R = L Lᵀ,  W = L⁻¹ V,  z = L⁻¹ ν,   correction += Wᵀ z,   P ← P − Wᵀ W
//! ```
//! which is m scalar updates with the rows of P touched once: L_ii² are their innovation variances. Independent rows go
//! four at a time, so that a row with one coefficient costs n²/2 multiply-adds and a quarter of the loads of P.

use core::ops::Range;

use super::stage::{Stage, VECTORS};
use super::{Rows, UpdateError};
use crate::linalg::{Mat, MatMut, axpy, cholesky, head, head_mut, symmetric, triangular};
use crate::real::Real;

/// Independent rows, [`VECTORS`] at a time.
pub(super) fn independent<T: Real>(
    stage: &mut Stage<'_, T>,
    rows: &impl Rows<T>,
    range: Range<usize>,
    innovation: impl Fn(usize) -> T,
    variance: impl Fn(usize) -> T,
) -> Result<(), UpdateError> {
    let n = stage.correction.len();
    for first in range.clone().step_by(VECTORS) {
        let m = VECTORS.min(range.end.saturating_sub(first));
        let mut s = [T::ZERO; VECTORS * VECTORS];
        let mut s = MatMut::new(&mut s, m, m, VECTORS)?;
        let mut z = [T::ZERO; VECTORS];
        let z = head_mut(&mut z, m);
        for (i, z) in z.iter_mut().enumerate() {
            *z = innovation(first + i);
            s.set(i, i, variance(first + i));
        }
        let mut v = stage.work.vectors.block_mut(0, 0, m, n)?;
        project(stage.p.as_ref(), rows, first, &mut v, &mut s, explain(z, stage.correction));
        apply(stage.correction, &mut stage.p, &mut v, &mut s, z).map_err(|error| at(error, first))?;
        gauge(stage, m, z_squared(z), cholesky::log_determinant(s.as_ref()));
    }
    Ok(())
}

/// Correlated rows.
pub(super) fn correlated<T: Real>(
    stage: &mut Stage<'_, T>,
    rows: &impl Rows<T>,
    first: usize,
    innovation: &mut [T],
    noise: &mut MatMut<'_, T>,
) -> Result<(), UpdateError> {
    let (m, n) = (innovation.len(), stage.correction.len());
    let mut v = stage.work.rows.block_mut(0, 0, m, n)?;
    project(stage.p.as_ref(), rows, first, &mut v, noise, explain(innovation, stage.correction));
    apply(stage.correction, &mut stage.p, &mut v, noise, innovation).map_err(|error| at(error, first))?;
    gauge(stage, m, z_squared(innovation), cholesky::log_determinant(noise.as_ref()));
    Ok(())
}

/// Coefficients of a row that are kept, so that its model is asked once.
const KEPT: usize = 16;

/// `v` ← J P, and `s` += J P Jᵀ in its lower triangle, for the rows from `first` on. Calls `also` with each coefficient: row
/// counted from `first`, state, value.
pub(crate) fn project<T: Real>(
    p: Mat<'_, T>,
    rows: &impl Rows<T>,
    first: usize,
    v: &mut MatMut<'_, T>,
    s: &mut MatMut<'_, T>,
    mut also: impl FnMut(usize, usize, T),
) {
    for i in 0..v.rows() {
        let (above, v_i) = v.split_row(i);
        v_i.fill(T::ZERO);
        let mut kept = [(0, T::ZERO); KEPT];
        let mut count = 0;
        rows.for_each(first + i, &mut |state, coefficient| {
            symmetric::add_row(p, state, coefficient, v_i);
            also(i, state, coefficient);
            if let Some(slot) = kept.get_mut(count) {
                *slot = (state, coefficient);
            }
            count += 1;
        });
        let v_i = &*v_i;
        let mut add = |entries: &[(usize, T)]| {
            for (s, v) in s.row_mut(i).iter_mut().zip(above.iter().chain([v_i])) {
                for &(state, coefficient) in entries {
                    *s += coefficient * v.get(state).copied().unwrap_or_default();
                }
            }
        };
        if count <= KEPT {
            add(head(&kept, count));
        } else {
            rows.for_each(first + i, &mut |state, coefficient| add(&[(state, coefficient)]));
        }
    }
}

/// Takes off the innovations what the correction explains: what [`project`] calls with each coefficient.
pub(crate) fn explain<'a, T: Real>(
    innovation: &'a mut [T],
    correction: &'a [T],
) -> impl FnMut(usize, usize, T) + use<'a, T> {
    move |row, state, coefficient| {
        if let (Some(innovation), Some(&correction)) = (innovation.get_mut(row), correction.get(state)) {
            *innovation -= coefficient * correction;
        }
    }
}

/// From V, S and ν on; `v` returns W, `s` L and `z` L⁻¹ ν.
fn apply<T: Real>(
    correction: &mut [T],
    p: &mut MatMut<'_, T>,
    v: &mut MatMut<'_, T>,
    s: &mut MatMut<'_, T>,
    z: &mut [T],
) -> Result<(), UpdateError> {
    cholesky::factor(s)?;
    triangular::forward_rows(s.as_ref(), v)?;
    triangular::forward(s.as_ref(), z)?;
    symmetric::subtract_gram(p, v.as_ref());
    for (&z, w) in z.iter().zip(v.iter()) {
        axpy(correction, z, w);
    }
    Ok(())
}

fn z_squared<T: Real>(z: &[T]) -> T {
    z.iter().fold(T::ZERO, |sum, &z| sum + z * z)
}

fn gauge<T: Real>(stage: &mut Stage<'_, T>, rows: usize, squared: T, log_determinant: f64) {
    stage.gauge.rows += rows;
    stage.gauge.normalized_innovation_squared += squared;
    stage.gauge.log_determinant += log_determinant;
}

/// Numbers a row among all.
fn at(error: UpdateError, first: usize) -> UpdateError {
    match error {
        UpdateError::IndefiniteNoise { row } => UpdateError::IndefiniteNoise { row: first + row },
        other => other,
    }
}
