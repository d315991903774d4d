//! `surefix replay`.

use super::Outcome;

/// Run a device log through the filter.
#[derive(clap::Args, Debug)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built in this version")
}
