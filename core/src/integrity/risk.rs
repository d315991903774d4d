//! Integrity risk, how it is divided, and how many standard deviations it comes to.
//!
//! The risk I that an error exceeds its protection level is divided into the share of a wrong fix, P_IF, and the rest:
//! ```text
//! I = p (1 − P_IF) + P_IF     →     p = (I − P_IF)/(1 − P_IF)                    (Wang et al. 2022, eq. 31)
//! ```
//! p is the probability that, given right integers, the error of a normal distribution exceeds K standard deviations:
//! in one dimension p = P(|N| > K). In the plane the covariance has semi-axes a ≥ b, and the distance exceeds R with
//! ```text
//! p = 1/(2π) ∫ exp(−R²/(2 g(θ))) dθ,   g = a² cos²θ + b² sin²θ,   R = K √(a² + b²)
//! ```
//! so that K depends on b/a: from that of one dimension at b = 0, which is the largest, to √(−ln p) at b = a. (The paper
//! takes the first; Rayleigh's K/√2 on √(a² + b²), which is also in use, holds for circles only and is too small for all
//! else.)
//!
//! Cost: one quantile, or about ten integrals of [`NODES`] `exp` each. No panics.

use crate::stats::normal;

/// Nodes of the trapezium rule over a quarter of the circle. The integrand is smooth and periodic: it converges
/// exponentially.
pub const NODES: u32 = 96;
/// Newton steps for K.
const STEPS: u32 = 60;

/// How the integrity risk is divided.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Allocation {
    /// Probability, for each epoch, that an error exceeds its protection level, horizontal or vertical.
    pub risk: f64,
    /// Part of it that is left to wrong integers, P_IF.
    pub wrong_fix: f64,
    /// Share of the risk that is for the vertical component; the rest is for the horizontal one.
    pub vertical_share: f64,
}

impl Allocation {
    /// The risk of the paper's table, 1e-7 with 1e-8 for wrong integers, for each of horizontal and vertical.
    pub const DEFAULT: Self = Self { risk: 2e-7, wrong_fix: 2e-8, vertical_share: 0.5 };
}

impl Default for Allocation {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Why an allocation cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AllocationError {
    /// The risk is not above 0 and below 1.
    Risk,
    /// The part for wrong integers is below 0, or not smaller than the risk.
    WrongFix,
    /// The share of the vertical component is not above 0 and below 1.
    VerticalShare,
}

impl core::fmt::Display for AllocationError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Risk => "the integrity risk is a probability: give a number above 0 and below 1",
            Self::WrongFix => {
                "the risk of wrong integers is a part of the integrity risk: give a number from 0 to below it"
            }
            Self::VerticalShare => "the vertical share of the risk is a fraction: give a number above 0 and below 1",
        })
    }
}

impl core::error::Error for AllocationError {}

/// p of the horizontal and of the vertical component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// Of the distance in the plane.
    pub horizontal: f64,
    /// Of the vertical component.
    pub vertical: f64,
}

impl Allocation {
    /// Whether these numbers make sense together.
    pub fn check(&self) -> Result<(), AllocationError> {
        let is_fraction = |x: f64| x > 0.0 && x < 1.0;
        if !is_fraction(self.risk) {
            return Err(AllocationError::Risk);
        }
        if !(self.wrong_fix >= 0.0 && self.wrong_fix < self.risk) {
            return Err(AllocationError::WrongFix);
        }
        if !is_fraction(self.vertical_share) {
            return Err(AllocationError::VerticalShare);
        }
        Ok(())
    }

    /// p of both components, for right integers (eq. 31 for each). A wrong fix spoils both: each has its share of P_IF.
    pub fn split(&self) -> Result<Split, AllocationError> {
        self.check()?;
        let of = |share: f64| given_right_integers(share * self.risk, share * self.wrong_fix);
        Ok(Split { horizontal: of(1.0 - self.vertical_share), vertical: of(self.vertical_share) })
    }
}

/// p = (I − P_IF)/(1 − P_IF).
pub fn given_right_integers(risk: f64, wrong_fix: f64) -> f64 {
    (risk - wrong_fix) / (1.0 - wrong_fix)
}

/// K with P(|N(0, 1)| > K) = p. ∞ at 0, 0 at 1, NaN outside.
pub fn one_dimension(p: f64) -> f64 {
    normal::upper_quantile(0.5 * p)
}

/// K with P(distance > K √(a² + b²)) = p, where the semi-axes have the ratio b/a (taken within 0 and 1). NaN for p
/// outside (0, 1] and for a NaN.
pub fn two_dimensions(p: f64, ratio: f64) -> f64 {
    if !(p > 0.0 && p <= 1.0) || ratio.is_nan() {
        return f64::NAN;
    }
    if p == 1.0 {
        return 0.0;
    }
    let ratio = ratio.clamp(0.0, 1.0);
    let one = one_dimension(p);
    if ratio == 0.0 {
        return one;
    }
    // K lies between those of line and circle, or, for p near 1, not far from them.
    let circle = libm::sqrt(-libm::log(p));
    let (mut low, mut high) = (0.0, 2.0 * one.max(circle));
    let target = libm::log(p);
    let mut k = one;
    for _ in 0..STEPS {
        let (tail, slope) = planar_tail(k, ratio);
        let excess = libm::log(tail) - target;
        if excess > 0.0 {
            low = k;
        } else {
            high = k;
        }
        let newton = k - excess * tail / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - k).abs() <= 1e-15 * k {
            return next;
        }
        k = next;
    }
    k
}

/// P(distance > K √(a² + b²)) for semi-axes 1 and `ratio`, and its derivative by K.
pub fn planar_tail(k: f64, ratio: f64) -> (f64, f64) {
    let sum = 1.0 + ratio * ratio;
    let half = 0.5 * k * k * sum;
    let (mut tail, mut slope) = (0.0, 0.0);
    for i in 0..=NODES {
        let (sin, cos) = libm::sincos(core::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(NODES));
        let g = cos * cos + ratio * ratio * sin * sin;
        let weight = if i == 0 || i == NODES { 0.5 } else { 1.0 };
        let value = if g > 0.0 { weight * libm::exp(-half / g) } else { 0.0 };
        tail += value;
        slope -= if g > 0.0 { value * k * sum / g } else { 0.0 };
    }
    (tail / f64::from(NODES), slope / f64::from(NODES))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// P(|N| > 1.959963984540054) = 0.05 (tables of the normal distribution); 5.345837 for the paper's table
    /// (I = 1e-7, P_IF = 1e-8), which prints 5.3457.
    #[test]
    fn factors_by_table() {
        assert!((one_dimension(0.05) - 1.959_963_984_540_054).abs() < 1e-14);
        let p = given_right_integers(1e-7, 1e-8);
        assert!((p - 9.000_000_09e-8).abs() < 1e-22);
        assert!((one_dimension(p) - 5.345_837_350_732_903).abs() < 1e-12);
        let split = Allocation::default().split().unwrap();
        assert!((split.vertical / p - 1.0).abs() < 1e-15 && split.vertical == split.horizontal);
    }

    /// A circle: Rayleigh, P(r > R) = exp(−R²/(2σ²)) with R = K √2 σ. A line: one dimension.
    #[test]
    fn the_plane_between_line_and_circle() {
        for p in [0.3, 1e-3, 1e-7, 1e-12] {
            assert!((two_dimensions(p, 1.0) - libm::sqrt(-libm::log(p))).abs() < 1e-12);
            assert_eq!(two_dimensions(p, 0.0), one_dimension(p));
            assert!((two_dimensions(p, 1e-3) - one_dimension(p)).abs() < 1e-4);
        }
        assert_eq!((two_dimensions(1.0, 0.5), one_dimension(1.0)), (0.0, 0.0));
        assert!(
            [two_dimensions(0.0, 0.5), two_dimensions(-1.0, 0.5), two_dimensions(0.1, f64::NAN)]
                .iter()
                .all(|k| k.is_nan())
        );
    }

    #[test]
    fn allocations_that_contradict_themselves_say_why() {
        let with = |risk, wrong_fix, vertical_share| Allocation { risk, wrong_fix, vertical_share }.split();
        for risk in [0.0, 1.0, -1e-3, f64::NAN, f64::INFINITY] {
            assert_eq!(with(risk, 0.0, 0.5), Err(AllocationError::Risk));
        }
        assert_eq!(with(1e-7, 1e-7, 0.5), Err(AllocationError::WrongFix));
        assert_eq!(with(1e-7, -1e-9, 0.5), Err(AllocationError::WrongFix));
        assert_eq!(with(1e-7, 1e-8, 1.0), Err(AllocationError::VerticalShare));
        assert_eq!(with(1e-7, 1e-8, 0.0), Err(AllocationError::VerticalShare));
        assert!(with(1e-7, 0.0, 0.3).is_ok());
    }

    proptest! {
        /// The larger the ratio, the smaller K (p up to 0.1), and the tail of K is p.
        #[test]
        fn factors_invert_the_tail(exponent in -12.0f64..-1.0, ratio in 0.01f64..1.0, more in 0.0f64..0.5) {
            let p = libm::exp10(exponent);
            let k = two_dimensions(p, ratio);
            prop_assert!((planar_tail(k, ratio).0 / p - 1.0).abs() < 1e-10);
            prop_assert!(two_dimensions(p, (ratio + more).min(1.0)) <= k + 1e-12);
            prop_assert!(k <= one_dimension(p) + 1e-12);
        }

        /// The slope is the derivative of the tail.
        #[test]
        fn the_slope_is_that_of_the_tail(k in 0.5f64..6.0, ratio in 0.05f64..1.0) {
            let h = 1e-5;
            let numeric = (planar_tail(k + h, ratio).0 - planar_tail(k - h, ratio).0) / (2.0 * h);
            let (_, slope) = planar_tail(k, ratio);
            prop_assert!((numeric / slope - 1.0).abs() < 1e-6, "{} {}", numeric, slope);
        }
    }
}
