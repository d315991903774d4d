//! What the PPP engine says of an epoch.

use crate::gnss::satellite::{Constellation, SatelliteSet};
use crate::gnss::solution::Solution;

/// A value with its standard deviation, same unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The answer for one epoch. Positions in `solution` are those of the marker, in the frame of the orbits, without tides.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PppSolution {
    /// Position, velocity (of a moving receiver) and quality.
    pub solution: Solution,
    /// Receiver clock against the time of `reference`, c dt `[m]`.
    pub clock: Option<Estimate>,
    /// The constellation whose time the clock is against.
    pub reference: Option<Constellation>,
    /// Inter-system biases by [`Constellation::index`] `[m]`; that of `reference` is absent.
    pub inter_system: [Option<Estimate>; 5],
    /// Zenith hydrostatic delay, modelled `[m]`.
    pub zenith_hydrostatic: f64,
    /// Zenith wet delay: modelled plus estimated `[m]`.
    pub zenith_wet: Option<Estimate>,
    /// The estimated part of it `[m]`.
    pub zenith_estimated: f64,
    /// Gradients to north and east `[m]`.
    pub gradients: [Option<Estimate>; 2],
    /// Satellites without orbit or clock, or with a gap in them.
    pub without_products: SatelliteSet,
    /// Satellites used whose antenna is not in the products.
    pub without_antenna: SatelliteSet,
    /// Satellites in eclipse or noon turn whose attitude is a guess.
    pub attitude_guessed: SatelliteSet,
    /// Satellites that found no room.
    pub overflow: u16,
    /// By how much phases were moved after a jump of the receiver clock in codes alone `[m]`, 0 without one.
    pub clock_jump: f64,
}

impl PppSolution {
    /// One without a position.
    pub fn none(solution: Solution) -> Self {
        Self {
            solution,
            clock: None,
            reference: None,
            inter_system: [None; 5],
            zenith_hydrostatic: 0.0,
            zenith_wet: None,
            zenith_estimated: 0.0,
            gradients: [None; 2],
            without_products: SatelliteSet::EMPTY,
            without_antenna: SatelliteSet::EMPTY,
            attitude_guessed: SatelliteSet::EMPTY,
            overflow: 0,
            clock_jump: 0.0,
        }
    }

    /// Zenith total delay `[m]`.
    pub fn zenith_total(&self) -> Option<f64> {
        self.zenith_wet.map(|wet| self.zenith_hydrostatic + wet.value)
    }
}
