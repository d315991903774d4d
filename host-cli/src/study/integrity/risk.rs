//! Whether protection levels are exceeded as rarely as they promise, where model and noise are true.
//!
//! Runs of 120 epochs, each from its own start drawn from the prior, with the filter's own model of motion (white
//! acceleration) and noise (eq. 9) and integers drawn anew: every assumption holds, and every epoch counts. Of the same
//! answers the levels of three risks are formed; integers count where 1 − P_s ≤ P_IF, a tenth of the smallest risk, else
//! the float position with its level. The rate of epochs beyond is a ratio over runs, whose standard error takes the
//! correlation within a run into account; its 95 % interval is ± 1.96 of them.
//!
//! Direct simulation, no importance sampling: at 1e-5 three million epochs have thirty such epochs to expect, or fifteen
//! for each of horizontal and vertical.

use super::super::monte_carlo;
use super::super::statistics::{Estimate, Tally};
use super::noise::{Noise, Noises, normal};
use super::scenario::{START, satellites, sin_elevation};
use super::trial::integers_are_right;
use indicatif::ProgressBar;
use nalgebra::{Matrix3, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use surefix_core::filter::double_difference::{DoubleDifference22, Options, Sight};
use surefix_core::integer::subset;
use surefix_core::integrity::protection::{Basis, Config, Factors, HorizontalFactor, Levels, Rule};
use surefix_core::integrity::risk::{Allocation, one_dimension, two_dimensions};

/// Epochs of a run.
pub const EPOCHS: usize = 120;
/// Risks, both components together.
pub const RISKS: [f64; 3] = [1e-3, 1e-4, 1e-5];
/// Part of the risk that is for wrong integers.
const WRONG_FIX: f64 = 0.1;
/// Satellites that are used, the highest.
const SATELLITES: usize = 9;

/// Levels that are compared: exact for the plane, of one dimension for the plane, vertical.
pub const LEVELS: [&str; 3] = ["horizontal, exact K", "horizontal, K of one dimension", "vertical"];

/// Epochs beyond their level in one run: for each risk and each level.
pub type Beyond = [[Tally; 3]; 3];

/// What the runs come to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Runs.
    pub runs: usize,
    /// For each risk and each level: rate of epochs beyond.
    pub rates: [[Estimate; 3]; 3],
    /// Share of epochs with integers that count.
    pub fixed: f64,
    /// Share of those whose integers are wrong.
    pub wrong: f64,
    /// Epochs that were refused, or have no level.
    pub dropped: usize,
}

impl Outcome {
    /// Runs as many epochs at least, on the threads of the pool it is called from.
    pub fn run(epochs: usize, seed: u64, progress: &ProgressBar) -> Self {
        let runs = epochs.div_ceil(EPOCHS);
        let results = monte_carlo::run(runs, progress, |i| trial(&mut monte_carlo::stream(seed ^ 0x5afe, i as u64)));
        let rate = |risk: usize, level: usize| Estimate::ratio(results.iter().map(|run| run.beyond[risk][level]));
        let sum = |of: fn(&Trial) -> Tally| Estimate::ratio(results.iter().map(of)).value;
        Self {
            runs,
            rates: std::array::from_fn(|risk| std::array::from_fn(|level| rate(risk, level))),
            fixed: sum(|run| run.fixed),
            wrong: sum(|run| run.wrong),
            dropped: results.iter().map(|run| run.dropped).sum(),
        }
    }
}

/// What one run came to.
#[derive(Clone, Copy, Debug, Default)]
struct Trial {
    beyond: Beyond,
    fixed: Tally,
    wrong: Tally,
    dropped: usize,
}

/// Allocation of a risk: half for each component, a tenth for wrong integers.
pub fn allocation(risk: f64) -> Allocation {
    Allocation { risk, wrong_fix: WRONG_FIX * risk, vertical_share: 0.5 }
}

/// What each component may have: half of the risk.
pub fn promised(risk: f64) -> f64 {
    0.5 * risk
}

fn factors(risk: f64, horizontal_factor: HorizontalFactor) -> Factors {
    let config = Config { allocation: allocation(risk), horizontal_factor, rule: Rule::SuccessRate, ..Config::DEFAULT };
    config.factors().expect("a risk that adds up")
}

/// The options: the paper's, with integers only where they are as sure as the smallest risk wants.
fn options() -> Options {
    let least = 1.0 - WRONG_FIX * RISKS[RISKS.len() - 1];
    Options { subset: subset::Options { min_success: least, ..subset::Options::DEFAULT }, ..Options::PAPER }
}

fn trial(random: &mut ChaCha8Rng) -> Trial {
    let options = options();
    let mut filter = Box::new(DoubleDifference22::<f64>::new(options));
    let levels = RISKS.map(|risk| [HorizontalFactor::Exact, HorizontalFactor::OneDimension].map(|k| factors(risk, k)));
    // Of the factor of a circle to that of a line.
    let circles = RISKS.map(|risk| {
        let p = allocation(risk).split().map_or(1.0, |split| split.horizontal);
        two_dimensions(p, 1.0) / one_dimension(p)
    });
    let first = random.random_range(0.0..86_164.0);
    let mut all = satellites(first);
    all.sort_by(|a, b| sin_elevation(b).total_cmp(&sin_elevation(a)));
    let mut noises = Noises::new(Noise::Constant, SATELLITES, random);
    let mut position = Vector3::new(8000.0, 3000.0, 10.0);
    let mut velocity = Vector3::new(5.0, -3.0, 0.0);
    let state: [f64; 6] = std::array::from_fn(|i| {
        let truth = if i < 3 { position[i] } else { velocity[i - 3] };
        truth + START[i].sqrt() * normal(random)
    });
    let mut trial = Trial::default();
    if filter.start(&state, &START).is_err() {
        trial.dropped = EPOCHS;
        return trial;
    }
    let ambiguities: Vec<[i64; 2]> = (0..SATELLITES).map(|_| [(); 2].map(|()| random.random_range(-50..=50))).collect();
    let q = options.motion_noise;
    for k in 0..EPOCHS {
        if k > 0 {
            // Of 1 s: position and velocity noise of the covariance q (1/3, 1/2; 1/2, 1).
            for axis in 0..3 {
                let (a, b) = (normal(random), normal(random));
                position[axis] += velocity[axis] + (q / 3.0).sqrt() * a;
                velocity[axis] += q.sqrt() * (0.75f64.sqrt() * a + 0.5 * b);
            }
        }
        // The sky as it was at the start: two minutes change nothing of note.
        let sky = &all[..SATELLITES];
        let errors = noises.next(sky, 0.0, 0.0, random);
        let sight = |(id, s): (usize, &Vector3<f64>)| {
            let range = (position - 2.0 * s).dot(&position) / ((s - position).norm() + s.norm());
            let of_band = |band: usize| options.wavelengths[band] * ambiguities[id][band] as f64;
            Sight {
                id: id as u8,
                position: *s,
                sin_elevation: sin_elevation(s),
                code: [0, 1].map(|band| range + errors[id].code[band]),
                phase: [0, 1].map(|band| range + of_band(band) + errors[id].phase[band]),
                new_lock: k == 0,
            }
        };
        let sights: Vec<Sight> = sky.iter().enumerate().map(sight).collect();
        let Ok(answer) = filter.step(1.0, &sights, None) else {
            trial.dropped += EPOCHS - k;
            return trial;
        };
        let float = (filter.position(), Matrix3::from_fn(|i, j| filter.covariance().get(i, j).unwrap_or(f64::NAN)));
        for (beyond, (circle, [exact, plain])) in trial.beyond.iter_mut().zip(circles.iter().zip(&levels)) {
            let basis = exact.basis(answer.failure, false);
            let (at, covariance) = if basis == Basis::Float { float } else { answer.conditional.unwrap_or(float) };
            let error = at - position;
            let Some(level) = plain.levels(&covariance, 1.0) else {
                trial.dropped += 1;
                continue;
            };
            let horizontal = error.xy().norm();
            // The exact factor, a thousand exponentials, lies between that of a circle and that of a line.
            let surely_within = horizontal <= circle * level.horizontal;
            let exceeds = |level: Levels| horizontal > level.horizontal;
            let exactly = || exact.levels(&covariance, 1.0).is_some_and(exceeds);
            beyond[0].add_case(!surely_within && (exceeds(level) || exactly()));
            beyond[1].add_case(exceeds(level));
            beyond[2].add_case(error.z.abs() > level.vertical);
        }
        let fixed = levels[RISKS.len() - 1][0].basis(answer.failure, false) != Basis::Float;
        trial.fixed.add_case(fixed);
        if fixed {
            trial.wrong.add_case(!integers_are_right(&filter, &ambiguities));
        }
    }
    trial
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the largest risk 24 000 epochs are enough to see whether levels hold, within four standard errors and the 20-fold.
    #[test]
    fn levels_hold_their_risk() {
        let outcome = Outcome::run(24_000, 1, &ProgressBar::hidden());
        assert_eq!((outcome.runs, outcome.dropped), (200, 0));
        let promised = promised(RISKS[0]);
        for level in [0, 2] {
            let rate = outcome.rates[0][level];
            assert!(rate.value <= promised + 4.0 * rate.standard_error, "{level}: {rate:?}");
            assert!(rate.value >= promised / 20.0, "{level}: {rate:?}");
        }
        assert!(outcome.rates[0][1].value <= outcome.rates[0][0].value);
        assert!(outcome.fixed > 0.5, "{}", outcome.fixed);
    }
}
