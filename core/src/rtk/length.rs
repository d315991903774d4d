//! A baseline of known length, as two antennas on one vehicle have it ([`BaselineLength`]).
//!
//! b = r_r − r_b at the instant of the base, L its known length with standard deviation σ:
//! * validate: integers whose vector has another length, ‖b‖ − L beyond [`SIGMAS`] standard deviations (of b along itself,
//!   and σ), are refused.
//! * measure: the relaxed density takes the row
//!   ```text
//!   L − ‖b̂‖ = uᵀ δ + e,   u = b̂/‖b̂‖,   var e = σ² + uᵀ C u + (tr P⊥/2L)² + tr(P⊥²)/2L²
//!   ```
//!   with P⊥ = (I − uuᵀ)(P + C)(I − uuᵀ), C the covariance of what the rover moved between both instants,
//!   after the observations of the epoch. The last two terms are mean and variance of the length's second order in what lies
//!   across it (Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, sec. 10.3.2);
//!   the mean counts as variance and not as a correction, because its sign is another one for a prior than for an error. While √tr(P⊥) exceeds
//!   [`MAX_ANGLE`] L the direction is not known well enough, and the row is left out; so is one that contradicts the density
//!   beyond the outlier threshold. An error of L is the same in all epochs, but counts as news in each: σ should say how well
//!   L is known, and be small against a wavelength.
//!
//! Panic contract: none.

use super::RtkFilter;
use super::config::{BaselineLength, LengthUse};
use crate::filter::common_term::Difference;
use crate::gnss::solution::Solution;
use crate::gnss::time::GpsTime;
use crate::spp::SinglePoint;
use nalgebra::{Matrix3, Vector3};

/// Standard deviations that a length may differ from the known one (1 in 16 000 right ones do).
const SIGMAS: f64 = 4.0;
/// Largest standard deviation across the baseline for a row of its length, in lengths.
const MAX_ANGLE: f64 = 0.35;

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// The vector of a rover position, and the covariance that bringing it to the instant of the base adds.
    fn vector(
        &self,
        time: GpsTime,
        position: Vector3<f64>,
        single: Option<&SinglePoint>,
    ) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (carried, spread) = self.carried(time, single).unwrap_or_default();
        Some((position - carried - self.base_position?, spread))
    }

    /// Whether the length of a fixed vector is the known one, if that is to be validated.
    pub(super) fn has_length(&self, solution: &Solution, single: Option<&SinglePoint>) -> bool {
        let Some(known) = self.config.baseline_length.filter(|known| known.usage == LengthUse::Validate) else {
            return true;
        };
        let Some((vector, spread)) = self.vector(solution.time, solution.position, single) else { return true };
        let (length, along) = along(&vector, &(solution.position_covariance + spread));
        libm::fabs(length - known.length) <= SIGMAS * libm::sqrt(along + known.sigma * known.sigma)
    }

    /// Takes the known length as a measurement, if it is one.
    pub(super) fn measure_length(&mut self, time: GpsTime, single: Option<&SinglePoint>) {
        let Some(known) = self.config.baseline_length.filter(|known| known.usage == LengthUse::Measure) else { return };
        let Some((vector, carried)) = self.vector(time, self.position, single) else { return };
        let covariance = Matrix3::from_fn(|i, j| self.density.covariance(i, j));
        let Some((direction, value, variance)) = length_row(&known, &vector, &(covariance + carried)) else { return };
        let along = |covariance: &Matrix3<f64>| (direction.transpose() * covariance * direction)[(0, 0)].max(0.0);
        // What carrying adds along the vector is noise of the row: the density does not have it.
        let variance = variance + along(&carried);
        let spread = along(&covariance) + variance;
        if value * value > self.config.screening.outlier * self.config.screening.outlier * spread {
            return;
        }
        let Self { density, update_work, config, .. } = self;
        let n = density.dim();
        let mut row = [0.0; N];
        row.iter_mut().zip(direction.iter()).for_each(|(entry, &u)| *entry = u);
        // A row that the density cannot take leaves it as it was.
        let _ = density.update(config.estimation.form, update_work, |stage, mean| {
            Difference { row: row.get(..n).unwrap_or_default(), measurement: value, variance }.update(stage, mean)
        });
        self.absorb_position();
    }
}

/// Length of a vector and its variance `[m²]`.
fn along(vector: &Vector3<f64>, covariance: &Matrix3<f64>) -> (f64, f64) {
    let length = vector.norm();
    let direction = vector / length.max(f64::MIN_POSITIVE);
    (length, (direction.transpose() * covariance * direction)[(0, 0)].max(0.0))
}

/// Direction, value and variance of the row of a known length; `None` where it cannot be linearised.
fn length_row(
    known: &BaselineLength,
    vector: &Vector3<f64>,
    covariance: &Matrix3<f64>,
) -> Option<(Vector3<f64>, f64, f64)> {
    let length = vector.norm();
    let direction = vector / length;
    let off = Matrix3::identity() - direction * direction.transpose();
    let across = off * covariance * off;
    let sure = across.trace() <= MAX_ANGLE * MAX_ANGLE * known.length * known.length && length > 0.5 * known.length;
    let value = known.length - length;
    let mean = across.trace() / (2.0 * known.length);
    let curvature = mean * mean + (across * across).trace() / (2.0 * known.length * known.length);
    (sure && value.is_finite()).then_some((direction, value, known.sigma * known.sigma + curvature))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 m east, 0.1 m across in both directions: of second order the length is longer by 0.02/4 m, and varies by
    /// √(2·1e-4/8) m.
    #[test]
    fn a_length_to_second_order() {
        let known = BaselineLength { length: 2.0, sigma: 0.01, usage: LengthUse::Measure };
        let covariance = Matrix3::from_diagonal(&Vector3::new(4e-4, 1e-2, 1e-2));
        let (direction, value, variance) = length_row(&known, &Vector3::new(2.1, 0.0, 0.0), &covariance).unwrap();
        assert_eq!(direction, Vector3::x());
        assert!(
            (value + 0.1).abs() < 1e-12 && (variance - (1e-4 + 2.5e-5 + 2.5e-5)).abs() < 1e-15,
            "{value} {variance}"
        );
        let (length, variance) = along(&Vector3::new(2.1, 0.0, 0.0), &covariance);
        assert_eq!((length, variance), (2.1, 4e-4));
        // 0.5 m across of 2 m is more than 0.35 of it in all.
        assert!(length_row(&known, &Vector3::new(2.1, 0.0, 0.0), &(covariance * 25.0)).is_none());
        assert!(length_row(&known, &Vector3::zeros(), &covariance).is_none());
        assert!(length_row(&known, &Vector3::new(f64::NAN, 0.0, 1.0), &covariance).is_none());
    }
}
