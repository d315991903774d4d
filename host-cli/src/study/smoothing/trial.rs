//! One run: the relaxed passes with the slip detector, integers on both posteriors of each epoch, the fixed passes, and
//! their positions against the truth.
//!
//! The relaxed passes are shared by both sources of integers, and the fixed ones too where both say the same.

use super::scenario::{FREQUENCIES, INITIAL_VARIANCES, Record, Scenario};
use crate::smooth::integers::{Fixer, IntegerOptions, Search, Source};
use crate::smooth::model::{Density, Integer, Model};
use crate::smooth::multi_band::{self, MultiBand, MultiBandError, Prior, Settings};
use crate::smooth::pass::{PassError, Passes};
use crate::study::statistics::Tally;
use nalgebra::Vector3;
use std::time::Instant;
use surefix_core::filter::linearize::Rule;
use surefix_core::model::multi_band::{Bands, ClockRows, MotionParameters};
use thiserror::Error;

/// Why a run came to nothing.
#[derive(Debug, Error)]
pub enum TrialError {
    /// The frequencies are not three.
    #[error("carrier frequencies coincide")]
    Bands,
    /// Record and model do not fit.
    #[error(transparent)]
    Model(#[from] MultiBandError),
    /// A pass ended early.
    #[error(transparent)]
    Pass(#[from] PassError),
}

/// What the smoother supposes of the ambiguities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimation {
    /// Standard deviation of the ambiguities in the prior `[cycles]`.
    pub prior: f64,
    /// Whether the relaxed pass uses y₀.
    pub first_epoch: bool,
    /// σ_L, an epoch `[cycles]`.
    pub stay: f64,
    /// σ_H, over a slip `[cycles]`.
    pub slip: f64,
    /// ε of the slip detector `[cycles]`.
    pub threshold: f64,
}

/// A smoother on a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    /// What happens.
    pub scenario: Scenario,
    /// How it is estimated.
    pub estimation: Estimation,
}

/// A moment approximation of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Taylor.
    Erts,
    /// Unscented transform.
    Ut,
    /// Spherical-radial.
    Sr,
}

/// A posterior of an epoch: given the measurements up to it, or all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Posterior {
    /// Up to it.
    Filter,
    /// All.
    Smoother,
}

/// A fixed position at an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// Estimate minus truth `[m]`.
    pub error: Vector3<f64>,
    /// Trace of its covariance `[m²]`.
    pub trace: f64,
}

/// The fixed estimates for one source of integers.
#[derive(Clone, Debug, Default)]
pub struct Fixed {
    /// Given the measurements up to each epoch, and given all.
    pub positions: [Vec<Position>; 2],
    /// Right integers of all.
    pub right: Tally,
    /// Epochs with a wrong integer.
    pub wrong: Vec<usize>,
    /// Relaxed passes, integers and fixed passes `[s]`.
    pub seconds: f64,
}

/// A run.
#[derive(Clone, Debug)]
pub struct Run {
    /// With integers from the relaxed filter, and from the relaxed smoother.
    pub fixed: [Fixed; 2],
    /// Slips that the detector flagged.
    pub flags: usize,
    /// −ln p(y | θ) of the relaxed pass.
    pub negative_log_likelihood: f64,
}

impl Scheme {
    /// In the order of the paper's rows.
    pub const ALL: [Self; 3] = [Self::Erts, Self::Ut, Self::Sr];

    /// As the paper calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Erts => "ERTS",
            Self::Ut => "UT-PL-RTS",
            Self::Sr => "SR-PL-RTS",
        }
    }

    fn rule(self) -> Rule {
        match self {
            Self::Erts => Rule::Taylor,
            Self::Ut => Rule::unscented(4),
            Self::Sr => Rule::Cubature,
        }
    }
}

impl Posterior {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Filter, Self::Smoother];

    /// Bootstrapping on it at each epoch, as in the paper.
    fn fixing(self) -> IntegerOptions {
        let source = match self {
            Self::Filter => Source::Filter,
            Self::Smoother => Source::Smoother,
        };
        IntegerOptions::paper(source, Search::Bootstrapping)
    }

    /// As the paper calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Filter => "filter",
            Self::Smoother => "smoother",
        }
    }
}

impl Estimation {
    /// The decided configuration: a wide prior, all epochs used.
    pub fn recommended() -> Self {
        Self { prior: 100.0, first_epoch: true, stay: 0.05, slip: 10.0, threshold: 0.5 }
    }
}

impl Configuration {
    /// The model of a record of the scenario; EM learns its process noise.
    pub fn model(&self, record: &Record, scheme: Scheme) -> Result<MultiBand, TrialError> {
        let bands = Bands::new(FREQUENCIES).ok_or(TrialError::Bands)?;
        let Estimation { prior, first_epoch, stay, slip, threshold } = self.estimation;
        let [position, velocity, bias] = INITIAL_VARIANCES;
        let settings = Settings {
            base: record.base,
            bands,
            variances: self.scenario.noise,
            clock_rows: ClockRows::All,
            motion: MotionParameters { stay: stay * stay, slip: slip * slip, ..self.scenario.motion },
            rule: scheme.rule(),
            threshold,
            prior: Prior { kinematic: [position, position, position, velocity], ambiguity: prior * prior, bias },
            first_epoch,
            learn_noise: false,
        };
        let epochs = record.satellites.iter().zip(&record.measurements);
        let records: Option<Vec<multi_band::Record>> =
            epochs.map(|(satellites, y)| multi_band::Record::from_rows(&settings, satellites.clone(), y)).collect();
        Ok(MultiBand::new(settings, records.ok_or(MultiBandError::Empty)?)?)
    }
}

/// Epoch, ambiguities and values of a fix.
type Fix = (usize, Vec<Integer>, Vec<f64>);

/// Runs a smoother with these integers' sources on a record.
pub fn run(
    configuration: &Configuration,
    scheme: Scheme,
    record: &Record,
    sources: &[Posterior],
) -> Result<Run, TrialError> {
    smooth(&mut configuration.model(record, scheme)?, record, sources)
}

/// Algorithm 1, integers, and fixed passes, with the parameters in force.
pub fn smooth(model: &mut MultiBand, record: &Record, sources: &[Posterior]) -> Result<Run, TrialError> {
    let mut passes = Passes::new(Default::default());
    model.release();
    let start = Instant::now();
    let fit = passes.forward_detecting(model)?;
    let relaxed_forward = start.elapsed().as_secs_f64();
    let flags = model.flags().iter().flatten().filter(|&&flag| flag).count();
    let start = Instant::now();
    let mut fixers: Vec<Fixer> = sources.iter().map(|source| Fixer::new(source.fixing())).collect();
    passes.backward(model, |epoch| fixers.iter_mut().for_each(|fixer| fixer.visit(model, epoch)))?;
    let relaxed = relaxed_forward + start.elapsed().as_secs_f64();
    let mut fixed = <[Fixed; 2]>::default();
    let mut before: Option<(Vec<Fix>, Posterior)> = None;
    for (&source, fixer) in sources.iter().zip(fixers) {
        let fixes = fixer.fixes().to_vec();
        fixed[source as usize] = match &before {
            Some((same, other)) if *same == fixes => fixed[*other as usize].clone(),
            _ => fixed_passes(model, &mut passes, record, fixer, relaxed)?,
        };
        before = Some((fixes, source));
    }
    Ok(Run { fixed, flags, negative_log_likelihood: fit.negative_log_likelihood() })
}

/// Passes over the model without ambiguities.
fn fixed_passes(
    model: &mut MultiBand,
    passes: &mut Passes<'_>,
    record: &Record,
    fixer: Fixer,
    relaxed_seconds: f64,
) -> Result<Fixed, TrialError> {
    let start = Instant::now();
    let mut fixed = Fixed::default();
    for (k, _, values) in fixer.fixes() {
        let right = || values.iter().zip(&record.truth[*k].ambiguities).map(|(&value, &truth)| value == truth as f64);
        right().for_each(|right| fixed.right.add_case(right));
        if right().any(|right| !right) {
            fixed.wrong.push(*k);
        }
    }
    model.release();
    fixer.apply(model);
    passes.forward(model)?;
    fixed.positions = Posterior::ALL.map(|_| vec![Position::default(); record.truth.len()]);
    let [filtered, smoothed] = &mut fixed.positions;
    passes.backward(model, |epoch| {
        let truth = &record.truth[epoch.k].position;
        filtered[epoch.k] = Position::new(epoch.filtered, truth);
        smoothed[epoch.k] = Position::new(epoch.smoothed, truth);
    })?;
    fixed.seconds = relaxed_seconds + start.elapsed().as_secs_f64();
    Ok(fixed)
}

impl Position {
    fn new(density: &Density, truth: &Vector3<f64>) -> Self {
        Self {
            error: Vector3::from_fn(|i, _| density.mean[i]) - truth,
            trace: (0..3).map(|i| density.covariance(i, i)).sum(),
        }
    }
}

/// Largest difference of the fixed positions of two runs on the same record `[m]`. Wrong integers put a position metres off,
/// where moment rules see the curvature of the range: d²/2ρ is 1e-6 m at 6 m.
pub fn difference(a: &Run, b: &Run) -> f64 {
    let positions = |run: &Run| -> Vec<Vector3<f64>> {
        run.fixed.iter().flat_map(|fixed| fixed.positions.iter().flatten().map(|position| position.error)).collect()
    };
    positions(a).iter().zip(positions(b)).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::super::scenario::{AMBIGUITIES, Differences, Sky};
    use super::*;

    fn configuration(differences: Differences, last: usize) -> Configuration {
        let scenario = Scenario { differences, last, sky: Sky::G2, ..Scenario::default() };
        Configuration { scenario, estimation: Estimation::recommended() }
    }

    /// With a wide prior every integer is right, and the fixed estimates err by what they say. The filtering posterior of
    /// the first epoch has the measurements of that epoch alone, which do not always tell.
    #[test]
    fn integers_are_right_and_positions_too() {
        for differences in [Differences::Double, Differences::Single] {
            let configuration = configuration(differences, 40);
            let record = Record::simulate(&configuration.scenario, &mut stream(1, 0));
            let run = run(&configuration, Scheme::Erts, &record, &Posterior::ALL).unwrap();
            assert!(run.fixed[Posterior::Filter as usize].wrong.iter().all(|&epoch| epoch == 0));
            assert!(run.fixed[Posterior::Smoother as usize].wrong.is_empty());
            for fixed in &run.fixed {
                assert_eq!(fixed.right.count, 41.0 * AMBIGUITIES as f64);
                for position in fixed.positions.iter().flatten() {
                    // χ² of three degrees of freedom over 1e-9; the trace is at most three times the largest variance.
                    assert!(position.error.norm_squared() < 43.0 * position.trace, "{position:?}");
                }
                let [filtered, smoothed] = &fixed.positions;
                assert!(smoothed.iter().zip(filtered).all(|(s, f)| s.trace <= f.trace * (1.0 + 1e-9)));
                assert_eq!(smoothed.last(), filtered.last());
            }
        }
    }

    /// The moment rules differ by rounding alone.
    #[test]
    fn schemes_agree() {
        let configuration = configuration(Differences::Double, 20);
        let record = Record::simulate(&configuration.scenario, &mut stream(2, 0));
        let [erts, ut, sr] = Scheme::ALL.map(|scheme| run(&configuration, scheme, &record, &Posterior::ALL).unwrap());
        let [of_ut, of_sr] = [&ut, &sr].map(|other| difference(&erts, other));
        assert!(of_ut < 1e-6 && of_sr < 1e-6, "{of_ut} {of_sr}");
        assert!(of_ut > 0.0 && of_sr > 0.0, "the rules are the same");
    }
}
