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
fn sun_moon_and_tides() {
    passes("10_sunmoon_tides.json");
}

#[test]
fn atmosphere_of_precise_points() {
    if surefix_tests::shared("data").is_some() {
        passes("08_gmf_gpt_ionex.json");
    }
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

#[test]
fn precise_orbits_and_clocks() {
    passes("06_sp3_clk.json");
}

#[test]
fn broadcast_against_precise() {
    if surefix_tests::shared("data").is_some() {
        passes("09_broadcast_vs_sp3.json");
    }
}

#[test]
fn attitude_wind_up_antennas_and_relativity() {
    passes("11_windup_antenna_relativity.json");
}

/// A model that is not known is reported as such, not passed over.
#[test]
fn what_is_not_built_fails_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("crystal_ball.json");
    std::fs::write(&path, r#"{"cases": [{"id": "a", "model": "crystal ball", "in": {}, "out": {"future": {}}}]}"#)
        .unwrap();
    let report = run_file(&path, None).unwrap();
    assert!(!report.passed() && report.unknown_models().contains_key("crystal ball"), "{report}");
}
