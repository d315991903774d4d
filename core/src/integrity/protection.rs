//! Protection levels from a covariance, and the status of an epoch.
//!
//! ```text
//! HPL = K_H √(P_EE + P_NN)      VPL = K_V √P_UU                      (Wang et al. 2022, eqs. 27 to 30)
//! ```
//! P: posterior covariance of the position error given the integers that were fixed (none for a float position), east,
//! north, up. Both are multiplied by what innovations say of the covariance ([`super::window::NisWindow`]).
//!
//! A fixed position presumes that its integers are right. [`Basis`] says when that may be presumed: where 1 − P_s ≤ P_IF,
//! or where a test of the data (ratio) accepted them; else the protection level is that of the float position.
//!
//! Cost: ten multiplications, two roots; the exact horizontal factor some thousand `exp`. No panics.

use super::fault;
use super::risk::{Allocation, AllocationError, Split, one_dimension, two_dimensions};
use nalgebra::Matrix3;

/// The factor for the horizontal protection level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum HorizontalFactor {
    /// That of one dimension: never too small, up to a third too large.
    #[default]
    OneDimension,
    /// That of the ellipse's axis ratio, exact.
    Exact,
}

/// When integers count as right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Rule {
    /// Where a test of the data accepted them, or 1 − P_s ≤ P_IF.
    #[default]
    Accepted,
    /// Only where 1 − P_s ≤ P_IF, as the allocation presumes.
    SuccessRate,
}

/// What protection levels need.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Config {
    /// The risk.
    pub allocation: Allocation,
    /// The horizontal factor.
    pub horizontal_factor: HorizontalFactor,
    /// When the protection level of a fixed position is that of right integers.
    pub rule: Rule,
    /// Alert limits, horizontal and vertical `[m]`; infinite for none.
    pub alert_limits: [f64; 2],
    /// Faults of one satellite of a fixed position.
    pub fault: fault::Config,
}

impl Config {
    /// The default allocation; alert limits of 1 m and 2 m.
    pub const DEFAULT: Self = Self {
        allocation: Allocation::DEFAULT,
        horizontal_factor: HorizontalFactor::OneDimension,
        rule: Rule::Accepted,
        alert_limits: [1.0, 2.0],
        fault: fault::Config::DEFAULT,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Why a [`Config`] cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// The risk does not add up.
    Allocation(AllocationError),
    /// An alert limit is not above 0.
    AlertLimit,
    /// P_fa or P_md is no probability.
    Fault,
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Allocation(error) => error.fmt(f),
            Self::AlertLimit => f.write_str("an alert limit is a distance: give metres above 0"),
            Self::Fault => f.write_str("fault.p_fa and fault.p_md are probabilities: give numbers above 0 and below 1"),
        }
    }
}

impl core::error::Error for ConfigError {}

impl Config {
    /// The factors for this configuration.
    pub fn factors(&self) -> Result<Factors, ConfigError> {
        let split = self.allocation.split().map_err(ConfigError::Allocation)?;
        if !self.fault.is_sound() {
            Err(ConfigError::Fault)
        } else if self.alert_limits.iter().all(|limit| *limit > 0.0) {
            Ok(Factors { split, one_dimension: [split.horizontal, split.vertical].map(one_dimension), config: *self })
        } else {
            Err(ConfigError::AlertLimit)
        }
    }
}

/// Protection levels `[m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Levels {
    /// HPL.
    pub horizontal: f64,
    /// VPL.
    pub vertical: f64,
}

/// What is known of an epoch's integrity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Status {
    /// Both protection levels are below their alert limits.
    Available,
    /// One of them is not, or a fault was detected that the exclusion of no satellite explains.
    Alert,
    /// There is no protection level: nothing watches this position.
    Unmonitored,
}

/// What a protection level of a fixed position rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Basis {
    /// The success rate alone: 1 − P_s ≤ P_IF.
    SuccessRate,
    /// A test of the data accepted the integers.
    Data,
    /// Neither: the float position counts.
    Float,
}

impl Basis {
    /// Of integers with the failure rate 1 − P_s that a test of the data `accepted` or not.
    pub fn of(failure: f64, wrong_fix: f64, accepted: bool, rule: Rule) -> Self {
        if failure <= wrong_fix {
            Self::SuccessRate
        } else if accepted && rule == Rule::Accepted {
            Self::Data
        } else {
            Self::Float
        }
    }
}

/// K factors of a configuration, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    split: Split,
    one_dimension: [f64; 2],
    config: Config,
}

impl Factors {
    /// Protection levels of a covariance, east, north, up `[m²]`, whose standard deviations are to be multiplied by
    /// `inflation` (at least 1). `None` if it is not finite or has negative variances.
    pub fn levels(&self, covariance: &Matrix3<f64>, inflation: f64) -> Option<Levels> {
        let (east, north, up) = (covariance[(0, 0)], covariance[(1, 1)], covariance[(2, 2)]);
        let sound = [east, north, up].iter().all(|variance| *variance >= 0.0 && variance.is_finite());
        if !sound || !covariance[(0, 1)].is_finite() || !inflation.is_finite() {
            return None;
        }
        let inflation = inflation.max(1.0);
        let [one, vertical] = self.one_dimension;
        let factor = match self.config.horizontal_factor {
            HorizontalFactor::OneDimension => one,
            HorizontalFactor::Exact => {
                two_dimensions(self.split.horizontal, axis_ratio(east, north, covariance[(0, 1)]))
            }
        };
        Some(Levels {
            horizontal: inflation * factor * libm::sqrt(east + north),
            vertical: inflation * vertical * libm::sqrt(up),
        })
    }

    /// The status of an epoch with these protection levels.
    pub fn status(&self, levels: Option<Levels>) -> Status {
        let [horizontal, vertical] = self.config.alert_limits;
        match levels {
            None => Status::Unmonitored,
            Some(levels) if levels.horizontal < horizontal && levels.vertical < vertical => Status::Available,
            Some(_) => Status::Alert,
        }
    }

    /// What a protection level rests on, of integers with the failure rate 1 − P_s that a test `accepted` or not.
    pub fn basis(&self, failure: f64, accepted: bool) -> Basis {
        Basis::of(failure, self.config.allocation.wrong_fix, accepted, self.config.rule)
    }
}

/// b/a of the ellipse of a covariance in the plane.
fn axis_ratio(xx: f64, yy: f64, xy: f64) -> f64 {
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let radius = libm::sqrt(half * half + xy * xy);
    if mean > 0.0 { libm::sqrt(((mean - radius) / (mean + radius)).max(0.0)) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn factors(horizontal_factor: HorizontalFactor) -> Factors {
        Config { horizontal_factor, ..Config::default() }.factors().unwrap()
    }

    /// I = 1e-7 and P_IF = 1e-8 for each component: K = 5.345837350732903 (one dimension), 4.027835169990965 (circle, on
    /// DRMS), by √2 erfc⁻¹(9e-8) and √(−ln 9e-8).
    #[test]
    fn a_circle_and_a_line() {
        let covariance = Matrix3::from_diagonal(&nalgebra::Vector3::new(9e-4, 9e-4, 4e-4));
        let levels = factors(HorizontalFactor::OneDimension).levels(&covariance, 1.0).unwrap();
        assert!((levels.vertical - 0.02 * 5.345_837_350_732_903).abs() < 1e-12);
        assert!((levels.horizontal - 0.03 * 2f64.sqrt() * 5.345_837_350_732_903).abs() < 1e-12);
        let exact = factors(HorizontalFactor::Exact);
        let circle = exact.levels(&covariance, 1.0).unwrap().horizontal;
        assert!((circle - 0.03 * 2f64.sqrt() * 4.027_835_169_990_965).abs() < 1e-11);
        // All error along (3, 4)/5: one dimension.
        let line = Matrix3::new(9.0, 12.0, 0.0, 12.0, 16.0, 0.0, 0.0, 0.0, 1.0);
        assert!((exact.levels(&line, 1.0).unwrap().horizontal - 5.0 * 5.345_837_350_732_903).abs() < 1e-6);
        assert_eq!(exact.levels(&line, 3.0).unwrap().vertical, 3.0 * exact.levels(&line, 0.2).unwrap().vertical);
    }

    #[test]
    fn status_and_basis() {
        let factors = factors(HorizontalFactor::OneDimension);
        let levels = |horizontal, vertical| Some(Levels { horizontal, vertical });
        assert_eq!(factors.status(levels(0.9, 1.9)), Status::Available);
        assert_eq!(factors.status(levels(1.0, 1.9)), Status::Alert);
        assert_eq!(factors.status(levels(0.9, 2.1)), Status::Alert);
        assert_eq!(factors.status(None), Status::Unmonitored);
        assert_eq!(factors.basis(1e-9, false), Basis::SuccessRate);
        assert_eq!(factors.basis(1e-3, true), Basis::Data);
        assert_eq!(factors.basis(1e-3, false), Basis::Float);
        assert_eq!(factors.basis(f64::NAN, false), Basis::Float);
        let strict = Config { rule: Rule::SuccessRate, ..Config::default() }.factors().unwrap();
        assert_eq!(strict.basis(1e-3, true), Basis::Float);
    }

    #[test]
    fn bad_numbers_are_refused() {
        for limits in [[0.0, 1.0], [1.0, -1.0], [f64::NAN, 1.0]] {
            let error = Config { alert_limits: limits, ..Config::default() }.factors().unwrap_err();
            assert_eq!(error, ConfigError::AlertLimit);
        }
        let allocation = Allocation { risk: 2.0, ..Allocation::default() };
        let error = Config { allocation, ..Config::default() }.factors().unwrap_err();
        assert!(error.to_string().contains("above 0 and below 1"), "{error}");
        let factors = factors(HorizontalFactor::Exact);
        for bad in [f64::NAN, f64::INFINITY, -1.0] {
            let mut covariance = Matrix3::identity();
            covariance[(1, 1)] = bad;
            assert_eq!(factors.levels(&covariance, 1.0), None);
        }
        assert_eq!(factors.levels(&Matrix3::identity(), f64::NAN), None);
        assert_eq!(factors.levels(&Matrix3::zeros(), 1.0), Some(Levels { horizontal: 0.0, vertical: 0.0 }));
    }

    proptest! {
        /// The exact level is never above the conservative one.
        #[test]
        fn the_exact_factor_is_the_smaller(a in -2.0..2.0, b in -2.0..2.0, c in -2.0..2.0, d in -2.0..2.0) {
            let (xx, xy, yy) = (a * a + b * b, a * c + b * d, c * c + d * d);
            let covariance = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 1.0);
            let level = |factor| factors(factor).levels(&covariance, 1.0).unwrap().horizontal;
            let (exact, one) = (level(HorizontalFactor::Exact), level(HorizontalFactor::OneDimension));
            prop_assert!(exact <= one * (1.0 + 1e-12) && exact >= one * 0.75, "{} {}", exact, one);
        }
    }
}
