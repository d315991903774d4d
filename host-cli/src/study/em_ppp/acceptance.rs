//! The numbers that the study must give.

use super::super::acceptance::{Line, missed};
use super::super::statistics::Estimate;
use super::outcome::{at, mean, rise};
use super::scenario::Motion;
use super::trial::Trial;
use super::variant::names;
use super::{Study, Table};

impl Study {
    /// All numbers of the parts that were done.
    pub fn acceptance(&self) -> Vec<Line> {
        self.tables.iter().flat_map(|table| of_table(table, self.settings.iterations)).collect()
    }

    /// How many lie outside of their bands.
    pub fn missed(&self) -> usize {
        missed(&self.acceptance())
    }
}

/// After as many iterations as there are, at most 10.
fn of_table(table: &Table, iterations: usize) -> Vec<Line> {
    let look = [10, 5, 0].into_iter().find(|look| *look <= iterations).unwrap_or(0);
    let (name, mut lines) = (table.motion.name(), Vec::new());
    for (variant, trials) in table.rows.iter().filter(|(variant, _)| variant.options.is_likelihood()) {
        // Rounding at |ℓ| of some thousands.
        let quantity = format!("{name}: greatest rise of ℓ, {}", variant.name);
        lines.push(Line::exact(quantity, rise(trials), f64::NEG_INFINITY, 1e-3));
    }
    let mut line = |what: &str, value: Estimate, low: f64, high: f64| {
        lines.push(Line { quantity: format!("{name}: {what}"), value, low, high });
    };
    let beyond_truth = |trials: &[Trial]| {
        let place = super::trial::LOOKS.iter().position(|of| *of == look)?;
        let of = trials.iter().zip(&table.truth);
        let differences: Vec<f64> =
            of.filter_map(|(trial, truth)| Some(trial.looks.get(place)?.as_ref()?.held_out - truth)).collect();
        Some(mean(differences.iter().copied()))
    };
    let student = table.trials(names::STUDENT);
    let ratio = ratio(student, look);
    line(&format!("filter rms of student-t / start, {look} iterations"), ratio, 0.0, 0.6);
    if table.motion == Motion::Rest {
        let elevation = table.trials(names::ELEVATION);
        for (of, trials) in [(names::ELEVATION, elevation), (names::STUDENT, student)] {
            line(&format!("NEES of the smoother, {of}"), at(trials, look, |look| look.nees).0, 0.3, 5.0);
            if let Some(value) = beyond_truth(trials) {
                line(&format!("held-out ℓ for each measurement above the truth's, {of}"), value, 0.0, 1.0);
            }
        }
        let zero = table.recommended.iter().map(|run| f64::from(run.taken == Some(0.0)));
        line("share of runs whose scan takes a walk of 0", mean(zero), 0.875, 1.0);
        let nees = table.recommended.iter().map(|run| run.look.nees);
        line("NEES of the smoother, recommended", mean(nees), 0.3, 5.0);
    }
    lines
}

/// The filter's error after so many iterations over that at the start.
fn ratio(trials: &[Trial], look: usize) -> Estimate {
    let place = super::trial::LOOKS.iter().position(|of| *of == look).unwrap_or(0);
    let pairs = trials.iter().filter_map(|trial| {
        let (start, end) = (trial.looks.first()?.as_ref()?, trial.looks.get(place)?.as_ref()?);
        Some(end.filter / start.filter)
    });
    let ratios: Vec<f64> = pairs.collect();
    mean(ratios.iter().copied())
}
