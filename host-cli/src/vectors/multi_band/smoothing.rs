//! The smoother with adaptive ambiguity priors (Greiff 2023, Algorithm 1) on recorded measurements: relaxed filter and
//! smoother, flags, likelihood, integers on either posterior, and the fixed filter and smoother.
//!
//! Tolerances of the files: means 1e-5 σ, variances 1e-7, flags and integers exact. Bootstrapped integers depend on the
//! decorrelation and are compared where they are those of integer least squares. The fixed passes take the integers of the
//! file.

use super::super::integer::compare;
use super::{CaseError, Inputs, Report, Setting, Source, note, root};
use crate::smooth::integers::{Fixer, IntegerOptions, Search, Source as Posterior};
use crate::smooth::model::{Density, Integer, Model};
use crate::smooth::multi_band::{MultiBand, Prior, Record, Settings};
use crate::smooth::pass::{PassError, PassOptions, Passes};
use serde_json::{Value, json};
use surefix_core::filter::linearize::Rule;
use surefix_core::model::multi_band::MotionParameters;

/// Of a mean, in standard deviations.
const MEAN: f64 = 1e-5;
/// Of a variance, relative.
const VARIANCE: f64 = 1e-7;

impl From<PassError> for CaseError {
    fn from(error: PassError) -> Self {
        Self::Absurd(error.to_string())
    }
}

/// Whether a file is of this kind.
pub fn recognises(root: &Value) -> bool {
    root["expect"].get("m_smooth").is_some() && root.get("rule").is_some()
}

/// Runs it.
pub fn run(source: &Source, report: &mut Report) {
    let outcome = check(source, report);
    note("smoothing", outcome, report);
}

/// A file beside that of the source.
pub(super) fn neighbour(source: &Source, name: &str) -> Result<Value, CaseError> {
    let absent = || CaseError::Absent { file: name.to_owned() };
    let bytes = std::fs::read(source.directory.as_ref().ok_or_else(absent)?.join(name)).map_err(|_| absent())?;
    serde_json::from_slice(&bytes).map_err(|_| absent())
}

/// The model of a file, with the paper's prior.
pub(super) fn model(inputs: &Inputs, rule: Rule) -> Result<MultiBand, CaseError> {
    let double = inputs.text("model")? == "DD";
    let setting = Setting::read(inputs, double)?;
    let mut motion = MotionParameters { interval: inputs.number("h")?, ..MotionParameters::default() };
    for (variance, theta) in motion.variances.iter_mut().zip(inputs.list("theta")?) {
        *variance = 1.0 / theta;
    }
    motion.stay = inputs.number("sigma_L")?.powi(2);
    motion.slip = inputs.number("sigma_H")?.powi(2);
    let settings = Settings {
        variances: setting.variances,
        clock_rows: setting.clock_rows,
        motion,
        rule,
        threshold: inputs.number("eps_amb")?,
        prior: Prior { ambiguity: 1.0, ..Prior::default() },
        first_epoch: !inputs.text("note")?.contains("WITHOUT processing y_0"),
        ..Settings::recommended(setting.bands, setting.base)
    };
    let absurd = |error: &dyn std::fmt::Display| CaseError::Absurd(error.to_string());
    let (epochs, columns, y) = inputs.matrix("y")?;
    let mut records = Vec::with_capacity(epochs);
    for (satellites, y) in setting.satellites.into_iter().zip(y.chunks(columns)) {
        let record = Record::from_rows(&settings, satellites, y);
        records.push(record.ok_or_else(|| absurd(&"measurements that are not those of the model"))?);
    }
    MultiBand::new(settings, records).map_err(|error| absurd(&error))
}

fn rule(name: &str) -> Result<Rule, CaseError> {
    match name {
        "E" => Ok(Rule::Taylor),
        "UT" => Ok(Rule::unscented(4)),
        "SR" => Ok(Rule::Cubature),
        other => Err(CaseError::Absurd(format!("no rule {other}"))),
    }
}

/// Integers as the files name them.
const INTEGERS: [(&str, Posterior, Search); 4] = [
    ("n_boot_filter", Posterior::Filter, Search::Bootstrapping),
    ("n_ils_filter", Posterior::Filter, Search::LeastSquares),
    ("n_boot_smooth", Posterior::Smoother, Search::Bootstrapping),
    ("n_ils_smooth", Posterior::Smoother, Search::LeastSquares),
];

fn check(source: &Source, report: &mut Report) -> Result<(), CaseError> {
    let file = root(source);
    let expected = file.object("expect")?;
    let beside;
    let inputs = if file.0.get("y").is_some() {
        file
    } else {
        beside = neighbour(source, "05_rtsap_DD_E.json")?;
        Inputs(&beside)
    };
    let mut model = model(&inputs, rule(file.text("rule")?)?)?;
    let mut passes = Passes::new(PassOptions::default());
    let fit = passes.forward_detecting(&mut model)?;
    let nll = expected.number("nll")?;
    compare(report, "likelihood", "relaxed", fit.negative_log_likelihood(), nll, 1e-7);
    let flags: Vec<Vec<u8>> =
        model.flags().iter().map(|step| step.iter().map(|&flag| u8::from(flag)).collect()).collect();
    report.compare("flags", "relaxed", &json!(flags), &expected.0["flags"], Some(0.0));

    let mut fixers = INTEGERS.map(|(_, source, search)| Fixer::new(IntegerOptions::paper(source, search)));
    let (mut filtered, mut smoothed) = (vec![], vec![]);
    passes.backward(&model, |epoch| {
        fixers.iter_mut().for_each(|fixer| fixer.visit(&model, epoch));
        filtered.push(epoch.filtered.clone());
        smoothed.push(epoch.smoothed.clone());
    })?;
    densities(&expected, "filt", filtered, report)?;
    if let Ok(covariance) = expected.square("P_smooth_20") {
        let density = &smoothed[smoothed.len() - 1 - 20];
        for (k, expected) in covariance.1.into_iter().enumerate() {
            let (i, j) = (k / covariance.0, k % covariance.0);
            let scale = (density.covariance(i, i) * density.covariance(j, j)).sqrt();
            compare(
                report,
                "covariance.smooth",
                "k = 20",
                (density.covariance(i, j) - expected) / scale,
                0.0,
                VARIANCE,
            );
        }
    }
    densities(&expected, "smooth", smoothed, report)?;
    for ((name, ..), fixer) in INTEGERS.iter().zip(fixers) {
        let mut fixed = model.clone();
        fixer.apply(&mut fixed);
        integers(&expected, name, &fixed, report)?;
    }

    for (of_filter, integers) in [(true, "n_boot_filter"), (false, "n_boot_smooth")] {
        fixed_pass(&expected, &mut model, of_filter, integers, report)?;
    }
    Ok(())
}

/// Compares densities, the last epoch first, with `m_…` and, where the file has them, `Pdiag_…`.
fn densities(expected: &Inputs, name: &str, mut computed: Vec<Density>, report: &mut Report) -> Result<(), CaseError> {
    computed.reverse();
    let means = expected.matrix(&format!("m_{name}"))?;
    let variances = expected.matrix(&format!("Pdiag_{name}")).ok();
    for (k, density) in computed.iter().enumerate() {
        moments(name, k, density, &means.2[k * means.1..][..means.1], report);
        if let Some((_, n, variances)) = &variances {
            for (i, expected) in variances[k * n..][..*n].iter().enumerate() {
                let ratio = density.covariance(i, i) / expected;
                compare(report, &format!("variance.{name}"), &format!("k = {k}"), ratio, 1.0, VARIANCE);
            }
        }
    }
    Ok(())
}

/// Compares the first means of a density.
fn moments(name: &str, k: usize, density: &Density, means: &[f64], report: &mut Report) {
    for (i, (computed, expected)) in density.mean.iter().zip(means).enumerate() {
        let deviation = (computed - expected) / density.covariance(i, i).sqrt();
        compare(report, &format!("mean.{name}"), &format!("k = {k}"), deviation, 0.0, MEAN);
    }
}

fn integers(expected: &Inputs, name: &str, fixed: &MultiBand, report: &mut Report) -> Result<(), CaseError> {
    let Ok((epochs, n, wanted)) = expected.matrix(name) else { return Ok(()) };
    let least_squares = expected.matrix(&name.replace("boot", "ils")).ok();
    for k in 0..epochs {
        let wanted = &wanted[k * n..][..n];
        let unique = least_squares.as_ref().is_none_or(|(_, _, values)| values[k * n..][..n] == *wanted);
        if unique {
            report.compare(name, &format!("k = {k}"), &json!(fixed.fixed(k)), &json!(wanted), Some(0.0));
        }
    }
    Ok(())
}

/// The fixed pass with the integers of the file.
fn fixed_pass(
    expected: &Inputs,
    model: &mut MultiBand,
    of_filter: bool,
    integers: &str,
    report: &mut Report,
) -> Result<(), CaseError> {
    let Ok((_, n, values)) = expected.matrix(integers) else { return Ok(()) };
    model.release();
    let mut list: Vec<Integer> = vec![];
    for (k, values) in values.chunks(n).enumerate() {
        model.integers(k, &mut list);
        model.fix(k, &list, values);
    }
    model.settle();
    let mut passes = Passes::new(PassOptions::default());
    passes.forward(&*model)?;
    let (mut filtered, mut smoothed) = (vec![], vec![]);
    passes.backward(&*model, |epoch| {
        filtered.push(epoch.filtered.clone());
        smoothed.push(epoch.smoothed.clone());
    })?;
    // Files that fix on both posteriors give positions only.
    if let (true, Ok((_, n, means))) = (of_filter, expected.matrix("z_fixedF_filt")) {
        for (k, density) in filtered.iter().rev().enumerate() {
            moments("fixed_on_filter", k, density, &means[k * n..][..n], report);
        }
    }
    if let (false, Ok((_, n, means))) = (of_filter, expected.matrix("z_fixedS_smooth")) {
        for (k, density) in smoothed.iter().rev().enumerate() {
            moments("fixed_on_smoother", k, density, &means[k * n..][..n], report);
        }
    }
    if !of_filter && expected.matrix("m_fixed_smooth").is_ok() {
        if expected.matrix("m_fixed_filt").is_ok() {
            densities(expected, "fixed_filt", filtered, report)?;
        }
        densities(expected, "fixed_smooth", smoothed, report)?;
    }
    Ok(())
}
