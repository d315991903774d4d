//! Recursive mixed-integer least squares with a static x: Section III of Greiff et al. (CCTA 2021), exactly.
//!
//! ```text
//! y_k = H_k x + G_k n_k + e_k,   e_k ~ N(0, R_k),   no prior on n_k
//! ```
//! Ambiguities of an epoch know nothing of those before: Algorithm 1 in the limit V → ∞, W = 0, taken in closed form rather
//! than by a large number. With S = H P Hᵀ + R = L Lᵀ and L⁻¹ G = Q U,
//! ```text
//! nᶠ = U⁻¹ Qᵀ L⁻¹ (y − H m),   Σ_nn = U⁻¹ U⁻ᵀ                         (11)–(12): nᶠ is generalised least squares
//! W = (I − Q Qᵀ) L⁻¹ H P,   m ← m + Wᵀ L⁻¹ (y − H m),   P ← P − Wᵀ W   what is left of the rows is for x
//! nᴵ = arg min |n − nᶠ| in Σ_nn⁻¹,   z = y − G nᴵ                       (13), (14)
//! x̂, Ξ ← Kalman update of the constrained density by z                  (16)–(18)
//! ```
//! [`RecursiveMils::start`] begins without a prior on x either, by (5)–(8).
//!
//! This is the theory that the filter rests on, not a filter to use: an old integer is never revised, and in weak geometry
//! 0.5 % of its solutions are all right where exact least squares over all epochs has 90.5 %.
//!
//! Shapes: H p × m, G p × n, R p × p. Memory 2 X² + P (P + X + A) + 2 A² scalars and the integer workspace. Panic contract:
//! none. Errors leave everything as it was.

use super::super::density::Density;
use super::super::update::{Form, Stage, VECTORS, Work, project};
use super::{FilterError, is_plausible};
use crate::integer::{Config, Workspace, resolve};
use crate::linalg::{
    LinalgError, Mat, MatMut, axpy, cholesky, copy, head, head_mut, projection, symmetric, triangular,
};
use crate::real::Real;

/// The measurements of an epoch.
#[derive(Clone, Copy, Debug)]
pub struct Measurement<'a, T> {
    /// H, p × m.
    pub h: Mat<'a, T>,
    /// G, p × n.
    pub g: Mat<'a, T>,
    /// R, p × p.
    pub r: Mat<'a, T>,
    /// y, p.
    pub y: &'a [f64],
}

/// Both densities of x and the ambiguities of the last epoch. X states, A ambiguities, P rows at most.
#[derive(Debug)]
pub struct RecursiveMils<T, const X: usize, const A: usize, const P: usize> {
    states: usize,
    ambiguities: usize,
    relaxed: Density<T, X>,
    constrained: Density<T, X>,
    float: [f64; A],
    float_covariance: [[T; A]; A],
    integers: [i64; A],
    norms: [T; 2],
    scratch: Scratch<T, X, A, P>,
    workspace: Workspace<T, A>,
}

/// Memory that lasts for one epoch.
#[derive(Debug)]
struct Scratch<T, const X: usize, const A: usize, const P: usize> {
    rows: [[T; X]; P],
    columns: [[T; A]; P],
    s: [[T; P]; P],
    residual: [T; P],
    vectors: [[T; X]; VECTORS],
    coefficients: [[T; X]; 1],
    factor: [[T; A]; A],
    covariance: [[T; A]; A],
    whole: [f64; A],
    fraction: [T; A],
    integers: [i64; A],
}

/// The same cut to one measurement.
struct Bench<'a, T> {
    /// L⁻¹ H P, then W; p × m.
    rows: MatMut<'a, T>,
    /// L⁻¹ G, then Q; p × n.
    columns: MatMut<'a, T>,
    /// S, then L.
    s: MatMut<'a, T>,
    residual: &'a mut [T],
    vectors: MatMut<'a, T>,
    /// m numbers.
    coefficients: &'a mut [T],
    /// Uᵀ.
    factor: MatMut<'a, T>,
    /// Σ_nn.
    covariance: MatMut<'a, T>,
    /// nᶠ is `whole` + `fraction`.
    whole: &'a mut [f64],
    fraction: &'a mut [T],
    integers: &'a mut [i64],
}

/// Σ g_j x_j.
fn product<T: Real>(g: &[T], x: impl Iterator<Item = f64>) -> f64 {
    g.iter().zip(x).fold(0.0, |sum, (g, x)| sum + g.to_f64() * x)
}

impl<T: Real, const X: usize, const A: usize, const P: usize> Scratch<T, X, A, P> {
    const fn new() -> Self {
        Self {
            rows: [[T::ZERO; X]; P],
            columns: [[T::ZERO; A]; P],
            s: [[T::ZERO; P]; P],
            residual: [T::ZERO; P],
            vectors: [[T::ZERO; X]; VECTORS],
            coefficients: [[T::ZERO; X]; 1],
            factor: [[T::ZERO; A]; A],
            covariance: [[T::ZERO; A]; A],
            whole: [0.0; A],
            fraction: [T::ZERO; A],
            integers: [0; A],
        }
    }

    fn bench(&mut self, m: usize, n: usize, p: usize) -> Result<Bench<'_, T>, LinalgError> {
        Ok(Bench {
            rows: MatMut::new(self.rows.as_flattened_mut(), p, m, X)?,
            columns: MatMut::new(self.columns.as_flattened_mut(), p, n, A)?,
            s: MatMut::new(self.s.as_flattened_mut(), p, p, P)?,
            residual: head_mut(&mut self.residual, p),
            vectors: MatMut::new(self.vectors.as_flattened_mut(), VECTORS, m, X)?,
            coefficients: head_mut(self.coefficients.as_flattened_mut(), m),
            factor: MatMut::new(self.factor.as_flattened_mut(), n, n, A)?,
            covariance: MatMut::new(self.covariance.as_flattened_mut(), n, n, A)?,
            whole: head_mut(&mut self.whole, n),
            fraction: head_mut(&mut self.fraction, n),
            integers: head_mut(&mut self.integers, n),
        })
    }
}

impl<T: Real> Bench<'_, T> {
    /// L⁻¹ H into `rows` and L⁻¹ G into `columns`.
    fn whiten(&mut self, h: Mat<'_, T>, g: Mat<'_, T>) -> Result<(), LinalgError> {
        self.rows.copy_from(h)?;
        self.columns.copy_from(g)?;
        triangular::forward_rows(self.s.as_ref(), &mut self.rows)?;
        triangular::forward_rows(self.s.as_ref(), &mut self.columns)
    }

    /// nᶠ and Σ_nn from innovations ν, given L in `s`, Q in `columns` and Uᵀ in `factor`. What of nᶠ is whole is found
    /// first, so that `residual` returns L⁻¹ (ν − G `whole`), which is small.
    fn solve_float(&mut self, g: &Mat<'_, T>, innovation: impl Fn(usize) -> f64) -> Result<(), FilterError> {
        self.whole.fill(0.0);
        for _ in 0..2 {
            for ((i, residual), g) in self.residual.iter_mut().enumerate().zip(g.iter()) {
                *residual = T::from_f64(innovation(i) - product(g, self.whole.iter().copied()));
            }
            triangular::forward(self.s.as_ref(), self.residual)?;
            projection::solve(self.columns.as_ref(), self.factor.as_ref(), self.residual, self.fraction)?;
            for (index, (whole, fraction)) in self.whole.iter_mut().zip(&mut *self.fraction).enumerate() {
                let rounded = fraction.round();
                *whole += rounded.to_f64();
                *fraction -= rounded;
                if !is_plausible(*whole) {
                    return Err(FilterError::Ambiguity { index });
                }
            }
        }
        self.covariance.copy_from(self.factor.as_ref())?;
        triangular::invert(&mut self.covariance)?;
        symmetric::square_transposed(&mut self.covariance);
        self.covariance.mirror_lower();
        Ok(())
    }

    /// nᴵ and the norms of the two best.
    fn fix<const A: usize>(&mut self, workspace: &mut Workspace<T, A>) -> Result<[T; 2], FilterError> {
        let found = resolve(self.fraction, self.covariance.as_ref(), &Config::default(), workspace)?;
        for ((integer, &whole), &offset) in self.integers.iter_mut().zip(&*self.whole).zip(found.best) {
            *integer = whole as i64 + offset;
        }
        Ok([found.best_norm, found.second_norm])
    }

    /// ν − G nᴵ into `residual`.
    fn constrain(&mut self, g: &Mat<'_, T>, innovation: impl Fn(usize) -> f64) {
        for ((i, residual), g) in self.residual.iter_mut().enumerate().zip(g.iter()) {
            let fixed = product(g, self.integers.iter().map(|&integer| integer as f64));
            *residual = T::from_f64(innovation(i) - fixed);
        }
    }
}

impl<T: Real, const X: usize, const A: usize, const P: usize> Default for RecursiveMils<T, X, A, P> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const X: usize, const A: usize, const P: usize> RecursiveMils<T, X, A, P> {
    /// Without states.
    pub const fn new() -> Self {
        Self {
            states: 0,
            ambiguities: 0,
            relaxed: Density::new(),
            constrained: Density::new(),
            float: [0.0; A],
            float_covariance: [[T::ZERO; A]; A],
            integers: [0; A],
            norms: [T::ZERO; 2],
            scratch: Scratch::new(),
            workspace: Workspace::new(),
        }
    }

    /// Starts anew from a prior on x, the same for both densities.
    pub fn reset(&mut self, mean: &[f64], covariance: Mat<'_, T>) -> Result<(), FilterError> {
        let m = mean.len();
        if m > X {
            return Err(FilterError::Capacity);
        }
        if m == 0 || covariance.rows() != m {
            return Err(FilterError::Shape);
        }
        if !mean.iter().all(|mean| mean.is_finite()) {
            return Err(FilterError::NotFinite);
        }
        symmetric::check(covariance).map_err(FilterError::Covariance)?;
        self.relaxed.cut(self.states)?.begin();
        let entry = |i, j| covariance.at(i, j);
        if let Err(error) = cholesky::factor(&mut self.relaxed.cut(m)?.set(mean, entry).p) {
            self.relaxed.cut(self.states)?.roll_back();
            return Err(error.into());
        }
        for density in [&mut self.relaxed, &mut self.constrained] {
            density.cut(m)?.set(mean, entry).commit();
        }
        (self.states, self.ambiguities) = (m, 0);
        Ok(())
    }

    /// Starts anew from the first measurement, without a prior on x: mixed-integer least squares, (3)–(8).
    pub fn start(&mut self, measurement: &Measurement<'_, T>) -> Result<(), FilterError> {
        self.check(measurement, measurement.h.cols())?;
        let (m, n) = (measurement.h.cols(), measurement.g.cols());
        if measurement.y.len() < m + n {
            return Err(FilterError::Undetermined { index: measurement.y.len().saturating_sub(m) });
        }
        let kept = (self.states, self.ambiguities);
        self.begin(kept.0)?;
        self.states = m;
        let outcome = self.start_with(measurement);
        if outcome.is_err() {
            self.states = kept.0;
        }
        self.end(outcome, n)
    }

    /// One epoch.
    pub fn step(&mut self, measurement: &Measurement<'_, T>) -> Result<(), FilterError> {
        self.check(measurement, self.states)?;
        if measurement.y.len() < measurement.g.cols() {
            return Err(FilterError::Undetermined { index: measurement.y.len() });
        }
        self.begin(self.states)?;
        let outcome = self.step_with(measurement);
        self.end(outcome, measurement.g.cols())
    }

    /// Mean and covariance of x in the relaxed density.
    pub fn relaxed(&self) -> (&[f64], Mat<'_, T>) {
        self.relaxed.view(self.states)
    }

    /// Mean and covariance of x in the constrained density.
    pub fn constrained(&self) -> (&[f64], Mat<'_, T>) {
        self.constrained.view(self.states)
    }

    /// Real-valued ambiguities nᶠ `[cycles]` of the last epoch and their covariance.
    pub fn float(&self) -> (&[f64], Mat<'_, T>) {
        let n = self.ambiguities;
        let covariance = Mat::new(self.float_covariance.as_flattened(), n, n, A);
        (head(&self.float, n), covariance.unwrap_or(Mat::empty()))
    }

    /// Integers nᴵ of the last epoch `[cycles]`.
    pub fn integers(&self) -> &[i64] {
        head(&self.integers, self.ambiguities)
    }

    /// Squared norms of the two nearest integer vectors of the last epoch.
    pub fn norms(&self) -> [T; 2] {
        self.norms
    }

    fn check(&self, measurement: &Measurement<'_, T>, m: usize) -> Result<(), FilterError> {
        let Measurement { h, g, r, y } = measurement;
        let p = y.len();
        if p == 0 {
            return Err(FilterError::NoRows);
        }
        if p > P || m > X || g.cols() > A {
            return Err(FilterError::Capacity);
        }
        if m == 0 || g.cols() == 0 || [h.rows(), g.rows(), r.rows()] != [p; 3] || h.cols() != m {
            return Err(FilterError::Shape);
        }
        symmetric::check(*r).map_err(FilterError::Covariance)?;
        let finite = |matrix: &Mat<'_, T>| (0..p).all(|i| matrix.row(i).iter().all(|value| value.is_finite()));
        if finite(h) && finite(g) && y.iter().all(|y| y.is_finite()) { Ok(()) } else { Err(FilterError::NotFinite) }
    }

    /// Remembers both densities, of the dimension they have.
    fn begin(&mut self, m: usize) -> Result<(), FilterError> {
        self.relaxed.cut(m)?.begin();
        self.constrained.cut(m)?.begin();
        Ok(())
    }

    fn end(&mut self, outcome: Result<[T; 2], FilterError>, n: usize) -> Result<(), FilterError> {
        let (mut relaxed, mut constrained) = (self.relaxed.cut(self.states)?, self.constrained.cut(self.states)?);
        match outcome {
            Ok(norms) => {
                relaxed.commit();
                constrained.commit();
                (self.ambiguities, self.norms) = (n, norms);
                let bench = self.scratch.bench(0, n, 0)?;
                for (float, (whole, fraction)) in self.float.iter_mut().zip(bench.whole.iter().zip(&*bench.fraction)) {
                    *float = whole + fraction.to_f64();
                }
                copy(&mut self.integers, bench.integers);
                MatMut::new(self.float_covariance.as_flattened_mut(), n, n, A)?.copy_from(bench.covariance.as_ref())?;
                Ok(())
            }
            Err(error) => {
                relaxed.roll_back();
                constrained.roll_back();
                Err(error)
            }
        }
    }
}

impl<T: Real, const X: usize, const A: usize, const P: usize> RecursiveMils<T, X, A, P> {
    /// Mixed-integer least squares with A = L⁻¹ H, B = L⁻¹ G, R = L Lᵀ.
    fn start_with(&mut self, measurement: &Measurement<'_, T>) -> Result<[T; 2], FilterError> {
        let Measurement { h, g, r, y } = measurement;
        let innovation = |i: usize| y.get(i).copied().unwrap_or(0.0);
        let (m, n) = (h.cols(), g.cols());
        let (mut relaxed, mut constrained) = (self.relaxed.cut(m)?, self.constrained.cut(m)?);
        let mut bench = self.scratch.bench(m, n, y.len())?;
        bench.s.copy_from(*r)?;
        cholesky::factor(&mut bench.s)?;

        // n with x free: B without what A explains. Then x given the integers.
        bench.whiten(*h, *g)?;
        projection::orthogonalize(&mut bench.rows, &mut constrained.p)?;
        projection::remove(&mut bench.columns, bench.rows.as_ref(), bench.fraction);
        projection::orthogonalize(&mut bench.columns, &mut bench.factor)?;
        bench.solve_float(g, innovation)?;
        let norms = bench.fix(&mut self.workspace)?;
        bench.constrain(g, innovation);
        triangular::forward(bench.s.as_ref(), bench.residual)?;
        constrained.solve(bench.rows.as_ref(), bench.residual)?;

        // x with n free: A without what B explains.
        bench.whiten(*h, *g)?;
        projection::orthogonalize(&mut bench.columns, &mut bench.factor)?;
        projection::remove(&mut bench.rows, bench.columns.as_ref(), bench.coefficients);
        projection::orthogonalize(&mut bench.rows, &mut relaxed.p)?;
        relaxed.solve(bench.rows.as_ref(), bench.residual)?;
        Ok(norms)
    }

    fn step_with(&mut self, measurement: &Measurement<'_, T>) -> Result<[T; 2], FilterError> {
        let Measurement { h, g, r, y } = measurement;
        let (mut relaxed, mut constrained) = (self.relaxed.cut(self.states)?, self.constrained.cut(self.states)?);
        let mut bench = self.scratch.bench(self.states, g.cols(), y.len())?;
        let predicted = |mean: &[f64], i: usize| product(h.row(i), mean.iter().copied());
        let y = |i: usize| y.get(i).copied().unwrap_or(0.0);

        bench.s.copy_from(*r)?;
        project(relaxed.p.as_ref(), h, 0, &mut bench.rows, &mut bench.s, |_, _, _| ());
        cholesky::factor(&mut bench.s)?;
        triangular::forward_rows(bench.s.as_ref(), &mut bench.rows)?;
        bench.columns.copy_from(*g)?;
        triangular::forward_rows(bench.s.as_ref(), &mut bench.columns)?;
        projection::orthogonalize(&mut bench.columns, &mut bench.factor)?;
        bench.solve_float(g, |i| y(i) - predicted(relaxed.mean, i))?;
        let norms = bench.fix(&mut self.workspace)?;

        // What of the rows is orthogonal to the ambiguities updates x.
        projection::remove(&mut bench.rows, bench.columns.as_ref(), bench.coefficients);
        symmetric::subtract_gram(&mut relaxed.p, bench.rows.as_ref());
        for (&z, w) in bench.residual.iter().zip(bench.rows.iter()) {
            axpy(relaxed.correction, z, w);
        }
        symmetric::check_diagonal(relaxed.p.as_ref())?;
        relaxed.correct();

        bench.s.copy_from(*r)?;
        bench.constrain(g, |i| y(i) - predicted(constrained.mean, i));
        let work = Work { rows: bench.rows, vectors: bench.vectors };
        let mut stage = Stage::begin(Form::Joseph, constrained.correction, constrained.p.reborrow(), work)?;
        stage.correlated(h, 0, bench.residual, &mut bench.s)?;
        stage.finish()?;
        constrained.correct();
        Ok(norms)
    }
}

#[cfg(test)]
mod tests;
