//! `surefix study mixed-integer`.

use super::Outcome;
use super::simulation::{self, Repeatable};
use crate::study::mixed_integer::section::Part;
use crate::study::mixed_integer::{Settings, Study};
use anyhow::Context;
use clap::ValueEnum;
use std::path::PathBuf;

/// Mixed-integer filter with cycle slips: Section V of Greiff et al. (2021).
///
/// A rover 10 km from its base, 13 satellites, single-frequency code and phase, 12 ambiguities that jump 0.05 times a
/// second each; 300 epochs a run. Prints tables of how often all integers are right, of errors, and of normalised errors,
/// each beside what an independent program found, and writes every number as CSV and Fig. 1 of the paper as SVG, PNG and
/// CSV. The same seed gives the same numbers, whatever the number of threads.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Files in DIR (of the parts that are done):
  acceptance.csv      each number with its band
  configurations.csv  every number of every row of every table, with standard errors
  detectors.csv       false alarms and detections of both slip detectors over the threshold
  figure1.{svg,png,csv}  errors of one run over time
  figure1.sfl         measurements of that run, a device log for `surefix replay` and firmware

Exit code 1 if a number of the acceptance table lies outside its band.
The bands are for 60 runs: with fewer, numbers leave them by chance.

Examples:
  surefix study mixed-integer -o study
  surefix study mixed-integer --only acceptance --seed 2
  surefix study mixed-integer --only figure,curve --runs 10")]
pub struct Args {
    /// Runs of each configuration
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// Directory for the files; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = "study-mixed-integer")]
    output: PathBuf,
    /// Parts of the study to do; all if not given
    #[arg(long, value_name = "PART", value_delimiter = ',')]
    only: Vec<Part>,
    #[command(flatten)]
    repeatable: Repeatable,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let parts = if args.only.is_empty() { Part::value_variants().to_vec() } else { args.only.clone() };
    let settings = Settings { runs: args.runs as usize, seed: args.repeatable.seed, parts };
    let study = args.repeatable.run(|progress| Study::run(settings, progress))?;
    let study = study.context("the filter refused its initial density")?;
    simulation::answer(&study, |directory| study.write(directory), &args.output, study.missed())
}
