//! Linearisation of a function of a Gaussian: explicit (Taylor) or statistical (over integration points), of the few
//! states that enter nonlinearly.
//!
//! For y = g(u) + L w + e with (u, w) ~ N(m, S), points ξᵢ with weights wᵐ, wᶜ, and S_uu = C Cᵀ:
//! ```text
//! Yᵢ = g(m_u + C ξᵢ),   ḡ = Σ wᵐ Yᵢ,   A = Σ wᶜ ξᵢ (Yᵢ − ḡ)ᵀ,   G = Aᵀ C⁻¹
//! rᵢ = Yᵢ − ḡ − Aᵀ ξᵢ,   Ω = Σ wᶜ rᵢ rᵢᵀ
//! ⇒ E y = ḡ + L m_w,   Cov((u, w), y) = S Jᵀ,   Cov y = J S Jᵀ + Ω + R,   J = [G L]
//! ```
//! Greiff et al. (CCTA 2021), Remarks 2 and 3, after M. Greiff, A. Robertsson, K. Berntorp, *Exploiting linear substructure
//! in linear regression Kalman filters* (CDC 2020): the residual of w given u is independent of u, so that K(dim u)
//! evaluations replace K(dim x). The update that follows is an ordinary Kalman update with Jacobian J and noise R + Ω.
//!
//! Ω is formed from residuals, never as Cov Y − A Aᵀ: that difference is wrong by 1e-16 · G S Gᵀ, 2e-8 m² at a prior of
//! 10 km.
//!
//! What to use: over a double-differenced range all rules agree up to a prior of 1 km. At 10 km only Gauss–Hermite is
//! consistent (position NEES 2.9 of 3; Taylor 113, cubature 30), because the true Ω has rank 6 and 2d points see 2 of it.
//! An unscented rule with α = 1e-3 weighs rounding by 1e6: 1.4 mm. Negative covariance weights may make Ω indefinite.
//!
//! Points are generated one after another; deviations Yᵢ − Y₁ are kept in `samples` as far as they fit, the others are
//! evaluated a second time. Cost: K to 2K evaluations of g and K p (p/2 + 2d) multiply-adds. Stack: 1 KB.
//! Panic contract: none.

mod points;

use core::fmt;

pub use points::{Points, Weights};

use crate::linalg::{Mat, MatMut, axpy, cholesky, copy, head, head_mut, tail_mut, triangular};
use crate::model::partially_linear::Nonlinear;
use crate::real::Real;

/// Most nonlinear states.
pub const MAX_INPUTS: usize = 8;

/// How to linearise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Rule {
    /// First-order Taylor expansion about the mean: the extended Kalman filter. Ω = 0.
    Taylor,
    /// Unscented transform, 2d + 1 points.
    Unscented {
        /// Spread α of the points.
        alpha: f64,
        /// β, which enters the central covariance weight; 2 for a Gaussian.
        beta: f64,
        /// κ.
        kappa: f64,
    },
    /// Spherical cubature, 2d points.
    Cubature,
    /// Product of Gauss–Hermite rules, orderᵈ points.
    GaussHermite {
        /// Points per dimension, 2 to 5, or 15 as a reference.
        order: usize,
    },
}

impl Rule {
    /// The unscented transform with α = 1, β = 2, κ = 3 − d.
    pub fn unscented(inputs: usize) -> Self {
        Self::Unscented { alpha: 1.0, beta: 2.0, kappa: 3.0 - inputs as f64 }
    }

    /// The points of a statistical rule in `inputs` dimensions.
    pub fn points(self, inputs: usize) -> Result<Points, LinearizeError> {
        Points::new(self, inputs)
    }
}

/// Why a function was not linearised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearizeError {
    /// Lengths do not fit together.
    Shape,
    /// No nonlinear states, or more than [`MAX_INPUTS`].
    Inputs,
    /// The rule has no points: an order that is not offered, or a spread that is not positive.
    Rule,
    /// S_uu is not positive definite.
    NotPositiveDefinite,
    /// A mean or a value of the function is NaN or infinite.
    NotFinite,
}

impl fmt::Display for LinearizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Shape => "dimensions do not fit together",
            Self::Inputs => "the number of nonlinear states is not supported",
            Self::Rule => "the rule has no integration points",
            Self::NotPositiveDefinite => "covariance of the nonlinear states is not positive definite",
            Self::NotFinite => "the function or its argument is not finite",
        })
    }
}

impl core::error::Error for LinearizeError {}

/// Memory for [`linearize`]: `values` and `reference` of p entries, and `samples` of at least p, p·K at best.
#[derive(Debug)]
pub struct Work<'a, T> {
    /// The function at the point at hand.
    pub values: &'a mut [f64],
    /// The function at the first point.
    pub reference: &'a mut [f64],
    /// Deviations from it.
    pub samples: &'a mut [T],
}

/// Linearises `function` about N(`mean`, `covariance`) by `rule`.
///
/// `mean` (d) and `covariance` (d × d, lower triangle read) belong to u alone. Returns ḡ in `prediction` (p), G in
/// `jacobian` (p × d) and adds Ω to the lower triangle of `noise` (p × p). On an error these are spoilt. With d = 0, `g`
/// is a constant.
pub fn linearize<T: Real>(
    rule: Rule,
    function: &(impl Nonlinear + ?Sized),
    mean: &[f64],
    covariance: Mat<'_, T>,
    prediction: &mut [f64],
    jacobian: &mut MatMut<'_, T>,
    noise: &mut MatMut<'_, T>,
    mut work: Work<'_, T>,
) -> Result<(), LinearizeError> {
    let (d, p) = (function.inputs(), function.outputs());
    let lengths =
        [prediction.len(), jacobian.rows(), noise.rows(), noise.cols(), work.values.len(), work.reference.len()];
    if lengths != [p; 6] || [mean.len(), covariance.rows(), covariance.cols(), jacobian.cols()] != [d; 4] {
        return Err(LinearizeError::Shape);
    }
    if d > MAX_INPUTS {
        return Err(LinearizeError::Inputs);
    }
    if rule == Rule::Taylor || d == 0 {
        taylor(function, mean, prediction, jacobian)
    } else if work.samples.len() < p {
        Err(LinearizeError::Shape)
    } else {
        statistical(rule, function, mean, covariance, prediction, jacobian, noise, &mut work)
    }
}

fn taylor<T: Real>(
    function: &(impl Nonlinear + ?Sized),
    mean: &[f64],
    prediction: &mut [f64],
    jacobian: &mut MatMut<'_, T>,
) -> Result<(), LinearizeError> {
    function.evaluate(mean, prediction);
    all_finite(prediction)?;
    let mut gradient = [0.0; MAX_INPUTS];
    let gradient = head_mut(&mut gradient, mean.len());
    for row in 0..prediction.len() {
        function.gradient(mean, row, gradient);
        all_finite(gradient)?;
        for (entry, &value) in jacobian.row_mut(row).iter_mut().zip(&*gradient) {
            *entry = T::from_f64(value);
        }
    }
    Ok(())
}

fn statistical<T: Real>(
    rule: Rule,
    function: &(impl Nonlinear + ?Sized),
    mean: &[f64],
    covariance: Mat<'_, T>,
    prediction: &mut [f64],
    jacobian: &mut MatMut<'_, T>,
    noise: &mut MatMut<'_, T>,
    work: &mut Work<'_, T>,
) -> Result<(), LinearizeError> {
    let (d, p) = (mean.len(), prediction.len());
    if p == 0 {
        return Ok(());
    }
    let mut factor = [T::ZERO; MAX_INPUTS * MAX_INPUTS];
    let mut factor = MatMut::square(&mut factor, d).map_err(|_| LinearizeError::Shape)?;
    factor.copy_from(covariance).map_err(|_| LinearizeError::Shape)?;
    cholesky::factor(&mut factor).map_err(|_| LinearizeError::NotPositiveDefinite)?;
    let factor = factor.as_ref();
    let count = rule.points(d)?.count();
    let slots = work.samples.len() / p;
    let stored = if slots >= count { count } else { slots - 1 };
    let mut xi = [0.0; MAX_INPUTS];
    let xi = head_mut(&mut xi, d);

    // First pass: ḡ and A, from deviations from the first point; they are small, and Σ wᶜ ξ = 0.
    prediction.fill(0.0);
    jacobian.fill(T::ZERO);
    let mut points = rule.points(d)?;
    for k in 0..count {
        let Some(weights) = points.next(xi) else { break };
        evaluate(function, mean, factor, xi, work.values);
        if k == 0 {
            all_finite(work.values)?;
            copy(work.reference, work.values);
        }
        let slot = k.min(slots - 1) * p;
        let sample = head_mut(tail_mut(work.samples, slot), p);
        let weight = T::from_f64(weights.covariance);
        let values = work.values.iter().zip(&*work.reference).zip(&mut *prediction);
        for (((value, reference), prediction), (sample, slope)) in
            values.zip(sample.iter_mut().zip(jacobian.iter_mut()))
        {
            let deviation = value - reference;
            *prediction += weights.mean * deviation;
            *sample = T::from_f64(deviation);
            for (entry, &xi) in slope.iter_mut().zip(&*xi) {
                *entry += weight * *sample * T::from_f64(xi);
            }
        }
    }

    // Second pass: Ω from the residuals, which take the place of the deviations.
    let mut points = rule.points(d)?;
    for k in 0..count {
        let Some(weights) = points.next(xi) else { break };
        let slot = k.min(slots - 1) * p;
        let sample = head_mut(tail_mut(work.samples, slot), p);
        if k >= stored {
            evaluate(function, mean, factor, xi, work.values);
            for ((sample, value), reference) in sample.iter_mut().zip(&*work.values).zip(&*work.reference) {
                *sample = T::from_f64(value - reference);
            }
        }
        for ((residual, &prediction), slope) in sample.iter_mut().zip(&*prediction).zip(jacobian.iter()) {
            *residual -= T::from_f64(prediction);
            for (&slope, &xi) in slope.iter().zip(&*xi) {
                *residual -= slope * T::from_f64(xi);
            }
        }
        let weight = T::from_f64(weights.covariance);
        for ((i, row), &residual) in noise.iter_mut().enumerate().zip(&*sample) {
            axpy(head_mut(row, i + 1), weight * residual, sample);
        }
    }

    for (value, reference) in prediction.iter_mut().zip(&*work.reference) {
        *value += reference;
    }
    all_finite(prediction)?;
    for slope in jacobian.iter_mut() {
        triangular::back_transposed(factor, slope).map_err(|_| LinearizeError::NotPositiveDefinite)?;
    }
    Ok(())
}

/// Writes g(m + C ξ) into `values`.
fn evaluate<T: Real>(
    function: &(impl Nonlinear + ?Sized),
    mean: &[f64],
    factor: Mat<'_, T>,
    xi: &[f64],
    values: &mut [f64],
) {
    let mut u = [0.0; MAX_INPUTS];
    for (i, (u, mean)) in u.iter_mut().zip(mean).enumerate() {
        let row = head(factor.row(i), i + 1);
        *u = mean + row.iter().zip(xi).fold(0.0, |sum, (c, xi)| sum + c.to_f64() * xi);
    }
    function.evaluate(head(&u, mean.len()), values);
}

fn all_finite(values: &[f64]) -> Result<(), LinearizeError> {
    if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(LinearizeError::NotFinite) }
}

#[cfg(test)]
mod tests;
