//! Broadcast orbits and clocks.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::{Value, json};
use surefix_core::gnss::ephemeris::{Ephemeris, GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use surefix_core::gnss::time::GpsTime;

/// Orbit and clock of GPS, Galileo, BeiDou and QZSS.
pub fn kepler(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let all = Inputs(&context.source.root).object("ephemerides")?;
    let ephemeris = kepler_ephemeris(all.object(inputs.text("eph")?)?)?;
    let time = inputs.time()?;
    let mut outputs = states(Ephemeris::Kepler(ephemeris), time);
    outputs.push(("tk_s", json!(time.since(ephemeris.toe))));
    Ok(outputs)
}

/// Orbit and clock of GLONASS.
pub fn glonass(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let toe = inputs.time_at("toe_gpst")?;
    let ephemeris = GlonassEphemeris {
        satellite: inputs.parsed("sat")?,
        iode: 0,
        channel: 0,
        toe,
        position: inputs.numbers("pos")?,
        velocity: inputs.numbers("vel")?,
        acceleration: inputs.numbers("acc")?,
        clock_bias: -inputs.number("taun")?,
        frequency_bias: inputs.number("gamn")?,
        health: 0,
        age: 0.0,
    };
    Ok(states(Ephemeris::Glonass(ephemeris), toe.plus_seconds(inputs.number("dt")?)))
}

fn states(ephemeris: Ephemeris, time: GpsTime) -> Outputs {
    let Ok(state) = ephemeris.state(time) else {
        return ["position", "velocity", "clock", "relativistic"].map(|name| (name, Value::Null)).to_vec();
    };
    vec![
        ("position", json!(state.position.as_slice())),
        ("velocity", json!(state.velocity.as_slice())),
        ("clock", json!(state.clock)),
        ("relativistic", json!(state.relativity)),
    ]
}

/// What orbit and clock depend on; message, health and group delays are left out.
fn kepler_ephemeris(from: Inputs) -> Result<KeplerEphemeris, CaseError> {
    Ok(KeplerEphemeris {
        satellite: from.parsed("sat")?,
        message: NavigationMessage::Lnav,
        iode: 0,
        toe: from.time_at("toe_gpst")?,
        toc: from.time_at("toc_gpst")?,
        sqrt_a: from.number("A")?.sqrt(),
        e: from.number("e")?,
        m0: from.number("M0")?,
        delta_n: from.number("deln")?,
        i0: from.number("i0")?,
        idot: from.number("idot")?,
        omega0: from.number("OMG0")?,
        omega: from.number("omg")?,
        omega_dot: from.number("OMGd")?,
        cuc: from.number("cuc")?,
        cus: from.number("cus")?,
        crc: from.number("crc")?,
        crs: from.number("crs")?,
        cic: from.number("cic")?,
        cis: from.number("cis")?,
        af0: from.number("f0")?,
        af1: from.number("f1")?,
        af2: from.number("f2")?,
        group_delay: [0.0; 2],
        health: 0,
        accuracy: 0.0,
        fit_interval: 0.0,
    })
}
