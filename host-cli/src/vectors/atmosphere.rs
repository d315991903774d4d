//! Ionosphere and troposphere.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::{Value, json};
use surefix_core::gnss::atmosphere::tec::{SingleLayer, TecMaps, code_delay};
use surefix_core::gnss::atmosphere::{
    GlobalWeather, Gpt3Weather, Klobuchar, Mapping, MappingFunction, SiteMapping, StandardAtmosphere, ZenithDelay,
    niell,
};
use surefix_core::gnss::geodesy::{Geodetic, LookAngle};
use surefix_core::gnss::time::GpsTime;

/// 0 °C `[K]`.
const CELSIUS: f64 = 273.15;
/// GPS L1 `[Hz]`.
const L1: f64 = 1_575.42e6;
/// Modified Julian day of the start of GPS time.
const GPS_EPOCH: f64 = 44_244.0;

fn place(inputs: Inputs) -> Result<Geodetic, CaseError> {
    Ok(Geodetic { latitude: inputs.number("lat")?, longitude: 0.0, height: inputs.number("height")? })
}

/// A receiver given as latitude, longitude `[rad]` and height `[m]`.
fn position(inputs: Inputs) -> Result<Geodetic, CaseError> {
    let [latitude, longitude, height] = inputs.numbers("lat_lon_h")?;
    Ok(Geodetic { latitude, longitude, height })
}

/// A time given as a modified Julian day.
fn modified_julian(inputs: Inputs) -> Result<GpsTime, CaseError> {
    Ok(GpsTime::default().plus_seconds((inputs.number("mjd")? - GPS_EPOCH) * 86_400.0))
}

/// Klobuchar's broadcast ionosphere.
pub fn klobuchar(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let [a0, a1, a2, a3, b0, b1, b2, b3] = inputs.numbers("alpha_beta")?;
    let model = Klobuchar { alpha: [a0, a1, a2, a3], beta: [b0, b1, b2, b3] };
    let look = LookAngle { azimuth: inputs.number("az")?, elevation: inputs.number("el")? };
    let delay = model.delay_l1(&position(inputs)?, look, inputs.number("tow")?);
    Ok(Outputs::from([("delay_L1", json!(delay))]))
}

/// Standard atmosphere, Saastamoinen's zenith delays and the flat mapping.
pub fn saastamoinen(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let (receiver, elevation) = (place(inputs)?, inputs.number("el")?);
    let weather = StandardAtmosphere::at_height(receiver.height, inputs.number("humidity")?);
    let zenith = weather.zenith_delay(&receiver);
    let slant = |zenith| json!(Mapping::Cosecant.slant(zenith, 1.0, &receiver, elevation));
    Ok(Outputs::from([
        ("pressure_hPa", json!(weather.pressure)),
        ("temperature_K", json!(weather.temperature)),
        ("vapour_pressure_hPa", json!(weather.vapour_pressure)),
        ("slant_hydrostatic", slant(ZenithDelay { wet: 0.0, ..zenith })),
        ("slant_total", slant(zenith)),
    ]))
}

/// Niell's mapping functions.
pub fn niell(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    Ok(mapping_functions(&niell::site(inputs.number("doy")?, &place(inputs)?), inputs.number("el")?))
}

/// GMF's mapping functions.
pub fn gmf(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    Ok(mapping_functions(&MappingFunction::Gmf.at(modified_julian(inputs)?, &position(inputs)?), inputs.number("el")?))
}

fn mapping_functions(site: &SiteMapping, elevation: f64) -> Outputs {
    let sin = elevation.sin();
    Outputs::from([("hydrostatic", json!(site.hydrostatic(sin))), ("wet", json!(site.wet(sin)))])
}

/// GPT's weather and geoid.
pub fn gpt(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let weather = GlobalWeather::at(modified_julian(inputs)?, &position(inputs)?);
    Ok(Outputs::from([
        ("pressure_hPa", json!(weather.pressure)),
        ("temperature_C", json!(weather.temperature - CELSIUS)),
        ("geoid_undulation", json!(weather.undulation)),
    ]))
}

/// GPT3 on a grid: weather, mapping coefficients, gradients and zenith delays.
pub fn gpt3(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let name = inputs.text("grid")?.split_whitespace().next().unwrap_or_default();
    let grid = context.source.data.gpt3(name)?;
    let (time, receiver) = (modified_julian(inputs)?, position(inputs)?);
    let outside = || CaseError::Absurd(format!("{name} has no cells there"));
    let weather = Gpt3Weather::at(grid.as_ref(), time, &receiver).ok_or_else(outside)?;
    let zenith = weather.zenith_delay(&receiver);
    let ([north_h, east_h], [north_w, east_w]) = (weather.hydrostatic_gradients, weather.wet_gradients);
    Ok(Outputs::from([
        ("pressure_hPa", json!(weather.pressure)),
        ("temperature_C", json!(weather.temperature - CELSIUS)),
        ("lapse_K_per_km", json!(weather.lapse_rate * 1e3)),
        ("Tm_K", json!(weather.mean_temperature)),
        ("vapour_pressure_hPa", json!(weather.vapour_pressure)),
        ("ah", json!(weather.hydrostatic_a)),
        ("aw", json!(weather.wet_a)),
        ("lambda", json!(weather.decrease)),
        ("undulation_m", json!(weather.undulation)),
        ("Gn_h", json!(north_h)),
        ("Ge_h", json!(east_h)),
        ("Gn_w", json!(north_w)),
        ("Ge_w", json!(east_w)),
        ("zhd_saastamoinen", json!(zenith.hydrostatic)),
        ("zwd_askne", json!(zenith.wet)),
    ]))
}

/// IONEX: pierce point, vertical content and delay, with and without the receiver's height and the Sun.
pub fn ionex(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let maps = context.source.data.ionex(inputs.text("file")?)?;
    let (time, receiver) = (inputs.time()?, position(inputs)?);
    let look = LookAngle { azimuth: inputs.number("az")?, elevation: inputs.number("el")? };
    let layer = |with_receiver_height| -> Result<SingleLayer, CaseError> {
        Ok(SingleLayer {
            base_radius: inputs.number("base_radius_km")? * 1e3,
            shell_height: inputs.number("shell_height_km")? * 1e3,
            with_receiver_height,
        })
    };
    let outside = || CaseError::Absurd("outside of the maps".into());
    let turned = maps.maps_at(time).ok_or_else(outside)?;
    let unturned = TecMaps { turned: false, ..turned };
    let of = |layer: SingleLayer| -> Result<[Value; 4], CaseError> {
        let pierced = layer.pierce(&receiver, look).ok_or_else(outside)?;
        let vertical = turned.vertical(time, &pierced).ok_or_else(outside)?;
        let delay = |maps: &TecMaps| maps.slant(&layer, time, &receiver, look).map(|tec| code_delay(tec, L1));
        let place = [pierced.latitude.to_degrees(), pierced.longitude.to_degrees()];
        Ok([json!(vertical), json!(place), json!(delay(&turned)), json!(delay(&unturned))])
    };
    let [vertical, place, rotated, unrotated] = of(layer(false)?)?;
    let [vertical_with, place_with, rotated_with, unrotated_with] = of(layer(true)?)?;
    Ok(Outputs::from([
        ("vtec_TECU", vertical),
        ("ipp_lat_lon_deg", place),
        ("delay_L1_rotated", rotated),
        ("delay_L1_unrotated", unrotated),
        ("vtec_TECU_with_station_height", vertical_with),
        ("ipp_lat_lon_deg_with_station_height", place_with),
        ("delay_L1_rotated_with_station_height", rotated_with),
        ("delay_L1_unrotated_with_station_height", unrotated_with),
    ]))
}
