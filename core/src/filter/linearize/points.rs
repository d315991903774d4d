//! Integration points for N(0, I) in d dimensions, one after another.
//!
//! | rule | points, in this order | weights | number |
//! |---|---|---|---|
//! | cubature | √d e₁ … √d e_d, −√d e₁ … | 1/2d | 2d |
//! | unscented | 0, √(d+λ) e₁ …, −√(d+λ) e₁ … | λ/(d+λ), 1/2(d+λ) | 2d + 1 |
//! | Gauss–Hermite | all d-tuples of the roots of the probabilists' Heₘ, the last coordinate fastest | products | mᵈ |
//!
//! I. Arasaratnam & S. Haykin, *Cubature Kalman filters* (2009); E. A. Wan & R. van der Merwe, *The unscented Kalman filter
//! for nonlinear estimation* (2000), with λ = α²(d + κ) − d and the central covariance weight + 1 − α² + β; S. Särkkä,
//! *Bayesian Filtering and Smoothing* (2013), ch. 6. All sets are symmetric: Σ w ξ = 0 for both kinds of weights.

use super::{LinearizeError, MAX_INPUTS, Rule};

/// Roots and weights of Heₘ for m = 2…5, in closed form: ±√(3 ∓ √6) and ±√(5 ∓ √10) for m = 4, 5.
/// For m = 15, a reference rather than a rule for filters: Newton's method in 60 digits, wᵢ = (m − 1)!/(m Heₘ₋₁(xᵢ)²).
const HERMITE: [&[(f64, f64)]; 5] = [
    &[(-1.0, 0.5), (1.0, 0.5)],
    &[(-1.7320508075688772, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.7320508075688772, 1.0 / 6.0)],
    &[
        (-2.334414218338977, 0.04587585476806849),
        (-0.7419637843027259, 0.4541241452319315),
        (0.7419637843027259, 0.4541241452319315),
        (2.334414218338977, 0.04587585476806849),
    ],
    &[
        (-2.8569700138728056, 0.011257411327720688),
        (-1.355626179974266, 0.22207592200561263),
        (0.0, 8.0 / 15.0),
        (1.355626179974266, 0.22207592200561263),
        (2.8569700138728056, 0.011257411327720688),
    ],
    &[
        (-6.363947888829839, 8.58964989963327e-10),
        (-5.190093591304781, 5.975419597920605e-7),
        (-4.1962077112690155, 5.642146405189017e-5),
        (-3.2890824243987664, 0.0015673575035499562),
        (-2.432436827009758, 0.017365774492137605),
        (-1.6067100690287297, 0.0894177953998444),
        (-0.799129068324548, 0.23246229360973222),
        (0.0, 0.31825951825951826),
        (0.799129068324548, 0.23246229360973222),
        (1.6067100690287297, 0.0894177953998444),
        (2.432436827009758, 0.017365774492137605),
        (3.2890824243987664, 0.0015673575035499562),
        (4.1962077112690155, 5.642146405189017e-5),
        (5.190093591304781, 5.975419597920605e-7),
        (6.363947888829839, 8.58964989963327e-10),
    ],
];

/// Weights of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// For means.
    pub mean: f64,
    /// For covariances.
    pub covariance: f64,
}

#[derive(Clone, Copy, Debug)]
enum Set {
    /// ±radius along each axis, after a centre if it has weights.
    Axes { radius: f64, centre: Option<Weights>, weight: f64 },
    /// A grid.
    Grid(&'static [(f64, f64)]),
}

/// The points of a rule; see [`Rule::points`].
#[derive(Clone, Copy, Debug)]
pub struct Points {
    set: Set,
    inputs: usize,
    index: usize,
}

impl Points {
    /// The points of `rule` in `inputs` dimensions, 1 to [`MAX_INPUTS`].
    pub(super) fn new(rule: Rule, inputs: usize) -> Result<Self, LinearizeError> {
        if inputs == 0 || inputs > MAX_INPUTS {
            return Err(LinearizeError::Inputs);
        }
        let d = inputs as f64;
        let set = match rule {
            Rule::Taylor => return Err(LinearizeError::Rule),
            Rule::Cubature => Set::Axes { radius: libm::sqrt(d), centre: None, weight: 0.5 / d },
            Rule::Unscented { alpha, beta, kappa } => {
                let spread = alpha * alpha * (d + kappa);
                let central = (spread - d) / spread;
                let centre = Weights { mean: central, covariance: central + 1.0 - alpha * alpha + beta };
                let weight = 0.5 / spread;
                if !(spread > 0.0 && weight.is_finite() && centre.covariance.is_finite()) {
                    return Err(LinearizeError::Rule);
                }
                Set::Axes { radius: libm::sqrt(spread), centre: Some(centre), weight }
            }
            Rule::GaussHermite { order } => {
                let grid = HERMITE.iter().find(|nodes| nodes.len() == order).ok_or(LinearizeError::Rule)?;
                Set::Grid(grid)
            }
        };
        Ok(Self { set, inputs, index: 0 })
    }

    /// How many points there are.
    pub fn count(&self) -> usize {
        match self.set {
            Set::Axes { centre, .. } => 2 * self.inputs + usize::from(centre.is_some()),
            Set::Grid(nodes) => (0..self.inputs).fold(1, |product, _| product * nodes.len()),
        }
    }

    /// Writes the next point into `xi` (d entries) and returns its weights; `None` after the last.
    pub fn next(&mut self, xi: &mut [f64]) -> Option<Weights> {
        if self.index >= self.count() {
            return None;
        }
        let i = self.index;
        self.index += 1;
        match self.set {
            Set::Axes { radius, centre, weight } => {
                xi.fill(0.0);
                let axis = match centre {
                    Some(centre) if i == 0 => return Some(centre),
                    Some(_) => i - 1,
                    None => i,
                };
                let sign = if axis < self.inputs { radius } else { -radius };
                if let Some(entry) = xi.get_mut(axis % self.inputs.max(1)) {
                    *entry = sign;
                }
                Some(Weights { mean: weight, covariance: weight })
            }
            Set::Grid(nodes) => {
                let mut weight = 1.0;
                let mut digits = i;
                for entry in xi.iter_mut().take(self.inputs).rev() {
                    let count = nodes.len().max(1);
                    let (node, w) = nodes.get(digits % count).copied()?;
                    digits /= count;
                    *entry = node;
                    weight *= w;
                }
                Some(Weights { mean: weight, covariance: weight })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: [Rule; 7] = [
        Rule::Cubature,
        Rule::Unscented { alpha: 1.0, beta: 2.0, kappa: 1.0 },
        Rule::Unscented { alpha: 0.5, beta: 2.0, kappa: 0.0 },
        Rule::GaussHermite { order: 2 },
        Rule::GaussHermite { order: 3 },
        Rule::GaussHermite { order: 4 },
        Rule::GaussHermite { order: 5 },
    ];

    /// Σ w f(ξ) with mean or covariance weights.
    fn integral(rule: Rule, d: usize, covariance: bool, f: impl Fn(&[f64]) -> f64) -> f64 {
        let mut points = rule.points(d).unwrap();
        let mut xi = vec![0.0; d];
        let mut sum = 0.0;
        while let Some(weights) = points.next(&mut xi) {
            sum += f(&xi) * if covariance { weights.covariance } else { weights.mean };
        }
        sum
    }

    /// Moments of N(0, I): weights add up to 1, all sets have mean 0 and covariance I.
    #[test]
    fn the_first_two_moments_are_those_of_the_normal_distribution() {
        for rule in RULES {
            for d in 1..=4 {
                assert!((integral(rule, d, false, |_| 1.0) - 1.0).abs() < 1e-14, "{rule:?}");
                for i in 0..d {
                    for j in 0..d {
                        let expected = f64::from(u8::from(i == j));
                        for covariance in [false, true] {
                            let product = integral(rule, d, covariance, |xi| xi[i] * xi[j]);
                            assert!((product - expected).abs() < 1e-14, "{rule:?} {d} {i} {j} {product}");
                            assert!(integral(rule, d, covariance, |xi| xi[i]).abs() < 1e-15);
                        }
                    }
                }
            }
        }
    }

    /// An m-point Gauss rule is exact to degree 2m − 1: E x^2k = 1·3·…·(2k − 1).
    #[test]
    fn gauss_hermite_is_exact_to_its_degree() {
        for order in [2, 3, 4, 5, 15] {
            let rule = Rule::GaussHermite { order };
            let mut moment = 1.0;
            for k in 1..order {
                moment *= (2 * k - 1) as f64;
                let computed = integral(rule, 2, false, |xi| xi[1].powi(2 * k as i32));
                assert!((computed / moment - 1.0).abs() < 1e-13, "{order} {k}");
            }
        }
    }

    #[test]
    fn impossible_rules_are_refused() {
        let unscented = |alpha, kappa| Rule::Unscented { alpha, beta: 2.0, kappa }.points(3).unwrap_err();
        assert_eq!(unscented(0.0, 0.0), LinearizeError::Rule);
        assert_eq!(unscented(1.0, -3.0), LinearizeError::Rule);
        assert_eq!(unscented(f64::NAN, 0.0), LinearizeError::Rule);
        for order in [0, 1, 6, 14, 16] {
            assert_eq!(Rule::GaussHermite { order }.points(3).unwrap_err(), LinearizeError::Rule);
        }
        assert_eq!(Rule::Cubature.points(0).unwrap_err(), LinearizeError::Inputs);
        assert_eq!(Rule::Cubature.points(MAX_INPUTS + 1).unwrap_err(), LinearizeError::Inputs);
        assert_eq!(Rule::Taylor.points(3).unwrap_err(), LinearizeError::Rule);
    }
}
