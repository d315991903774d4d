//! Forward and backward passes over all epochs of a [`Model`].
//!
//! ```text
//! forward:   m⁻, P⁻ of epoch k from m, P of epoch k − 1 ── detect ──► update ──► m, P          (filter)
//! backward:  mˢ, Pˢ of epoch k from m, P, and m⁻, P⁻, mˢ, Pˢ of epoch k + 1                   (Rauch–Tung–Striebel)
//! ```
//! Greiff et al. (2023), eqs. (3) to (8). The forward pass yields −ln p(y | θ) = ½ Σ (νᵀ S⁻¹ ν + ln det S + p ln 2π), the
//! backward pass, on request, the sums from which EM learns. Where the filtered densities are kept is for
//! [`super::history`]; predictions are made again from them, to the same bits.

use super::history::{History, Storage};
use super::model::{Density, Model, Scratch, Sums, Transition};
use super::progress::Progress;
use super::vector::vectorised;
use std::io;
use surefix_core::filter::update::{Gauge, UpdateError};
use surefix_core::linalg::MatMut;
use surefix_core::smooth::{Moments, MomentsMut, SmoothError, em, tiled};
use thiserror::Error;

/// ln 2π.
pub(super) const LN_2_PI: f64 = 1.837_877_066_409_345_3;

/// Why a pass ended early.
#[derive(Debug, Error)]
pub enum PassError {
    /// There are no epochs.
    #[error("there are no epochs to smooth; give data that overlap")]
    Empty,
    /// The measurements of an epoch could not be taken in.
    #[error(
        "epoch {epoch}: measurements cannot be used: {source}; leave the epoch out or widen the noise of its states"
    )]
    Update {
        /// Which, from 0.
        epoch: usize,
        /// Why.
        source: UpdateError,
    },
    /// The step from an epoch to the next could not be taken.
    #[error(
        "step from epoch {epoch} to the next: {source}; give all its states process noise or a positive prior variance"
    )]
    Step {
        /// The epoch that it starts from, from 0.
        epoch: usize,
        /// Why.
        source: SmoothError,
    },
    /// Filtered densities could not be stored.
    #[error("temporary file: {0}; free some space there or allow more memory")]
    Storage(#[from] io::Error),
    /// [`Progress::cancel`] was called.
    #[error("interrupted")]
    Cancelled,
}

/// What the innovations of a forward pass say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fit {
    /// Of each epoch: number of measurements, νᵀ S⁻¹ ν and ln det S.
    pub gauges: Vec<Gauge<f64>>,
}

impl Fit {
    /// −ln p(y | θ).
    pub fn negative_log_likelihood(&self) -> f64 {
        let terms = self
            .gauges
            .iter()
            .map(|gauge| gauge.normalized_innovation_squared + gauge.log_determinant + gauge.rows as f64 * LN_2_PI);
        0.5 * terms.sum::<f64>()
    }

    /// Number of measurements.
    pub fn rows(&self) -> usize {
        self.gauges.iter().map(|gauge| gauge.rows).sum()
    }

    /// Σ νᵀ S⁻¹ ν over the number of measurements: 1 where model and noise are right, `None` without measurements.
    pub fn consistency(&self) -> Option<f64> {
        let squares: f64 = self.gauges.iter().map(|gauge| gauge.normalized_innovation_squared).sum();
        (self.rows() > 0).then(|| squares / self.rows() as f64)
    }
}

/// One epoch of a backward pass.
#[derive(Clone, Copy, Debug)]
pub struct Epoch<'a> {
    /// Which.
    pub k: usize,
    /// Given the measurements up to it.
    pub filtered: &'a Density,
    /// Given all measurements.
    pub smoothed: &'a Density,
}

/// One step of a backward pass, for those who learn from it: the density of q_k.
pub(super) struct StepView<'a> {
    pub transition: &'a Transition,
    /// m⁻, and L of P⁻ = L Lᵀ.
    pub predicted: Moments<'a, f64>,
    /// mˢ⁺, Pˢ⁺.
    pub next: Moments<'a, f64>,
}

impl StepView<'_> {
    /// Calls `add` with component and sum of each block of `transition` that has a component.
    pub fn sums(
        &self,
        transition: &Transition,
        buffer: &mut Vec<f64>,
        add: impl FnMut(usize, em::Sum),
    ) -> Result<(), SmoothError> {
        let n = self.next.mean.len();
        buffer.resize(buffer.len().max(em::VECTORS * n), 0.0);
        let mut work = MatMut::new(buffer, em::VECTORS, n, n)?;
        em::process(&transition.step(), self.predicted, self.next, &mut work, add)
    }
}

/// A model that a forward pass leaves as it is, or changes.
enum Access<'m, M: ?Sized> {
    Frozen(&'m M),
    Detecting(&'m mut M),
}

impl<M: ?Sized> Access<'_, M> {
    fn get(&self) -> &M {
        match self {
            Self::Frozen(model) => model,
            Self::Detecting(model) => model,
        }
    }
}

/// How much memory passes may take, and who watches.
#[derive(Clone, Copy, Debug)]
pub struct PassOptions<'a> {
    /// For filtered densities, in bytes (default 512 MiB).
    pub budget: usize,
    /// How they are kept, whatever the budget.
    pub storage: Option<Storage>,
    /// Counts the epochs and can stop the passes.
    pub progress: Option<&'a Progress>,
}

impl Default for PassOptions<'_> {
    fn default() -> Self {
        Self { budget: 512 << 20, storage: None, progress: None }
    }
}

/// The passes, with their memory.
#[derive(Debug)]
pub struct Passes<'a> {
    options: PassOptions<'a>,
    history: Option<History>,
    transition: Transition,
    scratch: Scratch,
    work: Vec<f64>,
}

impl<'a> Passes<'a> {
    /// Nothing yet.
    pub fn new(options: PassOptions<'a>) -> Self {
        let (transition, scratch) = Default::default();
        Self { options, history: None, transition, scratch, work: Vec::new() }
    }

    /// Those options.
    pub fn options(&self) -> PassOptions<'a> {
        self.options
    }

    /// How the densities of the last forward pass are kept.
    pub fn storage(&self) -> Option<Storage> {
        self.history.as_ref().map(History::storage)
    }

    /// Tells who watches that so many more passes over all epochs are to come.
    pub(super) fn expect<M: Model + ?Sized>(&self, model: &M, passes: usize) {
        if let Some(progress) = self.options.progress {
            progress.expect(passes * model.epochs());
        }
    }

    /// Tells who watches that so many epochs of passes are not needed after all.
    pub(super) fn spare(&self, epochs: usize) {
        if let Some(progress) = self.options.progress {
            progress.spare(epochs);
        }
    }

    /// Tells who watches how likely the parameters of an iteration of EM are: ℓ = −2 ln p.
    pub(super) fn reach(&self, iteration: usize, likelihood: f64) {
        if let Some(progress) = self.options.progress {
            progress.reach(iteration, likelihood);
        }
    }

    /// A forward pass over steps as they are.
    pub fn forward<M: Model + ?Sized>(&mut self, model: &M) -> Result<Fit, PassError> {
        self.run(Access::Frozen(model))
    }

    /// A forward pass that detects what changes the steps (slips).
    pub fn forward_detecting<M: Model + ?Sized>(&mut self, model: &mut M) -> Result<Fit, PassError> {
        model.forget_detections();
        self.run(Access::Detecting(model))
    }

    fn run<M: Model + ?Sized>(&mut self, mut model: Access<'_, M>) -> Result<Fit, PassError> {
        let mut history = self.start(model.get())?;
        let (mut filtered, mut predicted) = <(Density, Density)>::default();
        let mut fit = Fit::default();
        for k in 0..model.get().epochs() {
            if k == 0 {
                model.get().prior(&mut predicted);
            } else {
                self.predict(model.get(), k - 1, &filtered, &mut predicted)?;
                if let Access::Detecting(model) = &mut model
                    && model.detect(k, &predicted, &mut self.scratch)
                {
                    self.predict(&**model, k - 1, &filtered, &mut predicted)?;
                }
            }
            std::mem::swap(&mut filtered, &mut predicted);
            fit.gauges.push(self.update(model.get(), k, &mut filtered)?);
            history.put(k, &filtered)?;
            self.count()?;
        }
        self.history = Some(history);
        Ok(fit)
    }

    /// Memory for a forward pass: that of the last one, if it is still right.
    fn start<M: Model + ?Sized>(&mut self, model: &M) -> Result<History, PassError> {
        let epochs = model.epochs();
        if epochs == 0 {
            return Err(PassError::Empty);
        }
        let states = (0..epochs).map(|k| model.states(k)).max().unwrap_or(0);
        let choice = self.options.storage.unwrap_or_else(|| Storage::choose(epochs, states, self.options.budget));
        match self.history.take() {
            Some(history) if history.storage() == choice => Ok(history),
            _ => Ok(History::new(choice)?),
        }
    }

    fn count(&self) -> Result<(), PassError> {
        match self.options.progress {
            Some(progress) if !progress.step() => Err(PassError::Cancelled),
            _ => Ok(()),
        }
    }

    /// The density before the measurements of epoch k + 1.
    fn predict<M: Model + ?Sized>(
        &mut self,
        model: &M,
        k: usize,
        filtered: &Density,
        predicted: &mut Density,
    ) -> Result<(), PassError> {
        model.transition(k, &mut self.transition);
        let step = self.transition.step();
        let (n, after) = (step.map.columns, step.map.rows());
        predicted.resize(after);
        self.work.resize(self.work.len().max(tiled::prediction_len(after, n)), 0.0);
        let mut predict = || {
            let (filtered, mut predicted) = (filtered.moments()?, predicted.moments_mut()?);
            vectorised(
                #[inline(always)]
                || tiled::predict(&step, filtered, &mut predicted, &mut self.work),
            )
        };
        predict().map_err(|source| PassError::Step { epoch: k, source })
    }

    fn update<M: Model + ?Sized>(
        &mut self,
        model: &M,
        k: usize,
        density: &mut Density,
    ) -> Result<Gauge<f64>, PassError> {
        let gauge = model.update(k, density, &mut self.scratch);
        gauge.map_err(|source| PassError::Update { epoch: k, source })
    }

    /// A backward pass over what the last forward pass kept, of the same model: calls `visit` for each epoch from the last
    /// to the first.
    pub fn backward<M: Model + ?Sized>(
        &mut self,
        model: &M,
        mut visit: impl FnMut(Epoch<'_>),
    ) -> Result<(), PassError> {
        self.walk(model, |epoch, _| visit(epoch), |_, _| Ok(()))
    }

    /// As [`Passes::backward`], and gathers what EM learns from.
    pub fn backward_learning<M: Model + ?Sized>(
        &mut self,
        model: &M,
        mut visit: impl FnMut(Epoch<'_>),
    ) -> Result<Sums, PassError> {
        let mut sums = Sums::new(model.parameters().len());
        let mut process = sums.clone();
        self.walk(
            model,
            |epoch, scratch| {
                model.residuals(epoch.k, epoch.smoothed, scratch, &mut sums);
                visit(epoch);
            },
            |step, work| step.sums(step.transition, work, |j, sum| process.add(j, sum.quadratic, sum.count)),
        )?;
        sums.merge(&process);
        Ok(sums)
    }

    /// A backward pass that shows the epochs, and the steps between them.
    pub(super) fn walk<M: Model + ?Sized>(
        &mut self,
        model: &M,
        mut visit: impl FnMut(Epoch<'_>, &mut Scratch),
        mut learn: impl FnMut(&StepView<'_>, &mut Vec<f64>) -> Result<(), SmoothError>,
    ) -> Result<(), PassError> {
        let last = model.epochs().checked_sub(1).ok_or(PassError::Empty)?;
        let mut history = self.history.take().ok_or(PassError::Empty)?;
        let [mut filtered, mut predicted, mut smoothed, mut next] = <[Density; 4]>::default();
        history.get(last, &mut filtered)?;
        smoothed.clone_from(&filtered);
        visit(Epoch { k: last, filtered: &filtered, smoothed: &smoothed }, &mut self.scratch);
        for k in (0..last).rev() {
            self.fetch(model, &mut history, k, &mut filtered, &mut predicted)?;
            model.transition(k, &mut self.transition);
            std::mem::swap(&mut smoothed, &mut next);
            smoothed.resize(filtered.dim());
            predicted.resize(next.dim());
            let mut step = || {
                let (n, after) = (filtered.dim(), predicted.dim());
                self.work.resize(self.work.len().max(tiled::buffer_len(after, n)), 0.0);
                let mut work = tiled::Work::new(&mut self.work, after, n)?;
                let (step, next) = (self.transition.step(), next.moments()?);
                let mut predicted = predicted.moments_mut()?;
                let mut smoothed = smoothed.moments_mut()?;
                let filtered = filtered.moments()?;
                vectorised(
                    #[inline(always)]
                    || tiled::smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut work),
                )?;
                let view = StepView { transition: &self.transition, predicted: predicted.as_ref(), next };
                learn(&view, &mut self.work)
            };
            step().map_err(|source| PassError::Step { epoch: k, source })?;
            visit(Epoch { k, filtered: &filtered, smoothed: &smoothed }, &mut self.scratch);
            self.count()?;
        }
        self.count()?;
        self.history = Some(history);
        Ok(())
    }

    /// The filtered density of epoch k, filtered again from the checkpoint before it if it was not kept.
    fn fetch<M: Model + ?Sized>(
        &mut self,
        model: &M,
        history: &mut History,
        k: usize,
        filtered: &mut Density,
        predicted: &mut Density,
    ) -> Result<(), PassError> {
        for j in history.get(k, filtered)?..k {
            self.predict(model, j, filtered, predicted)?;
            std::mem::swap(filtered, predicted);
            self.update(model, j + 1, filtered)?;
            history.put(j + 1, filtered)?;
        }
        Ok(())
    }
}

impl Density {
    /// Becomes one of n states, of which nothing is said yet.
    pub(super) fn resize(&mut self, n: usize) {
        self.mean.resize(n, 0.0);
        self.covariance.resize(n * n, 0.0);
    }

    /// As the steps of the core read it.
    pub(super) fn moments(&self) -> Result<Moments<'_, f64>, SmoothError> {
        Moments::packed(&self.mean, &self.covariance)
    }

    /// As the steps of the core write it.
    pub(super) fn moments_mut(&mut self) -> Result<MomentsMut<'_, f64>, SmoothError> {
        MomentsMut::packed(&mut self.mean, &mut self.covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::{random, solve};
    use super::*;
    use proptest::prelude::*;
    use surefix_core::filter::update::Form;

    /// Everything a forward and a backward pass yield.
    fn passes(model: &impl Model, storage: Option<Storage>) -> (Fit, Vec<Density>, Sums) {
        let mut passes = Passes::new(PassOptions { storage, ..PassOptions::default() });
        let fit = passes.forward(model).unwrap();
        let mut smoothed = Vec::new();
        let sums = passes.backward_learning(model, |epoch| smoothed.push(epoch.smoothed.clone())).unwrap();
        smoothed.reverse();
        (fit, smoothed, sums)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn smoothed_densities_are_those_of_batch_least_squares(seed: u64, epochs in 1usize..9) {
            let mut model = random(seed, epochs);
            model.form = Form::Joseph;
            let (fit, smoothed, _) = passes(&model, None);
            let (expected, nll) = solve(&model);
            prop_assert!((fit.negative_log_likelihood() - nll).abs() < 1e-9 * (1.0 + nll.abs()));
            for (density, (mean, covariance)) in smoothed.iter().zip(&expected) {
                for i in 0..density.dim() {
                    let sigma = covariance[(i, i)].sqrt();
                    prop_assert!((density.mean[i] - mean[i]).abs() < 1e-9 * (1.0 + sigma));
                    for j in 0..=i {
                        let scale = sigma * covariance[(j, j)].sqrt();
                        prop_assert!((density.covariance(i, j) - covariance[(i, j)]).abs() < 1e-9 * scale);
                    }
                }
            }
        }

        #[test]
        fn storages_differ_in_no_bit(seed: u64, epochs in 1usize..40, spacing in 1usize..9) {
            let model = random(seed, epochs);
            let of = |storage| {
                let (fit, smoothed, sums) = passes(&model, Some(storage));
                // The upper triangles hold anything.
                let lower: Vec<f64> = smoothed.iter().flat_map(|density| {
                    let n = density.dim();
                    (0..n).flat_map(move |i| density.covariance[i * n..][..=i].iter().copied())
                }).collect();
                (fit, smoothed.iter().map(|density| density.mean.clone()).collect::<Vec<_>>(), lower, sums)
            };
            let memory = of(Storage::Memory);
            prop_assert_eq!(&memory, &of(Storage::Checkpoints { spacing }));
            prop_assert_eq!(&memory, &of(Storage::File));
        }
    }

    #[test]
    fn errors_name_the_epoch() {
        let mut model = random(1, 6);
        let mut parameters: Vec<f64> = model.parameters().iter().map(|parameter| parameter.variance).collect();
        parameters[1] = f64::NAN;
        model.set_variances(&parameters);
        let error = Passes::new(PassOptions::default()).forward(&model).unwrap_err();
        assert!(error.to_string().starts_with("epoch 1: "), "{error}");
    }

    #[test]
    fn a_cancelled_pass_ends() {
        let progress = Progress::default();
        let model = random(1, 6);
        let mut passes = Passes::new(PassOptions { progress: Some(&progress), ..PassOptions::default() });
        assert!(passes.forward(&model).is_ok());
        progress.cancel();
        assert!(matches!(passes.backward(&model, |_| ()), Err(PassError::Cancelled)));
        assert!(matches!(passes.forward(&model), Err(PassError::Cancelled)));
    }
}
