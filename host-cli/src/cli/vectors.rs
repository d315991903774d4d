//! `surefix vectors`: run files of golden vectors and print each check.

use super::Outcome;
use crate::vectors;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Check the models against golden vectors.
///
/// Recomputes every case of the files, and prints for each quantity the number of cases, the tolerance that the file
/// states, the worst deviation and the case it occurs in. Exit code 1 if a deviation exceeds its tolerance, a model is not
/// known to this version or a case cannot be recomputed; 3 if a file cannot be read.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Vector files (JSON).
    #[arg(required = true, value_name = "FILE.json")]
    files: Vec<PathBuf>,

    /// Directory with the observation and navigation files that cases refer to by name. Default: `data` beside the
    /// directory that holds the vectors, where it exists.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    let mut failed = 0;
    for file in &args.files {
        let data = args.data.clone().or_else(|| data_beside(file));
        let report = vectors::run_file(file, data.as_deref())?;
        failed += usize::from(!report.passed());
        let verdict = if report.passed() { "pass" } else { "FAIL" };
        writeln!(out, "{}: {verdict}\n{report}", file.display())?;
    }
    writeln!(out, "{} of {} files pass", args.files.len() - failed, args.files.len())?;
    Ok(if failed == 0 { Outcome::Good } else { Outcome::Bad })
}

/// The nearest `data` directory beside one of the directories that hold the file.
fn data_beside(file: &Path) -> Option<PathBuf> {
    let file = file.canonicalize().ok()?;
    file.ancestors().skip(1).take(3).map(|directory| directory.join("data")).find(|data| data.is_dir())
}
