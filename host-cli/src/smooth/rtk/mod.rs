//! Smoothing of what the RTK engine recorded: true Rauch–Tung–Striebel smoothing of motion, ambiguities and coloured
//! noise, integers fixed on the smoothing posterior, noise learned by EM (Greiff et al. 2023).
//!
//! * [`tape`]: what the engine used, epoch by epoch.
//! * [`model`]: states, transitions and measurements of a tape; [`clusters`], [`noise`], [`rows`]: its parts.
//! * [`fix`]: integers on the smoothing posterior.
//! * [`answer`]: from smoothed densities to solutions.
//! * [`report`]: what smoothing found out.

pub mod answer;
pub mod clusters;
pub mod fix;
pub mod model;
pub mod noise;
pub mod report;
pub mod rows;
pub mod tape;
#[cfg(test)]
mod tests;

use crate::smooth::em::{self, EmOptions};
use crate::smooth::history::Storage;
use crate::smooth::model::Model;
use crate::smooth::pass::{PassError, PassOptions, Passes};
use crate::smooth::progress::Progress;
use fix::Samples;
use model::RtkModel;
use noise::{Kind, Noise, TimeConstants};
use report::{Consistency, Learned, Report};
use surefix_core::gnss::solution::Solution;
use tape::Tape;

/// How to smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Whether noise is learned from the data (EM).
    pub em: bool,
    /// Memory for filtered densities, in bytes.
    pub budget: usize,
    /// Whether multipath is modelled as coloured noise.
    pub coloured: bool,
    /// Correlation times of multipath.
    pub time_constants: TimeConstants,
    /// Uncertainty of the antennas' phase centres, horizontal (each axis) and vertical `[m]`: constant over a run, so that
    /// no data can tell it; added to the covariances that are reported.
    pub phase_centres: [f64; 2],
    /// Factors on the standard deviations of process and measurement noise with which smoothing starts, to see whether EM
    /// finds back from a wrong start.
    pub start_factors: [f64; 2],
}

impl Default for Options {
    fn default() -> Self {
        Self {
            em: false,
            budget: 512 << 20,
            coloured: true,
            time_constants: TimeConstants { code: 20.0, phase: 600.0 },
            phase_centres: [0.001, 0.002],
            start_factors: [1.0; 2],
        }
    }
}

/// A smoothed run.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// One for each epoch of the tape.
    pub solutions: Vec<Solution>,
    /// What was found out.
    pub report: Report,
}

/// Evaluations of EM (passes forward and backward) before integers are fixed, and after.
const EVALUATIONS: [usize; 2] = [10, 20];
/// Rounds of fixing: those fixed help the rest.
const ROUNDS: usize = 4;

/// Smooths a tape.
pub fn smooth(tape: &Tape, options: &Options, progress: Option<&Progress>) -> Result<Smoothed, PassError> {
    let passes = Passes::new(PassOptions { budget: options.budget, storage: None, progress });
    let mut noise = Noise::new(tape, options.time_constants, options.coloured);
    noise.scale(options.start_factors);
    let start = noise.parameters().to_vec();
    let mut run = Run { passes, model: RtkModel::new(tape, noise), report: Report::default() };
    run.announce(options.em);
    if options.em {
        run.learn(EVALUATIONS[0])?;
    }
    run.fix()?;
    if options.em {
        run.learn(EVALUATIONS[1])?;
        run.fix()?;
    }
    run.model.take_gauges();
    let fit = run.forward()?;
    run.report.negative_log_likelihood.push(fit);
    run.report.consistency = consistency(&run.model);
    let mut solutions = tape.solutions().to_vec();
    let model = &run.model;
    run.passes.backward(model, |epoch| {
        answer::answer(model, epoch.k, epoch.smoothed, options.phase_centres, &mut solutions[epoch.k]);
    })?;
    run.report.memory = match run.passes.storage() {
        Some(Storage::Checkpoints { .. }) => "checkpoints",
        Some(Storage::File) => "file",
        _ => "all epochs",
    };
    run.report.parameters = learned(&start, &run.model);
    run.report.arcs = fix::count(&run.model);
    Ok(Smoothed { solutions, report: run.report })
}

struct Run<'t, 'p> {
    passes: Passes<'p>,
    model: RtkModel<'t>,
    report: Report,
}

impl Run<'_, '_> {
    /// Tells who watches how many passes are to come.
    fn announce(&self, em: bool) {
        let fixing = ROUNDS * if em { 2 } else { 1 };
        let learning: usize = if em { EVALUATIONS.iter().sum() } else { 0 };
        self.passes.expect(&self.model, 2 * (fixing + learning + 1));
    }

    /// A forward pass; returns −ln likelihood.
    fn forward(&mut self) -> Result<f64, PassError> {
        self.report.passes += 1;
        Ok(self.passes.forward(&self.model)?.negative_log_likelihood())
    }

    /// EM with the integers of the time.
    fn learn(&mut self, evaluations: usize) -> Result<(), PassError> {
        // EM announces its passes itself.
        self.passes.spare(2 * evaluations * self.model.epochs());
        let options = EmOptions { evaluations, ..EmOptions::default() };
        let learned = em::learn(&mut self.model, &mut self.passes, &options)?;
        self.report.passes += learned.forward_passes;
        let history = learned.history.iter().map(|step| step.negative_log_likelihood);
        self.report.negative_log_likelihood.extend(history);
        Ok(())
    }

    /// Rounds of fixing on the smoothing posterior.
    fn fix(&mut self) -> Result<(), PassError> {
        for round in 0..ROUNDS {
            self.forward()?;
            let mut samples = Samples::new(&self.model);
            let model = &self.model;
            self.passes.backward(model, |epoch| samples.take(model, epoch.k, epoch.smoothed))?;
            if samples.fix(&mut self.model) == 0 {
                self.passes.spare(2 * (ROUNDS - 1 - round) * self.model.epochs());
                break;
            }
        }
        Ok(())
    }
}

fn consistency(model: &RtkModel<'_>) -> Vec<Consistency> {
    let gauges = model.take_gauges();
    let of = |kind: Kind| {
        let gauge = gauges[kind as usize];
        let mean = gauge.normalized_innovation_squared / gauge.rows as f64;
        (gauge.rows > 0).then_some(Consistency { of: kind.name(), count: gauge.rows, mean })
    };
    Kind::ALL.into_iter().filter_map(of).collect()
}

fn learned(start: &[crate::smooth::model::Parameter], model: &RtkModel<'_>) -> Vec<Learned> {
    let pairs = start.iter().zip(model.parameters());
    pairs
        .map(|(start, end)| Learned {
            name: start.name.clone(),
            unit: start.unit,
            start: start.variance.sqrt(),
            end: end.variance.sqrt(),
            learned: start.learned,
        })
        .collect()
}
