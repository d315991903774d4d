//! `surefix study drive`.

use crate::cli::Outcome;
use crate::cli::engine::EngineArgs;
use crate::cli::files::Files;
use crate::compare::Truth;
use crate::process::settings::Settings;
use crate::process::stream::Input;
use crate::read::solution;
use crate::study::drive;
use anyhow::Context;
use std::path::PathBuf;

/// Slip detectors, kinds of fixed solution and linearisations on a real drive.
///
/// Processes the files with every combination of detector (weighted, the paper's projection, none), fixed solution (given
/// the integers of its epoch, or of all epochs so far) and linearisation (Taylor, Gauss–Hermite), and prints how each
/// compares with the truth.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Example:
  surefix study drive rover.obs base.obs base.nav --base-xyz -2430697.699 -4704189.201 3544329.103 \\
      --bands \"G1 E1 C2\" --truth truth.csv")]
pub struct Args {
    #[command(flatten)]
    drive: Drive,
}

/// A drive: its files, how to process them, and where the rover truly was.
#[derive(clap::Args, Debug)]
pub struct Drive {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    engine: EngineArgs,
    /// True positions over time, as `surefix compare` reads them
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Use only rows of the truth whose quality column reads like this
    #[arg(long, value_name = "QUALITY")]
    truth_quality: Option<String>,
}

impl Drive {
    /// How to process it.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let settings = self.engine.settings()?;
        let moving = settings.moving_base || self.files.moving_base;
        anyhow::ensure!(
            !moving,
            "the study compares positions: give a base at rest, without --moving-base and moving_base"
        );
        Ok(settings)
    }

    /// All inputs, and the truth.
    pub fn read(&self) -> anyhow::Result<(Vec<Input>, Truth)> {
        let mut open = self.files.open()?;
        open.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        let mut stream = open.stream();
        let inputs = stream.by_ref().collect::<Result<Vec<_>, _>>()?;
        stream.coverage()?;
        let near = inputs.iter().find_map(|input| match input {
            Input::Rover(epoch) => Some(epoch.time),
            _ => None,
        });
        let options = solution::Options { near, only_quality: self.truth_quality.clone(), ..Default::default() };
        Ok((inputs, Truth::Track(solution::read(&self.truth, &options)?)))
    }
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let config = args.drive.settings()?.config()?;
    let (inputs, truth) = args.drive.read()?;
    let table = drive::run(&inputs, &config, &truth);
    print!("{table}");
    let matched = table.0.iter().map(|row| row.report.matched).max().context("no combination ran")?;
    Ok(if matched > 0 { Outcome::Good } else { Outcome::Bad })
}
