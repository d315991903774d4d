//! Kalman updates: prior, Jacobian and noise in, posterior of 50-digit arithmetic out. Every form of the update is run.

use super::inputs::{CaseError, Inputs};
use super::integer::{compare, first_case_has, run_cases};
use super::{Report, Source};
use serde_json::{Value, json};
use surefix_core::filter::update::{Form, Gauge, buffer_len, update};
use surefix_core::linalg::{Mat, MatMut};

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    first_case_has(root, "Reff")
}

/// Runs all its cases.
pub fn run(source: &Source, report: &mut Report) {
    run_cases(source, report, run_case);
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
    gauge: Gauge<f64>,
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
    for (form, name) in [(Form::Sequential, "sequential"), (Form::Joseph, "joseph"), (Form::Array, "array")] {
        // As the file states: a prior far wider than the noise costs the plain form its digits.
        let tolerance = match (stiff, form) {
            (false, _) => 1e-10,
            (true, Form::Sequential) => 1e-6,
            (true, _) => 1e-9,
        };
        let posterior = solve(&problem, form)?;
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
        let (computed, expected) = (posterior.gauge.normalized_innovation_squared, case.number("nis")?);
        compare(report, &format!("{name}.innovation_squared"), id, computed, expected, 1e-8);
        let (computed, expected) = (posterior.gauge.log_determinant, case.number("logdetS")?);
        compare(report, &format!("{name}.log_determinant"), id, computed, expected, 1e-10);
    }
    Ok(())
}

fn solve(problem: &Problem, form: Form) -> Result<Posterior, CaseError> {
    let (n, m) = (problem.mean.len(), problem.innovation.len());
    let (mut mean, mut covariance) = (problem.mean.clone(), problem.covariance.clone());
    let (mut noise, mut innovation) = (problem.noise.clone(), problem.innovation.clone());
    let gauge = update(
        form,
        &mut mean,
        &mut MatMut::square(&mut covariance, n)?,
        &Mat::new(&problem.jacobian, m, n, n)?,
        &mut innovation,
        &mut MatMut::square(&mut noise, m)?,
        &mut vec![0.0; buffer_len(m, n)],
    )
    .map_err(|error| CaseError::Absurd(error.to_string()))?;
    Ok(Posterior { mean, covariance, gauge })
}
