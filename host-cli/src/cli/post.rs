//! `surefix post`.

use super::Outcome;
use super::engine::EngineArgs;
use super::files::{Files, OpenFiles};
use super::results::{self, Results};
use super::smoothing::{Recording, SmoothArgs};
use crate::process::base_check::BaseCheck;
use crate::process::run::Engine;
use crate::process::settings::Settings;
use crate::write::pos::Header;
use crate::write::summary::Summary;
use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::time::Duration;
use surefix_core::gnss::solution::Quality;

/// Process RINEX observations of rover and base into positions.
///
/// Writes NAME.pos (RTKLIB's format), NAME.csv (every field of every solution) and NAME.json (summary) into DIR, NAME
/// being that of the rover file. Positions are those of the rover's marker: antenna heights are taken from the headers.
/// For a device log there is `surefix replay LOG -r DIR`, with the same options.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  surefix post rover.obs base.obs base.nav --base-xyz -2430697.699 -4704189.201 3544329.103 -o out
  surefix post rover.rnx.gz base.crx.gz brdc.rnx.gz --bands \"G12 E15\" -o out
  surefix post rover.obs base.obs base.nav --smooth --em -o out     # from all epochs, with noise learned from them
  surefix replay drive.sfl -r out --smooth --em                     # the same of a device log
  surefix post front.obs rear.obs base.nav --moving-base -o out       # vectors from rear to front, heading, pitch
  surefix post --print-config > settings.toml")]
pub struct Args {
    #[command(flatten)]
    files: Option<Files>,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    smoothing: SmoothArgs,
    /// Directory for the results; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    /// Print all settings with their values as a TOML file, and stop
    #[arg(long, exclusive = true)]
    print_config: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.print_config {
        print!("{}", toml::to_string(&Settings::default())?);
        return Ok(Outcome::Good);
    }
    let files = args.files.as_ref().context("give the files ROVER BASE NAV…")?;
    let mut settings = args.engine.settings()?;
    args.smoothing.apply(&mut settings);
    settings.moving_base |= files.moving_base;
    let (summary, paths) = process(files, &settings, args.smoothing.smooth, &args.output)?;
    println!("{}", results::report(&summary));
    println!("wrote {}", paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", "));
    let positions = summary.epochs - summary.by_quality.get("none").copied().unwrap_or(0);
    Ok(if positions > 0 { Outcome::Good } else { Outcome::Bad })
}

/// Processes files, smooths if that is wanted, and writes the results into a directory.
pub fn process(
    files: &Files,
    settings: &Settings,
    smooth: bool,
    output: &std::path::Path,
) -> anyhow::Result<(Summary, [PathBuf; 3])> {
    let config = settings.config()?;
    let mut open = files.open_for(settings.moving_base)?;
    open.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    let inputs = [&files.rover, &files.base].into_iter().chain(&files.navigation);
    let header = Header {
        inputs: inputs.map(|path| path.display().to_string()).collect(),
        base: open.header.base_position.map(Into::into),
        options: vec![
            ("bands".into(), settings.bands.clone()),
            ("motion".into(), format!("{:?}", settings.motion).to_lowercase()),
            ("elev mask".into(), format!("{} deg", settings.elevation_mask_deg)),
        ],
        ..Header::default()
    };
    let mut results = Results::create(output, &files.rover, &header)?;
    let warnings = std::mem::take(&mut open.warnings);
    warnings.into_iter().for_each(|warning| results.summary.warn(warning));
    let engine = Engine::new(config);
    let recording = smooth.then(|| Recording::new(&engine, settings)).transpose()?;
    run_engine(&mut open, engine, recording, &mut results)?;
    for report in [open.rover.report(), open.base.report()].into_iter().chain(&open.navigation.reports) {
        for (reason, tally) in &report.dropped {
            results.summary.dropped(format!("{}: {reason}", report.file), tally.count);
        }
        if !report.dropped.is_empty() {
            eprintln!("{report}");
        }
    }
    results.finish(settings)
}

fn run_engine(
    open: &mut OpenFiles,
    mut engine: Engine,
    mut recording: Option<Recording>,
    results: &mut Results,
) -> anyhow::Result<()> {
    let progress = progress();
    let mut check = BaseCheck::default();
    let (mut epochs, mut fixed) = (0u64, 0u64);
    let mut stream = open.stream();
    for input in stream.by_ref() {
        let input = input?;
        check.watch(&input)?;
        if let Some(solution) = engine.feed(&input) {
            epochs += 1;
            fixed += u64::from(solution.quality <= Quality::Partial);
            if epochs.is_multiple_of(64) {
                progress.set_position(epochs);
                progress.set_message(format!("{:.1} % fixed", 100.0 * fixed as f64 / epochs as f64));
            }
            match &mut recording {
                Some(recording) => recording.push(&engine, &solution),
                None => results.push(&solution)?,
            }
        }
    }
    progress.finish_and_clear();
    stream.coverage()?;
    recording.map_or(Ok(()), |recording| recording.smooth_into(results))
}

/// A progress bar on a terminal, nothing in a pipe.
fn progress() -> ProgressBar {
    let progress = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {pos} epochs, {per_sec}, {msg} [{elapsed}]") {
        progress.set_style(style);
    }
    progress.enable_steady_tick(Duration::from_millis(200));
    progress
}
