//! Ionosphere and troposphere.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::json;
use surefix_core::gnss::atmosphere::{Klobuchar, Mapping, StandardAtmosphere, ZenithDelay, niell as mapping};
use surefix_core::gnss::geodesy::{Geodetic, LookAngle};

fn place(inputs: Inputs) -> Result<Geodetic, CaseError> {
    Ok(Geodetic { latitude: inputs.number("lat")?, longitude: 0.0, height: inputs.number("height")? })
}

/// Klobuchar's broadcast ionosphere.
pub fn klobuchar(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let [a0, a1, a2, a3, b0, b1, b2, b3] = inputs.numbers("alpha_beta")?;
    let model = Klobuchar { alpha: [a0, a1, a2, a3], beta: [b0, b1, b2, b3] };
    let [latitude, longitude, height] = inputs.numbers("lat_lon_h")?;
    let look = LookAngle { azimuth: inputs.number("az")?, elevation: inputs.number("el")? };
    let delay = model.delay_l1(&Geodetic { latitude, longitude, height }, look, inputs.number("tow")?);
    Ok(vec![("delay_L1", json!(delay))])
}

/// Standard atmosphere, Saastamoinen's zenith delays and the flat mapping.
pub fn saastamoinen(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let (receiver, elevation) = (place(inputs)?, inputs.number("el")?);
    let weather = StandardAtmosphere::at_height(receiver.height, inputs.number("humidity")?);
    let zenith = weather.zenith_delay(&receiver);
    let slant = |zenith| json!(Mapping::Cosecant.slant(zenith, 1.0, &receiver, elevation));
    Ok(vec![
        ("pressure_hPa", json!(weather.pressure)),
        ("temperature_K", json!(weather.temperature)),
        ("vapour_pressure_hPa", json!(weather.vapour_pressure)),
        ("slant_hydrostatic", slant(ZenithDelay { wet: 0.0, ..zenith })),
        ("slant_total", slant(zenith)),
    ])
}

/// Niell's mapping functions.
pub fn niell(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let (receiver, elevation) = (place(inputs)?, inputs.number("el")?);
    let hydrostatic = mapping::hydrostatic(inputs.number("doy")?, &receiver, elevation);
    Ok(vec![("hydrostatic", json!(hydrostatic)), ("wet", json!(mapping::wet(receiver.latitude, elevation)))])
}
