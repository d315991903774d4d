//! `surefix demo`.

use super::Outcome;
use super::files::Files;
use super::post;
use crate::compare::{Options, Truth, compare};
use crate::process::settings::Settings;
use crate::read::solution;
use crate::simulate::files::Files as SimulatedFiles;
use crate::simulate::scenario::Scenario;
use crate::simulate::simulate;
use crate::simulate::tracking::Change;
use std::io::Write;
use std::path::PathBuf;

/// Simulate a drive with cycle slips, process it and compare it with the truth.
///
/// Ten minutes in town, GPS and Galileo on two bands, with stops, turns, hills, cycle slips (a third of them without a
/// flag), a tunnel, a street between tall houses and a gap of the base. Needs nothing but this program. The files stay,
/// so that `surefix post`, `surefix compare` and other programs can be tried on them.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Directory for the files.
    #[arg(short, long, value_name = "DIR", default_value = "surefix-demo")]
    output: PathBuf,
    /// Seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    let scenario = Scenario { seed: args.seed, ..Scenario::default() };
    let simulation = simulate(&scenario)?;
    let simulated = SimulatedFiles::write(&args.output, &scenario, &simulation)?;
    let slips = || simulation.rover_changes.iter().filter(|c| matches!(c.change, Change::Slip | Change::HalfCycle));
    writeln!(
        out,
        "simulated a drive of {} minutes: {} rover epochs, {} cycle slips ({} without a flag), {} outages",
        scenario.duration_s / 60.0,
        simulation.rover.len(),
        slips().count(),
        slips().filter(|slip| !slip.flagged).count(),
        scenario.rover.receiver.outages.len(),
    )?;

    let files = Files {
        rover: simulated.rover,
        base: simulated.base,
        navigation: vec![simulated.navigation],
        base_xyz: Some(simulation.base_position.iter().copied().collect()),
        base_antenna: None,
        moving_base: false,
    };
    let settings = Settings { bands: "G15 E15".into(), ..Settings::default() };
    let (summary, paths) = post::process(&files, &settings, false, &args.output)?;
    let rate = summary.epochs_per_second.unwrap_or(f64::NAN);
    writeln!(out, "processed in {:.2} s ({rate:.0} epochs a second)\n", summary.seconds)?;

    let [_, csv, _] = &paths;
    let solution = solution::read(csv, &solution::Options::default())?;
    let truth = Truth::Track(solution::read(&simulated.truth, &solution::Options::default())?);
    let report = compare(&solution, &truth, &Options::default());
    write!(out, "{report}")?;
    writeln!(out, "\nfiles:")?;
    for file in paths.iter().chain([&files.rover, &files.base, &files.navigation[0], &simulated.truth]) {
        writeln!(out, "  {}", file.display())?;
    }
    Ok(if report.matched > 0 { Outcome::Good } else { Outcome::Bad })
}
