//! Integer estimation and Kalman updates against golden vectors of an independent implementation.
//!
//! `vectors/milrkf/*.json`: 50-digit arithmetic from the listed doubles; each file's `doc` states what it holds.
//! `data/lambda_vectors/vectors.json`: published LAMBDA cases (RTKLIB's tests, LGR 12, PPP arcs), every result verified by an
//! exact rational exhaustive search.

use serde_json::Value;
use surefix_core::integer::bootstrap::bootstrap_ordered;
use surefix_core::integer::decorrelate::decorrelate;
use surefix_core::integer::{Config, Method, Workspace, resolve, success_rate};
use surefix_core::linalg::block::{update_block, whiten};
use surefix_core::linalg::ldl::factor_ltdl;
use surefix_core::linalg::sequential::{Row, update_scalar, update_scalar_joseph};
use surefix_core::linalg::{Mat, MatMut};

/// The cases of a vector file, or `None` where the file is absent.
fn cases(path: &str) -> Option<Vec<Value>> {
    let text = std::fs::read_to_string(surefix_tests::shared(path)?).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let cases = file["cases"].as_array().unwrap().clone();
    assert!(!cases.is_empty(), "{path} has no cases");
    Some(cases)
}

fn vector(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// A matrix, row-major and packed.
fn matrix(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().flat_map(vector).collect()
}

fn integers(value: &Value) -> Vec<i64> {
    value.as_array().unwrap().iter().map(|x| x.as_i64().unwrap_or_else(|| x.as_f64().unwrap() as i64)).collect()
}

#[track_caller]
fn assert_close(got: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((got - expected).abs() <= tolerance * expected.abs().max(1.0), "{what}: {got}, expected {expected}");
}

#[test]
fn decorrelation_keeps_what_it_must() {
    let Some(cases) = cases("vectors/milrkf/decorrelation.json") else { return };
    for case in &cases {
        let name = case["name"].as_str().unwrap();
        let q = matrix(&case["Q"]);
        let n = case["n"].as_u64().unwrap() as usize;

        // Q = Lᵀ D L is unique.
        let mut factor = q.clone();
        let mut d = vec![0.0; n];
        factor_ltdl(&mut MatMut::square(&mut factor, n).unwrap(), &mut d).unwrap();
        for (got, expected) in d.iter().zip(vector(&case["ltdl_d"])) {
            assert_close(got / expected, 1.0, 1e-9, name);
        }
        for (i, row) in case["ltdl_L"].as_array().unwrap().iter().enumerate() {
            for (j, expected) in vector(row).iter().enumerate().take(i + 1) {
                assert_close(factor[i * n + j], *expected, 1e-9, name);
            }
        }
        assert_close(success_rate::adop(&d), case["adop"].as_f64().unwrap(), 1e-9, name);
        let before = success_rate::bootstrapped(&d).success;
        assert_close(before, case["ib_before_order_n_to_1"].as_f64().unwrap(), 1e-9, name);

        let (mut u, mut transform, mut inverse) = (q.clone(), vec![0; n * n], vec![0; n * n]);
        decorrelate(
            &mut MatMut::square(&mut u, n).unwrap(),
            &mut d,
            &mut MatMut::square(&mut transform, n).unwrap(),
            &mut MatMut::square(&mut inverse, n).unwrap(),
        )
        .unwrap();
        // Z⁻¹ Z = I in integers, hence |det Z| = 1.
        for i in 0..n {
            for j in 0..n {
                let product: i64 = (0..n).map(|k| inverse[i * n + k] * transform[j * n + k]).sum();
                assert_eq!(product, i64::from(i == j), "{name}");
            }
        }
        // Zᵀ Q Z = U D Uᵀ, relative to the standard deviations.
        let zqz = |i: usize, j: usize| -> f64 {
            let row = |k: usize| (0..n).map(|l| q[k * n + l] * transform[j * n + l] as f64).sum::<f64>();
            (0..n).map(|k| transform[i * n + k] as f64 * row(k)).sum()
        };
        let udu = |i: usize, j: usize| -> f64 { (0..n).map(|k| u[i * n + k] * d[k] * u[j * n + k]).sum() };
        let scale = (0..n).map(|i| q[i * n + i]).fold(0.0, f64::max);
        for i in 0..n {
            for j in 0..n {
                assert!((zqz(i, j) - udu(i, j)).abs() < 1e-9 * scale.max(udu(i, i)), "{name}: ({i}, {j})");
            }
        }
        let after = success_rate::bootstrapped(&d).success;
        let oracle = case["ib_after_oracle"].as_f64().unwrap();
        assert!(after >= before - 1e-12, "{name}: success rate {before} fell to {after}");
        assert!(after >= 0.98 * oracle, "{name}: success rate {after}, oracle {oracle}");
        assert_close(success_rate::adop(&d), case["adop"].as_f64().unwrap(), 1e-9, name);
    }
}

#[test]
fn nearest_integers_are_found() {
    let Some(cases) = cases("vectors/milrkf/ils.json") else { return };
    let mut workspace = Workspace::<f64, 16>::new();
    for case in &cases {
        let name = case["name"].as_str().unwrap();
        let (a, q) = (vector(&case["a"]), matrix(&case["Q"]));
        let q = Mat::square(&q, a.len()).unwrap();
        let found = resolve(&a, q, &Config::default(), &mut workspace).unwrap();
        assert_eq!(found.method, Method::LeastSquares, "{name}");
        assert_eq!(found.best, integers(&case["best"]), "{name}");
        assert_eq!(found.second, integers(&case["second"]), "{name}");
        assert_close(found.best_norm, case["sqnorm_best"].as_f64().unwrap(), 1e-8, name);
        assert_close(found.second_norm, case["sqnorm_second"].as_f64().unwrap(), 1e-8, name);
    }
}

#[test]
fn published_cases_are_reproduced() {
    let Some(cases) = cases("data/lambda_vectors/vectors.json") else { return };
    let mut workspace = Workspace::<f64, 24>::new();
    for case in &cases {
        let name = case["name"].as_str().unwrap();
        let (a, q) = (vector(&case["a"]), matrix(&case["Q"]));
        let q = Mat::square(&q, a.len()).unwrap();
        let found = resolve(&a, q, &Config::default(), &mut workspace).unwrap();
        let verified = &case["verified"];
        let norms = vector(&verified["sqnorm"]);
        assert_eq!(found.best, integers(&verified["best"]), "{name}");
        assert_eq!(found.second, integers(&verified["second"]), "{name}");
        assert_close(found.best_norm / norms[0], 1.0, 1e-6, name);
        assert_close(found.second_norm / norms[1], 1.0, 1e-6, name);
    }
}

#[test]
fn bootstrapping_in_a_given_order() {
    let Some(cases) = cases("vectors/milrkf/bootstrap.json") else { return };
    for case in &cases {
        let name = case["name"].as_str().unwrap();
        let (a, q) = (vector(&case["a"]), matrix(&case["Q"]));
        let n = a.len();
        let order: Vec<usize> = integers(&case["order"]).iter().map(|&i| i as usize).collect();
        let (mut work, mut variances, mut residual, mut fixed) =
            (vec![0.0; n * n], vec![0.0; n], vec![0.0; n], vec![0; n]);
        let probability = bootstrap_ordered(
            &a,
            Mat::square(&q, n).unwrap(),
            &order,
            &mut MatMut::square(&mut work, n).unwrap(),
            &mut variances,
            &mut residual,
            &mut fixed,
        )
        .unwrap();
        let z = integers(&case["z"]);
        for (k, &index) in order.iter().enumerate() {
            assert_eq!(fixed[k], z[index], "{name}: ambiguity {index}");
        }
        for (got, expected) in variances.iter().zip(vector(&case["cond_var_in_order"])) {
            assert_close(got / expected, 1.0, 1e-9, name);
        }
        assert_close(probability.success, case["success_rate"].as_f64().unwrap(), 1e-9, name);
    }
}

#[test]
fn success_rates_and_bounds() {
    let Some(cases) = cases("vectors/milrkf/success_rates.json") else { return };
    let decorrelation = self::cases("vectors/milrkf/decorrelation.json").unwrap();
    for case in &cases {
        let name = case["name"].as_str().unwrap();
        let variances = vector(&case["cond_var"]);
        let n = variances.len();
        let q = matrix(&case["Q"]);
        let expected = |key: &str| case[key].as_f64().unwrap();
        let adop = success_rate::adop(&variances);
        assert_close(adop, expected("adop"), 1e-10, name);
        let rates = [
            ("ib", success_rate::bootstrapped(&variances)),
            ("ir_lower", success_rate::rounding_lower(Mat::square(&q, n).unwrap())),
            ("p_adop", success_rate::adop_upper(adop, n)),
            ("ils_upper", success_rate::ils_upper(adop, n)),
        ];
        for (key, rate) in rates {
            assert_close(rate.success, expected(key), 1e-10, &format!("{name}, {key}"));
            assert_close(rate.success + rate.failure, 1.0, 1e-13, &format!("{name}, {key}"));
        }
        let shortest = decorrelation.iter().find(|c| c["name"] == case["name"]).unwrap();
        let ball = success_rate::ball_lower(shortest["shortest_sqnorm"].as_f64().unwrap(), n);
        assert_close(ball.success, expected("ils_lower_ball"), 1e-10, name);
    }
}

/// The plain, Joseph, whitened sequential and block updates agree with 50-digit arithmetic. Tolerances as the file states
/// them: the stiff case loses digits in the plain forms only.
#[test]
fn kalman_updates() {
    let Some(cases) = cases("vectors/milrkf/kf_update.json") else { return };
    for case in &cases {
        let name = case["name"].as_str().unwrap();
        let (prior, jacobian) = (vector(&case["m"]), matrix(&case["J"]));
        let (y, predicted) = (vector(&case["y"]), vector(&case["m_y"]));
        let innovation: Vec<f64> = y.iter().zip(&predicted).map(|(y, p)| y - p).collect();
        let (n, m) = (prior.len(), innovation.len());
        let (mean_expected, covariance_expected) = (vector(&case["m_post"]), matrix(&case["P_post"]));
        let stiff = name.contains("stiff");
        let check = |mean: &[f64], p: &[f64], mean_tolerance: f64, tolerance: f64, form: &str| {
            for i in 0..n {
                let sigma = covariance_expected[i * n + i].sqrt();
                let error = (mean[i] - mean_expected[i]).abs() / sigma.max(mean_expected[i].abs());
                assert!(error < mean_tolerance, "{name}, {form}: mean {i} is off by {error:e}");
                for j in 0..n {
                    let scale = sigma * covariance_expected[j * n + j].sqrt();
                    let error = (p[i * n + j] - covariance_expected[i * n + j]).abs() / scale;
                    assert!(error < tolerance, "{name}, {form}: covariance ({i}, {j}) is off by {error:e}");
                    assert_eq!(p[i * n + j], p[j * n + i], "{name}, {form}: not symmetric");
                }
            }
        };
        let plain = if stiff { 1e-6 } else { 1e-10 };
        let joseph = if stiff { 1e-9 } else { 1e-10 };

        let (mut mean, mut p) = (prior.clone(), matrix(&case["P"]));
        let (mut r, mut z, mut work) = (matrix(&case["Reff"]), innovation.clone(), vec![0.0; m * n]);
        let h = Mat::new(&jacobian, m, n, n).unwrap();
        let update = update_block(
            &mut mean,
            &mut MatMut::square(&mut p, n).unwrap(),
            h,
            &mut z,
            &mut MatMut::square(&mut r, m).unwrap(),
            &mut MatMut::new(&mut work, m, n, n).unwrap(),
        )
        .unwrap();
        check(&mean, &p, plain, plain, "block");
        assert_close(update.normalized_innovation_squared, case["nis"].as_f64().unwrap(), 1e-9, name);
        assert_close(update.log_determinant, case["logdetS"].as_f64().unwrap(), 1e-10, name);

        for form in ["sequential", "sequential Joseph"] {
            let (mut mean, mut p) = (prior.clone(), matrix(&case["P"]));
            let (mut h, mut z, mut r) = (jacobian.clone(), innovation.clone(), matrix(&case["Reff"]));
            let mut h = MatMut::new(&mut h, m, n, n).unwrap();
            whiten(&mut h, &mut z, &mut MatMut::square(&mut r, m).unwrap()).unwrap();
            let (mut gain, mut work) = (vec![0.0; n], vec![0.0; n]);
            let mut nis = 0.0;
            for i in 0..m {
                let row = h.row(i);
                let moved: f64 = (0..n).map(|j| row[j] * (mean[j] - prior[j])).sum();
                let nu = z[i] - moved;
                let mut p = MatMut::square(&mut p, n).unwrap();
                let update = if form == "sequential" {
                    update_scalar(&mut mean, &mut p, Row::Dense(row), nu, 1.0, &mut gain)
                } else {
                    update_scalar_joseph(&mut mean, &mut p, Row::Dense(row), nu, 1.0, &mut gain, &mut work)
                };
                nis += update.unwrap().normalized_innovation.powi(2);
            }
            let tolerance = if form == "sequential" { plain } else { joseph };
            check(&mean, &p, tolerance, tolerance, form);
            assert_close(nis, case["nis"].as_f64().unwrap(), 1e-8, name);
        }
    }
}
