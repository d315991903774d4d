//! C of each step, (24) of Zhang et al. (2020), from the disturbance smoother: E[q qᵀ | Y] = Q − Q N Q + (Q r)(Q r)ᵀ.
//!
//! The pair (r, N) runs backward beside the smoothed moments ([`surefix_core::smooth::disturbance`]). It needs no inverse of
//! the predicted covariance, whose condition with a clock of 100 m, phases of millimetres and a walk of next to nothing
//! costs (24) in its other forms half of the digits and more. Each step back takes the measurements of the later epoch in
//! once more, for their gains. Cost of a step with m rows: n³ + 2 m n² multiply-adds; memory m n numbers.

use super::model::PppModel;
use crate::smooth::model::{Density, Model, Sums, Transition};
use surefix_core::filter::update::Form;
use surefix_core::linalg::MatMut;
use surefix_core::linalg::sequential::{Row, update_scalar, update_scalar_joseph};
use surefix_core::smooth::disturbance::Adjoint;
use surefix_core::smooth::{Moments, MomentsMut, SmoothError, tiled};

/// The pair (r, N) after the measurements of an epoch, on its way back.
#[derive(Debug, Default)]
pub struct Disturbances {
    score: Vec<f64>,
    information: Vec<f64>,
    transition: Transition,
    predicted: Density,
    work: Vec<f64>,
    /// h and k of each row taken.
    taken: Vec<f64>,
    /// ν and s of each.
    innovations: Vec<[f64; 2]>,
}

impl Disturbances {
    /// Nothing is known beyond the measurements of the last epoch, of n states.
    pub fn new(n: usize) -> Self {
        Self { score: vec![0.0; n], information: vec![0.0; n * n], ..Self::default() }
    }

    /// Goes back from epoch k + 1 to epoch k, whose filtered density is given; adds C of the step to `sums`.
    pub fn step_back(
        &mut self,
        model: &PppModel,
        k: usize,
        filtered: &Density,
        sums: &mut Sums,
    ) -> Result<(), SmoothError> {
        model.transition(k, &mut self.transition);
        self.predict(filtered)?;
        self.take(model, k + 1)?;
        let (n, before) = (self.score.len(), filtered.dim());
        let mut adjoint = Adjoint::packed(&mut self.score, &mut self.information)?;
        self.work.resize(self.work.len().max(n * before.max(1)), 0.0);
        for (pair, &[innovation, variance]) in self.taken.chunks_exact(2 * n).zip(&self.innovations).rev() {
            let (h, gain) = pair.split_at(n);
            adjoint.measurement(h, gain, innovation, variance, &mut self.work[..n])?;
        }
        let step = self.transition.step();
        for block in step.noise {
            if let Some(component) = block.component {
                let sum = adjoint.noise(block)?;
                sums.add(component, sum.quadratic, sum.count);
            }
        }
        let (mut score, mut information) = (vec![0.0; before], vec![0.0; before * before]);
        let mut to = Adjoint::packed(&mut score, &mut information)?;
        adjoint.time_step(&step, &mut to, &mut MatMut::new(&mut self.work, before, n, n)?)?;
        (self.score, self.information) = (score, information);
        Ok(())
    }

    /// m⁻ and P⁻ of the later epoch.
    fn predict(&mut self, filtered: &Density) -> Result<(), SmoothError> {
        let step = self.transition.step();
        let (n, after) = (step.map.columns, step.map.rows());
        let Density { mean, covariance } = &mut self.predicted;
        mean.resize(after, 0.0);
        covariance.resize(after * after, 0.0);
        self.work.resize(self.work.len().max(tiled::prediction_len(after, n)), 0.0);
        let moments = Moments::packed(&filtered.mean, &filtered.covariance)?;
        tiled::predict(&step, moments, &mut MomentsMut::packed(mean, covariance)?, &mut self.work)?;
        MatMut::square(covariance, after)?.mirror_lower();
        Ok(())
    }

    /// Takes the measurements of an epoch in, and keeps rows and gains.
    fn take(&mut self, model: &PppModel, k: usize) -> Result<(), SmoothError> {
        let Self { predicted, taken, innovations, work, .. } = self;
        let n = predicted.dim();
        taken.clear();
        innovations.clear();
        work.resize(work.len().max(n), 0.0);
        let plain = model.form(k) == Form::Sequential;
        for i in model.order(k) {
            let line = model.line(k, i);
            let start = taken.len();
            taken.resize(start + 2 * n, 0.0);
            let (h, gain) = taken[start..].split_at_mut(n);
            line.entries().for_each(|(state, coefficient)| h[state] += coefficient);
            let innovation = line.residual(&predicted.mean);
            let mut p = MatMut::square(&mut predicted.covariance, n)?;
            let (mean, r) = (&mut predicted.mean, model.noise.row(i));
            let update = if plain {
                let (indices, values) = line.columns();
                update_scalar(mean, &mut p, Row::Sparse { indices, values }, innovation, r, gain)
            } else {
                update_scalar_joseph(mean, &mut p, Row::Dense(h), innovation, r, gain, &mut work[..n])
            };
            let update = update.map_err(|_| SmoothError::NotFinite)?;
            innovations.push([innovation, update.innovation_variance]);
        }
        Ok(())
    }
}
