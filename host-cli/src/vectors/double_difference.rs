//! Sixty epochs of the double-difference filter of Wang et al. (2022), on the inputs of the file `run60_inputs.json` beside.
//! β follows the success rates of the file, as it asks for: they depend on how ambiguities are decorrelated. The file
//! of inputs itself has the truth: the plain filter must find its integers.

use super::inputs::{CaseError, Inputs};
use super::{Report, Source};
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use surefix_core::filter::adaptive::forgetting::Forgetting;
use surefix_core::filter::double_difference::{Adaptation, DoubleDifference22, Options, Sight, WholeNoise};

/// The file with the inputs.
const INPUTS: &str = "run60_inputs.json";
/// Beside its tolerances the files ask for 2 % of a success rate, which depends on the reduction.
const SUCCESS_TOLERANCE: f64 = 0.02;

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root["HPL"].is_array() && root["epochs"][0]["xpred"].is_array()
}

/// The file of inputs.
pub mod inputs_alone {
    use super::*;

    /// Whether a file is it.
    pub fn recognises(root: &Value) -> bool {
        root["lam"].is_array() && root["epochs"][0]["N_true"].is_array()
    }

    /// Runs it: the plain filter, against the truth.
    pub fn run(source: &Source, report: &mut Report) {
        if let Err(error) = run_file(Inputs(&source.root), report) {
            report.unreadable("run", error);
        }
    }

    fn run_file(inputs: Inputs, report: &mut Report) -> Result<(), CaseError> {
        let mut filter = start(inputs, Options::PAPER)?;
        for (at, epoch) in inputs.objects("epochs")?.into_iter().enumerate() {
            let id = format!("epoch {at}");
            let answer = filter.step(1.0, &sights(epoch)?, None).map_err(failed)?;
            let truth = epoch.list("N_true")?;
            let wrong = filter.integers().filter(|&(index, value)| truth.get(index) != Some(&(value as f64))).count();
            report.compare("double_difference.wrong_integers", &id, &json!(wrong), &json!(0), None);
            // Three satellites on two bands at least.
            let enough = filter.integers().count() >= 6;
            report.compare("double_difference.fixed_ambiguities", &id, &json!(enough), &json!(true), None);
            // Within six standard deviations of each axis: exceeded once in 5e8.
            let r = Vector3::from(epoch.numbers::<3>("r_true")?);
            for axis in 0..3 {
                let ratio = (answer.position[axis] - r[axis]) / answer.covariance[(axis, axis)].sqrt();
                report.compare("double_difference.error/sigma", &id, &json!(ratio), &json!(0.0), Some(6.0));
            }
        }
        Ok(())
    }
}

fn failed(error: impl std::fmt::Display) -> CaseError {
    CaseError::Absurd(error.to_string())
}

/// A filter at the start of the file of inputs.
fn start(inputs: Inputs, options: Options) -> Result<Box<DoubleDifference22<f64>>, CaseError> {
    let mut filter = Box::new(DoubleDifference22::new(options));
    filter.start(&inputs.numbers::<6>("x0")?, &[25.0, 25.0, 25.0, 4.0, 4.0, 4.0]).map_err(failed)?;
    Ok(filter)
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let path = source.directory.as_ref().map(|directory| directory.join(INPUTS));
    let inputs = path.and_then(|path| std::fs::read(path).ok()).and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let Some(inputs): Option<Value> = inputs else {
        return report.skipped("double differences", format!("{INPUTS} is not beside it"));
    };
    if let Err(error) = run_file(Inputs(&source.root), Inputs(&inputs), report) {
        report.unreadable("run", error);
    }
}

/// The options that a file names.
fn options(root: Inputs) -> Result<Options, CaseError> {
    let named = root.object("opts")?;
    let text = |key: &str| named.0[key].as_str().unwrap_or("").to_owned();
    let adaptation = match (text("mode").as_str(), text("adapt").as_str()) {
        ("kf", _) => Adaptation::Off,
        (_, "scale") => Adaptation::Type,
        (_, "eig") => Adaptation::Literal,
        (mode, form) => return Err(CaseError::Absurd(format!("mode {mode}, form {form}"))),
    };
    let forgetting = match text("mode").as_str() {
        "iavakf" => Forgetting::SuccessRate { threshold: 0.95, b: 0.97, bounds: [0.0, 1.0] },
        _ => Forgetting::SageHusa { b: 0.97 },
    };
    Ok(Options { adaptation, forgetting, ..Options::PAPER })
}

/// The sights of an epoch: the reference has differences of zero, so that those of the file are what comes of it.
fn sights(epoch: Inputs) -> Result<Vec<Sight>, CaseError> {
    let ids: Vec<u8> = epoch.list("sats")?.into_iter().map(|id| id as u8).collect();
    let s = ids.len();
    let (y, positions, elevations) = (epoch.list_of("y", 4 * s)?, epoch.rows::<3>("s")?, epoch.list_of("el", s)?);
    let locks = epoch.0["newlock"].as_array().cloned().unwrap_or_default();
    let position = |id: u8| {
        let found = positions.get(usize::from(id)).copied().map(Vector3::from);
        found.ok_or_else(|| CaseError::Absurd(format!("satellite {id} has no position")))
    };
    let reference = epoch.integer("ref")? as u8;
    let own = Sight {
        id: reference,
        position: position(reference)?,
        sin_elevation: 1.0,
        code: [0.0; 2],
        phase: [0.0; 2],
        new_lock: false,
    };
    let mut sights = vec![own];
    for (i, &id) in ids.iter().enumerate() {
        let of = |kind: usize| y[kind * s + i];
        sights.push(Sight {
            id,
            position: position(id)?,
            sin_elevation: elevations[i].to_radians().sin(),
            code: [of(0), of(1)],
            phase: [of(2), of(3)],
            new_lock: locks.get(i).and_then(Value::as_bool).unwrap_or(true),
        });
    }
    Ok(sights)
}

fn run_file(root: Inputs, inputs: Inputs, report: &mut Report) -> Result<(), CaseError> {
    let options = options(root)?;
    let k = root.number("K")?;
    let mut filter = start(inputs, options)?;
    let mut whole = Box::new(WholeNoise::new());
    let expected = root.objects("epochs")?;
    let mut beta = options.first_beta;
    let levels = [root.list_of("HPL", expected.len())?, root.list_of("VPL", expected.len())?];
    for (at, (given, wanted)) in inputs.objects("epochs")?.into_iter().zip(&expected).enumerate() {
        let id = format!("epoch {at}");
        let with = (options.adaptation == Adaptation::Literal).then_some(&mut *whole);
        // The success rate between both passes is not in the file, but follows from its β: β' = β/(β + P_s).
        let next = wanted.0["beta"].as_f64();
        filter.assume_success_rate(next.map(|next| (beta * (1.0 / next - 1.0)).min(1.0)));
        beta = next.unwrap_or(beta);
        let answer = filter.step(1.0, &sights(given)?, with).map_err(failed)?;
        let n = filter.mean().len();
        let (x, variances) = (wanted.list_of("x", n)?, wanted.list_of("Pd", n)?);
        let mut near = |check: &str, computed: f64, expected: f64, tolerance: f64| {
            report.compare(check, &id, &json!(computed), &json!(expected), Some(tolerance));
        };
        for (i, (&x, &variance)) in x.iter().zip(&variances).enumerate() {
            near("double_difference.mean", filter.mean()[i], x, 1e-6 * variance.sqrt());
            let own = filter.covariance().get(i, i).unwrap_or(f64::NAN);
            near("double_difference.variance", own, variance, 1e-8 * variance);
        }
        for (row, noise) in wanted.list("Rd")?.into_iter().enumerate() {
            let with = (options.adaptation == Adaptation::Literal).then_some(&*whole);
            near("double_difference.noise", filter.noise_variance(row, with), noise, 1e-8 * noise);
        }
        near("double_difference.full_success_rate", answer.full_success, wanted.number("psfull")?, SUCCESS_TOLERANCE);
        if let Some(beta) = next {
            near("double_difference.beta", answer.beta.unwrap_or(f64::NAN), beta, 1e-12);
        }
        let found: BTreeMap<usize, i64> = filter.integers().collect();
        let indices = wanted.list("idx").unwrap_or_default();
        let values = wanted.list("z").unwrap_or_default();
        let known: BTreeMap<usize, i64> =
            indices.iter().zip(&values).map(|(&index, &value)| (index as usize, value as i64)).collect();
        report.compare("double_difference.integers", &id, &json!(found), &json!(known), None);
        let is_fixed = wanted.0["rfix"].is_array();
        report.compare("double_difference.is_fixed", &id, &json!(answer.conditional.is_some()), &json!(is_fixed), None);
        let Some((position, covariance)) = answer.conditional.filter(|_| is_fixed) else { continue };
        let fixed_variance = wanted.numbers::<3>("Pfixd")?;
        for (i, (expected, variance)) in wanted.numbers::<3>("rfix")?.into_iter().zip(fixed_variance).enumerate() {
            let mut near = |check: &str, computed: f64, expected: f64, tolerance: f64| {
                report.compare(check, &id, &json!(computed), &json!(expected), Some(tolerance));
            };
            near("double_difference.fixed", position[i], expected, 1e-6 * variance.sqrt());
            near("double_difference.fixed_variance", covariance[(i, i)], variance, 1e-7 * variance);
        }
        let computed = [k * (covariance[(0, 0)] + covariance[(1, 1)]).sqrt(), k * covariance[(2, 2)].sqrt()];
        for ((name, computed), expected) in ["HPL", "VPL"].into_iter().zip(computed).zip(&levels) {
            let expected = expected[at];
            report.compare(
                &format!("double_difference.{name}"),
                &id,
                &json!(computed),
                &json!(expected),
                Some(1e-7 * expected),
            );
        }
    }
    Ok(())
}
