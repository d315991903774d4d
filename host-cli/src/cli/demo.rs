//! `surefix demo`.

use super::Outcome;

/// Simulate a drive with cycle slips, process it and compare it with the truth.
#[derive(clap::Args, Debug)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built in this version")
}
