//! Precise orbits and clocks between the nodes of SP3 and clock files.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::{Value, json};
use surefix_core::gnss::geodesy::rotate_ecef;
use surefix_core::gnss::precise::{ClockNode, OrbitNode, PreciseOrbit, clock, orbit};
use surefix_core::gnss::relativity::clock_correction;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::time::GpsTime;

/// The nodes of a satellite.
struct Tables {
    orbit: Vec<OrbitNode>,
    clock: Vec<ClockNode>,
    /// Longest time between clocks to interpolate across `[s]`.
    max_gap: f64,
}

/// Orbit and clock of an SP3 file, or of the nodes that a case lists of it where the file is not at hand.
pub fn sp3(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let time = inputs.time()?;
    let tables = match from_files(context, inputs) {
        Err(CaseError::Absent { .. }) => listed(inputs, time)?,
        tables => tables?,
    };
    // Turned back beforehand, nodes come to be interpolated as they are.
    let not_rotated: Vec<OrbitNode> = tables
        .orbit
        .iter()
        .map(|node| OrbitNode { position: rotate_ecef(&node.position, node.time.since(time)), ..*node })
        .collect();
    let at = orbit(&tables.orbit, time).ok();
    let bias = clock(&tables.clock, time, tables.max_gap).ok().map(|value| value.bias);
    let with_relativity =
        bias.zip(at).map(|(bias, PreciseOrbit { position, velocity })| bias + clock_correction(&position, &velocity));
    Ok(Outputs::from([
        ("position", position(at)),
        ("position_without_node_rotation", position(orbit(&not_rotated, time).ok())),
        ("velocity", at.map_or(Value::Null, |orbit| json!(orbit.velocity.as_slice()))),
        ("clock_linear", json!(bias)),
        ("clock_with_relativity", json!(with_relativity)),
    ]))
}

/// Clock of a clock file, or of the nodes that a case lists of it where the file is not at hand.
pub fn clk(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let time = inputs.time()?;
    let tables = match from_files(context, inputs) {
        Err(CaseError::Absent { .. }) => Tables { clock: clock_nodes(inputs, time)?, ..Tables::none() },
        tables => tables?,
    };
    let bias = clock(&tables.clock, time, tables.max_gap).ok().map(|value| value.bias);
    Ok(Outputs::from([("clock_linear", json!(bias))]))
}

/// Cases that name no model ask for a refusal, which files alone can show.
pub fn refusal(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let time = inputs.time()?;
    let tables = from_files(context, inputs)?;
    let bias = clock(&tables.clock, time, tables.max_gap).ok().map(|value| value.bias);
    Ok(Outputs::from([("position", position(orbit(&tables.orbit, time).ok())), ("clock_linear", json!(bias))]))
}

fn position(orbit: Option<PreciseOrbit>) -> Value {
    orbit.map_or(Value::Null, |orbit| json!(orbit.position.as_slice()))
}

impl Tables {
    fn none() -> Self {
        Self { orbit: Vec::new(), clock: Vec::new(), max_gap: f64::INFINITY }
    }
}

/// The nodes that a case lists, as seconds from its time.
fn listed(inputs: Inputs, time: GpsTime) -> Result<Tables, CaseError> {
    let offsets = inputs.list("node_offsets_s")?;
    let positions = inputs.rows::<3>("nodes_ecef_m")?;
    let node =
        |(offset, position): (f64, [f64; 3])| OrbitNode { time: time.plus_seconds(offset), position: position.into() };
    let orbit = offsets.into_iter().zip(positions).map(node).collect();
    // (Cases whose clock is to be refused list none.)
    Ok(Tables { orbit, clock: clock_nodes(inputs, time).unwrap_or_default(), ..Tables::none() })
}

fn clock_nodes(inputs: Inputs, time: GpsTime) -> Result<Vec<ClockNode>, CaseError> {
    let node = |[offset, bias]: [f64; 2]| ClockNode { time: time.plus_seconds(offset), bias };
    Ok(inputs.rows::<2>("clock_nodes")?.into_iter().map(node).collect())
}

/// The nodes of the files that `product` means: `COD0MGXFIN 2020-177 05M`, `GRG0MGXFIN 2020-176 + 2020-177 15M`,
/// `GRG0MGXFIN 2020-177 30S CLK`, and after `edited` what is taken out of them.
fn from_files(context: &Context, inputs: Inputs) -> Result<Tables, CaseError> {
    let satellite: SatelliteId = inputs.parsed("sat")?;
    let product = inputs.text("product")?;
    let absurd = || CaseError::Absurd(format!("product \"{product}\" is not known"));
    let (name, edit) = product.split_once(" edited").map_or((product, None), |(name, edit)| (name, Some(edit)));
    let words: Vec<&str> = name.split_whitespace().filter(|word| *word != "+").collect();
    let (centre, rest) = words.split_first().ok_or_else(absurd)?;
    let day = |word: &str| word.split_once('-').map(|(year, day)| format!("{year}{day}0000"));
    let days: Vec<String> = rest.iter().map_while(|word| day(word)).collect();
    let mut tables = Tables::none();
    match rest.get(days.len()..).ok_or_else(absurd)? {
        [spacing] => {
            for day in &days {
                let sp3 = context.source.data.sp3(&format!("{centre}_{day}_01D_{spacing}_ORB.SP3"))?;
                tables.max_gap = sp3.headers.first().map_or(0.0, |header| header.interval);
                tables.orbit.extend_from_slice(sp3.orbit(satellite));
                tables.clock.extend_from_slice(sp3.clock(satellite));
            }
        }
        [spacing, "CLK"] => {
            for day in &days {
                let clocks = context.source.data.clocks(&format!("{centre}_{day}_01D_{spacing}_CLK.CLK"))?;
                tables.max_gap = clocks.spacing().unwrap_or(0.0);
                tables.clock.extend_from_slice(clocks.clock(satellite));
            }
        }
        _ => return Err(absurd()),
    }
    if let Some(edit) = edit {
        take_out(&mut tables, satellite, edit, inputs.time()?).ok_or_else(absurd)?;
    }
    Ok(tables)
}

/// Takes out nodes as in `: at 12:00:00 PG05 set to 0.0 0.0 0.0 999999.999999, PE12 clock set to 999999.999999`, of the day
/// of `time`.
fn take_out(tables: &mut Tables, satellite: SatelliteId, edit: &str, time: GpsTime) -> Option<()> {
    let (clock, what) = edit.strip_prefix(": at ")?.split_once(' ')?;
    let mut parts = clock.split(':').map(str::parse::<f64>);
    let mut part = || parts.next()?.ok();
    let of_day = part()? * 3_600.0 + part()? * 60.0 + part()?;
    let day = (time.tow() / 86_400.0).floor() * 86_400.0;
    let at = GpsTime::from_week_tow(time.week(), day + of_day);
    for change in what.split(", ").filter(|change| change.starts_with(&format!("P{satellite} "))) {
        tables.clock.retain(|node| node.time != at);
        if !change.contains("clock") {
            tables.orbit.retain(|node| node.time != at);
        }
    }
    Some(())
}
