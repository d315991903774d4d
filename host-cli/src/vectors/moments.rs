//! Linearisation: point sets, and the moments of y = h(u) + L w + e for a generic function and for double differences.

use super::inputs::{CaseError, Inputs};
use super::integer::compare;
use super::{Report, Source, rule};
use nalgebra::{DMatrix, Vector3};
use serde_json::Value;
use surefix_core::filter::linearize::{LinearizeError, Rule, Work, linearize};
use surefix_core::linalg::{Mat, MatMut};
use surefix_core::model::partially_linear::Nonlinear;
use surefix_core::model::virtual_bias::{VirtualBiasModel, VirtualBiasParameters};

/// The generic function of the files, as they write it.
const GENERIC: &str = "h(u)=[sin(u0)*u1, exp(0.3*u0), sqrt((u0-3)^2+(u1+1)^2), u0^3]";

impl From<LinearizeError> for CaseError {
    fn from(error: LinearizeError) -> Self {
        Self::Absurd(error.to_string())
    }
}

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("point_sets").is_some() && root.get("generic").is_some()
}

/// Runs all its parts.
pub fn run(source: &Source, report: &mut Report) {
    let root = Inputs(&source.root);
    let note = |part: &str, outcome: Result<(), CaseError>, report: &mut Report| {
        if let Err(error) = outcome {
            report.unreadable(part, error);
        }
    };
    for set in root.objects("point_sets").unwrap_or_default() {
        let outcome = point_set(set, report);
        note("point set", outcome, report);
    }
    let outcome = root.object("generic").and_then(|case| generic(case, report));
    note("generic", outcome, report);
    for case in root.objects("gnss").unwrap_or_default() {
        let outcome = gnss(case, report);
        note("gnss", outcome, report);
    }
}

fn point_set(set: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let (count, d, expected) = set.matrix("points")?;
    let (wm, wc) = (set.list_of("wm", count)?, set.list_of("wc", count)?);
    let id = format!("{} in {d}", set.0["rule"]);
    let mut points = rule::read(&set.0["rule"])?.points(d)?;
    compare(report, "points.count", &id, points.count() as f64, count as f64, 0.0);
    let mut xi = vec![0.0; d];
    for i in 0..count {
        let Some(weights) = points.next(&mut xi) else { break };
        for (computed, expected) in xi.iter().zip(&expected[i * d..]) {
            compare(report, "points.coordinates", &id, *computed, *expected, 1e-11);
        }
        compare(report, "points.mean_weights", &id, weights.mean, wm[i], 1e-11);
        compare(report, "points.covariance_weights", &id, weights.covariance, wc[i], 1e-11);
    }
    Ok(())
}

/// [`GENERIC`].
struct Generic;

impl Nonlinear for Generic {
    fn inputs(&self) -> usize {
        2
    }
    fn outputs(&self) -> usize {
        4
    }
    fn evaluate(&self, u: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&[u[0].sin() * u[1], (0.3 * u[0]).exp(), (u[0] - 3.0).hypot(u[1] + 1.0), u[0].powi(3)]);
    }
    fn gradient(&self, u: &[f64], row: usize, gradient: &mut [f64]) {
        let range = (u[0] - 3.0).hypot(u[1] + 1.0);
        gradient.copy_from_slice(&match row {
            0 => [u[0].cos() * u[1], u[0].sin()],
            1 => [0.3 * (0.3 * u[0]).exp(), 0.0],
            2 => [(u[0] - 3.0) / range, (u[1] + 1.0) / range],
            _ => [3.0 * u[0] * u[0], 0.0],
        });
    }
}

/// All moments, dense.
struct Moments {
    mean: Vec<f64>,
    jacobian: DMatrix<f64>,
    omega: DMatrix<f64>,
    cross: DMatrix<f64>,
    covariance: DMatrix<f64>,
}

/// The moments of y = h(u) + L w + e, u being the first states.
fn moments(
    rule: Rule,
    function: &impl Nonlinear,
    mean: &[f64],
    s: &DMatrix<f64>,
    l: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<Moments, CaseError> {
    let (d, p) = (function.inputs(), function.outputs());
    let uu: Vec<f64> = (0..d * d).map(|k| s[(k / d, k % d)]).collect();
    let (mut prediction, mut slope, mut noise) = (vec![0.0; p], vec![0.0; p * d], vec![0.0; p * p]);
    linearize(
        rule,
        function,
        &mean[..d],
        Mat::square(&uu, d)?,
        &mut prediction,
        &mut MatMut::new(&mut slope, p, d, d)?,
        &mut MatMut::square(&mut noise, p)?,
        Work { values: &mut vec![0.0; p], reference: &mut vec![0.0; p], samples: &mut vec![0.0; 7 * p] },
    )?;
    let rows = r.nrows();
    // Rows beyond those of the function are linear.
    let jacobian = DMatrix::from_fn(rows, mean.len(), |i, j| match (i < p, j < d) {
        (true, true) => slope[i * d + j],
        (false, true) => 0.0,
        (_, false) => l[(i, j - d)],
    });
    let omega = DMatrix::from_fn(rows, rows, |i, j| if i.max(j) < p { noise[i.max(j) * p + i.min(j)] } else { 0.0 });
    let mean = (0..rows)
        .map(|i| {
            (d..mean.len()).fold(prediction.get(i).copied().unwrap_or(0.0), |sum, j| sum + jacobian[(i, j)] * mean[j])
        })
        .collect();
    let cross = s * jacobian.transpose();
    let covariance = &jacobian * &cross + &omega + r;
    Ok(Moments { mean, jacobian, omega, cross, covariance })
}

fn dense(case: &Inputs, key: &str) -> Result<DMatrix<f64>, CaseError> {
    let (rows, cols, entries) = case.matrix(key)?;
    Ok(DMatrix::from_row_slice(rows, cols, &entries))
}

/// Compares all entries with a tolerance relative to the largest.
fn compare_all<'a>(
    report: &mut Report,
    check: &str,
    id: &str,
    computed: impl IntoIterator<Item = &'a f64>,
    expected: &[f64],
    tolerance: f64,
) {
    let size = expected.iter().fold(f64::MIN_POSITIVE, |size: f64, value| size.max(value.abs()));
    let computed: Vec<f64> = computed.into_iter().copied().collect();
    compare(report, &format!("{check}.entries"), id, computed.len() as f64, expected.len() as f64, 0.0);
    for (computed, expected) in computed.iter().zip(expected) {
        compare(report, check, id, (computed - expected) / size, 0.0, tolerance);
    }
}

fn generic(case: Inputs, report: &mut Report) -> Result<(), CaseError> {
    if case.text("h")? != GENERIC {
        return Err(CaseError::Absurd(format!("no function {}", case.text("h")?)));
    }
    let (mean, s) = (case.list("m")?, dense(&case, "S")?);
    let (l, r) = (dense(&case, "L")?, dense(&case, "R")?);
    for expected in case.objects("expected")? {
        let id = expected.0["rule"].to_string();
        let found = moments(rule::read(&expected.0["rule"])?, &Generic, &mean, &s, &l, &r)?;
        compare_all(report, "generic.mean", &id, &found.mean, &expected.list("m_y")?, 1e-11);
        for (key, check, computed) in [
            ("S_iy", "generic.cross_covariance", &found.cross),
            ("S_yy", "generic.covariance", &found.covariance),
            ("J", "generic.jacobian", &found.jacobian),
        ] {
            let computed: Vec<f64> = computed.transpose().as_slice().to_vec();
            compare_all(report, check, &id, &computed, &expected.matrix(key)?.2, 1e-11);
        }
        // Ω of a rule that sees no curvature is zero: its scale is that of the covariance.
        let (omega, scale) = (dense(&expected, "Omega")?, dense(&expected, "S_yy")?.amax());
        compare(report, "generic.omega", &id, (&found.omega - omega).amax() / scale, 0.0, 1e-11);
    }
    Ok(())
}

fn gnss(case: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let satellites: Vec<Vector3<f64>> = case.rows::<3>("sats_rel_base")?.into_iter().map(Vector3::from).collect();
    let parameters = VirtualBiasParameters { wavelength: case.number("lam")?, ..VirtualBiasParameters::default() };
    let model = VirtualBiasModel { satellites: &satellites, parameters };
    let (mean, s) = (case.list("m")?, dense(&case, "P")?);
    let (l, r) = (dense(&case, "L_joint")?, dense(&case, "R")?);
    let sigma = case.number("sigma_p")?;
    for expected in case.objects("expected")? {
        let id = format!("{} at {sigma} m", expected.0["rule"]);
        let found = moments(rule::read(&expected.0["rule"])?, &model, &mean, &s, &l, &r)?;
        for (computed, expected) in found.mean.iter().zip(expected.list_of("m_y", r.nrows())?) {
            compare(report, "gnss.mean", &id, computed - expected, 0.0, 1e-8);
        }
        let covariance: Vec<f64> = found.covariance.transpose().as_slice().to_vec();
        compare_all(report, "gnss.covariance", &id, &covariance, &expected.matrix("S_yy")?.2, 1e-9);
        let (rows, cols, slope) = expected.matrix("Hs")?;
        let computed: Vec<f64> = (0..rows * cols).map(|k| found.jacobian[(k / cols, k % cols)]).collect();
        compare_all(report, "gnss.jacobian", &id, &computed, &slope, 1e-9);
        let diagonal = expected.list("Omega_diag")?;
        let scale = covariance.iter().fold(0.0, |scale: f64, value| scale.max(value.abs()));
        for (i, expected) in diagonal.into_iter().enumerate() {
            let computed = if i < found.omega.nrows() { found.omega[(i, i)] } else { f64::NAN };
            compare(report, "gnss.omega", &id, (computed - expected) / scale, 0.0, 1e-9);
        }
        for (key, row) in [("S_iy_row0", 0), ("S_iy_row24", 24)] {
            if let (Ok(expected), true) = (expected.list(key), row < found.cross.nrows()) {
                let computed: Vec<f64> = found.cross.row(row).iter().copied().collect();
                compare_all(report, "gnss.cross_covariance", &id, &computed, &expected, 1e-9);
            }
        }
    }
    Ok(())
}
