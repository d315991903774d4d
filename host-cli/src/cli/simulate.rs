//! `surefix simulate`.

use super::Outcome;
use crate::simulate::files::Files;
use crate::simulate::scenario::Scenario;
use crate::simulate::simulate;
use anyhow::Context;
use std::io::Write;
use std::path::PathBuf;

/// Simulate rover and base observations from a scenario.
///
/// Writes RINEX observations of rover and base, navigation messages, a device log, and the truth: positions,
/// velocities, clock and every change of an ambiguity. The same scenario gives the same files, byte for byte.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  surefix simulate --print-default > scenario.toml
  surefix simulate scenario.toml -o simulated
  surefix post simulated/rover.obs simulated/base.obs simulated/broadcast.nav -o solved
  surefix compare solved/rover.pos simulated/truth.csv

A scenario needs only what differs from the default:
  seed = 7
  duration_s = 1800
  [rover.motion]
  kind = \"static\"          # static, circle, drive
  [rover.receiver.slips]
  per_hour = 20")]
pub struct Args {
    /// Scenario (TOML).
    #[arg(required_unless_present = "print_default")]
    scenario: Option<PathBuf>,
    /// Directory for the files.
    #[arg(short, long, value_name = "DIR", default_value = "simulated")]
    output: PathBuf,
    /// Seed of everything random, instead of the scenario's.
    #[arg(long)]
    seed: Option<u64>,
    /// Print the default scenario with all there is, and do nothing else.
    #[arg(long)]
    print_default: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    let path = match &args.scenario {
        Some(path) if !args.print_default => path,
        _ => {
            write!(out, "{}", Scenario::default().to_toml())?;
            return Ok(Outcome::Good);
        }
    };
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{name}: cannot be read; check the path, and that it is a text file"))?;
    let mut scenario = Scenario::from_toml(&name, &text)?;
    scenario.seed = args.seed.unwrap_or(scenario.seed);
    let simulation = simulate(&scenario)?;
    let files = Files::write(&args.output, &scenario, &simulation)?;
    writeln!(
        out,
        "{} rover and {} base epochs, {} changes of ambiguities",
        simulation.rover.len(),
        simulation.base.len(),
        simulation.rover_changes.len() + simulation.base_changes.len()
    )?;
    for file in [&files.rover, &files.base, &files.navigation, &files.log, &files.truth, &files.slips, &files.scenario]
    {
        writeln!(out, "  {}", file.display())?;
    }
    Ok(if simulation.rover.is_empty() { Outcome::Bad } else { Outcome::Good })
}
