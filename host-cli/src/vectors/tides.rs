//! Sun, Moon, orientation of the Earth and the tides that move stations.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use nalgebra::Vector3;
use serde_json::{Value, json};
use surefix_core::gnss::celestial::SunMoon;
use surefix_core::gnss::earth_rotation::{
    ARCSECOND, EarthOrientation, earth_rotation_angle, gcrs_to_itrs, mean_sidereal_time_1982,
};
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::tide::ocean::{CONSTITUENTS, OceanLoading};
use surefix_core::gnss::tide::{pole, solid};
use surefix_core::gnss::time::{Calendar, GpsTime};

fn vector(inputs: Inputs, key: &str) -> Result<Vector3<f64>, CaseError> {
    Ok(Vector3::from(inputs.numbers::<3>(key)?))
}

fn list(vector: &Vector3<f64>) -> Value {
    json!(vector.as_slice())
}

/// A number in arcseconds, as an angle; 0 where it is not given.
fn arcseconds(inputs: Inputs, key: &str) -> f64 {
    inputs.number(key).unwrap_or(0.0) * ARCSECOND
}

fn orientation(inputs: Inputs) -> EarthOrientation {
    EarthOrientation {
        xp: arcseconds(inputs, "xp_arcsec"),
        yp: arcseconds(inputs, "yp_arcsec"),
        ut1_minus_utc: inputs.number("ut1_utc_s").unwrap_or(0.0),
    }
}

/// UTC as year, month, day, hours, minutes and seconds.
fn utc(fields: [f64; 6]) -> Result<GpsTime, CaseError> {
    let [year, month, day, hour, minute, second] = fields;
    let [month, day, hour, minute] = [month, day, hour, minute].map(|field| field as u8);
    let calendar = Calendar { year: year as i32, month, day, hour, minute, second };
    GpsTime::from_utc(&calendar).ok_or_else(|| CaseError::Absurd(format!("no such time: {fields:?}")))
}

/// Sun and Moon in ECEF.
pub fn sun_and_moon(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let SunMoon { sun, moon } = SunMoon::at(inputs.time()?, &orientation(inputs));
    Ok(Outputs::from([("sun_ecef", list(&sun)), ("moon_ecef", list(&moon))]))
}

/// Sidereal time, Earth rotation angle and the rotation from the celestial to the terrestrial frame. The cases leave
/// out the polar motion: it is that of the case of Sun and Moon at the same time.
pub fn rotation(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let (week, tow) = (inputs.integer("gps_week")?, inputs.number("tow")?);
    let time = inputs.time()?;
    let orientation = orientation(context.inputs_of(&format!("sunmoon_{week}_{tow}"))?);
    let rows: Vec<Vec<f64>> =
        gcrs_to_itrs(time, &orientation).row_iter().map(|row| row.iter().copied().collect()).collect();
    Ok(Outputs::from([
        ("gmst_iau1982", json!(mean_sidereal_time_1982(time, &orientation))),
        ("era_iau2000", json!(earth_rotation_angle(time, &orientation))),
        ("gcrs_to_itrs_rowmajor", json!(rows)),
    ]))
}

/// Solid Earth tide, with Sun and Moon given and with our own.
pub fn solid_tide(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let station = vector(inputs, "station_ecef")?;
    let [year, month, day, hours] = inputs.numbers("utc_ymd_fhr")?;
    let time = utc([year, month, day, 0.0, 0.0, 0.0])?.plus_seconds(hours * 3_600.0);
    let given = solid::displacement(&station, time, &vector(inputs, "sun_ecef")?, &vector(inputs, "moon_ecef")?);
    let SunMoon { sun, moon } = SunMoon::at(time, &EarthOrientation::default());
    let own = solid::displacement(&station, time, &sun, &moon);
    Ok(Outputs::from([("displacement", list(&given)), ("displacement_own_sun_moon", list(&own))]))
}

/// Pole tide: east, north, up.
pub fn pole_tide(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let (station, time) = (vector(inputs, "station_ecef")?, inputs.time()?);
    let displacement = pole::displacement(&station, time, &orientation(inputs));
    Ok(Outputs::from([
        ("secular_pole_arcsec", json!(pole::secular_pole(time).map(|angle| angle / ARCSECOND))),
        ("enu", list(&Geodetic::from_ecef(&station).ecef_to_enu(&displacement))),
    ]))
}

/// Ocean loading from the rows of a BLQ file.
pub fn ocean_loading(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let rows = inputs.rows::<CONSTITUENTS>("blq_rows_radial_west_south_amp_m_then_phase_deg")?;
    let [a, b, c, d, e, f] =
        rows.try_into().map_err(|_| CaseError::Absurd("ocean loading has six rows of coefficients".into()))?;
    let loading = OceanLoading::new(&[a, b, c], &[d, e, f].map(|row| row.map(f64::to_radians)));
    let enu = loading.displacement(utc(inputs.numbers("utc")?)?);
    let mut outputs = Outputs::from([("up_south_west", json!([enu.z, -enu.y, -enu.x]))]);
    if let Ok(station) = vector(inputs, "station_ecef") {
        outputs.add("ecef", list(&Geodetic::from_ecef(&station).enu_to_ecef(&enu)));
    }
    Ok(outputs)
}
