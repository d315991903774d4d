//! EM for PPP: general linear problems with dense Q and R of each epoch, and a small linearised PPP problem by scheme.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use crate::smooth::pass::{PassError, PassOptions, Passes};
use crate::smooth::ppp::answer::state;
use crate::smooth::ppp::learn::{self, Learning, likelihood};
use crate::smooth::ppp::model::PppModel;
use crate::smooth::ppp::noise::{Measurements, Process};
use crate::smooth::ppp::pools::Rule;
use crate::smooth::ppp::tape::{Arc, Epoch, Group, Kind, Row, Tape};
use crate::smooth::ppp::{Class, Options, Priors, Walk};
use nalgebra::Vector3;
use serde_json::{Value, json};
use surefix_core::filter::update::Form;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root.get("schemes").is_some() && root.get("Fdiag").is_some() && root.get("mask").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let root = Inputs(&source.root);
    let outcome = tape(root).and_then(|tape| {
        root.objects("schemes")?.into_iter().try_for_each(|scheme| run_scheme(&tape, root, scheme, report))
    });
    if let Err(error) = outcome {
        report.unreadable("file", error);
    }
}

/// A square or rectangular list of lists.
fn rows(root: Inputs, key: &str) -> Result<Vec<Vec<f64>>, CaseError> {
    let (_, columns, entries) = root.matrix(key)?;
    Ok(entries.chunks(columns.max(1)).map(<[f64]>::to_vec).collect())
}

/// The problem on a tape: an epoch without rows for x_0, then one for each epoch of the file, a second apart, so that
/// spectral densities are variances for each epoch. The file has states x, y, z, clock, bias, zenith delay, N_1 … N_s.
fn tape(root: Inputs) -> Result<Tape, CaseError> {
    let absurd = |what: &str| CaseError::Absurd(what.to_owned());
    let (y, el, r0) = (rows(root, "y")?, rows(root, "el")?, rows(root, "R0")?);
    let masks = root.0["mask"].as_array().ok_or_else(|| absurd("\"mask\" is not a list"))?;
    let matrices = root.0["H"].as_array().ok_or_else(|| absurd("\"H\" is not a list"))?;
    let signals = root.list("sig")?;
    let satellites = signals.iter().filter(|signal| **signal == 0.0).count();
    let constellation = Constellation::Gps;
    let satellite =
        |i: usize| SatelliteId::new(constellation, (i % satellites) as u8 + 1).unwrap_or_else(|| unreachable!());
    let group = |isb| Group { name: "G IF".into(), constellation, isb };
    let mut tape = Tape { groups: vec![group(None), group(Some(0))], ..Tape::default() };
    let last = y.len();
    tape.arcs =
        (0..satellites).map(|i| Arc { satellite: satellite(i), group: 0, first: 0, last, prior: 0.0 }).collect();
    let time = |k: usize| GpsTime::from_week_tow(2100, k as f64);
    let epoch = |k: usize, rows| Epoch { time: time(k), rows, clock: 0.0, position: Vector3::zeros() };
    tape.epochs.push(epoch(0, 0..0));
    for (k, values) in y.iter().enumerate() {
        let first = tape.rows.len();
        let h = Inputs(&matrices[k]);
        for (i, &value) in values.iter().enumerate() {
            if masks[k][i] == json!(false) {
                continue;
            }
            let row: Vec<f64> = serde_json::from_value(h.0[i].clone()).map_err(|error| absurd(&error.to_string()))?;
            tape.rows.push(Row {
                kind: Kind::ALL[usize::from(signals[i] != 0.0)],
                satellite: satellite(i),
                group: 0,
                arc: (i % satellites) as u32,
                elevation: el[k][i].to_radians(),
                direction: [row[0], row[1], row[2]],
                wet: row[5],
                gradients: [0.0; 2],
                ionosphere: 0.0,
                value,
                variance: r0[k][i],
                shape: 1.0,
            });
        }
        tape.epochs.push(epoch(k + 1, first..tape.rows.len()));
    }
    Ok(tape)
}

fn options(root: Inputs, scheme: Inputs) -> Result<Options, CaseError> {
    let opts = scheme.object("opts")?;
    let process = match opts.text("Q")? {
        "epoch" => Process::Epoch,
        "pooled" => Process::Pooled,
        "map" => Process::Map(4.0),
        other => return Err(CaseError::Absurd(format!("Q scheme \"{other}\""))),
    };
    let measurements = match opts.text("R")? {
        "epoch" => Measurements::Epoch,
        "type" => Measurements::Pooled(Rule::Type),
        "elev" => Measurements::Pooled(Rule::Elevation),
        "map" => Measurements::Map(6.0),
        "t" => Measurements::StudentT(5.0),
        other => return Err(CaseError::Absurd(format!("R scheme \"{other}\""))),
    };
    let (p0, q0) = (root.list("P0diag")?, rows(root, "Q0diag")?);
    let (sigma, walk) = (|i: usize| p0[i].sqrt(), |i: usize| q0[0][i].sqrt());
    let floors: [f64; 2] = opts.numbers("rfl")?;
    let at_rest = Options::at_rest();
    let priors = Priors {
        position: sigma(0),
        clock: sigma(3),
        bias: sigma(4),
        zenith: sigma(5),
        ambiguity: sigma(6),
        ..at_rest.priors
    };
    let mut walks = at_rest.walks;
    walks[Class::Motion as usize] = Walk { sigma: walk(0), learned: process };
    walks[Class::Zenith as usize] = Walk { sigma: walk(5), learned: process };
    walks[Class::Biases as usize].sigma = walk(4);
    let learning =
        Learning { mean: opts.0["mu0"] == json!(true), covariance: opts.0["P0"] == json!(true), ..Learning::default() };
    Ok(Options {
        priors,
        walks,
        measurements,
        minimum: 0,
        floors: floors.map(f64::sqrt),
        process_floor: opts.number("qfl")?,
        learning,
        form: Form::Array,
        ..at_rest
    })
}

/// States of the file in a smoothed state of the model.
fn vector(state: &crate::smooth::ppp::answer::State) -> Vec<f64> {
    let mut x: Vec<f64> = state.position.iter().copied().collect();
    x.push(state.clock.value);
    x.extend(state.biases.iter().map(|bias| bias.value));
    x.push(state.zenith.value);
    x.extend(state.ambiguities.iter().map(|(_, ambiguity)| ambiguity.value));
    x
}

fn run_scheme(tape: &Tape, root: Inputs, scheme: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let name = scheme.text("scheme")?;
    let absurd = |error: PassError| CaseError::Absurd(error.to_string());
    let mut model = PppModel::new(tape.clone(), options(root, scheme)?);
    let mut passes = Passes::new(PassOptions::default());
    for iteration in scheme.objects("iterations")? {
        let id = format!("{name}, iteration {}", iteration.integer("iteration")?);
        let fit = passes.forward(&model).map_err(absurd)?;
        // The file says 1e-6 on ℓ, of its size where that is above 1.
        let ell = iteration.number("ell")?;
        report.compare("ell", &id, &json!(likelihood(&fit)), &json!(ell), Some(1e-6 * ell.abs().max(1.0)));
        let mut relative = |check: &str, computed: f64, expected: f64| {
            report.compare(check, &id, &json!(computed / expected), &json!(1.0), Some(1e-7));
        };
        each_row(tape, root, |i, k, column| {
            relative("R", model.noise.row(i), rows_at(iteration, "R", k, column));
        })?;
        for k in 0..tape.epochs.len() - 1 {
            for (column, (class, axis)) in
                [(Class::Motion, 0), (Class::Motion, 1), (Class::Motion, 2), (Class::Zenith, 0)].into_iter().enumerate()
            {
                relative("Q", model.noise.process(class, axis, k).1, rows_at(iteration, "Qdiag", k, column));
            }
        }
        let expectation = learn::expect(&model, &mut passes).map_err(absurd)?;
        let last = tape.epochs.len() - 1;
        let mut states = vec![Vec::new(); last + 1];
        let mut filtered = Vec::new();
        let mut variances = states.clone();
        passes
            .backward(&model, |epoch| {
                states[epoch.k] = vector(&state(&model, epoch.k, epoch.smoothed));
                variances[epoch.k] = (0..epoch.smoothed.dim()).map(|i| epoch.smoothed.covariance(i, i)).collect();
                if epoch.k == last {
                    filtered = vector(&state(&model, epoch.k, epoch.filtered));
                }
            })
            .map_err(absurd)?;
        let mut absolute = |check: &str, computed: &[f64], expected: &[f64]| {
            report.compare(check, &id, &json!(computed), &json!(expected), Some(1e-6));
        };
        absolute("x_filt_N", &filtered, &iteration.list("x_filt_N")?);
        absolute("x_smooth_N", &states[last], &iteration.list("x_smooth_N")?);
        absolute("x_smooth_0", &states[0], &iteration.list("x_smooth_0")?);
        if iteration.0.get("x_smooth").is_some() {
            for (k, expected) in rows(iteration, "x_smooth")?.iter().enumerate() {
                absolute("x_smooth", &states[k], expected);
            }
            let mut relative = |check: &str, computed: f64, expected: f64| {
                report.compare(check, &id, &json!(computed / expected), &json!(1.0), Some(1e-7));
            };
            for (k, expected) in rows(iteration, "P_smooth_diag")?.iter().enumerate() {
                variances[k].iter().zip(expected).for_each(|(&p, &expected)| relative("P_smooth", p, expected));
            }
            each_row(tape, root, |i, k, column| {
                relative("B", expectation.squares[i], rows_at(iteration, "B", k, column));
            })?;
        }
        learn::maximize(&mut model, &expectation);
    }
    Ok(())
}

/// An entry of a matrix; NaN where it is none.
fn rows_at(root: Inputs, key: &str, row: usize, column: usize) -> f64 {
    root.0[key][row][column].as_f64().unwrap_or(f64::NAN)
}

/// Index in the tape, epoch and column in the file of each measurement.
fn each_row(tape: &Tape, root: Inputs, mut each: impl FnMut(usize, usize, usize)) -> Result<(), CaseError> {
    let columns = root.list("sig")?.len();
    for (k, epoch) in tape.epochs.iter().skip(1).enumerate() {
        let present = (0..columns).filter(|&column| root.0["mask"][k][column] == json!(true));
        epoch.rows.clone().zip(present).for_each(|(i, column)| each(i, k, column));
    }
    Ok(())
}
