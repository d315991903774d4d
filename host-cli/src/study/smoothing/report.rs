//! The study as tables for people.

use super::super::statistics::Estimate;
use super::adaptation::{CaseOutcome, Reading};
use super::outcome::Outcome;
use super::section::{Part, Reference, independent, paper};
use super::trial::{Posterior, Scheme};
use super::{Adaptation, Row, Study, Table};
use std::fmt;

impl fmt::Display for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let settings = &self.settings;
        writeln!(
            f,
            "{} runs a row, epochs 0 to {}, seed {}; ± is one standard error; S is at K/2, window K/2 ± K/10",
            settings.runs, settings.last, settings.seed
        )?;
        self.tables.iter().try_for_each(|table| table_2(f, table))?;
        if let Some(adaptation) = &self.adaptation {
            figure_3(f, adaptation)?;
        }
        let lines = self.acceptance();
        if !lines.is_empty() {
            let width = lines.iter().map(|line| line.quantity.len()).max().unwrap_or(0);
            writeln!(f, "\n{:<width$} {:>20} {:>17}", "acceptance", "band", "")?;
            for line in &lines {
                let band = format!("{:.4} - {:.4}", line.low, line.high);
                let band = if line.high < 1e-4 { format!("<= {:.0e}", line.high) } else { band };
                let value = match line.high < 1e-4 {
                    true => format!("{:.1e}", line.value.value),
                    false => with_error(line.value, 4),
                };
                writeln!(f, "{:<width$} {band:>20} {value:>17} {}", line.quantity, line.verdict().name())?;
            }
            writeln!(
                f,
                "acceptance: {} of {} numbers not outside their bands",
                lines.len() - self.missed(),
                lines.len()
            )?;
        }
        Ok(())
    }
}

/// The paper's columns, first its rows, then all sources of integers with both estimates.
fn table_2(f: &mut fmt::Formatter<'_>, table: &Table) -> fmt::Result {
    writeln!(f, "\n{}", table.part.title())?;
    writeln!(
        f,
        "{:<6} {:<8} {:<8} {:<9} {:^15} {:^15} {:^15} {:>7} {:^13} {:^14} {:>6}   {}: TA-RMSE  S-RMSE  S-RAPC  TA-IFA   CT [s]",
        "model",
        "integers",
        "fixed",
        "scheme",
        "TA-RMSE [m]",
        "S-RMSE [m]",
        "S-RMSE, window",
        "S-RAPC",
        "RMSE/RAPC",
        "TA-IFA [%]",
        "CT [s]",
        if compares_with_paper(table.part) { "paper" } else { "independent" }
    )?;
    let rows = table.rows.iter();
    if compares_with_paper(table.part) {
        for row in rows.clone() {
            for source in Posterior::ALL {
                line(f, row, source, source, Some(paper(row.differences, source, row.scheme)))?;
            }
        }
        writeln!(f, "all four combinations; beside them what an independent program found, S-RMSE over the window")?;
    }
    for row in rows.clone().filter(|row| row.scheme == Scheme::Erts) {
        for (source, estimate) in Posterior::ALL.into_iter().flat_map(|s| Posterior::ALL.map(|e| (s, e))) {
            line(f, row, source, estimate, independent(table.part, row.differences, source, estimate))?;
        }
    }
    for row in rows.filter(|row| row.scheme != Scheme::Erts) {
        let (model, scheme) = (row.differences.name(), row.scheme.name());
        writeln!(f, "{model} {scheme}: fixed positions within {:.1e} m of those of ERTS", row.difference)?;
    }
    Ok(())
}

/// Whether the table has the 12 rows of the paper.
fn compares_with_paper(part: Part) -> bool {
    part.schemes().len() == Scheme::ALL.len()
}

fn line(
    f: &mut fmt::Formatter<'_>,
    row: &Row,
    source: Posterior,
    estimate: Posterior,
    reference: Option<Reference>,
) -> fmt::Result {
    let Outcome { mean_rmse, middle_rmse, window_rmse, middle_rapc, ratio, right, seconds, .. } =
        row.outcome(source, estimate);
    write!(
        f,
        "{:<6} {:<8} {:<8} {:<9} {:>15} {:>15} {:>15} {middle_rapc:>7.5} {:>13} {:>14} {seconds:>6.3}",
        row.differences.name(),
        source.name(),
        estimate.name(),
        row.scheme.name(),
        with_error(*mean_rmse, 4),
        with_error(*middle_rmse, 4),
        with_error(*window_rmse, 4),
        with_error(*ratio, 3),
        with_error(*right, 3),
    )?;
    match reference {
        Some(Reference { mean_rmse, rmse, rapc, right, seconds }) => {
            write!(f, "   {mean_rmse:>13.4} {rmse:>8.5} {rapc:>8.5} {right:>7.3}")?;
            if seconds.is_finite() { writeln!(f, " {seconds:>7.3}") } else { writeln!(f) }
        }
        None => writeln!(f),
    }
}

fn figure_3(f: &mut fmt::Formatter<'_>, adaptation: &Adaptation) -> fmt::Result {
    writeln!(f, "\n{}, {} runs", Part::Adaptation.title(), adaptation.runs.len())?;
    writeln!(
        f,
        "{:<9} {:<24} {:^15} {:>8} {:^13} {:^14} {:>6} {:>11}   independent: RMSE  RAPC  ratio",
        "reading", "case", "RMSE [m]", "RAPC [m]", "RMSE/RAPC", "TA-IFA [%]", "flags", "-ln L"
    )?;
    let mut line = |reading: &str, name: &str, case: &CaseOutcome, independent: Option<[f64; 3]>| {
        let independent = independent.map(|[rmse, rapc, ratio]| format!("   {rmse:>17.4} {rapc:.4}  {ratio:.3}"));
        writeln!(
            f,
            "{reading:<9} {name:<24} {:>15} {:>8.4} {:>13} {:>14} {:>6.0} {:>11.0}{}",
            with_error(case.rmse, 4),
            case.rapc,
            with_error(case.ratio, 3),
            with_error(case.right, 3),
            case.flags,
            case.negative_log_likelihood,
            independent.unwrap_or_default()
        )
    };
    // Ten runs, σ_L = 0.01, prior 1 cycle.
    let independent =
        [[[0.0422, 0.0467, 0.905], [0.0362, 0.0356, 1.018]], [[0.0455, 0.0275, 1.653], [0.0364, 0.0352, 1.034]]];
    for reading in Reading::ALL {
        let [start, learned, recommended] = &adaptation.cases[reading as usize];
        let [of_start, of_learned] = independent[reading as usize];
        line(reading.name(), "(A) RTSAP, wrong noise", start, Some(of_start))?;
        line(reading.name(), "(B) APP", learned, Some(of_learned))?;
        line(reading.name(), "(D) APP, fixed integers", recommended, None)?;
    }
    line("-", "(C) RTSAP, true noise", &adaptation.truth, Some([0.0361, 0.0359, 1.006]))?;
    for reading in Reading::ALL {
        let [start, learned, recommended] = &adaptation.sigma_factors[reading as usize];
        let list = |factors: &[f64]| factors.iter().map(|factor| format!("{factor:.2}")).collect::<Vec<_>>().join(", ");
        writeln!(
            f,
            "{}: sigma_x, y, z, I, T, t off by factors of {} at the start, {} after (B), {} after (D)",
            reading.name(),
            list(start),
            list(learned),
            list(recommended)
        )?;
        let runs = adaptation.runs.iter().map(|run| &run.learning[reading as usize]);
        let steps = |series: fn(&super::Learning) -> &[f64]| {
            let rising = runs.clone().flat_map(move |run| series(run).windows(2).map(|pair| pair[1] > pair[0] + 1e-6));
            (rising.clone().filter(|&rises| rises).count(), rising.count())
        };
        let (objective, likelihood) = (steps(|run| &run.objective), steps(|run| &run.negative_log_likelihood));
        writeln!(
            f,
            "{}: Q rises in {} of {} steps, -ln L in {} of {}",
            reading.name(),
            objective.0,
            objective.1,
            likelihood.0,
            likelihood.1
        )?;
    }
    Ok(())
}

fn with_error(estimate: Estimate, digits: usize) -> String {
    let Estimate { value, standard_error } = estimate;
    match (value.is_finite(), standard_error.is_finite()) {
        (false, _) => "-".to_owned(),
        (true, false) => format!("{value:.digits$}"),
        (true, true) => format!("{value:.digits$}±{standard_error:.digits$}"),
    }
}
