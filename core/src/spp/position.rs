//! What code says about position and receiver clocks: P = ρ + c dt_r,k − c dt_s + I + T, group delay taken off P before.
//! Panic contract: never panics.

use super::adjust::{Equation, Model, Unknowns};
use super::rows::Row;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::atmosphere::{Klobuchar, Mapping, StandardAtmosphere};
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

impl Atmosphere {
    /// The delays at a receiver for a satellite seen at `look` at carrier `frequency` `[Hz]`. Zero below the horizon.
    pub fn delays(&self, receiver: &Geodetic, look: LookAngle, frequency: f64) -> Delays {
        if !HEIGHTS.contains(&receiver.height) {
            return Delays::default();
        }
        let above = LookAngle { elevation: look.elevation.max(0.0), ..look };
        let ionosphere = self.klobuchar.map(|k| k.delay(frequency, receiver, above, self.time.tow()));
        let zenith = StandardAtmosphere::at_height(receiver.height, HUMIDITY).zenith_delay(receiver);
        let troposphere = self.mapping.slant(zenith, season(self.time), receiver, look.elevation).unwrap_or(0.0);
        Delays { ionosphere, troposphere }
    }
}

/// Day of a mean year of 365.25 days, within a day of the calendar's: enough for a seasonal cosine (1980-01-06 was day
/// 6).
fn season(time: GpsTime) -> f64 {
    let days = time.since(GpsTime::default()) / 86_400.0 + 5.0;
    days - 365.25 * libm::floor(days / 365.25) + 1.0
}

/// Code as a measurement of position and clock offsets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionModel {
    /// Delays to add.
    pub atmosphere: Atmosphere,
}

impl Model for PositionModel {
    type Row = Row;
    type Point = (Unknowns, Geodetic);

    fn point(&self, unknowns: &Unknowns) -> Self::Point {
        (*unknowns, Geodetic::from_ecef(&unknowns.vector))
    }

    fn equation(&self, row: &Row, (unknowns, receiver): &Self::Point) -> Option<Equation> {
        let sight = line_of_sight(&unknowns.vector, &row.state.position);
        let look = receiver.look(&(row.state.position - unknowns.vector));
        let delays = self.atmosphere.delays(receiver, look, row.frequency);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn season_follows_the_calendar() {
        // 2020-06-25 00:00 GPST is week 2111, second 345600, and day 177 of its year.
        assert!((season(GpsTime::from_week_tow(2111, 345_600.0)) - 177.0).abs() < 1.0);
        assert!((season(GpsTime::from_week_tow(0, 0.0)) - 6.0).abs() < 1e-9);
    }
}
