//! Smoothing of what the RTK engine recorded: true Rauch–Tung–Striebel smoothing of motion, ambiguities and coloured
//! noise, integers fixed on the smoothing posterior, noise learned by EM (Greiff et al. 2023).
//!
//! * [`tape`]: what the engine used, epoch by epoch.
//! * [`model`]: states, transitions and measurements of a tape; [`clusters`], [`noise`], [`rows`]: its parts.
//! * [`robust`]: how far each measurement is to be trusted.
//! * [`fix`]: integers on the smoothing (or the filtering) posterior.
//! * [`answer`]: from smoothed densities to solutions.
//! * [`report`]: what smoothing found out.

pub mod answer;
pub mod clusters;
pub mod fix;
pub mod model;
pub mod noise;
pub mod report;
pub mod robust;
pub mod rows;
pub mod tape;
#[cfg(test)]
mod tests;

use crate::smooth::em::{self, EmOptions};
use crate::smooth::history::Storage;
use crate::smooth::integers::Scope;
use crate::smooth::model::Model;
use crate::smooth::pass::{PassError, PassOptions, Passes};
use crate::smooth::progress::Progress;
use fix::{ByEpoch, Fixing, Samples};
use model::RtkModel;
use noise::{Kind, Noise, TimeConstants};
use report::{Consistency, Learned, Report, Start};
use surefix_core::gnss::solution::Solution;
use tape::Tape;

/// How to smooth.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Whether noise is learned from the data (EM).
    pub em: bool,
    /// Whether, with EM, each measurement is trusted as its smoothed error deserves: noise with heavy tails.
    pub robust: bool,
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
    /// Further starts of EM, as factors like those: before integers are fixed, EM learns from each, and the likeliest end
    /// counts.
    pub starts: Vec<[f64; 2]>,
    /// How integers are fixed.
    pub fixing: Fixing,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            em: false,
            robust: true,
            budget: 512 << 20,
            coloured: true,
            time_constants: TimeConstants { code: 20.0, phase: 600.0 },
            phase_centres: [0.001, 0.002],
            start_factors: [1.0; 2],
            starts: Vec::new(),
            fixing: Fixing::default(),
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

/// Evaluations of EM (passes forward and backward) before integers are fixed, after, and after measurements were judged.
const EVALUATIONS: [usize; 3] = [10, 12, 6];
/// How often measurements are judged by their smoothed errors.
const JUDGEMENTS: usize = 2;
/// Rounds of fixing: those fixed help the rest.
const ROUNDS: usize = 4;

/// Smooths a tape.
pub fn smooth(tape: &Tape, options: &Options, progress: Option<&Progress>) -> Result<Smoothed, PassError> {
    let passes = Passes::new(PassOptions { budget: options.budget, storage: None, progress });
    let mut noise = Noise::new(tape, options.time_constants, options.coloured);
    noise.scale(options.start_factors);
    let start = noise.parameters().to_vec();
    let by_arc = options.fixing.scope == Scope::Arc;
    let mut run = Run { passes, model: RtkModel::new(tape, noise), report: Report::default() };
    run.announce(options);
    if options.em {
        run.learn(if by_arc { EVALUATIONS[0] } else { EVALUATIONS[0] + EVALUATIONS[1] }, &options.starts)?;
    }
    if by_arc {
        run.fix(options.fixing)?;
        if options.em {
            run.learn(EVALUATIONS[1], &[])?;
        }
    }
    if options.em && options.robust {
        for _ in 0..JUDGEMENTS {
            (run.model.trust, run.report.tails) = robust::judge(&run.model, &mut run.passes)?;
            run.report.passes += 1;
            run.learn(EVALUATIONS[2], &[])?;
        }
    }
    if options.em && by_arc {
        run.fix(options.fixing)?;
    }
    run.model.take_gauges();
    let fit = run.forward()?;
    run.report.negative_log_likelihood.push(fit);
    run.report.consistency = consistency(&run.model);
    let mut solutions = tape.solutions().to_vec();
    let model = &run.model;
    let mut by_epoch = (!by_arc).then(|| ByEpoch::new(options.fixing));
    run.passes.backward(model, |epoch| {
        let fixed = by_epoch.as_mut().map(|by_epoch| by_epoch.condition(model, epoch));
        let (density, integers) = fixed.as_ref().map_or((epoch.smoothed, [].as_slice()), |(d, list)| (d, list));
        answer::answer(model, epoch.k, density, integers, options.phase_centres, &mut solutions[epoch.k]);
    })?;
    run.report.memory = match run.passes.storage() {
        Some(Storage::Checkpoints { .. }) => "checkpoints",
        Some(Storage::File) => "file",
        _ => "all epochs",
    };
    run.report.parameters = learned(&start, &run.model);
    run.report.arcs = by_epoch.map_or_else(|| fix::count(&run.model), |by_epoch| by_epoch.count(&run.model));
    Ok(Smoothed { solutions, report: run.report })
}

struct Run<'t, 'p> {
    passes: Passes<'p>,
    model: RtkModel<'t>,
    report: Report,
}

impl Run<'_, '_> {
    /// Tells who watches how many passes are to come.
    fn announce(&self, options: &Options) {
        let rounds = if options.em { 2 * ROUNDS } else { ROUNDS };
        let fixing = if options.fixing.scope == Scope::Arc { rounds } else { 0 };
        let [first, second, third] = EVALUATIONS;
        let judging = if options.em && options.robust { JUDGEMENTS } else { 0 };
        let learning = if options.em { first + second + judging * third } else { 0 };
        self.passes.expect(&self.model, 2 * (fixing + learning + judging + 1));
    }

    /// A forward pass; returns −ln likelihood.
    fn forward(&mut self) -> Result<f64, PassError> {
        self.report.passes += 1;
        Ok(self.passes.forward(&self.model)?.negative_log_likelihood())
    }

    /// EM with the integers of the time, from the noise of the time and from further starts.
    fn learn(&mut self, evaluations: usize, starts: &[[f64; 2]]) -> Result<(), PassError> {
        // EM announces its passes itself.
        self.passes.spare(2 * evaluations * self.model.epochs());
        let factors = starts.iter().map(|&factors| self.variance_factors(factors)).collect();
        let options = EmOptions { evaluations, starts: factors, ..EmOptions::default() };
        let learned = em::learn(&mut self.model, &mut self.passes, &options)?;
        self.report.passes += learned.forward_passes;
        let history = learned.history.iter().map(|step| step.negative_log_likelihood);
        self.report.negative_log_likelihood.extend(history);
        if !starts.is_empty() {
            self.report.starts = Start::list(starts, &learned.ends);
        }
        Ok(())
    }

    /// What [`Noise::scale`] by these factors on standard deviations makes of each variance.
    fn variance_factors(&self, factors: [f64; 2]) -> Vec<f64> {
        let noise = &self.model.noise;
        let mut scaled = noise.clone();
        scaled.scale(factors);
        scaled.parameters().iter().zip(noise.parameters()).map(|(to, from)| to.variance / from.variance).collect()
    }

    /// Rounds of fixing on the posterior.
    fn fix(&mut self, fixing: Fixing) -> Result<(), PassError> {
        for round in 0..ROUNDS {
            self.forward()?;
            let mut samples = Samples::new(&self.model, fixing);
            let model = &self.model;
            self.passes.backward(model, |epoch| samples.take(model, epoch))?;
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
