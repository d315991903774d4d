//! `surefix log`.

use super::Outcome;

mod dump;
mod pack;

/// Pack RINEX files into a device log, or dump one.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Pack(pack::Args),
    Dump(dump::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::Pack(args) => pack::run(args),
        Command::Dump(args) => dump::run(args),
    }
}
