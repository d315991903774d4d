//! The study as tables for people.

use super::outcome::components;
use super::risk::{EPOCHS, LEVELS, RISKS, promised};
use super::scenario::PLACE;
use super::variant::PAPERS;
use super::{Study, Table};
use nalgebra::Vector3;
use std::fmt;
use surefix_core::gnss::geodesy::Geodetic;

/// Table 3 of the paper: mean and standard deviation of errors, ECEF `[m]`.
const TABLE_3: [([f64; 3], [f64; 3]); 3] = [
    ([1.17, 1.07, -0.51], [10.41, 10.73, 6.09]),
    ([-0.70, -0.82, 0.47], [5.83, 6.51, 4.21]),
    ([0.63, 0.75, -0.53], [5.72, 6.61, 3.72]),
];
/// Table 4 of the paper: epochs of 2164 with PE > PL, vertical and horizontal.
const TABLE_4: [[u32; 2]; 3] = [[40, 53], [3, 46], [0, 0]];

impl fmt::Display for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let settings = &self.settings;
        if !self.tables.is_empty() {
            writeln!(
                f,
                "{} runs of {} epochs for each filter and noise (two where R* is a whole matrix), seed {}",
                settings.seeds, settings.epochs, settings.seed
            )?;
        }
        self.tables.iter().try_for_each(|table| filters(f, table))?;
        self.tables.iter().try_for_each(|table| papers(f, table))?;
        if let Some(risk) = &self.risk {
            let epochs = risk.runs * EPOCHS;
            writeln!(
                f,
                "\nProtection levels at their risk: {epochs} epochs in {} runs, {:.2} % fixed, {:.1e} of these wrong",
                risk.runs,
                100.0 * risk.fixed,
                risk.wrong
            )?;
            writeln!(f, "{:<8} {:<30} {:>10} {:>11} {:>25}", "risk", "level", "promised", "PE > PL", "95 % interval")?;
            for (risk, rates) in RISKS.iter().zip(&risk.rates) {
                for (level, rate) in LEVELS.iter().zip(rates) {
                    let half = 1.96 * rate.standard_error;
                    let (low, high) = ((rate.value - half).max(0.0), rate.value + half);
                    writeln!(
                        f,
                        "{risk:<8.0e} {level:<30} {:>10.1e} {:>11.3e} {low:>12.3e} {high:>12.3e}",
                        promised(*risk),
                        rate.value
                    )?;
                }
            }
        }
        if let Some(bounds) = &self.bounds {
            writeln!(f, "\nFig. 4: success rates of {} ambiguities against the factor F", bounds.ambiguities)?;
            writeln!(f, "{}", super::bounds::COLUMNS.map(|name| format!("{name:>20}")).join(" "))?;
            for row in bounds.rows.iter().step_by(2) {
                writeln!(f, "{}", row.map(|value| format!("{value:>20.4}")).join(" "))?;
            }
        }
        let lines = self.acceptance();
        if !lines.is_empty() {
            let width = lines.iter().map(|line| line.quantity.len()).max().unwrap_or(0);
            writeln!(f, "\n{:<width$} {:>17} {:>19}", "acceptance", "band", "")?;
            for line in &lines {
                let band = format!("{:.2} - {:.2}", line.low, line.high);
                let value = format!("{:.3} ± {:.3}", line.value.value, line.value.standard_error);
                writeln!(f, "{:<width$} {band:>17} {value:>19} {}", line.quantity, line.verdict().name())?;
            }
            let inside = lines.len() - self.missed();
            writeln!(f, "acceptance: {inside} of {} numbers not outside their bands", lines.len())?;
        }
        Ok(())
    }
}

fn filters(f: &mut fmt::Formatter<'_>, table: &Table) -> fmt::Result {
    writeln!(f, "\nNoise: {}", table.noise.name())?;
    writeln!(
        f,
        "{:<24} {:>4} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9} {:>9} {:>7} {:>7} {:>7} {:>6}",
        "filter",
        "runs",
        "mean m",
        "std m",
        "rms m",
        "fixed %",
        "wrong %",
        "PE>PL H %",
        "PE>PL V %",
        "HPL m",
        "VPL m",
        "refused",
        "R* < 0"
    )?;
    for (variant, outcome) in &table.rows {
        let percent = |value: f64| 100.0 * value;
        writeln!(
            f,
            "{:<24} {:>4} {:>8.4} {:>8.4} {:>8.4} {:>8.2} {:>8.3} {:>9.3} {:>9.3} {:>7.3} {:>7.3} {:>7} {:>6}",
            variant.name,
            outcome.runs,
            outcome.mean,
            outcome.deviation,
            outcome.rms,
            percent(outcome.fixed.value),
            percent(outcome.wrong.value),
            percent(outcome.beyond[0].value),
            percent(outcome.beyond[1].value),
            outcome.levels[0],
            outcome.levels[1],
            outcome.refused,
            outcome.indefinite,
        )?;
    }
    Ok(())
}

/// Tables 3 and 4 of one run, beside the paper's.
fn papers(f: &mut fmt::Formatter<'_>, table: &Table) -> fmt::Result {
    let place = Geodetic { latitude: PLACE[0], longitude: PLACE[1], height: 0.0 };
    writeln!(f, "\nTables 3 and 4 of the paper, first run, noise: {}", table.noise.name())?;
    writeln!(
        f,
        "{:<8} {:^26} {:^26} {:>6} {:>6}   paper: {:^20} {:^20} {:>4} {:>4}",
        "filter", "mean x, y, z m", "std x, y, z m", "V", "H", "mean", "std", "V", "H"
    )?;
    for ((name, of), ((mean, deviation), [vertical, horizontal])) in PAPERS.iter().zip(TABLE_3.iter().zip(TABLE_4)) {
        let Some(run) = table.first(of) else { continue };
        let mut turned = run.clone();
        let turn = |error: Vector3<f64>| place.enu_to_ecef(&error);
        turned.samples.iter_mut().for_each(|sample| sample.error = turn(sample.error));
        let (own_mean, own_deviation) = components(&turned);
        let beyond = |k: usize| run.samples.iter().filter(|sample| sample.beyond()[k]).count();
        let three = |v: [f64; 3], digits: usize| v.map(|x| format!("{x:>8.digits$}")).join(" ");
        writeln!(
            f,
            "{name:<8} {} {} {:>6} {:>6}          {} {} {vertical:>4} {horizontal:>4}",
            three(own_mean.into(), 4),
            three(own_deviation.into(), 4),
            beyond(1),
            beyond(0),
            mean.map(|x| format!("{x:>6.2}")).join(" "),
            deviation.map(|x| format!("{x:>6.2}")).join(" "),
        )?;
    }
    Ok(())
}
