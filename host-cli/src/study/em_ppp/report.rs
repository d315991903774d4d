//! The study as tables for people.

use super::outcome::{at, mean};
use super::scenario::Motion;
use super::speed::GAPS;
use super::trial::{LOOKS, Look};
use super::variant::names;
use super::{Study, Table};
use std::fmt;

/// Table 3 of the paper: improvement of the position after 50 iterations: north, east, up, all `[%]`.
const TABLE_3: [f64; 4] = [66.91, 66.16, 71.60, 69.95];

impl fmt::Display for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { settings, .. } = self;
        if !self.tables.is_empty() {
            writeln!(
                f,
                "{} runs of each scheme, up to {} iterations, seed {}; errors in cm, NEES of the smoother (3 is right), walk \
                 from epoch to epoch in mm (static) or in m/s^1.5 (kinematic), held-out ℓ for each measurement",
                settings.seeds, settings.iterations, settings.seed
            )?;
        }
        for table in &self.tables {
            schemes(f, table, settings.iterations)?;
        }
        if let Some(table) = self.table(Motion::Rest) {
            improvements(f, table, settings.iterations)?;
        }
        if let Some(table) = self.table(Motion::Drive) {
            stop_and_go(f, table)?;
        }
        if !self.starts.is_empty() {
            writeln!(f, "\nSix starts, static: how far the ends lie apart")?;
            writeln!(f, "{:<16} {:>6} {:>10} {:>12} {:>20}", "scheme", "ended", "ℓ", "position cm", "NEES")?;
            for of in &self.starts {
                let nees = format!("{:.1} – {:.1}", of.nees[0], of.nees[1]);
                let (likelihood, position) = (of.likelihood, 100.0 * of.position);
                writeln!(f, "{:<16} {:>6} {likelihood:>10.2} {position:>12.3} {nees:>20}", of.name, of.ended)?;
            }
        }
        if !self.speed.is_empty() {
            writeln!(f, "\nEvaluations until ℓ is within so much of its best, pools by elevation")?;
            let gaps = GAPS.map(|gap| format!("{gap:>8}")).concat();
            writeln!(f, "{:<10} {:<12}{gaps}", "", "")?;
            for of in &self.speed {
                for (name, row) in ["plain", "accelerated"].iter().zip(&of.evaluations) {
                    let numbers = row.map(|n| format!("{:>8}", n.map_or("-".into(), |n| n.to_string()))).concat();
                    writeln!(f, "{:<10} {name:<12}{numbers}", of.motion.name())?;
                }
            }
        }
        let lines = self.acceptance();
        if !lines.is_empty() {
            let width = lines.iter().map(|line| line.quantity.chars().count()).max().unwrap_or(0);
            writeln!(f, "\n{:<width$} {:>17} {:>19}", "acceptance", "band", "")?;
            for line in &lines {
                let band = format!("{:.3} - {:.3}", line.low, line.high);
                let value = format!("{:.3} ± {:.3}", line.value.value, line.value.standard_error);
                writeln!(f, "{:<width$} {band:>17} {value:>19} {}", line.quantity, line.verdict().name())?;
            }
            let inside = lines.len() - self.missed();
            writeln!(f, "acceptance: {inside} of {} numbers not outside their bands", lines.len())?;
        }
        Ok(())
    }
}

fn schemes(f: &mut fmt::Formatter<'_>, table: &Table, iterations: usize) -> fmt::Result {
    let looks: Vec<usize> = LOOKS.into_iter().filter(|look| *look <= iterations).collect();
    writeln!(f, "\nSchemes, {}: filter rms 2nd half / smoother rms / NEES / walk", table.motion.name())?;
    write!(f, "{:<20}", "scheme")?;
    looks.iter().try_for_each(|look| write!(f, " {:>26}", format!("{look} iterations")))?;
    writeln!(f, " {:>12} {:>10}", "held-out ℓ", "failed")?;
    let walk = if table.motion == Motion::Rest { 1e3 } else { 1.0 };
    let cells = |f: &mut fmt::Formatter<'_>, numbers: [f64; 4]| {
        let ([filter, smoother], [nees, walk]) =
            ([100.0 * numbers[0], 100.0 * numbers[1]], [numbers[2], walk * numbers[3]]);
        write!(f, " {:>26}", format!("{filter:.2} / {smoother:.2} / {nees:.1} / {walk:.3}"))
    };
    let columns: [fn(&Look) -> f64; 4] = [|look| look.filter, |look| look.smoother, |look| look.nees, |look| look.walk];
    for (variant, trials) in &table.rows {
        write!(f, "{:<20}", variant.name)?;
        for &look in &looks {
            cells(f, columns.map(|number| at(trials, look, number).0.value))?;
        }
        let last = looks.last().copied().unwrap_or(0);
        let (held_out, ended) = at(trials, last, |look| look.held_out);
        let failed: Vec<String> = trials.iter().filter_map(|trial| Some(trial.failed?.to_string())).collect();
        let failed = if failed.is_empty() { format!("of {ended} -") } else { failed.join(",") };
        writeln!(f, " {:>12.2} {failed:>10}", held_out.value)?;
    }
    write!(f, "{:<20}", "recommended, as used")?;
    cells(f, columns.map(|number| mean(table.recommended.iter().map(|run| number(&run.look))).value))?;
    let held_out = mean(table.recommended.iter().map(|run| run.look.held_out)).value;
    let passes = mean(table.recommended.iter().map(|run| run.passes.iter().sum::<usize>() as f64)).value;
    writeln!(f, " held-out ℓ {held_out:.2}, {passes:.0} passes")?;
    writeln!(f, "held-out ℓ under the variances of the draw: {:.2}", mean(table.truth.iter().copied()).value)
}

/// The paper's Table 3: how much better the end of the run is than at the start.
fn improvements(f: &mut fmt::Formatter<'_>, table: &Table, iterations: usize) -> fmt::Result {
    writeln!(f, "\nImprovement of the last 20 epochs [%]: north, east, up, all")?;
    let row = |f: &mut fmt::Formatter<'_>, name: String, numbers: [f64; 4]| {
        writeln!(f, "{name:<34} {}", numbers.map(|x| format!("{x:>8.2}")).concat())
    };
    row(f, "the paper, Table 3, real data".into(), TABLE_3)?;
    for name in [names::EPOCH, names::FLOORS, names::STUDENT] {
        for look in LOOKS.into_iter().filter(|look| (1..=iterations).contains(look)) {
            let errors = |look: usize| {
                let axis = |k: usize| at(table.trials(name), look, |look| look.end[k]).0.value;
                [axis(0), axis(1), axis(2), at(table.trials(name), look, |look| look.end.norm()).0.value]
            };
            let (start, end) = (errors(0), errors(look));
            row(f, format!("{name}, {look} iterations"), std::array::from_fn(|k| 100.0 * (1.0 - end[k] / start[k])))?;
        }
    }
    Ok(())
}

/// Whether a walk of its own for each step tells stop from go.
fn stop_and_go(f: &mut fmt::Formatter<'_>, table: &Table) -> fmt::Result {
    writeln!(f, "\nWalk of the velocity in stop and go, first run, 10 iterations [m/s^1.5]: stop, go")?;
    for name in [names::EPOCH, names::STUDENT] {
        let Some([stop, go]) = phases(table, name) else { continue };
        writeln!(f, "{name:<20} {stop:>8.4} {go:>8.4}")?;
    }
    Ok(())
}

/// Median walk of the steps that have no acceleration, and of the others.
pub fn phases(table: &Table, name: &str) -> Option<[f64; 2]> {
    let place = LOOKS.iter().position(|look| *look == 10)?;
    let walks = &table.trials(name).first()?.looks.get(place)?.as_ref()?.walks;
    let median = |go: bool| {
        let of = walks.iter().zip(&table.accelerations).filter(|(_, a)| (**a > 0.1) == go);
        let mut list: Vec<f64> = of.map(|(walk, _)| *walk).collect();
        list.sort_by(f64::total_cmp);
        list.get(list.len() / 2).copied()
    };
    Some([median(false)?, median(true)?])
}
