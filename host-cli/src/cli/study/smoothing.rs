//! `surefix study smoothing`.

use super::Outcome;
use super::simulation::{self, Repeatable};
use crate::study::smoothing::section::Part;
use crate::study::smoothing::{Settings, Study};
use anyhow::Context;
use clap::ValueEnum;
use std::path::PathBuf;

/// Smoother with integers and learned noise: Section 5 of Greiff et al. (2023).
///
/// Ten satellites, three bands of code, phase and Doppler in double or single differences, 1001 epochs of 5 s, 27
/// ambiguities that slip 135 times a run. Prints Table 2 of the paper beside the paper's numbers, for the configuration
/// that reproduces it and for the recommended one, all combinations of where integers come from and which estimate is
/// reported, and what EM makes of noise that is wrong at the start; writes every number as CSV and Figs. 2, 3 and 4 as SVG,
/// PNG and CSV. The same seed gives the same numbers but computing times, whatever the number of threads.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Files in DIR (of the parts that are done):
  acceptance.csv             each number with its band
  table2.csv                 every number of every row, with standard errors, the paper's, and an independent program's
  figure2-PART.{svg,png,csv} RMSE and RAPC over time
  figure3.{svg,png,csv}      the same with wrong, learned and true noise
  figure4.{svg,png,csv}      objective and likelihood over the iterations of EM

Exit code 1 if a number of the acceptance table lies outside its band by two standard errors or more.

Examples:
  surefix study smoothing -o study
  surefix study smoothing --only paper,recommended --runs 100
  surefix study smoothing --only adaptation --seed 2")]
pub struct Args {
    /// Runs of each row; of the part adaptation, ten at most
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// K, the last epoch of a run
    #[arg(long, value_name = "K", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(20..=100_000))]
    epochs: u32,
    /// Directory for the files; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = "study-smoothing")]
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
    let settings = Settings { runs: args.runs as usize, seed: args.repeatable.seed, last: args.epochs as usize, parts };
    let study = args.repeatable.run(|progress| Study::run(settings, progress))?;
    let study = study.context("a run could not be smoothed")?;
    simulation::answer(&study, |directory| study.write(directory), &args.output, study.missed())
}
