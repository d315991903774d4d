//! Integers from the filtering or the smoothing posterior, epoch by epoch or arc by arc.
//!
//! Greiff et al. (2023), sec. 4.2: the ambiguities of an epoch with their covariance go to integer least squares or to
//! bootstrapping. A set whose success rate is too low loses its least certain ambiguity until the rest is good enough
//! (partial fixing).
//!
//! Arc by arc, every epoch still votes: the value of an arc is that of the epoch which knows it best, and only if the
//! epochs agree. An arc along which the integer changes hides a slip that no one saw; joint fixing over it would do more
//! harm than none, so it is left float and counted.

use super::model::{Density, Integer, Model};
use super::pass::Epoch;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use surefix_core::integer::accept::{Decision, Thresholds};
use surefix_core::integer::resolve::{Config, Method, Workspace, resolve};
use surefix_core::integer::success_rate::{self, Probability};
use surefix_core::integer::{IntegerError, bootstrap, decorrelate};
use surefix_core::linalg::{Mat, MatMut};

/// Most ambiguities of an epoch; of more, the least certain stay float.
pub const CAPACITY: usize = 96;

/// The density whose ambiguities are fixed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// Given the measurements up to the epoch.
    Filter,
    /// Given all measurements.
    #[default]
    Smoother,
}

/// What gets one value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// An ambiguity of an epoch.
    Epoch,
    /// An ambiguity from birth or slip to the next.
    #[default]
    Arc,
}

/// How integers are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Search {
    /// Integer least squares.
    #[default]
    LeastSquares,
    /// Sequential rounding after decorrelation, the last and most precise first.
    Bootstrapping,
}

/// What is fixed, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegerOptions {
    /// The density whose ambiguities are fixed.
    pub source: Source,
    /// What gets one value.
    pub scope: Scope,
    /// How integers are found.
    pub search: Search,
    /// What a set has to satisfy; `None` accepts all there are, as the paper does. (Of bootstrapped integers, only the
    /// success rate is tested.)
    pub thresholds: Option<Thresholds>,
    /// Fewest ambiguities that are fixed together.
    pub fewest: usize,
    /// Share of the epochs of an arc that have to agree on its value (default 1).
    pub agreement: f64,
}

impl Default for IntegerOptions {
    fn default() -> Self {
        let (source, scope, search) = Default::default();
        Self { source, scope, search, thresholds: Some(Thresholds::default()), fewest: 4, agreement: 1.0 }
    }
}

impl IntegerOptions {
    /// As in the paper: every epoch by itself, whatever its success rate.
    pub fn paper(source: Source, search: Search) -> Self {
        Self { source, scope: Scope::Epoch, search, thresholds: None, fewest: 1, agreement: 1.0 }
    }
}

/// What came of fixing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IntegerReport {
    /// Epochs with ambiguities that were not yet fixed.
    pub epochs: usize,
    /// Of these, those where all were fixed by their own density.
    pub whole: usize,
    /// Of these, those where some were.
    pub partial: usize,
    /// Arcs seen; 0 where epochs are fixed by themselves.
    pub arcs: usize,
    /// Arcs that were fixed.
    pub fixed_arcs: usize,
    /// Arcs left float because their epochs do not agree.
    pub torn_arcs: usize,
    /// Values that contradict what was fixed before, by the model's count.
    pub contradictions: usize,
}

impl IntegerReport {
    /// Whether anything was fixed.
    pub fn found(&self) -> bool {
        if self.arcs > 0 { self.fixed_arcs > 0 } else { self.whole + self.partial > 0 }
    }
}

/// Memory for the ambiguities of one epoch.
#[derive(Debug)]
struct Resolver {
    options: IntegerOptions,
    workspace: Box<Workspace<f64, CAPACITY>>,
    mean: Vec<f64>,
    covariance: Vec<f64>,
    values: Vec<i64>,
}

impl Resolver {
    /// Leaves in `integers` those that may be fixed, and returns their values.
    fn resolve(&mut self, density: &Density, integers: &mut Vec<Integer>) -> &[i64] {
        let variance = |integer: &Integer| density.covariance(integer.state, integer.state);
        // The least certain goes first, wherever it stands.
        let drop_worst = |integers: &mut Vec<Integer>| {
            let worst = (0..integers.len()).max_by(|&a, &b| variance(&integers[a]).total_cmp(&variance(&integers[b])));
            worst.map(|worst| integers.remove(worst));
        };
        while integers.len() > CAPACITY {
            drop_worst(integers);
        }
        while integers.len() >= self.options.fewest.max(1) {
            if self.accepts(density, integers) {
                return &self.values;
            }
            drop_worst(integers);
        }
        integers.clear();
        &[]
    }

    /// Finds the values of a set; whether they are acceptable.
    fn accepts(&mut self, density: &Density, integers: &[Integer]) -> bool {
        self.mean.clear();
        self.mean.extend(integers.iter().map(|integer| density.mean[integer.state]));
        self.covariance.clear();
        for a in integers {
            self.covariance.extend(integers.iter().map(|b| density.covariance(a.state, b.state)));
        }
        match self.options.search {
            Search::LeastSquares => self.least_squares(),
            Search::Bootstrapping => self.bootstrapping(),
        }
        .unwrap_or(false)
    }

    fn least_squares(&mut self) -> Result<bool, IntegerError> {
        let q = Mat::square(&self.covariance, self.mean.len())?;
        let found = resolve(&self.mean, q, &Config::default(), &mut self.workspace)?;
        self.values.clear();
        self.values.extend_from_slice(found.best);
        Ok(self.options.thresholds.is_none_or(|thresholds| found.decide(&thresholds) == Decision::Accepted))
    }

    fn bootstrapping(&mut self) -> Result<bool, IntegerError> {
        let success = bootstrap_decorrelated(&self.mean, &mut self.covariance, &mut self.values)?;
        let only_success = |thresholds: Thresholds| {
            let lenient = Thresholds { ratio: 0.0, difference: f64::NEG_INFINITY, ..thresholds };
            lenient.decide(success, Method::LeastSquares, 0.0, 1.0) == Decision::Accepted
        };
        Ok(self.options.thresholds.is_none_or(only_success))
    }
}

/// Bootstrapping after decorrelation: the integers of `mean` (n) into `values`, and its success rate. The `covariance`
/// (n × n) is spoilt.
pub fn bootstrap_decorrelated(
    mean: &[f64],
    covariance: &mut [f64],
    values: &mut Vec<i64>,
) -> Result<Probability, IntegerError> {
    let n = mean.len();
    let (mut d, mut z, mut inverse) = (vec![0.0; n], vec![0; n * n], vec![0; n * n]);
    let mut factor = MatMut::square(covariance, n)?;
    let mut to_inverse = MatMut::square(&mut inverse, n)?;
    decorrelate::decorrelate(&mut factor, &mut d, &mut MatMut::square(&mut z, n)?, &mut to_inverse)?;
    // Fractions only: 1e7 cycles would cost digits.
    values.clear();
    values.extend(mean.iter().map(|mean| mean.round() as i64));
    let fraction: Vec<f64> = mean.iter().map(|mean| mean - mean.round()).collect();
    let (mut reduced, mut residual, mut rounded) = (vec![0.0; n], vec![0.0; n], vec![0; n]);
    decorrelate::transform(Mat::square(&z, n)?, &fraction, &mut reduced)?;
    bootstrap::bootstrap(&reduced, factor.as_ref(), &d, &mut rounded, &mut residual)?;
    decorrelate::back_transform_integers(Mat::square(&inverse, n)?, &rounded, values)?;
    Ok(success_rate::bootstrapped(&d))
}

/// What the epochs of an arc say of its integer.
#[derive(Debug)]
struct Arc {
    /// Value of the epoch that knows it best, and its variance.
    best: (i64, f64),
    /// How many epochs are for each value.
    votes: BTreeMap<i64, usize>,
}

/// Fixes found during a backward pass, to be given to the model after it.
#[derive(Debug)]
pub struct Fixer {
    resolver: Resolver,
    report: IntegerReport,
    /// By epoch, where those are fixed by themselves.
    epochs: Vec<(usize, Vec<Integer>, Vec<f64>)>,
    arcs: BTreeMap<usize, Arc>,
    seen: BTreeSet<usize>,
    list: Vec<Integer>,
}

impl Fixer {
    /// Nothing yet.
    pub fn new(options: IntegerOptions) -> Self {
        let (mean, covariance, values) = Default::default();
        let resolver = Resolver { options, workspace: Box::default(), mean, covariance, values };
        let (report, epochs, arcs, seen, list) = Default::default();
        Self { resolver, report, epochs, arcs, seen, list }
    }

    /// Looks at an epoch of a backward pass.
    pub fn visit<M: Model + ?Sized>(&mut self, model: &M, epoch: Epoch<'_>) {
        model.integers(epoch.k, &mut self.list);
        if self.list.is_empty() {
            return;
        }
        let by_arc = self.resolver.options.scope == Scope::Arc;
        if by_arc {
            self.seen.extend(self.list.iter().map(|integer| integer.arc));
        }
        let density = match self.resolver.options.source {
            Source::Filter => epoch.filtered,
            Source::Smoother => epoch.smoothed,
        };
        let all = self.list.len();
        let values = self.resolver.resolve(density, &mut self.list);
        self.report.epochs += 1;
        self.report.whole += usize::from(self.list.len() == all);
        self.report.partial += usize::from((1..all).contains(&self.list.len()));
        if !by_arc {
            let values = values.iter().map(|&value| value as f64).collect();
            self.epochs.push((epoch.k, self.list.clone(), values));
            return;
        }
        for (integer, &value) in self.list.iter().zip(values) {
            let variance = density.covariance(integer.state, integer.state);
            let new = || Arc { best: (value, variance), votes: BTreeMap::new() };
            let arc = self.arcs.entry(integer.arc).or_insert_with(new);
            *arc.votes.entry(value).or_default() += 1;
            if variance < arc.best.1 {
                arc.best = (value, variance);
            }
        }
    }

    /// Epoch, ambiguities and values of each fix, where epochs are fixed by themselves; from the last epoch to the first.
    pub fn fixes(&self) -> &[(usize, Vec<Integer>, Vec<f64>)] {
        &self.epochs
    }

    /// Gives the model what was found, and settles it.
    pub fn apply<M: Model + ?Sized>(mut self, model: &mut M) -> IntegerReport {
        let report = &mut self.report;
        for (k, integers, values) in &self.epochs {
            report.contradictions += model.fix(*k, integers, values);
        }
        if self.resolver.options.scope == Scope::Arc {
            let agreement = self.resolver.options.agreement;
            let values: BTreeMap<usize, f64> = self
                .arcs
                .iter()
                .filter_map(|(&arc, found)| {
                    let votes: usize = found.votes.values().sum();
                    let agreed = found.votes[&found.best.0] as f64 >= agreement * votes as f64;
                    agreed.then_some((arc, found.best.0 as f64))
                })
                .collect();
            report.arcs = self.seen.len();
            report.fixed_arcs = values.len();
            report.torn_arcs = self.arcs.len() - values.len();
            for k in 0..model.epochs() {
                model.integers(k, &mut self.list);
                self.list.retain(|integer| values.contains_key(&integer.arc));
                if !self.list.is_empty() {
                    let values: Vec<f64> = self.list.iter().map(|integer| values[&integer.arc]).collect();
                    report.contradictions += model.fix(k, &self.list, &values);
                }
            }
        }
        model.settle();
        self.report
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::ambiguous;
    use super::super::pass::{PassOptions, Passes};
    use super::*;

    fn fix(options: IntegerOptions, model: &mut super::super::dense::Dense) -> IntegerReport {
        let mut passes = Passes::new(PassOptions::default());
        passes.forward(model).unwrap();
        let mut fixer = Fixer::new(options);
        passes.backward(model, |epoch| fixer.visit(model, epoch)).unwrap();
        fixer.apply(model)
    }

    /// Both densities, both searches: all arcs get their true values.
    #[test]
    fn arcs_get_their_integers() {
        for source in [Source::Filter, Source::Smoother] {
            for search in [Search::LeastSquares, Search::Bootstrapping] {
                let (mut model, _) = ambiguous(5, 120, 6, 40);
                let report = fix(IntegerOptions { source, search, ..IntegerOptions::default() }, &mut model);
                assert_eq!((report.torn_arcs, report.contradictions), (0, 0), "{source:?} {search:?}: {report:?}");
                assert!(report.fixed_arcs * 10 >= report.arcs * 9, "{source:?} {search:?}: {report:?}");
            }
        }
    }

    /// An integer that changes along its arc, as after a missed slip, leaves that arc float and no other.
    #[test]
    fn an_arc_whose_epochs_disagree_is_left_float() {
        let options = IntegerOptions { fewest: 1, ..IntegerOptions::default() };
        let integer = |arc| Integer { state: arc, arc };
        let (model, _) = ambiguous(5, 3, 2, 40);
        let mut fixer = Fixer::new(options);
        for (k, means) in [[4.02, 7.01], [4.01, 6.01], [3.98, 6.02]].into_iter().enumerate() {
            let mut density = Density::default();
            density.reset(3);
            density.mean[1..].copy_from_slice(&means);
            for i in 0..3 {
                density.covariance[4 * i] = 1e-4;
            }
            fixer.visit(&model, Epoch { k, filtered: &density, smoothed: &density });
        }
        let mut model = model;
        let report = fixer.apply(&mut model);
        assert_eq!((report.arcs, report.fixed_arcs, report.torn_arcs, report.whole), (2, 1, 1, 3));
        let mut left = Vec::new();
        model.integers(1, &mut left);
        assert_eq!(left, [Integer { arc: integer(1).arc, state: 1 }]);
    }

    #[test]
    fn an_uncertain_ambiguity_stays_float_beside_certain_ones() {
        let (mut model, truth) = ambiguous(5, 30, 5, 1000);
        let mut fixer = Fixer::new(IntegerOptions { scope: Scope::Epoch, fewest: 2, ..IntegerOptions::default() });
        let mut density = Density::default();
        density.reset(6);
        for i in 0..6 {
            density.mean[i] = if i == 0 { 0.0 } else { truth[i - 1] as f64 + 0.01 };
            density.covariance[7 * i] = if i == 3 { 1.0 } else { 1e-4 };
        }
        fixer.visit(&model, Epoch { k: 0, filtered: &density, smoothed: &density });
        let report = fixer.apply(&mut model);
        assert_eq!((report.whole, report.partial), (0, 1));
        let mut left = Vec::new();
        model.integers(0, &mut left);
        assert_eq!(left.iter().map(|integer| integer.arc).collect::<Vec<_>>(), [2]);
    }
}
