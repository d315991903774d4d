//! The command line: raw arguments → validated configuration → run. One file a subcommand.

use crate::write::partial_file::PartialFile;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

pub mod compare;
pub mod degrade;
pub mod demo;
pub mod engine;
pub mod files;
pub mod log;
pub mod post;
pub mod ppp;
mod ppp_figures;
pub mod replay;
pub mod results;
pub mod simulate;
pub mod smoothing;
pub mod study;
pub mod vectors;

/// Precise GNSS positioning that can be trusted.
#[derive(Parser, Debug)]
#[command(name = "surefix", version, about, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "\
Exit codes:
    0  done
    1  ran, but the result is not good: a check failed, or no epoch has a position
    2  wrong usage of the command line
    3  an input cannot be used; the message names the file, the place and the remedy
  130  interrupted; no half-written file is left";

#[derive(Subcommand, Debug)]
#[allow(clippy::large_enum_variant)] // there is only ever one
enum Command {
    Post(post::Args),
    Ppp(ppp::Args),
    Simulate(simulate::Args),
    Degrade(degrade::Args),
    Demo(demo::Args),
    Compare(compare::Args),
    Log(log::Args),
    Replay(replay::Args),
    Study(study::Args),
    Vectors(vectors::Args),
}

/// How a command that ran to its end turned out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All is well (exit code 0).
    Good,
    /// It ran, but a check failed or there is no result (exit code 1).
    Bad,
}

/// Exit code of a process that was interrupted, as shells have it: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

/// On Ctrl-C, and where there are such signals SIGTERM and SIGHUP: removes what is half written and ends the process.
fn watch_for_interruption() {
    let watched = ctrlc::set_handler(|| {
        eprintln!("interrupted; files that were not complete are removed");
        PartialFile::end_process(INTERRUPTED)
    });
    if let Err(error) = watched {
        eprintln!("warning: an interruption would leave files called *.partial ({error})");
    }
}

/// Parses the command line, runs the command and returns the process's exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    watch_for_interruption();
    let outcome = match cli.command {
        Command::Post(args) => post::run(&args),
        Command::Ppp(args) => ppp::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Degrade(args) => degrade::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Log(args) => log::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Study(args) => study::run(&args),
        Command::Vectors(args) => vectors::run(&args),
    };
    match outcome {
        Ok(Outcome::Good) => ExitCode::SUCCESS,
        Ok(Outcome::Bad) => ExitCode::from(1),
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(3)
        }
    }
}

/// A reader that closed our pipe (`surefix … | head`) has what it wanted: not an error.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|io| io.kind() == std::io::ErrorKind::BrokenPipe)
}
