//! The plain form: m rows at once,
//! ```text
//! V = J P,  S = V Jᵀ + R = L Lᵀ,  W = L⁻¹ V,  z = L⁻¹ ν,   correction += Wᵀ z,   P ← P − Wᵀ W
//! ```
//! which is m scalar updates with the rows of P touched once: L_ii² are their innovation variances. Independent rows go
//! four at a time, so that a row with one coefficient costs n²/2 multiply-adds and a quarter of the loads of P.

use core::ops::Range;

use super::stage::{Stage, VECTORS};
use super::{Rows, UpdateError};
use crate::linalg::{LinalgError, Mat, MatMut, axpy, cholesky, dot, head, head_mut, symmetric, triangular};
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

/// Correlated rows in two groups, y₁ and y₂: with B = R₂₁ R₁₁⁻¹ the noise of
/// ```text
/// y₂ − B y₁,   of rows J₂ − B J₁ and covariance R₂₂ − B R₂₁ᵀ,
/// ```
/// is independent of that of y₁.
pub(super) fn correlated_in_two<T: Real>(
    stage: &mut Stage<'_, T>,
    rows: &impl Rows<T>,
    first: usize,
    split: usize,
    innovation: &mut [T],
    noise: &mut MatMut<'_, T>,
) -> Result<(), UpdateError> {
    let (m, n) = (innovation.len(), stage.correction.len());
    let (second, others) = (first + split, m.saturating_sub(split));
    let is_coupled = separate(noise, split).map_err(|error| at(error.into(), first))?;
    let (z1, z2) = innovation.split_at_mut_checked(split).ok_or(UpdateError::Shape)?;
    if is_coupled {
        remove_coupled(z1, z2, noise);
    }
    correlated(stage, rows, first, z1, &mut noise.block_mut(0, 0, split, split)?)?;

    let Stage { correction, p, work, .. } = stage;
    let mut v = work.rows.block_mut(0, 0, m, n)?;
    let (mut v1, mut v2) = v.split_at(split);
    let mut s = noise.block_mut(split, split, others, others)?;
    project(p.as_ref(), rows, second, &mut v2, &mut s, explain(z2, correction));
    if is_coupled {
        z1.fill(T::ZERO);
        let mut unused = noise.block_mut(0, 0, split, split)?;
        project(p.as_ref(), rows, first, &mut v1, &mut unused, explain(z1, correction));
        remove_coupled(z1, z2, noise);
        couple(rows, first, v1.as_ref(), &mut v2, noise, z1);
    }
    let mut s = noise.block_mut(split, split, others, others)?;
    apply(correction, p, &mut v2, &mut s, z2).map_err(|error| at(error, second))?;
    gauge(stage, others, z_squared(z2), cholesky::log_determinant(s.as_ref()));
    Ok(())
}

/// From the lower triangle of a noise covariance: B and R₂₂ − B R₂₁ᵀ in place of its last rows. Returns whether B
/// matters: where R₂₁ is below the rounding of R₁₁ and R₂₂ it does not, and nothing is changed.
fn separate<T: Real>(noise: &mut MatMut<'_, T>, split: usize) -> Result<bool, LinalgError> {
    let is_rounding = |i: usize, j: usize| {
        let covariance = noise.at(i, j);
        covariance * covariance <= T::EPSILON * T::EPSILON * noise.at(i, i) * noise.at(j, j)
    };
    if (split..noise.rows()).all(|i| (0..split).all(|j| is_rounding(i, j))) {
        return Ok(false);
    }
    let (mut above, mut below) = noise.split_at(split);
    let mut r11 = above.block_mut(0, 0, split, split)?;
    cholesky::factor(&mut r11)?;
    for i in 0..below.rows() {
        let (earlier, row) = below.split_row(i);
        let (b, s) = row.split_at_mut_checked(split).ok_or(LinalgError::Shape)?;
        triangular::forward(r11.as_ref(), b)?;
        for (s, earlier) in s.iter_mut().zip(earlier.iter()) {
            *s -= dot(earlier, b);
        }
        if let Some(s) = s.get_mut(i) {
            *s -= dot(b, b);
        }
    }
    for row in below.iter_mut() {
        triangular::back_transposed(r11.as_ref(), head_mut(row, split))?;
    }
    symmetric::square(&mut r11);
    Ok(true)
}

/// ν₂ −= B ν₁.
fn remove_coupled<T: Real>(z1: &[T], z2: &mut [T], noise: &MatMut<'_, T>) {
    for (z2, b) in z2.iter_mut().zip(noise.iter().skip(z1.len())) {
        *z2 -= dot(b, z1);
    }
}

/// From V₁ = J₁ P, V₂ = J₂ P and S = J₂ P J₂ᵀ + R to V₂ and S of J₂ − B J₁. With E = (V₂ − B V₁/2) J₁ᵀ the latter is
/// S − E Bᵀ − B Eᵀ. `e` has a number for each row of V₁.
fn couple<T: Real>(
    rows: &impl Rows<T>,
    first: usize,
    v1: Mat<'_, T>,
    v2: &mut MatMut<'_, T>,
    noise: &mut MatMut<'_, T>,
    e: &mut [T],
) {
    let (split, others) = (v1.rows(), v2.rows());
    let half = T::from_f64(0.5);
    for (i, v2) in v2.iter_mut().enumerate() {
        let take_half = |v2: &mut [T], b: &[T]| b.iter().zip(v1.iter()).for_each(|(&b, v1)| axpy(v2, -half * b, v1));
        take_half(v2, noise.row(split + i));
        for (j, e) in e.iter_mut().enumerate() {
            *e = T::ZERO;
            rows.for_each(first + j, &mut |state, coefficient| {
                *e += coefficient * v2.get(state).copied().unwrap_or_default();
            });
        }
        take_half(v2, noise.row(split + i));
        for k in 0..others {
            let term = dot(noise.row(split + k), e);
            noise.add(split + i.max(k), split + i.min(k), if i == k { -(term + term) } else { -term });
        }
    }
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
