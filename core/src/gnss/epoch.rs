//! One epoch of raw observations of one receiver.

use super::satellite::SatelliteId;
use super::signal::Signal;
use super::time::GpsTime;
use heapless::Vec;

/// What a receiver measured of one signal of one satellite. `None` where it was not recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observation {
    /// Whose signal.
    pub satellite: SatelliteId,
    /// Which signal.
    pub signal: Signal,
    /// Pseudorange `[m]`.
    pub code: Option<f64>,
    /// Carrier phase `[cycles]`, growing with range (RINEX sign).
    pub phase: Option<f64>,
    /// Doppler `[Hz]`, positive for an approaching satellite (RINEX sign: range rate = −λ·doppler).
    pub doppler: Option<f64>,
    /// Carrier to noise density `[dB-Hz]`.
    pub cn0: Option<f32>,
    /// Loss-of-lock indicator (RINEX LLI bit 0): lock was lost since the previous epoch, a cycle slip is possible.
    pub loss_of_lock: bool,
    /// Half-cycle ambiguity not resolved (RINEX LLI bit 1): the phase may be off by half a cycle.
    pub half_cycle: bool,
}

impl Observation {
    /// An observation of a signal with nothing measured yet.
    pub const fn new(satellite: SatelliteId, signal: Signal) -> Self {
        Self {
            satellite,
            signal,
            code: None,
            phase: None,
            doppler: None,
            cn0: None,
            loss_of_lock: false,
            half_cycle: false,
        }
    }
}

/// An epoch with room for up to `N` observations (signals, not satellites).
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch<const N: usize> {
    /// Receiver time of the measurement, on the GPS time scale.
    pub time: GpsTime,
    /// The observations, in no particular order.
    pub observations: Vec<Observation, N>,
}

impl<const N: usize> Epoch<N> {
    /// An epoch without observations.
    pub const fn new(time: GpsTime) -> Self {
        Self { time, observations: Vec::new() }
    }

    /// The epoch without its capacity, as engines take it.
    pub fn view(&self) -> EpochView<'_> {
        EpochView { time: self.time, observations: &self.observations }
    }
}

/// A borrowed epoch of any capacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EpochView<'a> {
    /// Receiver time of the measurement, on the GPS time scale.
    pub time: GpsTime,
    /// The observations, in no particular order.
    pub observations: &'a [Observation],
}
