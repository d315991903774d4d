//! `surefix study`.

use super::Outcome;

mod drive;
mod em_ppp;
mod integrity;
mod mixed_integer;
mod simulation;
mod smoothing;
mod smoothing_drive;
mod urban;

/// Repeat the simulations of a paper, with the numbers they must give, or compare its choices on a real drive.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    MixedInteger(mixed_integer::Args),
    Smoothing(smoothing::Args),
    Integrity(integrity::Args),
    Drive(drive::Args),
    EmPpp(em_ppp::Args),
    SmoothingDrive(smoothing_drive::Args),
    Urban(urban::Args),
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::MixedInteger(args) => mixed_integer::run(args),
        Command::Smoothing(args) => smoothing::run(args),
        Command::Integrity(args) => integrity::run(args),
        Command::Drive(args) => drive::run(args),
        Command::EmPpp(args) => em_ppp::run(args),
        Command::SmoothingDrive(args) => smoothing_drive::run(args),
        Command::Urban(args) => urban::run(args),
    }
}
