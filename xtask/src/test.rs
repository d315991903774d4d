//! `cargo xtask test`: every check there is, the quick ones first.

use crate::command::run;
use crate::firmware;
use crate::machine::Machine;
use crate::repository;
use crate::toolchain::CortexM;
use anyhow::Result;
use std::process::Command;

/// Environment variable with the path of this program. Tests that need it skip where it is not set.
const XTASK: &str = "SUREFIX_XTASK";

/// Runs everything, and stops at the first failure.
pub fn run_all() -> Result<()> {
    let toolchain = CortexM::find_or_install()?;
    println!("Cortex-M: {toolchain}");

    run(cargo("fmt").args(["--all", "--check"]))?;
    run(cargo("fmt").args(["--manifest-path", "firmware-sim/Cargo.toml", "--check"]))?;
    run(cargo("clippy").args(["--workspace", "--all-targets", "--all-features", "--", "-D", "warnings"]))?;

    for features in ["--no-default-features", "--all-features"] {
        let mut check = toolchain.cargo("check", Machine::An386);
        check.current_dir(repository()).args(["--package", "surefix-core", features]);
        run(check.args(["--target-dir", "firmware-sim/target/check"]))?;
    }
    for machine in Machine::ALL {
        firmware::test(&toolchain, machine)?;
    }

    // Unit, integration and doc tests; among them those that compare the host with the firmware built above.
    run(cargo("test").arg("--workspace").env(XTASK, std::env::current_exe()?))?;
    println!("\nall checks passed");
    Ok(())
}

fn cargo(subcommand: &str) -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(repository()).arg(subcommand);
    command
}
