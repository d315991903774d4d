//! Integers of an epoch, and how far its position may be off.

use super::{BANDS, DoubleDifferenceError, DoubleDifferenceFilter, KINEMATIC};
use crate::integer::Method;
use crate::integer::condition::condition_on_integers;
use crate::integer::subset::resolve_subset;
use crate::integrity::protection::{Basis, Levels, Status};
use crate::linalg::{Mat, MatMut, copy, head, head_mut};
use crate::real::Real;
use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

/// Memory of the integer step.
#[derive(Debug)]
pub(super) struct Integers<T, const A: usize> {
    whole: [f64; A],
    fraction: [T; A],
    mean: [T; A],
    states: [usize; A],
    q: [[T; A]; A],
    factor: [[T; A]; A],
    cross: [[T; 3]; A],
    residual: [T; A],
    indices: Vec<u8, A>,
    values: Vec<f64, A>,
}

impl<T: Real, const A: usize> Integers<T, A> {
    /// Forgets integers.
    pub fn clear(&mut self) {
        self.indices.clear();
        self.values.clear();
    }

    pub const fn new() -> Self {
        Self {
            whole: [0.0; A],
            fraction: [T::ZERO; A],
            mean: [T::ZERO; A],
            states: [0; A],
            q: [[T::ZERO; A]; A],
            factor: [[T::ZERO; A]; A],
            cross: [[T::ZERO; 3]; A],
            residual: [T::ZERO; A],
            indices: Vec::new(),
            values: Vec::new(),
        }
    }
}

/// What an epoch came to. Positions are from the base, in the frame of the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The answer: given the integers if they count as right, else the float position `[m]`.
    pub position: Vector3<f64>,
    /// Its covariance `[m²]`.
    pub covariance: Matrix3<f64>,
    /// What it rests on.
    pub basis: Basis,
    /// How many ambiguities were fixed, whether they count or not.
    pub fixed: usize,
    /// Position and covariance given the integers that were found, whether they count or not.
    pub conditional: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// 1 − P_s of the fixed set; 1 without.
    pub failure: f64,
    /// Bootstrapped success rate of all ambiguities.
    pub full_success: f64,
    /// Ratio of the second-best and best squared norm; 0 without.
    pub ratio: f64,
    /// Protection levels `[m]`.
    pub levels: Option<Levels>,
    /// Against the alert limits.
    pub status: Status,
    /// β, if R* was learned.
    pub beta: Option<f64>,
    /// Double differences whose noise the gate raised.
    pub gated: u32,
}

impl<T: Real, const A: usize, const N: usize, const M: usize> DoubleDifferenceFilter<T, A, N, M> {
    /// Ambiguities less what is whole of them, and their covariance; returns how many there are.
    fn gather(&mut self) -> usize {
        let a = BANDS * self.satellites.len();
        let Self { integers, density, .. } = self;
        let p = density.view(KINEMATIC + a).1;
        for i in 0..a {
            let mean = density.mean.get(KINEMATIC + i).copied().unwrap_or(0.0);
            let whole = libm::round(mean);
            if let (Some(to), Some(rest)) = (integers.whole.get_mut(i), integers.fraction.get_mut(i)) {
                (*to, *rest) = (whole, T::from_f64(mean - whole));
            }
            if let Some(row) = integers.q.get_mut(i) {
                for (j, entry) in head_mut(row, a).iter_mut().enumerate() {
                    *entry = p.at(KINEMATIC + i.max(j), KINEMATIC + i.min(j));
                }
            }
        }
        a
    }

    /// Bootstrapped success rate of all ambiguities after decorrelation.
    pub(super) fn full_success_rate(&mut self) -> Result<f64, DoubleDifferenceError> {
        let a = self.gather();
        let q = Mat::new(self.integers.q.as_flattened(), a, a, A)?;
        Ok(self.workspace.success_rate(head(&self.integers.fraction, a), q)?.success)
    }

    /// Fixes what can be fixed of the density of now, and bounds the answer.
    pub(super) fn answer(&mut self) -> Result<Answer, DoubleDifferenceError> {
        let Some(factors) = self.factors else { return Err(DoubleDifferenceError::NotStarted) };
        let (squares, rows) = self.learned.gauge;
        self.window.push(squares, rows);
        let n = self.states();
        let float = (self.position(), Matrix3::from_fn(|i, j| self.density.view(n).1.at(i, j).to_f64()));
        let mut answer = Answer {
            position: float.0,
            covariance: float.1,
            basis: Basis::Float,
            fixed: 0,
            conditional: None,
            failure: 1.0,
            full_success: 0.0,
            ratio: 0.0,
            levels: None,
            status: Status::Unmonitored,
            beta: self.learned.beta,
            gated: self.gated,
        };
        // Integers that cannot be found leave the float answer.
        let found = self.resolve(&mut answer).unwrap_or(false);
        if let Some(conditional) = found.then(|| self.condition().ok()).flatten() {
            answer.conditional = Some(conditional);
            // Data that contradict are not outweighed by a success rate, which knows nothing of biases.
            if answer.ratio >= self.options.veto {
                answer.basis = factors.basis(answer.failure, answer.ratio >= self.options.ratio);
            }
            if answer.basis != Basis::Float {
                (answer.position, answer.covariance) = conditional;
            }
        } else {
            self.integers.clear();
            (answer.fixed, answer.failure, answer.ratio) = (0, 1.0, 0.0);
        }
        if !self.options.two_passes {
            self.success = answer.full_success;
        }
        let inflation = if self.options.inflate { self.window.inflation() } else { 1.0 };
        answer.levels = factors.levels(&answer.covariance, inflation);
        answer.status = factors.status(answer.levels);
        Ok(answer)
    }

    /// Chooses a subset and resolves it; false if there is none.
    fn resolve(&mut self, answer: &mut Answer) -> Result<bool, DoubleDifferenceError> {
        let a = self.gather();
        let s = self.satellites.len();
        self.order.clear();
        let mut of: Vec<u8, A> = Vec::new();
        for i in 0..a {
            let _ = of.push(i.checked_rem(s).unwrap_or(0) as u8);
        }
        for i in 0..s {
            let _ = self.order.push(i as u8);
        }
        let sine = |i: u8| self.positions.get(1 + usize::from(i)).map_or(0.0, |sight| sight.sin_elevation);
        self.order.sort_unstable_by(|&i, &j| sine(j).total_cmp(&sine(i)).then(i.cmp(&j)));
        let Self { integers, workspace, options, order, .. } = self;
        let q = Mat::new(integers.q.as_flattened(), a, a, A)?;
        let fraction = head(&integers.fraction, a);
        let found = resolve_subset(fraction, q, &of, order, &options.subset, workspace)?;
        let Some(subset) = found else {
            answer.full_success = workspace.success_rate(fraction, q)?.success;
            return Ok(false);
        };
        answer.full_success = subset.full_success_rate.success;
        answer.failure = subset.success_rate.failure;
        answer.ratio = subset.ratio.to_f64();
        answer.fixed = subset.indices.len();
        for (&index, value) in subset.indices.iter().zip(subset.values) {
            let _ = integers.indices.push(index as u8);
            let _ = integers.values.push(value.to_f64());
        }
        Ok(subset.method == Method::LeastSquares)
    }

    /// Position and covariance given the integers found.
    fn condition(&mut self) -> Result<(Vector3<f64>, Matrix3<f64>), DoubleDifferenceError> {
        let (n, m) = (self.states(), self.integers.indices.len());
        let position = self.position();
        let Self { integers, density, rows, .. } = self;
        // The mean of the joint density about position and whole ambiguities, in the memory of the update.
        let Some(mean) = rows.as_flattened_mut().get_mut(..n) else { return Err(DoubleDifferenceError::Capacity) };
        mean.fill(T::ZERO);
        copy(mean.get_mut(KINEMATIC..).unwrap_or_default(), head(&integers.fraction, n - KINEMATIC));
        for ((state, value), (&index, &whole)) in
            integers.states.iter_mut().zip(&mut integers.mean).zip(integers.indices.iter().zip(&integers.values))
        {
            (*state, *value) = (KINEMATIC + usize::from(index), T::from_f64(whole));
        }
        let (mut shift, mut covariance) = ([T::ZERO; 3], [[T::ZERO; 3]; 3]);
        condition_on_integers(
            mean,
            density.view(n).1,
            &[0, 1, 2],
            head(&integers.states, m),
            head(&integers.mean, m),
            &mut MatMut::new(integers.factor.as_flattened_mut(), m, m, A)?,
            &mut MatMut::new(integers.cross.as_flattened_mut(), m, 3, 3)?,
            head_mut(&mut integers.residual, m),
            &mut shift,
            &mut MatMut::new(covariance.as_flattened_mut(), 3, 3, 3)?,
        )?;
        let position = position + Vector3::from(shift.map(T::to_f64));
        Ok((position, Matrix3::from_fn(|i, j| covariance[i][j].to_f64())))
    }

    /// Integers found in the latest epoch: index among the ambiguities, and value `[cycles]`.
    pub fn integers(&self) -> impl Iterator<Item = (usize, i64)> + '_ {
        self.integers.indices.iter().zip(&self.integers.values).map(|(&index, &value)| {
            let index = usize::from(index);
            (index, (value + self.integers.whole.get(index).copied().unwrap_or(0.0)) as i64)
        })
    }
}
