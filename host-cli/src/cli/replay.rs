//! `surefix replay`.

use super::Outcome;
use super::engine::EngineArgs;
use super::results::{self, Results};
use super::smoothing::{Recording, SmoothArgs};
use crate::log::section_v::{is_for_section_v, replay};
use crate::log::{LogInputs, LogReader, LogWriter};
use crate::process::run::Engine;
use crate::process::stream::Input;
use crate::write::partial_file::PartialFile;
use crate::write::pos::Header;
use anyhow::{Context, bail};
use std::path::PathBuf;
use surefix_core::real::Real;

/// Run a device log through the filter.
///
/// A log of GNSS observations goes through the RTK filter, one of measurements of the study of mixed-integer filters
/// through the filter of that study. The log's own settings are used; a log without settings is processed with the
/// defaults and the options below. The frames that `-o` writes are those that firmware answers, byte for byte; with
/// `--smooth` the files of `-r` have the smoothed solutions.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The log
    log: PathBuf,
    /// Write the solutions as frames of a device log, as firmware does
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the result files of `surefix post` into this directory
    #[arg(short, long, value_name = "DIR")]
    results: Option<PathBuf>,
    /// Keep covariances in single precision, as on a core without double (only for a log of the study)
    #[arg(long)]
    single: bool,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    smoothing: SmoothArgs,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.smoothing.smooth && args.results.is_none() {
        bail!("--smooth has nowhere to write to; give a directory by --results DIR");
    }
    if is_for_section_v(&args.log)? {
        return if args.single { run_section_v::<f32>(args) } else { run_section_v::<f64>(args) };
    }
    if args.single {
        bail!("{}: has no measurements of the study, and --single is for these; leave it out", args.log.display());
    }
    let mut settings = args.engine.settings()?;
    args.smoothing.apply(&mut settings);
    let mut engine = Engine::new(settings.config()?);
    let mut inputs = LogInputs::open(&args.log)?;
    let cannot_write =
        || args.output.as_ref().map_or(String::new(), |path| format!("{}: cannot be written", path.display()));
    let mut frames = match &args.output {
        Some(path) => Some(LogWriter::new(PartialFile::create(path).with_context(cannot_write)?)),
        None => None,
    };
    let header = Header { inputs: vec![args.log.display().to_string()], ..Header::default() };
    let mut files = match &args.results {
        Some(directory) => Some(Results::create(directory, &args.log, &header)?),
        None => None,
    };
    let mut recording = args.smoothing.smooth.then(|| Recording::new(&engine, &settings)).transpose()?;
    let (mut epochs, mut positions, mut with_base) = (0u64, 0u64, false);
    for input in inputs.by_ref() {
        let input = input?;
        with_base |= matches!(input, Input::Base(_));
        let Some(solution) = engine.feed(&input) else { continue };
        epochs += 1;
        positions += u64::from(solution.quality < surefix_core::gnss::solution::Quality::None);
        if let Some(frames) = &mut frames {
            frames.solution(&solution).with_context(cannot_write)?;
        }
        match (&mut recording, &mut files) {
            (Some(recording), _) => recording.push(&engine, &solution),
            (None, Some(files)) => files.push(&solution)?,
            (None, None) => {}
        }
    }
    if let Some(frames) = frames {
        frames.finish().and_then(PartialFile::keep).with_context(cannot_write)?;
    }
    let damage = inputs.damage();
    if !damage.is_none() {
        eprintln!(
            "{}: {} damaged frames, {} incomplete epochs, {} values not finite, {} records lost while recording{}; \
             `surefix log dump` shows the places",
            args.log.display(),
            damage.bad,
            damage.incomplete,
            damage.not_finite,
            damage.dropped,
            if damage.no_end { ", the end is missing" } else { "" }
        );
    }
    if epochs > 0 && !with_base {
        eprintln!("{}: no epoch of a base; there are only single points", args.log.display());
    }
    if let (Some(recording), Some(files)) = (recording, &mut files) {
        recording.smooth_into(files)?;
    }
    match files {
        Some(files) => println!("{}", results::report(&files.finish(&settings)?.0)),
        None => println!("{epochs} epochs, {positions} with a position"),
    }
    Ok(if positions > 0 { Outcome::Good } else { Outcome::Bad })
}

/// Runs a log of the study of mixed-integer filters.
fn run_section_v<T: Real>(args: &Args) -> anyhow::Result<Outcome> {
    if args.results.is_some() {
        bail!("{}: is a log of the study, of which there are no result files; use -o", args.log.display());
    }
    let cannot_write =
        || args.output.as_ref().map_or(String::new(), |path| format!("{}: cannot be written", path.display()));
    let mut frames = match &args.output {
        Some(path) => Some(LogWriter::new(PartialFile::create(path).with_context(cannot_write)?)),
        None => None,
    };
    let (mut epochs, mut refused, mut slips) = (0u64, 0u64, 0u64);
    let mut log = LogReader::open(&args.log)?;
    replay::<T, _>(&mut log, |answer| {
        epochs += 1;
        match answer.outcome {
            Ok(outcome) => slips += outcome.slips as u64,
            Err(_) => refused += 1,
        }
        frames.as_mut().map_or(Ok(()), |frames| frames.estimate(&answer.estimate(), answer.ambiguities()))
    })?;
    if let Some(frames) = frames {
        frames.finish().and_then(PartialFile::keep).with_context(cannot_write)?;
    }
    let bad = log.counts().bad();
    if bad > 0 {
        eprintln!("{}: {bad} damaged frames; `surefix log dump` shows the places", args.log.display());
    }
    println!("{epochs} epochs, {refused} refused, {slips} slips flagged");
    Ok(if epochs > refused { Outcome::Good } else { Outcome::Bad })
}
