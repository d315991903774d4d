//! Arguments that the studies by simulation share, and how they run and answer.

use super::super::Outcome;
use crate::study::monte_carlo;
use crate::write::files::FilesError;
use anyhow::Context;
use indicatif::ProgressBar;
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Seed and threads.
#[derive(clap::Args, Debug)]
pub struct Repeatable {
    /// Seed of everything random
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Threads; all cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Repeatable {
    /// Runs a study on those threads, with a progress bar of its runs.
    pub fn run<S: Send>(&self, study: impl FnOnce(&ProgressBar) -> S + Send) -> anyhow::Result<S> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.map_or(0, usize::from))
            .build()
            .context("threads cannot be started; give --threads 1")?;
        let progress = monte_carlo::progress_bar("runs");
        let start = Instant::now();
        let study = pool.install(|| study(&progress));
        progress.finish_and_clear();
        if std::io::stderr().is_terminal() {
            eprintln!("done in {:.1} s", start.elapsed().as_secs_f64());
        }
        Ok(study)
    }
}

/// Writes a study's files, prints its report and their names; good if no number was `missed`.
pub fn answer(
    study: &impl Display,
    write: impl FnOnce(&Path) -> Result<Vec<PathBuf>, FilesError>,
    directory: &Path,
    missed: usize,
) -> anyhow::Result<Outcome> {
    let files = write(directory)?;
    let mut out = std::io::stdout().lock();
    write!(out, "{study}")?;
    writeln!(out, "\nfiles:")?;
    for file in files {
        writeln!(out, "  {}", file.display())?;
    }
    Ok(if missed == 0 { Outcome::Good } else { Outcome::Bad })
}
