//! Single points: position, clocks and velocity of one epoch from listed satellite states and corrected codes.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use nalgebra::Vector3;
use serde_json::{Value, json};
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::atmosphere::{Klobuchar, Mapping};
use surefix_core::gnss::epoch::Observation;
use surefix_core::gnss::geodesy::{Geodetic, line_of_sight, look_angle, sagnac_first_order};
use surefix_core::gnss::orbit::SatelliteState;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::time::GpsTime;
use surefix_core::spp::adjust::{Unknowns, equations};
use surefix_core::spp::position::{Atmosphere, PositionModel};
use surefix_core::spp::rows::Row;
use surefix_core::spp::velocity::range_rate;
use surefix_core::spp::{Config, SinglePoint, estimate};

/// Names of the clock offsets against GPS, by [`Constellation::index`]; GPS itself has the receiver clock.
const CLOCKS: [&str; 5] = [
    "receiver_clock_s",
    "clock_offset_E_minus_GPS_s",
    "clock_offset_C_minus_GPS_s",
    "clock_offset_J_minus_GPS_s",
    "clock_offset_R_minus_GPS_s",
];

/// Standard deviation of Doppler `[Hz]`: the same for all, as RTKLIB has it, and so large that none is excluded.
const DOPPLER_HZ: f64 = 10.0;

/// A single point from codes, and its velocity from the Doppler recorded with them.
pub fn single_point(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let time = inputs.time()?;
    let epoch = context.source.data.epoch(inputs.text("obs_file")?, time);
    let observations = epoch.as_ref().map_or(&[][..], |epoch| epoch.observations.as_slice());
    let mut rows = inputs
        .objects("satellites")?
        .into_iter()
        .map(|satellite| row(satellite, time, observations))
        .collect::<Result<Vec<Row>, _>>()?;
    let [a0, a1, a2, a3, b0, b1, b2, b3] = inputs.numbers("klobuchar")?;
    let klobuchar = Klobuchar { alpha: [a0, a1, a2, a3], beta: [b0, b1, b2, b3] };
    let atmosphere = Atmosphere { time, klobuchar: Some(klobuchar), mapping: Mapping::Cosecant };

    let fit = |rows: &[Row]| {
        let point = estimate(rows, &atmosphere, Unknowns::default(), &Config::DEFAULT);
        point.map_err(|error| CaseError::Absurd(error.to_string()))
    };
    let near = fit(&rows)?;
    let velocity = near.velocity.map(|velocity| velocity.velocity).unwrap_or_default();
    for row in &mut rows {
        row.code += beyond_first_order(&near.position, &row.state.position);
        let wavelength = SPEED_OF_LIGHT / row.frequency;
        let beyond = beyond_rtklibs_rate(&near.position, &velocity, &row.state);
        row.doppler = row.doppler.map(|doppler| doppler - beyond / wavelength);
    }
    let mut outputs = outputs(&fit(&rows)?, &rows, &atmosphere);
    match epoch {
        Ok(_) => {}
        Err(error @ CaseError::Absent { .. }) => outputs.not_at_hand("velocity_ecef", error),
        Err(error) => return Err(error),
    }
    Ok(outputs)
}

/// The programs that made the vectors have the first-order Sagnac term; the full rotation differs from it by up to
/// 0.11 mm, as much as the tolerances. This difference `[m]` is put on the codes.
fn beyond_first_order(receiver: &Vector3<f64>, satellite: &Vector3<f64>) -> f64 {
    let first_order = (satellite - receiver).norm() + sagnac_first_order(receiver, satellite);
    line_of_sight(receiver, satellite).range - first_order
}

/// The velocities are RTKLIB's alone, whose range rate leaves out that light takes longer to a receding satellite (up to
/// 3 mm/s) and adds the Sagnac rate with the sign opposite to that of its Sagnac term (up to 1 cm/s, as much as the
/// tolerance). What the rate of this program has beyond that `[m/s]` is put on the Doppler.
fn beyond_rtklibs_rate(receiver: &Vector3<f64>, velocity: &Vector3<f64>, satellite: &SatelliteState) -> f64 {
    let SatelliteState { position: s, velocity: s_rate, .. } = satellite;
    let sagnac_rate = sagnac_first_order(receiver, s_rate) + sagnac_first_order(velocity, s);
    let rtklib = (s - receiver).normalize().dot(&(s_rate - velocity)) - sagnac_rate;
    range_rate(receiver, velocity, s, s_rate).0 - rtklib
}

/// A satellite as listed; its Doppler is that of the observation with the listed code.
fn row(from: Inputs, time: GpsTime, observations: &[Observation]) -> Result<Row, CaseError> {
    let (satellite, code, frequency) = (from.parsed("sat")?, from.number("code")?, from.number("f_hz")?);
    let is_listed = |o: &&Observation| o.satellite == satellite && o.code == Some(code);
    Ok(Row {
        satellite,
        state: SatelliteState {
            time,
            position: from.numbers("satellite_ecef")?.into(),
            velocity: from.numbers("satellite_velocity_ecef")?.into(),
            clock: from.number("satellite_clock")?,
            clock_drift: from.number("satellite_clock_drift")?,
            relativity: 0.0,
        },
        code: from.number("code_corrected")?,
        code_variance: from.number("variance")?,
        frequency,
        doppler: observations.iter().find(is_listed).and_then(|o| o.doppler),
        doppler_variance: (DOPPLER_HZ * SPEED_OF_LIGHT / frequency).powi(2),
        cn0: None,
        accuracy: 0.0,
    })
}

fn outputs(point: &SinglePoint, rows: &[Row], atmosphere: &Atmosphere) -> Outputs {
    let unknowns = Unknowns { vector: point.position, biases: point.clocks.map(Option::unwrap_or_default) };
    let model = PositionModel { atmosphere: *atmosphere };
    let residuals: Vec<f64> =
        equations(&model, rows, &point.rejected, &unknowns).map(|(_, equation)| equation.residual).collect();
    let local = atmosphere.above(&Geodetic::from_ecef(&point.position));
    let looks: Vec<_> = rows.iter().map(|row| look_angle(&point.position, &row.state.position)).collect();
    let delays: Vec<_> = rows.iter().zip(&looks).map(|(row, &look)| local.delays(look, row.frequency)).collect();
    let used = rows.iter().map(|row| row.satellite).filter(|&satellite| point.used.contains(satellite));
    let degrees: Vec<_> = looks.iter().map(|look| [look.azimuth.to_degrees(), look.elevation.to_degrees()]).collect();
    let dop = point.dop;
    let mut outputs = Outputs::from([
        ("position_ecef", json!(point.position.as_slice())),
        ("satellites_used", json!(used.map(|satellite| satellite.to_string()).collect::<Vec<_>>())),
        ("residuals_m", json!(residuals)),
        ("dop_gdop_pdop_hdop_vdop", json!([dop.geometric, dop.position, dop.horizontal, dop.vertical])),
        ("az_el_deg", json!(degrees)),
        ("slant_iono_m", delays.iter().map(|delay| json!(delay.ionosphere)).collect()),
        ("slant_tropo_m", delays.iter().map(|delay| json!(delay.troposphere)).collect()),
        ("velocity_ecef", point.velocity.map_or(Value::Null, |velocity| json!(velocity.velocity.as_slice()))),
    ]);
    let gps = point.clocks[Constellation::Gps.index()].unwrap_or_default();
    for ((name, clock), constellation) in CLOCKS.iter().zip(point.clocks).zip(Constellation::ALL) {
        let reference = if constellation == Constellation::Gps { 0.0 } else { gps };
        if let Some(clock) = clock {
            outputs.add(name, json!((clock - reference) / SPEED_OF_LIGHT));
        }
    }
    outputs
}
