//! Memory that lasts for one epoch.

use super::super::linearize::MAX_INPUTS;
use super::super::update;
use crate::linalg::{LinalgError, MatMut, head_mut};
use crate::real::Real;

/// For N states, A ambiguities and C correlated rows.
#[derive(Debug)]
pub(super) struct Scratch<T, const N: usize, const A: usize, const C: usize> {
    rows: [[T; N]; C],
    vectors: [[T; N]; update::VECTORS],
    noise: [[T; C]; C],
    noise_diagonal: [T; C],
    innovation: [T; C],
    residual: [T; C],
    slope: [[T; MAX_INPUTS]; C],
    prediction: [f64; C],
    values: [f64; C],
    reference: [f64; C],
    g: [[T; A]; C],
    factor: [[T; A]; A],
    estimate: [T; A],
    fraction: [T; A],
    flags: [bool; A],
    integers: [i64; A],
}

/// The same cut to a model of n states, d nonlinear ones, a ambiguities and c correlated rows.
pub(super) struct Bench<'a, T> {
    /// c rows of `stride`; samples of the linearisation.
    pub rows: &'a mut [T],
    /// A few more rows of `stride`.
    pub vectors: &'a mut [T],
    /// N.
    pub stride: usize,
    /// R + Ω, then S, then its factor.
    pub noise: MatMut<'a, T>,
    pub noise_diagonal: &'a mut [T],
    pub innovation: &'a mut [T],
    /// Innovations that the weighted detector may spoil.
    pub residual: &'a mut [T],
    /// ∂g/∂u, c × d.
    pub slope: MatMut<'a, T>,
    /// ḡ.
    pub prediction: &'a mut [f64],
    pub values: &'a mut [f64],
    pub reference: &'a mut [f64],
    /// G, c × a.
    pub g: MatMut<'a, T>,
    /// a × a.
    pub factor: MatMut<'a, T>,
    /// δn.
    pub estimate: &'a mut [T],
    /// n − rint(n).
    pub fraction: &'a mut [T],
    pub flags: &'a mut [bool],
    pub integers: &'a mut [i64],
}

impl<T: Real, const N: usize, const A: usize, const C: usize> Scratch<T, N, A, C> {
    pub const fn new() -> Self {
        Self {
            rows: [[T::ZERO; N]; C],
            vectors: [[T::ZERO; N]; update::VECTORS],
            noise: [[T::ZERO; C]; C],
            noise_diagonal: [T::ZERO; C],
            innovation: [T::ZERO; C],
            residual: [T::ZERO; C],
            slope: [[T::ZERO; MAX_INPUTS]; C],
            prediction: [0.0; C],
            values: [0.0; C],
            reference: [0.0; C],
            g: [[T::ZERO; A]; C],
            factor: [[T::ZERO; A]; A],
            estimate: [T::ZERO; A],
            fraction: [T::ZERO; A],
            flags: [false; A],
            integers: [0; A],
        }
    }

    /// Cuts it; all dimensions must be within capacity.
    pub fn bench(&mut self, d: usize, a: usize, c: usize) -> Result<Bench<'_, T>, LinalgError> {
        if d > MAX_INPUTS || a > A || c > C {
            return Err(LinalgError::Shape);
        }
        Ok(Bench {
            rows: self.rows.as_flattened_mut(),
            vectors: self.vectors.as_flattened_mut(),
            stride: N,
            noise: MatMut::new(self.noise.as_flattened_mut(), c, c, C)?,
            noise_diagonal: head_mut(&mut self.noise_diagonal, c),
            innovation: head_mut(&mut self.innovation, c),
            residual: head_mut(&mut self.residual, c),
            slope: MatMut::new(self.slope.as_flattened_mut(), c, d, MAX_INPUTS)?,
            prediction: head_mut(&mut self.prediction, c),
            values: head_mut(&mut self.values, c),
            reference: head_mut(&mut self.reference, c),
            g: MatMut::new(self.g.as_flattened_mut(), c, a, A)?,
            factor: MatMut::new(self.factor.as_flattened_mut(), a, a, A)?,
            estimate: head_mut(&mut self.estimate, a),
            fraction: head_mut(&mut self.fraction, a),
            flags: head_mut(&mut self.flags, a),
            integers: head_mut(&mut self.integers, a),
        })
    }
}

/// Memory for an update of n states by up to m correlated rows at a time, cut from that of a [`Bench`].
pub(super) fn work<'a, T: Real>(
    rows: &'a mut [T],
    vectors: &'a mut [T],
    stride: usize,
    m: usize,
    n: usize,
) -> Result<update::Work<'a, T>, LinalgError> {
    Ok(update::Work {
        rows: MatMut::new(rows, m, n, stride)?,
        vectors: MatMut::new(vectors, update::VECTORS, n, stride)?,
    })
}
