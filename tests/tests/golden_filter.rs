//! Linearisation, updates, slip detection and the mixed-integer filter against golden vectors of independent arithmetic
//! of 50 to 60 digits, each within the file's tolerance.

use surefix::vectors::run_file;

/// Runs a vector file, or skips where the reference data is absent.
fn passes(file: &str) {
    let Some(path) = surefix_tests::shared(file) else { return };
    let report = run_file(&path, None).unwrap();
    assert!(report.passed(), "{file}:\n{report}");
}

#[test]
fn linearisation() {
    passes("vectors/milrkf/pl_moments.json");
}

#[test]
fn kalman_updates() {
    passes("vectors/milrkf/kf_update.json");
}

#[test]
fn cycle_slips() {
    passes("vectors/milrkf/cycle_slip.json");
}

/// Section V: 13 satellites with a prior of 10 m.
#[test]
fn mixed_integer_filter() {
    passes("vectors/milrkf/alg1_A_N13_ckf_b0.05h.json");
}

/// 8 satellites with a prior of 10 km, by each rule.
#[test]
fn mixed_integer_filter_with_a_wide_prior() {
    for rule in ["ekf", "ckf", "ut_1_2_1", "gh3"] {
        passes(&format!("vectors/milrkf/alg1_C_N8_{rule}_wideprior.json"));
    }
}

#[test]
fn recursive_mixed_integer_least_squares() {
    passes("vectors/milrkf/rmils.json");
}
