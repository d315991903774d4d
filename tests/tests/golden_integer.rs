//! Integer estimation against golden vectors of independent implementations, each within the file's
//! tolerance.

use surefix::vectors::run_file;

/// Runs a vector file, or skips where the reference data is absent.
fn passes(file: &str) {
    let Some(path) = surefix_tests::shared(file) else { return };
    let report = run_file(&path, None).unwrap();
    assert!(report.passed(), "{file}:\n{report}");
}

#[test]
fn decorrelation() {
    passes("vectors/milrkf/decorrelation.json");
}

#[test]
fn least_squares() {
    passes("vectors/milrkf/ils.json");
}

/// RTKLIB's tests, LGR 12 and PPP arcs, verified by an exact rational exhaustive search.
#[test]
fn published_cases() {
    passes("data/lambda_vectors/vectors.json");
}

#[test]
fn bootstrapping() {
    passes("vectors/milrkf/bootstrap.json");
}

#[test]
fn success_rates() {
    passes("vectors/milrkf/success_rates.json");
}

/// All bounds of Wang et al. (2022), table 1 as corrected, with simulated rates.
#[test]
fn success_bounds() {
    passes("vectors/iavakf/success_rates.json");
}

/// Partial fixing, K factors, Stanford classes, β and R* (L. Wang et al. 2022).
#[test]
fn partial_fixing() {
    passes("vectors/iavakf/par.json");
}

#[test]
fn k_factors() {
    passes("vectors/iavakf/k_factors.json");
}

#[test]
fn stanford_classes() {
    passes("vectors/iavakf/stanford.json");
}

#[test]
fn forgetting() {
    passes("vectors/iavakf/beta.json");
}

#[test]
fn adaptive_noise() {
    passes("vectors/iavakf/rstar_chain.json");
}
