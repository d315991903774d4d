//! `surefix log`.

use super::Outcome;
use super::engine::EngineArgs;
use super::files::Files;
use crate::log::{Frame, LogReader, LogWriter};
use anyhow::Context;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufWriter, Write, stdout};
use std::path::{Path, PathBuf};
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::satellite::SatelliteSet;
use surefix_core::log::{Counts, EpochPart, Event, Header, Record, Station};
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::feed::CONFIG_SCHEMA;

/// Pack RINEX files into a device log, or dump one.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Pack(PackArgs),
    Dump(DumpArgs),
}

/// Make a device log of RINEX files, its records in the order in which a receiver would have them.
///
/// Nothing recorded is lost or rounded: `surefix replay` of the log gives what `surefix post` gives of the files.
#[derive(clap::Args, Debug)]
struct PackArgs {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    engine: EngineArgs,
    /// The log to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Print what a device log holds, one line a record, damaged places included.
///
/// Exit code 1 if any part of the log is damaged or its end is missing.
#[derive(clap::Args, Debug)]
struct DumpArgs {
    /// The log
    log: PathBuf,
    /// One JSON object a line, with every field of every record
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// A table of the observations, one row a signal
    #[arg(long)]
    csv: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::Pack(args) => pack(args),
        Command::Dump(args) => dump(args),
    }
}

fn pack(args: &PackArgs) -> anyhow::Result<Outcome> {
    let mut files = args.files.open()?;
    files.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    // Under another name until it is complete, so that an error leaves no half log, and an input survives a slip of
    // the pen.
    let mut partial = args.output.clone().into_os_string();
    partial.push(".partial");
    let partial = PathBuf::from(partial);
    let done = write_log(&mut files, &args.engine.rtk_config()?, &partial).and_then(|records| {
        std::fs::rename(&partial, &args.output)
            .with_context(|| format!("{}: cannot be written", args.output.display()))?;
        Ok(records)
    });
    files.reports().iter().for_each(|report| eprintln!("{report}"));
    match done {
        Ok(records) => {
            eprintln!("{}: {records} records", args.output.display());
            Ok(Outcome::Good)
        }
        Err(error) => {
            // It may not exist yet; the error is the news.
            let _ = std::fs::remove_file(&partial);
            Err(error)
        }
    }
}

fn write_log(files: &mut super::files::OpenFiles, config: &RtkConfig, path: &Path) -> anyhow::Result<u64> {
    let cannot_write = || format!("{}: cannot be written", path.display());
    let mut log = LogWriter::new(BufWriter::new(File::create(path).with_context(cannot_write)?));
    let mut stream = files.stream();
    log.config(CONFIG_SCHEMA, config).with_context(cannot_write)?;
    let mut records = 1;
    for input in stream.by_ref() {
        log.input(&input?).with_context(cannot_write)?;
        records += 1;
    }
    stream.coverage()?;
    log.finish().with_context(cannot_write)?;
    Ok(records)
}

fn dump(args: &DumpArgs) -> anyhow::Result<Outcome> {
    let mut log = LogReader::open(&args.log)?;
    let mut out = BufWriter::new(stdout().lock());
    let mut first_bad = None;
    let mut ended = false;
    if args.csv {
        writeln!(
            out,
            "gps_week,gps_tow_s,station,satellite,signal,code_m,phase_cycles,doppler_hz,cn0_dbhz,loss_of_lock,half_cycle"
        )?;
    }
    while let Some(frame) = log.next_frame()? {
        match (&frame.record, args.csv, args.json) {
            (Ok(Record::Epoch(part)), true, _) => write_rows(&mut out, part)?,
            (_, true, _) => {}
            (_, _, true) => writeln!(out, "{}", as_json(&frame))?,
            _ => writeln!(out, "{:>10}  {}", frame.offset, as_text(&frame))?,
        }
        match frame.record {
            Ok(record) => ended = matches!(record, Record::Event(Event::End)),
            Err(_) => first_bad = first_bad.or(Some(frame.offset)),
        }
    }
    out.flush()?;
    let problems = problems(log.counts(), first_bad, ended);
    problems.iter().for_each(|problem| eprintln!("{}: {problem}", args.log.display()));
    Ok(if problems.is_empty() { Outcome::Good } else { Outcome::Bad })
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
        Record::Event(event) => format!("event       {event:?}"),
        Record::Config(config) => format!("config      schema {}, {} bytes", config.schema, config.data.len()),
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
        Ok(Record::Config(config)) => json!({ "kind": "config", "schema": config.schema, "data": config.data }),
    };
    object["offset"] = frame.offset.into();
    object
}

fn write_rows(out: &mut impl Write, part: &EpochPart<'_>) -> std::io::Result<()> {
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
