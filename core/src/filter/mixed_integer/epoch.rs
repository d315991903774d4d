//! Algorithm 1, one epoch.

use super::super::density::Cut;
use super::super::linearize::{self, linearize};
use super::super::slip;
use super::super::update::{Form, Gauge, Stage, explain, project};
use super::rows::{ModelRows, innovation};
use super::scratch::{Bench, work};
use super::{Detector, FilterError, Fixing, Integers, Options, Outcome, Output, is_plausible};
use crate::integer::{Config, Workspace, resolve};
use crate::linalg::{MatMut, axpy, cholesky, copy, head_mut, symmetric, tail, tail_mut, triangular};
use crate::model::partially_linear::{PartiallyLinear, Shape};
use crate::real::Real;

/// Everything an epoch works on.
pub(super) struct Epoch<'a, T, M: ?Sized> {
    pub options: Options,
    pub model: &'a M,
    pub shape: Shape,
    pub y: &'a [f64],
    pub relaxed: Cut<'a, T>,
    pub constrained: Cut<'a, T>,
    pub bench: Bench<'a, T>,
}

/// Which rows an update takes.
#[derive(Clone, Copy, PartialEq)]
enum Group {
    Independent,
    Correlated,
}

impl<T: Real, M: PartiallyLinear + ?Sized> Epoch<'_, T, M> {
    /// Runs it; on an error both densities are spoilt.
    pub fn run<const A: usize>(&mut self, workspace: &mut Workspace<T, A>) -> Result<Outcome<T>, FilterError> {
        let Self { options, model, shape, y, relaxed, bench, .. } = self;
        relaxed.predict(*model, shape.real)?;
        let form = predict_rows(options, *model, y, relaxed, bench, value_of)?;
        // The independent rows contain no ambiguity, so that they commute with V: they go first and inform the detector.
        let mut gauge = self.update_relaxed(Group::Independent, self.options.form)?;
        let (slips, common_jump) = self.detect()?;
        self.open_ambiguities(common_jump);
        gauge.add(self.update_relaxed(Group::Correlated, form)?);
        self.relaxed.correct();

        let integers = self.fix(workspace)?;
        let gated = integers.is_some_and(|integers| integers.success_rate < self.options.gate);
        let constrained = match self.options.output {
            Output::DualDensity => self.update_constrained(gated)?,
            Output::ConditionalFix => self.condition(gated)?,
        };
        Ok(Outcome { relaxed: gauge, constrained, slips, common_jump, integers, gated })
    }

    /// Updates the relaxed density.
    fn update_relaxed(&mut self, group: Group, form: Form) -> Result<Gauge<T>, FilterError> {
        let Self { model, shape, y, relaxed, bench, .. } = self;
        let n = shape.states();
        let rows = ModelRows { model: *model, slope: bench.slope.as_ref(), nonlinear: model.nonlinear(), states: n };
        let work = work(bench.rows, bench.vectors, bench.stride, shape.correlated, n)?;
        let mut stage = Stage::begin(form, relaxed.correction, relaxed.p.reborrow(), work)?;
        let mean = &*relaxed.mean;
        if group == Group::Correlated {
            stage.correlated(&rows, 0, bench.innovation, &mut bench.noise)?;
        } else {
            let nu = |row| T::from_f64(innovation(*model, row, value_of(y, row), 0.0, |state| value_of(mean, state)));
            stage.independent(&rows, shape.correlated..shape.rows(), nu, |row| T::from_f64(model.variance(row)))?;
        }
        Ok(stage.finish()?)
    }

    /// Slip estimates and flags. Returns the number of flags, and a jump common to all.
    fn detect(&mut self) -> Result<(usize, Option<i64>), FilterError> {
        let Self { options, model, shape, relaxed, bench, .. } = self;
        bench.estimate.fill(T::ZERO);
        bench.flags.fill(false);
        if shape.ambiguities == 0 || options.detector == Detector::None {
            return Ok((0, None));
        }
        // The projection needs the rows with ambiguities only.
        let weighted = options.detector == Detector::Weighted;
        let first = if weighted { 0 } else { shape.unambiguous };
        let m = shape.correlated.saturating_sub(first);
        if m < shape.ambiguities {
            return Err(FilterError::Undetermined { index: m });
        }
        let mut g = bench.g.block_mut(0, 0, m, shape.ambiguities)?;
        for (i, row) in g.iter_mut().enumerate() {
            row.fill(T::ZERO);
            model.linear_row(first + i, &mut |state, coefficient| {
                if let Some(entry) = state.checked_sub(shape.real).and_then(|ambiguity| row.get_mut(ambiguity)) {
                    *entry += T::from_f64(coefficient);
                }
            });
        }
        if weighted {
            // With the independent rows taken in, what is left of the normal equations are the correlated rows. R + Ω is
            // kept above the diagonal for the update.
            let n = shape.states();
            let rows =
                ModelRows { model: *model, slope: bench.slope.as_ref(), nonlinear: model.nonlinear(), states: n };
            let mut v = MatMut::new(bench.rows, m, n, bench.stride)?;
            bench.noise.mirror_lower();
            symmetric::keep_diagonal(bench.noise.as_ref(), bench.noise_diagonal);
            copy(bench.residual, bench.innovation);
            let unexplained = explain(bench.residual, relaxed.correction);
            project(relaxed.p.as_ref(), &rows, 0, &mut v, &mut bench.noise, unexplained);
            slip::project_weighted(&mut g, bench.residual, &mut bench.noise, &mut bench.factor, bench.estimate)?;
            symmetric::restore(&mut bench.noise, bench.noise_diagonal);
        } else {
            slip::project(&mut g, tail(bench.innovation, first), &mut bench.factor, bench.estimate)?;
        }
        let mut slips = 0;
        for (flag, estimate) in bench.flags.iter_mut().zip(&*bench.estimate) {
            *flag = slip::jumped(estimate.to_f64(), options.threshold);
            slips += usize::from(*flag);
        }
        Ok((slips, slip::common_jump(bench.estimate, options.threshold)))
    }

    /// P_nn += V.
    fn open_ambiguities(&mut self, common_jump: Option<i64>) {
        let (real, n) = (self.shape.real, self.shape.states());
        let Options { sigma_jump, sigma_stay, .. } = self.options;
        for (i, &flag) in self.bench.flags.iter().enumerate() {
            let sigma = slip::sigma(flag, sigma_jump, sigma_stay);
            self.relaxed.p.add(real + i, real + i, T::from_f64(sigma * sigma));
        }
        if common_jump.is_some() && self.options.common_jump {
            let variance = T::from_f64(sigma_jump * sigma_jump);
            for i in real..n {
                for entry in tail_mut(head_mut(self.relaxed.p.row_mut(i), i + 1), real) {
                    *entry += variance;
                }
            }
        }
    }

    /// nᴵ from the relaxed ambiguities; what of them is whole stays out of the search.
    fn fix<const A: usize>(&mut self, workspace: &mut Workspace<T, A>) -> Result<Option<Integers<T>>, FilterError> {
        let Self { options, shape, relaxed, bench, .. } = self;
        let real = shape.real;
        if shape.ambiguities == 0 {
            return Ok(None);
        }
        let ambiguities = tail(relaxed.mean, real).iter().zip(bench.integers.iter_mut().zip(&mut *bench.fraction));
        for (index, (&mean, (integer, fraction))) in ambiguities.enumerate() {
            if !is_plausible(mean) {
                return Err(FilterError::Ambiguity { index });
            }
            let whole = libm::round(mean);
            *integer = whole as i64;
            *fraction = T::from_f64(mean - whole);
        }
        bench.factor.copy_from(relaxed.p.as_ref().block(real, real, shape.ambiguities, shape.ambiguities)?)?;
        bench.factor.mirror_lower();
        let budget = if options.fixing == Fixing::LeastSquares { options.search_budget } else { 0 };
        let found = resolve(bench.fraction, bench.factor.as_ref(), &Config { budget }, workspace)?;
        for (integer, &offset) in bench.integers.iter_mut().zip(found.best) {
            *integer += offset;
        }
        Ok(Some(Integers {
            best_norm: found.best_norm,
            second_norm: found.second_norm,
            success_rate: found.success_rate.success,
            method: found.method,
            nodes: found.nodes,
        }))
    }

    /// The constrained density given z = y − G nᴵ; without the rows that contain ambiguities if `gated`.
    fn update_constrained(&mut self, gated: bool) -> Result<Gauge<T>, FilterError> {
        let Self { options, model, shape, y, constrained, bench, .. } = self;
        let real = shape.real;
        constrained.predict(*model, real)?;
        let integers = core::mem::take(&mut bench.integers);
        let value = |mean: &[f64], state: usize| match state.checked_sub(real) {
            Some(ambiguity) => integers.get(ambiguity).map_or(0.0, |&integer| integer as f64),
            None => value_of(mean, state),
        };
        let predicted = predict_rows(options, *model, y, constrained, bench, value);
        bench.integers = integers;
        let form = predicted?;

        let rows = ModelRows { model: *model, slope: bench.slope.as_ref(), nonlinear: model.nonlinear(), states: real };
        let room = work(bench.rows, bench.vectors, bench.stride, shape.correlated, real)?;
        let mut stage = Stage::begin(options.form, constrained.correction, constrained.p.reborrow(), room)?;
        let mean = &*constrained.mean;
        let nu = |row| T::from_f64(innovation(*model, row, value_of(y, row), 0.0, |state| value_of(mean, state)));
        stage.independent(&rows, shape.correlated..shape.rows(), nu, |row| T::from_f64(model.variance(row)))?;
        let mut gauge = stage.finish()?;

        let room = work(bench.rows, bench.vectors, bench.stride, shape.correlated, real)?;
        let mut stage = Stage::begin(form, constrained.correction, constrained.p.reborrow(), room)?;
        let taken = if gated { shape.unambiguous } else { shape.correlated };
        let mut noise = bench.noise.block_mut(0, 0, taken, taken)?;
        stage.correlated(&rows, 0, head_mut(bench.innovation, taken), &mut noise)?;
        gauge.add(stage.finish()?);
        constrained.correct();
        Ok(gauge)
    }

    /// The relaxed density of x given n = nᴵ; its marginal if `gated`:
    /// m_x + Wᵀ z and P_xx − Wᵀ W with P_nn = L Lᵀ, W = L⁻¹ P_nx, z = L⁻¹ (nᴵ − m_n).
    fn condition(&mut self, gated: bool) -> Result<Gauge<T>, FilterError> {
        let Self { shape, relaxed, constrained, bench, .. } = self;
        let (real, a) = (shape.real, shape.ambiguities);
        let joint = relaxed.p.as_ref();
        constrained.set_covariance(|i, j| joint.at(i, j));
        copy(constrained.mean, relaxed.mean);
        if a == 0 || gated {
            return Ok(Gauge::default());
        }
        let mut w = MatMut::new(bench.rows, a, real, bench.stride)?;
        w.copy_from(joint.block(real, 0, a, real)?)?;
        bench.factor.copy_from(joint.block(real, real, a, a)?)?;
        let ambiguities = tail(relaxed.mean, real).iter().zip(&*bench.integers);
        for (z, (mean, &integer)) in bench.fraction.iter_mut().zip(ambiguities) {
            *z = T::from_f64(integer as f64 - mean);
        }
        cholesky::factor(&mut bench.factor)?;
        triangular::forward(bench.factor.as_ref(), bench.fraction)?;
        triangular::forward_rows(bench.factor.as_ref(), &mut w)?;
        symmetric::subtract_gram(&mut constrained.p, w.as_ref());
        for (&z, w) in bench.fraction.iter().zip(w.iter()) {
            axpy(constrained.correction, z, w);
        }
        symmetric::check_diagonal(constrained.p.as_ref())?;
        constrained.correct();
        Ok(Gauge::default())
    }
}

/// The plain form is left where u gives a row more than this over √ε times the variance of its noise and ambiguities (Ω may
/// be nil in some directions): in the constrained density, at a prior of 50 m against 2 cm in `f64`, of 30 cm in `f32`.
const MAX_LOSS: f64 = 0.1;

/// Linearises at a predicted density: ∂g/∂u, R + Ω and the innovations of the correlated rows. `value` is that of a
/// linear state. Returns the form of the update that is safe for them: the one that was chosen, or, for the plain form with
/// too wide a prior, the array form.
fn predict_rows<T: Real>(
    options: &Options,
    model: &(impl PartiallyLinear + ?Sized),
    y: &[f64],
    density: &Cut<'_, T>,
    bench: &mut Bench<'_, T>,
    value: impl Fn(&[f64], usize) -> f64,
) -> Result<Form, FilterError> {
    for (i, row) in bench.noise.iter_mut().enumerate() {
        for (j, entry) in head_mut(row, i + 1).iter_mut().enumerate() {
            *entry = T::from_f64(model.noise(i, j));
        }
    }
    let u = model.nonlinear();
    let covariance = density.p.as_ref().block(u.start, u.start, u.len(), u.len())?;
    let work = linearize::Work { values: bench.values, reference: bench.reference, samples: bench.rows };
    let (slope, noise) = (&mut bench.slope, &mut bench.noise);
    let mean = density.mean.get(u).unwrap_or(&[]);
    linearize(options.rule, model, mean, covariance, bench.prediction, slope, noise, work)?;
    let predicted = y.iter().zip(&*bench.prediction);
    for ((row, nu), (&y, &prediction)) in bench.innovation.iter_mut().enumerate().zip(predicted) {
        let value = |state| value(density.mean, state);
        *nu = T::from_f64(innovation(model, row, y, prediction, value));
    }
    let real = model.shape().real;
    let is_wide = |(row, slope): (usize, &[T])| {
        let mut other = model.noise(row, row);
        let loss = (T::EPSILON.sqrt() * symmetric::quadratic_form(covariance, slope)).to_f64();
        loss > MAX_LOSS * other && {
            model.linear_row(row, &mut |state, coefficient| {
                if state >= real {
                    other += coefficient * coefficient * density.p.at(state, state).to_f64();
                }
            });
            loss > MAX_LOSS * other
        }
    };
    let wide = options.form == Form::Sequential && bench.slope.iter().enumerate().any(is_wide);
    Ok(if wide { Form::Array } else { options.form })
}

/// An entry, 0 where there is none.
fn value_of(values: &[f64], index: usize) -> f64 {
    values.get(index).copied().unwrap_or(0.0)
}
