//! Section 5.2: noise learned by EM from a wrong start.
//!
//! | case | of the paper | here |
//! |---|---|---|
//! | (A) | RTSAP with θ₀ | the same |
//! | (B) | APP from θ₀ | [`ITERATIONS`] of EM with the flags of (A), then RTSAP with θ*, which detects anew |
//! | (C) | RTSAP with θ_true | the same |
//! | (D) | – | APP as recommended: accelerated EM on the model whose integers are fixed |
//!
//! SD-IF, integers from the smoother, fixed smoother. Appendix A draws θ_true/θ₀ from U(0.1, 10), θ being inverse
//! variances: [`Reading::Literal`], which starts with too much noise, in contradiction to the paper's Fig. 3, where (A)
//! is too sure of itself. [`Reading::Reversed`] takes the reciprocal.
//!
//! On the relaxed model EM takes part of the process noise for the random walk of the ambiguities, which σ_L = 0.05 cycles
//! allows them and the data do not have: the variances of positions become too small. (D) knows the integers.

use super::super::monte_carlo;
use super::super::statistics::{Estimate, Tally};
use super::scenario::{Differences, Record, Scenario};
use super::trial::{self, Configuration, Estimation, Fixed, Posterior, Scheme, TrialError};
use crate::smooth::app::{AppOptions, LearnOn, app};
use crate::smooth::em;
use crate::smooth::integers::{IntegerOptions, Search, Source};
use crate::smooth::model::{Model, Parameter};
use crate::smooth::objective::Expectation;
use crate::smooth::pass::Passes;
use crate::smooth::rtsap::RtsapOptions;
use rand::Rng;

/// Steps of EM.
pub const ITERATIONS: usize = 20;
/// Runs of the paper.
pub const RUNS: usize = 10;

/// How the start is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// θ_true/θ₀ ~ U(0.1, 10): variances mostly too large.
    Literal,
    /// θ₀/θ_true ~ U(0.1, 10): variances mostly too small.
    Reversed,
}

impl Reading {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Literal, Self::Reversed];

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Literal => "literal",
            Self::Reversed => "reversed",
        }
    }
}

/// What EM did, from one start.
#[derive(Clone, Debug)]
pub struct Learning {
    /// (A), (B) and (D).
    pub cases: [Case; 3],
    /// σ of the start, of each iteration, over the true one, for each component.
    pub sigma_ratios: Vec<Vec<f64>>,
    /// The same of (D).
    pub recommended_ratios: Vec<f64>,
    /// −ln p(y | θⁱ), i = 0, …
    pub negative_log_likelihood: Vec<f64>,
    /// Q(θⁱ, θⁱ⁻¹), i = 1, …
    pub objective: Vec<f64>,
}

/// One case of one run.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its fixed positions.
    pub fixed: Fixed,
    /// Slips that were flagged.
    pub flags: usize,
    /// −ln p(y | θ).
    pub negative_log_likelihood: f64,
}

/// A run: both readings and (C).
#[derive(Clone, Debug)]
pub struct Adapted {
    /// In the order of [`Reading::ALL`].
    pub learning: [Learning; 2],
    /// With the true θ.
    pub truth: Case,
}

/// The data and the smoother of this part.
pub fn configuration(last: usize) -> Configuration {
    let scenario = Scenario { differences: Differences::Single, last, ..Scenario::default() };
    Configuration { scenario, estimation: Estimation::recommended() }
}

/// One run.
pub fn adapt(configuration: &Configuration, seed: u64, run: u64) -> Result<Adapted, TrialError> {
    let mut random = monte_carlo::stream(seed, run);
    let record = Record::simulate(&configuration.scenario, &mut random);
    let mut model = configuration.model(&record, Scheme::Erts)?;
    let truth: Vec<f64> = model.parameters().iter().map(|parameter| parameter.variance).collect();
    let case = |model: &mut _| -> Result<Case, TrialError> {
        let run = trial::smooth(model, &record, &[Posterior::Smoother])?;
        let [_, fixed] = run.fixed;
        Ok(Case { fixed, flags: run.flags, negative_log_likelihood: run.negative_log_likelihood })
    };
    let truth_case = case(&mut model)?;
    let factors: Vec<f64> = model.parameters().iter().map(|_| random.random_range(0.1..10.0)).collect();
    let mut learn = |reading: Reading| -> Result<Learning, TrialError> {
        let start =
            model.parameters().iter().zip(&truth).zip(&factors).map(|((parameter, &variance), &factor)| {
                match (parameter.learned, reading) {
                    (false, _) => variance,
                    (true, Reading::Literal) => variance * factor,
                    (true, Reading::Reversed) => variance / factor,
                }
            });
        let initial: Vec<f64> = start.collect();
        model.set_variances(&initial);
        let first = case(&mut model)?;
        model.release();
        let ratios = |variances: &[f64], parameters: &[Parameter]| -> Vec<f64> {
            let all = variances.iter().zip(&truth).zip(parameters);
            all.filter(|(_, parameter)| parameter.learned).map(|((ours, truth), _)| (ours / truth).sqrt()).collect()
        };
        let mut sigma_ratios = vec![ratios(&initial, model.parameters())];
        let (mut negative_log_likelihood, mut objective) = (Vec::new(), Vec::new());
        let mut passes = Passes::new(Default::default());
        for _ in 0..ITERATIONS {
            negative_log_likelihood.push(passes.forward(&model)?.negative_log_likelihood());
            let expectation = Expectation::gather(&model, &mut passes)?;
            let variances: Vec<f64> = em::maximize(&model, &expectation.process).into_iter().map(f64::exp).collect();
            objective.push(expectation.value(&variances).total());
            model.set_variances(&variances);
            sigma_ratios.push(ratios(&variances, model.parameters()));
        }
        negative_log_likelihood.push(passes.forward(&model)?.negative_log_likelihood());
        let last = case(&mut model)?;
        model.set_variances(&initial);
        let integers = IntegerOptions::paper(Source::Smoother, Search::Bootstrapping);
        let rtsap = RtsapOptions { integers, ..RtsapOptions::default() };
        let options = AppOptions { learn_on: LearnOn::Fixed, rtsap, ..AppOptions::default() };
        let recommended = app(&mut model, &mut passes, &options, |_, _| ())?;
        let recommended_ratios = ratios(&recommended.em.end, model.parameters());
        let cases = [first, last, case(&mut model)?];
        Ok(Learning { cases, sigma_ratios, recommended_ratios, negative_log_likelihood, objective })
    };
    let learning = [learn(Reading::Literal)?, learn(Reading::Reversed)?];
    Ok(Adapted { learning, truth: truth_case })
}

/// A case of all runs: what the paper's Fig. 3 shows, and what it comes to after the first twentieth of the epochs and
/// before the last one.
#[derive(Clone, Debug)]
pub struct CaseOutcome {
    /// RMSE `[m]`.
    pub rmse: Estimate,
    /// RAPC `[m]`.
    pub rapc: f64,
    /// RMSE/RAPC.
    pub ratio: Estimate,
    /// Right integers `[%]`.
    pub right: Estimate,
    /// Mean number of flagged slips.
    pub flags: f64,
    /// Mean −ln p(y | θ).
    pub negative_log_likelihood: f64,
    /// RMSE and RAPC of each epoch `[m]`.
    pub series: [Vec<f64>; 2],
}

impl CaseOutcome {
    /// Of all runs.
    pub fn of(cases: &[&Case]) -> Self {
        let count = cases.len() as f64;
        let tracks: Vec<_> =
            cases.iter().map(|case| case.fixed.positions[Posterior::Smoother as usize].as_slice()).collect();
        let epochs = tracks.iter().map(|track| track.len()).min().unwrap_or(0);
        let mean = |of: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..epochs).map(|k| ((0..tracks.len()).map(|run| of(run, k)).sum::<f64>() / count).sqrt()).collect()
        };
        let inner = epochs / 20..epochs - epochs / 20;
        let sums = tracks.iter().map(|track| {
            let inside = &track[inner.clone()];
            let square = inside.iter().map(|position| position.error.norm_squared()).sum();
            (square, inside.iter().map(|position| position.trace).sum::<f64>())
        });
        let length = inner.len() as f64;
        let rapc = (sums.clone().map(|(_, trace)| trace).sum::<f64>() / (length * count)).sqrt();
        Self {
            rmse: Estimate::ratio(sums.clone().map(|(sum, _)| Tally { sum, count: length })).sqrt(),
            rapc,
            ratio: Estimate::ratio(sums.map(|(sum, count)| Tally { sum, count })).sqrt(),
            right: Estimate::ratio(cases.iter().map(|case| case.fixed.right)).scale(100.0),
            flags: cases.iter().map(|case| case.flags as f64).sum::<f64>() / count,
            negative_log_likelihood: cases.iter().map(|case| case.negative_log_likelihood).sum::<f64>() / count,
            series: [mean(&|run, k| tracks[run][k].error.norm_squared()), mean(&|run, k| tracks[run][k].trace)],
        }
    }
}

/// Geometric mean over runs of the factor by which σ is off, whichever way, for each component: at the
/// start, after (B) and after (D).
pub fn sigma_factors(runs: &[&Learning]) -> [Vec<f64>; 3] {
    let factors = |pick: fn(&Learning) -> Option<&Vec<f64>>| -> Vec<f64> {
        let components = runs.first().and_then(|run| pick(run)).map_or(0, Vec::len);
        let off = |j: usize| runs.iter().filter_map(move |run| Some(pick(run)?[j].ln().abs()));
        (0..components).map(|j| (off(j).sum::<f64>() / runs.len() as f64).exp()).collect()
    };
    [
        factors(|run| run.sigma_ratios.first()),
        factors(|run| run.sigma_ratios.last()),
        factors(|run| Some(&run.recommended_ratios)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A short run: the likelihood never falls, and σ comes nearer to the truth.
    #[test]
    fn the_likelihood_rises_and_learning_helps() {
        let run = adapt(&configuration(100), 1, 0).unwrap();
        for learning in &run.learning {
            assert_eq!(learning.negative_log_likelihood.len(), ITERATIONS + 1);
            let falls = learning.negative_log_likelihood.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6);
            assert!(falls, "{:?}", learning.negative_log_likelihood);
            let [first, last, recommended] = sigma_factors(&[learning]);
            let off = |factors: &[f64]| factors.iter().map(|factor| factor.ln()).sum::<f64>();
            assert!(off(&last) < off(&first), "{first:?} {last:?}");
            assert!(off(&recommended) < off(&first), "{first:?} {recommended:?}");
        }
    }

    /// Factors of 2 and 1/2 are both off by 2.
    #[test]
    fn factors_count_both_ways() {
        let case = Case { fixed: Fixed::default(), flags: 0, negative_log_likelihood: 0.0 };
        let learning = |ratio: f64| Learning {
            cases: [case.clone(), case.clone(), case.clone()],
            sigma_ratios: vec![vec![ratio], vec![1.0]],
            recommended_ratios: vec![1.0],
            negative_log_likelihood: vec![],
            objective: vec![],
        };
        let [start, end, _] = sigma_factors(&[&learning(2.0), &learning(0.5)]);
        assert!((start[0] - 2.0).abs() < 1e-12 && end[0] == 1.0);
    }
}
