//! EM for all learned parameters of a model, guarded by the likelihood of the innovations.
//!
//! One evaluation at θ is a forward pass, which yields L(θ) = −ln p(y | θ), and a backward pass, whose sums yield the
//! M-step M(θ) in closed form (Greiff et al. 2023, eq. 12; R in the same way). In between:
//! ```text
//! θ₁ = M(θ₀), r = θ₁ − θ₀, v = M(θ₁) − θ₁ − r, α = −‖r‖/‖v‖,   θ' = θ₀ − 2α r + α² v      (all of ln θ)
//! ```
//! R. Varadhan & C. Roland, *Simple and globally convergent methods for accelerating the convergence of any EM algorithm*,
//! Scand. J. Stat. 35 (2008), scheme S3. θ' is taken only if L(θ') < L(θ₁), otherwise it cost one forward pass. A step of
//! plain EM that raises L, which only a nonlinear model can, is halved, and refused if that does not help.
//!
//! The paper stops on the decrease of Q(θⁱ, θⁱ⁻¹), which rises while L improves; here L itself and ln θ decide. The steps
//! stay as detection left them.

use super::model::{Model, Sums};
use super::pass::{PassError, PassOptions, Passes};
use rayon::prelude::*;

/// How often a step that raises L is halved.
const HALVINGS: usize = 4;

/// How EM goes about it.
#[derive(Clone, Debug, PartialEq)]
pub struct EmOptions {
    /// Most evaluations (forward and backward pass) from one start.
    pub evaluations: usize,
    /// Converged if a cycle lowers L by less than this for each measurement.
    pub decrease: f64,
    /// Converged if no ln θ changes by more than this in a step of EM.
    pub change: f64,
    /// Whether to extrapolate (SQUAREM).
    pub accelerate: bool,
    /// Further starts beside the variances that the model has: factors on the learned ones, in the order of the
    /// parameters; a list of one factor is for all of them. The best end counts.
    pub starts: Vec<Vec<f64>>,
}

impl Default for EmOptions {
    fn default() -> Self {
        Self { evaluations: 30, decrease: 1e-7, change: 1e-3, accelerate: true, starts: Vec::new() }
    }
}

/// A θ that was reached, and what the innovations say of it.
#[derive(Clone, Debug, PartialEq)]
pub struct EmStep {
    /// Variances of all parameters.
    pub variances: Vec<f64>,
    /// L = −ln p(y | θ).
    pub negative_log_likelihood: f64,
    /// Whether it was extrapolated.
    pub accelerated: bool,
}

/// What came of EM.
#[derive(Clone, Debug, PartialEq)]
pub struct EmReport {
    /// Variances it started from.
    pub start: Vec<f64>,
    /// Variances it ended with.
    pub end: Vec<f64>,
    /// Every θ on the way, L falling.
    pub history: Vec<EmStep>,
    /// Forward passes.
    pub forward_passes: usize,
    /// Backward passes.
    pub backward_passes: usize,
    /// Whether it stopped because nothing changed any more.
    pub converged: bool,
    /// L at the end of each start, NaN where that failed; one number if there was one start.
    pub ends: Vec<f64>,
}

/// Learns the parameters of `model`, which keeps them: from its own variances, and in parallel from further starts.
pub fn learn<M: Model + Clone + Send + Sync>(
    model: &mut M,
    passes: &mut Passes<'_>,
    options: &EmOptions,
) -> Result<EmReport, PassError> {
    if options.starts.is_empty() {
        return learn_once(model, passes, options);
    }
    let initial = variances(model);
    let (own, count) = (vec![1.0], options.starts.len() + 1);
    let starts: Vec<&Vec<f64>> = std::iter::once(&own).chain(&options.starts).collect();
    let pass_options = PassOptions { budget: passes.options().budget / count, ..passes.options() };
    let run = |factors: &&Vec<f64>| {
        let mut model = model.clone();
        let scaled: Vec<f64> = model
            .parameters()
            .iter()
            .enumerate()
            .map(|(j, parameter)| {
                let factor = if factors.len() == 1 { factors.first() } else { factors.get(j) };
                let factor = if parameter.learned { factor.copied().unwrap_or(1.0) } else { 1.0 };
                (parameter.variance * factor).clamp(parameter.bounds[0], parameter.bounds[1])
            })
            .collect();
        model.set_variances(&scaled);
        learn_once(&mut model, &mut Passes::new(pass_options), options)
    };
    let results: Vec<Result<EmReport, PassError>> = starts.par_iter().map(run).collect();
    let ends = results.iter().map(|result| result.as_ref().map_or(f64::NAN, EmReport::best)).collect();
    let (mut best, mut failure) = (None::<EmReport>, None);
    let [mut forward_passes, mut backward_passes] = [0; 2];
    for result in results {
        match result {
            Ok(report) => {
                forward_passes += report.forward_passes;
                backward_passes += report.backward_passes;
                if best.as_ref().is_none_or(|best| report.best() < best.best()) {
                    best = Some(report);
                }
            }
            Err(PassError::Cancelled) => return Err(PassError::Cancelled),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    match (best, failure) {
        (Some(best), _) => {
            model.set_variances(&best.end);
            Ok(EmReport { start: initial, ends, forward_passes, backward_passes, ..best })
        }
        (None, failure) => Err(failure.unwrap_or(PassError::Empty)),
    }
}

impl EmReport {
    /// L at the end.
    pub fn best(&self) -> f64 {
        self.history.last().map_or(f64::NAN, |step| step.negative_log_likelihood)
    }
}

fn variances<M: Model + ?Sized>(model: &M) -> Vec<f64> {
    model.parameters().iter().map(|parameter| parameter.variance).collect()
}

/// ln of the M-step, within the bounds; parameters that are not learned stay.
pub fn maximize<M: Model + ?Sized>(model: &M, sums: &Sums) -> Vec<f64> {
    let new = |(j, parameter): (usize, &super::model::Parameter)| {
        let [low, high] = parameter.bounds;
        let learned = sums.variance(j).filter(|variance| parameter.learned && variance.is_finite());
        learned.map_or(parameter.variance, |variance| variance.clamp(low, high)).ln()
    };
    model.parameters().iter().enumerate().map(new).collect()
}

/// A θ with L and the step that EM would take from there, all as ln θ.
#[derive(Clone)]
struct Point {
    at: Vec<f64>,
    value: f64,
    next: Vec<f64>,
}

/// EM from one start.
struct Search<'m, 'p, M> {
    model: &'m mut M,
    passes: &'m mut Passes<'p>,
    rows: usize,
    forward_passes: usize,
    backward_passes: usize,
}

impl<M: Model> Search<'_, '_, M> {
    /// L(θ); infinite where the filter fails.
    fn value(&mut self, at: &[f64]) -> Result<f64, PassError> {
        let variances: Vec<f64> = at.iter().map(|log| log.exp()).collect();
        self.model.set_variances(&variances);
        self.forward_passes += 1;
        match self.passes.forward(self.model) {
            Ok(fit) => {
                self.rows = fit.rows();
                let value = fit.negative_log_likelihood();
                Ok(if value.is_finite() { value } else { f64::INFINITY })
            }
            Err(PassError::Update { .. } | PassError::Step { .. }) => Ok(f64::INFINITY),
            Err(error) => Err(error),
        }
    }

    /// The rest of the evaluation at the θ that [`Search::value`] was called with last.
    fn point(&mut self, at: Vec<f64>, value: f64) -> Result<Point, PassError> {
        self.backward_passes += 1;
        let sums = self.passes.backward_learning(self.model, |_| ())?;
        Ok(Point { at, value, next: maximize(self.model, &sums) })
    }

    /// A step of EM that does not raise L; `None` if there is none.
    fn plain(&mut self, from: &Point) -> Result<Option<(Point, bool)>, PassError> {
        let mut to = from.next.clone();
        for halving in 0..=HALVINGS {
            let value = self.value(&to)?;
            if value <= from.value {
                return Ok(Some((self.point(to, value)?, halving == 0)));
            }
            to.iter_mut().zip(&from.at).for_each(|(to, from)| *to = 0.5 * (*to + from));
        }
        Ok(None)
    }

    /// θ' of the scheme, within the bounds. `longest` is the largest −α.
    fn extrapolate(&self, first: &Point, second: &Point, longest: f64) -> Option<(Vec<f64>, f64)> {
        // (ln 0, of variances that stay 0, does not change.)
        let difference = |b: f64, a: f64| if a == b { 0.0 } else { b - a };
        let r: Vec<f64> = second.at.iter().zip(&first.at).map(|(b, a)| difference(*b, *a)).collect();
        let v: Vec<f64> =
            second.next.iter().zip(&second.at).zip(&r).map(|((c, b), r)| difference(*c, *b) - r).collect();
        let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let length = (norm(&r) / norm(&v)).min(longest);
        // At a length of 1 θ' is the next step of EM.
        if length.is_nan() || length <= 1.0 {
            return None;
        }
        let jump = first.at.iter().zip(&r).zip(&v).zip(self.model.parameters()).map(|(((at, r), v), parameter)| {
            let to = at + 2.0 * length * r + length * length * v;
            if parameter.learned { to.clamp(parameter.bounds[0].ln(), parameter.bounds[1].ln()) } else { *at }
        });
        Some((jump.collect(), length))
    }
}

fn learn_once<M: Model>(model: &mut M, passes: &mut Passes<'_>, options: &EmOptions) -> Result<EmReport, PassError> {
    let epochs = model.epochs();
    let start = variances(model);
    passes.expect(model, 2 * options.evaluations);
    let mut search = Search { model, passes, rows: 0, forward_passes: 0, backward_passes: 0 };

    let at: Vec<f64> = start.iter().map(|variance| variance.ln()).collect();
    // The start itself has to work, or its error is the answer.
    let fit = search.passes.forward(search.model)?;
    search.forward_passes = 1;
    search.rows = fit.rows();
    let mut current = search.point(at, fit.negative_log_likelihood())?;
    let step = |point: &Point, accelerated| EmStep {
        variances: point.at.iter().map(|log| log.exp()).collect(),
        negative_log_likelihood: point.value,
        accelerated,
    };
    let mut history = vec![EmStep { variances: start.clone(), ..step(&current, false) }];
    let (mut converged, mut longest) = (false, 4.0);
    while !converged && search.backward_passes < options.evaluations {
        let Some((second, whole)) = search.plain(&current)? else {
            // Not even a small step lowers L: this is as low as it gets.
            converged = true;
            break;
        };
        history.push(step(&second, false));
        search.passes.reach(history.len() - 1, 2.0 * second.value);
        let change = second.at.iter().zip(&current.at).map(|(b, a)| (b - a).abs()).fold(0.0, f64::max);
        let before = current.value;
        let mut latest = second;
        if options.accelerate
            && whole
            && change > options.change
            && search.backward_passes < options.evaluations
            && let Some((to, length)) = search.extrapolate(&current, &latest, longest)
        {
            let value = search.value(&to)?;
            if value < latest.value {
                latest = search.point(to, value)?;
                history.push(step(&latest, true));
                longest = if length == longest { 4.0 * longest } else { longest };
            } else {
                longest = (longest / 4.0).max(2.0);
            }
        }
        converged = before - latest.value <= options.decrease * search.rows as f64 || change <= options.change;
        current = latest;
    }
    let end = history.last().map_or_else(|| start.clone(), |step| step.variances.clone());
    search.model.set_variances(&end);
    let Search { forward_passes, backward_passes, .. } = search;
    passes.spare((2 * options.evaluations).saturating_sub(forward_passes + backward_passes) * epochs);
    let ends = vec![current.value];
    Ok(EmReport { start, end, history, forward_passes, backward_passes, converged, ends })
}

#[cfg(test)]
mod tests {
    use super::super::batch::random;
    use super::*;
    use proptest::prelude::*;
    use surefix_core::filter::update::Form;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn the_likelihood_never_falls(seed: u64, accelerate: bool) {
            let mut model = random(seed, 30);
            model.form = Form::Joseph;
            let options = EmOptions { accelerate, ..EmOptions::default() };
            let report = learn(&mut model, &mut Passes::new(PassOptions::default()), &options).unwrap();
            let values: Vec<f64> = report.history.iter().map(|step| step.negative_log_likelihood).collect();
            prop_assert!(values.is_sorted_by(|a, b| a >= b), "{:?}", values);
            for (parameter, &end) in model.parameters().iter().zip(&report.end) {
                prop_assert!(parameter.variance == end && (parameter.bounds[0]..=parameter.bounds[1]).contains(&end));
            }
        }

        #[test]
        fn sums_of_two_spans_add(a in proptest::collection::vec(0.0..9.0, 6), b in proptest::collection::vec(0.0..9.0, 6)) {
            let sums = |x: &[f64]| {
                let mut sums = Sums::new(2);
                (0..2).for_each(|j| { sums.add(j, x[3 * j], x[3 * j + 1]); sums.add_log_determinant(j, x[3 * j + 2]); });
                sums
            };
            let mut merged = sums(&a);
            merged.merge(&sums(&b));
            let together: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + b).collect();
            prop_assert_eq!(merged, sums(&together));
        }
    }

    /// Greiff's remark: far fewer evaluations, the same end.
    #[test]
    fn acceleration_ends_no_worse_with_fewer_passes() {
        let run = |accelerate| {
            let mut model = random(3, 400);
            model.set_variances(&[1e-3, 30.0, 5.0]);
            let options = EmOptions { accelerate, evaluations: 400, ..EmOptions::default() };
            learn(&mut model, &mut Passes::new(PassOptions::default()), &options).unwrap()
        };
        let (plain, fast) = (run(false), run(true));
        assert!(plain.converged && fast.converged, "{plain:?} {fast:?}");
        assert!(fast.best() < plain.best() + 0.05, "{} {}", fast.best(), plain.best());
        assert!(fast.forward_passes < plain.forward_passes, "{} {}", fast.forward_passes, plain.forward_passes);
    }

    #[test]
    fn of_several_starts_the_best_counts_and_what_is_not_learned_stays() {
        let mut model = random(3, 200);
        let before = variances(&model);
        let mut single = model.clone();
        let once = learn(&mut single, &mut Passes::new(PassOptions::default()), &EmOptions::default()).unwrap();
        let options = EmOptions { starts: vec![vec![0.01], vec![100.0, 1.0, 0.1]], ..EmOptions::default() };
        let report = learn(&mut model, &mut Passes::new(PassOptions::default()), &options).unwrap();
        assert_eq!((report.ends.len(), &report.start), (3, &before));
        assert!(report.best() <= once.best() && report.ends.iter().all(|&end| end >= report.best()));
        assert_eq!(variances(&model), report.end);
    }
}
