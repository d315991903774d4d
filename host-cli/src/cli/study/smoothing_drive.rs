//! `surefix study smoothing-drive`.

use crate::cli::Outcome;
use crate::study::smoothing_drive;

/// What smoothing gains on a real drive, and whether EM finds the noise from wrong starts.
///
/// Runs the filter once and smooths it with noise as configured, with noise learned from there, and with noise learned
/// from standard deviations of process and measurement noise wrong by factors of 0.1 and 10; prints how each compares with
/// the truth. Exit code 1 if a wrong start ends with errors more than a tenth larger than those of the configured one.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Example:
  surefix study smoothing-drive rover.obs base.obs base.nav --base-xyz -2430697.699 -4704189.201 3544329.103 \\
      --bands \"G1 E1 C2\" --truth truth.csv")]
pub struct Args {
    #[command(flatten)]
    drive: super::drive::Drive,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let (inputs, truth) = args.drive.read()?;
    let settings = args.drive.settings()?;
    let table = smoothing_drive::run(&inputs, &settings.config()?, &settings.smoothing.options()?, &truth)?;
    print!("{table}");
    let matched = table.0.iter().any(|row| row.report.matched > 0);
    Ok(if matched && table.missed() == 0 { Outcome::Good } else { Outcome::Bad })
}
