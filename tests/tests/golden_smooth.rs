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

#[test]
fn smoothing_with_double_differences() {
    passes("vectors/app/05_rtsap_DD_E.json");
    passes("vectors/app/05_rtsap_DD_SR.json");
}

#[test]
fn smoothing_with_single_differences() {
    passes("vectors/app/05_rtsap_SD_E.json");
}

/// Ambiguities that contradict their prior: wrong fixes, and bootstrapping that differs from integer least squares.
#[test]
fn smoothing_from_a_wrong_prior() {
    passes("vectors/app/07_rtsap_DD_hard.json");
}

#[test]
fn steps_of_em_with_the_multi_band_models() {
    passes("vectors/app/04_em_DD.json");
    passes("vectors/app/04_em_SD.json");
}
