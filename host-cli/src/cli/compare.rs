//! `surefix compare`.

use super::Outcome;
use crate::compare::{Options, Truth, compare};
use crate::read::solution;
use anyhow::Context;
use nalgebra::Vector3;
use std::io::Write;
use std::path::PathBuf;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::time::GpsTime;

/// Compare a solution with the truth.
///
/// Prints how many epochs are fixed and how many of them wrongly, the time to the first fix, the errors in east, north
/// and up, and the errors over their own standard deviations.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  surefix compare rover.pos truth.csv
  surefix compare rover.csv receiver.csv --truth-quality 4
  surefix compare rover.csv truth.csv --stanford pl --alert-limits 0.5 1
  surefix compare front.csv vectors.csv --vectors
  surefix compare rover.pos --truth-llh 35.134699010 136.977575490 104.8626 --json

Files, plain or .gz, told by their content:
  .pos   of RTKLIB or surefix: degrees, ECEF or baselines; calendar or week and seconds; GPST, UTC or JST
  table  comma-separated with a header row that names time (tow, week) and x, y, z or latitude, longitude, height;
         as written by surefix post and surefix simulate")]
pub struct Args {
    /// Solution to judge.
    solution: PathBuf,
    /// True positions over time.
    #[arg(required_unless_present_any = ["truth_xyz", "truth_llh"])]
    truth: Option<PathBuf>,
    /// True coordinate of an antenna at rest, ECEF metres.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true,
          conflicts_with_all = ["truth", "truth_llh"])]
    truth_xyz: Option<Vec<f64>>,
    /// True coordinate of an antenna at rest: latitude and longitude in degrees, ellipsoidal height in metres.
    #[arg(long, num_args = 3, value_names = ["LAT", "LON", "HEIGHT"], allow_negative_numbers = true,
          conflicts_with = "truth")]
    truth_llh: Option<Vec<f64>>,
    /// Use only rows of the truth whose quality column reads like this (4 for fixed in NMEA).
    #[arg(long, value_name = "QUALITY")]
    truth_quality: Option<String>,
    /// GPS week of a truth that has seconds of week only (default: the one nearest to the solution).
    #[arg(long)]
    week: Option<i32>,
    /// Base coordinate, ECEF metres, where a .pos has baselines.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    base_xyz: Option<Vec<f64>>,
    /// Largest difference of time between an epoch and its truth, seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.05)]
    tolerance: f64,
    /// Interpolate between true positions that are at most this many seconds apart; 0 for never.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    interpolate: f64,
    /// A fixed epoch is wrong if its 3-D error exceeds this many metres.
    #[arg(long, value_name = "METERS", default_value_t = 0.1)]
    wrong_threshold: f64,
    /// Rover epochs that the fix rate refers to (default: epochs in the solution).
    #[arg(long)]
    epochs: Option<usize>,
    /// When the clock for the first fix starts, seconds of the GPS week (default: first epoch of the solution).
    #[arg(long, value_name = "TOW")]
    start: Option<f64>,
    /// Compare vectors from a moving base with true ones (columns dx, dy, dz), as if both began at the first base position
    /// of the solution.
    #[arg(long, requires = "truth")]
    vectors: bool,
    /// Judge protection levels: write the Stanford diagram as NAME.svg and NAME.png with counts in NAME.csv.
    #[arg(long, value_name = "NAME")]
    stanford: Option<PathBuf>,
    /// Horizontal and vertical alert limit, metres.
    #[arg(long, num_args = 2, value_names = ["H", "V"], default_values_t = [1.0, 2.0])]
    alert_limits: Vec<f64>,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let base = vector(args.base_xyz.as_deref());
    let vectors_from = if args.vectors { Some(solution::first_base(&args.solution)?) } else { None };
    let options = solution::Options { base, week: args.week, vectors_from, ..Default::default() };
    let solution = solution::read(&args.solution, &options)?;
    let near = solution.start;
    let alert_limits = <[f64; 2]>::try_from(args.alert_limits.as_slice())?;
    if !alert_limits.iter().all(|limit| *limit > 0.0) {
        anyhow::bail!("--alert-limits: an alert limit is a distance; give two numbers above 0, metres");
    }
    let truth = if let Some(path) = &args.truth {
        let only_quality = args.truth_quality.clone();
        Truth::Track(solution::read(path, &solution::Options { near, only_quality, ..options })?)
    } else if let Some(position) = vector(args.truth_xyz.as_deref()) {
        Truth::Fixed(position)
    } else if let Some(llh) = vector(args.truth_llh.as_deref()) {
        let (latitude, longitude) = (llh.x.to_radians(), llh.y.to_radians());
        Truth::Fixed(Geodetic { latitude, longitude, height: llh.z }.to_ecef())
    } else {
        anyhow::bail!("no truth: give a file, --truth-xyz or --truth-llh");
    };
    let options = Options {
        tolerance: args.tolerance,
        interpolate: args.interpolate,
        wrong_threshold: args.wrong_threshold,
        epochs: args.epochs,
        alert_limits: args.stanford.as_ref().map(|_| alert_limits),
        start: args.start.zip(near).map(|(tow, near)| GpsTime::from_week_tow(near.week(), tow)),
    };
    let report = compare(&solution, &truth, &options);
    if let Some(path) = &args.stanford {
        let stanford = report.stanford.as_ref().context(
            "--stanford: the solution has no protection levels at epochs with a truth; give a .csv of surefix post",
        )?;
        let name = path.file_name().and_then(|name| name.to_str()).context("--stanford: give a name for the files")?;
        let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        for file in stanford.write(directory.unwrap_or(std::path::Path::new(".")), name)? {
            eprintln!("wrote {}", file.display());
        }
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        write!(out, "{report}")?;
    }
    Ok(if report.matched > 0 { Outcome::Good } else { Outcome::Bad })
}

fn vector(components: Option<&[f64]>) -> Option<Vector3<f64>> {
    match components {
        Some(&[x, y, z]) => Some(Vector3::new(x, y, z)),
        _ => None,
    }
}
