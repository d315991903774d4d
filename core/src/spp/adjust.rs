//! Weighted least squares for one 3-vector and one bias per constellation, by Gauss–Newton.
//!
//! Both single-point problems have this form: code gives a position and clock offsets, Doppler a velocity and a clock
//! drift. With residuals r, gradients A and weights W = diag(1/σ²) each step solves (Aᵀ W A) dx = Aᵀ W r (P. Teunissen,
//! *Adjustment Theory*, 2003, section 2.4) by Cholesky on 8 × 8; columns of absent biases are set apart by a unit
//! diagonal. The covariance is (Aᵀ W A)⁻¹, from the σ given: it is not scaled by the residuals.
//!
//! Rows are never stored with their derivatives: a row is linearised again wherever it is needed, so that no workspace
//! of the number of satellites is required. Cost of a step: one linearisation and 14 multiply-adds a row, and about
//! 400 multiply-adds for the solution. Stack: four 8 × 8 matrices. Panic contract: never panics; rows that are not
//! finite or have no positive variance are left out.

use super::SinglePointError;
use crate::gnss::satellite::{Constellation, SatelliteId, SatelliteSet};
use nalgebra::{SMatrix, SVector, Vector3};

/// Biases: one per constellation.
pub const GROUPS: usize = Constellation::ALL.len();
/// Unknowns: a vector and the biases.
const UNKNOWNS: usize = 3 + GROUPS;
/// Gauss–Newton from the centre of the Earth takes 6 steps; each gains at least two digits.
const MAX_STEPS: usize = 15;
/// A step of the vector this small ends the iteration `[m]` or `[m/s]`.
const CONVERGED: f64 = 1e-5;
/// Steps of the robust start, the first half with Huber's weights, the second with Cauchy's.
const ROBUST_STEPS: usize = 30;

/// What is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unknowns {
    /// Position `[m]` or velocity `[m/s]`, ECEF.
    pub vector: Vector3<f64>,
    /// Clock offsets `[m]` by [`Constellation::index`], or in `[0]` the clock drift `[m/s]`.
    pub biases: [f64; GROUPS],
}

/// One measurement, linearised: prediction(x + dx, b + db) ≈ prediction(x, b) + gradient · dx + db\[group\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equation {
    /// Measurement minus prediction.
    pub residual: f64,
    /// Variance of the measurement.
    pub variance: f64,
    /// Derivative of the prediction by the vector.
    pub gradient: Vector3<f64>,
    /// The bias that it contains, < [`GROUPS`].
    pub group: usize,
}

/// How rows depend on the unknowns.
pub trait Model {
    /// What the model is given of a satellite.
    type Row;
    /// What rows share at one linearisation point.
    type Point;

    /// Prepares the point.
    fn point(&self, unknowns: &Unknowns) -> Self::Point;
    /// Linearises a row there; `None` where the row says nothing about these unknowns.
    fn equation(&self, row: &Self::Row, point: &Self::Point) -> Option<Equation>;
    /// Whose row.
    fn satellite(row: &Self::Row) -> SatelliteId;
}

/// A least-squares fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adjustment {
    /// The estimate.
    pub unknowns: Unknowns,
    /// Its covariance: vector first, then biases. Absent biases have variance 1 and no correlation.
    pub covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Which biases were estimated.
    pub groups: [bool; GROUPS],
    /// Satellites that took part.
    pub used: SatelliteSet,
    /// Equations minus unknowns.
    pub degrees_of_freedom: u32,
    /// Σ r²/σ².
    pub chi_square: f64,
    /// Σ r².
    pub sum_of_squares: f64,
}

impl Adjustment {
    /// Variance of the prediction of `equation` by this fit, a (Aᵀ W A)⁻¹ aᵀ.
    pub fn prediction_variance(&self, equation: &Equation) -> f64 {
        let q = &self.covariance;
        let bias = 3 + equation.group.min(GROUPS - 1);
        let mut sum = q[(bias, bias)];
        for i in 0..3 {
            sum += 2.0 * equation.gradient[i] * q[(i, bias)];
            for j in 0..3 {
                sum += equation.gradient[i] * q[(i, j)] * equation.gradient[j];
            }
        }
        sum
    }
}

/// The equations of the usable rows that are not excluded.
pub fn equations<'a, M: Model>(
    model: &'a M,
    rows: &'a [M::Row],
    excluded: &'a SatelliteSet,
    unknowns: &Unknowns,
) -> impl Iterator<Item = (SatelliteId, Equation)> + 'a {
    let point = model.point(unknowns);
    rows.iter().filter_map(move |row| {
        let satellite = M::satellite(row);
        let usable = |e: &Equation| {
            e.residual.is_finite()
                && e.variance > 0.0
                && e.variance.is_finite()
                && e.gradient.iter().all(|g| g.is_finite())
        };
        if excluded.contains(satellite) {
            return None;
        }
        model.equation(row, &point).filter(usable).map(|equation| (satellite, equation))
    })
}

/// Fits the rows that are not excluded, from `start`.
pub fn adjust<M: Model>(
    model: &M,
    rows: &[M::Row],
    excluded: &SatelliteSet,
    start: Unknowns,
) -> Result<Adjustment, SinglePointError> {
    let mut unknowns = start;
    for _ in 0..MAX_STEPS {
        let step = Step::solve(model, rows, excluded, &unknowns, |_| 1.0)?;
        step.apply(&mut unknowns)?;
        if step.length() < CONVERGED {
            let mut used = SatelliteSet::EMPTY;
            let (mut chi_square, mut sum_of_squares) = (0.0, 0.0);
            for (satellite, equation) in equations(model, rows, excluded, &unknowns) {
                used.insert(satellite);
                let square = equation.residual * equation.residual;
                sum_of_squares += square;
                chi_square += square / equation.variance;
            }
            let degrees_of_freedom = step.count.saturating_sub(step.unknowns()) as u32;
            let Step { inverse: covariance, groups, .. } = step;
            return Ok(Adjustment {
                unknowns,
                covariance,
                groups,
                used,
                degrees_of_freedom,
                chi_square,
                sum_of_squares,
            });
        }
    }
    Err(SinglePointError::NotConverged)
}

/// An estimate that several gross errors do not carry away: iteratively reweighted least squares with Huber's weights
/// min(1, 1.5 σ/|r|), which have one minimum and tolerate any start, then Cauchy's 1/(1 + (r/2σ)²), which forget gross
/// errors altogether (P. J. Huber, *Robust Statistics*, 1981, chapter 7).
pub fn robust_start<M: Model>(model: &M, rows: &[M::Row], start: Unknowns) -> Result<Unknowns, SinglePointError> {
    let mut unknowns = start;
    for step in 0..ROBUST_STEPS {
        let huber = |r: f64| (1.5 / libm::fabs(r)).min(1.0);
        let cauchy = |r: f64| 1.0 / (1.0 + 0.25 * r * r);
        let weight = |r: f64| if step < ROBUST_STEPS / 2 { huber(r) } else { cauchy(r) };
        Step::solve(model, rows, &SatelliteSet::EMPTY, &unknowns, weight)?.apply(&mut unknowns)?;
    }
    Ok(unknowns)
}

/// A Gauss–Newton step.
struct Step {
    dx: SVector<f64, UNKNOWNS>,
    inverse: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    groups: [bool; GROUPS],
    count: usize,
}

impl Step {
    /// Solves the normal equations at `unknowns`, with each weight 1/σ² times `factor` of the residual over σ.
    fn solve<M: Model>(
        model: &M,
        rows: &[M::Row],
        excluded: &SatelliteSet,
        unknowns: &Unknowns,
        factor: impl Fn(f64) -> f64,
    ) -> Result<Self, SinglePointError> {
        let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        let mut right = SVector::<f64, UNKNOWNS>::zeros();
        let mut groups = [false; GROUPS];
        let mut count = 0;
        for (_, Equation { residual, variance, gradient, group }) in equations(model, rows, excluded, unknowns) {
            let Some(present) = groups.get_mut(group) else { continue };
            *present = true;
            count += 1;
            let weight = factor(residual / libm::sqrt(variance)) / variance;
            let bias = 3 + group;
            for i in 0..3 {
                let weighted = weight * gradient[i];
                for j in 0..=i {
                    normal[(i, j)] += weighted * gradient[j];
                }
                normal[(bias, i)] += weighted;
                right[i] += weighted * residual;
            }
            normal[(bias, bias)] += weight;
            right[bias] += weight * residual;
        }
        for (group, present) in groups.iter().enumerate() {
            if !present {
                normal[(3 + group, 3 + group)] = 1.0;
            }
        }
        let step = Self { dx: right, inverse: normal, groups, count };
        if count < step.unknowns() {
            return Err(SinglePointError::TooFewSatellites);
        }
        let cholesky = normal.cholesky().ok_or(SinglePointError::PoorGeometry)?;
        Ok(Self { dx: cholesky.solve(&right), inverse: cholesky.inverse(), ..step })
    }

    fn unknowns(&self) -> usize {
        3 + self.groups.iter().filter(|&&present| present).count()
    }

    fn length(&self) -> f64 {
        self.dx.fixed_rows::<3>(0).norm()
    }

    fn apply(&self, unknowns: &mut Unknowns) -> Result<(), SinglePointError> {
        if !self.dx.iter().all(|x| x.is_finite()) {
            return Err(SinglePointError::PoorGeometry);
        }
        unknowns.vector += self.dx.fixed_rows::<3>(0);
        for (group, bias) in unknowns.biases.iter_mut().enumerate() {
            *bias += self.dx[3 + group];
        }
        Ok(())
    }
}
