//! Which broadcast ephemeris is used when.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::{Value, json};
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::orbit::store::{EphemerisStore, SelectionRule};
use surefix_core::gnss::satellite::SatelliteId;

/// Messages of one satellite in a day: one of each Galileo message every ten minutes, with room to spare.
type OneSatellite = EphemerisStore<512>;

/// The nearest ephemeris of a navigation file within RTKLIB's limits, which the file of vectors is made for.
pub fn selection(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let satellite: SatelliteId = inputs.parsed("sat")?;
    let data = context.source.data.navigation(inputs.text("file")?)?;
    let mut store = OneSatellite::new();
    for ephemeris in data.ephemerides.iter().filter(|ephemeris| ephemeris.satellite() == satellite) {
        store.insert(*ephemeris);
    }
    let selected = store.select(satellite, inputs.time()?, &SelectionRule::RTKLIB).map_or(Value::Null, |ephemeris| {
        let iode = match ephemeris {
            Ephemeris::Kepler(kepler) => kepler.iode,
            Ephemeris::Glonass(glonass) => glonass.iode,
        };
        json!([ephemeris.toe().week(), ephemeris.toe().tow(), iode, ephemeris.health()])
    });
    Ok(Outputs::from([("selected_toe_week_toe_tow_iode_health", selected)]))
}
