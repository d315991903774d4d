//! Measurement models that are linear in most of their states, which is what a mixed-integer filter is told about the
//! world.
//!
//! ```text
//! x = (…, u, …) ∈ ℝᵐ,  n ∈ ℤⁿ
//! y = g(u) + L w + G n + e,   e ~ N(0, R)          u: the few states that enter nonlinearly, w: all the others
//! x⁺ = F x + w,  w ~ N(0, W)
//! ```
//! Greiff et al., *Mixed-Integer Linear Regression Kalman Filters for GNSS Positioning* (CCTA 2021), eqs. (24), (34).
//!
//! The structure is exposed, not assembled: the p rows are never a dense p × (m + n) matrix.
//!
//! | rows, in this order | depend on | noise |
//! |---|---|---|
//! | `correlated`, of which the first `unambiguous` | u and w | full covariance R |
//! | the rest of `correlated` | u, w and n | the same R |
//! | `independent` | w only | a variance each |
//!
//! States are numbered (x, n): ambiguity i is state m + i. Panic contract: implementations must not panic for rows and
//! states within their own [`Shape`].

use core::ops::Range;

/// A function ℝᵈ → ℝᵖ, always evaluated in `f64`: it is where ranges of 2e7 m are.
pub trait Nonlinear {
    /// d, the number of arguments.
    fn inputs(&self) -> usize;

    /// p, the number of values.
    fn outputs(&self) -> usize;

    /// Writes g(u) into `values` (p); `u` has d entries.
    fn evaluate(&self, u: &[f64], values: &mut [f64]);

    /// Writes ∂g_row/∂u at `u` into `gradient` (d).
    fn gradient(&self, u: &[f64], row: usize, gradient: &mut [f64]);
}

/// The dimensions of a [`PartiallyLinear`] model at one epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    /// m, the number of real states x.
    pub real: usize,
    /// n, the number of ambiguities.
    pub ambiguities: usize,
    /// c, the number of rows with correlated noise; they come first.
    pub correlated: usize,
    /// How many of these contain no ambiguity; they come before those that do.
    pub unambiguous: usize,
    /// Number of rows with independent noise that contain neither nonlinear states nor ambiguities.
    pub independent: usize,
}

impl Shape {
    /// m + n.
    pub const fn states(&self) -> usize {
        self.real + self.ambiguities
    }

    /// p, the number of measurements.
    pub const fn rows(&self) -> usize {
        self.correlated + self.independent
    }
}

/// One factor of a transition F, which is their product, the first one applied first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Elementary {
    /// x_to ← x_to + factor · x_from.
    Shear {
        /// The state that changes.
        to: usize,
        /// The state that is added.
        from: usize,
        /// Its coefficient.
        factor: f64,
    },
    /// x_state ← factor · x_state.
    Scale {
        /// The state that changes.
        state: usize,
        /// Its coefficient.
        factor: f64,
    },
}

/// y = g(u) + L w + G n + e with its motion. [`Nonlinear::evaluate`] gives g for the correlated rows.
pub trait PartiallyLinear: Nonlinear {
    /// Dimensions.
    fn shape(&self) -> Shape;

    /// Which states are u, within x; as many as [`Nonlinear::inputs`].
    fn nonlinear(&self) -> Range<usize>;

    /// Calls `entry` with every state and coefficient of a row of [L G]; u is left out.
    fn linear_row(&self, row: usize, entry: &mut dyn FnMut(usize, f64));

    /// R_ij for two correlated rows with j ≤ i.
    fn noise(&self, i: usize, j: usize) -> f64;

    /// Noise variance of an independent row, numbered among all rows.
    fn variance(&self, row: usize) -> f64;

    /// Calls `step` with each factor of F, in the order in which they apply. Ambiguities do not move.
    fn transition(&self, step: &mut dyn FnMut(Elementary));

    /// Calls `entry` with i, j ≤ i and W_ij for every entry of the lower triangle of W that is not zero.
    fn process_noise(&self, entry: &mut dyn FnMut(usize, usize, f64));
}
