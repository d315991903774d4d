//! `surefix degrade`.

use super::Outcome;
use crate::degrade::events::What;
use crate::degrade::scenario::Scenario;
use crate::degrade::{degrade, files};
use crate::read::rinex::{NavigationData, ObservationReader};
use anyhow::Context;
use std::io::Write;
use std::path::PathBuf;

/// Make a city of a real drive under open sky.
///
/// Puts buildings beside the street for stretches of time: satellites vanish or are seen by reflection only, the others get
/// multipath of code and phase and cycle slips without a flag. Writes the observations, what was done when to which
/// satellite, and the scenario. The same seed gives the same files, byte for byte.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Files in DIR:
  rover.obs      the observations, RINEX 3.04
  events.csv     streets, satellites hidden or reflected, jumps of ambiguities
  scenario.toml  the scenario with all its values

Examples:
  surefix degrade --rover rover.obs.gz --nav base.nav.gz --seed 3 -o city
  surefix degrade --print-default > city.toml
  surefix post city/rover.obs base.obs.gz base.nav.gz -o solved

A scenario needs only what differs from the default:
  [canyons]
  mask_deg = [20, 40]
  [slips]
  per_hour = 0")]
pub struct Args {
    /// Observations of the rover: RINEX 2 or 3, plain, gzipped or compact (Hatanaka)
    #[arg(long, value_name = "FILE", required_unless_present = "print_default")]
    rover: Option<PathBuf>,
    /// Navigation messages (RINEX 2 or 3, plain or gzipped), one file or more
    #[arg(long = "nav", value_name = "FILE", num_args = 1.., required_unless_present = "print_default")]
    navigation: Vec<PathBuf>,
    /// Scenario (TOML); the default city if not given
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Tall buildings: a harder city than the default one
    #[arg(long, conflicts_with = "scenario")]
    dense: bool,
    /// Seed of everything random, instead of the scenario's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Directory for the files; it is made if need be
    #[arg(short, long, value_name = "DIR", default_value = "degraded")]
    output: PathBuf,
    /// Print the scenario of the default city, or of the dense one, with all there is, and do nothing else
    #[arg(long)]
    print_default: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    let built_in = if args.dense { Scenario::dense() } else { Scenario::default() };
    let rover = match &args.rover {
        Some(rover) if !args.print_default => rover,
        _ => {
            write!(out, "{}", built_in.to_toml())?;
            return Ok(Outcome::Good);
        }
    };
    let mut scenario = match &args.scenario {
        Some(path) => {
            let name = path.display().to_string();
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("{name}: cannot be read; check the path, and that it is a text file"))?;
            Scenario::from_toml(&name, &text)?
        }
        None => built_in,
    };
    scenario.seed = args.seed.unwrap_or(scenario.seed);

    let mut reader = ObservationReader::open(rover)?;
    let mut navigation = NavigationData::default();
    for path in &args.navigation {
        navigation.merge(NavigationData::open(path)?);
    }
    let mut epochs = Vec::new();
    while let Some(epoch) = reader.next_epoch()? {
        epochs.push(epoch);
    }
    let degraded = degrade(&epochs, &navigation, &scenario).with_context(|| rover.display().to_string())?;
    if !degraded.unknown.is_empty() {
        let names: Vec<String> = degraded.unknown.iter().map(ToString::to_string).collect();
        eprintln!("warning: without ephemeris or carrier frequency, left as they are: {}", names.join(" "));
    }
    let paths = files::write(&args.output, reader.header(), &scenario, &degraded)?;
    let count = |what| degraded.events.iter().filter(|event| event.what == what).count();
    writeln!(
        out,
        "{} epochs, {} streets between buildings: satellites hidden {} times, reflected {} times, {} slips, {} new locks",
        degraded.epochs.len(),
        count(What::Canyon),
        count(What::Hidden),
        count(What::Reflected),
        count(What::Slip),
        count(What::Reacquired),
    )?;
    for path in &paths {
        writeln!(out, "  {}", path.display())?;
    }
    Ok(Outcome::Good)
}
