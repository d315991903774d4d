//! Integers on a posterior.
//!
//! Ambiguities do not change over a span of epochs that share their states, so one density speaks for all of it: the
//! smoothed one in its middle, or the filtered one at its end, which knows most. There the integers are resolved jointly,
//! the least certain left out until success rate and ratio are accepted. Arc by arc, a pair of clusters is merged if every
//! span that accepted an integer for it agrees; then the next round finds fewer states and smaller covariances. Epoch by
//! epoch ([`ByEpoch`]), each answer is conditioned on the integers that its own density accepts, and on no others.
//!
//! With bootstrapping there is no second candidate, hence no ratio: the success rate alone decides.

use super::answer::ambiguities;
use super::model::RtkModel;
use super::report::ArcCount;
use crate::smooth::integers::{Scope, Search, Source};
use crate::smooth::model::{Density, Integer, Model};
use crate::smooth::pass::Epoch;
use std::collections::{BTreeMap, BTreeSet};
use surefix_core::integer::{self, Config, IntegerError, Method, Workspace, condition};
use surefix_core::linalg::{Mat, MatMut};
use surefix_core::rtk::config::Acceptance;

/// Most ambiguities resolved at a time.
const CAPACITY: usize = 64;
/// Most sets tried for one density: the least certain eighth is left out each time.
const SETS: usize = 16;

/// By how much the ratio must exceed the engine's: covariances depend on noise that was learned from the same data.
const STRICTER: f64 = 0.5;

/// How integers are fixed. What a set has to satisfy is the engine's [`Acceptance`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fixing {
    /// The density whose ambiguities are fixed.
    pub source: Source,
    /// What gets one value.
    pub scope: Scope,
    /// How integers are found.
    pub search: Search,
}

impl Fixing {
    /// The density of an epoch that is fixed.
    fn density(self, epoch: Epoch<'_>) -> &Density {
        match self.source {
            Source::Filter => epoch.filtered,
            Source::Smoother => epoch.smoothed,
        }
    }
}

/// The ambiguities of one density, those of the smallest variance first.
struct Sample {
    /// Fewest that may be fixed.
    least: usize,
    integers: Vec<Integer>,
    float: Vec<f64>,
    covariance: Vec<f64>,
}

/// Densities of ambiguities, one for each span of epochs that share their states.
pub struct Samples {
    fixing: Fixing,
    /// Epochs at which to take one, the latest last.
    epochs: Vec<usize>,
    samples: Vec<Sample>,
}

impl Samples {
    /// None yet.
    pub fn new(model: &RtkModel<'_>, fixing: Fixing) -> Self {
        let best = |[first, last]: [usize; 2]| match fixing.source {
            Source::Filter => last,
            Source::Smoother => first.midpoint(last),
        };
        let epochs = model.layouts().spans().into_iter().map(best).collect();
        Self { fixing, epochs, samples: Vec::new() }
    }

    /// Takes that of an epoch, if it is one of those wanted. Epochs come from the last to the first.
    pub fn take(&mut self, model: &RtkModel<'_>, epoch: Epoch<'_>) {
        if self.epochs.pop_if(|wanted| *wanted == epoch.k).is_some() {
            self.samples.extend(Sample::new(model, epoch.k, self.fixing.density(epoch)));
        }
    }

    /// Fixes what is accepted; returns how many states are gone by it.
    pub fn fix(&self, model: &mut RtkModel<'_>) -> usize {
        let acceptance = model.tape().config().acceptance;
        let mut workspace: Box<Workspace<f64, CAPACITY>> = Box::default();
        // Of each pair the integer, or none once two spans differ.
        let mut votes: BTreeMap<usize, Option<i64>> = BTreeMap::new();
        for sample in &self.samples {
            let Some(values) = sample.resolve(&acceptance, self.fixing.search, &mut workspace) else { continue };
            for (integer, &value) in sample.integers.iter().zip(&values) {
                let vote = votes.entry(integer.arc).or_insert(Some(value));
                *vote = vote.filter(|&other| other == value);
            }
        }
        let accepted = votes.into_iter().filter_map(|(arc, value)| Some((Integer { state: 0, arc }, value? as f64)));
        let (integers, values): (Vec<Integer>, Vec<f64>) = accepted.unzip();
        model.fix(0, &integers, &values);
        model.settle();
        integers.len()
    }
}

impl Sample {
    /// That of an epoch; `None` without ambiguities.
    fn new(model: &RtkModel<'_>, epoch: usize, density: &Density) -> Option<Self> {
        let mut integers = Vec::new();
        model.integers(epoch, &mut integers);
        let variance = |integer: &Integer| density.covariance(integer.state, integer.state);
        integers.sort_by(|a, b| variance(a).total_cmp(&variance(b)));
        integers.truncate(CAPACITY);
        if integers.is_empty() {
            return None;
        }
        let float = integers.iter().map(|integer| density.mean[integer.state]).collect();
        let pairs = integers.iter().flat_map(|a| integers.iter().map(move |b| (a.state, b.state)));
        let covariance = pairs.map(|(i, j)| density.covariance(i, j)).collect();
        // Where a position is fixed already, it proves single integers; else they have to prove each other.
        let acceptance = &model.tape().config().acceptance;
        let fixed = ambiguities(model, epoch, &[])[1] > acceptance.min_ambiguities;
        let least = if fixed { 1 } else { acceptance.min_ambiguities + 1 };
        Some(Self { least, integers, float, covariance })
    }

    /// The integers of the largest set that is accepted, from the first on.
    fn resolve(
        &self,
        acceptance: &Acceptance,
        search: Search,
        workspace: &mut Workspace<f64, CAPACITY>,
    ) -> Option<Vec<i64>> {
        // A search without nodes leaves bootstrapping.
        let config = match search {
            Search::LeastSquares => Config::default(),
            Search::Bootstrapping => Config { budget: 0 },
        };
        let stride = self.integers.len();
        let mut m = stride;
        if m < self.least {
            return None;
        }
        for _ in 0..SETS {
            let q = Mat::new(&self.covariance, m, m, stride).ok()?;
            if let Ok(resolution) = integer::resolve(&self.float[..m], q, &config, workspace) {
                // Where floats are farther from integers than their covariance says, it is too small.
                let factor = (resolution.best_norm / m as f64).max(1.0);
                let variances: Vec<f64> = resolution.variances.iter().map(|variance| variance * factor).collect();
                let success = integer::success_rate::bootstrapped(&variances).success;
                let proven = search == Search::Bootstrapping
                    || (resolution.method == Method::LeastSquares && resolution.ratio >= acceptance.ratio + STRICTER);
                if success >= acceptance.success_rate && proven {
                    return Some(resolution.best.to_vec());
                }
            }
            m -= (m / 8).max(1);
            if m < self.least {
                break;
            }
        }
        None
    }
}

/// Integers epoch by epoch: none helps another epoch.
pub struct ByEpoch {
    fixing: Fixing,
    workspace: Box<Workspace<f64, CAPACITY>>,
    /// Of each pair the first value, and whether all others are the same.
    values: BTreeMap<usize, (i64, bool)>,
    /// Arcs that were fixed in some epoch.
    arcs: BTreeSet<usize>,
}

impl ByEpoch {
    /// None yet.
    pub fn new(fixing: Fixing) -> Self {
        Self { fixing, workspace: Box::default(), values: BTreeMap::new(), arcs: BTreeSet::new() }
    }

    /// The smoothed motion of an epoch, given the integers that its density accepts, and these.
    pub fn condition(&mut self, model: &RtkModel<'_>, epoch: Epoch<'_>) -> (Density, Vec<Integer>) {
        let motion = model.tape().config().motion.states();
        let sample = Sample::new(model, epoch.k, self.fixing.density(epoch));
        let acceptance = &model.tape().config().acceptance;
        let found = sample.and_then(|sample| {
            let values = sample.resolve(acceptance, self.fixing.search, &mut self.workspace)?;
            let mut integers = sample.integers;
            integers.truncate(values.len());
            let density = given(epoch.smoothed, motion, &integers, &values).ok()?;
            Some((density, integers, values))
        });
        let Some((density, integers, values)) = found else { return (epoch.smoothed.clone(), Vec::new()) };
        for (integer, &value) in integers.iter().zip(&values) {
            let (first, same) = self.values.entry(integer.arc).or_insert((value, true));
            *same &= *first == value;
            self.arcs.extend(model.layouts().pairs[integer.arc]);
        }
        (density, integers)
    }

    /// Counts arcs by what became of them. Pairs with another value in another epoch are contradictory.
    pub fn count(&self, model: &RtkModel<'_>) -> ArcCount {
        let contradictory = self.values.values().filter(|(_, same)| !same).count();
        tally(model, |arc| self.arcs.contains(&arc), contradictory)
    }
}

/// The first `motion` states of a density, given that some of the others have these values.
fn given(density: &Density, motion: usize, integers: &[Integer], values: &[i64]) -> Result<Density, IntegerError> {
    // A dense copy of both: of the density the lower triangle counts.
    let states: Vec<usize> = (0..motion).chain(integers.iter().map(|integer| integer.state)).collect();
    let (n, m) = (states.len(), integers.len());
    let mean: Vec<f64> = states.iter().map(|&i| density.mean[i]).collect();
    let pairs = states.iter().flat_map(|&i| states.iter().map(move |&j| (i, j)));
    let covariance: Vec<f64> = pairs.map(|(i, j)| density.covariance(i, j)).collect();
    let values: Vec<f64> = values.iter().map(|&value| value as f64).collect();
    let places: Vec<usize> = (0..n).collect();
    let (of_motion, of_integers) = places.split_at(motion);
    let (mut factor, mut cross, mut residual) = (vec![0.0; m * m], vec![0.0; m * motion], vec![0.0; m]);
    let mut result = Density::default();
    result.reset(motion);
    condition::condition_on_integers(
        &mean,
        Mat::square(&covariance, n)?,
        of_motion,
        of_integers,
        &values,
        &mut MatMut::square(&mut factor, m)?,
        &mut MatMut::new(&mut cross, m, motion, motion)?,
        &mut residual,
        &mut result.mean,
        &mut MatMut::square(&mut result.covariance, motion)?,
    )?;
    Ok(result)
}

/// Counts arcs by what became of them, where they are fixed as a whole.
pub fn count(model: &RtkModel<'_>) -> ArcCount {
    tally(model, |arc| model.clusters().size(arc) > 1, model.contradictions())
}

fn tally(model: &RtkModel<'_>, is_fixed: impl Fn(usize) -> bool, contradictory: usize) -> ArcCount {
    let arcs = model.tape().arcs();
    let mut count = ArcCount { total: arcs.len(), contradictory, ..ArcCount::default() };
    let mut usable = vec![false; arcs.len()];
    for epoch in 0..model.tape().epochs().len() {
        if ambiguities(model, epoch, &[])[0] > 0 {
            model.tape().links(epoch).iter().filter(|link| !link.phase.is_nan()).for_each(|link| {
                usable[link.arc as usize] = true;
            });
        }
    }
    for (i, arc) in arcs.iter().enumerate() {
        if is_fixed(i) {
            count.fixed += 1;
        } else if arc.integer && usable[i] {
            count.refused += 1;
        } else {
            count.float_by_nature += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::super::tests::{drive, model};
    use super::*;

    fn sample(least: usize, float: &[f64], variances: &[f64]) -> Sample {
        let n = float.len();
        let covariance = (0..n * n).map(|i| if i % (n + 1) == 0 { variances[i / n] } else { 0.0 }).collect();
        let integers = (0..n).map(|i| Integer { state: i, arc: i }).collect();
        Sample { least, integers, float: float.to_vec(), covariance }
    }

    const SEARCHES: [Search; 2] = [Search::LeastSquares, Search::Bootstrapping];

    /// σ of 0.01 cycles: bootstrapping succeeds but once in 10^500; of 0.5 cycles, two times in three.
    #[test]
    fn the_least_certain_are_left_out_until_the_rest_is_certain_enough() {
        let mut workspace: Box<Workspace<f64, CAPACITY>> = Box::default();
        let acceptance = Acceptance::default();
        let (float, variances) = ([3.01, -7.0, 12.99, 5.01, 0.4], [1e-4, 1e-4, 1e-4, 1e-4, 0.25]);
        for search in SEARCHES {
            let found = sample(4, &float, &variances).resolve(&acceptance, search, &mut workspace);
            assert_eq!(found.as_deref(), Some(&[3, -7, 13, 5][..]), "{search:?}");
            assert_eq!(sample(5, &float, &variances).resolve(&acceptance, search, &mut workspace), None, "{search:?}");
            assert_eq!(sample(6, &float, &variances).resolve(&acceptance, search, &mut workspace), None, "{search:?}");
        }
    }

    /// σ of 0.1 cycles: rounding fails five times in ten million, P = 2 Φ(−5) = 5.7e-7.
    #[test]
    fn the_success_rate_decides_for_both_searches_and_the_ratio_for_one() {
        let mut workspace: Box<Workspace<f64, CAPACITY>> = Box::default();
        let sample = sample(1, &[4.01], &[0.01]);
        let mut resolve = |success_rate, ratio, search| {
            let acceptance = Acceptance { success_rate, ratio, ..Acceptance::default() };
            sample.resolve(&acceptance, search, &mut workspace)
        };
        for search in SEARCHES {
            assert_eq!(resolve(1.0 - 6e-7, 3.0, search), Some(vec![4]), "{search:?}");
            assert_eq!(resolve(1.0 - 5e-7, 3.0, search), None, "{search:?}");
        }
        // The second candidate is 0.99 cycles off, 9801 times as far as the first by its square.
        assert_eq!(resolve(0.999, 9801.0 - STRICTER - 1.0, Search::LeastSquares), Some(vec![4]));
        assert_eq!(resolve(0.999, 9801.0, Search::LeastSquares), None);
        assert_eq!(resolve(0.999, 9801.0, Search::Bootstrapping), Some(vec![4]));
    }

    /// Floats 0.3 cycles off by a σ of 0.01 tell of a covariance that is too small by 900.
    #[test]
    fn floats_far_from_integers_are_not_believed() {
        let mut workspace: Box<Workspace<f64, CAPACITY>> = Box::default();
        let acceptance = Acceptance { ratio: 1.0, ..Acceptance::default() };
        for search in SEARCHES {
            let far = sample(2, &[3.3, 7.3], &[1e-4; 2]);
            assert_eq!(far.resolve(&acceptance, search, &mut workspace), None, "{search:?}");
        }
    }

    /// A density of an epoch whose ambiguities all have this mean, with a σ of 0.01 cycles, known to go with the first state.
    fn density(model: &RtkModel<'_>, epoch: usize, ambiguity: f64) -> Density {
        let mut density = Density::default();
        let n = model.states(epoch);
        density.reset(n);
        (0..n).for_each(|i| density.covariance[i * n + i] = 1e-4);
        let mut integers = Vec::new();
        model.integers(epoch, &mut integers);
        integers.iter().for_each(|integer| density.mean[integer.state] = ambiguity);
        density
    }

    #[test]
    fn samples_are_of_the_density_asked_for_where_it_knows_most() {
        let (tape, _) = drive(20.0);
        for (source, value) in [(Source::Filter, 5.0), (Source::Smoother, 7.0)] {
            let mut model = model(&tape);
            let mut samples = Samples::new(&model, Fixing { source, ..Fixing::default() });
            let spans = model.layouts().spans();
            let expected: Vec<usize> = match source {
                Source::Filter => spans.iter().map(|span| span[1]).collect(),
                Source::Smoother => spans.iter().map(|[first, last]| (first + last) / 2).collect(),
            };
            assert_eq!(samples.epochs, expected);
            for k in (0..model.epochs()).rev() {
                let (filtered, smoothed) = (density(&model, k, 5.01), density(&model, k, 7.01));
                samples.take(&model, Epoch { k, filtered: &filtered, smoothed: &smoothed });
            }
            assert_eq!(samples.samples.len(), spans.len());
            let pairs = model.layouts().pairs.clone();
            assert!(samples.fix(&mut model) > 4);
            let differences = pairs.iter().map(|&[cluster, reference]| {
                let [(a, d_a), (b, d_b)] = [cluster, reference].map(|arc| model.clusters().find(arc));
                (a == b).then_some(d_a - d_b)
            });
            let known: Vec<f64> = differences.flatten().collect();
            assert!(known.len() > 4 && known.iter().all(|&difference| difference == value), "{source:?}: {known:?}");
        }
    }

    /// Two spans that differ, as by a slip that no one saw: the pair stays float, all others are fixed.
    #[test]
    fn a_pair_on_which_spans_differ_is_left_float() {
        let (tape, _) = drive(5.0);
        let mut model = model(&tape);
        let integers: Vec<Integer> = {
            let mut list = Vec::new();
            model.integers(0, &mut list);
            list
        };
        let of = |last: f64| {
            let n = integers.len();
            let mut float = vec![2.0; n];
            float[n - 1] = last;
            Sample { integers: integers.clone(), ..sample(1, &float, &vec![1e-4; n]) }
        };
        let samples = Samples { fixing: Fixing::default(), epochs: Vec::new(), samples: vec![of(2.0), of(3.0)] };
        let states = model.states(0);
        assert_eq!(samples.fix(&mut model), integers.len() - 1);
        assert_eq!(model.states(0), states - integers.len() + 1);
        assert_eq!(count(&model).contradictory, 0);
    }

    /// x | n for correlated x and n: x − ρ σ_x/σ_n (n̂ − n), variance σ_x² (1 − ρ²).
    #[test]
    fn an_epoch_is_conditioned_on_its_own_integers_and_no_other_epoch_is() {
        let (tape, _) = drive(10.0);
        let model = model(&tape);
        let mut by_epoch = ByEpoch::new(Fixing { scope: Scope::Epoch, ..Fixing::default() });
        let floating = density(&model, 3, 5.0);
        let mut known = floating.clone();
        let mut integers = Vec::new();
        model.integers(3, &mut integers);
        let (n, first) = (known.dim(), integers[0].state);
        known.mean[first] = 5.02;
        known.covariance[first * n] = 0.5e-4; // ρ = 0.5 with the first state
        let (density, fixed) = by_epoch.condition(&model, Epoch { k: 3, filtered: &floating, smoothed: &known });
        assert_eq!((density.dim(), fixed.len()), (6, integers.len()));
        assert!((density.mean[0] + 0.5 * 0.02).abs() < 1e-12 && density.mean[1] == 0.0, "{:?}", density.mean);
        assert!((density.covariance(0, 0) - 0.75e-4).abs() < 1e-16 && density.covariance(1, 1) == 1e-4);
        assert_eq!(model.states(3), n, "the model keeps its states");
        let all = by_epoch.count(&model);
        assert!(all.fixed > 4 && all.refused == 0 && all.contradictory == 0, "{all:?}");
        // Another integer in another epoch.
        known.mean[first] = 6.0;
        by_epoch.condition(&model, Epoch { k: 3, filtered: &floating, smoothed: &known });
        assert_eq!(by_epoch.count(&model), ArcCount { contradictory: 1, ..all });
        // Nothing known: nothing fixed, the density as it was.
        (0..n).for_each(|i| known.covariance[i * n + i] = 1.0);
        let (density, fixed) = by_epoch.condition(&model, Epoch { k: 3, filtered: &floating, smoothed: &known });
        assert_eq!((&density, fixed.len()), (&known, 0));
    }
}
