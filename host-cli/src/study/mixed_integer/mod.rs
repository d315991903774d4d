//! `study mixed-integer`: Section V of M. Greiff et al., *Mixed-Integer Linear Regression Kalman Filters for GNSS
//! Positioning* (CCTA 2021), by Monte Carlo.
//!
//! | module | holds |
//! |---|---|
//! | [`constellation`] | where the 13 satellites are |
//! | [`scenario`] | synthetic data and their truth |
//! | [`trial`] | one run of the filter against the truth |
//! | [`outcome`] | what the runs of a configuration come to |
//! | [`section`] | which configurations are compared |
//! | [`acceptance`] | the bands that must be met |
//! | [`detector_curve`] | false alarms and detections over the threshold |
//! | [`report`] | the tables on screen |
//! | [`files`] | the tables as CSV |
//! | [`figure`] | Fig. 1 |
//! | [`device_log`] | a run for `surefix replay` and firmware |
//!
//! Cost: a run of 300 epochs is 300 steps of the filter; the whole study is some 55 configurations of `runs` runs, each
//! configuration once, however many tables it stands in.

pub mod acceptance;
pub mod constellation;
pub mod detector_curve;
pub mod device_log;
pub mod figure;
pub mod files;
pub mod outcome;
pub mod report;
pub mod scenario;
pub mod section;
pub mod trial;

use super::monte_carlo;
use constellation::Constellation;
use detector_curve::{Curve, CurveTally};
use indicatif::ProgressBar;
use outcome::{Outcome, RunTally};
use section::{Part, Section};
use surefix_core::filter::mixed_integer::FilterError;
use trial::{Configuration, Snapshot, trial};

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Runs of each configuration.
    pub runs: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Parts of the study.
    pub parts: Vec<Part>,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Study {
    /// What was done.
    pub settings: Settings,
    /// The tables, with an outcome for each row.
    pub sections: Vec<(Section, Vec<Outcome>)>,
    /// The paper's detector and the weighted one.
    pub curves: Option<[Curve; 2]>,
    /// The epochs of one run.
    pub track: Option<Vec<Snapshot>>,
    /// Epochs that went through a filter.
    pub epochs: usize,
}

impl Study {
    /// Runs the parts on the threads of the pool it is called from.
    pub fn run(settings: Settings, progress: &ProgressBar) -> Result<Self, FilterError> {
        let constellation = Constellation::new();
        let sections = section::sections(&settings.parts);
        let mut configurations: Vec<Configuration> = Vec::new();
        for row in sections.iter().flat_map(|section| &section.rows) {
            if !configurations.contains(&row.configuration) {
                configurations.push(row.configuration);
            }
        }
        let runs = settings.runs.max(1);
        let tallies: Vec<RunTally> = monte_carlo::run(configurations.len() * runs, progress, |task| {
            let mut tally = RunTally::default();
            let random = monte_carlo::stream(settings.seed, (task % runs) as u64);
            trial(&configurations[task / runs], &constellation, random, |snapshot| tally.add(snapshot))?;
            Ok(tally)
        })
        .into_iter()
        .collect::<Result<_, FilterError>>()?;
        let outcomes: Vec<Outcome> = tallies.chunks(runs).map(Outcome::of).collect();
        let outcome = |configuration: &Configuration| {
            configurations.iter().zip(&outcomes).find(|(other, _)| *other == configuration).map(|(_, outcome)| *outcome)
        };
        let sections: Vec<(Section, Vec<Outcome>)> = sections
            .into_iter()
            .map(|section| {
                let outcomes = section.rows.iter().filter_map(|row| outcome(&row.configuration)).collect();
                (section, outcomes)
            })
            .collect();

        let wanted = |part| settings.parts.contains(&part);
        let curves = match wanted(Part::Curve) {
            true => Some(curves(&constellation, runs, settings.seed, progress)?),
            false => None,
        };
        let track = match wanted(Part::Figure) {
            true => Some(track(&constellation, settings.seed)?),
            false => None,
        };
        let in_curves = if curves.is_some() { runs * section::open_loop().scenario.epochs } else { 0 };
        let in_tables: usize = configurations.iter().map(|configuration| runs * configuration.scenario.epochs).sum();
        let epochs = in_tables + in_curves + track.as_ref().map_or(0, Vec::len);
        Ok(Self { settings, sections, curves, track, epochs })
    }

    /// How many numbers lie outside their acceptance bands.
    pub fn missed(&self) -> usize {
        let acceptance = self.sections.iter().filter(|(section, _)| section.part == Part::Acceptance);
        acceptance.flat_map(|(_, outcomes)| outcomes).map(acceptance::missed).sum()
    }
}

/// Both detectors, open loop.
fn curves(
    constellation: &Constellation,
    runs: usize,
    seed: u64,
    progress: &ProgressBar,
) -> Result<[Curve; 2], FilterError> {
    let tallies: Vec<CurveTally> = monte_carlo::run(runs, progress, |run| {
        let mut tally = CurveTally::default();
        let random = monte_carlo::stream(seed, run as u64);
        trial(&section::open_loop(), constellation, random, |snapshot| tally.add(snapshot))?;
        Ok(tally)
    })
    .into_iter()
    .collect::<Result<_, FilterError>>()?;
    Ok(Curve::of(&tallies))
}

/// The epochs of the first run of the nominal configuration.
fn track(constellation: &Constellation, seed: u64) -> Result<Vec<Snapshot>, FilterError> {
    let mut epochs = Vec::new();
    let random = monte_carlo::stream(seed, 0);
    trial(&section::nominal(), constellation, random, |snapshot| epochs.push(snapshot.clone()))?;
    Ok(epochs)
}

#[cfg(test)]
mod tests;
