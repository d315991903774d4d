//! `surefix compare`.

use super::Outcome;
use crate::compare::{Options, Truth, compare};
use crate::read::solution;
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
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let base = vector(args.base_xyz.as_deref());
    let solution = solution::read(&args.solution, &solution::Options { base, week: args.week, ..Default::default() })?;
    let near = solution.start;
    let truth = if let Some(path) = &args.truth {
        let only_quality = args.truth_quality.clone();
        Truth::Track(solution::read(path, &solution::Options { base, week: args.week, near, only_quality })?)
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
        start: args.start.zip(near).map(|(tow, near)| GpsTime::from_week_tow(near.week(), tow)),
    };
    let report = compare(&solution, &truth, &options);
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
