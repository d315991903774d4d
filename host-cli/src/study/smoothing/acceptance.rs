//! Acceptance: the numbers that the study must give, with their bands.
//!
//! The bands are those of an independent implementation of the same choices, 40 to 80 runs. RAPC does not depend on the
//! number of runs; of RMSE/RAPC the standard error is 1 % after 80 runs and 3 % after ten. A number outside of its band
//! by less than two of its standard errors is undecided; only those beyond count as missed.

use super::super::acceptance::{Line, missed};
use super::adaptation::Reading;
use super::scenario::Differences;
use super::section::Part;
use super::trial::{Posterior, Scheme};
use super::{Adaptation, Study, Table};

/// S-RAPC of the fixed filter and the fixed smoother in geometry G2 `[m]`.
const RAPC: [(Differences, [f64; 2]); 2] =
    [(Differences::Double, [0.0550, 0.0403]), (Differences::Single, [0.0521, 0.0383])];

impl Study {
    /// All numbers of the parts that were done.
    pub fn acceptance(&self) -> Vec<Line> {
        let tables = self.tables.iter().flat_map(of_table);
        tables.chain(self.adaptation.iter().flat_map(of_adaptation)).collect()
    }

    /// How many numbers lie outside of their bands.
    pub fn missed(&self) -> usize {
        missed(&self.acceptance())
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
