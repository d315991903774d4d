//! Cycle-slip detection in the innovations of a filter whose ambiguities are states.
//!
//! If everything unexpected in δy = y − ŷ comes from jumps δn of the ambiguities, δy = G δn + noise, and
//! ```text
//! projection  δn = (Gᵀ G)⁻¹ Gᵀ δy                 (31), with the Gᵀ that the paper leaves out
//! weighted    δn = (Gᵀ S⁻¹ G)⁻¹ Gᵀ S⁻¹ δy          generalised least squares with the predicted S, without V
//! cᵢ = 1 if |δnᵢ| > d,    V = diag(cᵢ σ_jump² + (1 − cᵢ) σ_stay²)                    (32), (33c)
//! ```
//! Greiff et al. (CCTA 2021). G has rows for phases only, so that the projection is (y_Φ − ŷ_Φ)/λ and does not know how
//! uncertain the prediction is: with the numbers of Table I its standard deviation is 0.345 cycles, 92 % of it a bias walk
//! that the same epoch's virtual measurements reveal. The weighted estimate uses them: 0.17 cycles.
//!
//! With σ the standard deviation of δnᵢ, false alarms and detections have the probabilities
//! [`false_alarm_rate`] = 2 Q(d/σ) and [`detection_rate`] = Q((d − |s|)/σ).
//!
//! A slip on the *reference satellite* moves all differences by the same integer; [`common_jump`] recognises that.
//!
//! Shapes: G is m × n, m ≥ n. Cost 2 m n² multiply-adds, weighted m³/6 + m² n/2 more. Panic contract: none.

use crate::linalg::{LinalgError, MatMut, cholesky, projection, triangular};
use crate::real::Real;
use crate::stats::normal;

/// Writes the projection estimate of the jumps `[cycles]` into `estimate` (n).
///
/// `g` (m × n) and `factor` (n × n) are spoilt. [`LinalgError::Singular`] names the first ambiguity without a row of its
/// own.
pub fn project<T: Real>(
    g: &mut MatMut<'_, T>,
    innovation: &[T],
    factor: &mut MatMut<'_, T>,
    estimate: &mut [T],
) -> Result<(), LinalgError> {
    if g.rows() != innovation.len() || g.cols() != estimate.len() {
        return Err(LinalgError::Shape);
    }
    projection::orthogonalize(g, factor)?;
    projection::solve(g.as_ref(), factor.as_ref(), innovation, estimate)?;
    if estimate.iter().all(|estimate| estimate.is_finite()) { Ok(()) } else { Err(LinalgError::NotFinite) }
}

/// Writes the S⁻¹-weighted estimate of the jumps `[cycles]` into `estimate` (n).
///
/// `s` (m × m) is the predicted covariance of the innovations, of which the lower triangle is read. All other arguments
/// are spoilt; `s` returns its Cholesky factor.
pub fn project_weighted<T: Real>(
    g: &mut MatMut<'_, T>,
    innovation: &mut [T],
    s: &mut MatMut<'_, T>,
    factor: &mut MatMut<'_, T>,
    estimate: &mut [T],
) -> Result<(), LinalgError> {
    if s.rows() != innovation.len() {
        return Err(LinalgError::Shape);
    }
    cholesky::factor(s)?;
    triangular::forward(s.as_ref(), innovation)?;
    triangular::forward_rows(s.as_ref(), g)?;
    project(g, innovation, factor, estimate)
}

/// Whether an estimate exceeds the threshold, strictly (32).
pub fn jumped(estimate: f64, threshold: f64) -> bool {
    libm::fabs(estimate) > threshold
}

/// The standard deviation for an ambiguity's step (33c).
pub fn sigma(jumped: bool, sigma_jump: f64, sigma_stay: f64) -> f64 {
    if jumped { sigma_jump } else { sigma_stay }
}

/// Probability that an ambiguity which did not jump is flagged, 2 Q(d/σ).
pub fn false_alarm_rate(threshold: f64, sigma: f64) -> f64 {
    normal::two_sided_survival(threshold / sigma)
}

/// Probability that a jump of `slip` cycles is flagged, Q((d − |s|)/σ); the far side, below 1e-4 for |s| ≥ 1 and d ≥ 2 σ,
/// is left out.
pub fn detection_rate(threshold: f64, slip: f64, sigma: f64) -> f64 {
    normal::survival((threshold - libm::fabs(slip)) / sigma)
}

/// Estimates of a common jump differ from their mean by at most this `[cycles]`: three times the part that the references
/// do not share under Table I.
const AGREEMENT: f64 = 0.75;

/// The jump common to all ambiguities of one reference satellite, if their estimates look like one `[cycles]`.
///
/// It needs at least three, all of one size within `AGREEMENT`, a mean nearer to another integer than to 0, and a third
/// of them beyond `threshold`: without the last a common error of the prediction would pass for it.
pub fn common_jump<T: Real>(estimates: &[T], threshold: f64) -> Option<i64> {
    let n = estimates.len();
    if n < 3 {
        return None;
    }
    let estimates = || estimates.iter().map(|estimate| estimate.to_f64());
    let mean = estimates().sum::<f64>() / n as f64;
    let flagged = estimates().filter(|estimate| jumped(*estimate, threshold)).count();
    let agree = estimates().all(|estimate| libm::fabs(estimate - mean) <= AGREEMENT);
    let jump = libm::round(mean);
    let found = agree && 3 * flagged >= n && jump != 0.0 && libm::fabs(jump) < 1e15;
    found.then_some(jump as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates of the findings that rest on 24 simulated runs a row (σ = 0.345 and 0.170, b = 0.02 a step), within their
    /// sampling error.
    #[test]
    fn rates_are_those_of_the_simulation() {
        for (d, false_alarms, detections) in [
            (0.3, 0.387, 0.976),
            (0.5, 0.152, 0.922),
            (0.75, 0.032, 0.747),
            (1.0, 0.0041, 0.506),
            (1.25, 3.7e-4, 0.205),
        ] {
            assert!((false_alarm_rate(d, 0.345) - false_alarms).abs() < 0.12 * false_alarms + 1e-4, "{d}");
            assert!((detection_rate(d, 1.0, 0.345) - detections).abs() < 0.035, "{d}");
            assert_eq!(detection_rate(d, 1.0, 0.345), detection_rate(d, -1.0, 0.345));
        }
        assert!((false_alarm_rate(0.5, 0.170) - 0.0030).abs() < 4e-4);
        assert!((detection_rate(0.75, 1.0, 0.170) - 0.922).abs() < 0.02);
    }

    /// S = I makes the weighted estimate the plain one; a scaled row that is known better draws it.
    #[test]
    fn weights_matter_only_where_they_differ() {
        let g = [1.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        let estimate = |s: [f64; 9]| {
            let (mut g, mut s, mut r, mut x) = (g, s, [0.0; 4], [0.0; 2]);
            let mut innovation = [1.0, 1.0, 5.0];
            project_weighted(
                &mut MatMut::new(&mut g, 3, 2, 2).unwrap(),
                &mut innovation,
                &mut MatMut::square(&mut s, 3).unwrap(),
                &mut MatMut::square(&mut r, 2).unwrap(),
                &mut x,
            )
            .unwrap();
            x
        };
        let (mut q, mut r, mut x) = (g, [0.0; 4], [0.0; 2]);
        let mut q = MatMut::new(&mut q, 3, 2, 2).unwrap();
        project(&mut q, &[1.0, 1.0, 5.0], &mut MatMut::square(&mut r, 2).unwrap(), &mut x).unwrap();
        // Normal equations by hand: [2 1; 1 2] x = [6; 6].
        assert!(x.iter().all(|x| (x - 2.0).abs() < 1e-14));
        assert!(estimate([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]).iter().all(|x| (x - 2.0).abs() < 1e-14));
        let sum: f64 = estimate([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1e-9]).iter().sum();
        assert!((sum - 5.0).abs() < 1e-6);
    }

    #[test]
    fn an_ambiguity_without_a_row_is_named() {
        let (mut g, mut r, mut x) = ([1.0, 0.0, 1.0, 0.0], [0.0; 4], [0.0; 2]);
        let mut g = MatMut::square(&mut g, 2).unwrap();
        let outcome = project(&mut g, &[1.0, 1.0], &mut MatMut::square(&mut r, 2).unwrap(), &mut x);
        assert_eq!(outcome, Err(LinalgError::Singular { pivot: 1 }));
    }

    #[test]
    fn the_threshold_is_strict() {
        assert!(!jumped(1.0, 1.0) && jumped(-1.000_000_1, 1.0) && !jumped(f64::NAN, 1.0));
        assert_eq!((sigma(true, 10.0, 0.05), sigma(false, 10.0, 0.05)), (10.0, 0.05));
    }

    #[test]
    fn a_jump_of_the_reference_moves_all() {
        assert_eq!(common_jump(&[1.2, 0.7, 1.1, 0.9], 1.0), Some(1));
        assert_eq!(common_jump(&[-4.2, -3.7, -4.1, -3.9], 1.0), Some(-4));
        // One that does not follow, too few, none beyond the threshold, none at all.
        assert_eq!(common_jump(&[1.2, 0.7, 1.1, -0.1], 1.0), None);
        assert_eq!(common_jump(&[3.0, 3.0], 1.0), None);
        assert_eq!(common_jump(&[0.7, 0.7, 0.8, 0.9], 1.0), None);
        assert_eq!(common_jump(&[0.1, -0.1, 0.2], 1.0), None);
        assert_eq!(common_jump(&[f64::NAN, 2.0, 2.0], 1.0), None);
    }
}
