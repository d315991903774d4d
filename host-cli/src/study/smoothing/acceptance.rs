//! Acceptance: the numbers that the study must give, with their bands.
//!
//! The bands are those of an independent implementation of the same choices, 40 to 80 runs. RAPC does not depend on the
//! number of runs; of RMSE/RAPC the standard error is 1 % after 80 runs and 3 % after ten. A number outside of its band
//! by less than two of its standard errors is undecided; only those beyond count as missed.

use super::super::statistics::Estimate;
use super::adaptation::Reading;
use super::scenario::Differences;
use super::section::Part;
use super::trial::{Posterior, Scheme};
use super::{Adaptation, Study, Table};

/// A number and where it must lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What it is.
    pub quantity: String,
    /// The number.
    pub value: Estimate,
    /// Smallest value that is accepted.
    pub low: f64,
    /// Largest value that is accepted.
    pub high: f64,
}

/// Where a number lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// In its band.
    Inside,
    /// Not, but within two standard errors of it.
    Undecided,
    /// Farther off, or not a number.
    Outside,
}

impl Verdict {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inside => "inside",
            Self::Undecided => "undecided",
            Self::Outside => "OUTSIDE",
        }
    }
}

/// S-RAPC of the fixed filter and the fixed smoother in geometry G2 `[m]`.
const RAPC: [(Differences, [f64; 2]); 2] =
    [(Differences::Double, [0.0550, 0.0403]), (Differences::Single, [0.0521, 0.0383])];

impl Line {
    /// A number that is not uncertain.
    fn exact(quantity: String, value: f64, low: f64, high: f64) -> Self {
        Self { quantity, value: Estimate { value, standard_error: 0.0 }, low, high }
    }

    /// Where it lies.
    pub fn verdict(&self) -> Verdict {
        let Estimate { value, standard_error } = self.value;
        let margin = if standard_error.is_finite() { 2.0 * standard_error } else { 0.0 };
        match (value >= self.low && value <= self.high, value >= self.low - margin && value <= self.high + margin) {
            (true, _) => Verdict::Inside,
            (false, true) => Verdict::Undecided,
            (false, false) => Verdict::Outside,
        }
    }
}

impl Study {
    /// All numbers of the parts that were done.
    pub fn acceptance(&self) -> Vec<Line> {
        let tables = self.tables.iter().flat_map(of_table);
        tables.chain(self.adaptation.iter().flat_map(of_adaptation)).collect()
    }

    /// How many numbers lie outside of their bands.
    pub fn missed(&self) -> usize {
        self.acceptance().iter().filter(|line| line.verdict() == Verdict::Outside).count()
    }
}

fn of_table(table: &Table) -> Vec<Line> {
    let mut lines = Vec::new();
    for row in &table.rows {
        let name = format!("{:?} {}", table.part, row.differences.name()).to_lowercase();
        if row.scheme != Scheme::Erts {
            let quantity = format!("{name}: position {} - ERTS [m]", row.scheme.name());
            lines.push(Line::exact(quantity, row.difference, 0.0, 1e-6));
            continue;
        }
        for (source, estimate) in Posterior::ALL.into_iter().flat_map(|s| Posterior::ALL.map(|e| (s, e))) {
            let outcome = row.outcome(source, estimate);
            let of = format!("fixed {}, integers from {}", estimate.name(), source.name());
            if table.part != Part::Nominal {
                for (_, rapc) in RAPC.iter().filter(|(differences, _)| *differences == row.differences) {
                    let rapc = rapc[estimate as usize];
                    let quantity = format!("{name}: S-RAPC [m], {of}");
                    lines.push(Line::exact(quantity, outcome.middle_rapc, 0.98 * rapc, 1.02 * rapc));
                }
            }
            let quantity = format!("{name}: RMSE/RAPC, {of}");
            lines.push(Line { quantity, value: outcome.ratio, low: 0.95, high: 1.05 });
        }
    }
    lines
}

/// EM ends within 8 % of consistency and each σ, as the geometric mean over the runs, within 30 %.
fn of_adaptation(adaptation: &Adaptation) -> Vec<Line> {
    let mut lines = Vec::new();
    for reading in Reading::ALL {
        let [_, paper, recommended] = &adaptation.cases[reading as usize];
        let [_, of_paper, of_recommended] = &adaptation.sigma_factors[reading as usize];
        for (case, outcome, factors) in [("(B)", paper, of_paper), ("(D)", recommended, of_recommended)] {
            let quantity = format!("adaptation, {}: RMSE/RAPC of {case}", reading.name());
            lines.push(Line { quantity, value: outcome.ratio, low: 0.0, high: 1.08 });
            for (name, &factor) in ["x", "y", "z", "I", "T", "t"].into_iter().zip(factors) {
                let quantity = format!("adaptation, {}: sigma_{name} of {case} off by a factor of", reading.name());
                lines.push(Line::exact(quantity, factor, 1.0, 1.3));
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_know_the_standard_error() {
        let line = |value, standard_error| Line {
            quantity: String::new(),
            value: Estimate { value, standard_error },
            low: 0.95,
            high: 1.05,
        };
        assert_eq!(line(0.95, 0.0).verdict(), Verdict::Inside);
        assert_eq!(line(1.05, f64::NAN).verdict(), Verdict::Inside);
        assert_eq!(line(1.06, 0.01).verdict(), Verdict::Undecided);
        assert_eq!(line(1.08, 0.01).verdict(), Verdict::Outside);
        assert_eq!(line(0.94, f64::NAN).verdict(), Verdict::Outside);
        assert_eq!(line(f64::NAN, 1.0).verdict(), Verdict::Outside);
    }
}
