//! `surefix study smoothing`.

use super::Outcome;
use crate::study::monte_carlo;
use crate::study::smoothing::section::Part;
use crate::study::smoothing::{Settings, Study};
use anyhow::Context;
use clap::ValueEnum;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::Instant;

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
    /// Seed of everything random
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// K, the last epoch of a run
    #[arg(long, value_name = "K", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(20..=100_000))]
    epochs: u32,
    /// Directory for the files; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = "study-smoothing")]
    output: PathBuf,
    /// Parts of the study to do; all if not given
    #[arg(long, value_name = "PART", value_delimiter = ',')]
    only: Vec<Part>,
    /// Threads; all cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let parts = if args.only.is_empty() { Part::value_variants().to_vec() } else { args.only.clone() };
    let settings = Settings { runs: args.runs as usize, seed: args.seed, last: args.epochs as usize, parts };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.map_or(0, usize::from))
        .build()
        .context("threads cannot be started; give --threads 1")?;
    let progress = monte_carlo::progress_bar("runs");
    let start = Instant::now();
    let study = pool.install(|| Study::run(settings, &progress));
    progress.finish_and_clear();
    let study = study.context("a run could not be smoothed")?;
    if std::io::stderr().is_terminal() {
        eprintln!("done in {:.1} s", start.elapsed().as_secs_f64());
    }
    let files = study.write(&args.output)?;
    let mut out = std::io::stdout().lock();
    write!(out, "{study}")?;
    writeln!(out, "\nfiles:")?;
    for file in files {
        writeln!(out, "  {}", file.display())?;
    }
    Ok(if study.missed() == 0 { Outcome::Good } else { Outcome::Bad })
}
