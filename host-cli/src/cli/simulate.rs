//! `surefix simulate`.

use super::Outcome;

/// Simulate rover and base observations from a scenario.
#[derive(clap::Args, Debug)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built in this version")
}
