//! A linear model given by its matrices, epoch by epoch: for vectors, tests, and as an example of a [`Model`].
//!
//! ```text
//! x_{k+1} = F_k x_k + b_k + q_k,   y_k = H_k x_k + e_k,   e_k ~ N(0, R_k)  or  N(0, θ_j R_k)
//! ```
//! Fixed integers are taken out of the state, and what they contribute out of y and b. F may be rectangular. An integer
//! is fixed at the epochs it was given for; where it is fixed at an epoch and not at the next, it is born anew there.

use super::model::{Density, Integer, Model, Parameter, Scratch, Sums, Transition};
use std::collections::BTreeMap;
use surefix_core::filter::update::{Form, Gauge, Stage, UpdateError, VECTORS, Work};
use surefix_core::linalg::{Mat, MatMut, cholesky};
use surefix_core::smooth::em;

/// The measurements of an epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurement {
    /// y.
    pub values: Vec<f64>,
    /// H by rows.
    pub rows: Vec<f64>,
    /// R by rows, or R⁰ if `parameter` says so.
    pub noise: Vec<f64>,
    /// The parameter θ_j that R⁰ is multiplied by.
    pub parameter: Option<usize>,
}

/// The states, steps and measurements of all epochs.
#[derive(Clone, Debug, Default)]
pub struct System {
    /// N(m, P) before the measurements of epoch 0.
    pub prior: Density,
    /// K of them.
    pub steps: Vec<Transition>,
    /// K + 1 of them.
    pub measurements: Vec<Measurement>,
    /// Which states are integers in truth, for each epoch; none where the list is shorter.
    pub integers: Vec<Vec<Integer>>,
}

impl System {
    fn states(&self, k: usize) -> usize {
        if k == 0 { self.prior.dim() } else { self.steps[k - 1].states() }
    }

    fn integers(&self, k: usize) -> &[Integer] {
        self.integers.get(k).map_or(&[], Vec::as_slice)
    }

    /// The same system, given the values of integers by epoch and state.
    fn given(&self, fixed: &BTreeMap<(usize, usize), f64>) -> Self {
        let epochs = self.measurements.len();
        let value = |k: usize, state: usize| fixed.get(&(k, state)).copied();
        // The new index of each state that stays.
        let places: Vec<Vec<Option<usize>>> = (0..epochs)
            .map(|k| {
                let mut next = 0..;
                (0..self.states(k)).map(|state| if value(k, state).is_some() { None } else { next.next() }).collect()
            })
            .collect();
        let staying = |k: usize| (0..self.states(k)).filter(move |&state| value(k, state).is_none());

        let mut prior = Density::default();
        prior.mean.extend(staying(0).map(|i| self.prior.mean[i]));
        prior.covariance.extend(staying(0).flat_map(|i| staying(0).map(move |j| self.prior.covariance(i, j))));
        let measurements = (0..epochs).map(|k| {
            let (given, n) = (&self.measurements[k], self.states(k));
            let mut measurement = Measurement { rows: Vec::new(), ..given.clone() };
            for (y, row) in measurement.values.iter_mut().zip(given.rows.chunks_exact(n.max(1))) {
                *y -= (0..n).filter_map(|state| Some(row[state] * value(k, state)?)).sum::<f64>();
                measurement.rows.extend(staying(k).map(|state| row[state]));
            }
            measurement
        });
        let steps = (0..epochs - 1).map(|k| self.steps[k].given(|column| value(k, column), &places[k], &places[k + 1]));
        let integers = (0..epochs).map(|k| {
            let free = |integer: &Integer| Some(Integer { state: places[k][integer.state]?, arc: integer.arc });
            self.integers(k).iter().filter_map(free).collect()
        });
        Self { steps: steps.collect(), measurements: measurements.collect(), integers: integers.collect(), prior }
    }
}

impl Transition {
    /// Number of states of x⁺.
    pub fn states(&self) -> usize {
        self.step().map.rows()
    }

    /// The same step without the states of x and x⁺ that have no place; those of x have a value. A state of x⁺ that
    /// depends on no random state and has no noise is born with a variance of 1e4.
    fn given(&self, value: impl Fn(usize) -> Option<f64>, before: &[Option<usize>], after: &[Option<usize>]) -> Self {
        let step = self.step();
        let mut given = Self::default();
        given.reset(before.iter().flatten().count());
        for (i, offset) in step.offset.iter().enumerate().filter(|(i, _)| after[*i].is_some()) {
            let row = step.map.row(i);
            let known: f64 = row.iter().filter_map(|&(column, f)| Some(f * value(column)?)).sum();
            let random: Vec<_> = row.iter().filter_map(|&(column, f)| Some((before[column]?, f))).collect();
            let state = given.push(offset + known, &random);
            if random.is_empty() && !row.is_empty() {
                given.noise(&[state], &[&[1.0]], 1e4, None);
            }
        }
        for block in step.noise {
            let states: Option<Vec<usize>> = block.states[..block.dim].iter().map(|&state| after[state]).collect();
            let Some(states) = states else { continue };
            let mut moved = *block;
            moved.states[..block.dim].copy_from_slice(&states);
            given.noise.push(moved);
        }
        given
    }

    /// Adds noise of any covariance to all states of x⁺; it is not learned.
    pub fn dense_noise(&mut self, covariance: &[f64]) {
        let n = self.states();
        for i in 0..n {
            for j in 0..i {
                let q = covariance[i * n + j];
                self.noise(&[i, j], &[&[0.0, q], &[q, 0.0]], 1.0, None);
            }
            self.noise(&[i], &[&[covariance[i * n + i]]], 1.0, None);
        }
    }
}

/// A [`System`] with parameters and fixes.
#[derive(Clone, Debug)]
pub struct Dense {
    /// How measurements are taken in.
    pub form: Form,
    full: System,
    current: System,
    parameters: Vec<Parameter>,
    fixed: BTreeMap<(usize, usize), f64>,
}

impl Dense {
    /// Nothing is fixed yet.
    pub fn new(system: System, parameters: Vec<Parameter>) -> Self {
        Self { form: Form::Sequential, current: system.clone(), full: system, parameters, fixed: BTreeMap::new() }
    }

    /// The states that are left, given the fixes.
    pub fn system(&self) -> &System {
        &self.current
    }
}

/// (R or R⁰, and the scale of it).
fn noise(measurement: &Measurement, parameters: &[Parameter]) -> f64 {
    measurement.parameter.map_or(1.0, |j| parameters[j].variance)
}

impl Model for Dense {
    fn epochs(&self) -> usize {
        self.current.measurements.len()
    }

    fn states(&self, k: usize) -> usize {
        self.current.states(k)
    }

    fn prior(&self, density: &mut Density) {
        density.clone_from(&self.current.prior);
    }

    fn transition(&self, k: usize, transition: &mut Transition) {
        transition.clone_from(&self.current.steps[k]);
        for block in &mut transition.noise {
            if let Some(component) = block.component {
                block.scale = self.parameters[component].variance;
            }
        }
    }

    fn update(&self, k: usize, density: &mut Density, scratch: &mut Scratch) -> Result<Gauge<f64>, UpdateError> {
        let measurement = &self.current.measurements[k];
        let (m, n) = (measurement.values.len(), density.dim());
        let [innovation, r, rows, vectors, correction, ..] = &mut scratch.buffers;
        innovation.clear();
        for (y, row) in measurement.values.iter().zip(measurement.rows.chunks_exact(n.max(1))) {
            innovation.push(y - row.iter().zip(&density.mean).map(|(h, x)| h * x).sum::<f64>());
        }
        let scale = noise(measurement, &self.parameters);
        r.clear();
        r.extend(measurement.noise.iter().map(|entry| scale * entry));
        rows.resize(m * n, 0.0);
        vectors.resize(VECTORS * n, 0.0);
        correction.clear();
        correction.resize(n, 0.0);
        let work = Work { rows: MatMut::new(rows, m, n, n)?, vectors: MatMut::new(vectors, VECTORS, n, n)? };
        let p = MatMut::square(&mut density.covariance, n)?;
        let mut stage = Stage::begin(self.form, correction, p, work)?;
        if m > 0 {
            let h = Mat::new(&measurement.rows, m, n, n)?;
            stage.correlated(&h, 0, innovation, &mut MatMut::square(r, m)?)?;
        }
        let gauge = stage.finish()?;
        density.mean.iter_mut().zip(correction).for_each(|(mean, correction)| *mean += *correction);
        Ok(gauge)
    }

    fn residuals(&self, k: usize, smoothed: &Density, scratch: &mut Scratch, sums: &mut Sums) {
        let measurement = &self.current.measurements[k];
        let (Some(parameter), m, n) = (measurement.parameter, measurement.values.len(), smoothed.dim()) else { return };
        let [residual, r, work, product, ..] = &mut scratch.buffers;
        residual.clear();
        for (y, row) in measurement.values.iter().zip(measurement.rows.chunks_exact(n.max(1))) {
            residual.push(y - row.iter().zip(&smoothed.mean).map(|(h, x)| h * x).sum::<f64>());
        }
        r.clone_from(&measurement.noise);
        work.resize(m * n, 0.0);
        product.resize(m * m, 0.0);
        let mut add = || -> Option<()> {
            let mut unit = MatMut::square(r, m).ok()?;
            let h = Mat::new(&measurement.rows, m, n, n).ok()?;
            let p = Mat::square(&smoothed.covariance, n).ok()?;
            let mut work = MatMut::new(work, m, n, n).ok()?;
            let mut product = MatMut::square(product, m).ok()?;
            let sum = em::correlated(&h, 0, residual, &mut unit, p, &mut work, &mut product).ok()?;
            sums.add(parameter, sum.quadratic, sum.count);
            sums.add_log_determinant(parameter, cholesky::log_determinant(unit.as_ref()));
            Some(())
        };
        // (R⁰ was positive definite in the update.)
        add();
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn set_variances(&mut self, variances: &[f64]) {
        for (parameter, &variance) in self.parameters.iter_mut().zip(variances) {
            parameter.variance = variance;
        }
    }

    fn integers(&self, k: usize, integers: &mut Vec<Integer>) {
        integers.clear();
        integers.extend_from_slice(self.current.integers(k));
    }

    fn fix(&mut self, k: usize, integers: &[Integer], values: &[f64]) -> usize {
        let mut contradictions = 0;
        for (integer, &value) in integers.iter().zip(values) {
            let Some(found) = self.full.integers(k).iter().find(|full| full.arc == integer.arc) else { continue };
            let held = *self.fixed.entry((k, found.state)).or_insert(value);
            contradictions += usize::from(held != value);
        }
        contradictions
    }

    fn settle(&mut self) {
        self.current = self.full.given(&self.fixed);
    }

    fn release(&mut self) {
        self.fixed.clear();
        self.current.clone_from(&self.full);
    }
}
