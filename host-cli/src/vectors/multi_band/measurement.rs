//! Rows, noise, motion and slip detector of the multi-band models at a few states.

use super::super::integer::compare;
use super::{CaseError, Inputs, Report, Setting, Source, note, root};
use serde_json::{Value, json};
use surefix_core::filter::slip::jumped;
use surefix_core::model::multi_band::{Component, MotionParameters, MultiBandModel, Signal, ambiguity_innovation};
use surefix_core::model::partially_linear::Nonlinear;

/// ε of the detector `[cycles]`; the files use the decided one.
const THRESHOLD: f64 = 0.5;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("Qreal_diag").is_some() && root.get("sat_pos").is_some()
}

/// Runs all its cases.
pub fn run(source: &Source, report: &mut Report) {
    let outcome = check(root(source), report);
    note("measurement", outcome, report);
}

fn check(root: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let theta = root.list("theta")?;
    let setting = Setting::read(&root, theta.len() < Component::ALL.len())?;
    let tolerance = root.object("tol")?;
    let model = |k: usize| MultiBandModel {
        satellites: setting.satellites.get(k).map_or(&[], Vec::as_slice),
        base: setting.base,
        bands: setting.bands,
        variances: setting.variances,
        clock_rows: setting.clock_rows,
    };
    constants(&root, &model(0), report)?;
    matrices(&root, &model(0), tolerance.number("C")?, report)?;
    motion(&root, &model(0), &theta, report)?;
    for case in root.objects("cases")? {
        let k = usize::try_from(case.integer("k")?).unwrap_or(usize::MAX);
        functions(case, &model(k), &tolerance, report)?;
    }
    Ok(())
}

fn constants(root: &Inputs, model: &MultiBandModel, report: &mut Report) -> Result<(), CaseError> {
    for (computed, expected) in model.bands.wavelengths().into_iter().zip(root.numbers::<3>("lam")?) {
        compare(report, "multi_band.wavelength", "bands", computed, expected, 1e-15);
    }
    for (computed, key) in model.bands.alpha().into_iter().zip(["alpha12", "alpha13"]) {
        compare(report, "multi_band.alpha", key, computed, root.number(key)?, 1e-15);
    }
    Ok(())
}

/// Compares a sparse matrix, given entry by entry, with a dense one.
fn dense(
    root: &Inputs,
    key: &str,
    fill: impl FnOnce(&mut dyn FnMut(usize, usize, f64)),
    tolerance: f64,
    report: &mut Report,
) -> Result<(), CaseError> {
    let (rows, columns, expected) = root.matrix(key)?;
    let mut computed = vec![0.0; rows * columns];
    let mut outside = 0;
    fill(&mut |i, j, value| match computed.get_mut(i * columns + j).filter(|_| j < columns) {
        Some(entry) => *entry += value,
        None => outside += 1,
    });
    report.compare("multi_band.entries_outside", key, &json!(outside), &json!(0), Some(0.0));
    report.compare(&format!("multi_band.{key}"), key, &json!(computed), &json!(expected), Some(tolerance));
    Ok(())
}

fn matrices(root: &Inputs, model: &MultiBandModel, tolerance: f64, report: &mut Report) -> Result<(), CaseError> {
    let rows = model.rows();
    let c = |entry: &mut dyn FnMut(usize, usize, f64)| {
        (0..rows).for_each(|row| model.row(row, &mut |state, value| entry(row, state, value)));
    };
    dense(root, "C", c, tolerance, report)?;
    let r = |entry: &mut dyn FnMut(usize, usize, f64)| {
        (0..rows * rows).for_each(|k| entry(k / rows, k % rows, model.noise(k / rows, k % rows)));
    };
    dense(root, "R", r, tolerance, report)
}

fn motion(root: &Inputs, model: &MultiBandModel, theta: &[f64], report: &mut Report) -> Result<(), CaseError> {
    let interval = root.number("h")?;
    dense(root, "A", |entry| model.transition(interval, entry), 1e-14, report)?;
    let mut parameters = MotionParameters { interval, stay: 0.0, ..MotionParameters::default() };
    for (variance, theta) in parameters.variances.iter_mut().zip(theta) {
        *variance = 1.0 / theta;
    }
    let mut diagonal = vec![0.0; model.layout().states()];
    model.process_noise(&parameters, |_| false, &mut |block| {
        for (i, &state) in block.states.iter().take(block.dim).enumerate() {
            diagonal[state] += block.scale * block.shape[i][i];
        }
    });
    report.compare("multi_band.Q", "Q", &json!(diagonal), &root.0["Qreal_diag"], Some(1e-18));
    Ok(())
}

fn functions(case: Inputs, model: &MultiBandModel, tolerance: &Inputs, report: &mut Report) -> Result<(), CaseError> {
    let id = format!("k = {}", case.integer("k")?);
    let x = case.list_of("x", model.layout().states())?;
    let z = &x[..model.inputs()];
    let mut values = vec![0.0; model.outputs()];
    model.evaluate(z, &mut values);
    let signals = model.signal_rows();
    for (row, expected) in case.list_of("g", signals)?.into_iter().enumerate() {
        let deviation = model.nonlinear_part(row, &values) - expected;
        compare(report, "multi_band.g", &id, deviation, 0.0, tolerance.number("g")?);
    }
    for (row, expected) in case.list_of("h", model.rows())?.into_iter().enumerate() {
        let mut computed = model.nonlinear_part(row, &values);
        model.row(row, &mut |state, coefficient| computed += coefficient * x[state]);
        compare(report, "multi_band.h", &id, computed - expected, 0.0, tolerance.number("g")?);
    }
    let (rows, columns, slope) = case.matrix("dg_dz")?;
    let mut gradients = vec![0.0; values.len() * columns];
    for (row, gradient) in gradients.chunks_mut(columns).enumerate() {
        model.gradient(z, row, gradient);
    }
    for input in 0..columns {
        let column: Vec<f64> = gradients.iter().skip(input).step_by(columns).copied().collect();
        for row in 0..rows {
            let deviation = model.nonlinear_part(row, &column) - slope[row * columns + input];
            compare(report, "multi_band.dg_dz", &id, deviation, 0.0, tolerance.number("dg_dz")?);
        }
    }
    slips(case, &id, model, report)
}

fn slips(case: Inputs, id: &str, model: &MultiBandModel, report: &mut Report) -> Result<(), CaseError> {
    let innovation = case.list_of("innovation", model.rows())?;
    let differences = model.layout().differences();
    let expected = case.list_of("nbar_signed", 3 * differences)?;
    let flags = case.list_of("flags", 3 * differences)?;
    for i in 0..differences {
        let phase = |band: usize| innovation[(3 * band + Signal::Phase as usize) * differences + i];
        for (band, slip) in ambiguity_innovation(&model.bands, [0, 1, 2].map(phase)).into_iter().enumerate() {
            let at = band * differences + i;
            compare(report, "multi_band.slip", id, slip, expected[at], 1e-10);
            let flag = f64::from(u8::from(jumped(slip, THRESHOLD)));
            compare(report, "multi_band.flag", id, flag, flags[at], 0.0);
        }
    }
    Ok(())
}
