//! `surefix study em-ppp`.

use super::Outcome;
use super::simulation::{self, Repeatable};
use crate::study::em_ppp::{Part, Settings, Study};
use clap::ValueEnum;
use std::path::PathBuf;

/// Learning the noise of precise point positioning: Zhang et al. (2020), by simulation.
///
/// A receiver at rest (200 epochs of 30 s, 16 satellites) and one that stops and goes (300 epochs of 1 s), 1 % outliers,
/// started with the paper's 3 m and 0.03 m. Schemes from one variance for each measurement (the paper's) to pools with
/// Student-t weights (recommended): errors, consistency, and how well they predict measurements that they have not seen.
/// Then six starts of three schemes, and plain against accelerated EM. The same seed gives the same numbers, whatever the
/// number of threads.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Files in DIR (of the parts that are done):
  acceptance.csv                    each number with its band
  schemes.csv                       every run of every scheme after 0, 5, 10 and 50 iterations
  starts.csv, speed.csv             ends of six starts; evaluations of EM
  likelihood-MOTION.{svg,png}       -2 ln likelihood by iteration

Exit code 1 if a number of the acceptance table lies outside its band by two standard errors or more.

Examples:
  surefix study em-ppp -o study
  surefix study em-ppp --seeds 1 --only static --iterations 10")]
pub struct Args {
    /// Runs of each scheme
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    seeds: u32,
    /// Most iterations of EM
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=1000))]
    iterations: u32,
    /// Epochs of a run; 200 static and 300 kinematic if not given
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(20..=100_000))]
    epochs: Option<u32>,
    /// Directory for the files; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = "study-em-ppp")]
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
        iterations: args.iterations as usize,
        epochs: args.epochs.map(|epochs| epochs as usize),
        seed: args.repeatable.seed,
        parts,
    };
    let study = args.repeatable.run(|progress| Study::run(settings, progress))?;
    simulation::answer(&study, |directory| study.write(directory), &args.output, study.missed())
}
