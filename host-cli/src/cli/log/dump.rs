//! `surefix log dump`.

use crate::cli::Outcome;
use crate::log::{Frame, LogReader};
use crate::write::csv::CsvWriter;
use serde_json::{Value, json};
use std::io::{self, BufWriter, Write, stdout};
use std::path::PathBuf;
use surefix_core::filter::section_v::{self, Setup};
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::satellite::SatelliteSet;
use surefix_core::log::{Config, Counts, EpochPart, EstimateRecord, Event, Header, PositionDensity, Record, Station};
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::feed::CONFIG_SCHEMA;

/// Print what a device log holds, one line a record, damaged places included.
///
/// Exit code 1 if any part of the log is damaged or its end is missing.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The log
    log: PathBuf,
    /// One JSON object a line, with every field of every record
    #[arg(long, group = "form")]
    json: bool,
    /// A table of the observations, one row a signal
    #[arg(long, group = "form")]
    csv: bool,
    /// A table of the solutions, one row an epoch
    #[arg(long, group = "form")]
    solutions: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut log = LogReader::open(&args.log)?;
    let mut first_bad = None;
    let mut ended = false;
    let mut printer = Printer::new(args, BufWriter::new(stdout().lock()))?;
    while let Some(frame) = log.next_frame()? {
        printer.print(&frame)?;
        match frame.record {
            Ok(record) => ended = matches!(record, Record::Event(Event::End)),
            Err(_) => first_bad = first_bad.or(Some(frame.offset)),
        }
    }
    printer.finish()?;
    let problems = problems(log.counts(), first_bad, ended);
    problems.iter().for_each(|problem| eprintln!("{}: {problem}", args.log.display()));
    Ok(if problems.is_empty() { Outcome::Good } else { Outcome::Bad })
}

/// Prints frames in the form that was asked for.
#[allow(clippy::large_enum_variant)] // there is only ever one
enum Printer<W: Write> {
    Text(W),
    Json(W),
    Observations(W),
    Solutions(Box<CsvWriter<W>>),
}

impl<W: Write> Printer<W> {
    fn new(args: &Args, mut out: W) -> io::Result<Self> {
        Ok(match args {
            Args { json: true, .. } => Self::Json(out),
            Args { solutions: true, .. } => Self::Solutions(Box::new(CsvWriter::new(out))),
            Args { csv: true, .. } => {
                out.write_all(COLUMNS)?;
                Self::Observations(out)
            }
            _ => Self::Text(out),
        })
    }

    fn print(&mut self, frame: &Frame<'_>) -> io::Result<()> {
        match (self, &frame.record) {
            (Self::Text(out), _) => writeln!(out, "{:>10}  {}", frame.offset, as_text(frame)),
            (Self::Json(out), _) => writeln!(out, "{}", as_json(frame)),
            (Self::Observations(out), Ok(Record::Epoch(part))) => write_rows(out, part),
            (Self::Solutions(table), Ok(Record::Solution(solution))) => table.push(solution),
            (Self::Observations(_) | Self::Solutions(_), _) => Ok(()),
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            Self::Text(mut out) | Self::Json(mut out) | Self::Observations(mut out) => out.flush(),
            Self::Solutions(table) => table.finish()?.flush(),
        }
    }
}

/// What is wrong with a log, and what to do.
fn problems(counts: &Counts, first_bad: Option<u64>, ended: bool) -> Vec<String> {
    let mut problems = Vec::new();
    if let Some(offset) = first_bad {
        let kinds = [
            (counts.checksum, "wrong checksum"),
            (counts.malformed, "not a frame"),
            (counts.overlong, "too long"),
            (counts.version, "other version"),
            (counts.kind, "unknown kind"),
            (counts.payload, "unreadable payload"),
            (counts.not_finite, "NaN or infinite number"),
        ];
        let kinds: Vec<_> =
            kinds.iter().filter(|(count, _)| *count > 0).map(|(count, name)| format!("{count} {name}")).collect();
        problems.push(format!(
            "{} of {} frames are damaged ({}), the first at byte {offset}; all others are intact. Fetch or record the \
             log again if the damaged ones matter",
            counts.bad(),
            counts.bad() + counts.good,
            kinds.join(", ")
        ));
    }
    if counts.observables_not_finite > 0 {
        problems.push(format!(
            "{} observables are NaN or infinite and are left out; the program that recorded them has an error",
            counts.observables_not_finite
        ));
    }
    if !ended {
        problems.push(
            "has no end mark: it was cut off, or the device lost power. What is there is intact, later records are \
             missing"
                .to_owned(),
        );
    }
    problems
}

/// The settings in a config record, if they are of the RTK filter.
fn rtk_config(config: &Config<'_>) -> Option<RtkConfig> {
    config.value().filter(|_| config.schema == CONFIG_SCHEMA)
}

/// The settings in a config record, if they are of the mixed-integer filter.
fn section_v_setup(config: &Config<'_>) -> Option<Setup> {
    config.value().filter(|_| config.schema == section_v::CONFIG_SCHEMA)
}

fn station_name(station: Station) -> &'static str {
    match station {
        Station::Rover => "rover",
        Station::Base => "base",
    }
}

/// One line: kind, and what there is to say about it.
fn as_text(frame: &Frame<'_>) -> String {
    let record = match &frame.record {
        Ok(record) => record,
        Err(error) => {
            let cut_off = if frame.cut_off { ", cut off by the end of the file" } else { "" };
            return format!("BAD         {error} ({} bytes{cut_off})", frame.length);
        }
    };
    match record {
        Record::Header(Header { base_position, base_antenna, rover_antenna }) => {
            let base = base_position.map_or("unknown".to_owned(), |[x, y, z]| format!("{x:.4} {y:.4} {z:.4}"));
            let [base_up, rover_up] = [base_antenna[0], rover_antenna[0]];
            format!("header      base {base}, antennas above markers: base {base_up:.4} rover {rover_up:.4}")
        }
        Record::Ionosphere(ionosphere) => {
            let k = ionosphere.klobuchar;
            format!(
                "ionosphere  {:?} alpha {:e} {:e} {:e} {:e} beta {} {} {} {}",
                ionosphere.constellation,
                k.alpha[0],
                k.alpha[1],
                k.alpha[2],
                k.alpha[3],
                k.beta[0],
                k.beta[1],
                k.beta[2],
                k.beta[3]
            )
        }
        Record::Ephemeris(ephemeris) => {
            let message = match ephemeris {
                Ephemeris::Kepler(kepler) => format!("{:?} IODE {}", kepler.message, kepler.iode),
                Ephemeris::Glonass(glonass) => format!("channel {}", glonass.channel),
            };
            let (satellite, toe, health) = (ephemeris.satellite(), ephemeris.toe(), ephemeris.health());
            format!("ephemeris   {satellite} toe {toe} {message} health {health}")
        }
        Record::Epoch(part) => {
            let satellites =
                part.observations().map(|observation| observation.satellite).collect::<SatelliteSet>().len();
            let of = if part.is_whole() { String::new() } else { format!(", from {} of {}", part.first, part.total) };
            let station = station_name(part.station);
            format!("{station:<10}  {} {satellites} satellites, {} signals{of}", part.time, part.count)
        }
        Record::Solution(s) => {
            let [x, y, z] = s.position.into();
            format!(
                "solution    {} {:?} ({:?}) {x:.4} {y:.4} {z:.4} {} satellites, ratio {:.1}",
                s.time,
                s.quality,
                s.reason,
                s.satellites_used.len(),
                s.ratio
            )
        }
        Record::Measurements(m) => {
            format!("measured    {} {} satellites, {} rows", m.time, m.satellites().len(), m.values().len())
        }
        Record::Estimate(record) => {
            let e = &record.estimate;
            let [x, y, z] = e.constrained.mean;
            let state = match e.refusal {
                Some(refusal) => format!("refused ({refusal:?})"),
                None => format!(
                    "{} ambiguities, {} slipped, NIS {:.1}",
                    record.ambiguities().count(),
                    record.ambiguities().filter(|ambiguity| ambiguity.slipped).count(),
                    e.relaxed_nis
                ),
            };
            format!("estimate    {} {x:.4} {y:.4} {z:.4} {state}", e.time)
        }
        Record::Event(event) => format!("event       {event:?}"),
        Record::Config(config) => match rtk_config(config) {
            Some(_) => format!("config      RTK filter, {} bytes", config.data.len()),
            None if section_v_setup(config).is_some() => {
                format!("config      mixed-integer filter, {} bytes", config.data.len())
            }
            None => format!("config      of unknown schema {}, {} bytes", config.schema, config.data.len()),
        },
    }
}

/// Every field of a record.
fn as_json(frame: &Frame<'_>) -> Value {
    let mut object = match &frame.record {
        Err(error) => json!({ "kind": "bad", "reason": error.to_string(), "cut_off": frame.cut_off }),
        Ok(Record::Header(header)) => json!({
            "kind": "header",
            "base_position": header.base_position,
            "base_antenna": header.base_antenna,
            "rover_antenna": header.rover_antenna,
        }),
        Ok(Record::Ionosphere(ionosphere)) => json!({
            "kind": "ionosphere",
            "constellation": ionosphere.constellation,
            "alpha": ionosphere.klobuchar.alpha,
            "beta": ionosphere.klobuchar.beta,
        }),
        Ok(Record::Ephemeris(ephemeris)) => json!({
            "kind": "ephemeris",
            "satellite": ephemeris.satellite().to_string(),
            "ephemeris": ephemeris,
        }),
        Ok(Record::Epoch(part)) => json!({
            "kind": "epoch",
            "station": station_name(part.station),
            "gps_week": part.time.week(),
            "gps_tow_s": part.time.tow(),
            "first": part.first,
            "total": part.total,
            "observations": part.observations().map(|observation| json!({
                "satellite": observation.satellite.to_string(),
                "signal": observation.signal.to_string(),
                "code_m": observation.code,
                "phase_cycles": observation.phase,
                "doppler_hz": observation.doppler,
                "cn0_dbhz": observation.cn0,
                "loss_of_lock": observation.loss_of_lock,
                "half_cycle": observation.half_cycle,
            })).collect::<Vec<_>>(),
        }),
        Ok(Record::Solution(solution)) => json!({
            "kind": "solution",
            "gps_week": solution.time.week(),
            "gps_tow_s": solution.time.tow(),
            "solution": solution,
        }),
        Ok(Record::Event(event)) => match event {
            Event::End => json!({ "kind": "event", "event": "end" }),
            Event::Reset => json!({ "kind": "event", "event": "reset" }),
            Event::Dropped(count) => json!({ "kind": "event", "event": "dropped", "count": count }),
            Event::Marker(value) => json!({ "kind": "event", "event": "marker", "value": value }),
        },
        Ok(Record::Measurements(m)) => json!({
            "kind": "measurements",
            "gps_week": m.time.week(),
            "gps_tow_s": m.time.tow(),
            "satellites": m.satellites().map(|s| [s.x, s.y, s.z]).collect::<Vec<_>>(),
            "values": m.values().collect::<Vec<_>>(),
        }),
        Ok(Record::Estimate(record)) => estimate_as_json(record),
        Ok(Record::Config(config)) => json!({
            "kind": "config",
            "schema": config.schema,
            "data": config.data,
            "settings": rtk_config(config).map(|settings| json!(settings)).or(section_v_setup(config).map(|setup| json!(setup))),
        }),
    };
    object["offset"] = frame.offset.into();
    object
}

fn estimate_as_json(record: &EstimateRecord<'_>) -> Value {
    let e = &record.estimate;
    let density = |density: &PositionDensity| json!({ "mean_m": density.mean, "covariance_m2": density.covariance });
    json!({
        "kind": "estimate",
        "gps_week": e.time.week(),
        "gps_tow_s": e.time.tow(),
        "refusal": e.refusal.map(|refusal| format!("{refusal:?}")),
        "relaxed": density(&e.relaxed),
        "constrained": density(&e.constrained),
        "relaxed_nis": e.relaxed_nis,
        "constrained_nis": e.constrained_nis,
        "best_norm": e.best_norm,
        "second_norm": e.second_norm,
        "success_rate": e.success_rate,
        "nodes": e.nodes,
        "bootstrapped": e.bootstrapped,
        "gated": e.gated,
        "common_jump_cycles": e.common_jump,
        "checksum": e.checksum,
        "ambiguities": record.ambiguities().map(|ambiguity| json!({
            "mean_cycles": ambiguity.mean,
            "variance_cycles2": ambiguity.variance,
            "integer_cycles": ambiguity.integer,
            "slip_estimate_cycles": ambiguity.slip_estimate,
            "slipped": ambiguity.slipped,
        })).collect::<Vec<_>>(),
    })
}

/// Head of the table of observations.
const COLUMNS: &[u8] =
    b"gps_week,gps_tow_s,station,satellite,signal,code_m,phase_cycles,doppler_hz,cn0_dbhz,loss_of_lock,half_cycle\n";

/// Observations as rows of the table.
fn write_rows(out: &mut impl Write, part: &EpochPart<'_>) -> io::Result<()> {
    let number = |value: Option<f64>| value.map(|x| x.to_string()).unwrap_or_default();
    for o in part.observations() {
        writeln!(
            out,
            "{},{},{},{},{},{},{},{},{},{},{}",
            part.time.week(),
            part.time.tow(),
            station_name(part.station),
            o.satellite,
            o.signal.to_string().trim(),
            number(o.code),
            number(o.phase),
            number(o.doppler),
            o.cn0.map(|x| x.to_string()).unwrap_or_default(),
            u8::from(o.loss_of_lock),
            u8::from(o.half_cycle)
        )?;
    }
    Ok(())
}
