//! `surefix post`.

use super::Outcome;

/// Process RINEX observations of rover and base into positions.
#[derive(clap::Args, Debug)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built in this version")
}
