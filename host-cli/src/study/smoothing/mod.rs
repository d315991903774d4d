//! `study smoothing`: Section 5 of M. Greiff et al., *Adaptive Smoothing with Ambiguity Fixation for GNSS Post-Processing*
//! (IFAC World Congress 2023), by Monte Carlo.
//!
//! | module | holds |
//! |---|---|
//! | [`geometry`] | where the ten satellites are |
//! | [`scenario`] | synthetic data and their truth |
//! | [`trial`] | one run of the smoother against the truth |
//! | [`outcome`] | what the runs of a row come to |
//! | [`section`] | which configurations are compared, and the paper's numbers |
//! | [`adaptation`] | noise learned from a wrong start |
//! | [`acceptance`] | the bands that must be met |
//! | [`report`] | the tables on screen |
//! | [`files`] | the tables as CSV |
//! | [`figure`] | Figs. 2, 3 and 4 |
//!
//! All parts and both models draw from the same streams: run i of each sees the same noise. Cost: a run is one relaxed
//! pass forward and back for each moment rule, and a fixed one for each source of integers that differs.

pub mod acceptance;
pub mod adaptation;
pub mod figure;
pub mod files;
pub mod geometry;
pub mod outcome;
pub mod report;
pub mod scenario;
pub mod section;
pub mod trial;

use super::monte_carlo;
use adaptation::{Adapted, CaseOutcome, Learning, Reading};
use indicatif::ProgressBar;
use outcome::Outcome;
use scenario::{Differences, Record};
use section::Part;
use trial::{Fixed, Posterior, Run, Scheme, TrialError};

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Runs of each row; of [`Part::Adaptation`] the paper's ten at most.
    pub runs: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// K: there are epochs 0 to K.
    pub last: usize,
    /// Parts of the study.
    pub parts: Vec<Part>,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Study {
    /// What was done.
    pub settings: Settings,
    /// Table 2 in several configurations.
    pub tables: Vec<Table>,
    /// Learned noise.
    pub adaptation: Option<Adaptation>,
}

/// A configuration of Table 2.
#[derive(Clone, Debug)]
pub struct Table {
    /// Which.
    pub part: Part,
    /// Double and single differences, each with every moment rule.
    pub rows: Vec<Row>,
}

/// A model and a moment rule.
#[derive(Clone, Debug)]
pub struct Row {
    /// The model.
    pub differences: Differences,
    /// The moment rule.
    pub scheme: Scheme,
    /// By source of the integers, then by estimate.
    pub outcomes: [[Outcome; 2]; 2],
    /// Largest difference of any fixed position from that of ERTS `[m]`.
    pub difference: f64,
}

/// Learned noise.
#[derive(Clone, Debug)]
pub struct Adaptation {
    /// Each run.
    pub runs: Vec<Adapted>,
    /// (A), (B) and (D) of each reading.
    pub cases: [[CaseOutcome; 3]; 2],
    /// (C).
    pub truth: CaseOutcome,
    /// For each reading, by which factor each σ is off: at the start, after (B) and after (D).
    pub sigma_factors: [[Vec<f64>; 3]; 2],
}

impl Study {
    /// Runs the parts on the threads of the pool it is called from.
    pub fn run(settings: Settings, progress: &ProgressBar) -> Result<Self, TrialError> {
        let wanted = |part: &Part| settings.parts.contains(part);
        let tables = Part::TABLES.into_iter().filter(wanted).map(|part| Table::run(part, &settings, progress));
        let tables = tables.collect::<Result<_, _>>()?;
        let adaptation = match wanted(&Part::Adaptation) {
            true => Some(Adaptation::run(&settings, progress)?),
            false => None,
        };
        Ok(Self { settings, tables, adaptation })
    }

    /// The table of a part, if it was done.
    pub fn table(&self, part: Part) -> Option<&Table> {
        self.tables.iter().find(|table| table.part == part)
    }
}

impl Table {
    fn run(part: Part, settings: &Settings, progress: &ProgressBar) -> Result<Self, TrialError> {
        let mut rows = Vec::new();
        for differences in [Differences::Double, Differences::Single] {
            let Some(configuration) = part.configuration(differences, settings.last) else { continue };
            let schemes = part.schemes();
            let runs = monte_carlo::run(settings.runs.max(1), progress, |run| {
                let mut random = monte_carlo::stream(settings.seed, run as u64);
                let record = Record::simulate(&configuration.scenario, &mut random);
                let runs = schemes.iter().map(|&scheme| trial::run(&configuration, scheme, &record, &Posterior::ALL));
                runs.collect::<Result<Vec<Run>, TrialError>>()
            });
            let runs = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
            for (i, &scheme) in schemes.iter().enumerate() {
                let outcomes = Posterior::ALL.map(|source| {
                    let fixed: Vec<&Fixed> = runs.iter().map(|run| &run[i].fixed[source as usize]).collect();
                    Posterior::ALL.map(|estimate| Outcome::of(&fixed, estimate))
                });
                let difference = runs.iter().map(|run| trial::difference(&run[0], &run[i])).fold(0.0, f64::max);
                rows.push(Row { differences, scheme, outcomes, difference });
            }
        }
        Ok(Self { part, rows })
    }
}

impl Row {
    /// The numbers of a source of integers and an estimate.
    pub fn outcome(&self, source: Posterior, estimate: Posterior) -> &Outcome {
        &self.outcomes[source as usize][estimate as usize]
    }
}

impl Adaptation {
    fn run(settings: &Settings, progress: &ProgressBar) -> Result<Self, TrialError> {
        let configuration = adaptation::configuration(settings.last);
        let count = settings.runs.clamp(1, adaptation::RUNS);
        let runs =
            monte_carlo::run(count, progress, |run| adaptation::adapt(&configuration, settings.seed, run as u64));
        let runs = runs.into_iter().collect::<Result<Vec<Adapted>, _>>()?;
        let learning =
            |reading: Reading| -> Vec<&Learning> { runs.iter().map(|run| &run.learning[reading as usize]).collect() };
        let cases = Reading::ALL.map(|reading| {
            let case = |i: usize| {
                let cases: Vec<_> = learning(reading).iter().map(|learning| &learning.cases[i]).collect();
                CaseOutcome::of(&cases)
            };
            [case(0), case(1), case(2)]
        });
        let truth = CaseOutcome::of(&runs.iter().map(|run| &run.truth).collect::<Vec<_>>());
        let sigma_factors = Reading::ALL.map(|reading| adaptation::sigma_factors(&learning(reading)));
        Ok(Self { cases, truth, sigma_factors, runs })
    }
}

#[cfg(test)]
mod tests;
