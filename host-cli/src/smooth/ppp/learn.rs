//! The iterations of EM.
//!
//! ```text
//! forward ─► ℓ ─► stop? ─► (scan of Q = 0) ─► backward ─► B, C ─► M-step ─► (linearise again) ─► forward …
//! ```
//! ℓ is (21) of Zhang et al. (2020), −2 ln p(y | θ) without its constant, and is minimised. The criterion (20) of the paper
//! is undefined where ℓ crosses zero, and stops early; here |Δℓ| for each measurement and the greatest |Δ ln θ| both have
//! to be small. EM approaches a variance of zero so slowly that hundreds of iterations do less than one look at ℓ on a
//! grid that has 0 in it ([`Learning::scan`]). After the iterations of EM, pooled variances that have not converged are
//! accelerated (SQUAREM, [`crate::smooth::em`]), with the trust in each measurement as it is.
//!
//! A pass that fails (a covariance that is not positive definite, a number that is not finite) ends the iterations with
//! the last variances that worked, and a [`Status`] that says so.

use super::disturbances::Disturbances;
use super::model::PppModel;
use super::noise::Noise;
use super::{Class, Motion};
use crate::smooth::em::{self, EmOptions};
use crate::smooth::model::{Density, Model, Sums};
use crate::smooth::pass::{Fit, PassError, Passes};
use nalgebra::Vector3;

/// How EM goes about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Learning {
    /// Most iterations of EM; 0 learns nothing.
    pub iterations: usize,
    /// Converged if ℓ changes by less than this for each measurement, and …
    pub decrease: f64,
    /// … no ln θ by more than this.
    pub change: f64,
    /// Standard deviations of the position's walk from one epoch to the next `[m]` that are tried, if they are below what
    /// EM has, after each iteration from [`Learning::scan_after`] on. The likeliest is taken, but 0 if that is not unlikelier
    /// than chance would have it for a receiver that does rest; and 0 is final. (Student-t weights belong to the walk that
    /// they were found with: it takes some looks to get down.) None for receivers that move.
    pub scan: Vec<f64>,
    /// From which iteration on.
    pub scan_after: usize,
    /// Most evaluations of accelerated EM on pooled variances that have not converged; 0 for none.
    pub accelerated: usize,
    /// Whether the mean before the first epoch is learned (μ₀).
    pub mean: bool,
    /// Whether its covariance is (P₀): it falls to zero, and the answer is far too sure of itself.
    pub covariance: bool,
}

impl Default for Learning {
    fn default() -> Self {
        Self {
            iterations: 10,
            decrease: 1e-5,
            change: 1e-2,
            scan: vec![1e-3, 3e-4, 1e-4, 3e-5, 0.0],
            scan_after: 5,
            accelerated: 20,
            mean: true,
            covariance: false,
        }
    }
}

/// Linearised again, ℓ may rise by this for each measurement.
const RISE: f64 = 1e-3;

/// A walk of 0 is refused only if ℓ falls by more than this without it: in one of twenty runs of a receiver at rest, as
/// half of the time the likeliest variance is 0, and else ℓ gains a χ² of one degree of freedom (S. G. Self & K.-Y. Liang,
/// J. Am. Stat. Assoc. 82, 1987, case 5).
const CHANCE: f64 = 2.706;

/// How EM ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// Nothing changed any more.
    Converged,
    /// After the most iterations.
    Iterations,
    /// A pass failed: the variances are those before it.
    Failed {
        /// In which iteration.
        iteration: usize,
        /// Why.
        reason: String,
    },
    /// ℓ rose after the measurements were linearised again: the variances are those before.
    Rose {
        /// In which iteration.
        iteration: usize,
    },
}

/// A θ that was reached.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// ℓ, (21).
    pub likelihood: f64,
    /// ℓ and the penalty of the scheme: what the scheme minimises.
    pub objective: f64,
    /// The same of the step before, by the prior of this step (which schemes with a prior choose from the data).
    pub before: Option<f64>,
    /// Whether it was reached by acceleration.
    pub accelerated: bool,
}

/// A look at ℓ for some walks of the position.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// The iteration after which it was done.
    pub iteration: usize,
    /// Standard deviation from one epoch to the next `[m]` and ℓ (infinite where the filter failed).
    pub tried: Vec<(f64, f64)>,
    /// ℓ with what EM had.
    pub before: f64,
    /// Which was taken; none if EM's was.
    pub taken: Option<f64>,
}

/// What came of it; the variances are the model's.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// Every θ on the way.
    pub history: Vec<Step>,
    /// How it ended.
    pub status: Status,
    /// The last scan, if there was one.
    pub scan: Option<Scan>,
    /// Forward and backward passes.
    pub passes: [usize; 2],
}

/// (21): −2 ln p(y) without its constant.
pub fn likelihood(fit: &Fit) -> f64 {
    fit.gauges.iter().map(|gauge| gauge.normalized_innovation_squared + gauge.log_determinant).sum()
}

/// What a backward pass tells the M-step.
#[derive(Clone, Debug, Default)]
pub struct Expectation {
    /// B of each row, (26); NaN of those not used.
    pub squares: Vec<f64>,
    /// C of each process parameter, (24).
    pub sums: Sums,
    /// Smoothed position of each epoch, ECEF `[m]`.
    pub positions: Vec<Vector3<f64>>,
    /// Smoothed density of the first epoch.
    pub first: Density,
}

/// The E-step, after a forward pass.
pub fn expect(model: &PppModel, passes: &mut Passes<'_>) -> Result<Expectation, PassError> {
    let mut squares = vec![f64::NAN; model.tape().rows.len()];
    let mut positions = vec![model.tape().origin; model.epochs()];
    let mut first = Density::default();
    let mut sums = Sums::new(model.parameters().len());
    let last = model.epochs().saturating_sub(1);
    let mut disturbances = Disturbances::new(model.states(last));
    let mut failure = None;
    passes.backward(model, |epoch| {
        if epoch.k < last && failure.is_none() {
            let outcome = disturbances.step_back(model, epoch.k, epoch.filtered, &mut sums);
            failure = outcome.err().map(|source| PassError::Step { epoch: epoch.k, source });
        }
        model.each_residual(epoch.k, epoch.smoothed, |i, _, square| squares[i] = square);
        positions[epoch.k] += Vector3::from_fn(|axis, _| epoch.smoothed.mean[axis]);
        if epoch.k == 0 {
            first.clone_from(epoch.smoothed);
        }
    })?;
    failure.map_or(Ok(()), Err)?;
    Ok(Expectation { squares, sums, positions, first })
}

/// All that a step of EM changes, to go back to.
struct Kept {
    noise: Noise,
    prior: Option<Density>,
    positions: Vec<Vector3<f64>>,
}

impl Kept {
    fn of(model: &PppModel) -> Self {
        let positions = model.tape().epochs.iter().map(|epoch| epoch.position).collect();
        Self { noise: model.noise.clone(), prior: model.prior.clone(), positions }
    }

    fn restore(self, model: &mut PppModel) {
        model.noise = self.noise;
        model.prior = self.prior;
        model.relinearize(&self.positions);
    }
}

/// Learns the noise of a model, which keeps it. Fails only if the first pass does, or if it is stopped.
pub fn learn(model: &mut PppModel, passes: &mut Passes<'_>) -> Result<Learned, PassError> {
    let options = model.options().learning.clone();
    passes.expect(model, 2 * options.iterations + 1);
    let mut learned = Learned { history: Vec::new(), status: Status::Iterations, scan: None, passes: [0; 2] };
    let start: Vec<_> = model.tape().epochs.iter().map(|epoch| epoch.position).collect();
    model.relinearize(&start);
    let observations = model.observations().max(1) as f64;
    let mut before: Option<Kept> = None;
    for iteration in 0..=options.iterations {
        let fit = pass(passes.forward(model), model);
        learned.passes[0] += 1;
        let step = match fit {
            Ok(fit) => step(model, before.as_ref(), &learned.history, likelihood(&fit)),
            Err(error) => return fail(learned, iteration, error, before, model),
        };
        let rise = learned.history.last().map(|last| step.likelihood - last.likelihood);
        let linearised = !model.tape().geometry.is_empty();
        if linearised && model.options().is_likelihood() && rise.is_some_and(|rise| rise > RISE * observations) {
            learned.status = Status::Rose { iteration };
            if let Some(before) = before {
                before.restore(model);
            }
            break;
        }
        let change = before.as_ref().map_or(f64::INFINITY, |before| model.noise.change(&before.noise));
        passes.reach(iteration, step.likelihood);
        learned.history.push(step);
        let open = model.options().motion == Motion::Walk && model.noise.history(Class::Motion, 0).any(|q| q > 0.0);
        let mut moved = false;
        if open && iteration >= options.scan_after && !options.scan.is_empty() {
            scan(model, passes, iteration, &mut learned)?;
            moved = learned.scan.as_ref().is_some_and(|scan| scan.taken.is_some());
        }
        if moved {
            // The filtered densities are those of the last that was tried.
            passes.forward(model)?;
            learned.passes[0] += 1;
        } else if rise.is_some_and(|rise| rise.abs() < options.decrease * observations) && change < options.change {
            learned.status = Status::Converged;
            break;
        }
        if iteration == options.iterations {
            break;
        }
        let expectation = match pass(expect(model, passes), model) {
            Ok(expectation) => expectation,
            Err(error) => {
                learned.history.pop();
                return fail(learned, iteration, error, before, model);
            }
        };
        learned.passes[1] += 1;
        before = Some(Kept::of(model));
        maximize(model, &expectation);
    }
    let more = options.accelerated > 0 && options.iterations > 0 && model.options().is_pooled();
    if more && learned.status == Status::Iterations {
        accelerate(model, passes, &mut learned)?;
    }
    Ok(learned)
}

/// Enlarges R for errors that last, and learns the process noise once more with that, in as many iterations as before the scan.
pub fn correlate(model: &mut PppModel, passes: &mut Passes<'_>, learned: &mut Learned) -> Result<(), PassError> {
    let options = model.options().learning.clone();
    let iterations = if model.noise.learns_process() { options.iterations.min(options.scan_after) } else { 0 };
    passes.expect(model, 2 * iterations + 2);
    passes.forward(model)?;
    let mut residuals = vec![f64::NAN; model.tape().rows.len()];
    passes.backward(model, |epoch| {
        model.each_residual(epoch.k, epoch.smoothed, |i, residual, _| residuals[i] = residual);
    })?;
    let lags = match model.options().walk(Class::Motion).learned {
        super::noise::Process::Window(width) => width,
        _ => usize::MAX,
    };
    let factors = super::correlation::factors(model, &residuals, lags);
    model.noise.correlate(factors);
    for iteration in 0..iterations {
        let kept = Kept::of(model);
        let outcome = pass(passes.forward(model), model).and_then(|_| pass(expect(model, passes), model));
        learned.passes[0] += 1;
        match outcome {
            Ok(expectation) => maximize(model, &expectation),
            Err(error) => {
                learned.status = failed(iteration, error)?;
                kept.restore(model);
                break;
            }
        }
        learned.passes[1] += 1;
    }
    Ok(())
}

/// The M-step: variances, the density before the first epoch, and the points of linearisation.
pub fn maximize(model: &mut PppModel, expectation: &Expectation) {
    let mut noise = model.noise.clone();
    noise.maximize(model.tape(), &expectation.squares, &expectation.sums);
    model.noise = noise;
    let options = &model.options().learning;
    if options.mean || options.covariance {
        let (mean, covariance) = (options.mean, options.covariance);
        let mut prior = Density::default();
        model.prior(&mut prior);
        if mean {
            prior.mean.clone_from(&expectation.first.mean);
        }
        if covariance {
            prior.covariance.clone_from(&expectation.first.covariance);
        }
        model.prior = Some(prior);
    }
    model.relinearize(&expectation.positions);
}

/// A pass that yields numbers, and variances that are some.
fn pass<T>(result: Result<T, PassError>, model: &PppModel) -> Result<T, PassError> {
    match result {
        Ok(_) if !model.noise.is_valid() => {
            Err(PassError::Step { epoch: 0, source: surefix_core::smooth::SmoothError::NotFinite })
        }
        other => other,
    }
}

/// What a failed pass means for EM; cancellation and full disks are errors of their own.
fn failed(iteration: usize, error: PassError) -> Result<Status, PassError> {
    match error {
        PassError::Update { .. } | PassError::Step { .. } => {
            Ok(Status::Failed { iteration, reason: error.to_string() })
        }
        other => Err(other),
    }
}

fn fail(
    mut learned: Learned,
    iteration: usize,
    error: PassError,
    before: Option<Kept>,
    model: &mut PppModel,
) -> Result<Learned, PassError> {
    let Some(before) = before else { return Err(error) };
    learned.status = failed(iteration, error)?;
    before.restore(model);
    Ok(learned)
}

fn step(model: &PppModel, before: Option<&Kept>, history: &[Step], likelihood: f64) -> Step {
    let (active, noise) = (model.active(), &model.noise);
    let earlier = before.zip(history.last()).map(|(kept, last)| last.likelihood + kept.noise.penalty(active, noise));
    Step { likelihood, objective: likelihood + noise.penalty(active, noise), before: earlier, accelerated: false }
}

/// Tries walks of the position; the model takes the likeliest.
fn scan(
    model: &mut PppModel,
    passes: &mut Passes<'_>,
    iteration: usize,
    learned: &mut Learned,
) -> Result<(), PassError> {
    let before = learned.history.last().map_or(f64::INFINITY, |step| step.likelihood);
    let Some(interval) = model.tape().interval() else { return Ok(()) };
    let own = model.noise.clone();
    let mut scan = Scan { iteration, tried: Vec::new(), before, taken: None };
    let mut best = (before, own.clone());
    let most = (0..3).flat_map(|axis| own.history(Class::Motion, axis)).fold(0.0, f64::max);
    let mut sigmas = model.options().learning.scan.clone();
    sigmas.sort_by(|a, b| b.total_cmp(a));
    for sigma in sigmas {
        if sigma * sigma / interval >= most {
            continue;
        }
        model.noise = own.clone();
        model.noise.set_class(Class::Motion, sigma * sigma / interval);
        learned.passes[0] += 1;
        let value = match passes.forward(model) {
            Ok(fit) => likelihood(&fit),
            Err(error) => failed(iteration, error).map(|_| f64::INFINITY)?,
        };
        scan.tried.push((sigma, value));
        if value < best.0 + if sigma == 0.0 { CHANCE } else { 0.0 } {
            best = (value, model.noise.clone());
            scan.taken = Some(sigma);
        }
    }
    model.noise = best.1;
    if let (Some(_), Some(step)) = (scan.taken, learned.history.last_mut()) {
        step.objective += best.0 - step.likelihood;
        step.likelihood = best.0;
    } else {
        passes.forward(model)?;
        learned.passes[0] += 1;
    }
    learned.scan = Some(scan);
    Ok(())
}

/// Accelerated EM on the parameters, with trust and linearisation as they are.
fn accelerate(model: &mut PppModel, passes: &mut Passes<'_>, learned: &mut Learned) -> Result<(), PassError> {
    let learning = model.options().learning.clone();
    // ℓ is twice −ln p.
    let decrease = learning.decrease / 2.0;
    let options =
        EmOptions { evaluations: learning.accelerated, decrease, change: learning.change, ..EmOptions::default() };
    let kept = Kept::of(model);
    let iteration = learned.history.len();
    match em::learn(model, passes, &options) {
        Ok(report) => {
            learned.passes[0] += report.forward_passes;
            learned.passes[1] += report.backward_passes;
            let last = learned.history.last().cloned();
            for step in report.history.iter().skip(1) {
                let change = report.history[0].negative_log_likelihood - step.negative_log_likelihood;
                learned.history.extend(last.clone().map(|last| Step {
                    likelihood: last.likelihood - 2.0 * change,
                    objective: last.objective - 2.0 * change,
                    before: None,
                    accelerated: true,
                }));
            }
            if report.converged {
                learned.status = Status::Converged;
            }
        }
        Err(error) => {
            learned.status = failed(iteration, error)?;
            kept.restore(model);
        }
    }
    Ok(())
}
