//! Where satellites stand and where the rover heads, by the core's own orbits and single points.

use crate::read::rinex::{NavigationData, ObservationEpoch};
use nalgebra::Vector3;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::geodesy::{Geodetic, LookAngle, line_of_sight};
use surefix_core::gnss::orbit::store::{EphemerisStore, SelectionRule};
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::time::GpsTime;
use surefix_core::spp::{Config, single_point};

/// Ephemerides held: those of two days of all constellations, thinned to the time of the rover.
const EPHEMERIDES: usize = 1024;
/// An ephemeris farther from the rover's epochs is of no use `[s]`.
const REACH: f64 = 4.0 * 3600.0;
/// Below this speed Doppler does not tell where the rover heads `[m/s]`.
const STANDING: f64 = 1.0;
/// A range that is right to 0.02 s of travel time: the direction is then right to 1e-5 rad.
const USUAL_RANGE: f64 = 0.075 * SPEED_OF_LIGHT;

/// Where the rover is at an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Position, ECEF `[m]`.
    pub position: Vector3<f64>,
    /// Azimuth in which it moves, or moved last `[rad]`.
    pub heading: f64,
}

/// The sky over a rover.
pub struct Sky {
    ephemerides: Box<EphemerisStore<EPHEMERIDES>>,
}

impl Sky {
    /// From navigation messages, for epochs between two times.
    pub fn new(navigation: &NavigationData, [first, last]: [GpsTime; 2]) -> Self {
        let mut ephemerides = Box::new(EphemerisStore::new());
        for &ephemeris in &navigation.ephemerides {
            if first.since(ephemeris.toe()) < REACH && ephemeris.toe().since(last) < REACH {
                ephemerides.insert(ephemeris);
            }
        }
        Self { ephemerides }
    }

    /// Places at all epochs: single points, and where there is none the last one, before the first it. `None` if there is
    /// no single point at all.
    pub fn places(&self, epochs: &[ObservationEpoch]) -> Option<Vec<Place>> {
        let mut rows = Box::new(surefix_core::spp::rows::Rows::<128>::new());
        let mut start = None;
        let mut singles = Vec::with_capacity(epochs.len());
        for epoch in epochs {
            let single = single_point(epoch.view(), &self.ephemerides, None, &Config::DEFAULT, start, &mut rows).ok();
            start = single.map(|single| single.position).or(start);
            singles.push(single);
        }
        let heading = |position: Vector3<f64>, velocity: Vector3<f64>| {
            let enu = Geodetic::from_ecef(&position).ecef_to_enu(&velocity);
            (enu.xy().norm() > STANDING).then(|| enu.x.atan2(enu.y))
        };
        let moving = |single: &surefix_core::spp::SinglePoint| heading(single.position, single.velocity?.velocity);
        let mut place = Place {
            position: singles.iter().flatten().next()?.position,
            heading: singles.iter().flatten().find_map(moving).unwrap_or(0.0),
        };
        let next = |single: &Option<surefix_core::spp::SinglePoint>| {
            if let Some(single) = single {
                place = Place { position: single.position, heading: moving(single).unwrap_or(place.heading) };
            }
            place
        };
        Some(singles.iter().map(next).collect())
    }

    /// Azimuth and elevation of a satellite from a place at a time; `None` without an ephemeris.
    pub fn look(&self, satellite: SatelliteId, time: GpsTime, position: &Vector3<f64>) -> Option<LookAngle> {
        let ephemeris = self.ephemerides.select(satellite, time, &SelectionRule::SAFE)?;
        let state = ephemeris.state_at_transmission(time, USUAL_RANGE).ok()?;
        let direction = line_of_sight(position, &state.position).direction;
        Some(Geodetic::from_ecef(position).look(&direction))
    }

    /// Frequency channel of a GLONASS satellite.
    pub fn glonass_channel(&self, satellite: SatelliteId) -> Option<i8> {
        self.ephemerides.glonass_channel(satellite)
    }
}
