//! Finding the observations that contradict the rest, before any of them touches the filter.
//!
//! Innovations νᵢ of one kind (all phases, or all codes) follow
//!
//! ```text
//! νᵢ = c_g(i) + gᵢ·δ + eᵢ,   δ ~ N(0, Λ⁻¹),   eᵢ ~ N(0, σᵢ²) independent,   c_g free
//! ```
//!
//! with the position error δ `[m]`, a free common term c for each group g (the receiver clock, and for phases the
//! ambiguity of the reference satellite) and the row gᵢ = ∂ν/∂δ. Weighted least squares gives residuals vᵢ and their
//! standard deviations; the largest normalised residual |vᵢ|/σ(vᵢ) (the w-test of Baarda 1968; equal to the
//! S⁻¹-weighted slip estimate over all rows) beyond a threshold marks its observation, and the rest is solved again. The
//! most likely size of the error is vᵢ·σᵢ²/σ²(vᵢ).
//!
//! Because every satellite is a row of its own, the reference satellite of a double difference is found like any other.
//!
//! Cost: O(rounds · n); bounded by one round per row. Panic contract: none.

use nalgebra::{Matrix3, Vector3};

/// One innovation to be screened.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// gᵢ = ∂ν/∂δ.
    pub gradient: Vector3<f64>,
    /// Index of the group with a common free term, below [`MAX_GROUPS`].
    pub group: usize,
    /// νᵢ `[m]`.
    pub innovation: f64,
    /// σᵢ² `[m²]`.
    pub variance: f64,
    /// Excluded: not used, and not examined. Set by [`screen`] on outliers.
    pub excluded: bool,
    /// Estimated error `[m]` of an excluded row; 0 for the others.
    pub error: f64,
}

/// Most groups of a call of [`screen`].
pub const MAX_GROUPS: usize = 16;

/// How a screening ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Screened {
    /// Rows found to contradict the rest.
    pub outliers: usize,
    /// Weighted sum of squared residuals of the rows that remain, including the prior of δ.
    pub chi_square: f64,
    /// Its degrees of freedom: rows that remain less groups (δ has a prior and costs none).
    pub degrees_of_freedom: usize,
    /// δ by the rows that remain and its prior `[m]`.
    pub delta: Vector3<f64>,
    /// Its covariance `[m²]`.
    pub covariance: Matrix3<f64>,
}

/// Weighted means of the rows of each group.
#[derive(Clone, Copy)]
struct Group {
    weight: f64,
    gradient: Vector3<f64>,
    innovation: f64,
}

/// The groups by their index.
struct Groups([Group; MAX_GROUPS]);

impl Groups {
    /// The group of a row. The index of a row that is not excluded is below [`MAX_GROUPS`].
    fn of(&self, row: &Row) -> &Group {
        &self.0[row.group % MAX_GROUPS]
    }
}

/// Marks the rows whose normalised residual exceeds `threshold`, one at a time, the worst first. `information` is Λ
/// `[1/m²]`, zero where nothing is known of δ. A group left with one row cannot contradict anything.
pub fn screen(rows: &mut [Row], information: &Matrix3<f64>, threshold: f64) -> Screened {
    let mut outcome = Screened::default();
    for row in rows.iter_mut() {
        let usable = row.group < MAX_GROUPS && row.innovation.is_finite() && row.variance > 0.0;
        row.excluded |= !usable;
        row.error = 0.0;
    }
    for _ in 0..=rows.len() {
        let groups = group_means(rows);
        let Some((delta, covariance)) = solve(rows, &groups, information) else { break };
        (outcome.delta, outcome.covariance) = (delta, covariance);
        let mut worst: Option<(usize, f64, f64)> = None;
        outcome.chi_square = (delta.transpose() * information * delta)[0];
        outcome.degrees_of_freedom = 0;
        for (i, row) in rows.iter().enumerate().filter(|(_, row)| !row.excluded) {
            let group = groups.of(row);
            let g = row.gradient - group.gradient;
            let residual = row.innovation - group.innovation - g.dot(&delta);
            let variance = row.variance - 1.0 / group.weight - g.dot(&(covariance * g));
            outcome.chi_square += residual * residual / row.variance;
            outcome.degrees_of_freedom += 1;
            // Without redundancy the residual is zero by construction and says nothing.
            if variance > 1e-6 * row.variance {
                let normalised = libm::fabs(residual) / libm::sqrt(variance);
                if worst.is_none_or(|(_, most, _)| normalised > most) {
                    worst = Some((i, normalised, residual * row.variance / variance));
                }
            }
        }
        outcome.degrees_of_freedom -=
            groups.0.iter().filter(|group| group.weight > 0.0).count().min(outcome.degrees_of_freedom);
        match worst {
            Some((i, normalised, error)) if normalised > threshold => {
                if let Some(row) = rows.get_mut(i) {
                    row.excluded = true;
                    row.error = error;
                }
                outcome.outliers += 1;
            }
            _ => break,
        }
    }
    outcome
}

fn group_means(rows: &[Row]) -> Groups {
    let mut groups = Groups([Group { weight: 0.0, gradient: Vector3::zeros(), innovation: 0.0 }; MAX_GROUPS]);
    for row in rows.iter().filter(|row| !row.excluded) {
        let (group, weight) = (&mut groups.0[row.group % MAX_GROUPS], 1.0 / row.variance);
        group.weight += weight;
        group.gradient += row.gradient * weight;
        group.innovation += row.innovation * weight;
    }
    for group in groups.0.iter_mut().filter(|group| group.weight > 0.0) {
        group.gradient /= group.weight;
        group.innovation /= group.weight;
    }
    groups
}

/// δ and its covariance; without rows, the prior.
fn solve(rows: &[Row], groups: &Groups, information: &Matrix3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    // A weak prior (1000 km) keeps the normal matrix regular when there are too few rows.
    let mut normal = information + Matrix3::identity() * 1e-12;
    let mut right = Vector3::zeros();
    for row in rows.iter().filter(|row| !row.excluded) {
        let group = groups.of(row);
        let g = row.gradient - group.gradient;
        normal += g * g.transpose() / row.variance;
        right += g * ((row.innovation - group.innovation) / row.variance);
    }
    let covariance = normal.try_inverse()?;
    Some((covariance * right, covariance))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nine satellites spread over the sky, two groups with clocks of their own, a position error and small noise.
    fn sky() -> Vec<Row> {
        let delta = Vector3::new(0.4, -0.7, 0.2);
        (0..9)
            .map(|i| {
                let (azimuth, elevation) = (i as f64 * 2.4, 0.3 + 0.13 * i as f64);
                let gradient =
                    -Vector3::new(elevation.cos() * azimuth.sin(), elevation.cos() * azimuth.cos(), elevation.sin());
                let clock = [12.0, -7.0][i % 2];
                let noise = 0.004 * ((i * 7 % 5) as f64 - 2.0) / 2.0;
                let innovation = gradient.dot(&delta) + clock + noise;
                Row { gradient, group: i % 2, innovation, variance: 0.005f64.powi(2), excluded: false, error: 0.0 }
            })
            .collect()
    }

    #[test]
    fn a_consistent_sky_passes() {
        let outcome = screen(&mut sky(), &Matrix3::zeros(), 4.0);
        assert_eq!((outcome.outliers, outcome.degrees_of_freedom), (0, 7));
        assert!(outcome.chi_square < 7.0);
    }

    #[test]
    fn two_slips_are_found_with_their_sizes() {
        let mut rows = sky();
        rows[0].innovation += 0.19;
        rows[5].innovation -= 0.38;
        let outcome = screen(&mut rows, &Matrix3::identity(), 4.0);
        let marked: Vec<usize> = (0..9).filter(|&i| rows[i].excluded).collect();
        assert_eq!((outcome.outliers, marked), (2, vec![0, 5]));
        assert!((rows[0].error - 0.19).abs() < 0.03 && (rows[5].error + 0.38).abs() < 0.03);
    }

    #[test]
    fn without_redundancy_nothing_is_marked_and_nan_is_left_out() {
        let mut rows = sky();
        rows.truncate(4);
        rows[1].innovation = f64::NAN;
        rows[2].innovation += 100.0;
        let outcome = screen(&mut rows, &Matrix3::zeros(), 4.0);
        assert_eq!(outcome.outliers, 0);
        assert!(rows[1].excluded && !rows[2].excluded);
        assert_eq!(screen(&mut [], &Matrix3::zeros(), 4.0).degrees_of_freedom, 0);
    }
}
