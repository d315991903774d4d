//! `surefix study integrity`.

use super::Outcome;
use super::simulation::{self, Repeatable};
use crate::study::integrity::scenario::EPOCHS;
use crate::study::integrity::{Part, Settings, Study};
use clap::ValueEnum;
use std::path::PathBuf;

/// Adaptive noise and protection levels between two vehicles: Wang et al. (2022), by simulation.
///
/// Two vehicles 6 to 13 km apart, two bands, trees twice, four kinds of noise from exactly what the filter assumes to
/// multipath, outliers and reflections. KF, AKF and IAVAKF in all forms, and the recommended filter: Tables 3 and 4 of the
/// paper beside its numbers, Figs. 4 and 10 to 15. Then protection levels at risks of 1e-3, 1e-4 and 1e-5, by three million
/// epochs in which every assumption holds. The same seed gives the same numbers, whatever the number of threads.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Files in DIR (of the parts that are done):
  acceptance.csv              each number with its band
  filters.csv                 every filter under every noise, with standard errors
  risk.csv                    rates of epochs beyond their protection level
  figure4.{svg,png,csv}       bounds of success rates
  figure10- to figure16-NOISE.{svg,png}  success rates, errors, levels, Stanford diagrams

Exit code 1 if a number of the acceptance table lies outside its band by two standard errors or more.

Examples:
  surefix study integrity -o study
  surefix study integrity --seeds 2 --only filters
  surefix study integrity --only risk --risk-epochs 3000000")]
pub struct Args {
    /// Runs of each filter and noise; two at most where R* is a whole matrix
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    seeds: u32,
    /// Epochs of a run, of which the first 60 do not count
    #[arg(long, value_name = "K", default_value_t = EPOCHS as u32, value_parser = clap::value_parser!(u32).range(120..=100_000))]
    epochs: u32,
    /// Epochs of the part risk
    #[arg(long, value_name = "N", default_value_t = 3_000_000, value_parser = clap::value_parser!(u32).range(1200..=1_000_000_000))]
    risk_epochs: u32,
    /// Directory for the files; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = "study-integrity")]
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
    let settings = Settings {
        seeds: args.seeds as usize,
        epochs: args.epochs as usize,
        risk_epochs: args.risk_epochs as usize,
        seed: args.repeatable.seed,
        parts,
    };
    let study = args.repeatable.run(|progress| Study::run(settings, progress))?;
    simulation::answer(&study, |directory| study.write(directory), &args.output, study.missed())
}
