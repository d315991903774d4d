//! The choices that a mixed-integer filter leaves open, on a real drive: slip detector × kind of fixed solution ×
//! linearisation, each through the whole engine, all judged against one truth.
//!
//! The counterpart on simulated data, where every slip is known, is [`super::mixed_integer`].

use crate::compare::{Options, Report, Truth, compare};
use crate::process::run::Engine;
use crate::process::stream::Input;
use crate::read::solution::Track;
use rayon::prelude::*;
use std::fmt;
use surefix_core::filter::linearize::Rule;
use surefix_core::filter::mixed_integer::{Detector, Output};
use surefix_core::gnss::solution::Solution;
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::config::Estimation;

const DETECTORS: [Detector; 3] = [Detector::Weighted, Detector::Projection, Detector::None];
const OUTPUTS: [Output; 2] = [Output::ConditionalFix, Output::DualDensity];
const RULES: [Rule; 2] = [Rule::Taylor, Rule::GaussHermite { order: 3 }];

/// One combination and what it reaches.
pub struct Row {
    /// The combination.
    pub estimation: Estimation,
    /// Its solution against the truth.
    pub report: Report,
}

/// The table.
pub struct Table(pub Vec<Row>);

/// Runs all combinations over the same inputs, `config` being the rest of the configuration, on all cores.
pub fn run(inputs: &[Input], config: &RtkConfig, truth: &Truth) -> Table {
    let combinations: Vec<Estimation> = DETECTORS
        .iter()
        .flat_map(|&detector| OUTPUTS.iter().map(move |&output| (detector, output)))
        .flat_map(|(detector, output)| RULES.iter().map(move |&rule| (detector, output, rule)))
        .map(|(detector, output, rule)| Estimation { detector, output, rule, ..config.estimation })
        .collect();
    let row = |estimation: Estimation| {
        let mut engine = Engine::new(RtkConfig { estimation, ..*config });
        let solutions: Vec<Solution> = inputs.iter().filter_map(|input| engine.feed(input)).collect();
        Row { estimation, report: compare(&Track::of(&solutions), truth, &Options::default()) }
    };
    Table(combinations.into_par_iter().map(row).collect())
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| {:10} | {:11} | {:14} | fix % | wrong % | rms H cm | rms 3D cm | error/σ e, n, u   | NEES (3) |",
            "detector", "fixed is", "linearisation"
        )?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        for Row { estimation, report } in &self.0 {
            let (detector, output, rule) = names(estimation);
            let [horizontal, three_d] =
                report.fixed.map_or([f64::NAN; 2], |errors| [100.0 * errors.rms_horizontal_m, 100.0 * errors.rms_3d_m]);
            write!(
                f,
                "| {detector:10} | {output:11} | {rule:14} | {:5.2} | {:7.2} | {horizontal:8.2} | {three_d:9.2} |",
                100.0 * report.fix_rate,
                100.0 * report.wrong_fix_rate,
            )?;
            match &report.fixed_normalized {
                Some(normalized) => writeln!(
                    f,
                    " {:4.2}, {:4.2}, {:4.2}  | {:8.2} |",
                    normalized.rms.east, normalized.rms.north, normalized.rms.up, normalized.nees_mean
                )?,
                None => writeln!(f, " {:17} | {:8} |", "", "")?,
            }
        }
        Ok(())
    }
}

/// Detector, output and rule in a word each.
fn names(estimation: &Estimation) -> (&'static str, &'static str, &'static str) {
    let detector = match estimation.detector {
        Detector::Weighted => "weighted",
        Detector::Projection => "projection",
        Detector::None => "none",
    };
    let output = match estimation.output {
        Output::ConditionalFix => "conditional",
        Output::DualDensity => "dual",
    };
    let rule = match estimation.rule {
        Rule::Taylor => "Taylor",
        Rule::GaussHermite { .. } => "Gauss-Hermite",
        Rule::Cubature => "cubature",
        Rule::Unscented { .. } => "unscented",
    };
    (detector, output, rule)
}
