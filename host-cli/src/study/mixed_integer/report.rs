//! The study as tables for people.

use super::super::statistics::Estimate;
use super::Study;
use super::acceptance::BANDS;
use super::detector_curve::{Curve, SIGMA_PROJECTION, SIGMA_WEIGHTED};
use super::outcome::Outcome;
use super::section::{Part, Reference, Section, nominal};
use std::fmt;
use surefix_core::filter::slip;

impl fmt::Display for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} runs a row, seed {}, the first {} epochs of a run left out; ± is one standard error",
            self.settings.runs,
            self.settings.seed,
            nominal().scenario.transient
        )?;
        for (section, outcomes) in &self.sections {
            if section.part == Part::Acceptance {
                acceptance(f, section, outcomes)?;
            }
            table(f, section, outcomes)?;
        }
        if let Some([projection, weighted]) = &self.curves {
            curve(f, "paper's", projection, SIGMA_PROJECTION)?;
            curve(f, "weighted", weighted, SIGMA_WEIGHTED)?;
        }
        if let Some((section, _)) = self.sections.iter().find(|(section, _)| section.part == Part::Acceptance) {
            let (all, missed) = (section.rows.len() * BANDS.len(), self.missed());
            writeln!(f, "\nacceptance: {} of {all} numbers inside their bands", all - missed)?;
        }
        Ok(())
    }
}

/// Each number with its band.
fn acceptance(f: &mut fmt::Formatter<'_>, section: &Section, outcomes: &[Outcome]) -> fmt::Result {
    write!(f, "\n{:<22} {:>13} ", "acceptance", "band")?;
    section.rows.iter().try_for_each(|row| write!(f, "{:^22}", row.label))?;
    writeln!(f)?;
    for band in &BANDS {
        let name = match band.unit {
            "" => band.quantity.to_owned(),
            unit => format!("{} [{unit}]", band.quantity),
        };
        write!(f, "{name:<22} {:>13} ", format!("{} - {}", band.low, band.high))?;
        for outcome in outcomes {
            let estimate = (band.of)(outcome);
            let verdict = if band.accepts(estimate.value) { "inside" } else { "OUTSIDE" };
            write!(f, "{:>14} {verdict:<7}", with_error(estimate, 4))?;
        }
        writeln!(f)?;
    }
    Ok(())
}

/// All numbers of all rows, and what an independent program found.
fn table(f: &mut fmt::Formatter<'_>, section: &Section, outcomes: &[Outcome]) -> fmt::Result {
    writeln!(f, "\n{}", section.title)?;
    writeln!(
        f,
        "{:<26} {:^13} {:^11} {:^14} {:>6} {:>6} {:>6} {:>5} {:>6} {:>7} {:>6}  reference: right, RMSE c, NEES c, NEES f",
        "", "all right", "RMSE c [cm]", "NEES c", "RMSE f", "NEES f", "max c", "in95%", "single", "P_FA", "P_D"
    )?;
    for (row, outcome) in section.rows.iter().zip(outcomes) {
        let (constrained, relaxed) = (&outcome.constrained, &outcome.relaxed);
        write!(
            f,
            "{:<26} {:>13} {:>11} {:>14} {:>6.2} {:>6.2} {:>6.1} {:>5.3} {:>6} {:>7.5} {:>6.4}  {}",
            row.label,
            with_error(outcome.right, 4),
            with_error(constrained.rmse.scale(100.0), 2),
            with_error(constrained.nees, 2),
            100.0 * relaxed.rmse.value,
            relaxed.nees.value,
            100.0 * constrained.largest,
            constrained.inside.value,
            optional(outcome.single.value, 2),
            outcome.false_alarms.value,
            outcome.detections.value,
            reference(&row.reference),
        )?;
        match outcome.refused {
            0 => writeln!(f)?,
            refused => writeln!(f, "  ({refused} epochs refused)")?,
        }
    }
    Ok(())
}

/// Sampled and analytic probabilities of one detector.
fn curve(f: &mut fmt::Formatter<'_>, name: &str, curve: &Curve, sigma: f64) -> fmt::Result {
    writeln!(f, "\n{name} detector, open loop, b = 0.02: σ {} cycles ({sigma} published)", with_error(curve.sigma, 4))?;
    writeln!(
        f,
        "{:<6} {:^15} {:>9}  {:^13} {:>8}  {:^13}  {:^13}",
        "d", "P_FA", "2Q(d/σ)", "P_D, 1 cycle", "analytic", "P_D, 2 cycles", "P_D, any size"
    )?;
    for point in &curve.points {
        let [one, two, any] = point.detections.map(|estimate| with_error(estimate, 4));
        writeln!(
            f,
            "{:<6} {:>15} {:>9.5}  {one:>13} {:>8.4}  {two:>13}  {any:>13}",
            point.threshold,
            with_error(point.false_alarms, 5),
            slip::false_alarm_rate(point.threshold, sigma),
            slip::detection_rate(point.threshold, 1.0, sigma),
        )?;
    }
    Ok(())
}

fn with_error(estimate: Estimate, digits: usize) -> String {
    let Estimate { value, standard_error } = estimate;
    let digits = if value.abs() < 1000.0 { digits } else { 0 };
    match (value.is_finite(), standard_error.is_finite()) {
        (false, _) => "-".to_owned(),
        (true, false) => format!("{value:.digits$}"),
        (true, true) => format!("{value:.digits$}±{standard_error:.digits$}"),
    }
}

fn optional(value: f64, digits: usize) -> String {
    if value.is_finite() { format!("{value:.digits$}") } else { "-".to_owned() }
}

fn reference(reference: &Reference) -> String {
    let Reference { right, rmse, nees, relaxed_nees } = *reference;
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    format!(
        "{:>16} {:>7} {:>7} {:>7}",
        or_dash(right.map(|right| format!("{right:.4}"))),
        or_dash(rmse.map(|rmse| format!("{:.2}", 100.0 * rmse))),
        or_dash(nees.map(|nees| format!("{nees:.2}"))),
        or_dash(relaxed_nees.map(|nees| format!("{nees:.1}")))
    )
}
