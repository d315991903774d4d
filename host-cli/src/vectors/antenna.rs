//! Attitude, wind-up, antennas and relativity.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use crate::read::antex::AntexCalibration;
use nalgebra::Vector3;
use serde_json::json;
use surefix_core::gnss::antenna::{AntennaBand, Calibration, Variations};
use surefix_core::gnss::attitude::{Axes, Block, attitude};
use surefix_core::gnss::geodesy::{Geodetic, LookAngle};
use surefix_core::gnss::relativity::{clock_correction, shapiro_delay};
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::{Calendar, GpsTime};
use surefix_core::gnss::wind_up::{ReceiverDipole, wind_up};

/// An epoch of a satellite's pass, with nominal attitude.
pub fn arc(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let vector = |key| inputs.numbers(key).map(Vector3::from);
    let (satellite, velocity) = (vector("satellite_ecef")?, vector("satellite_velocity_ecef")?);
    let (receiver, sun) = (vector("receiver_ecef")?, vector("sun_ecef")?);
    let degenerate = || CaseError::Absurd("satellite, Earth and Sun are on a line".to_owned());
    let axes = Axes::nominal(&satellite, &sun).ok_or_else(degenerate)?;
    let found = attitude(Block::Unknown, &satellite, &velocity, &sun).ok_or_else(degenerate)?;
    let dipole = ReceiverDipole::level(&Geodetic::from_ecef(&receiver));
    let direction = (satellite - receiver).normalize();
    let cycles = wind_up(&axes, &dipole, &direction, inputs.number("previous_cycles").ok());
    Ok(Outputs::from([
        ("windup_cycles", json!(cycles)),
        ("x_axis_ecef", json!(axes.x.as_slice())),
        ("y_axis_ecef", json!(axes.y.as_slice())),
        ("beta_deg", json!(found.beta.to_degrees())),
        ("shapiro_m", json!(shapiro_delay(&receiver, &satellite))),
        ("relativistic_clock_s", json!(clock_correction(&satellite, &velocity))),
    ]))
}

/// Offset and variation of a satellite antenna, from the antenna file if it is at hand.
pub fn satellite_variation(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let nadir = inputs.number("nadir_deg")?.to_radians();
    let band = band(inputs.text("frequency")?)?;
    let mean = inputs.list("noazi_m")?;
    let listed = calibration(inputs, band, &mean, [0.0; 3])?.variations.mean(nadir);
    let mut outputs = Outputs::from([("pcv_m", json!(listed))]);

    let [year, month, day, hour, minute, second] = inputs.numbers("epoch")?;
    let date = Calendar {
        year: year as i32,
        month: month as u8,
        day: day as u8,
        hour: hour as u8,
        minute: minute as u8,
        second,
    };
    let time = GpsTime::from_calendar(&date).ok_or_else(|| CaseError::Absurd("\"epoch\" is no date".to_owned()))?;
    let satellite: SatelliteId = inputs.parsed("sat")?;
    match context.source.data.antex(inputs.text("antex")?) {
        Ok(antex) => {
            let antenna = antex.satellite(satellite, time);
            let of_band = antenna.and_then(|antenna| antenna.calibrations.iter().find(|entry| entry.band == band));
            let found = of_band.map(AntexCalibration::view);
            outputs.replace("pcv_m", json!(found.map(|calibration| calibration.variations.mean(nadir))));
            outputs.add("pco_body_m", json!(found.map(|calibration| calibration.offset)));
        }
        Err(error @ CaseError::Absent { .. }) => outputs.not_at_hand("pco_body_m", error),
        Err(error) => return Err(error),
    }
    Ok(outputs)
}

/// Offset of a satellite's ionosphere-free phase centre, with nominal attitude.
pub fn satellite_offset(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let (satellite, sun) = (inputs.numbers("satellite_ecef")?.into(), inputs.numbers("sun_ecef")?.into());
    let axes = Axes::nominal(&satellite, &sun)
        .ok_or_else(|| CaseError::Absurd("satellite, Earth and Sun are on a line".to_owned()))?;
    let [f1, f2] = inputs.numbers("f_hz")?;
    let offsets = inputs.rows::<3>("pco_body_m")?;
    let [first, second] = offsets[..] else {
        return Err(CaseError::Absurd("\"pco_body_m\" is not of two frequencies".to_owned()));
    };
    let combined = ionosphere_free([f1, f2], [first.into(), second.into()]);
    Ok(Outputs::from([("iono_free_offset_ecef_m", json!(axes.to_ecef(&combined).as_slice()))]))
}

/// The ionosphere-free combination of two offsets.
pub(super) fn ionosphere_free([f1, f2]: [f64; 2], [first, second]: [Vector3<f64>; 2]) -> Vector3<f64> {
    (first * (f1 * f1) - second * (f2 * f2)) / (f1 * f1 - f2 * f2)
}

/// Correction of a receiver antenna, without its dependence on azimuth.
pub fn receiver(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let look = LookAngle { azimuth: inputs.number("az")?, elevation: inputs.number("el")? };
    let [north, east, up] = inputs.numbers("pco_neu_m")?;
    let mean = inputs.list("noazi_m")?;
    let calibration = calibration(inputs, band(inputs.text("frequency")?)?, &mean, [north, east, up])?;
    let delta = inputs.numbers("antenna_delta_enu_m")?.into();
    let zenith = std::f64::consts::FRAC_PI_2 - look.elevation;
    Ok(Outputs::from([
        ("noazi_pcv_m", json!(calibration.variations.mean(zenith))),
        ("range_correction_noazi_m", json!(calibration.receiver_correction(&delta, look))),
        ("pco_enu_m", json!([east, north, up])),
    ]))
}

/// A calibration with the grid of a case.
fn calibration<'a>(
    inputs: Inputs,
    band: AntennaBand,
    mean: &'a [f64],
    offset: [f64; 3],
) -> Result<Calibration<'a>, CaseError> {
    let [first, _, step] = inputs.numbers("zen")?;
    Ok(Calibration { band, offset, variations: Variations { first, step, mean, azimuth_step: 0.0, rows: &[] } })
}

/// A frequency as ANTEX names it.
fn band(name: &str) -> Result<AntennaBand, CaseError> {
    let band = match name.as_bytes() {
        &[letter, b'0', digit] => {
            Constellation::from_letter(letter as char).and_then(|constellation| AntennaBand::new(constellation, digit))
        }
        _ => None,
    };
    band.ok_or_else(|| CaseError::Absurd(format!("\"{name}\" is no frequency")))
}
