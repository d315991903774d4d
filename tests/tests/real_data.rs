//! `surefix post` and `surefix compare` on real observations: the cases of `cases.toml`, each with its limits, forward and
//! with `--smooth --em`.
//!
//! Settings are the defaults for all but the band list. Rows are printed beside what the peer reaches; see them with
//! `cargo test -p surefix-tests --test real_data -- --nocapture`: percent of epochs fixed and of fixed ones wrong; errors
//! `[cm]`, of fixed epochs in the forward cases and of all in the smoothed ones; rms of errors east, north and up over their
//! standard deviations; seconds to the first fix; epochs with a component beyond ten of its own standard deviations.

use std::path::{Path, PathBuf};
use surefix::cli::files::Files;
use surefix::cli::post;
use surefix::compare::{Enu, Options, Report, Truth, compare};
use surefix::process::settings::Settings;
use surefix::read::solution;
use surefix_core::model::motion::Motion;
use surefix_tests::cases::{Case, Limits, Reference, cases};
use surefix_tests::shared;

/// Forward, or smoothed with noise learned from the data.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    Forward,
    Smoothed,
}

/// What is reached.
struct Reached {
    epochs: usize,
    matched: usize,
    fixed_percent: f64,
    wrong_percent: f64,
    horizontal_cm: f64,
    three_d_cm: f64,
    three_d_p95_cm: f64,
    normalized: Enu,
    first_fix_s: f64,
    beyond_10_sigma: usize,
}

/// What `surefix post` and `surefix compare` make of a case's files in `directory`.
fn run(case: &Case, directory: &Path, way: Way) -> Report {
    let file = |name: &String| directory.join(name);
    let files = Files {
        rover: file(&case.rover),
        base: file(&case.base),
        navigation: case.navigation.iter().map(file).collect(),
        base_xyz: Some(case.base_xyz.into()),
        base_antenna: None,
        moving_base: false,
    };
    let mut settings = Settings { bands: case.bands.clone(), ..Settings::default() };
    match case.motion.as_deref() {
        None => {}
        Some("static") => settings.motion = Motion::Static,
        Some(other) => panic!("{}: no motion is called {other}", case.name),
    }
    let smooth = way == Way::Smoothed;
    settings.smoothing.em = smooth;
    let output = tempfile::tempdir().unwrap();
    let (_, [_, csv, _]): (_, [PathBuf; 3]) = post::process(&files, &settings, smooth, output.path()).unwrap();
    let track = solution::read(&csv, &solution::Options::default()).unwrap();
    compare(&track, &truth(&case.truth, directory, &track), &Options::default())
}

fn truth(reference: &Reference, directory: &Path, solution: &solution::Track) -> Truth {
    match (&reference.file, reference.xyz) {
        (Some(file), _) => {
            let only_quality = reference.quality.clone();
            let options = solution::Options { near: solution.start, only_quality, ..Default::default() };
            Truth::Track(solution::read(&directory.join(file), &options).unwrap())
        }
        (None, Some(xyz)) => Truth::Fixed(xyz.into()),
        (None, None) => panic!("a case without truth"),
    }
}

impl Reached {
    fn new(report: &Report, way: Way) -> Self {
        let (errors, normalized) = match way {
            Way::Forward => (report.fixed, report.fixed_normalized),
            Way::Smoothed => (report.all, report.all_normalized),
        };
        const NONE: Enu = Enu { east: f64::NAN, north: f64::NAN, up: f64::NAN };
        Self {
            epochs: report.epochs,
            matched: report.matched,
            fixed_percent: 100.0 * report.fix_rate,
            wrong_percent: 100.0 * report.wrong_fix_rate,
            horizontal_cm: errors.map_or(f64::NAN, |errors| 100.0 * errors.rms_horizontal_m),
            three_d_cm: errors.map_or(f64::NAN, |errors| 100.0 * errors.rms_3d_m),
            three_d_p95_cm: errors.map_or(f64::NAN, |errors| 100.0 * errors.three_d_m.p95),
            normalized: normalized.map_or(NONE, |normalized| normalized.rms),
            first_fix_s: report.first_fix_s.unwrap_or(f64::INFINITY),
            beyond_10_sigma: report.all_normalized.map_or(0, |normalized| normalized.beyond_10_sigma),
        }
    }

    /// Prints a row under its heads.
    fn print(&self, name: &str, peer: &str) {
        let Enu { east, north, up } = self.normalized;
        println!(
            "{:16} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>5} {:>5} {:>5} {:>5} {:>5}  peer\n\
             {name:16} {:6} {:6.2} {:6.2} {:6.2} {:6.2} {:6.2} {east:5.2} {north:5.2} {up:5.2} {:5.0} {:5}  {peer}",
            "case",
            "epochs",
            "fixed",
            "wrong",
            "rms H",
            "rms 3D",
            "p95",
            "e/σ",
            "n/σ",
            "u/σ",
            "first",
            ">10σ",
            self.epochs,
            self.fixed_percent,
            self.wrong_percent,
            self.horizontal_cm,
            self.three_d_cm,
            self.three_d_p95_cm,
            self.first_fix_s,
            self.beyond_10_sigma,
        );
    }

    /// The limits that are not kept, in words. NaN keeps none.
    fn missed(&self, limits: &Limits) -> Vec<String> {
        let mut missed = Vec::new();
        let mut check = |what: &str, limit: Option<[f64; 2]>, value: f64| {
            let Some([least, most]) = limit else { return };
            if !(least..=most).contains(&value) {
                missed.push(format!("{what} {value:.2}, not in {least} to {most}"));
            }
        };
        let least = |limit: Option<f64>| limit.map(|limit| [limit, f64::INFINITY]);
        let most = |limit: Option<f64>| limit.map(|limit| [0.0, limit]);
        check("fixed [%]", least(limits.fixed_percent), self.fixed_percent);
        check("wrong [% of fixed]", most(limits.wrong_percent), self.wrong_percent);
        check("rms horizontal [cm]", most(limits.horizontal_cm), self.horizontal_cm);
        check("rms 3-D [cm]", most(limits.three_d_cm), self.three_d_cm);
        check("3-D 95 % [cm]", most(limits.three_d_p95_cm), self.three_d_p95_cm);
        check("error/σ east", limits.normalized_horizontal, self.normalized.east);
        check("error/σ north", limits.normalized_horizontal, self.normalized.north);
        check("error/σ up", limits.normalized_up, self.normalized.up);
        check("first fix [s]", most(limits.first_fix_s), self.first_fix_s);
        let beyond_10_sigma = limits.beyond_10_sigma.map(|limit| limit as f64);
        check("epochs beyond 10 σ", most(beyond_10_sigma), self.beyond_10_sigma as f64);
        missed
    }
}

/// Runs a case, prints its row and fails if a limit is not kept.
fn check(name: &str, way: Way) {
    let case = cases().unwrap().into_iter().find(|case| case.name == name).unwrap();
    let Some(directory) = shared(&format!("data/{}", case.directory)) else { return };
    let (peer, limits, shortfall) = match (&case.smooth, way) {
        (Some(smooth), Way::Smoothed) => (&smooth.peer, &smooth.limits, &smooth.shortfall),
        (None, Way::Smoothed) => panic!("{name} has no limits for smoothing"),
        (_, Way::Forward) => (&case.peer, &case.limits, &case.shortfall),
    };
    let reached = Reached::new(&run(&case, &directory, way), way);
    reached.print(name, peer);
    assert!(reached.matched > 0, "{name}: no epoch has a truth");
    let missed = reached.missed(limits);
    if let Some(shortfall) = shortfall {
        println!("{name} falls short: {}", missed.join("; "));
        assert!(!missed.is_empty(), "{name} keeps its limits: take its shortfall out of the table");
        let worse = reached.missed(shortfall);
        assert!(worse.is_empty(), "{name}: {}", worse.join("; "));
    } else {
        assert!(missed.is_empty(), "{name}: {}", missed.join("; "));
    }
}

macro_rules! cases {
    ($way:ident: $($name:ident)*) => {
        pub(super) const NAMES: &[&str] = &[$(stringify!($name)),*];

        $(#[test]
        fn $name() {
            super::check(stringify!($name), super::Way::$way);
        })*
    };
}

#[test]
fn every_case_has_its_tests() {
    let cases = cases().unwrap();
    assert!(cases.iter().map(|case| case.name.as_str()).eq(forward::NAMES.iter().copied()));
    let smoothed = cases.iter().filter(|case| case.smooth.is_some());
    assert!(smoothed.map(|case| case.name.as_str()).eq(smoothed::NAMES.iter().copied()));
}

mod forward {
    cases! {
        Forward:
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
}

mod smoothed {
    cases! {
        Smoothed:
        car
        wtzr_two_bands
        nagoya_two_bands
        geonet
    }
}
