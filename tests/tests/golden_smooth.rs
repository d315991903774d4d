//! Models and smoothers against golden vectors of an independent reference implementation, each within the stated
//! tolerance.

use surefix::vectors::run_file;

/// Runs a vector file, or skips where the reference data is absent.
fn passes(file: &str) {
    let Some(path) = surefix_tests::shared(file) else { return };
    let report = run_file(&path, None).unwrap();
    assert!(report.passed(), "{file}:\n{report}");
}

#[test]
fn geometry_of_the_study() {
    passes("vectors/app/00_geometry_G2.json");
}

#[test]
fn moments_of_a_partially_linear_function() {
    passes("vectors/app/02_pl_moments.json");
}

#[test]
fn multi_band_models() {
    passes("vectors/app/03_measurement_DD.json");
    passes("vectors/app/03_measurement_SD.json");
}

#[test]
fn linear_filter_and_smoother() {
    passes("vectors/app/01_rts_ltv.json");
}

#[test]
fn steps_of_em() {
    passes("vectors/app/04_em_small.json");
}

#[test]
fn integers_of_float_solutions() {
    passes("vectors/app/06_integer_fix.json");
}
