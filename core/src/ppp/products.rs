//! What the engine asks the world: orbits, clocks, antennas, biases, the Earth's rotation and the ocean's weight.
//!
//! A host answers from files, firmware from what it received; whatever is not known is said to be missing, never zero.

use crate::gnss::antenna::Calibration;
use crate::gnss::attitude::Block;
use crate::gnss::earth_rotation::EarthOrientation;
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// A satellite at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreciseState {
    /// Centre of mass, or phase centre, ECEF of the instant `[m]`.
    pub position: Vector3<f64>,
    /// Velocity in the rotating ECEF frame `[m/s]`.
    pub velocity: Vector3<f64>,
    /// Satellite clock minus system time, periodic relativity included `[s]`.
    pub clock: f64,
    /// Variance of orbit and clock along the line of sight, beyond what is in the noise of phases `[m²]`: interpolation between
    /// clocks far apart, broadcast messages.
    pub variance: f64,
    /// Whether `position` is the phase centre already, as in broadcast messages.
    pub phase_centre: bool,
}

/// Why a satellite has no [`PreciseState`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Missing {
    /// No orbit at all.
    Orbit,
    /// The orbit has a gap there, or ends before.
    OrbitGap,
    /// No clock at all.
    Clock,
    /// The clock has a gap there, or ends before.
    ClockGap,
}

/// Everything that comes from outside. All times are GPST.
pub trait Products {
    /// A satellite's orbit and clock.
    fn state(&self, satellite: SatelliteId, time: GpsTime) -> Result<PreciseState, Missing>;

    /// The series that a satellite belongs to, which decides how it turns near noon and midnight.
    fn block(&self, satellite: SatelliteId, time: GpsTime) -> Block;

    /// A satellite's antenna at the frequency of a signal; `None` if it is not known.
    fn satellite_antenna(&self, satellite: SatelliteId, time: GpsTime, signal: Signal) -> Option<Calibration<'_>>;

    /// The receiver's antenna at the frequency of a signal of a constellation; `None` if it is not known.
    fn receiver_antenna(&self, constellation: Constellation, signal: Signal) -> Option<Calibration<'_>>;

    /// Bias of a code: observed minus what the clocks refer to `[m]`; `None` if it is not known.
    fn code_bias(&self, satellite: SatelliteId, signal: Signal, time: GpsTime) -> Option<f64>;

    /// The orientation of the Earth, `None` if it is not known.
    fn earth_orientation(&self, time: GpsTime) -> Option<EarthOrientation>;

    /// Displacement of the receiver by ocean loading: east, north, up `[m]`; `None` if it is not known.
    fn ocean_loading(&self, time: GpsTime) -> Option<Vector3<f64>>;
}
