//! Everything between a satellite and a receiver that is not estimated.
//!
//! ```text
//! P_i = ρ + c (dt_r − dt_s) + T + R + A_i + μ_i I            ρ = |s − (x + d)|, s in the frame of reception
//! L_i = ρ + c (dt_r − dt_s) + T + R + A_i − μ_i I + λ_i w + N_i
//! ```
//! (Zhang 2020, eqs. 4 and 5; IERS Conventions 2010.) dt_s includes periodic relativity, R is Shapiro's delay, A_i the antennas of
//! both ends, w the wind-up, d what the station stands off its marker: the antenna's height, and tides. T is the hydrostatic
//! delay and that part of the wet one which a weather model knows; the rest is estimated.
//!
//! Panic contract: none. Cost: O(1); the Sun, tides and zenith delays once an epoch.

use super::config::PppConfig;
use super::products::{Missing, PreciseState, Products};
use super::select::PairReading;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::antenna::nadir_angle;
use crate::gnss::atmosphere::troposphere::Troposphere;
use crate::gnss::attitude::{Axes, attitude};
use crate::gnss::celestial;
use crate::gnss::geodesy::{Geodetic, LookAngle, line_of_sight};
use crate::gnss::relativity::shapiro_delay;
use crate::gnss::satellite::SatelliteId;
use crate::gnss::tide;
use crate::gnss::time::GpsTime;
use crate::gnss::wind_up::{ReceiverDipole, wind_up};
use nalgebra::Vector3;

/// The receiver at an epoch, with what all satellites share.
#[derive(Clone, Debug)]
pub struct Station {
    /// When, by the receiver's clock.
    pub time: GpsTime,
    /// The marker, ECEF `[m]`.
    pub marker: Vector3<f64>,
    /// Antenna reference point less marker, tides included, ECEF `[m]`.
    pub displacement: Vector3<f64>,
    /// The troposphere above.
    pub troposphere: Troposphere,
    /// Antenna reference point.
    place: Geodetic,
    dipole: ReceiverDipole,
    sun: Vector3<f64>,
}

impl Station {
    /// A receiver whose marker is at `marker`, and its antenna reference point `antenna` (east, north, up) from it `[m]`.
    pub fn new(
        time: GpsTime,
        marker: &Vector3<f64>,
        antenna: &Vector3<f64>,
        products: &impl Products,
        config: &PppConfig,
    ) -> Self {
        let earth = products.earth_orientation(time);
        let orientation = earth.unwrap_or_default();
        let sun = celestial::sun(time, &orientation);
        let place = Geodetic::from_ecef(marker);
        let mut displacement = place.enu_to_ecef(antenna);
        if config.tides {
            let moon = celestial::moon(time, &orientation);
            displacement += tide::solid::displacement(marker, time, &sun, &moon);
            if let Some(earth) = earth {
                displacement += tide::pole::displacement(marker, time, &earth);
            }
            if let Some(ocean) = products.ocean_loading(time) {
                displacement += place.enu_to_ecef(&ocean);
            }
        }
        let place = Geodetic::from_ecef(&(marker + displacement));
        let troposphere = Troposphere::new(time, &place, &config.troposphere);
        let dipole = ReceiverDipole::level(&place);
        Self { time, marker: *marker, displacement, troposphere, place, dipole, sun }
    }
}

/// A satellite as a receiver sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Unit vector from receiver to satellite, ECEF of reception.
    pub direction: Vector3<f64>,
    /// Azimuth and elevation.
    pub look: LookAngle,
    /// The satellite in the frame of reception less the receiver's displacement: its distance from the marker is ρ `[m]`.
    pub satellite: Vector3<f64>,
    /// ρ `[m]`.
    pub range: f64,
    /// −c dt_s + T + R `[m]`.
    pub common: f64,
    /// A_i `[m]`.
    pub antennas: [f64; 2],
    /// w `[cycles]`.
    pub wind_up: f64,
    /// Mapping of the zenith wet delay.
    pub wet: f64,
    /// Mapping of the gradients to north and east.
    pub gradients: [f64; 2],
    /// Variance of orbit and clock `[m²]`.
    pub variance: f64,
    /// Whether the antenna of the satellite is known at both frequencies.
    pub antenna_known: bool,
    /// Whether its attitude can be relied on.
    pub attitude_known: bool,
}

/// How a station sees the satellite of a reading; `before` is the wind-up of the satellite's epoch before. `Ok(None)` below the
/// mask, and where the geometry makes no sense.
pub fn sight(
    station: &Station,
    reading: &PairReading,
    before: Option<f64>,
    products: &impl Products,
    config: &PppConfig,
) -> Result<Option<Sight>, Missing> {
    let (satellite, time) = (reading.satellite, station.time);
    let state = at_transmission(satellite, time, reading.bands[0].code, products)?;
    let receiver = station.marker + station.displacement;
    let line = line_of_sight(&receiver, &state.position);
    let look = station.place.look(&line.direction);
    if look.elevation.is_nan() || look.elevation < config.elevation_mask {
        return Ok(None);
    }
    let Some(slant) = station.troposphere.slant(look) else { return Ok(None) };
    // Axes and Sun in the frame of reception, as the line of sight.
    let block = products.block(satellite, time);
    let attitude = attitude(block, &line.satellite, &line.rotate(&state.velocity), &station.sun);
    let Some(attitude) = attitude else { return Ok(None) };
    let Some(wind_up) = wind_up(&attitude.axes, &station.dipole, &line.direction, before) else { return Ok(None) };
    let nadir = nadir_angle(&line.satellite, &line.direction);
    let transmitter = |axes: &Axes, band: usize| {
        let signal = reading.bands[band % 2].phase_signal;
        Some(products.satellite_antenna(satellite, time, signal)?.satellite_correction(axes, &line.direction, nadir))
    };
    let sent: [Option<f64>; 2] = match state.phase_centre {
        true => [Some(0.0); 2],
        false => [0, 1].map(|band| transmitter(&attitude.axes, band)),
    };
    // The reference point's offset from the marker is in the displacement already.
    let received: [f64; 2] = [0, 1].map(|band: usize| {
        let signal = reading.bands[band % 2].phase_signal;
        let calibration = products.receiver_antenna(satellite.constellation(), signal);
        calibration.map_or(0.0, |calibration| calibration.receiver_correction(&Vector3::zeros(), look))
    });
    Ok(Some(Sight {
        direction: line.direction,
        look,
        satellite: line.satellite - station.displacement,
        range: line.range,
        common: slant.delay(station.troposphere.zenith.wet, [0.0; 2]) + shapiro_delay(&receiver, &line.satellite)
            - SPEED_OF_LIGHT * state.clock,
        antennas: core::array::from_fn(|i| sent[i].unwrap_or(0.0) + received[i]),
        wind_up,
        wet: slant.wet_mapping,
        gradients: slant.gradients,
        variance: state.variance,
        antenna_known: sent.iter().all(Option::is_some),
        attitude_known: attitude.reliable,
    }))
}

/// A satellite when it sent the signal of which a receiver measured `code` `[m]` at `time` by its own clock: the receiver's
/// clock drops out, as both are late by it.
pub fn at_transmission(
    satellite: SatelliteId,
    time: GpsTime,
    code: f64,
    products: &impl Products,
) -> Result<PreciseState, Missing> {
    let sent = time.plus_seconds(-code / SPEED_OF_LIGHT);
    let clock = products.state(satellite, sent)?.clock;
    products.state(satellite, sent.plus_seconds(-clock))
}
