//! Kalman updates: prior, Jacobian and noise in, posterior of 50-digit arithmetic out. Every form of the update is run:
//! as a block, and whitened and then row by row, plain and Joseph.

use super::inputs::{CaseError, Inputs};
use super::integer::{compare, first_case_has, run_cases};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::linalg::block::{update_block, whiten};
use surefix_core::linalg::sequential::{Row, update_scalar, update_scalar_joseph};
use surefix_core::linalg::{Mat, MatMut};

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    first_case_has(root, "Reff")
}

/// Runs all its cases.
pub fn run(source: &Source, report: &mut Report) {
    run_cases(source, report, run_case);
}

/// A way to do the same update.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Block,
    Sequential,
    Joseph,
}

/// What a case gives.
struct Problem {
    mean: Vec<f64>,
    covariance: Vec<f64>,
    jacobian: Vec<f64>,
    noise: Vec<f64>,
    innovation: Vec<f64>,
}

/// What an update makes of it.
struct Posterior {
    mean: Vec<f64>,
    covariance: Vec<f64>,
    normalized_innovation_squared: f64,
}

fn run_case(id: &str, case: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let (n, covariance) = case.square("P_post")?;
    let innovation: Vec<f64> =
        case.list("y")?.iter().zip(case.list("m_y")?).map(|(y, predicted)| y - predicted).collect();
    let problem = Problem {
        mean: case.list_of("m", n)?,
        covariance: case.square_of("P", n)?,
        jacobian: case.matrix("J")?.2,
        noise: case.square("Reff")?.1,
        innovation,
    };
    let mean = case.list_of("m_post", n)?;
    let stiff = id.contains("stiff");
    for (form, name) in [(Form::Block, "block"), (Form::Sequential, "sequential"), (Form::Joseph, "joseph")] {
        // As the file states: a prior far wider than the noise costs the plain forms their digits.
        let tolerance = match (stiff, form) {
            (false, _) => 1e-10,
            (true, Form::Joseph) => 1e-9,
            (true, _) => 1e-6,
        };
        let posterior = update(&problem, form)?;
        let sigma = |i: usize| covariance[i * (n + 1)].sqrt();
        for i in 0..n {
            let scale = sigma(i).max(mean[i].abs());
            compare(report, &format!("{name}.mean"), id, (posterior.mean[i] - mean[i]) / scale, 0.0, tolerance);
            for j in 0..n {
                let deviation = posterior.covariance[i * n + j] - covariance[i * n + j];
                compare(report, &format!("{name}.covariance"), id, deviation / (sigma(i) * sigma(j)), 0.0, tolerance);
            }
        }
        let symmetric = (0..n * n).all(|k| posterior.covariance[k] == posterior.covariance[k % n * n + k / n]);
        report.compare(&format!("{name}.symmetric"), id, &json!(symmetric), &json!(true), None);
        let (computed, expected) = (posterior.normalized_innovation_squared, case.number("nis")?);
        compare(report, &format!("{name}.innovation_squared"), id, computed, expected, 1e-8);
    }
    Ok(())
}

fn update(problem: &Problem, form: Form) -> Result<Posterior, CaseError> {
    let (n, m) = (problem.mean.len(), problem.innovation.len());
    let (mut mean, mut covariance) = (problem.mean.clone(), problem.covariance.clone());
    let (mut noise, mut innovation) = (problem.noise.clone(), problem.innovation.clone());
    let mut p = MatMut::square(&mut covariance, n)?;
    let mut r = MatMut::square(&mut noise, m)?;
    let normalized_innovation_squared = if form == Form::Block {
        let h = Mat::new(&problem.jacobian, m, n, n)?;
        let mut work = vec![0.0; m * n];
        let mut work = MatMut::new(&mut work, m, n, n)?;
        update_block(&mut mean, &mut p, h, &mut innovation, &mut r, &mut work)?.normalized_innovation_squared
    } else {
        let mut jacobian = problem.jacobian.clone();
        let mut h = MatMut::new(&mut jacobian, m, n, n)?;
        whiten(&mut h, &mut innovation, &mut r)?;
        let (mut gain, mut work) = (vec![0.0; n], vec![0.0; n]);
        let mut sum = 0.0;
        for (i, innovation) in innovation.iter().enumerate() {
            let row = h.row(i);
            let moved: f64 = (0..n).map(|j| row[j] * (mean[j] - problem.mean[j])).sum();
            let (row, nu) = (Row::Dense(row), innovation - moved);
            let found = if form == Form::Joseph {
                update_scalar_joseph(&mut mean, &mut p, row, nu, 1.0, &mut gain, &mut work)?
            } else {
                update_scalar(&mut mean, &mut p, row, nu, 1.0, &mut gain)?
            };
            sum += found.normalized_innovation * found.normalized_innovation;
        }
        sum
    };
    Ok(Posterior { mean, covariance, normalized_innovation_squared })
}
