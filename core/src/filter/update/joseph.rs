//! Joseph's form by one scalar row, on the lower triangle.
//! ```text
//! v = P h,  s = hᵀ v + r,  k = v/s,   A = P − k vᵀ,   P ← A − (A h) kᵀ + r k kᵀ
//! ```
//! A h, which is r k but for rounding, is computed from A itself, row by row before any of it is stored: this is what makes
//! the form stable (R. S. Bucy & P. D. Joseph, 1968; [`crate::linalg::sequential`] does the same on a full matrix).

use crate::linalg::{LinalgError, MatMut, axpy, dot, head_mut, scale, symmetric};
use crate::real::Real;

/// Updates the lower triangle of `p` by the row `h` with noise `variance`; returns s, and k in `gain`. `row` and `offset`
/// are workspace. On an error `p` is unchanged.
pub(super) fn update<T: Real>(
    p: &mut MatMut<'_, T>,
    h: &[T],
    variance: T,
    gain: &mut [T],
    row: &mut [T],
    offset: &mut [T],
) -> Result<T, LinalgError> {
    gain.fill(T::ZERO);
    for (i, &h) in h.iter().enumerate().filter(|(_, h)| **h != T::ZERO) {
        symmetric::add_row(p.as_ref(), i, h, gain);
    }
    let s = dot(h, gain) + variance;
    if !(s > T::ZERO && s.is_finite() && variance >= T::ZERO) {
        return Err(LinalgError::NotFinite);
    }
    for ((i, offset), &v) in offset.iter_mut().enumerate().zip(&*gain) {
        let k = v / s;
        symmetric::copy_row(p.as_ref(), i, row);
        axpy(row, -k, gain);
        *offset = (variance * k - dot(h, row)) / s;
    }
    for (((i, p), &offset), &v) in p.iter_mut().enumerate().zip(&*offset).zip(&*gain) {
        let k = v / s;
        for (p, &v) in head_mut(p, i + 1).iter_mut().zip(&*gain) {
            *p = *p - k * v + offset * v;
        }
    }
    scale(gain, T::ONE / s);
    Ok(s)
}
