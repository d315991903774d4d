//! `surefix study urban`.

use crate::cli::Outcome;
use crate::cli::files::Files;
use crate::compare::Truth;
use crate::degrade::scenario::Scenario;
use crate::process::settings::Settings;
use crate::process::stream::Input;
use crate::read::rinex::NavigationData;
use crate::read::solution;
use crate::study::urban::{self, Drive, Table, VARIANTS, Variant};
use anyhow::Context;
use nalgebra::Vector3;
use serde::Deserialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Adaptive noise and other settings between buildings.
///
/// Takes a table of real cases, such as `tests/cases.toml`, makes cities of one of them with several seeds as `surefix
/// degrade` does, and runs the engine forward with each variant of its configuration; then on the cases as they are.
/// Prints how each compares with the truth.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Variants are a TOML file:
  [[variant]]
  name = \"plain\"
  [[variant]]
  name = \"ratio 3\"
  config = { acceptance = { ratio = 3.0 } }

Examples:
  surefix study urban --data ../shared/data
  surefix study urban --data ../shared/data --seeds 0 --cases-as-they-are geonet
  surefix study urban --data ../shared/data --seeds 20 --variants mine.toml --cases-as-they-are none")]
pub struct Args {
    /// Directory of the real data
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Table of real cases: their files in that directory, bands and truths
    #[arg(long, value_name = "FILE.toml", default_value = "tests/cases.toml")]
    cases: PathBuf,
    /// Case to degrade
    #[arg(long, value_name = "CASE", default_value = "car")]
    city: String,
    /// How many cities; seeds 1 to N
    #[arg(long, value_name = "N", default_value_t = 5)]
    seeds: u64,
    /// Scenario of the cities, as `surefix degrade` has it; the default city and the dense one if not given
    #[arg(long, value_name = "FILE.toml")]
    scenario: Option<PathBuf>,
    /// Variants; a built-in list if not given
    #[arg(long, value_name = "FILE.toml")]
    variants: Option<PathBuf>,
    /// Cases to run as they are, or none
    #[arg(
        long,
        value_name = "CASE",
        value_delimiter = ',',
        default_value = "car,wtzr_two_bands,nagoya_two_bands,geonet,galway_static,galway_drive,moving_base"
    )]
    cases_as_they_are: Vec<String>,
}

/// What is needed of a case in the table; its limits are not.
#[derive(Clone, Deserialize)]
struct Case {
    name: String,
    directory: String,
    rover: String,
    base: String,
    navigation: Vec<String>,
    base_xyz: [f64; 3],
    bands: String,
    truth: Reference,
    /// For a moving base: where to put the vectors.
    #[serde(skip)]
    vectors_from: Option<Vector3<f64>>,
}

/// Where the rover truly was.
#[derive(Clone, Deserialize)]
struct Reference {
    xyz: Option<[f64; 3]>,
    file: Option<String>,
    quality: Option<String>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let variants = match &args.variants {
        Some(path) => Variant::all(&text(path)?).with_context(|| path.display().to_string())?,
        None => Variant::all(VARIANTS)?,
    };
    let scenarios = match &args.scenario {
        Some(path) => vec![("own city", Scenario::from_toml(&path.display().to_string(), &text(path)?)?)],
        None => vec![("city", Scenario::default()), ("dense", Scenario::dense())],
    };
    let cases = cases(&args.cases)?;
    let find = |name: &String| {
        let known = || cases.iter().map(|case| case.name.as_str()).collect::<Vec<_>>().join(", ");
        let table = args.cases.display();
        cases
            .iter()
            .find(|case| case.name == *name)
            .with_context(|| format!("{table}: has no case {name}, but {}", known()))
    };
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", Table::HEAD)?;
    let mut matched = false;
    let mut print = |table: Table| {
        matched |= table.0.iter().any(|row| row.score.rms_3d()[0].is_finite());
        write!(out, "{table}").and_then(|()| out.flush())
    };
    if args.seeds > 0 {
        let (drive, navigation) = find(&args.city)?.read(&args.data)?;
        for (name, scenario) in &scenarios {
            let city = |seed| drive.degraded(&navigation, &Scenario { seed, ..scenario.clone() });
            let runs = (1..=args.seeds).map(city).collect::<Result<Vec<Drive>, _>>()?;
            print(urban::run(&format!("{}, {name}", args.city), &runs, &variants)?)?;
        }
    }
    for name in args.cases_as_they_are.iter().filter(|name| *name != "none") {
        let (drive, _) = find(name)?.read(&args.data)?;
        print(urban::run(name, &[drive], &variants)?)?;
    }
    Ok(if matched { Outcome::Good } else { Outcome::Bad })
}

fn text(path: &Path) -> anyhow::Result<String> {
    let name = path.display();
    std::fs::read_to_string(path)
        .with_context(|| format!("{name}: cannot be read; check the path, and that it is a text file"))
}

/// All cases of a table, and the vectors from the car to its base.
fn cases(path: &Path) -> anyhow::Result<Vec<Case>> {
    #[derive(Deserialize)]
    struct Cases {
        case: Vec<Case>,
    }
    let table: Cases = toml::from_str(&text(path)?).with_context(|| path.display().to_string())?;
    let mut cases = table.case;
    if let Some(car) = cases.iter().find(|case| case.name == "car").cloned() {
        cases.push(Case {
            name: "moving_base".into(),
            rover: car.base.clone(),
            base: car.rover.clone(),
            truth: Reference {
                xyz: None,
                file: Some("../moving_base_ucr_2020194/baseline_truth.csv.gz".into()),
                quality: None,
            },
            // Some point of the drive: vectors are compared in its local frame.
            vectors_from: Some(Vector3::new(-2_430_550.69, -4_703_759.45, 3_544_971.765)),
            ..car
        });
    }
    Ok(cases)
}

impl Case {
    /// Its inputs, truth and configuration, and the navigation messages.
    fn read(&self, data: &Path) -> anyhow::Result<(Drive, NavigationData)> {
        let directory = data.join(&self.directory);
        let moving_base = self.vectors_from.is_some();
        let files = Files {
            rover: directory.join(&self.rover),
            base: directory.join(&self.base),
            navigation: self.navigation.iter().map(|name| directory.join(name)).collect(),
            base_xyz: (!moving_base).then(|| self.base_xyz.into()),
            base_antenna: None,
            moving_base,
        };
        let mut open = files.open()?;
        let mut stream = open.stream();
        let inputs = stream.by_ref().collect::<Result<Vec<_>, _>>()?;
        stream.coverage()?;
        drop(stream);
        let near = inputs.iter().find_map(|input| match input {
            Input::Rover(epoch) => Some(epoch.time),
            _ => None,
        });
        let truth = match (&self.truth.file, self.truth.xyz) {
            (Some(file), _) => {
                let only_quality = self.truth.quality.clone();
                let options =
                    solution::Options { near, only_quality, vectors_from: self.vectors_from, ..Default::default() };
                Truth::Track(solution::read(&directory.join(file), &options)?)
            }
            (None, Some(xyz)) => Truth::Fixed(xyz.into()),
            (None, None) => anyhow::bail!("case {}: has no truth; give its xyz or file", self.name),
        };
        let settings = Settings { bands: self.bands.clone(), moving_base, ..Settings::default() };
        let name = self.name.clone();
        let vectors_from = self.vectors_from;
        Ok((Drive { name, inputs, truth, config: settings.config()?, vectors_from }, open.navigation))
    }
}
