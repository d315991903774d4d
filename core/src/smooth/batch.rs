//! Random smoothing problems with everything that happens to states, and their solution by conditioning the joint
//! density of all epochs at once, for tests.
//!
//! Cost: cubic in the number of all states and measurements, of which a problem has some dozens. Panics where a density is
//! not positive definite, which fails the test.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::test_runner::TestRng;

use super::step::{Block, SparseMap, Step};
use super::{Moments, MomentsMut, disturbance, predict, rts};
use crate::linalg::sequential::{Row, update_scalar};
use crate::linalg::{Mat, MatMut, dot};

/// m and P (packed, full).
pub type Density = (Vec<f64>, Vec<f64>);

/// The owned form of a [`Step`].
#[derive(Clone, Debug, Default)]
pub struct Transition {
    pub columns: usize,
    pub ends: Vec<usize>,
    pub entries: Vec<(usize, f64)>,
    pub offset: Vec<f64>,
    pub blocks: Vec<Block<f64>>,
}

impl Transition {
    pub fn step(&self) -> Step<'_, f64> {
        let map = SparseMap { ends: &self.ends, entries: &self.entries, columns: self.columns };
        Step { map, offset: &self.offset, noise: &self.blocks }
    }

    fn push(&mut self, offset: f64, entries: &[(usize, f64)]) -> usize {
        self.entries.extend_from_slice(entries);
        self.ends.push(self.entries.len());
        self.offset.push(offset);
        self.ends.len() - 1
    }

    /// F, dense by rows.
    pub fn dense(&self) -> Vec<f64> {
        let mut f = vec![0.0; self.ends.len() * self.columns];
        for i in 0..self.ends.len() {
            self.step().map.row(i).iter().for_each(|&(column, c)| f[i * self.columns + column] += c);
        }
        f
    }

    /// Q, dense by rows.
    pub fn noise(&self) -> Vec<f64> {
        let n = self.ends.len();
        let mut q = vec![0.0; n * n];
        for block in &self.blocks {
            for i in 0..block.dim {
                for j in 0..block.dim {
                    q[block.states[i] * n + block.states[j]] += block.scale * block.shape[i][j];
                }
            }
        }
        q
    }
}

/// Independent measurements of one epoch.
#[derive(Clone, Debug)]
pub struct Measurements {
    pub rows: Vec<Vec<f64>>,
    pub values: Vec<f64>,
    pub variances: Vec<f64>,
}

/// A linear model of a few epochs.
#[derive(Clone, Debug)]
pub struct Problem {
    pub prior: Density,
    pub transitions: Vec<Transition>,
    pub measurements: Vec<Measurements>,
}

/// Between `low` and `high`.
fn uniform(rng: &mut TestRng, low: f64, high: f64) -> f64 {
    low + (high - low) * f64::from(rng.next_u32()) / f64::from(u32::MAX)
}

fn chance(rng: &mut TestRng, probability: f64) -> bool {
    uniform(rng, 0.0, 1.0) < probability
}

/// One time step from n states: motion with coupled pairs, deaths, changes of reference, births.
fn transition(rng: &mut TestRng, n: usize) -> Transition {
    let mut to = Transition { columns: n, ..Transition::default() };
    let reference = chance(rng, 0.3).then(|| rng.next_u32() as usize % n);
    let mut previous = None;
    for state in 0..n {
        if to.ends.len() + n - state > 3 && chance(rng, 0.2) {
            continue;
        }
        let index = match reference {
            Some(reference) if reference == state => to.push(0.0, &[(state, -1.0)]),
            Some(reference) => to.push(0.0, &[(state, 1.0), (reference, -1.0)]),
            None if state + 1 < n && chance(rng, 0.4) => {
                let step = uniform(rng, 0.1, 2.0);
                to.push(uniform(rng, -0.1, 0.1), &[(state, 1.0), (state + 1, step)])
            }
            None => to.push(0.0, &[(state, 1.0)]),
        };
        let scale = uniform(rng, 0.05, 1.0);
        let component = Some(index % 2);
        match previous.take() {
            Some(other) if chance(rng, 0.5) => {
                let shape = [[1.0, 0.5, 0.0], [0.5, 2.0, 0.0], [0.0; 3]];
                to.blocks.push(Block { states: [other, index, 0], dim: 2, shape, scale, component });
            }
            _ if chance(rng, 0.8) => {
                let shape = [[1.5, 0.0, 0.0], [0.0; 3], [0.0; 3]];
                to.blocks.push(Block { states: [index, 0, 0], dim: 1, shape, scale, component });
            }
            _ => previous = Some(index),
        }
    }
    while to.ends.len() < 6 && chance(rng, 0.4) {
        let index = to.push(uniform(rng, -3.0, 3.0), &[]);
        let (shape, scale) = ([[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], uniform(rng, 1.0, 100.0));
        to.blocks.push(Block { states: [index, 0, 0], dim: 1, shape, scale, component: None });
    }
    to
}

fn measurements(rng: &mut TestRng, n: usize) -> Measurements {
    let m = rng.next_u32() as usize % 4;
    let row =
        |rng: &mut TestRng| (0..n).map(|_| if chance(rng, 0.6) { uniform(rng, -1.0, 1.0) } else { 0.0 }).collect();
    Measurements {
        rows: (0..m).map(|_| row(rng)).collect(),
        values: (0..m).map(|_| uniform(rng, -3.0, 3.0)).collect(),
        variances: (0..m).map(|_| uniform(rng, 0.1, 2.0)).collect(),
    }
}

/// Problems of up to seven epochs and six states.
pub fn problem() -> impl Strategy<Value = Problem> {
    (2..5usize, 1..7usize).prop_perturb(|(n, steps), mut rng| {
        let rng = &mut rng;
        let spread: Vec<f64> = (0..n * n).map(|_| uniform(rng, -1.0, 1.0)).collect();
        let covariance = (0..n * n).map(|k| {
            let (a, b) = (&spread[k / n * n..][..n], &spread[k % n * n..][..n]);
            dot(a, b) + f64::from(u8::from(k / n == k % n))
        });
        let prior = ((0..n).map(|_| uniform(rng, -1.0, 1.0)).collect(), covariance.collect());
        let mut problem = Problem { prior, transitions: Vec::new(), measurements: vec![measurements(rng, n)] };
        let mut n = n;
        for _ in 0..steps {
            problem.transitions.push(transition(rng, n));
            n = problem.transitions.last().unwrap().ends.len();
            problem.measurements.push(measurements(rng, n));
        }
        problem
    })
}

/// What a filter remembers of a measurement.
#[derive(Clone, Debug)]
pub struct Taken {
    pub row: Vec<f64>,
    pub gain: Vec<f64>,
    pub innovation: f64,
    pub variance: f64,
}

/// A filter's pass.
#[derive(Clone, Debug, Default)]
pub struct Filtered {
    /// By epoch; the first is the prior.
    pub predicted: Vec<Density>,
    pub filtered: Vec<Density>,
    pub taken: Vec<Vec<Taken>>,
}

impl Problem {
    /// The Kalman filter.
    pub fn filter(&self) -> Filtered {
        let mut pass = Filtered::default();
        let mut density = self.prior.clone();
        for (k, measurements) in self.measurements.iter().enumerate() {
            if k > 0 {
                let step = self.transitions[k - 1].step();
                let (n, after) = (step.map.columns, step.map.rows());
                let (mut mean, mut p, mut work) = (vec![0.0; after], vec![0.0; after * after], vec![0.0; after * n]);
                let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
                let mut work = MatMut::new(&mut work, after, n, n).unwrap();
                let filtered = Moments::packed(&density.0, &density.1).unwrap();
                predict::predict(&step, filtered, &mut predicted, &mut work).unwrap();
                predicted.covariance.mirror_lower();
                density = (mean, p);
            }
            pass.predicted.push(density.clone());
            let n = density.0.len();
            let mut taken = Vec::new();
            for ((row, &value), &noise) in
                measurements.rows.iter().zip(&measurements.values).zip(&measurements.variances)
            {
                let innovation = value - dot(row, &density.0);
                let mut gain = vec![0.0; n];
                let mut p = MatMut::square(&mut density.1, n).unwrap();
                let update =
                    update_scalar(&mut density.0, &mut p, Row::Dense(row), innovation, noise, &mut gain).unwrap();
                taken.push(Taken { row: row.clone(), gain, innovation, variance: update.innovation_variance });
            }
            pass.taken.push(taken);
            pass.filtered.push(density.clone());
        }
        pass
    }

    /// The smoothed densities by [`rts`], calling `each` with the step, Σ⁻ factored, what is smoothed of x⁺ and the work.
    pub fn smooth(
        &self,
        pass: &Filtered,
        mut each: impl FnMut(usize, Moments<f64>, Moments<f64>, &rts::Work<f64>),
    ) -> Vec<Density> {
        let mut smoothed = pass.filtered.clone();
        for (k, transition) in self.transitions.iter().enumerate().rev() {
            let step = transition.step();
            let (n, after) = (step.map.columns, step.map.rows());
            let (mut mean, mut p) = pass.predicted[k + 1].clone();
            let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
            let (head, tail) = smoothed.split_at_mut(k + 1);
            let next = Moments::packed(&tail[0].0, &tail[0].1).unwrap();
            let filtered = Moments::packed(&pass.filtered[k].0, &pass.filtered[k].1).unwrap();
            let mut out = MomentsMut::packed(&mut head[k].0, &mut head[k].1).unwrap();
            let mut buffer = vec![f64::NAN; rts::buffer_len(after, n)];
            let mut work = rts::Work::new(&mut buffer, after, n).unwrap();
            rts::smooth(&step, filtered, &mut predicted, next, &mut out, &mut work).unwrap();
            out.covariance.mirror_lower();
            each(k, predicted.as_ref(), next, &work);
        }
        smoothed
    }

    /// The smoothed densities by [`disturbance`], calling `each` with every pair before the measurements of x⁺.
    pub fn smooth_by_disturbances(
        &self,
        pass: &Filtered,
        mut each: impl FnMut(usize, &disturbance::Adjoint<f64>),
    ) -> Vec<Density> {
        let mut smoothed = pass.filtered.clone();
        let last = pass.filtered.last().unwrap().0.len();
        let (mut r, mut information) = (vec![0.0; last], vec![0.0; last * last]);
        for k in (0..self.measurements.len()).rev() {
            let n = pass.filtered[k].0.len();
            let mut adjoint = disturbance::Adjoint::packed(&mut r, &mut information).unwrap();
            let filtered = Moments::packed(&pass.filtered[k].0, &pass.filtered[k].1).unwrap();
            let out = &mut smoothed[k];
            let mut out = MomentsMut::packed(&mut out.0, &mut out.1).unwrap();
            let mut work = vec![0.0; n * n];
            adjoint.smooth(filtered, &mut out, &mut MatMut::square(&mut work, n).unwrap()).unwrap();
            out.covariance.mirror_lower();
            for taken in pass.taken[k].iter().rev() {
                let mut work = vec![0.0; n];
                adjoint.measurement(&taken.row, &taken.gain, taken.innovation, taken.variance, &mut work).unwrap();
            }
            if k > 0 {
                each(k - 1, &adjoint);
                let step = self.transitions[k - 1].step();
                let before = step.map.columns;
                let (mut r_before, mut n_before) = (vec![f64::NAN; before], vec![f64::NAN; before * before]);
                let mut to = disturbance::Adjoint::packed(&mut r_before, &mut n_before).unwrap();
                let mut work = vec![f64::NAN; before * n];
                adjoint.time_step(&step, &mut to, &mut MatMut::new(&mut work, before, n, n).unwrap()).unwrap();
                (r, information) = (r_before, n_before);
            }
        }
        smoothed
    }

    /// First state of each epoch among those of all.
    pub fn starts(&self) -> Vec<usize> {
        let sizes = self.transitions.iter().map(|transition| transition.ends.len());
        let mut starts = vec![0, self.prior.0.len()];
        sizes.for_each(|size| starts.push(starts.last().unwrap() + size));
        starts
    }

    /// The joint density of the states of all epochs given all measurements.
    pub fn batch(&self) -> (DVector<f64>, DMatrix<f64>) {
        let starts = self.starts();
        let total = *starts.last().unwrap();
        let (mut mean, mut p) = (DVector::zeros(total), DMatrix::zeros(total, total));
        let n = self.prior.0.len();
        mean.rows_mut(0, n).copy_from_slice(&self.prior.0);
        p.view_mut((0, 0), (n, n)).copy_from(&DMatrix::from_row_slice(n, n, &self.prior.1));
        for (k, transition) in self.transitions.iter().enumerate() {
            let (at, to, n, after) = (starts[k], starts[k + 1], transition.columns, transition.ends.len());
            let f = DMatrix::from_row_slice(after, n, &transition.dense());
            let next = &f * mean.rows(at, n) + DVector::from_column_slice(&transition.offset);
            mean.rows_mut(to, after).copy_from(&next);
            let cross = &f * p.view((at, 0), (n, to));
            let own = &f * p.view((at, at), (n, n)) * f.transpose()
                + DMatrix::from_row_slice(after, after, &transition.noise());
            p.view_mut((to, 0), (after, to)).copy_from(&cross);
            p.view_mut((0, to), (to, after)).copy_from(&cross.transpose());
            p.view_mut((to, to), (after, after)).copy_from(&own);
        }
        let rows: usize = self.measurements.iter().map(|m| m.values.len()).sum();
        let (mut h, mut y, mut r) = (DMatrix::zeros(rows, total), DVector::zeros(rows), DMatrix::zeros(rows, rows));
        let mut i = 0;
        for (measurements, &start) in self.measurements.iter().zip(&starts) {
            for (row, (&value, &variance)) in
                measurements.rows.iter().zip(measurements.values.iter().zip(&measurements.variances))
            {
                row.iter().enumerate().for_each(|(j, &c)| h[(i, start + j)] = c);
                (y[i], r[(i, i)]) = (value, variance);
                i += 1;
            }
        }
        let gain = (&h * &p * h.transpose() + r).cholesky().unwrap().solve(&(&h * &p)).transpose();
        let mean = &mean + &gain * (y - &h * &mean);
        let p = &p - gain * h * &p;
        (mean, p)
    }

    /// Compares densities with those of [`Self::batch`], relative to the standard deviations.
    pub fn assert_batch(&self, smoothed: &[Density], tolerance: f64) {
        let (mean, p) = self.batch();
        for (density, &start) in smoothed.iter().zip(&self.starts()) {
            let n = density.0.len();
            for i in 0..n {
                let sigma = |i: usize| p[(start + i, start + i)].sqrt();
                let off = (density.0[i] - mean[start + i]).abs() / sigma(i);
                assert!(off < tolerance, "mean of state {i}: {off}");
                for j in 0..n {
                    let off = (density.1[i * n + j] - p[(start + i, start + j)]).abs() / (sigma(i) * sigma(j));
                    assert!(off < tolerance, "covariance of states {i} and {j}: {off}");
                }
            }
        }
    }
}

/// The view of a packed matrix.
pub fn square(data: &[f64]) -> Mat<'_, f64> {
    Mat::square(data, (data.len() as f64).sqrt() as usize).unwrap()
}
