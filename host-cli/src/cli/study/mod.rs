//! `surefix study`.

use super::Outcome;

mod mixed_integer;

/// Repeat the simulations of a paper, with the numbers they must give.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    MixedInteger(mixed_integer::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::MixedInteger(args) => mixed_integer::run(args),
    }
}
