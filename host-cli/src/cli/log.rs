//! `surefix log`.

use super::Outcome;

/// Pack RINEX files into a device log, or dump one.
#[derive(clap::Args, Debug)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built in this version")
}
