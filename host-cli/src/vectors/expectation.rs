//! Steps of EM: the sums T and n of each parameter, the M-step θ = n/T, the likelihood, and the objective before and after.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use crate::smooth::dense::{Dense, Measurement, System};
use crate::smooth::model::{Density, Model, Parameter, Transition};
use crate::smooth::objective::{Expectation, Objective};
use crate::smooth::pass::{PassError, PassOptions, Passes};
use serde_json::{Value, json};

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("qn").is_some() && root.get("steps").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let root = Inputs(&source.root);
    if let Err(error) = small(root).and_then(|mut model| steps(&mut model, root, report)) {
        report.unreadable("file", error);
    }
}

/// x = (p; q, q̇; n): a random walk, a random walk in velocity, an ambiguity; θ of the first two.
fn small(root: Inputs) -> Result<Dense, CaseError> {
    let (n, a) = root.square("A")?;
    let (m, _, rows) = root.matrix("C")?;
    let (noise, h) = (root.square_of("R", m)?, root.number("h")?);
    let (epochs, _, y) = root.matrix("y")?;
    let prior = Density { mean: root.list_of("m0", n)?, covariance: root.square_of("P0", n)? };
    let mut step = Transition::default();
    step.reset(n);
    for row in a.chunks(n) {
        step.push(0.0, &row.iter().copied().enumerate().collect::<Vec<_>>());
    }
    step.noise(&[0], &[&[h]], 1.0, Some(0));
    step.noise(&[1, 2], &[&[h.powi(3) / 3.0, h * h / 2.0], &[h * h / 2.0, h]], 1.0, Some(1));
    step.noise(&[3], &[&[1.0]], root.number("qn")?, None);
    let measurement = |values: &[f64]| Measurement {
        values: values.to_vec(),
        rows: rows.clone(),
        noise: noise.clone(),
        parameter: Some(2),
    };
    let measurements = y.chunks(m).map(measurement).collect();
    let system = System { prior, steps: vec![step; epochs - 1], measurements, integers: Vec::new() };
    let parameter = |(name, learned): (&str, bool)| {
        let name = name.to_owned();
        Parameter { name, unit: "m", variance: 1.0, bounds: [f64::MIN_POSITIVE, f64::MAX], learned }
    };
    let parameters = [("walk", true), ("velocity", true), ("measurements", false)].map(parameter);
    Ok(Dense::new(system, parameters.into()))
}

/// Runs the steps of a file. Its θ are the inverses of the first variances of the model.
pub fn steps<M: Model>(model: &mut M, root: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let absurd = |error: PassError| CaseError::Absurd(error.to_string());
    let tolerance = root.number("tol")?;
    let mut compare = |check: &str, id: &str, computed: f64, expected: f64| {
        let tolerance = Some(tolerance * expected.abs().max(1.0));
        report.compare(check, id, &json!(computed), &json!(expected), tolerance);
    };
    let mut passes = Passes::new(PassOptions::default());
    for (i, step) in root.objects("steps")?.into_iter().enumerate() {
        let id = format!("step {}", i + 1);
        let mut variances: Vec<f64> = model.parameters().iter().map(|parameter| parameter.variance).collect();
        let set = |variances: &mut Vec<f64>, theta: &[f64]| {
            variances.iter_mut().zip(theta).for_each(|(variance, theta)| *variance = 1.0 / theta);
        };
        set(&mut variances, &step.list("theta")?);
        model.set_variances(&variances);
        let fit = passes.forward(model).map_err(absurd)?;
        let expectation = Expectation::gather(model, &mut passes).map_err(absurd)?;
        compare("likelihood", &id, fit.negative_log_likelihood(), step.number("nll")?);
        let before = expectation.value(&variances);
        let theta = step.list("theta_new")?;
        let (traces, counts) = (step.list("T")?, step.list("n")?);
        for (j, ((theta, trace), count)) in theta.iter().zip(traces).zip(counts).enumerate() {
            // A trace is as good as it is in proportion, whatever its size.
            compare("traces", &id, expectation.process.quadratic[j] / trace, 1.0);
            compare("counts", &id, expectation.process.count[j], count);
            let computed = expectation.process.variance(j).map_or(f64::NAN, |variance| 1.0 / variance);
            compare("theta", &id, computed / theta, 1.0);
        }
        set(&mut variances, &theta);
        for (name, objective) in [("Q_before", before), ("Q_after", expectation.value(&variances))] {
            for (part, computed, expected) in parts(&step, name, objective)? {
                compare(&format!("{name}.{part}"), &id, computed, expected);
            }
        }
    }
    if let (Ok(expected), Some(last)) = (root.number("nll_final"), root.objects("steps")?.last()) {
        let mut variances: Vec<f64> = model.parameters().iter().map(|parameter| parameter.variance).collect();
        variances.iter_mut().zip(last.list("theta_new")?).for_each(|(variance, theta)| *variance = 1.0 / theta);
        model.set_variances(&variances);
        compare("likelihood", "end", passes.forward(model).map_err(absurd)?.negative_log_likelihood(), expected);
    }
    Ok(())
}

/// Computed and expected parts of an objective: its total alone, or all of them.
fn parts(step: &Inputs, name: &str, objective: Objective) -> Result<Vec<(&'static str, f64, f64)>, CaseError> {
    let Ok(expected) = step.object(name) else { return Ok(vec![("total", objective.total(), step.number(name)?)]) };
    let parts = [
        ("dyn_real", objective.process),
        ("dyn_amb", objective.rest),
        ("prior", objective.prior),
        ("meas", objective.measurements),
        ("total", objective.total()),
    ];
    parts.into_iter().map(|(part, computed)| Ok((part, computed, expected.number(part)?))).collect()
}
