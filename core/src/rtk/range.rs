//! The range to a satellite as a function of the position error, the one thing that is not linear in this engine.
//!
//! ```text
//! ρ(δ) − ρ(0) = |d − δ| − |d| = δ·(δ − 2d)/(|d − δ| + |d|)        d = ρ e, from rover to satellite
//! ```
//! in this form without loss of digits. [`relinearize`] replaces the tangent by the statistical linearisation over the
//! predicted position ([`crate::filter::linearize`]): the mean moves by E ρ(δ) − ρ(0), the direction becomes the mean
//! slope, and the variance left over, Ω, adds to the noise. Ω is taken satellite by satellite: what satellites have in
//! common is left out, so that a prior beyond 1 km is better met by a new single point.
//!
//! Panic contract: none.

use super::link::Link;
use crate::filter::linearize::{Rule, Work, linearize};
use crate::linalg::{Mat, MatMut};
use crate::model::partially_linear::Nonlinear;
use nalgebra::{Matrix3, Vector3};

/// ρ(δ) − ρ(0) `[m]`.
struct RangeChange {
    /// d, from rover to satellite `[m]`.
    line: Vector3<f64>,
}

impl Nonlinear for RangeChange {
    fn inputs(&self) -> usize {
        3
    }

    fn outputs(&self) -> usize {
        1
    }

    fn evaluate(&self, u: &[f64], values: &mut [f64]) {
        let ([x, y, z], [value, ..]) = (u, values) else { return };
        let delta = Vector3::new(*x, *y, *z);
        let distance = libm::sqrt((self.line - delta).norm_squared()) + libm::sqrt(self.line.norm_squared());
        *value = delta.dot(&(delta - self.line * 2.0)) / distance;
    }

    fn gradient(&self, u: &[f64], _row: usize, gradient: &mut [f64]) {
        let [x, y, z] = u else { return };
        let to_satellite = self.line - Vector3::new(*x, *y, *z);
        let norm = libm::sqrt(to_satellite.norm_squared());
        for (slope, component) in gradient.iter_mut().zip(to_satellite.iter()) {
            *slope = -component / norm;
        }
    }
}

/// Linearises the ranges of all links by `rule` over a position error of the given covariance `[m²]`. Nothing changes
/// where the covariance is none.
pub(super) fn relinearize(links: &mut [Link], rule: Rule, covariance: &Matrix3<f64>) {
    if rule == Rule::Taylor {
        // Links are linearised there already.
        return;
    }
    let symmetric: [f64; 9] = core::array::from_fn(|k| covariance[(k / 3, k % 3)]);
    for link in links {
        let range = RangeChange { line: link.direction * link.range };
        let (mut change, mut slope, mut omega) = ([0.0], [0.0; 3], [0.0]);
        let (mut values, mut reference, mut samples) = ([0.0], [0.0], [0.0; 27]);
        let work = Work { values: &mut values, reference: &mut reference, samples: &mut samples };
        let done = (|| {
            let (mut slope, mut omega) = (MatMut::new(&mut slope, 1, 3, 3).ok()?, MatMut::square(&mut omega, 1).ok()?);
            let covariance = Mat::square(&symmetric, 3).ok()?;
            linearize(rule, &range, &[0.0; 3], covariance, &mut change, &mut slope, &mut omega, work).ok()
        })();
        if done.is_some() {
            let ([change], [omega], [x, y, z]) = (change, omega, slope);
            link.direction = -Vector3::new(x, y, z);
            link.code = link.code.map(|residual| residual - change);
            link.phase = link.phase.map(|residual| residual - change);
            link.code_variance += omega;
            link.phase_variance += omega;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against |d − δ| − |d| in 2·10⁷ m, where the plain difference has 4 nm steps.
    #[test]
    fn change_and_gradient_are_those_of_the_range() {
        let range = RangeChange { line: Vector3::new(1.2e7, -0.9e7, 1.4e7) };
        let change = |u: [f64; 3]| {
            let mut value = [0.0];
            range.evaluate(&u, &mut value);
            value[0]
        };
        let delta = [30.0, -40.0, 25.0];
        let plain = (range.line - Vector3::from(delta)).norm() - range.line.norm();
        assert!((change(delta) - plain).abs() < 2e-8);
        let mut gradient = [0.0; 3];
        range.gradient(&delta, 0, &mut gradient);
        for axis in 0..3 {
            let (mut up, mut down) = (delta, delta);
            up[axis] += 10.0;
            down[axis] -= 10.0;
            assert!((gradient[axis] - (change(up) - change(down)) / 20.0).abs() < 1e-8);
        }
    }

    /// The second-order mean of a range across its direction is tr(P − e eᵀ P)/2ρ: 1 km² · 2/(2 · 2e7 m) = 0.05 m.
    #[test]
    fn a_kilometre_bends_a_range_by_centimetres() {
        let range = RangeChange { line: Vector3::new(0.0, 0.0, 2e7) };
        let (mut change, mut slope, mut omega) = ([0.0], [0.0f64; 3], [0.0f64]);
        let (mut values, mut reference, mut samples) = ([0.0], [0.0], [0.0; 27]);
        linearize(
            Rule::GaussHermite { order: 3 },
            &range,
            &[0.0; 3],
            Mat::square(&[1e6, 0.0, 0.0, 0.0, 1e6, 0.0, 0.0, 0.0, 1e6], 3).unwrap(),
            &mut change,
            &mut MatMut::new(&mut slope, 1, 3, 3).unwrap(),
            &mut MatMut::square(&mut omega, 1).unwrap(),
            Work { values: &mut values, reference: &mut reference, samples: &mut samples },
        )
        .unwrap();
        assert!((change[0] - 0.05).abs() < 1e-6 && (slope[2] + 1.0).abs() < 1e-6, "{change:?} {slope:?}");
        // Var of (x² + y²)/2ρ with x, y of 1 km: 2 · 2 · 1e12/(4 · 4e14).
        assert!((omega[0] - 0.0025).abs() < 1e-6, "{omega:?}");
    }
}
