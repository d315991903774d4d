//! Integer estimation: files of ambiguities with their covariances, from independent arithmetic of 50 digits or exact
//! rational search. Each kind of file is recognised by a field that only its cases have.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::integer::bootstrap::bootstrap_ordered;
use surefix_core::integer::decorrelate::decorrelate;
use surefix_core::integer::{Config, IntegerError, Workspace, resolve, success_rate};
use surefix_core::linalg::ldl::factor_ltdl;
use surefix_core::linalg::{LinalgError, Mat, MatMut};

/// Most ambiguities a case may have.
const CAPACITY: usize = 64;

impl From<IntegerError> for CaseError {
    fn from(error: IntegerError) -> Self {
        Self::Absurd(error.to_string())
    }
}

impl From<LinalgError> for CaseError {
    fn from(error: LinalgError) -> Self {
        Self::Absurd(error.to_string())
    }
}

/// Runs all cases of a file and notes those that cannot be run.
pub(super) fn run_cases(
    source: &Source,
    report: &mut Report,
    run: impl Fn(&str, Inputs, &mut Report) -> Result<(), CaseError>,
) {
    for (index, case) in source.root["cases"].as_array().map_or(&[][..], Vec::as_slice).iter().enumerate() {
        let id = case["name"].as_str().map_or_else(|| format!("case {index}"), str::to_owned);
        if let Err(error) = run(&id, Inputs(case), report) {
            report.unreadable(&id, error);
        }
    }
}

/// Whether the first case of a file has a field.
pub(super) fn first_case_has(root: &Value, field: &str) -> bool {
    root["cases"].as_array().and_then(|cases| cases.first()).is_some_and(|case| case.get(field).is_some())
}

/// Compares a number with a tolerance relative to it, absolute below 1.
pub(super) fn compare(report: &mut Report, check: &str, id: &str, computed: f64, expected: f64, tolerance: f64) {
    report.compare(check, id, &json!(computed), &json!(expected), Some(tolerance * expected.abs().max(1.0)));
}

/// A tolerance that the file states, else that of the files at hand.
fn stated(source: &Source, name: &str, otherwise: f64) -> f64 {
    source.root[name].as_f64().unwrap_or(otherwise)
}

/// Compares whether something holds.
fn holds(report: &mut Report, check: &str, id: &str, it_does: bool) {
    report.compare(check, id, &json!(it_does), &json!(true), None);
}

/// Decorrelation: any valid Z will do, so that only invariants are compared.
pub mod decorrelation {
    use super::*;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "ltdl_L")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        run_cases(source, report, run_case);
    }

    fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let (n, q) = case.square("Q")?;
        let (mut l, mut d) = (q.clone(), vec![0.0; n]);
        factor_ltdl(&mut MatMut::square(&mut l, n)?, &mut d)?;
        let expected_l = case.square_of("ltdl_L", n)?;
        for (i, expected) in case.list_of("ltdl_d", n)?.into_iter().enumerate() {
            compare(report, "ltdl.variances", id, d[i] / expected, 1.0, 1e-9);
            for j in 0..i {
                compare(report, "ltdl.factor", id, l[i * n + j], expected_l[i * n + j], 1e-9);
            }
        }
        let before = success_rate::bootstrapped(&d).success;
        compare(report, "success_rate.before", id, before, case.number("ib_before_order_n_to_1")?, 1e-9);

        let (mut u, mut transform, mut inverse) = (q.clone(), vec![0; n * n], vec![0; n * n]);
        decorrelate(
            &mut MatMut::square(&mut u, n)?,
            &mut d,
            &mut MatMut::square(&mut transform, n)?,
            &mut MatMut::square(&mut inverse, n)?,
        )?;
        compare(report, "adop", id, success_rate::adop(&d), case.number("adop")?, 1e-9);
        let after = success_rate::bootstrapped(&d).success;
        let oracle = case.number("ib_after_oracle")?;
        holds(report, "success_rate.not_lower", id, after >= before - 1e-12);
        holds(report, "success_rate.near_the_best_known", id, after >= 0.98 * oracle);

        let entries = || (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        // Z⁻¹ Z = I in integers, hence |det Z| = 1.
        let product = |i: usize, j: usize| -> i64 { (0..n).map(|k| inverse[i * n + k] * transform[j * n + k]).sum() };
        holds(report, "transform.unimodular", id, entries().all(|(i, j)| product(i, j) == i64::from(i == j)));
        // Zᵀ Q Z = U D Uᵀ, relative to the largest variance.
        let size = (0..n).map(|i| q[i * (n + 1)]).fold(0.0, f64::max);
        let zqz = |i: usize, j: usize| -> f64 {
            let qz = |k: usize| -> f64 { (0..n).map(|l| q[k * n + l] * transform[j * n + l] as f64).sum() };
            (0..n).map(|k| transform[i * n + k] as f64 * qz(k)).sum()
        };
        let udu = |i: usize, j: usize| -> f64 { (0..n).map(|k| u[i * n + k] * d[k] * u[j * n + k]).sum() };
        let worst = entries().map(|(i, j)| (zqz(i, j) - udu(i, j)).abs()).fold(0.0, f64::max);
        compare(report, "transform.congruent", id, worst / size, 0.0, 1e-9);
        Ok(())
    }
}

/// Integer least squares: the two nearest vectors and their squared norms.
pub mod least_squares {
    use super::*;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "sqnorm_best") || first_case_has(root, "verified")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        let tolerance = stated(source, "rel_tol", 1e-9);
        run_cases(source, report, |id, case, report| run_case(id, case, tolerance, report));
    }

    fn run_case(id: &str, case: Inputs, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
        let (a, (n, q)) = (case.list("a")?, case.square("Q")?);
        let mut workspace = Box::new(Workspace::<f64, CAPACITY>::new());
        let found = resolve(&a, Mat::square(&q, n)?, &Config::default(), &mut workspace)?;
        // A float of 1e7 cycles has lost digits of its decimal fraction, on which the expected norm was computed.
        let tolerance = tolerance + 10.0 * f64::EPSILON * a.iter().fold(0.0, |size: f64, a| size.max(a.abs()));
        // Published cases nest the result under "verified", with both norms in a list.
        // Their norms are printed with fewer digits.
        let (vectors, norms, tolerance) = match case.object("verified") {
            Ok(verified) => (verified, verified.list("sqnorm")?, 1e-6),
            Err(_) => (case, vec![case.number("sqnorm_best")?, case.number("sqnorm_second")?], tolerance),
        };
        report.compare("least_squares.best", id, &json!(found.best), &json!(vectors.list("best")?), Some(0.0));
        report.compare("least_squares.second", id, &json!(found.second), &json!(vectors.list("second")?), Some(0.0));
        let computed = [found.best_norm, found.second_norm];
        for (expected, (computed, check)) in
            norms.into_iter().zip(computed.into_iter().zip(["least_squares.best_norm", "least_squares.second_norm"]))
        {
            compare(report, check, id, computed, expected, tolerance);
        }
        Ok(())
    }
}

/// Float solutions of a smoother: the nearest integers, and those of bootstrapping where they are the same and have some
/// chance to be right, 1 %. (Where not, they depend on the decorrelation.)
pub mod smoothed {
    use super::*;
    use crate::smooth::integers::bootstrap_decorrelated;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "boot_sqnorm")
    }

    /// Runs it.
    pub fn run(source: &Source, report: &mut Report) {
        run_cases(source, report, run_case);
    }

    fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let (a, (n, mut q)) = (case.list("a")?, case.square("Q")?);
        let mut workspace = Box::new(Workspace::<f64, CAPACITY>::new());
        let found = resolve(&a, Mat::square(&q, n)?, &Config::default(), &mut workspace)?;
        let (nearest, bootstrapped) = (case.list("ils")?, case.list("boot")?);
        report.compare("nearest", id, &json!(found.best), &json!(nearest), Some(0.0));
        // The norm of the nearest integers of a itself: the search rounds a first and loses no digits, but a has.
        compare(report, "norm", id, found.best_norm, case.number("ils_sqnorm")?, 1e-6);
        let mut values = Vec::new();
        let rate = bootstrap_decorrelated(&a, &mut q, &mut values)?;
        let expected_rate = case.number("boot_success")?;
        if nearest == bootstrapped && expected_rate > 0.01 {
            report.compare("bootstrapped", id, &json!(values), &json!(bootstrapped), Some(0.0));
        }
        if expected_rate > 0.01 {
            holds(report, "success_rate.near", id, rate.success >= 0.98 * expected_rate);
        }
        Ok(())
    }
}

/// Bootstrapping the original ambiguities in a given order.
pub mod bootstrapping {
    use super::*;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "cond_var_in_order")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        run_cases(source, report, run_case);
    }

    fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let (a, (n, q)) = (case.list("a")?, case.square("Q")?);
        let order: Vec<usize> = case.list("order")?.into_iter().map(|index| index as usize).collect();
        let m = order.len();
        let (mut work, mut variances) = (vec![0.0; m * m], vec![0.0; m]);
        let (mut residual, mut fixed) = (vec![0.0; m], vec![0; m]);
        let rate = bootstrap_ordered(
            &a,
            Mat::square(&q, n)?,
            &order,
            &mut MatMut::square(&mut work, m)?,
            &mut variances,
            &mut residual,
            &mut fixed,
        )?;
        let expected = case.list("z")?;
        let in_order: Option<Vec<f64>> = order.iter().map(|&index| expected.get(index).copied()).collect();
        report.compare("bootstrap.integers", id, &json!(fixed), &json!(in_order), Some(0.0));
        for (computed, expected) in variances.iter().zip(case.list_of("cond_var_in_order", m)?) {
            compare(report, "bootstrap.variances", id, computed / expected, 1.0, 1e-9);
        }
        compare(report, "bootstrap.success_rate", id, rate.success, case.number("success_rate")?, 1e-9);
        Ok(())
    }
}

/// All bounds of the success rate, with simulated rates.
pub mod success_bounds {
    use super::*;
    use crate::ambiguity::monte_carlo::MonteCarlo;
    use surefix_core::linalg::eigen::eigenvalues;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "ils_slab_upper")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        let tolerance = stated(source, "abs_tol", 1e-11);
        run_cases(source, report, |id, case, report| run_case(id, case, tolerance, report));
    }

    fn run_case(id: &str, case: Inputs, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
        let (n, q) = case.square("Q")?;
        let (mut work, mut variances) = (q.clone(), vec![0.0; n]);
        let q = Mat::square(&q, n)?;
        factor_ltdl(&mut MatMut::square(&mut work, n)?, &mut variances)?;
        for (variance, expected) in variances.iter().zip(case.list_of("cond_sd", n)?) {
            compare(report, "conditional_sd", id, variance.sqrt(), expected, tolerance);
        }
        let adop = success_rate::adop(&variances);
        compare(report, "adop", id, adop, case.number("adop")?, tolerance);

        let (mut work, mut eigen) = (q_copy(q), vec![0.0; n]);
        eigenvalues(&mut MatMut::square(&mut work, n)?, &mut eigen)?;
        let largest = eigen.iter().copied().fold(0.0, f64::max);
        let smallest = eigen.iter().copied().fold(f64::INFINITY, f64::min);
        let mut workspace = Box::new(Workspace::<f64, CAPACITY>::new());
        let shortest = resolve(&vec![0.0; n], q, &Config::default(), &mut workspace)?.second_norm;
        compare(report, "shortest_norm", id, shortest, case.number("min_norm2")?, tolerance);
        let bootstrapped = success_rate::bootstrapped(&variances);
        let rates = [
            ("ib", bootstrapped, tolerance),
            ("ir_lower", success_rate::rounding_lower(q), tolerance),
            ("ir_upper", success_rate::rounding_upper(q), tolerance),
            ("ib_upper_adop", success_rate::adop_upper(adop, n), tolerance),
            ("ils_adop_chi2_upper", success_rate::ils_upper(adop, n), 10.0 * tolerance),
            ("ils_ball_lower", success_rate::ball_lower(shortest, n), 10.0 * tolerance),
            ("ils_lmax_lower", success_rate::eigenvalue_lower(largest, n), tolerance),
            ("ils_lmin_upper", success_rate::eigenvalue_upper(smallest, n), tolerance),
            ("ils_slab_upper", slabs(case, q)?, tolerance),
        ];
        for (name, rate, tolerance) in rates {
            compare(report, name, id, rate.success, case.number(name)?, tolerance);
            compare(report, "complement", id, rate.success + rate.failure, 1.0, 1e-13);
        }
        let failure = case.number("ib_fail")?;
        compare(report, "ib_fail", id, bootstrapped.failure / failure, 1.0, 1e-8);

        // What follows depends on Z, or on samples.
        let decorrelated = variances_after_decorrelation(q)?;
        let oracle = case.number("ib_z_oracle")?;
        compare(report, "ib_z", id, success_rate::bootstrapped(&decorrelated).success, oracle, 0.02);
        let tolerance = MC_TOLERANCE * (MC_SAMPLES / case.number("mc_samples")?).sqrt().max(1.0);
        let counts = MonteCarlo { samples: SAMPLES, ..MonteCarlo::default() }.run(q)?;
        compare(report, "mc_ils", id, counts.rate(counts.least_squares), case.number("mc_ils")?, tolerance);
        compare(report, "mc_ir", id, counts.rate(counts.rounding), case.number("mc_ir")?, tolerance);
        let simulated = counts.rate(counts.bootstrapping);
        compare(report, "mc_ib_z", id, simulated, case.number("mc_ib_z")?, 0.02 + tolerance);
        Ok(())
    }

    /// Samples that give a standard error of at most 0.0011, half of the file's own.
    const SAMPLES: u64 = 200_000;
    /// As documented with the files, for as many samples as follow.
    const MC_TOLERANCE: f64 = 0.008;
    /// Samples of the files at hand.
    const MC_SAMPLES: f64 = 60_000.0;

    fn q_copy(q: Mat<'_, f64>) -> Vec<f64> {
        (0..q.rows()).flat_map(|i| q.row(i)).copied().collect()
    }

    fn slabs(case: Inputs, q: Mat<'_, f64>) -> Result<success_rate::Probability, CaseError> {
        let (n, vectors) = case.square("slab_u")?;
        let vectors: Vec<i64> = vectors.into_iter().map(|u| u as i64).collect();
        let (mut factor, mut rows, mut gram) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * n]);
        Ok(success_rate::slab_upper(
            q,
            Mat::square(&vectors, n)?,
            &mut MatMut::square(&mut factor, n)?,
            &mut MatMut::square(&mut rows, n)?,
            &mut MatMut::square(&mut gram, n)?,
            &mut vec![0.0; n],
        )?)
    }

    fn variances_after_decorrelation(q: Mat<'_, f64>) -> Result<Vec<f64>, CaseError> {
        let mut workspace = Box::new(Workspace::<f64, CAPACITY>::new());
        Ok(resolve(&vec![0.0; q.rows()], q, &Config::default(), &mut workspace)?.variances.to_vec())
    }
}

/// Success rates and their bounds.
pub mod success_rates {
    use super::*;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "ils_lower_ball")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        let tolerance = stated(source, "abs_tol", 1e-10);
        run_cases(source, report, |id, case, report| run_case(id, case, tolerance, report));
    }

    fn run_case(id: &str, case: Inputs, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
        let (n, q) = case.square("Q")?;
        let variances = case.list("cond_var")?;
        let adop = success_rate::adop(&variances);
        // The shortest vector is the one second nearest to zero.
        let mut workspace = Box::new(Workspace::<f64, CAPACITY>::new());
        let shortest = resolve(&vec![0.0; n], Mat::square(&q, n)?, &Config::default(), &mut workspace)?.second_norm;
        let rates = [
            ("ib", success_rate::bootstrapped(&variances)),
            ("ir_lower", success_rate::rounding_lower(Mat::square(&q, n)?)),
            ("p_adop", success_rate::adop_upper(adop, n)),
            ("ils_upper", success_rate::ils_upper(adop, n)),
            ("ils_lower_ball", success_rate::ball_lower(shortest, n)),
        ];
        compare(report, "success_rate.adop", id, adop, case.number("adop")?, tolerance);
        for (name, rate) in rates {
            let check = format!("success_rate.{name}");
            compare(report, &check, id, rate.success, case.number(name)?, tolerance);
            compare(report, "success_rate.complement", id, rate.success + rate.failure, 1.0, 1e-13);
        }
        Ok(())
    }
}

/// Partial fixing by elevation, with and without help for the rest.
pub mod subsets {
    use super::*;
    use surefix_core::integer::subset::{Options, SubsetWorkspace, resolve_subset};

    /// As the file says: rates depend on the reduction, subsets where one is this close to P₀ are not compared.
    const RATES: f64 = 0.02;
    const UNDECIDED: f64 = 0.01;

    /// Whether a file is of this kind.
    pub fn recognises(root: &Value) -> bool {
        first_case_has(root, "subset_noassist")
    }

    /// Runs all its cases.
    pub fn run(source: &Source, report: &mut Report) {
        run_cases(source, report, run_case);
    }

    fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let (a, elevations, p0) = (case.list("a")?, case.list("el")?, case.number("P0")?);
        let (n, m) = (a.len(), elevations.len());
        let q = case.square_of("Q", n)?;
        let q = Mat::square(&q, n)?;
        // Bands one after the other, satellites in the same order in each.
        let of: Vec<u8> = (0..n).map(|i| (i % m) as u8).collect();
        let mut order: Vec<u8> = (0..m as u8).collect();
        order.sort_by(|&i, &j| elevations[usize::from(j)].total_cmp(&elevations[usize::from(i)]));
        let rates = case.list_of("top_k_rates_oracle", m)?;
        let decided = rates.iter().all(|rate| (rate - p0).abs() > UNDECIDED);
        let mut workspace = Box::new(SubsetWorkspace::<f64, CAPACITY>::new());
        for (assist, suffix) in [(false, "_noassist"), (true, "")] {
            // The file knows no least number of satellites: one of its cases fixes two.
            let options = Options { min_success: p0, min_satellites: 1, assist, ..Options::default() };
            let subset = resolve_subset(&a, q, &of, &order, &options, &mut workspace)?;
            let (indices, values, rate) = match &subset {
                // Before help the file lists the chosen ones in the order of a.
                Some(subset) => (subset.indices.to_vec(), subset.values.to_vec(), subset.success_rate.success),
                None => (Vec::new(), Vec::new(), 0.0),
            };
            let key = |name: &str| format!("{name}{suffix}");
            if decided {
                report.compare(&format!("subset{suffix}"), id, &json!(indices), &case.0[&key("subset")], Some(0.0));
                report.compare(&format!("integers{suffix}"), id, &json!(values), &case.0[&key("z")], Some(0.0));
                report.compare(&format!("rate{suffix}"), id, &json!(rate), &case.0[&key("P")], Some(RATES));
            }
            if let Some(subset) = &subset {
                let full = subset.full_success_rate.success;
                report.compare("rate_of_all", id, &json!(full), &case.0["P_full"], Some(RATES));
                if assist {
                    compare(report, "ratio", id, subset.ratio, case.number("ratio")?, 1e-6);
                }
            }
        }
        Ok(())
    }
}
