//! The model of a tape: motion, a white clock, biases, troposphere, ionosphere, and ambiguities that come and go.
//!
//! ```text
//! state   p (, v)   position relative to the origin (and velocity), ECEF [m, m/s]
//!         c         clock, born anew in each epoch: Φ = 0 [m]
//!         b         inter-system biases [m]
//!         z (, g)   zenith wet delay (and gradients north, east) [m]
//!         I_s       slant delay of each satellite, if any row has a coefficient for it [m]
//!         N_a       ambiguity of each arc that lives in the epoch [m]
//! ```
//! Zhang et al. (2020), eqs. (1) to (6). A state of no noise has no block in Q: P⁻ is what it was, and stays positive
//! definite as long as it was. Codes are taken in before phases: they narrow what is wide.

use super::noise::Noise;
use super::tape::{Kind, Row, Tape};
use super::{Class, Motion, Options};
use crate::smooth::model::{Density, Integer, Model, Parameter, Scratch, Sums, Transition};
use nalgebra::Vector3;
use std::sync::{Mutex, PoisonError};
use surefix_core::filter::update::{Form, Gauge, Rows, Stage, UpdateError, VECTORS, Work};
use surefix_core::linalg::MatMut;

/// A satellite out of sight for longer than this has another slant delay `[s]`.
const GAP: f64 = 600.0;

/// Most coefficients of a row: position, clock, bias, zenith delay, gradients, ionosphere, ambiguity.
const ENTRIES: usize = 10;

/// States of an epoch beside those that every epoch has.
#[derive(Clone, Debug, Default)]
struct Layout {
    /// Visits of satellites, ascending.
    visits: Vec<u32>,
    /// Arcs, ascending.
    arcs: Vec<u32>,
}

/// Squared innovations by row; a copy begins anew.
#[derive(Debug, Default)]
struct Innovations(Mutex<Vec<f64>>);

impl Clone for Innovations {
    fn clone(&self) -> Self {
        let rows = self.0.lock().unwrap_or_else(PoisonError::into_inner).len();
        Self(Mutex::new(vec![f64::NAN; rows]))
    }
}

/// A [`Model`] of a tape.
#[derive(Clone, Debug)]
pub struct PppModel {
    tape: Tape,
    options: Options,
    layouts: Vec<Layout>,
    /// Visit of the satellite of each row, where it has a slant delay.
    visit_of: Vec<u32>,
    /// Whether each row is used.
    active: Vec<bool>,
    /// The variances.
    pub noise: Noise,
    /// N(m, P) before the first epoch, where EM has changed it.
    pub prior: Option<Density>,
    innovations: Innovations,
}

/// A row on the states of its epoch.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    states: [usize; ENTRIES],
    coefficients: [f64; ENTRIES],
    len: usize,
    value: f64,
}

impl Line {
    /// States, and their coefficients.
    pub fn columns(&self) -> (&[usize], &[f64]) {
        (&self.states[..self.len], &self.coefficients[..self.len])
    }

    /// State and coefficient, pair by pair.
    pub fn entries(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let (states, coefficients) = self.columns();
        states.iter().copied().zip(coefficients.iter().copied())
    }

    /// value − h x.
    pub fn residual(&self, x: &[f64]) -> f64 {
        self.value - self.entries().map(|(i, h)| h * x[i]).sum::<f64>()
    }

    /// h P hᵀ.
    pub fn spread(&self, density: &Density) -> f64 {
        let along = |(i, h)| h * self.entries().map(|(j, g)| g * density.covariance(i, j)).sum::<f64>();
        self.entries().map(along).sum()
    }
}

/// The lines of an epoch, as the update takes them.
struct Lines<'a>(&'a [Line]);

impl Rows<f64> for Lines<'_> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        let entries = self.0.get(row).into_iter().flat_map(Line::entries);
        entries.for_each(|(state, coefficient)| entry(state, coefficient));
    }
}

impl PppModel {
    /// The model of a tape that [`Tape::check`] finds sound, at the start of EM.
    pub fn new(tape: Tape, options: Options) -> Self {
        let active = vec![true; tape.rows.len()];
        Self::without(tape, options, active)
    }

    /// The same without the rows that are not `active`.
    pub fn without(tape: Tape, options: Options, active: Vec<bool>) -> Self {
        let noise = Noise::new(&tape, &options, &active);
        let (visits, visit_of) = visits(&tape);
        let mut layouts = vec![Layout::default(); tape.epochs.len()];
        for (visit, &[first, last]) in visits.iter().enumerate() {
            layouts[first..=last].iter_mut().for_each(|layout| layout.visits.push(visit as u32));
        }
        for (arc, of) in tape.arcs.iter().enumerate() {
            let end = (of.last + 1).min(layouts.len());
            let lives = layouts.get_mut(of.first..end).unwrap_or_default();
            lives.iter_mut().for_each(|layout| layout.arcs.push(arc as u32));
        }
        let innovations = Innovations(Mutex::new(vec![f64::NAN; tape.rows.len()]));
        Self { tape, options, layouts, visit_of, active, noise, prior: None, innovations }
    }

    /// The same with other variances, of a tape with the same rows.
    pub fn with_noise(mut self, noise: Noise) -> Self {
        self.noise = noise;
        self
    }

    /// The tape, linearised as it is now.
    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// How it is smoothed.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Whether each row is used.
    pub fn active(&self) -> &[bool] {
        &self.active
    }

    /// Number of rows that are used.
    pub fn observations(&self) -> usize {
        self.active.iter().filter(|active| **active).count()
    }

    /// Linearises the rows about a trajectory, ECEF `[m]`.
    pub fn relinearize(&mut self, positions: &[Vector3<f64>]) {
        self.tape.relinearize(positions);
    }

    /// Of each row of the last forward pass ν²/s, given the rows of its epoch before it; NaN of those not used.
    pub fn innovations(&self) -> Vec<f64> {
        self.innovations.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// How the measurements of an epoch are taken in: those of states that are born in it, with their wide priors, in
    /// Joseph's form where the options have the plain one.
    pub fn form(&self, k: usize) -> Form {
        let born = |before: &Layout, now: &Layout| {
            let within = |now: &[u32], before: &[u32]| now.iter().all(|state| before.binary_search(state).is_ok());
            !(within(&now.arcs, &before.arcs) && within(&now.visits, &before.visits))
        };
        match self.options.form {
            Form::Sequential if k.checked_sub(1).is_none_or(|j| born(&self.layouts[j], &self.layouts[k])) => {
                Form::Joseph
            }
            form => form,
        }
    }

    /// Index of the clock.
    pub fn clock(&self) -> usize {
        match self.options.motion {
            Motion::Walk => 3,
            Motion::ConstantVelocity => 6,
        }
    }

    /// Index of the first inter-system bias.
    pub fn bias(&self) -> usize {
        self.clock() + 1
    }

    /// Index of the zenith wet delay; gradients come behind it.
    pub fn zenith(&self) -> usize {
        self.bias() + self.tape.biases()
    }

    /// Number of states that every epoch has.
    fn common(&self) -> usize {
        self.zenith() + if self.options.gradients { 3 } else { 1 }
    }

    /// State and arc of each ambiguity of an epoch.
    pub fn ambiguities(&self, k: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let layout = &self.layouts[k];
        let first = self.common() + layout.visits.len();
        layout.arcs.iter().enumerate().map(move |(i, &arc)| (first + i, arc as usize))
    }

    /// State and satellite visit of each slant delay of an epoch.
    pub fn slants(&self, k: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let first = self.common();
        self.layouts[k].visits.iter().enumerate().map(move |(i, &visit)| (first + i, visit as usize))
    }

    /// The rows of an epoch that are used, in the order in which they are taken in: codes, then phases.
    pub fn order(&self, k: usize) -> impl Iterator<Item = usize> + '_ {
        let rows = self.tape.epochs[k].rows.clone();
        let of_kind = move |kind| rows.clone().filter(move |&i| self.active[i] && self.tape.rows[i].kind == kind);
        Kind::ALL.into_iter().flat_map(of_kind)
    }

    /// A row of an epoch on its states.
    pub fn line(&self, k: usize, i: usize) -> Line {
        let (row, layout) = (&self.tape.rows[i], &self.layouts[k]);
        let mut line = Line { states: [0; ENTRIES], coefficients: [0.0; ENTRIES], len: 0, value: row.value };
        let mut push = |state: usize, coefficient: f64| {
            (line.states[line.len], line.coefficients[line.len]) = (state, coefficient);
            line.len += 1;
        };
        row.direction.iter().enumerate().for_each(|(axis, &d)| push(axis, d));
        push(self.clock(), 1.0);
        if let Some(isb) = self.tape.groups[usize::from(row.group)].isb {
            push(self.bias() + isb, 1.0);
        }
        push(self.zenith(), row.wet);
        if self.options.gradients {
            row.gradients.iter().enumerate().for_each(|(axis, &m)| push(self.zenith() + 1 + axis, m));
        }
        if let Ok(place) = layout.visits.binary_search(&self.visit_of[i]) {
            push(self.common() + place, row.ionosphere);
        }
        if let (Kind::Phase, Ok(place)) = (row.kind, layout.arcs.binary_search(&row.arc)) {
            push(self.common() + layout.visits.len() + place, 1.0);
        }
        line
    }

    /// Calls `each` with index, smoothed residual and E[e²], (26) of the paper, of each row of an epoch that is used.
    pub fn each_residual(&self, k: usize, smoothed: &Density, mut each: impl FnMut(usize, f64, f64)) {
        for i in self.tape.epochs[k].rows.clone().filter(|&i| self.active[i]) {
            let line = self.line(k, i);
            let residual = line.residual(&smoothed.mean);
            each(i, residual, residual * residual + line.spread(smoothed));
        }
    }

    /// Mean and standard deviation of a state when it is born in an epoch.
    fn births(&self, k: usize, mut each: impl FnMut(f64, f64)) {
        let (priors, epoch) = (&self.options.priors, &self.tape.epochs[k]);
        let offset = epoch.position - self.tape.origin;
        offset.iter().for_each(|&x| each(x, priors.position));
        if self.options.motion == Motion::ConstantVelocity {
            (0..3).for_each(|_| each(0.0, priors.velocity));
        }
        each(epoch.clock, priors.clock);
        (0..self.tape.biases()).for_each(|_| each(0.0, priors.bias));
        each(0.0, priors.zenith);
        if self.options.gradients {
            (0..2).for_each(|_| each(0.0, priors.gradient));
        }
        self.slants(k).for_each(|_| each(0.0, priors.ionosphere));
        self.ambiguities(k).for_each(|(_, arc)| each(self.tape.arcs[arc].prior, priors.ambiguity));
    }

    /// Appends a state that stays and walks, or is born where there is no state before.
    fn walk(
        &self,
        transition: &mut Transition,
        from: Option<usize>,
        [mean, sigma]: [f64; 2],
        (component, variance): (usize, f64),
        h: f64,
    ) {
        match from {
            Some(from) => {
                let state = transition.push(0.0, &[(from, 1.0)]);
                if variance > 0.0 {
                    transition.noise(&[state], &[&[h]], variance, Some(component));
                }
            }
            None => {
                transition.birth(mean, sigma * sigma);
            }
        }
    }

    /// Position (and velocity): F and Q of (2) and (3).
    fn motion(&self, k: usize, h: f64, transition: &mut Transition) {
        let velocity = self.options.motion == Motion::ConstantVelocity;
        for axis in 0..3 {
            let entries = [(axis, 1.0), (3 + axis, h)];
            transition.push(0.0, if velocity { &entries } else { &entries[..1] });
        }
        for axis in 0..3 {
            let (component, variance) = self.noise.process(Class::Motion, axis, k);
            if velocity {
                transition.push(0.0, &[(3 + axis, 1.0)]);
                let shape: [&[f64]; 2] = [&[h * h * h / 3.0, h * h / 2.0], &[h * h / 2.0, h]];
                if variance > 0.0 {
                    transition.noise(&[axis, 3 + axis], &shape, variance, Some(component));
                }
            } else if variance > 0.0 {
                transition.noise(&[axis], &[&[h]], variance, Some(component));
            }
        }
    }
}

/// First and last epoch of each visit of a satellite with rows that know the ionosphere, and the visit of each row (the
/// greatest number where there is none).
fn visits(tape: &Tape) -> (Vec<[usize; 2]>, Vec<u32>) {
    let mut visits: Vec<[usize; 2]> = Vec::new();
    let mut open = std::collections::HashMap::new();
    let mut of = vec![u32::MAX; tape.rows.len()];
    for (k, epoch) in tape.epochs.iter().enumerate() {
        for i in epoch.rows.clone() {
            let Row { satellite, ionosphere, .. } = tape.rows[i];
            if ionosphere == 0.0 {
                continue;
            }
            let key = (satellite.constellation().index(), satellite.number());
            let visit = match open.get(&key) {
                Some(&visit) if epoch.time.since(tape.epochs[visits[visit as usize][1]].time) <= GAP => visit,
                _ => {
                    visits.push([k, k]);
                    (visits.len() - 1) as u32
                }
            };
            open.insert(key, visit);
            visits[visit as usize][1] = k;
            of[i] = visit;
        }
    }
    (visits, of)
}

impl Model for PppModel {
    fn epochs(&self) -> usize {
        self.tape.epochs.len()
    }

    fn states(&self, k: usize) -> usize {
        let layout = &self.layouts[k];
        self.common() + layout.visits.len() + layout.arcs.len()
    }

    fn prior(&self, density: &mut Density) {
        if let Some(prior) = &self.prior {
            density.clone_from(prior);
            return;
        }
        let n = self.states(0);
        density.reset(n);
        let mut state = 0;
        self.births(0, |mean, sigma| {
            density.mean[state] = mean;
            density.covariance[state * n + state] = sigma * sigma;
            state += 1;
        });
    }

    fn transition(&self, k: usize, transition: &mut Transition) {
        let (epochs, priors) = (&self.tape.epochs, &self.options.priors);
        let h = epochs[k + 1].time.since(epochs[k].time);
        let (before, now) = (&self.layouts[k], &self.layouts[k + 1]);
        transition.reset(self.states(k));
        self.motion(k, h, transition);
        transition.birth(epochs[k + 1].clock, priors.clock * priors.clock);
        let process = |class| self.noise.process(class, 0, k);
        for state in self.bias()..self.zenith() {
            self.walk(transition, Some(state), [0.0; 2], process(Class::Biases), h);
        }
        self.walk(transition, Some(self.zenith()), [0.0; 2], process(Class::Zenith), h);
        for state in self.zenith() + 1..self.common() {
            self.walk(transition, Some(state), [0.0; 2], process(Class::Gradients), h);
        }
        let first = self.common();
        for visit in &now.visits {
            let from = before.visits.binary_search(visit).ok().map(|place| first + place);
            self.walk(transition, from, [0.0, priors.ionosphere], process(Class::Ionosphere), h);
        }
        let first = first + before.visits.len();
        for arc in &now.arcs {
            let from = before.arcs.binary_search(arc).ok().map(|place| first + place);
            let birth = [self.tape.arcs[*arc as usize].prior, priors.ambiguity];
            self.walk(transition, from, birth, process(Class::Ambiguities), h);
        }
    }

    fn update(&self, k: usize, density: &mut Density, scratch: &mut Scratch) -> Result<Gauge<f64>, UpdateError> {
        let n = density.dim();
        let order: Vec<usize> = self.order(k).collect();
        if order.is_empty() {
            return Ok(Gauge::default());
        }
        let lines: Vec<Line> = order.iter().map(|&i| self.line(k, i)).collect();
        let [correction, vectors, innovations, ..] = &mut scratch.buffers;
        correction.clear();
        correction.resize(n, 0.0);
        vectors.resize(VECTORS * n, 0.0);
        innovations.clear();
        innovations.extend(lines.iter().map(|line| line.residual(&density.mean)));
        let work = Work { rows: MatMut::new(&mut [], 0, n, n)?, vectors: MatMut::new(vectors, VECTORS, n, n)? };
        let p = MatMut::square(&mut density.covariance, n)?;
        let mut stage = Stage::begin(self.form(k), correction, p, work)?;
        let mut squares = self.innovations.0.lock().unwrap_or_else(PoisonError::into_inner);
        let lines = Lines(&lines);
        for (place, &i) in order.iter().enumerate() {
            let before = stage.gauge().normalized_innovation_squared;
            stage.independent(&lines, place..place + 1, |at| innovations[at], |_| self.noise.row(i))?;
            squares[i] = stage.gauge().normalized_innovation_squared - before;
        }
        drop(squares);
        let gauge = stage.finish()?;
        density.mean.iter_mut().zip(&*correction).for_each(|(mean, correction)| *mean += correction);
        Ok(gauge)
    }

    fn residuals(&self, k: usize, smoothed: &Density, _scratch: &mut Scratch, sums: &mut Sums) {
        self.each_residual(k, smoothed, |i, _, square| self.noise.gather(i, square, sums));
    }

    fn parameters(&self) -> &[Parameter] {
        self.noise.parameters()
    }

    fn set_variances(&mut self, variances: &[f64]) {
        self.noise.set(variances);
    }

    fn integers(&self, _k: usize, integers: &mut Vec<Integer>) {
        integers.clear();
    }

    fn fix(&mut self, _k: usize, _integers: &[Integer], _values: &[f64]) -> usize {
        0
    }

    fn settle(&mut self) {}

    fn release(&mut self) {}
}
