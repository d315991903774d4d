//! Single points from listed satellite states, codes and variances.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use nalgebra::Vector3;
use serde_json::{Value, json};
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::atmosphere::{Klobuchar, Mapping};
use surefix_core::gnss::geodesy::{Geodetic, line_of_sight, look_angle, sagnac_first_order};
use surefix_core::gnss::orbit::SatelliteState;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::spp::adjust::{Model, Unknowns};
use surefix_core::spp::position::{Atmosphere, PositionModel};
use surefix_core::spp::rows::Row;
use surefix_core::spp::{Config, SinglePoint, SinglePointError, estimate};

/// Position, clocks, residuals and dilution of precision.
///
/// The files' programs have the first-order Sagnac term, which differs from the full rotation by up to 0.11 mm, the size
/// of the tolerances. The difference, at the position found, is put on the codes before the point is computed again.
pub fn single_point(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let [a0, a1, a2, a3, b0, b1, b2, b3] = inputs.numbers("klobuchar")?;
    let klobuchar = Some(Klobuchar { alpha: [a0, a1, a2, a3], beta: [b0, b1, b2, b3] });
    let atmosphere = Atmosphere { time: inputs.time()?, klobuchar, mapping: Mapping::Cosecant };
    let mut rows = inputs.objects("satellites")?.into_iter().map(row).collect::<Result<Vec<_>, _>>()?;

    let config = Config::DEFAULT;
    let failed = |error: SinglePointError| CaseError::Absurd(error.to_string());
    let rough = estimate(&rows, &atmosphere, Unknowns::default(), &config).map_err(failed)?;
    for row in &mut rows {
        row.code += beyond_first_order(&rough.position, &row.state.position);
    }
    let point = estimate(&rows, &atmosphere, Unknowns::default(), &config).map_err(failed)?;
    outputs(&point, &rows, atmosphere)
}

fn row(satellite: Inputs) -> Result<Row, CaseError> {
    let vector = |key| satellite.numbers(key).map(|xyz: [f64; 3]| Vector3::from(xyz));
    Ok(Row {
        satellite: satellite.parsed("sat")?,
        state: SatelliteState {
            time: Default::default(),
            position: vector("satellite_ecef")?,
            velocity: vector("satellite_velocity_ecef")?,
            clock: satellite.number("satellite_clock")?,
            clock_drift: satellite.number("satellite_clock_drift")?,
            relativity: 0.0,
        },
        code: satellite.number("code_corrected")?,
        code_variance: satellite.number("variance")?,
        frequency: satellite.number("f_hz")?,
        doppler: None,
        doppler_variance: 1.0,
        cn0: None,
        accuracy: 0.0,
    })
}

fn beyond_first_order(receiver: &Vector3<f64>, satellite: &Vector3<f64>) -> f64 {
    let first_order = (satellite - receiver).norm() + sagnac_first_order(receiver, satellite);
    line_of_sight(receiver, satellite).range - first_order
}

fn outputs(point: &SinglePoint, rows: &[Row], atmosphere: Atmosphere) -> Result<Outputs, CaseError> {
    let no_gps = || CaseError::Absurd("no GPS satellite, whose clock others are relative to".to_owned());
    let gps = point.clocks[Constellation::Gps.index()].ok_or_else(no_gps)?;
    let offset = |constellation: Constellation| match point.clocks[constellation.index()] {
        Some(clock) => json!((clock - gps) / SPEED_OF_LIGHT),
        None => Value::Null,
    };
    let dop = point.dop;

    let local = atmosphere.above(&Geodetic::from_ecef(&point.position));
    let model = PositionModel { atmosphere };
    let at = model.point(&Unknowns { vector: point.position, biases: point.clocks.map(Option::unwrap_or_default) });
    let mut satellites = Vec::new();
    let (mut residuals, mut looks, mut ionosphere, mut troposphere) = (vec![], vec![], vec![], vec![]);
    for row in rows.iter().filter(|row| point.used.contains(row.satellite)) {
        let look = look_angle(&point.position, &row.state.position);
        let delays = local.delays(look, row.frequency);
        satellites.push(row.satellite.to_string());
        residuals.push(model.equation(row, &at).map(|equation| equation.residual));
        looks.push([look.azimuth.to_degrees(), look.elevation.to_degrees()]);
        ionosphere.push(delays.ionosphere);
        troposphere.push(delays.troposphere);
    }
    Ok(vec![
        ("position_ecef", json!(point.position.as_slice())),
        ("receiver_clock_s", json!(gps / SPEED_OF_LIGHT)),
        ("clock_offset_R_minus_GPS_s", offset(Constellation::Glonass)),
        ("clock_offset_E_minus_GPS_s", offset(Constellation::Galileo)),
        ("clock_offset_C_minus_GPS_s", offset(Constellation::BeiDou)),
        ("clock_offset_J_minus_GPS_s", offset(Constellation::Qzss)),
        ("satellites_used", json!(satellites)),
        ("residuals_m", json!(residuals)),
        ("dop_gdop_pdop_hdop_vdop", json!([dop.geometric, dop.position, dop.horizontal, dop.vertical])),
        ("az_el_deg", json!(looks)),
        ("slant_iono_m", json!(ionosphere)),
        ("slant_tropo_m", json!(troposphere)),
    ])
}
