//! Integers on the smoothing posterior.
//!
//! Ambiguities do not change over a span of epochs that share their states, so one density in its middle speaks for all of
//! it. There the integers are resolved jointly, the least certain left out until success rate and ratio are accepted.
//! A pair of clusters is merged if every span that accepted an integer for it agrees; then the next round finds fewer
//! states and smaller covariances.

use super::answer::ambiguities;
use super::model::RtkModel;
use super::report::ArcCount;
use crate::smooth::model::{Density, Integer, Model};
use std::collections::BTreeMap;
use surefix_core::integer::{self, Config, Method, Workspace};
use surefix_core::linalg::Mat;
use surefix_core::rtk::config::Acceptance;

/// Most ambiguities resolved at a time.
const CAPACITY: usize = 64;
/// Most sets tried for one density: the least certain eighth is left out each time.
const SETS: usize = 16;

/// By how much the ratio must exceed the engine's: covariances depend on noise that was learned from the same data.
const STRICTER: f64 = 0.5;

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
    /// Epochs at which to take one, the latest last.
    epochs: Vec<usize>,
    samples: Vec<Sample>,
    list: Vec<Integer>,
}

impl Samples {
    /// None yet.
    pub fn new(model: &RtkModel<'_>) -> Self {
        let epochs = model.layouts().spans().into_iter().map(|[first, last]| first.midpoint(last)).collect();
        Self { epochs, samples: Vec::new(), list: Vec::new() }
    }

    /// Takes that of an epoch, if it is one of those wanted. Epochs come from the last to the first.
    pub fn take(&mut self, model: &RtkModel<'_>, epoch: usize, smoothed: &Density) {
        if self.epochs.pop_if(|wanted| *wanted == epoch).is_none() {
            return;
        }
        model.integers(epoch, &mut self.list);
        let variance = |integer: &Integer| smoothed.covariance(integer.state, integer.state);
        self.list.sort_by(|a, b| variance(a).total_cmp(&variance(b)));
        self.list.truncate(CAPACITY);
        if self.list.is_empty() {
            return;
        }
        let float = self.list.iter().map(|integer| smoothed.mean[integer.state]).collect();
        let pairs = self.list.iter().flat_map(|a| self.list.iter().map(move |b| (a.state, b.state)));
        let covariance = pairs.map(|(i, j)| smoothed.covariance(i, j)).collect();
        // Where a position is fixed already, it proves single integers; else they have to prove each other.
        let acceptance = &model.tape().config().acceptance;
        let least =
            if ambiguities(model, epoch)[1] > acceptance.min_ambiguities { 1 } else { acceptance.min_ambiguities + 1 };
        self.samples.push(Sample { least, integers: self.list.clone(), float, covariance });
    }

    /// Fixes what is accepted; returns how many states are gone by it.
    pub fn fix(&self, model: &mut RtkModel<'_>) -> usize {
        let acceptance = model.tape().config().acceptance;
        let mut workspace: Box<Workspace<f64, CAPACITY>> = Box::default();
        // Of each pair the integer, or none once two spans differ.
        let mut votes: BTreeMap<usize, Option<i64>> = BTreeMap::new();
        for sample in &self.samples {
            let Some(values) = sample.resolve(&acceptance, &mut workspace) else { continue };
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
    /// The integers of the largest set that is accepted, from the first on.
    fn resolve(&self, acceptance: &Acceptance, workspace: &mut Workspace<f64, CAPACITY>) -> Option<Vec<i64>> {
        let stride = self.integers.len();
        let mut m = stride;
        if m < self.least {
            return None;
        }
        for _ in 0..SETS {
            let q = Mat::new(&self.covariance, m, m, stride).ok()?;
            if let Ok(resolution) = integer::resolve(&self.float[..m], q, &Config::default(), workspace) {
                // Where floats are farther from integers than their covariance says, it is too small.
                let factor = (resolution.best_norm / m as f64).max(1.0);
                let variances: Vec<f64> = resolution.variances.iter().map(|variance| variance * factor).collect();
                let success = integer::success_rate::bootstrapped(&variances).success;
                if success >= acceptance.success_rate
                    && resolution.ratio >= acceptance.ratio + STRICTER
                    && resolution.method == Method::LeastSquares
                {
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

/// Counts arcs by what became of them.
pub fn count(model: &RtkModel<'_>) -> ArcCount {
    let arcs = model.tape().arcs();
    let mut count = ArcCount { total: arcs.len(), contradictory: model.contradictions(), ..ArcCount::default() };
    let mut usable = vec![false; arcs.len()];
    for epoch in 0..model.tape().epochs().len() {
        if ambiguities(model, epoch)[0] > 0 {
            model.tape().links(epoch).iter().filter(|link| !link.phase.is_nan()).for_each(|link| {
                usable[link.arc as usize] = true;
            });
        }
    }
    for (i, arc) in arcs.iter().enumerate() {
        if model.clusters().size(i) > 1 {
            count.fixed += 1;
        } else if arc.integer && usable[i] {
            count.refused += 1;
        } else {
            count.float_by_nature += 1;
        }
    }
    count
}
