//! The GNSS models against golden vectors of independent programs and publications, each within the file's tolerance.

use surefix::vectors::run_file;

/// Runs `vectors/gnss/<file>`, or skips where the reference data is absent.
fn passes(file: &str) {
    let Some(path) = surefix_tests::shared(&format!("vectors/gnss/{file}")) else { return };
    let report = run_file(&path, surefix_tests::shared("data").as_deref()).unwrap();
    assert!(report.passed(), "{file}:\n{report}");
}

#[test]
fn time_scales() {
    passes("01_time.json");
}

#[test]
fn coordinates() {
    passes("02_coordinates.json");
}

#[test]
fn kepler_orbits() {
    passes("03_broadcast_kepler.json");
    passes("03b_week_change.json");
}

#[test]
fn glonass_orbits() {
    passes("04_glonass.json");
}

#[test]
fn ephemeris_selection() {
    if surefix_tests::shared("data").is_some() {
        passes("05_ephemeris_selection.json");
    }
}

#[test]
fn atmosphere() {
    passes("07_klobuchar_saastamoinen_niell.json");
}

#[test]
fn single_points() {
    if surefix_tests::shared("data").is_some() {
        passes("13_single_point.json");
    }
}

#[test]
fn combinations() {
    passes("12_combinations.json");
}

/// A model that is not built is reported as unknown, not passed over.
#[test]
fn what_is_not_built_yet_fails_by_name() {
    let Some(path) = surefix_tests::shared("vectors/gnss/06_sp3_clk.json") else { return };
    let report = run_file(&path, None).unwrap();
    assert!(!report.passed() && report.unknown_models().contains_key("sp3"), "{report}");
}
