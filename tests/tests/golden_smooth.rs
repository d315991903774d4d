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

/// EM on a linear model of dense Q and R: one for each epoch, or one for all; full or diagonal R.
#[test]
fn em_of_dense_linear_models() {
    passes("vectors/emppp/ltv_em.json");
}

/// EM on a small linearised PPP problem, six schemes. R and Q of the file come from a centred form in double precision,
/// which loses digits where Q is small beside P: they are compared with the same formulas in 60 digits instead
/// (`tests/data`), to the tolerance that the file states. All else is compared with the file itself.
#[test]
fn schemes_of_em_for_ppp() {
    let Some(path) = surefix_tests::shared("vectors/emppp/ppp_mini.json") else { return };
    let as_it_is = run_file(&path, None).unwrap();
    for (name, check) in as_it_is.checks() {
        // 2.98e-5 and 2.28e-7 are how far the file is from 60 digits.
        let off = match name.as_str() {
            "Q" => 2.99e-5,
            "R" => 2.29e-7,
            _ => 0.0,
        };
        let worst = check.worst.as_ref().unwrap();
        let allowed = f64::max(off, worst.tolerance.unwrap());
        assert!(worst.deviation <= allowed, "{name}: {worst:?}");
    }
    let mut root: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let exact = concat!(env!("CARGO_MANIFEST_DIR"), "/data/em_ppp_60_digits.json");
    let exact: serde_json::Value = serde_json::from_slice(&std::fs::read(exact).unwrap()).unwrap();
    for scheme in root["schemes"].as_array_mut().unwrap() {
        let of = &exact["schemes"][scheme["scheme"].as_str().unwrap()];
        for (k, iteration) in scheme["iterations"].as_array_mut().unwrap().iter_mut().enumerate().skip(1) {
            for key in ["R", "Qdiag"] {
                iteration[key] = of[k - 1][key].clone();
            }
        }
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), serde_json::to_vec(&root).unwrap()).unwrap();
    let report = run_file(file.path(), None).unwrap();
    assert!(report.passed(), "{report}");
}
