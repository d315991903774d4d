//! `surefix ppp`.

use super::Outcome;
use super::results::{self, Results};
use super::smoothing::with_progress;
use crate::process::ppp::files::{FileList, Opened};
use crate::process::ppp::run::{self, Done, Job, Run};
use crate::process::ppp::settings::Settings;
use crate::process::settings::parse_bands;
use crate::read::FileKind;
use crate::smooth::ppp::Smoothed;
use crate::smooth::ppp::noise::Measurements;
use crate::smooth::ppp::pools::Rule;
use crate::write::pos::Header;
use crate::write::ppp::tables;
use anyhow::{Context, bail};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use std::time::Duration;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::solution::Quality;
use surefix_core::gnss::time::{Calendar, GpsTime};
use surefix_core::ppp::config::{Ionosphere, Motion};

/// Precise point positioning: one receiver, precise orbits and clocks.
///
/// Files are told apart by their content: observations (several are processed one after another), SP3 orbits and clock files of
/// the days around, navigation messages, ANTEX. Writes into DIR, NAME being that of the observations: NAME.pos, .csv and .json
/// as `post` does, NAME-ppp.csv (clock, biases, zenith delay), NAME-residuals.csv, and with --em what was learned, with plots.
/// Positions are those of the marker in the frame of the orbits, without tides.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  surefix ppp esbc.crx.gz GRG.SP3.gz GRG.CLK.gz --antex igs14.atx.gz -o out
  surefix ppp esbc.crx.gz GRG.SP3.gz GRG.CLK.gz --antex igs14.atx.gz --blq esbc.blq --erp finals2000A.gz --kinematic --em -o out
  surefix ppp --print-config > ppp.toml")]
pub struct Args {
    /// Observations, SP3, clocks, navigation messages, in any order; plain, gzipped or compact
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Antennas of satellites and receiver (ANTEX), one file or more
    #[arg(long, value_name = "FILE")]
    antex: Vec<PathBuf>,
    /// Biases of codes: Bias-SINEX (OSB, DSB) or CODE's DCB files
    #[arg(long, value_name = "FILE")]
    bias: Vec<PathBuf>,
    /// Ocean loading (BLQ)
    #[arg(long, value_name = "FILE")]
    blq: Option<PathBuf>,
    /// Orientation of the Earth: IERS finals or IGS ERP
    #[arg(long, value_name = "FILE")]
    erp: Vec<PathBuf>,
    /// The receiver is at rest (the default)
    #[arg(long = "static", conflicts_with = "kinematic")]
    at_rest: bool,
    /// The receiver moves
    #[arg(long)]
    kinematic: bool,
    /// Estimate every epoch from all epochs, those after it too
    #[arg(long)]
    smooth: bool,
    /// Learn the noise of motion and measurements from the data (expectation maximisation); smooths too
    #[arg(long)]
    em: bool,
    /// How variances of measurements are learned
    #[arg(long, value_enum, default_value = "student-t", requires = "em")]
    scheme: Scheme,
    /// Most iterations of EM
    #[arg(long, requires = "em", value_name = "N")]
    iterations: Option<usize>,
    /// Constellations that are used, by their letters
    #[arg(long, value_name = "LETTERS", default_value = "GREJC")]
    systems: String,
    /// Bands of each constellation, two each, for instance "G12 E15 C26 J12 R12"
    #[arg(long)]
    bands: Option<String>,
    /// Keep the ionosphere as a state of each satellite instead of combining bands
    #[arg(long)]
    uncombined: bool,
    /// Settings from a TOML file; see --print-config
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Where to start, ECEF metres, instead of at a position by the codes
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    start: Option<Vec<f64>>,
    /// First epoch, GPS time: "YYYY-MM-DD HH:MM:SS"
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// Last epoch, likewise
    #[arg(long, value_name = "TIME")]
    until: Option<String>,
    /// Directory for the results; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    /// Print all settings with their values as a TOML file, and stop
    #[arg(long, exclusive = true)]
    print_config: bool,
}

/// How variances of measurements are learned (Zhang 2020, and what works better).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Scheme {
    /// One for each measurement, the paper's: its covariances are not usable
    Epoch,
    /// One for each constellation, signal and kind
    Type,
    /// One for each satellite and kind
    Satellite,
    /// One for each constellation, signal, kind and range of elevations
    Elevation,
    /// The mean over 20 epochs to either side, for each satellite and kind
    Window,
    /// That of the elevation pool, moved by each measurement (inverse gamma)
    Map,
    /// Heavy-tailed errors with the scale of the elevation pool
    #[default]
    StudentT,
}

impl Scheme {
    fn measurements(self) -> Measurements {
        match self {
            Self::Epoch => Measurements::Epoch,
            Self::Type => Measurements::Pooled(Rule::Type),
            Self::Satellite => Measurements::Pooled(Rule::Satellite),
            Self::Elevation => Measurements::Pooled(Rule::Elevation),
            Self::Window => Measurements::Window(20),
            Self::Map => Measurements::Map(6.0),
            Self::StudentT => Measurements::StudentT(5.0),
        }
    }
}

impl Args {
    fn settings(&self) -> anyhow::Result<Settings> {
        let mut settings: Settings = match &self.config {
            Some(path) => {
                let text = std::fs::read_to_string(path)
                    .with_context(|| format!("{}: cannot be read; check the path", path.display()))?;
                toml::from_str(&text).with_context(|| format!("{}: not settings of ppp", path.display()))?
            }
            None => Settings::default(),
        };
        let config = &mut settings.engine;
        if self.kinematic {
            config.motion = Motion::Kinematic;
        } else if self.at_rest {
            config.motion = Motion::Static;
        }
        if self.uncombined {
            config.ionosphere = Ionosphere::Estimated;
        }
        if let Some(bands) = &self.bands {
            let plan = parse_bands(bands)?;
            for constellation in Constellation::ALL {
                let mut bands = plan.bands(constellation);
                let bands = [0, 1].map(|_| bands.next().unwrap_or(0));
                config.bands.bands[constellation.index()] = bands;
            }
        }
        for constellation in Constellation::ALL.into_iter().filter(|c| !self.systems.contains(c.letter())) {
            config.bands = config.bands.without(constellation);
        }
        if let Some(unknown) = self.systems.chars().find(|&letter| Constellation::from_letter(letter).is_none()) {
            bail!("--systems {}: there is no constellation {unknown}; give letters of G R E J C", self.systems);
        }
        settings.smoothing.iterations = self.iterations.unwrap_or(settings.smoothing.iterations);
        Ok(settings)
    }

    fn files(&self) -> anyhow::Result<FileList> {
        let mut list = FileList::sort(&self.files)?;
        for (kind, paths) in [
            (FileKind::Antenna, &self.antex[..]),
            (FileKind::Bias, &self.bias[..]),
            (FileKind::OceanLoading, self.blq.as_slice()),
            (FileKind::EarthOrientation, &self.erp[..]),
        ] {
            for path in paths {
                list.push(kind, path.clone())?;
            }
        }
        Ok(list)
    }

    fn span(&self) -> anyhow::Result<Option<[GpsTime; 2]>> {
        let read = |text: &Option<String>, otherwise| match text {
            Some(text) => time(text).with_context(|| format!("\"{text}\" is not a time; give \"YYYY-MM-DD HH:MM:SS\"")),
            None => Ok(otherwise),
        };
        if self.from.is_none() && self.until.is_none() {
            return Ok(None);
        }
        let ends = [i64::MIN, i64::MAX].map(GpsTime::from_nanoseconds);
        Ok(Some([read(&self.from, ends[0])?, read(&self.until, ends[1])?]))
    }
}

/// A time on the GPS time scale.
fn time(text: &str) -> Option<GpsTime> {
    let numbers: Vec<f64> = text.split(['-', ' ', 'T', ':']).map(str::parse).collect::<Result<_, _>>().ok()?;
    let [year, month, day, rest @ ..] = numbers.as_slice() else { return None };
    let part = |i: usize| rest.get(i).copied().unwrap_or(0.0);
    GpsTime::from_calendar(&Calendar {
        year: *year as i32,
        month: *month as u8,
        day: *day as u8,
        hour: part(0) as u8,
        minute: part(1) as u8,
        second: part(2),
    })
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.print_config {
        print!("{}", toml::to_string(&Settings::default())?);
        return Ok(Outcome::Good);
    }
    let list = args.files()?;
    let job = Job {
        settings: args.settings()?,
        smooth: args.smooth,
        em: args.em.then(|| args.scheme.measurements()),
        start: args.start.as_ref().map(|start| Vector3::from_column_slice(start)),
        span: args.span()?,
    };
    let config = job.settings.engine;
    let inputs: Vec<String> = list.all().map(|path| path.display().to_string()).collect();
    let header = Header {
        inputs,
        options: vec![
            ("mode".into(), format!("ppp {:?}", config.motion).to_lowercase()),
            ("elev mask".into(), format!("{:.1} deg", config.elevation_mask.to_degrees())),
        ],
        ..Header::default()
    };
    let name = list.observations.first().context("none of the files has observations; give the one of the receiver")?;
    let mut results = Results::create(&args.output, name, &header)?;
    let Done { run: outcome, smoothed, opened } = with_progress(|progress| {
        let bar = spinner();
        let each = |k: usize| {
            if k.is_multiple_of(64) {
                bar.set_position(k as u64);
            }
        };
        job.run(&list, each, Some(progress))
    })?;
    conclude(&outcome, smoothed.as_ref(), opened, &mut results)?;
    let tables = tables(&outcome, smoothed.as_ref())?;
    let (summary, mut paths) = results.finish(&job.settings).map(|(summary, paths)| (summary, paths.to_vec()))?;
    let stem = stem(name);
    let mut files = crate::write::files::Files::default();
    for (suffix, content) in tables {
        files.push(format!("{stem}-{suffix}"), content);
    }
    for (suffix, drawing) in super::ppp_figures::all(&outcome, smoothed.as_ref()) {
        files.draw(&format!("{stem}-{suffix}"), &drawing)?;
    }
    paths.extend(files.write(&args.output)?);
    println!("{}", results::report(&summary));
    if let Some(smoothed) = &smoothed {
        println!("{}", learned(smoothed));
    }
    println!("{}", final_position(&outcome));
    println!("wrote {}", paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", "));
    let positions = outcome.solutions.iter().filter(|solution| solution.solution.quality != Quality::None).count();
    Ok(if positions > 0 { Outcome::Good } else { Outcome::Bad })
}

/// Counts epochs on a terminal, nothing in a pipe.
fn spinner() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {pos} epochs, {per_sec} [{elapsed}]") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Puts solutions, warnings and what was dropped into the results.
fn conclude(outcome: &Run, smoothed: Option<&Smoothed>, opened: Opened, results: &mut Results) -> anyhow::Result<()> {
    outcome.solutions.iter().try_for_each(|solution| results.push(&solution.solution))?;
    let mut warnings = opened.warnings;
    warnings.extend(run::remarks(outcome));
    warnings.extend(smoothed.and_then(|smoothed| smoothed.report.warning).map(String::from));
    for warning in warnings {
        eprintln!("warning: {warning}");
        results.summary.warn(warning);
    }
    let reports = opened.observations.iter().map(|reader| reader.report().clone()).chain(opened.reports);
    for report in reports {
        for (reason, tally) in &report.dropped {
            results.summary.dropped(format!("{}: {reason}", report.file), tally.count);
        }
        if !report.dropped.is_empty() {
            eprintln!("{report}");
        }
    }
    Ok(())
}

fn learned(smoothed: &Smoothed) -> String {
    let report = &smoothed.report;
    let first = report.history.first().map_or(f64::NAN, |step| step.likelihood);
    let last = report.history.last().map_or(f64::NAN, |step| step.likelihood);
    format!(
        "smoothed: {} measurements, -2 ln L from {first:.1} to {last:.1} in {} steps ({:?}); variances of codes and phases \
         enlarged by {:.1} and {:.1} for errors that last",
        report.observations,
        report.history.len(),
        report.status,
        report.correlation[0],
        report.correlation[1]
    )
}

fn final_position(outcome: &Run) -> String {
    let last = outcome.solutions.iter().rev().find(|solution| solution.solution.quality != Quality::None);
    last.map_or("no position".into(), |last| {
        let [x, y, z] = last.solution.position.into();
        let sigma = last.solution.position_covariance.trace().max(0.0).sqrt();
        format!("last position {x:.4} {y:.4} {z:.4} m, sigma {sigma:.4} m")
    })
}

fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.split('.').next().filter(|stem| !stem.is_empty()).unwrap_or("solution").to_owned()
}
