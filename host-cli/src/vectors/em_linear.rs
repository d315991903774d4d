//! EM on a linear state-space model of dense Q and R: smoothed moments, lag-one covariances, C, B, ℓ and the next Q and R.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use crate::variance::linear::{Linear, Pooling};
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("schemes").is_some() && root.get("rel_tol").is_some() && root.get("F").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let root = Inputs(&source.root);
    let outcome = root.objects("schemes").and_then(|schemes| {
        let model = read(root)?;
        schemes.into_iter().try_for_each(|scheme| run_scheme(model.clone(), scheme, root.number("rel_tol")?, report))
    });
    if let Err(error) = outcome {
        report.unreadable("file", error);
    }
}

fn matrix(value: &Value) -> Option<DMatrix<f64>> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(value.clone()).ok()?;
    let columns = rows.first()?.len();
    Some(DMatrix::from_row_slice(rows.len(), columns, &rows.concat()))
}

fn matrices(root: Inputs, key: &str) -> Result<Vec<DMatrix<f64>>, CaseError> {
    let list = root.0.get(key).and_then(Value::as_array);
    let read = list.and_then(|list| list.iter().map(matrix).collect::<Option<Vec<_>>>());
    read.ok_or_else(|| CaseError::Input { key: key.to_owned(), wanted: "a list of matrices" })
}

fn read(root: Inputs) -> Result<Linear, CaseError> {
    let (n, covariance) = root.square("P0")?;
    let (_, m, y) = root.matrix("y")?;
    Ok(Linear {
        transitions: matrices(root, "F")?,
        designs: matrices(root, "H")?,
        process: matrices(root, "Q")?,
        noise: matrices(root, "R")?,
        mean: DVector::from_vec(root.list_of("mu0", n)?),
        covariance: DMatrix::from_row_slice(n, n, &covariance),
        values: y.chunks(m).map(DVector::from_row_slice).collect(),
    })
}

fn run_scheme(mut model: Linear, scheme: Inputs, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
    let name = scheme.text("scheme")?;
    let pooling = Pooling { pooled: name.starts_with("pooled"), diagonal: name.ends_with("diagR") };
    if pooling.pooled {
        // "initial 0.3 I and 0.5 I".
        model.process.iter_mut().for_each(|q| q.fill_with_identity());
        model.process.iter_mut().for_each(|q| *q *= 0.3);
        model.noise.iter_mut().for_each(|r| r.fill_with_identity());
        model.noise.iter_mut().for_each(|r| *r *= 0.5);
    } else if pooling.diagonal {
        model.noise.iter_mut().for_each(|r| *r = DMatrix::from_diagonal(&r.diagonal()));
    }
    for iteration in scheme.objects("iterations")? {
        let id = format!("{name}, iteration {}", iteration.integer("iteration")?);
        let passes = model.passes().ok_or_else(|| CaseError::Absurd("not positive definite".into()))?;
        let ell = iteration.number("ell")?;
        report.compare("ell", &id, &json!(passes.likelihood), &json!(ell), Some(tolerance * ell.abs()));
        // Entries of a matrix are as good as its largest.
        let mut compare = |check: &str, computed: &[DMatrix<f64>], expected: &[DMatrix<f64>]| {
            for (t, (computed, expected)) in computed.iter().zip(expected).enumerate() {
                let id = format!("{id}, epoch {t}");
                let deviation =
                    if computed.shape() == expected.shape() { (computed - expected).amax() } else { f64::NAN };
                report.compare(check, &id, &json!(deviation), &json!(0.0), Some(tolerance * expected.amax()));
            }
        };
        let columns = |list: &[DVector<f64>]| -> Vec<DMatrix<f64>> {
            list.iter().map(|x| DMatrix::from_row_slice(1, x.len(), x.as_slice())).collect()
        };
        let rows = |key: &str| -> Result<Vec<DMatrix<f64>>, CaseError> {
            let (_, n, entries) = iteration.matrix(key)?;
            Ok(entries.chunks(n).map(|row| DMatrix::from_row_slice(1, n, row)).collect())
        };
        let has = |key: &str| iteration.0.get(key).is_some();
        if has("x_filt") {
            compare("x_filt", &columns(&passes.filtered), &rows("x_filt")?);
            let last = passes.filtered_covariances.last().map_or(&[][..], std::slice::from_ref);
            let p = iteration.0.get("P_filt_N").and_then(matrix).into_iter().collect::<Vec<_>>();
            compare("P_filt_N", last, &p);
        }
        if has("x_smooth") {
            compare("x_smooth", &columns(&passes.smoothed), &rows("x_smooth")?);
            compare("P_smooth", &passes.smoothed_covariances, &matrices(iteration, "P_smooth")?);
            compare("lag_one", &passes.lag_one, &matrices(iteration, "lag_one")?);
            compare("C", &passes.process, &matrices(iteration, "C")?);
            compare("B", &passes.noise, &matrices(iteration, "B")?);
        }
        model.maximize(&passes, pooling);
        if has("Q_next") {
            compare("Q_next", &model.process, &matrices(iteration, "Q_next")?);
            compare("R_next", &model.noise, &matrices(iteration, "R_next")?);
        }
        if has("mu0_next_optional") {
            compare(
                "mu0",
                &columns(&passes.smoothed[..1]),
                &[DMatrix::from_row_slice(
                    1,
                    model.mean.len(),
                    &iteration.list_of("mu0_next_optional", model.mean.len())?,
                )],
            );
            let p = iteration.0.get("P0_next_optional").and_then(matrix).into_iter().collect::<Vec<_>>();
            compare("P0", &passes.smoothed_covariances[..1], &p);
        }
    }
    Ok(())
}
