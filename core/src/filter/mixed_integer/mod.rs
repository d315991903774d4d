//! The mixed-integer filter: real states and integer ambiguities, two densities, any partially linear model.
//!
//! Algorithm 1 of Greiff et al., *Mixed-Integer Linear Regression Kalman Filters for GNSS Positioning* (CCTA 2021), called
//! MI-EKF with [`super::linearize::Rule::Taylor`] and MI-LRKF with the other rules:
//! ```text
//! relaxed density      p(xᶠ, nᶠ | y₁…y_k)      ambiguities are real numbers
//! constrained density  p(x | z₁…z_k)            z = y − G nᴵ, all integers so far taken as exact
//! ```
//! One epoch, [`MixedIntegerFilter::step`], in this order:
//! 1. predict the relaxed density by F and W, without ambiguity noise;
//! 2. linearise at it: ŷ, J, Ω;
//! 3. slip estimates δn from the innovations, flags c = |δn| > d, V = diag(c σ_jump² + (1 − c) σ_stay²), (31)–(33);
//! 4. add V to the ambiguities and update;
//! 5. integers nᴵ from the relaxed ambiguities, (37);
//! 6. z = y − G nᴵ; predict the constrained density, linearise anew, update, (38).
//!
//! Means are `f64` whatever the scalar T of the covariances: positions of 1e4 m and ambiguities of 1e6 cycles keep their
//! digits, residuals are formed in `f64`, and what meets the integer search is the fraction left of rint(n). Corrections
//! are sums in T.
//!
//! The plain form of the update gives way to the array form in epochs whose nonlinear states are too uncertain for it, such
//! as the first: in `f32` that is the difference between 5 mm and 0.02 mm.
//!
//! The model is never a dense matrix: rows without nonlinear states are taken one by one as sparse rows, the correlated
//! rows as one block, and only the lower triangles are worked on. The strict upper triangles keep the last good densities
//! until an epoch is complete, so that an error leaves the filter as it was.
//!
//! A missed slip biases the relaxed density, then the integers, and the constrained covariance never notices (NEES 26 when
//! wrong, 3.1 when right): real data need an acceptance test on top.
//!
//! Memory: N² + X² + C (N + C + A) + A² + O(N + C) scalars and the integer workspace; see [`SectionV`]. Stack: about 3 KB.
//! Panic contract: none.

mod epoch;
mod error;
mod options;
mod predict;
mod recursive;
mod rows;
mod scratch;
#[cfg(test)]
mod tests;

pub use error::FilterError;
pub use options::{Detector, Fixing, Options, Output};
pub use recursive::{Measurement, RecursiveMils};

use super::density::Density;
use super::linearize::MAX_INPUTS;
use super::update::Gauge;
use crate::integer::{Method, Workspace};
use crate::linalg::{Mat, cholesky, copy, head, symmetric, tail};
use crate::model::partially_linear::{PartiallyLinear, Shape};
use crate::real::Real;
use epoch::Epoch;
use scratch::Scratch;

/// Ambiguities of this size or more are refused `[cycles]`: 2e8 m, ten times the distance to a satellite.
pub const MAX_AMBIGUITY: f64 = 1e9;

/// Whether an ambiguity is finite and below [`MAX_AMBIGUITY`].
fn is_plausible(ambiguity: f64) -> bool {
    libm::fabs(ambiguity) < MAX_AMBIGUITY
}

/// What integer estimation found in an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integers<T> {
    /// Squared norm of the integers chosen.
    pub best_norm: T,
    /// Squared norm of the second nearest.
    pub second_norm: T,
    /// Success rate of bootstrapping.
    pub success_rate: f64,
    /// How they were found.
    pub method: Method,
    /// Nodes visited.
    pub nodes: u32,
}

/// What an epoch brought; densities, integers and slips are read from the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome<T> {
    /// Innovations of the relaxed update.
    pub relaxed: Gauge<T>,
    /// Innovations of the constrained update; empty for [`Output::ConditionalFix`].
    pub constrained: Gauge<T>,
    /// How many ambiguities are taken to have jumped.
    pub slips: usize,
    /// The jump common to all ambiguities, where there is one: a slip on their reference satellite `[cycles]`.
    pub common_jump: Option<i64>,
    /// The integers' quality; `None` for a model without ambiguities.
    pub integers: Option<Integers<T>>,
    /// Whether the constrained update left out the rows with ambiguities, see [`Options::gate`].
    pub gated: bool,
}

/// The filter. N joint states, X real states, A ambiguities, C correlated rows at most, N ≥ X + A. Suits a `static`.
///
/// A rover at its base, five satellites, nothing but zeros measured:
/// ```
/// use nalgebra::Vector3;
/// use surefix_core::filter::mixed_integer::{MixedIntegerFilter, Options};
/// use surefix_core::model::virtual_bias::{VirtualBiasModel, VirtualBiasParameters};
///
/// let satellites = [[0.1, 0.2, 2.2], [2.0, 0.3, 0.8], [-1.8, 0.9, 0.9], [0.4, -2.0, 0.7], [0.3, 1.9, 1.0]];
/// let satellites = satellites.map(|s| Vector3::from(s) * 1e7);
/// let model = VirtualBiasModel { satellites: &satellites, parameters: VirtualBiasParameters::default() };
///
/// let mut filter = MixedIntegerFilter::<f64, 25, 21, 4, 8>::new(Options::default());
/// filter.reset_independent(21, &[0.0; 25], &[100.0; 25])?;
/// filter.step(&model, &[0.0; 23])?;
/// assert_eq!(filter.integers(), [0; 4]);
/// assert!(filter.constrained_covariance().get(0, 0) < filter.covariance().get(0, 0));
/// # Ok::<(), surefix_core::filter::mixed_integer::FilterError>(())
/// ```
#[derive(Debug)]
pub struct MixedIntegerFilter<T, const N: usize, const X: usize, const A: usize, const C: usize> {
    options: Options,
    real: usize,
    ambiguities: usize,
    relaxed: Density<T, N>,
    constrained: Density<T, X>,
    integers: [i64; A],
    slip_estimates: [f64; A],
    slips: [bool; A],
    scratch: Scratch<T, N, A, C>,
    workspace: Workspace<T, A>,
}

/// Room for Section V of the paper: 13 satellites, 57 + 45 states, 63 rows.
///
/// 73 KB in `f64`, 39 KB in `f32`. An epoch with the default options takes 1.9 million instructions on a Cortex-M7 in
/// `f64` and 3.2 million on a Cortex-M4F in `f32` (QEMU; instructions are not cycles). In `f32` the constrained position
/// stays within 0.1 mm of that in `f64`; its first epoch, with a wide prior, takes 3.9 million.
pub type SectionV<T> = MixedIntegerFilter<T, 57, 45, 12, 24>;

impl<T: Real, const N: usize, const X: usize, const A: usize, const C: usize> MixedIntegerFilter<T, N, X, A, C> {
    /// A filter without states.
    pub const fn new(options: Options) -> Self {
        Self {
            options,
            real: 0,
            ambiguities: 0,
            relaxed: Density::new(),
            constrained: Density::new(),
            integers: [0; A],
            slip_estimates: [0.0; A],
            slips: [false; A],
            scratch: Scratch::new(),
            workspace: Workspace::new(),
        }
    }

    /// The options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The options, to be changed between epochs.
    pub fn options_mut(&mut self) -> &mut Options {
        &mut self.options
    }

    /// Starts anew from `mean` = (x, n), of which the first `real` are x, and its covariance. The constrained density is
    /// the marginal of x. On an error the filter is as it was before.
    pub fn reset(&mut self, real: usize, mean: &[f64], covariance: Mat<'_, T>) -> Result<(), FilterError> {
        let n = mean.len();
        let ambiguities = self.check_mean(real, mean)?;
        if covariance.rows() != n {
            return Err(FilterError::Shape);
        }
        symmetric::check(covariance).map_err(FilterError::Covariance)?;
        // The trial factorisation takes the place of the old covariance, which comes back if it fails.
        self.relaxed.cut(self.real + self.ambiguities)?.begin();
        let mut trial = self.relaxed.cut(n)?.set(mean, |i, j| covariance.at(i, j));
        if let Err(error) = cholesky::factor(&mut trial.p) {
            self.relaxed.cut(self.real + self.ambiguities)?.roll_back();
            return Err(error.into());
        }
        self.set(real, ambiguities, mean, |i, j| covariance.at(i, j))
    }

    /// As [`Self::reset`] with independent states of the given variances.
    pub fn reset_independent(&mut self, real: usize, mean: &[f64], variances: &[f64]) -> Result<(), FilterError> {
        let ambiguities = self.check_mean(real, mean)?;
        if variances.len() != mean.len() {
            return Err(FilterError::Shape);
        }
        let fits = |&variance: &f64| T::from_f64(variance).is_finite() && T::from_f64(variance) > T::ZERO;
        if let Some(state) = variances.iter().position(|variance| !fits(variance)) {
            return Err(FilterError::NotPositiveDefinite { state });
        }
        let covariance = |i: usize, j: usize| match variances.get(i) {
            Some(&variance) if i == j => T::from_f64(variance),
            _ => T::ZERO,
        };
        self.set(real, ambiguities, mean, covariance)
    }

    /// Checks an initial mean; returns the number of ambiguities in it.
    fn check_mean(&self, real: usize, mean: &[f64]) -> Result<usize, FilterError> {
        let ambiguities = mean.len().checked_sub(real).ok_or(FilterError::Shape)?;
        if mean.is_empty() {
            return Err(FilterError::Shape);
        }
        if real > X || ambiguities > A || mean.len() > N {
            return Err(FilterError::Capacity);
        }
        if !mean.iter().all(|mean| mean.is_finite()) {
            return Err(FilterError::NotFinite);
        }
        match tail(mean, real).iter().position(|&n| !is_plausible(n)) {
            Some(index) => Err(FilterError::Ambiguity { index }),
            None => Ok(ambiguities),
        }
    }

    /// Sets both densities.
    fn set(
        &mut self,
        real: usize,
        ambiguities: usize,
        mean: &[f64],
        covariance: impl Fn(usize, usize) -> T,
    ) -> Result<(), FilterError> {
        self.relaxed.cut(real + ambiguities)?.set(mean, &covariance).commit();
        self.constrained.cut(real)?.set(mean, &covariance).commit();
        (self.real, self.ambiguities) = (real, ambiguities);
        self.integers = [0; A];
        self.slip_estimates = [0.0; A];
        self.slips = [false; A];
        Ok(())
    }

    /// One epoch: the measurements `y`, in the order of the model's rows. On an error the filter is as it was before.
    pub fn step(&mut self, model: &impl PartiallyLinear, y: &[f64]) -> Result<Outcome<T>, FilterError> {
        let shape = self.check(model, y)?;
        let mut epoch = Epoch {
            options: self.options,
            model,
            shape,
            y,
            relaxed: self.relaxed.cut(shape.states())?,
            constrained: self.constrained.cut(shape.real)?,
            bench: self.scratch.bench(model.inputs(), shape.ambiguities, shape.correlated)?,
        };
        epoch.relaxed.begin();
        epoch.constrained.begin();
        match epoch.run(&mut self.workspace) {
            Ok(outcome) => {
                epoch.relaxed.commit();
                epoch.constrained.commit();
                copy(&mut self.integers, epoch.bench.integers);
                copy(&mut self.slips, epoch.bench.flags);
                for (to, from) in self.slip_estimates.iter_mut().zip(&*epoch.bench.estimate) {
                    *to = from.to_f64();
                }
                Ok(outcome)
            }
            Err(error) => {
                epoch.relaxed.roll_back();
                epoch.constrained.roll_back();
                Err(error)
            }
        }
    }

    /// Whether a model and its measurements fit this filter, and the model itself.
    fn check(&self, model: &impl PartiallyLinear, y: &[f64]) -> Result<Shape, FilterError> {
        let (shape, u) = (model.shape(), model.nonlinear());
        if shape.rows() == 0 {
            return Err(FilterError::NoRows);
        }
        if shape.correlated > C || model.inputs() > MAX_INPUTS {
            return Err(FilterError::Capacity);
        }
        let fits = (shape.real, shape.ambiguities) == (self.real, self.ambiguities)
            && y.len() == shape.rows()
            && model.outputs() == shape.correlated
            && shape.unambiguous <= shape.correlated
            && u.len() == model.inputs()
            && u.end <= shape.real;
        if !fits {
            return Err(FilterError::Shape);
        }
        let Options { threshold, sigma_jump, sigma_stay, gate, .. } = self.options;
        if ![threshold, sigma_jump, sigma_stay, gate].iter().chain(y).all(|value| value.is_finite()) {
            return Err(FilterError::NotFinite);
        }
        rows::check(model, &shape)?;
        Ok(shape)
    }

    /// m, the number of real states.
    pub fn real(&self) -> usize {
        self.real
    }

    /// The number of ambiguities.
    pub fn ambiguities(&self) -> usize {
        self.ambiguities
    }

    /// Mean of the relaxed density (x, n); ambiguities in cycles.
    pub fn mean(&self) -> &[f64] {
        self.relaxed.view(self.real + self.ambiguities).0
    }

    /// Covariance of the relaxed density.
    pub fn covariance(&self) -> Mat<'_, T> {
        self.relaxed.view(self.real + self.ambiguities).1
    }

    /// Mean of the constrained density x.
    pub fn constrained_mean(&self) -> &[f64] {
        self.constrained.view(self.real).0
    }

    /// Covariance of the constrained density.
    pub fn constrained_covariance(&self) -> Mat<'_, T> {
        self.constrained.view(self.real).1
    }

    /// Integers nᴵ of the last epoch `[cycles]`.
    pub fn integers(&self) -> &[i64] {
        head(&self.integers, self.ambiguities)
    }

    /// Slip estimates δn of the last epoch `[cycles]`; zero without a detector.
    pub fn slip_estimates(&self) -> &[f64] {
        head(&self.slip_estimates, self.ambiguities)
    }

    /// Which ambiguities were taken to have jumped in the last epoch.
    pub fn slips(&self) -> &[bool] {
        head(&self.slips, self.ambiguities)
    }
}
