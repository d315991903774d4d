//! The plain form: m rows at once,
//! ```text
//! V = J P,  S = V Jᵀ + R = L Lᵀ,  W = L⁻¹ V,  z = L⁻¹ ν,   correction += Wᵀ z,   P ← P − Wᵀ W
//! ```
//! which is m scalar updates with the rows of P touched once: L_ii² are their innovation variances. Independent rows go
//! four at a time, so that a row with one coefficient costs n²/2 multiply-adds and a quarter of the loads.

use core::ops::Range;

use super::stage::{Stage, VECTORS, product};
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
        project(stage.p.as_ref(), rows, first, &mut v, &mut s);
        remove(stage.correction, rows, first, z);
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
    project(stage.p.as_ref(), rows, first, &mut v, noise);
    remove(stage.correction, rows, first, innovation);
    apply(stage.correction, &mut stage.p, &mut v, noise, innovation).map_err(|error| at(error, first))?;
    gauge(stage, m, z_squared(innovation), cholesky::log_determinant(noise.as_ref()));
    Ok(())
}

/// `v` ← J P, and `s` += J P Jᵀ in its lower triangle, for the rows from `first` on.
pub(crate) fn project<T: Real>(
    p: Mat<'_, T>,
    rows: &impl Rows<T>,
    first: usize,
    v: &mut MatMut<'_, T>,
    s: &mut MatMut<'_, T>,
) {
    for (i, row) in v.iter_mut().enumerate() {
        row.fill(T::ZERO);
        rows.for_each(first + i, &mut |state, coefficient| symmetric::add_row(p, state, coefficient, row));
    }
    for j in 0..v.rows() {
        // A few coefficients at a time, so that the loop over the rows of V is tight.
        let mut entries = [(0, T::ZERO); 8];
        let mut count = 0;
        rows.for_each(first + j, &mut |state, coefficient| {
            if count == entries.len() {
                add_products(&entries, v, s, j);
                count = 0;
            }
            if let Some(entry) = entries.get_mut(count) {
                *entry = (state, coefficient);
            }
            count += 1;
        });
        add_products(head(&entries, count), v, s, j);
    }
}

/// `s`_ij += Σ coefficient · `v`_i,state for i ≥ j.
fn add_products<T: Real>(entries: &[(usize, T)], v: &MatMut<'_, T>, s: &mut MatMut<'_, T>, j: usize) {
    for (s, v) in s.iter_mut().zip(v.iter()).skip(j) {
        if let Some(s) = s.get_mut(j) {
            for &(state, coefficient) in entries {
                if let Some(&v) = v.get(state) {
                    *s += coefficient * v;
                }
            }
        }
    }
}

/// Takes off the innovations what the correction so far explains.
pub(crate) fn remove<T: Real>(correction: &[T], rows: &impl Rows<T>, first: usize, innovation: &mut [T]) {
    for (i, innovation) in innovation.iter_mut().enumerate() {
        *innovation -= product(rows, first + i, correction);
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
