//! Where a satellite is, how fast it moves and what its clock reads, from a broadcast [`Ephemeris`].
//!
//! * [`kepler`]: GPS, Galileo, BeiDou and QZSS; [`glonass`]: numerical integration.
//! * [`group_delay`]: what to subtract from the clock for a single signal (TGD, BGD).
//! * [`store`]: which ephemeris to use when.
//!
//! Frame: ECEF of the *evaluation* time; [`super::geodesy::line_of_sight`] takes it to the frame of reception. Health is
//! reported by [`Ephemeris::healthy`], not enforced: the state of an unhealthy satellite can be computed.
//!
//! Panic contract: none. Parameters that no real satellite has are refused, so that every returned state is finite.

use super::SPEED_OF_LIGHT;
use super::ephemeris::{Ephemeris, KeplerEphemeris};
use super::satellite::Constellation;
use super::time::GpsTime;
use core::fmt;
use nalgebra::Vector3;

pub mod glonass;
pub mod group_delay;
pub mod kepler;
pub mod store;

/// Distance of a navigation satellite from the Earth's centre `[m]`, with room to spare.
const RADIUS_RANGE: core::ops::RangeInclusive<f64> = 1.5e7..=6.0e7;
/// Greatest speed in the rotating frame `[m/s]`, nominally below 4 km/s.
const MAX_SPEED: f64 = 1.0e4;
/// Greatest clock offset `[s]`; messages express up to 62 ms (Galileo OS SIS ICD 2.1 table 62).
const MAX_CLOCK: f64 = 0.1;

/// Position, velocity and clock of a satellite's antenna phase centre at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SatelliteState {
    /// The instant, GPS time scale.
    pub time: GpsTime,
    /// Position, ECEF of `time` `[m]`.
    pub position: Vector3<f64>,
    /// Velocity in the rotating ECEF frame of `time` `[m/s]`.
    pub velocity: Vector3<f64>,
    /// Satellite clock minus system time, relativity included, group delay not included `[s]`.
    pub clock: f64,
    /// Rate of `clock` `[s/s]`.
    pub clock_drift: f64,
    /// Relativistic part of `clock` `[s]`; 0 for GLONASS, which broadcasts clocks that include it.
    pub relativity: f64,
}

/// Why no state can be computed from an ephemeris.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OrbitError {
    /// The time is further from the reference time than any use of the ephemeris makes sense.
    TooFar,
    /// The orbit or the clock is not that of a navigation satellite.
    Absurd,
    /// A parameter or a result is not finite.
    NotFinite,
}

impl fmt::Display for OrbitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooFar => "time too far from the ephemeris",
            Self::Absurd => "not the orbit or clock of a navigation satellite",
            Self::NotFinite => "ephemeris parameter not finite",
        })
    }
}

impl core::error::Error for OrbitError {}

impl Ephemeris {
    /// The satellite's state at `time`.
    ///
    /// Bounded: at most [`kepler::MAX_EXTRAPOLATION`] or [`glonass::MAX_EXTRAPOLATION`] from the reference time. How
    /// old an ephemeris may be for a good position is the business of [`store::SelectionRule`].
    pub fn state(&self, time: GpsTime) -> Result<SatelliteState, OrbitError> {
        let state = match self {
            Self::Kepler(kepler) => kepler::state(kepler, time)?,
            Self::Glonass(glonass) => glonass::state(glonass, time)?,
        };
        let (radius, speed, clock) = (state.position.norm(), state.velocity.norm(), libm::fabs(state.clock));
        if !(radius + speed + clock + state.clock_drift).is_finite() {
            Err(OrbitError::NotFinite)
        } else if RADIUS_RANGE.contains(&radius) && speed <= MAX_SPEED && clock <= MAX_CLOCK {
            Ok(state)
        } else {
            Err(OrbitError::Absurd)
        }
    }

    /// The satellite's state when it sent the signal that was received at `reception` (receiver clock) with
    /// `pseudorange` `[m]`: at t = t_rx − P/c − dt_sat. The receiver's clock error is in both t_rx and P and cancels.
    ///
    /// dt_sat is taken without relativity and group delay here (below 0.1 µs), which costs less than 0.1 mm of range.
    pub fn state_at_transmission(&self, reception: GpsTime, pseudorange: f64) -> Result<SatelliteState, OrbitError> {
        if !pseudorange.is_finite() {
            return Err(OrbitError::NotFinite);
        }
        let sent_by_satellite_clock = reception.plus_seconds(-pseudorange / SPEED_OF_LIGHT);
        let clock = self.clock_polynomial(sent_by_satellite_clock);
        if !clock.is_finite() {
            return Err(OrbitError::NotFinite);
        }
        self.state(sent_by_satellite_clock.plus_seconds(-clock))
    }

    /// Clock offset `[s]` as broadcast, without relativity.
    fn clock_polynomial(&self, time: GpsTime) -> f64 {
        match self {
            Self::Kepler(kepler) => kepler::clock_polynomial(kepler, time).0,
            Self::Glonass(glonass) => glonass::clock_polynomial(glonass, time),
        }
    }

    /// Whether the satellite says that it may be used. For QZSS bit 0 is ignored: it speaks of one of two alternative L1
    /// signals (C/A or C/B, IS-QZSS-PNT-005), and satellites in good health send it raised.
    pub const fn healthy(&self) -> bool {
        let ignored = match self.satellite().constellation() {
            Constellation::Qzss => 0x01,
            _ => 0x00,
        };
        self.health() & !ignored == 0
    }
}

impl KeplerEphemeris {
    /// Seconds of week of `toe` on the constellation's own time scale, as the broadcast message has it `[s]`.
    pub fn toe_seconds_of_week(&self) -> f64 {
        match self.satellite.constellation() {
            Constellation::BeiDou => self.toe.bdt().1,
            _ => self.toe.tow(),
        }
    }
}
