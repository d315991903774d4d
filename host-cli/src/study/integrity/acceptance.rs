//! The numbers that the study must give.

use super::super::acceptance::{Line, missed};
use super::super::statistics::Estimate;
use super::noise::Noise;
use super::risk::{LEVELS, RISKS, promised};
use super::variant::{RECOMMENDED, VARIANTS};
use super::{Study, Table};

impl Study {
    /// All numbers of the parts that were done.
    pub fn acceptance(&self) -> Vec<Line> {
        let tables = self.tables.iter().flat_map(of_table);
        tables.chain(self.risk.iter().flat_map(of_risk)).collect()
    }

    /// How many lie outside of their bands.
    pub fn missed(&self) -> usize {
        missed(&self.acceptance())
    }
}

fn of_table(table: &Table) -> Vec<Line> {
    let mut lines = Vec::new();
    let name = table.noise.name();
    // Positive definite by construction, and by trial in every epoch.
    let indefinite: usize = table.rows.iter().map(|(_, outcome)| outcome.indefinite).sum();
    lines.push(Line::exact(format!("{name}: epochs with an indefinite R*, all filters"), indefinite as f64, 0.0, 0.0));
    let refused: usize = table.rows.iter().map(|(_, outcome)| outcome.refused).sum();
    lines.push(Line::exact(format!("{name}: epochs refused, all filters"), refused as f64, 0.0, 0.0));
    let of = |name: &str| table.outcome(name);
    match table.noise {
        Noise::Constant => {
            for variant in VARIANTS.iter().filter(|v| ["AKF per channel", "AKF per type"].contains(&v.name)) {
                if let (Some(plain), Some(adaptive)) = (of("KF"), of(variant.name)) {
                    let quantity = format!("{name}: rms of {} / rms of KF", variant.name);
                    lines.push(Line::exact(quantity, adaptive.rms / plain.rms, 0.0, 1.03));
                }
            }
        }
        Noise::Varying => {
            for variant in ["AKF per type", RECOMMENDED] {
                if let Some(outcome) = of(variant) {
                    let quantity = format!("{name}: PE > PL horizontal of {variant} [%]");
                    lines.push(Line { quantity, value: outcome.beyond[0].scale(100.0), low: 0.0, high: 0.1 });
                }
            }
        }
        Noise::Correlated => (),
        Noise::Heavy => {
            if let Some(outcome) = of(RECOMMENDED) {
                let [horizontal, vertical] = outcome.beyond;
                let mut line = |what: &str, value: Estimate, low: f64, high: f64| {
                    let quantity = format!("{name}: {what} of {RECOMMENDED} [%]");
                    lines.push(Line { quantity, value: value.scale(100.0), low, high });
                };
                // None at all: an allowance for chance there is not.
                line("PE > PL horizontal", Estimate { standard_error: 0.0, ..horizontal }, 0.0, 0.0);
                line("PE > PL vertical", vertical, 0.0, 0.3);
                line("fixed", outcome.fixed, 75.0, 100.0);
            }
        }
    }
    lines
}

/// At or below what is promised within the 95 % interval, and not more than twenty times below.
fn of_risk(outcome: &super::risk::Outcome) -> Vec<Line> {
    let mut lines = vec![Line::exact("risk: epochs dropped".into(), outcome.dropped as f64, 0.0, 0.0)];
    for (risk, rates) in RISKS.iter().zip(&outcome.rates) {
        let promised = promised(*risk);
        for (level, rate) in LEVELS.iter().zip(rates) {
            // The factor of one dimension is conservative in the plane by choice.
            let least = if level.contains("one dimension") { 0.0 } else { 1.0 / 20.0 };
            let quantity = format!("risk {risk:e}: PE > PL over what is promised, {level}");
            lines.push(Line { quantity, value: rate.scale(1.0 / promised), low: least, high: 1.0 });
        }
    }
    lines
}
