//! `surefix post` and `surefix compare` on real observations: the cases of `cases.toml`, each with its limits.
//!
//! Settings are the defaults for all but the band list. Rows are printed beside what the peer reaches; see them with
//! `cargo test -p surefix-tests --test real_data -- --nocapture`: percent of epochs fixed and of fixed ones wrong, rms errors
//! of fixed epochs `[cm]`, seconds to the first fix, epochs with a component beyond ten of its own standard deviations.

use serde::Deserialize;
use std::path::{Path, PathBuf};
use surefix::cli::files::Files;
use surefix::cli::post;
use surefix::compare::{Options, Report, Truth, compare};
use surefix::process::settings::Settings;
use surefix::read::solution;
use surefix_core::model::motion::Motion;
use surefix_tests::shared;

/// A row of the table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    directory: String,
    rover: String,
    base: String,
    navigation: Vec<String>,
    base_xyz: [f64; 3],
    #[serde(rename = "antennas_m")]
    _antennas: Option<[f64; 2]>,
    bands: String,
    motion: Option<Motion>,
    truth: Reference,
    peer: String,
    limits: Limits,
    /// What is reached where a limit is not.
    shortfall: Option<Limits>,
}

/// Where the rover's marker truly is.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reference {
    xyz: Option<[f64; 3]>,
    file: Option<String>,
    quality: Option<String>,
}

/// What must be reached; nothing is asked where there is none.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Limits {
    fixed_percent: Option<f64>,
    wrong_percent: Option<f64>,
    horizontal_cm: Option<f64>,
    three_d_cm: Option<f64>,
    first_fix_s: Option<f64>,
    beyond_10_sigma: Option<usize>,
}

/// What is reached.
struct Reached {
    epochs: usize,
    matched: usize,
    fixed_percent: f64,
    wrong_percent: f64,
    horizontal_cm: f64,
    three_d_cm: f64,
    first_fix_s: f64,
    beyond_10_sigma: usize,
}

fn cases() -> Vec<Case> {
    #[derive(Deserialize)]
    struct Table {
        case: Vec<Case>,
    }
    toml::from_str::<Table>(include_str!("../cases.toml")).unwrap().case
}

impl Case {
    /// What `surefix post` and `surefix compare` make of the files in `directory`.
    fn run(&self, directory: &Path) -> Report {
        let file = |name: &String| directory.join(name);
        let files = Files {
            rover: file(&self.rover),
            base: file(&self.base),
            navigation: self.navigation.iter().map(file).collect(),
            base_xyz: Some(self.base_xyz.into()),
            base_antenna: None,
        };
        let mut settings = Settings { bands: self.bands.clone(), ..Settings::default() };
        settings.motion = self.motion.unwrap_or(settings.motion);
        let output = tempfile::tempdir().unwrap();
        let (_, [_, csv, _]): (_, [PathBuf; 3]) = post::process(&files, &settings, output.path(), false).unwrap();
        let track = solution::read(&csv, &solution::Options::default()).unwrap();
        compare(&track, &self.truth.read(directory, &track), &Options::default())
    }
}

impl Reference {
    fn read(&self, directory: &Path, solution: &solution::Track) -> Truth {
        match (&self.file, self.xyz) {
            (Some(file), _) => {
                let only_quality = self.quality.clone();
                let options = solution::Options { near: solution.start, only_quality, ..Default::default() };
                Truth::Track(solution::read(&directory.join(file), &options).unwrap())
            }
            (None, Some(xyz)) => Truth::Fixed(xyz.into()),
            (None, None) => panic!("a case without truth"),
        }
    }
}

impl From<&Report> for Reached {
    fn from(report: &Report) -> Self {
        Self {
            epochs: report.epochs,
            matched: report.matched,
            fixed_percent: 100.0 * report.fix_rate,
            wrong_percent: 100.0 * report.wrong_fix_rate,
            horizontal_cm: report.fixed.map_or(f64::NAN, |errors| 100.0 * errors.rms_horizontal_m),
            three_d_cm: report.fixed.map_or(f64::NAN, |errors| 100.0 * errors.rms_3d_m),
            first_fix_s: report.first_fix_s.unwrap_or(f64::INFINITY),
            beyond_10_sigma: report.all_normalized.map_or(0, |normalized| normalized.beyond_10_sigma),
        }
    }
}

impl Limits {
    /// The limits that are not kept, in words. NaN keeps none.
    fn missed(&self, reached: &Reached) -> Vec<String> {
        let mut missed = Vec::new();
        let mut check = |what: &str, limit: Option<f64>, value: f64, least: bool| {
            let Some(limit) = limit else { return };
            let keeps = if least { value >= limit } else { value <= limit };
            if !keeps {
                missed.push(format!("{what} {value:.2}, {} {limit}", if least { "at least" } else { "at most" }));
            }
        };
        check("fixed [%]", self.fixed_percent, reached.fixed_percent, true);
        check("wrong [% of fixed]", self.wrong_percent, reached.wrong_percent, false);
        check("rms horizontal [cm]", self.horizontal_cm, reached.horizontal_cm, false);
        check("rms 3-D [cm]", self.three_d_cm, reached.three_d_cm, false);
        check("first fix [s]", self.first_fix_s, reached.first_fix_s, false);
        let beyond_10_sigma = self.beyond_10_sigma.map(|limit| limit as f64);
        check("epochs beyond 10 σ", beyond_10_sigma, reached.beyond_10_sigma as f64, false);
        missed
    }
}

/// Runs a case, prints its row and fails if a limit is not kept.
fn check(name: &str) {
    let case = cases().into_iter().find(|case| case.name == name).unwrap();
    let Some(directory) = shared(&format!("data/{}", case.directory)) else { return };
    let reached = Reached::from(&case.run(&directory));
    println!(
        "{:16} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>5}  peer\n{:16} {:6} {:6.2} {:6.2} {:6.2} {:6.2} {:6.0} {:5}  {}",
        "case",
        "epochs",
        "fixed",
        "wrong",
        "rms H",
        "rms 3D",
        "first",
        ">10σ",
        name,
        reached.epochs,
        reached.fixed_percent,
        reached.wrong_percent,
        reached.horizontal_cm,
        reached.three_d_cm,
        reached.first_fix_s,
        reached.beyond_10_sigma,
        case.peer
    );
    assert!(reached.matched > 0, "{name}: no epoch has a truth");
    let missed = case.limits.missed(&reached);
    if let Some(shortfall) = &case.shortfall {
        println!("{name} falls short: {}", missed.join("; "));
        assert!(!missed.is_empty(), "{name} keeps its limits: take its shortfall out of the table");
        let worse = shortfall.missed(&reached);
        assert!(worse.is_empty(), "{name}: {}", worse.join("; "));
    } else {
        assert!(missed.is_empty(), "{name}: {}", missed.join("; "));
    }
}

macro_rules! cases {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })*

        #[test]
        fn every_case_has_a_test() {
            let names: Vec<String> = cases().into_iter().map(|case| case.name).collect();
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

cases! {
    car
    wtzr_one_band
    wtzr_two_bands
    nagoya_one_band
    nagoya_two_bands
    geonet
    geonet_static
    galway_static
    saitama
    tokyo
    galway_drive
    galway_walk
}
