//! Geodetic and local coordinates, directions and ranges.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::json;
use surefix_core::gnss::geodesy::{Geodetic, line_of_sight, look_angle, sagnac_first_order};

/// Geodetic → ECEF.
pub fn geodetic_to_ecef(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let [latitude, longitude, height] = inputs.numbers("lat_lon_h")?;
    let ecef = Geodetic { latitude, longitude, height }.to_ecef();
    Ok(vec![("ecef", json!(ecef.as_slice()))])
}

/// ECEF → geodetic.
pub fn ecef_to_geodetic(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let place = Geodetic::from_ecef(&inputs.numbers("ecef")?.into());
    Ok(vec![("lat", json!(place.latitude)), ("lon", json!(place.longitude)), ("h", json!(place.height))])
}

/// The local frame at a place and a vector in it.
pub fn local_frame(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let place = Geodetic::from_ecef(&inputs.numbers("receiver_ecef")?.into());
    let rows: Vec<Vec<f64>> = place.enu_rotation().row_iter().map(|row| row.iter().copied().collect()).collect();
    let enu = place.ecef_to_enu(&inputs.numbers("vector_ecef")?.into());
    Ok(vec![("matrix_rows_enu", json!(rows)), ("enu", json!(enu.as_slice()))])
}

/// Azimuth, elevation and range of a satellite.
pub fn sight(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let receiver = inputs.numbers("receiver_ecef")?.into();
    let satellite = inputs.numbers("satellite_ecef")?.into();
    let look = look_angle(&receiver, &satellite);
    let plain = (satellite - receiver).norm();
    Ok(vec![
        ("az", json!(look.azimuth)),
        ("el", json!(look.elevation)),
        ("range_plain", json!(plain)),
        ("range_sagnac_first_order", json!(plain + sagnac_first_order(&receiver, &satellite))),
        ("range_sagnac_rotated", json!(line_of_sight(&receiver, &satellite).range)),
    ])
}
