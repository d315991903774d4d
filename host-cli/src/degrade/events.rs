//! What was done to the observations: the truth that a detector is to find.

use serde::Serialize;
use std::io::{self, Write};
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;

/// The kind of an event, and what its size is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum What {
    /// A street between buildings begins; factor on reflections.
    Canyon,
    /// It ends.
    OpenSky,
    /// A satellite is taken away; the elevation of the roof before it `[deg]`.
    Hidden,
    /// A satellite is seen by reflection only; excess path at the first epoch `[m]`.
    Reflected,
    /// It is seen directly again; the elevation of the roof there `[deg]`.
    Direct,
    /// A signal's ambiguity changes while it is tracked `[cycles]`.
    Slip,
    /// A signal's ambiguity is a new one: its phase was away, or changes between direct signal and reflection `[cycles]`.
    Reacquired,
}

/// An event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// First epoch with it.
    pub time: GpsTime,
    /// Of which satellite; none where it is about all.
    pub satellite: Option<SatelliteId>,
    /// Of which signal; none where it is about all of the satellite.
    pub signal: Option<Signal>,
    /// What.
    pub what: What,
    /// How much; see [`What`].
    pub size: f64,
    /// Whether the loss-of-lock indicator was raised; none where no ambiguity changes.
    pub flagged: Option<bool>,
}

/// A row of the table.
#[derive(Serialize)]
struct Row {
    gps_week: i32,
    gps_tow_s: f64,
    satellite: Option<String>,
    signal: Option<String>,
    what: What,
    size: f64,
    flagged: Option<bool>,
}

/// Columns: there is a header row even if nothing was done.
const COLUMNS: [&str; 7] = ["gps_week", "gps_tow_s", "satellite", "signal", "what", "size", "flagged"];

/// Writes events as CSV.
pub fn write(events: &[Event], out: impl Write) -> io::Result<()> {
    let mut table = ::csv::WriterBuilder::new().has_headers(false).from_writer(out);
    table.write_record(COLUMNS)?;
    for event in events {
        table.serialize(Row {
            gps_week: event.time.week(),
            gps_tow_s: event.time.tow(),
            satellite: event.satellite.map(|satellite| satellite.to_string()),
            signal: event.signal.map(|signal| signal.to_string()),
            what: event.what,
            size: event.size,
            flagged: event.flagged,
        })?;
    }
    table.flush()
}
