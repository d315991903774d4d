//! Moments of y = g(z) + C x + e with a function whose curvature shows: ranges to anchors, a ratio and a product.

use super::{CaseError, Inputs, Report, Source, note, root};
use nalgebra::{DMatrix, DVector, Vector3};
use serde_json::Value;
use surefix_core::filter::linearize::{Rule, Work, linearize};
use surefix_core::linalg::{Mat, MatMut};
use surefix_core::model::partially_linear::Nonlinear;

/// z: position and a speed.
const INPUTS: usize = 4;

/// The rules of the file.
const RULES: [(&str, Rule); 5] = [
    ("E", Rule::Taylor),
    ("UT", Rule::Unscented { alpha: 1.0, beta: 2.0, kappa: -1.0 }),
    ("UT_k0", Rule::Unscented { alpha: 1.0, beta: 2.0, kappa: 0.0 }),
    ("SR", Rule::Cubature),
    ("GaussHermite15_truth", Rule::GaussHermite { order: 15 }),
];

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("anchors").is_some() && root.get("expect").is_some()
}

/// Runs all its rules.
pub fn run(source: &Source, report: &mut Report) {
    let outcome = check(root(source), report);
    note("moments", outcome, report);
}

/// Four ranges, z₃ (z₂ − 40)/|z − anchor₀| and z₀ z₃.
struct Anchors(Vec<Vector3<f64>>);

impl Anchors {
    fn line(&self, z: &[f64], anchor: usize) -> (Vector3<f64>, f64) {
        let line = Vector3::new(z[0], z[1], z[2]) - self.0[anchor];
        (line, line.norm())
    }
}

impl Nonlinear for Anchors {
    fn inputs(&self) -> usize {
        INPUTS
    }

    fn outputs(&self) -> usize {
        self.0.len() + 2
    }

    fn evaluate(&self, z: &[f64], values: &mut [f64]) {
        let n = self.0.len();
        for (anchor, value) in values[..n].iter_mut().enumerate() {
            *value = self.line(z, anchor).1;
        }
        values[n] = z[3] * (z[2] - 40.0) / self.line(z, 0).1;
        values[n + 1] = z[0] * z[3];
    }

    fn gradient(&self, z: &[f64], row: usize, gradient: &mut [f64]) {
        let n = self.0.len();
        let unit = |anchor: usize| {
            let (line, range) = self.line(z, anchor);
            (line / range, range)
        };
        let slope = if row < n {
            let e = unit(row).0;
            [e.x, e.y, e.z, 0.0]
        } else if row == n {
            let (e, range) = unit(0);
            let ratio = (z[2] - 40.0) / range;
            let of_position = (Vector3::z() - e * ratio) * (z[3] / range);
            [of_position.x, of_position.y, of_position.z, ratio]
        } else {
            [z[3], 0.0, 0.0, z[0]]
        };
        gradient.copy_from_slice(&slope);
    }
}

fn check(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let function = Anchors(root.rows::<3>("anchors")?.into_iter().map(Vector3::from).collect());
    let (rows, n, c) = root.matrix("C")?;
    if rows != function.outputs() || n < INPUTS {
        return Err(CaseError::Absurd(format!("{rows} rows of {n} states do not fit the function")));
    }
    let c = DMatrix::from_row_slice(rows, n, &c);
    let m = DVector::from_vec(root.list_of("m", n)?);
    let p = DMatrix::from_row_slice(n, n, &root.square_of("P", n)?);
    let r = DMatrix::from_row_slice(rows, rows, &root.square_of("R", rows)?);
    let expected = root.object("expect")?;
    let tolerance = root.number("tol")?;
    for (name, rule) in RULES {
        let expected = expected.object(name)?;
        let (g, slope, omega) = linear(rule, &function, &m, &p)?;
        let mut j = c.clone();
        for (k, slope) in slope.iter().enumerate() {
            j[(k / INPUTS, k % INPUTS)] += slope;
        }
        let mean = DVector::from_vec(g) + &c * &m;
        let cross = &p * j.transpose();
        let covariance = &j * &cross + &omega + &r;
        let mut compare = |check: &str, computed: &DMatrix<f64>, expected: DMatrix<f64>| {
            let deviation = (computed - &expected).amax() / expected.amax().max(1.0);
            super::super::integer::compare(report, check, name, deviation, 0.0, tolerance);
        };
        let dense = |key: &str| expected.matrix(key).map(|(rows, cols, e)| DMatrix::from_row_slice(rows, cols, &e));
        let column = DMatrix::from_column_slice(rows, 1, mean.as_slice());
        compare("moments.mean", &column, DMatrix::from_column_slice(rows, 1, &expected.list_of("m_y", rows)?));
        compare("moments.cross_covariance", &cross, dense("S_xy")?);
        compare("moments.covariance", &covariance, dense("S_yy")?);
        compare("moments.jacobian", &DMatrix::from_row_slice(rows, INPUTS, &slope), dense("Hz")?);
        compare("moments.omega", &omega, dense("Omega")?);
    }
    Ok(())
}

/// Mean, Jacobian by rows, and Ω of the nonlinear part.
type Linear = (Vec<f64>, Vec<f64>, DMatrix<f64>);

/// The nonlinear part by a rule.
fn linear(rule: Rule, function: &Anchors, m: &DVector<f64>, p: &DMatrix<f64>) -> Result<Linear, CaseError> {
    let rows = function.outputs();
    let zz: Vec<f64> = (0..INPUTS * INPUTS).map(|k| p[(k / INPUTS, k % INPUTS)]).collect();
    let (mut g, mut slope, mut omega) = (vec![0.0; rows], vec![0.0; rows * INPUTS], vec![0.0; rows * rows]);
    linearize(
        rule,
        function,
        &m.as_slice()[..INPUTS],
        Mat::square(&zz, INPUTS)?,
        &mut g,
        &mut MatMut::new(&mut slope, rows, INPUTS, INPUTS)?,
        &mut MatMut::square(&mut omega, rows)?,
        Work { values: &mut vec![0.0; rows], reference: &mut vec![0.0; rows], samples: &mut vec![0.0; 9 * rows] },
    )?;
    let omega = DMatrix::from_fn(rows, rows, |i, j| omega[i.max(j) * rows + i.min(j)]);
    Ok((g, slope, omega))
}
