//! `cargo xtask`: the project's task runner. See `cargo xtask --help`.
//!
//! | module | holds |
//! |---|---|
//! | [`command`] | running other programs |
//! | [`toolchain`] | finding and installing what builds and runs Cortex-M programs |
//! | [`machine`] | the simulated machines |
//! | [`firmware`] | building `firmware-sim` and checking what its programs say |
//! | [`qemu`] | one run of a program in QEMU: bytes in, bytes and messages out |
//! | [`panics`] | which places of the core can still panic |
//! | [`peers`] | the real cases in surefix and in RTKLIB |
//! | [`replay`] | a device log through the firmware |
//! | [`size`] | what the filter takes on a Cortex-M, for the README |
//! | [`test`] | every check there is |

mod command;
mod firmware;
mod machine;
mod panics;
mod peers;
mod qemu;
mod replay;
mod size;
mod test;
mod toolchain;

use clap::{Parser, Subcommand};
use machine::Machine;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The project's task runner.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Install what the Cortex-M builds and QEMU runs need, where it is missing
    Setup,
    /// Run every check: formatting, lints, host tests, doc tests, Cortex-M builds, firmware in QEMU
    Test,
    /// Build the firmware and run its programs in QEMU
    Firmware {
        /// Only on this machine
        #[arg(long)]
        machine: Option<Machine>,
    },
    Replay(replay::Args),
    /// Print what surefix and RTKLIB make of the real cases, side by side (installs Debian's rtklib and
    /// PyPI's pyrtklib5, which is RTKLIB demo5, where they are missing)
    Peers {
        /// Directory of the real data [default: ../shared/data beside the checkout]
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
        /// Only these cases
        #[arg(long, value_name = "NAME", num_args = 1..)]
        only: Vec<String>,
    },
    /// List the places of the core from which a panic is reachable; fail if one meets data from outside
    Panics,
    /// Measure flash, RAM, stack and instructions of the presets, and write the table in README.md
    Size,
}

fn main() -> ExitCode {
    match run(Cli::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Setup => toolchain::CortexM::find_or_install().map(|found| println!("ready: {found}")),
        Command::Test => test::run_all(),
        Command::Peers { data, only } => {
            peers::compare(&data.unwrap_or_else(|| repository().join("../shared/data")), &only)
        }
        Command::Replay(args) => replay::run(&args),
        Command::Panics => panics::run(&toolchain::CortexM::find_or_install()?),
        Command::Size => size::run(&toolchain::CortexM::find_or_install()?),
        Command::Firmware { machine } => {
            let toolchain = toolchain::CortexM::find_or_install()?;
            Machine::selected(machine).try_for_each(|machine| firmware::test(&toolchain, machine))
        }
    }
}

/// Top directory of the repository.
fn repository() -> &'static Path {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.parent().unwrap_or(manifest)
}
