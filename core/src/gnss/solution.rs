//! The answer for one epoch, with its own grade.

use super::satellite::SatelliteSet;
use super::time::GpsTime;
use crate::integrity::protection::{Levels, Status};
use nalgebra::{Matrix3, Vector3};

/// How good a [`Solution`] is, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Quality {
    /// All usable integer ambiguities are fixed and accepted.
    Fixed,
    /// A subset of them is fixed and accepted; the rest stays float. Centimetres as well.
    Partial,
    /// Carrier phase with real-valued ambiguities.
    Float,
    /// Code only (single point).
    Code,
    /// No position.
    None,
}

/// Why a [`Solution`] is not better than it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Reason {
    /// Nothing better was possible: every usable ambiguity is fixed.
    Complete,
    /// Some ambiguities were left float because the whole set was not accepted.
    SubsetOnly,
    /// The success rate of every candidate set is below the threshold.
    SuccessRateLow,
    /// The ratio test did not accept the best integers.
    RatioLow,
    /// The fixed solution contradicts the measurements or the float solution.
    Inconsistent,
    /// Fewer ambiguities than a fix needs.
    TooFewAmbiguities,
    /// The integer search used up its node budget and its answer was not accepted.
    SearchBudget,
    /// No base epoch has been received yet.
    NoBase,
    /// The latest base epoch is older than the configured limit.
    BaseTooOld,
    /// Too few satellites common to rover and base.
    TooFewCommonSatellites,
    /// Too few satellites with ephemeris for a position.
    TooFewSatellites,
    /// The single-point solution did not converge or failed its consistency check.
    PositionFailed,
    /// The epoch is not later than the previous one and was dropped.
    OutOfOrder,
    /// The covariance lost its definiteness and the filter was restarted.
    Restarted,
    /// The integers give a baseline of another length than it is known to have.
    BaselineLength,
}

/// Position, velocity and what is known of their quality, for one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Solution {
    /// Receiver time of the rover epoch (GPST).
    pub time: GpsTime,
    /// Grade.
    pub quality: Quality,
    /// Why the grade is not better.
    pub reason: Reason,
    /// Rover position, ECEF `[m]`. Zero if `quality` is [`Quality::None`].
    pub position: Vector3<f64>,
    /// Covariance of the position, ECEF `[m²]`.
    pub position_covariance: Matrix3<f64>,
    /// Rover velocity, ECEF `[m/s]`.
    pub velocity: Vector3<f64>,
    /// Covariance of the velocity, ECEF `[m²/s²]`.
    pub velocity_covariance: Matrix3<f64>,
    /// Ambiguities fixed to integers in this solution.
    pub ambiguities_fixed: u8,
    /// Ambiguities that could have been fixed.
    pub ambiguities: u8,
    /// Ratio of the squared norms of second-best and best integers (≥ 1), 0 if no search was done.
    pub ratio: f64,
    /// Success rate of the fixed (or best candidate) set, exact for bootstrapping, 0 if no search was done.
    pub success_rate: f64,
    /// Age of the base data `[s]`, 0 for a solution without base.
    pub age: f64,
    /// Satellites that took part.
    pub satellites_used: SatelliteSet,
    /// Satellites of which at least one measurement was rejected as an outlier.
    pub satellites_rejected: SatelliteSet,
    /// Satellites on which a cycle slip was detected in this epoch.
    pub satellites_slipped: SatelliteSet,
    /// How far the position may be off at the configured risk, from its antenna's true place; `None` where nothing bounds
    /// it.
    pub protection: Option<Levels>,
    /// Whether that is within the alert limits.
    pub integrity: Status,
    /// Where a moving base was taken to be, antenna reference point, ECEF `[m]`: `position` minus this is the vector
    /// between the antennas at the instant of the base epoch, its covariance that of the position. `None` for a base at
    /// rest.
    pub base: Option<Vector3<f64>>,
}

impl Solution {
    /// A solution without a position.
    pub fn none(time: GpsTime, reason: Reason) -> Self {
        Self {
            time,
            quality: Quality::None,
            reason,
            position: Vector3::zeros(),
            position_covariance: Matrix3::zeros(),
            velocity: Vector3::zeros(),
            velocity_covariance: Matrix3::zeros(),
            ambiguities_fixed: 0,
            ambiguities: 0,
            ratio: 0.0,
            success_rate: 0.0,
            age: 0.0,
            satellites_used: SatelliteSet::EMPTY,
            satellites_rejected: SatelliteSet::EMPTY,
            satellites_slipped: SatelliteSet::EMPTY,
            protection: None,
            integrity: Status::Unmonitored,
            base: None,
        }
    }
}
