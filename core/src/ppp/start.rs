//! A position from the codes of one epoch and precise orbits: where to linearise when nothing better is known.
//!
//! The ionosphere-free codes go through the single point adjustment with its fault exclusion; antennas, tides and biases of
//! codes are left out, which costs a metre or two. Panic contract: none.

use super::config::PppConfig;
use super::products::Products;
use super::select::PairReading;
use super::sight::at_transmission;
use crate::gnss::atmosphere::Mapping;
use crate::gnss::orbit::SatelliteState;
use crate::gnss::solution::Reason;
use crate::gnss::time::GpsTime;
use crate::spp::adjust::Unknowns;
use crate::spp::position::Atmosphere;
use crate::spp::rows::{Row, Rows};
use crate::spp::{self, SinglePointError};
use nalgebra::Vector3;

/// Standard deviation of a code here, whatever its elevation `[m]`.
const CODE: f64 = 5.0;

/// The position, ECEF `[m]`, started from `start` or from nothing.
pub fn single_point<const S: usize>(
    time: GpsTime,
    readings: &[PairReading],
    products: &impl Products,
    config: &PppConfig,
    start: Option<Vector3<f64>>,
    rows: &mut Rows<S>,
) -> Result<Vector3<f64>, Reason> {
    rows.clear();
    for reading in readings {
        let Ok(state) = at_transmission(reading.satellite, time, reading.bands[0].code, products) else { continue };
        let _ = rows.push(Row {
            satellite: reading.satellite,
            state: SatelliteState {
                time,
                position: state.position,
                velocity: state.velocity,
                clock: state.clock,
                clock_drift: 0.0,
                relativity: 0.0,
            },
            code: reading.pair.ionosphere_free(reading.codes()),
            code_variance: CODE * CODE + state.variance,
            frequency: reading.bands[0].frequency,
            doppler: None,
            doppler_variance: 1.0,
            cn0: None,
            accuracy: 1.0,
        });
    }
    let atmosphere = Atmosphere { time, klobuchar: None, mapping: Mapping::Niell };
    let from = Unknowns { vector: start.unwrap_or_default(), ..Unknowns::default() };
    let limits = spp::Config { elevation_mask: config.elevation_mask, max_pdop: 100.0, ..spp::Config::DEFAULT };
    match spp::estimate(rows, &atmosphere, from, &limits) {
        Ok(point) => Ok(point.position),
        Err(SinglePointError::TooFewSatellites) => Err(Reason::TooFewSatellites),
        Err(_) => Err(Reason::PositionFailed),
    }
}
