//! Whether to believe integers that were found.
//!
//! Two questions, both to be answered yes. Beforehand: is the model strong enough, that is the success rate at least
//! P₀? Afterwards: do the data prefer the best candidate clearly over the second?
//!
//! * ratio test: ‖ǎ₂‖² / ‖ǎ₁‖² ≥ R. H.-J. Euler & B. Schaffrin (1991); R between 1.5 and 3 in use, 3 is RTKLIB's
//!   default. A fixed R has no fixed failure rate: strong models reject too much with it, weak ones too little
//!   which is why the success rate is tested too; [`super::failure_rate`] computes R for a tolerated failure rate.
//! * difference test: ‖ǎ₂‖² − ‖ǎ₁‖² ≥ δ. C. C. J. M. Tiberius & P. de Jonge (1995) use δ of about 10…15.

use super::resolve::{Method, Resolution};
use super::success_rate::Probability;
use crate::real::Real;

/// Whether ‖ǎ₂‖² ≥ R ‖ǎ₁‖². Never for norms that are not numbers or are equal.
pub fn ratio_test<T: Real>(best_norm: T, second_norm: T, threshold: T) -> bool {
    second_norm > best_norm && second_norm >= threshold * best_norm
}

/// Whether ‖ǎ₂‖² − ‖ǎ₁‖² ≥ δ. Never for norms that are not numbers.
pub fn difference_test<T: Real>(best_norm: T, second_norm: T, threshold: T) -> bool {
    second_norm - best_norm >= threshold
}

/// What a fix has to satisfy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Least bootstrapped success rate P₀ (default 0.999).
    pub success_rate: f64,
    /// Least ratio of squared norms (default 3).
    pub ratio: f64,
    /// Least difference of squared norms (default 0: not tested).
    pub difference: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self { success_rate: 0.999, ratio: 3.0, difference: 0.0 }
    }
}

/// Outcome of the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Integers may be used as if known.
    Accepted,
    /// The model is too weak: success rate below P₀.
    LowSuccessRate,
    /// The search gave up, so that the candidates say nothing about each other.
    SearchExhausted,
    /// The second candidate is nearly as good as the best, by the ratio test.
    LowRatio,
    /// The second candidate is nearly as good as the best, by the difference test.
    LowDifference,
}

impl Thresholds {
    /// Applies all tests, the first that fails decides.
    pub fn decide<T: Real>(&self, success_rate: Probability, method: Method, best_norm: T, second_norm: T) -> Decision {
        let (best, second) = (best_norm.to_f64(), second_norm.to_f64());
        if success_rate.success.is_nan() || success_rate.success < self.success_rate {
            Decision::LowSuccessRate
        } else if method == Method::Bootstrapped {
            Decision::SearchExhausted
        } else if !ratio_test(best, second, self.ratio) {
            Decision::LowRatio
        } else if !difference_test(best, second, self.difference) {
            Decision::LowDifference
        } else {
            Decision::Accepted
        }
    }
}

impl<T: Real> Resolution<'_, T> {
    /// Whether these integers may be used as if known.
    pub fn decide(&self, thresholds: &Thresholds) -> Decision {
        thresholds.decide(self.success_rate, self.method, self.best_norm, self.second_norm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(success: f64) -> Probability {
        Probability { success, failure: 1.0 - success }
    }

    #[test]
    fn the_first_test_that_fails_decides() {
        let thresholds = Thresholds { difference: 10.0, ..Thresholds::default() };
        let decide = |success, method, best: f64, second| thresholds.decide(model(success), method, best, second);
        let (ils, bootstrapped) = (Method::LeastSquares, Method::Bootstrapped);
        assert_eq!(decide(0.9995, ils, 5.0, 20.0), Decision::Accepted);
        assert_eq!(decide(0.5, bootstrapped, 5.0, 20.0), Decision::LowSuccessRate);
        assert_eq!(decide(f64::NAN, ils, 5.0, 20.0), Decision::LowSuccessRate);
        assert_eq!(decide(0.9995, bootstrapped, 5.0, 20.0), Decision::SearchExhausted);
        assert_eq!(decide(0.9995, ils, 10.0, 29.9), Decision::LowRatio);
        assert_eq!(decide(0.9995, ils, 1.0, 10.9), Decision::LowDifference);
        assert_eq!(decide(0.9995, ils, f64::NAN, 20.0), Decision::LowRatio);
        assert_eq!(decide(0.9995, ils, 0.0, 0.0), Decision::LowRatio);
        assert_eq!(decide(0.9995, ils, 0.0, 12.0), Decision::Accepted);
    }
}
