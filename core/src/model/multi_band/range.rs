//! What is nonlinear in the multi-band model: M ρ(p) and −M ρ̇(p, v) of the rover, in double differences less the base's.
//!
//! ```text
//! ρ = |p − s|,  e = (p − s)/ρ,  ρ̇ = eᵀ(v − ṡ),  v = (0, 0, v^Z)
//! ∂ρ/∂p = e,   ∂ρ̇/∂p = (v − ṡ − e ρ̇)/ρ,   ∂ρ̇/∂v^Z = e_Z
//! ```
//! Ranges are formed as |s| + p·(p − 2s)/(|p − s| + |s|): of what depends on p nothing is lost by cancellation. Cost: two
//! square roots a satellite and position.

use super::{Layout, MultiBandModel, Satellite};
use crate::model::partially_linear::Nonlinear;
use nalgebra::Vector3;

/// |p − s| − |s| and the unit vector e from satellite to p, with |p − s| `[m]`.
fn sight(p: &Vector3<f64>, satellite: &Satellite) -> (f64, Vector3<f64>, f64) {
    let s = &satellite.position;
    let line = p - s;
    let distance = libm::sqrt(line.dot(&line));
    (p.dot(&(line - s)) / (distance + libm::sqrt(s.dot(s))), line / distance, distance)
}

impl MultiBandModel<'_> {
    /// Range and range rate of a satellite, less the base's if there is one.
    fn range(&self, satellite: &Satellite, p: &Vector3<f64>, v: &Vector3<f64>) -> [f64; 2] {
        let (excess, e, _) = sight(p, satellite);
        let rate = e.dot(&(v - satellite.velocity));
        match &self.base {
            Some(base) => {
                let (base_excess, base_e, _) = sight(base, satellite);
                [excess - base_excess, rate + base_e.dot(&satellite.velocity)]
            }
            None => [excess + libm::sqrt(satellite.position.dot(&satellite.position)), rate],
        }
    }
}

/// Position and velocity in z = (p^X, p^Y, p^Z, v^Z); zero where they are missing.
fn kinematics(z: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
    let entry = |i: usize| z.get(i).copied().unwrap_or_default();
    (Vector3::new(entry(0), entry(1), entry(2)), Vector3::new(0.0, 0.0, entry(3)))
}

/// ∂ρ/∂z or ∂ρ̇/∂z of one satellite.
fn slope(satellite: &Satellite, p: &Vector3<f64>, v: &Vector3<f64>, of_rate: bool) -> [f64; 4] {
    let (_, e, distance) = sight(p, satellite);
    if of_rate {
        let relative = v - satellite.velocity;
        let transverse = (relative - e * e.dot(&relative)) / distance;
        [transverse.x, transverse.y, transverse.z, e.z]
    } else {
        [e.x, e.y, e.z, 0.0]
    }
}

impl Nonlinear for MultiBandModel<'_> {
    fn inputs(&self) -> usize {
        Layout::Z.end
    }

    /// Differences of ranges, then those of range rates with the sign of Doppler.
    fn outputs(&self) -> usize {
        2 * self.layout().differences()
    }

    fn evaluate(&self, z: &[f64], values: &mut [f64]) {
        let Some((first, others)) = self.satellites.split_first() else { return };
        let (p, v) = kinematics(z);
        let [first_range, first_rate] = self.range(first, &p, &v);
        let (ranges, rates) = values.split_at_mut(values.len().min(others.len()));
        for ((satellite, range), rate) in others.iter().zip(ranges).zip(rates) {
            let [other_range, other_rate] = self.range(satellite, &p, &v);
            *range = first_range - other_range;
            *rate = other_rate - first_rate;
        }
    }

    fn gradient(&self, z: &[f64], row: usize, gradient: &mut [f64]) {
        let Some((first, others)) = self.satellites.split_first() else { return };
        let Some(other) = others.get(row % others.len().max(1)) else { return };
        let (p, v) = kinematics(z);
        let of_rate = row >= others.len();
        let sign = if of_rate { -1.0 } else { 1.0 };
        let (first, other) = (slope(first, &p, &v, of_rate), slope(other, &p, &v, of_rate));
        for ((entry, first), other) in gradient.iter_mut().zip(first).zip(other) {
            *entry = sign * (first - other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{SATELLITES, model};
    use super::*;

    #[test]
    fn gradients_are_the_slopes_of_the_function() {
        let z = [10.0, -20.0, 5.0, 0.4];
        for base in [None, Some(Vector3::new(-6000.0, 8000.0, 100.0))] {
            let model = model(base);
            for input in 0..4 {
                let step = 1.0;
                let shifted = |sign: f64| {
                    let mut z = z;
                    z[input] += sign * step;
                    let mut values = [0.0; 6];
                    model.evaluate(&z, &mut values);
                    values
                };
                let (plus, minus) = (shifted(1.0), shifted(-1.0));
                for row in 0..6 {
                    let mut gradient = [0.0; 4];
                    model.gradient(&z, row, &mut gradient);
                    let difference = (plus[row] - minus[row]) / (2.0 * step);
                    // Ranges of 2e7 m cancel to 4e-9 m in single differences.
                    assert!((gradient[input] - difference).abs() < 1e-8, "{input} {row}");
                }
            }
        }
    }

    /// The rate is the derivative of the range along the motion of rover and satellite.
    #[test]
    fn doppler_is_minus_the_derivative_of_the_range() {
        let base = Some(Vector3::new(-6000.0, 8000.0, 100.0));
        let moved =
            |t: f64| SATELLITES.map(|s| Satellite { position: s.position + s.velocity * t, velocity: s.velocity });
        let ranges = |t: f64| {
            let satellites = moved(t);
            let mut values = [0.0; 6];
            MultiBandModel { satellites: &satellites, ..model(base) }
                .evaluate(&[1.0, 2.0, 3.0 + 0.5 * t, 0.5], &mut values);
            values
        };
        let (before, now, after) = (ranges(-0.5), ranges(0.0), ranges(0.5));
        for i in 0..3 {
            assert!((now[3 + i] + (after[i] - before[i])).abs() < 1e-6, "{i}");
        }
    }

    #[test]
    fn no_satellites_no_values() {
        let model = MultiBandModel { satellites: &[], ..model(None) };
        let mut values = [7.0; 2];
        model.evaluate(&[], &mut values);
        model.gradient(&[], 0, &mut values);
        assert_eq!((values, model.outputs()), ([7.0; 2], 0));
    }
}
