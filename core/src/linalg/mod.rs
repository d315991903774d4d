//! In-place kernels on slices: factorisations, triangular solves and measurement updates.
//!
//! Matrices are row-major views [`Mat`] and [`MatMut`] with a leading dimension `ld`, so that a logical n × n matrix
//! lives in the corner of a buffer of any capacity. Symmetric matrices are stored full, both triangles; kernels read
//! what their documentation says and write both, so that symmetry is exact by construction. Inner loops run over
//! contiguous rows.
//!
//! | module | holds |
//! |---|---|
//! | [`view`] | matrix views |
//! | [`cholesky`] | A = L Lᵀ and its solves |
//! | [`ldl`] | A = L D Lᵀ, and Q = Lᵀ D L as integer estimation wants it |
//! | [`eigen`] | eigenvalues and eigenvectors of a symmetric matrix |
//! | [`triangular`] | forward and back substitution, inverse |
//! | [`sequential`] | Kalman update by one scalar measurement, plain and Joseph |
//! | [`block`] | Kalman update by several correlated measurements, whitening |
//! | [`symmetric`] | congruences and updates of the lower triangle alone |
//! | [`square_root`] | Kalman update of a Cholesky factor by rotations |
//! | [`tiles`] | dense products, factors and solves of larger matrices |
//! | [`projection`] | least squares by orthogonal columns |
//!
//! Nothing here allocates or panics. Shapes are checked once on entry; where a function fails on its numbers, its
//! documentation says what state the arguments are left in. Behind the check there is no index that could fail: rows
//! are walked by iterators or cut by `head`, `tail` and `around`, so that the compiler leaves no panic behind.

pub mod block;
pub mod cholesky;
pub mod eigen;
mod error;
pub mod ldl;
pub mod projection;
pub mod sequential;
#[cfg(test)]
pub(crate) mod spd;
pub mod square_root;
pub mod symmetric;
pub mod tiles;
pub mod triangular;
pub mod view;

pub use error::LinalgError;
pub use view::{Mat, MatMut};

use crate::real::Real;

/// The first `n` of `x`, or all where there are fewer.
pub(crate) fn head<T>(x: &[T], n: usize) -> &[T] {
    x.get(..n).unwrap_or(x)
}

/// What of `x` comes at `start` and later, nothing where there are fewer.
pub(crate) fn tail<T>(x: &[T], start: usize) -> &[T] {
    x.get(start..).unwrap_or(&[])
}

/// As [`head`], to write.
pub(crate) fn head_mut<T>(x: &mut [T], n: usize) -> &mut [T] {
    let n = n.min(x.len());
    x.split_at_mut_checked(n).map_or(&mut [], |(head, _)| head)
}

/// As [`tail`], to write.
pub(crate) fn tail_mut<T>(x: &mut [T], start: usize) -> &mut [T] {
    x.get_mut(start..).unwrap_or(&mut [])
}

/// to ← from, as far as both go.
pub(crate) fn copy<T: Copy>(to: &mut [T], from: &[T]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to = from;
    }
}

/// Entry `i` of `x`.
pub(crate) fn at<T>(x: &[T], i: usize) -> Result<&T, LinalgError> {
    x.get(i).ok_or(LinalgError::Shape)
}

/// As [`at`], to write.
pub(crate) fn at_mut<T>(x: &mut [T], i: usize) -> Result<&mut T, LinalgError> {
    x.get_mut(i).ok_or(LinalgError::Shape)
}

/// What is before, at and after index `i` of `x`.
pub(crate) fn around<T>(x: &[T], i: usize) -> Result<(&[T], &T, &[T]), LinalgError> {
    match x.split_at_checked(i) {
        Some((before, [at, after @ ..])) => Ok((before, at, after)),
        _ => Err(LinalgError::Shape),
    }
}

/// As [`around`], to write.
pub(crate) fn around_mut<T>(x: &mut [T], i: usize) -> Result<(&mut [T], &mut T, &mut [T]), LinalgError> {
    match x.split_at_mut_checked(i) {
        Some((before, [at, after @ ..])) => Ok((before, at, after)),
        _ => Err(LinalgError::Shape),
    }
}

/// Σ aᵢ bᵢ over the shorter of the two. Four sums run side by side, in the same order on every machine: a processor
/// can overlap them, and results stay the same bit for bit.
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let n = a.len().min(b.len());
    let (a4, a_rest) = a[..n].as_chunks::<4>();
    let (b4, b_rest) = b[..n].as_chunks::<4>();
    let mut sums = [T::ZERO; 4];
    for (a, b) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    let rest = a_rest.iter().zip(b_rest).fold(T::ZERO, |sum, (&a, &b)| sum + a * b);
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// y ← y + s x over the shorter of the two.
pub(crate) fn axpy<T: Real>(y: &mut [T], s: T, x: &[T]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}

/// y ← y − a₀ x₀ − a₁ x₁ − a₂ x₂ − a₃ x₃, in this order, over the shortest of them: as four [`axpy`], to the last bit, with
/// a quarter of the loads and stores of y. Not inlined, because only then does the compiler know that y is apart from the
/// others, and vectorises.
#[inline(never)]
pub(crate) fn subtract_four<T: Real>(y: &mut [T], [a0, a1, a2, a3]: [T; 4], [x0, x1, x2, x3]: [&[T]; 4]) {
    for ((((y, &x0), &x1), &x2), &x3) in y.iter_mut().zip(x0).zip(x1).zip(x2).zip(x3) {
        *y = *y - a0 * x0 - a1 * x1 - a2 * x2 - a3 * x3;
    }
}

/// x ← s x.
pub(crate) fn scale<T: Real>(x: &mut [T], s: T) {
    for x in x {
        *x *= s;
    }
}
