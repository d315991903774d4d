//! A linear time-varying system: filter, smoother, gains, lag-one covariances and likelihood, as the program's passes and the
//! core's steps compute them.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use crate::smooth::dense::{Dense, Measurement, System};
use crate::smooth::model::{Density, Model, Transition};
use crate::smooth::pass::{PassOptions, Passes};
use serde_json::{Value, json};
use surefix_core::linalg::{Mat, MatMut};
use surefix_core::smooth::{Moments, MomentsMut, SmoothError, predict, rts};

impl From<SmoothError> for CaseError {
    fn from(error: SmoothError) -> Self {
        Self::Absurd(error.to_string())
    }
}

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root["expect"].get("lag_one").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    if let Err(error) = run_file(Inputs(&source.root), report) {
        report.unreadable("file", error);
    }
}

/// Item k of a list of matrices or vectors, and all its numbers.
fn item(inputs: &Inputs, key: &str, k: usize) -> Result<Vec<f64>, CaseError> {
    fn flatten(value: &Value, numbers: &mut Vec<f64>) -> Option<()> {
        match value {
            Value::Array(items) => items.iter().try_for_each(|item| flatten(item, numbers)),
            number => {
                numbers.push(number.as_f64()?);
                Some(())
            }
        }
    }
    let mut numbers = Vec::new();
    let found = inputs.0.get(key).and_then(|list| list.get(k)).and_then(|item| flatten(item, &mut numbers));
    let absent = || CaseError::Input { key: format!("{key}[{k}]"), wanted: "numbers" };
    found.map(|()| numbers).ok_or_else(absent)
}

fn run_file(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let (n, covariance) = root.square("P0")?;
    let epochs = root.integer("K")? as usize + 1;
    let prior = Density { mean: root.list_of("m0", n)?, covariance };
    let mut system = System { prior, ..System::default() };
    for k in 0..epochs {
        let (values, rows, noise) = (item(&root, "y", k)?, item(&root, "C", k)?, item(&root, "R", k)?);
        system.measurements.push(Measurement { values, rows, noise, parameter: None });
        if k + 1 < epochs {
            let (a, q) = (item(&root, "A", k)?, item(&root, "Q", k)?);
            let mut step = Transition::default();
            step.reset(n);
            for row in a.chunks(n) {
                step.push(0.0, &row.iter().copied().enumerate().collect::<Vec<_>>());
            }
            step.dense_noise(&q);
            system.steps.push(step);
        }
    }
    let model = Dense::new(system, Vec::new());
    let mut passes = Passes::new(PassOptions::default());
    let absurd = |error: crate::smooth::pass::PassError| CaseError::Absurd(error.to_string());
    let fit = passes.forward(&model).map_err(absurd)?;
    let (mut filtered, mut smoothed) = (Vec::new(), Vec::new());
    let gather = |epoch: crate::smooth::pass::Epoch<'_>| {
        filtered.push(epoch.filtered.clone());
        smoothed.push(epoch.smoothed.clone());
    };
    passes.backward(&model, gather).map_err(absurd)?;
    filtered.reverse();
    smoothed.reverse();

    let expected = root.object("expect")?;
    let tolerance = root.number("tol")?;
    let mut compare = |check: &str, k: usize, computed: &[f64]| -> Result<(), CaseError> {
        let wanted = item(&expected, check, k)?;
        let size = wanted.iter().fold(f64::MIN_POSITIVE, |size: f64, x| size.max(x.abs()));
        report.compare(check, &format!("k = {k}"), &json!(computed), &json!(wanted), Some(tolerance * size));
        Ok(())
    };
    for (k, (filtered, smoothed)) in filtered.iter().zip(&smoothed).enumerate() {
        compare("m_filt", k, &filtered.mean)?;
        compare("P_filt", k, &full(filtered))?;
        compare("m_smooth", k, &smoothed.mean)?;
        compare("P_smooth", k, &full(smoothed))?;
    }
    let mut predicted = Density::default();
    model.prior(&mut predicted);
    compare("m_pred", 0, &predicted.mean)?;
    compare("P_pred", 0, &full(&predicted))?;
    let mut transition = Transition::default();
    let (mut work, mut buffer) = (vec![0.0; n * n], vec![0.0; rts::buffer_len(n, n)]);
    for k in 0..epochs - 1 {
        model.transition(k, &mut transition);
        let (step, filtered, next) = (transition.step(), moments(&filtered[k])?, moments(&smoothed[k + 1])?);
        let mut to = MomentsMut::packed(&mut predicted.mean, &mut predicted.covariance)?;
        predict::predict(&step, filtered, &mut to, &mut MatMut::square(&mut work, n)?)?;
        compare("m_pred", k + 1, &predicted.mean)?;
        compare("P_pred", k + 1, &full(&predicted))?;
        let mut to = MomentsMut::packed(&mut predicted.mean, &mut predicted.covariance)?;
        let (mut mean, mut covariance) = (vec![0.0; n], vec![0.0; n * n]);
        let mut smoothed = MomentsMut::packed(&mut mean, &mut covariance)?;
        let mut rts = rts::Work::new(&mut buffer, n, n)?;
        rts::smooth(&step, filtered, &mut to, next, &mut smoothed, &mut rts)?;
        compare("G", k, &transposed(rts.gain_transposed()))?;
        let mut lag_one = MatMut::square(&mut work, n)?;
        rts.lag_one(next.covariance, &mut lag_one)?;
        let lag_one: Vec<f64> = (0..n).flat_map(|i| lag_one.row(i).to_vec()).collect();
        compare("lag_one", k, &lag_one)?;
    }
    let nll = expected.number("nll")?;
    let computed = fit.negative_log_likelihood();
    report.compare("nll", "all", &json!(computed), &json!(nll), Some(tolerance * nll.abs()));
    Ok(())
}

fn moments(density: &Density) -> Result<Moments<'_, f64>, SmoothError> {
    Moments::packed(&density.mean, &density.covariance)
}

/// All of P, by rows.
fn full(density: &Density) -> Vec<f64> {
    let n = density.dim();
    (0..n * n).map(|index| density.covariance(index / n, index % n)).collect()
}

fn transposed(matrix: Mat<'_, f64>) -> Vec<f64> {
    let entry = |i: usize, j: usize| matrix.get(i, j).unwrap_or(f64::NAN);
    (0..matrix.cols()).flat_map(|i| (0..matrix.rows()).map(move |j| entry(j, i))).collect()
}
