//! What code says about position and receiver clocks: P = ρ + c dt_r,k − c dt_s + I + T, group delay taken off P before.
//! Panic contract: never panics.

use super::adjust::{Equation, Model, Unknowns};
use super::rows::Row;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::atmosphere::{Klobuchar, Mapping, StandardAtmosphere, ZenithDelay};
use crate::gnss::geodesy::{Geodetic, LookAngle, line_of_sight};
use crate::gnss::satellite::SatelliteId;
use crate::gnss::time::GpsTime;

/// Relative humidity of the standard atmosphere.
const HUMIDITY: f64 = 0.7;
/// Heights at which the delays are modelled `[m]`; elsewhere, as on the way from the Earth's centre, they are 0.
const HEIGHTS: core::ops::RangeInclusive<f64> = -1e3..=1e5;

/// The atmosphere at an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Atmosphere {
    /// When.
    pub time: GpsTime,
    /// Ionosphere coefficients; without them no delay is modelled.
    pub klobuchar: Option<Klobuchar>,
    /// Troposphere mapping.
    pub mapping: Mapping,
}

/// Modelled delays of code `[m]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Delays {
    /// By the ionosphere; `None` where it is not modelled.
    pub ionosphere: Option<f64>,
    /// By the troposphere.
    pub troposphere: f64,
}

/// The atmosphere above a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalAtmosphere {
    atmosphere: Atmosphere,
    receiver: Geodetic,
    zenith: ZenithDelay,
    day_of_year: f64,
}

impl Atmosphere {
    /// The atmosphere above `receiver`.
    pub fn above(&self, receiver: &Geodetic) -> LocalAtmosphere {
        let zenith = StandardAtmosphere::at_height(receiver.height, HUMIDITY).zenith_delay(receiver);
        LocalAtmosphere { atmosphere: *self, receiver: *receiver, zenith, day_of_year: self.time.day_of_year() }
    }
}

impl LocalAtmosphere {
    /// The delays of a signal from a satellite seen at `look` at carrier `frequency` `[Hz]`. Below the horizon those of
    /// the ionosphere at the horizon, and none of the troposphere.
    pub fn delays(&self, look: LookAngle, frequency: f64) -> Delays {
        let Self { atmosphere: Atmosphere { time, klobuchar, mapping }, receiver, zenith, day_of_year } = self;
        if !HEIGHTS.contains(&receiver.height) {
            return Delays::default();
        }
        let above = LookAngle { elevation: look.elevation.max(0.0), ..look };
        let troposphere = mapping.slant(*zenith, *day_of_year, receiver, look.elevation).unwrap_or(0.0);
        let ionosphere = klobuchar.map(|klobuchar| klobuchar.delay(frequency, receiver, above, time.tow()));
        Delays { ionosphere, troposphere }
    }
}

/// Code as a measurement of position and clock offsets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionModel {
    /// Delays to add.
    pub atmosphere: Atmosphere,
}

impl Model for PositionModel {
    type Row = Row;
    type Point = (Unknowns, LocalAtmosphere);

    fn point(&self, unknowns: &Unknowns) -> Self::Point {
        (*unknowns, self.atmosphere.above(&Geodetic::from_ecef(&unknowns.vector)))
    }

    fn equation(&self, row: &Row, (unknowns, atmosphere): &Self::Point) -> Option<Equation> {
        let sight = line_of_sight(&unknowns.vector, &row.state.position);
        let look = atmosphere.receiver.look(&(row.state.position - unknowns.vector));
        let delays = atmosphere.delays(look, row.frequency);
        let group = row.satellite.constellation().index();
        let clocks = unknowns.biases.get(group)? - SPEED_OF_LIGHT * row.state.clock;
        let predicted = sight.range + clocks + delays.ionosphere.unwrap_or(0.0) + delays.troposphere;
        Some(Equation {
            residual: row.code - predicted,
            variance: row.code_variance,
            gradient: -sight.direction,
            group,
        })
    }

    fn satellite(row: &Row) -> SatelliteId {
        row.satellite
    }
}
