//! Real data through a device log: an engine is told the same by the log as by the files, and answers the same.

use std::path::{Path, PathBuf};
use surefix::cli::files::Files;
use surefix::log::{LogInputs, LogWriter};
use surefix::process::run::Engine;
use surefix::process::stream::Input;
use surefix_core::gnss::solution::{Quality, Solution};
use surefix_core::log::Event;
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::config::BandPlan;
use surefix_core::rtk::feed::CONFIG_SCHEMA;
use surefix_tests::shared;

/// Rover, base and a navigation file of a data set; some are kept compressed, some not.
fn files(directory: &Path, navigation: &str) -> Files {
    let file = |name: &str| -> PathBuf {
        let plain = directory.join(name);
        if plain.exists() { plain } else { directory.join(format!("{name}.gz")) }
    };
    Files {
        rover: file("rover.obs"),
        base: file("base.obs"),
        navigation: vec![file(navigation)],
        base_xyz: None,
        base_antenna: None,
        moving_base: false,
    }
}

fn told_by_files(files: &Files) -> Vec<Input> {
    files.open().unwrap().stream().map(Result::unwrap).collect()
}

fn told_by_log(bytes: &[u8]) -> Vec<Input> {
    let mut log = LogInputs::new("test.sfl", bytes).unwrap();
    let told = log.by_ref().map(Result::unwrap).collect();
    assert!(log.damage().is_none(), "{:?}", log.damage());
    told
}

#[test]
fn a_log_tells_what_the_files_tell() {
    for (case, navigation) in [
        ("kinematic_ucr_car_2020194_10min", "rover.nav"),
        ("static_nagoya_2024176_1hz", "base.nav"),
        ("static_galway_2018277", "rover.nav"),
    ] {
        let Some(directory) = shared(&format!("data/{case}")) else { continue };
        let told = told_by_files(&files(&directory, navigation));
        assert!(told.len() > 300, "{case}: {}", told.len());
        let mut log = LogWriter::new(Vec::new());
        told.iter().for_each(|input| log.input(input).unwrap());
        assert!(told_by_log(&log.finish().unwrap()) == told, "{case}: the log differs from the files");
    }
}

/// With settings that are not the defaults: they come with the log.
#[test]
fn a_replayed_log_gives_the_solutions_of_the_files() {
    let Some(directory) = shared("data/kinematic_ucr_car_2020194_10min") else { return };
    let config = RtkConfig { bands: BandPlan::L1, max_age: 5.0, ..RtkConfig::default() };
    assert_ne!(config.max_age, RtkConfig::default().max_age);
    let told = told_by_files(&files(&directory, "rover.nav"));
    let mut engine = Engine::new(config);
    let solutions: Vec<Solution> = told.iter().filter_map(|input| engine.feed(input)).collect();
    let good = solutions.iter().filter(|solution| solution.quality <= Quality::Float).count();
    assert!(good > 300, "{good} of {}", solutions.len());

    let mut log = LogWriter::new(Vec::new());
    log.config(CONFIG_SCHEMA, &config).unwrap();
    told.iter().for_each(|input| log.input(input).unwrap());
    let log = log.finish().unwrap();
    let mut engine = Engine::new(RtkConfig::default());
    let replayed: Vec<Solution> = told_by_log(&log).iter().filter_map(|input| engine.feed(input)).collect();
    assert!(frames(&replayed) == frames(&solutions), "the solutions differ");

    // A reset in the middle costs the fix for a while, and not the stations and ephemerides.
    let (before, after) = told.split_at(told.len() / 2);
    let mut log = LogWriter::new(Vec::new());
    log.config(CONFIG_SCHEMA, &config).unwrap();
    before.iter().for_each(|input| log.input(input).unwrap());
    log.event(Event::Reset).unwrap();
    after.iter().for_each(|input| log.input(input).unwrap());
    let log = log.finish().unwrap();
    let mut engine = Engine::new(RtkConfig::default());
    let restarted: Vec<Solution> = told_by_log(&log).iter().filter_map(|input| engine.feed(input)).collect();
    let half = before.iter().filter(|input| matches!(input, Input::Rover(_))).count();
    assert!(frames(&restarted[..half]) == frames(&solutions[..half]));
    assert!(frames(&restarted) != frames(&solutions));
    let last = [&restarted, &solutions].map(|solutions| solutions.last().unwrap().position);
    assert!((last[0] - last[1]).norm() < 0.05, "{last:?}");
}

/// Solutions as the bytes of a log, which tell any two apart.
fn frames(solutions: &[Solution]) -> Vec<u8> {
    let mut log = LogWriter::new(Vec::new());
    solutions.iter().for_each(|solution| log.solution(solution).unwrap());
    log.finish().unwrap()
}
