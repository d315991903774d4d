//! Double differences of one band with single-difference biases as states, each seen by a virtual measurement: the model
//! of Greiff et al. (CCTA 2021), Section V.
//!
//! ```text
//! x = (p, v, θᴵ, θᴾ, θᶲ) ∈ ℝ^(6+3N)          n ∈ ℤ^(N−1)
//! y_P = M ρ(p) + M θᴵ + M θᴾ + ε             (42a)   N−1 rows   2 σ_P² M Mᵀ
//! y_Φ = M ρ(p) + λ n − M θᴵ + M θᶲ + η       (42b)   N−1 rows   2 σ_Φ² M Mᵀ
//! y^I = θᴵ + r,  y^P = θᴾ + r,  y^Φ = θᶲ + r (42c)   3N rows    σ_θ² I
//! ```
//! with M = [1 −I] (satellite 0 is the reference), p `[m]` the rover relative to the base, satellites sᵢ `[m]` relative to
//! the base, ρᵢ = |p − sᵢ| − |sᵢ| the single difference of ranges, computed as p·(p − 2 sᵢ)/(|p − sᵢ| + |sᵢ|): the plain
//! difference loses up to 2 mm with some point sets. Motion (39), (40): a double integrator driven by white acceleration
//! of density α `[m²/s³]`, biases a random walk of density β `[m²/s]`.
//!
//! Without the virtual rows the model has rank 24 of 54 (N = 13): they are part of it.
//! Cost of g: N square roots. Panic contract: none.

use super::partially_linear::{Elementary, Nonlinear, PartiallyLinear, Shape};
use core::ops::Range;
use nalgebra::Vector3;

/// The numbers of the model. The default is Table I of the paper.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct VirtualBiasParameters {
    /// h, time between epochs `[s]`.
    pub interval: f64,
    /// α, density of the white acceleration `[m²/s³]`.
    pub acceleration: f64,
    /// β, density of the bias random walk `[m²/s]`.
    pub bias_walk: f64,
    /// λ, wavelength `[m]`.
    pub wavelength: f64,
    /// σ_P, undifferenced code noise `[m]`.
    pub sigma_code: f64,
    /// σ_Φ, undifferenced phase noise `[m]`.
    pub sigma_phase: f64,
    /// σ_θ, noise of the virtual measurements `[m]`.
    pub sigma_bias: f64,
}

impl Default for VirtualBiasParameters {
    fn default() -> Self {
        Self {
            interval: 0.1,
            acceleration: 0.01,
            bias_walk: 0.01,
            wavelength: 0.2,
            sigma_code: 0.5,
            sigma_phase: 0.01,
            sigma_bias: 0.01,
        }
    }
}

/// The model at one epoch.
#[derive(Clone, Copy, Debug)]
pub struct VirtualBiasModel<'a> {
    /// Satellites relative to the base `[m]`, the reference first.
    pub satellites: &'a [Vector3<f64>],
    /// Its numbers.
    pub parameters: VirtualBiasParameters,
}

/// States before the biases: position and velocity.
const KINEMATIC: usize = 6;

impl VirtualBiasModel<'_> {
    /// N − 1, the number of double differences.
    fn differences(&self) -> usize {
        self.satellites.len().saturating_sub(1)
    }
}

/// |p − s| − |s| without cancellation, and |p − s|.
fn range_difference(p: &Vector3<f64>, s: &Vector3<f64>) -> (f64, f64) {
    let to_rover = p - s;
    let distance = libm::sqrt(to_rover.dot(&to_rover));
    (p.dot(&(to_rover - s)) / (distance + libm::sqrt(s.dot(s))), distance)
}

/// The position in `u`, zero where it is missing.
fn position(u: &[f64]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| u.get(i).copied().unwrap_or(0.0))
}

impl Nonlinear for VirtualBiasModel<'_> {
    fn inputs(&self) -> usize {
        3
    }

    fn outputs(&self) -> usize {
        2 * self.differences()
    }

    fn evaluate(&self, u: &[f64], values: &mut [f64]) {
        let Some((reference, others)) = self.satellites.split_first() else { return };
        let p = position(u);
        let rho = range_difference(&p, reference).0;
        let (codes, phases) = values.split_at_mut(values.len().min(others.len()));
        for ((satellite, code), phase) in others.iter().zip(codes).zip(phases) {
            *code = rho - range_difference(&p, satellite).0;
            *phase = *code;
        }
    }

    fn gradient(&self, u: &[f64], row: usize, gradient: &mut [f64]) {
        let Some((reference, others)) = self.satellites.split_first() else { return };
        let Some(satellite) = others.get(row % others.len().max(1)) else { return };
        let p = position(u);
        let unit = |s: &Vector3<f64>| (p - s) / range_difference(&p, s).1;
        for (entry, value) in gradient.iter_mut().zip((unit(reference) - unit(satellite)).iter()) {
            *entry = *value;
        }
    }
}

impl PartiallyLinear for VirtualBiasModel<'_> {
    fn shape(&self) -> Shape {
        let (n, differences) = (self.satellites.len(), self.differences());
        Shape {
            real: KINEMATIC + 3 * n,
            ambiguities: differences,
            correlated: 2 * differences,
            unambiguous: differences,
            independent: 3 * n,
        }
    }

    fn nonlinear(&self) -> Range<usize> {
        0..3
    }

    fn linear_row(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        let (n, differences) = (self.satellites.len(), self.differences());
        let (ionosphere, code, phase) = (KINEMATIC, KINEMATIC + n, KINEMATIC + 2 * n);
        let mut difference = |bias: usize, i: usize, sign: f64| {
            entry(bias, sign);
            entry(bias + 1 + i, -sign);
        };
        if row < differences {
            difference(ionosphere, row, 1.0);
            difference(code, row, 1.0);
        } else if row < 2 * differences {
            let i = row - differences;
            difference(ionosphere, i, -1.0);
            difference(phase, i, 1.0);
            entry(phase + n + i, self.parameters.wavelength);
        } else if row < 2 * differences + 3 * n {
            entry(KINEMATIC + row - 2 * differences, 1.0);
        }
    }

    fn noise(&self, i: usize, j: usize) -> f64 {
        let differences = self.differences();
        if (i < differences) != (j < differences) {
            return 0.0;
        }
        let sigma = if i < differences { self.parameters.sigma_code } else { self.parameters.sigma_phase };
        // M Mᵀ has 2 on the diagonal and 1 elsewhere.
        2.0 * sigma * sigma * if i == j { 2.0 } else { 1.0 }
    }

    fn variance(&self, _row: usize) -> f64 {
        self.parameters.sigma_bias * self.parameters.sigma_bias
    }

    fn transition(&self, step: &mut dyn FnMut(Elementary)) {
        for axis in 0..3 {
            step(Elementary::Shear { to: axis, from: axis + 3, factor: self.parameters.interval });
        }
    }

    fn process_noise(&self, entry: &mut dyn FnMut(usize, usize, f64)) {
        let VirtualBiasParameters { interval: h, acceleration: alpha, bias_walk: beta, .. } = self.parameters;
        for axis in 0..3 {
            entry(axis, axis, alpha * h * h * h / 3.0);
            entry(axis + 3, axis, alpha * h * h / 2.0);
            entry(axis + 3, axis + 3, alpha * h);
        }
        for bias in KINEMATIC..KINEMATIC + 3 * self.satellites.len() {
            entry(bias, bias, h * beta);
        }
    }
}
