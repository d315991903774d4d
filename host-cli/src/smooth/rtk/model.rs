//! The model of a tape: motion, ambiguities by clusters, coloured noise.
//!
//! ```text
//! state     p, v (, a)   east, north, up about the frame's origin [m, m/s, m/s²]
//!           a_c          ambiguity of each cluster but the reference of its group [units of its arcs]
//!           μ_s, ν_s     coloured noise (multipath) of phase and code of each signal, at the zenith [m]
//! code      y = c_g − e·(p − p₀) + √w ν_s + noise
//! phase     y = c_g − e·(p − p₀) − unit (a_c + d) + √w μ_s + noise
//! Doppler   y = c   − e·v + noise
//! ```
//! with a free common term for each epoch, group and type, which [`super::rows`] eliminates; w is how the configured
//! variance of the measurement (elevation, C/N0) compares with that at the zenith, and its white noise has the variance
//! α + β w. Coloured noise is a first-order Gauss–Markov process: μ⁺ = ρ μ + q, q ~ N(0, σ²(1 − ρ²)), ρ = exp(−h/τ), for
//! phases exp(−h/τ − s/ℓ) after s metres of travel: a rover that moves soon has other multipath.

use super::clusters::{Ambiguity, Clusters, Layout, Layouts, Merge, Visit, visits};
use super::noise::{Kind, Noise};
use super::robust::PerMeasurement;
use super::rows::{Differences, Row};
use super::tape::Tape;
use crate::smooth::model::{Density, Integer, Model, Parameter, Scratch, Sums, Transition};
use std::sync::{Mutex, PoisonError};
use surefix_core::filter::update::{Form, Gauge, Stage, UpdateError, VECTORS, Work};
use surefix_core::linalg::MatMut;

/// Standard deviation of the first position about where it was linearised `[m]`.
const NEW_POSITION: f64 = 50.0;
/// Of a velocity before anything was measured `[m/s]`.
const NEW_VELOCITY: f64 = 50.0;
/// Of an acceleration, likewise `[m/s²]`.
const NEW_ACCELERATION: f64 = 10.0;
/// Of an ambiguity about where its code puts it `[cycles]`.
const NEW_AMBIGUITY: f64 = 100.0;
/// Epochs of an arc whose codes tell about where its ambiguity is.
const ANCHOR: usize = 30;

/// Travel over which the multipath of phases changes to another one `[m]`: some wavelengths.
const TRAVEL: f64 = 2.0;

/// Innovations by type; a copy begins anew.
#[derive(Debug, Default)]
struct Gauges(Mutex<[Gauge<f64>; 3]>);

impl Clone for Gauges {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// A [`Model`] of a tape.
#[derive(Clone)]
pub struct RtkModel<'a> {
    tape: &'a Tape,
    visits: Vec<Visit>,
    /// Phase minus code of each arc, over its first epochs `[m]`.
    anchors: Vec<Option<f64>>,
    clusters: Clusters,
    layouts: Layouts,
    /// Parameters and what they are.
    pub noise: Noise,
    /// How far each measurement is to be trusted: its white noise has its variance divided by this.
    pub trust: PerMeasurement,
    /// Whether each epoch is the first of new states.
    births: Vec<bool>,
    /// Normalised squared innovations and their number, by type, since the last call of [`RtkModel::take_gauges`].
    gauges: Gauges,
    /// Fixes that contradicted others.
    contradictions: usize,
}

impl<'a> RtkModel<'a> {
    /// The model of a tape, all arcs floating.
    pub fn new(tape: &'a Tape, noise: Noise) -> Self {
        let visits = if noise.is_coloured() { visits(tape) } else { Vec::new() };
        let clusters = Clusters::new(tape.arcs().len());
        let mut model = Self {
            tape,
            visits,
            anchors: anchors(tape),
            layouts: Layouts::default(),
            clusters,
            noise,
            trust: PerMeasurement::new(tape.link_count(), 1.0),
            births: Vec::new(),
            gauges: Gauges::default(),
            contradictions: 0,
        };
        model.lay_out();
        model
    }

    fn lay_out(&mut self) {
        self.layouts = Layouts::new(self.tape, &self.clusters, &self.visits);
        let mut last = 0;
        self.births = (0..self.tape.epochs().len())
            .map(|k| {
                let born = k == 0 || {
                    let (before, now) = (self.layouts.of(last), self.layouts.of(k));
                    now.ambiguities.iter().any(|ambiguity| continued(before, now, ambiguity).is_none())
                };
                last = k;
                born
            })
            .collect();
    }

    /// The tape.
    pub fn tape(&self) -> &'a Tape {
        self.tape
    }

    /// Which arcs belong together.
    pub fn clusters(&self) -> &Clusters {
        &self.clusters
    }

    /// Which states there are.
    pub fn layouts(&self) -> &Layouts {
        &self.layouts
    }

    /// Fixes that were left out because they contradict others.
    pub fn contradictions(&self) -> usize {
        self.contradictions
    }

    /// Innovations by type since the last call.
    pub fn take_gauges(&self) -> [Gauge<f64>; 3] {
        std::mem::take(&mut *self.gauges.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// How far the rover went from epoch k to the next, by the engine's answers `[m]`.
    fn travel(&self, k: usize) -> f64 {
        let solutions = self.tape.solutions();
        (solutions[k + 1].position - solutions[k].position).norm()
    }

    fn motion_states(&self) -> usize {
        self.tape.config().motion.states()
    }

    /// The state of an arc's ambiguity, none for one of the reference, and d.
    fn ambiguity(&self, layout: &Layout, arc: usize) -> (Option<usize>, f64) {
        let (cluster, d) = self.clusters.find(arc);
        let place = layout.ambiguities.iter().position(|ambiguity| ambiguity.cluster == cluster);
        (place.map(|i| self.motion_states() + i), d)
    }

    /// Mean and variance of an ambiguity that is born in an epoch.
    fn ambiguity_prior(&self, k: usize, layout: &Layout, ambiguity: &Ambiguity) -> (f64, f64) {
        let arc = &self.tape.arcs()[ambiguity.cluster];
        let sigma = NEW_AMBIGUITY * arc.wavelength / arc.unit;
        let bias = |cluster: usize| {
            let mut bias = None;
            for link in self.tape.links(k) {
                let b = link.phase - link.code;
                if b.is_nan() {
                    continue;
                }
                let (root, d) = self.clusters.find(link.arc as usize);
                if root == cluster {
                    bias = Some(b + arc.unit * d);
                    break;
                }
            }
            bias.or_else(|| self.anchors[cluster])
        };
        let reference = layout.references[ambiguity.group];
        let mean = reference
            .and_then(bias)
            .zip(bias(ambiguity.cluster))
            .map_or(0.0, |(reference, b)| (reference - b) / arc.unit);
        (mean, sigma * sigma)
    }

    /// States of coloured noise of an epoch and their parameters: of phases, then of codes.
    fn coloured_states(&self, k: usize) -> impl Iterator<Item = (usize, usize)> {
        let layout = self.layouts.of(k);
        let first = self.motion_states() + layout.ambiguities.len();
        let of_kind = |kind| layout.visits.iter().map(move |&visit| (kind, self.visits[visit].signal));
        let signals = of_kind(Kind::Phase).chain(of_kind(Kind::Code)).enumerate();
        signals
            .map(move |(i, (kind, signal))| (first + i, self.noise.coloured(kind, self.tape.signals()[signal].group).0))
    }

    /// The rows of one type and group in an epoch; Doppler has one group.
    fn rows(&self, k: usize, kind: Kind, group: usize, rows: &mut Vec<Row>) {
        rows.clear();
        let layout = self.layouts.of(k);
        let motion = self.motion_states();
        let position = self.tape.epochs()[k].position;
        let [alpha, beta] = self.noise.white(kind, group);
        for (link, at) in self.tape.links(k).iter().zip(self.tape.first_link(k)..) {
            let signal = usize::from(link.signal);
            if kind != Kind::Doppler && self.tape.signals()[signal].group != group {
                continue;
            }
            let mut value = match kind {
                Kind::Code => link.code,
                Kind::Phase => link.phase,
                Kind::Doppler => f64::from(link.doppler),
            };
            if value.is_nan() {
                continue;
            }
            let weight = f64::from(link.variances[kind as usize]) / self.noise.zenith(kind);
            let e = link.direction.map(f64::from);
            let first = if kind == Kind::Doppler { 3 } else { 0 };
            let mut entries = [(first, -e[0]), (first + 1, -e[1]), (first + 2, -e[2]), (0, 0.0), (0, 0.0)];
            let mut len = 3;
            if kind != Kind::Doppler {
                value -= e[0] * position.x + e[1] * position.y + e[2] * position.z;
            }
            if kind == Kind::Phase {
                let arc = link.arc as usize;
                let unit = self.tape.arcs()[arc].unit;
                let (state, d) = self.ambiguity(layout, arc);
                value += unit * d;
                if let Some(state) = state {
                    entries[len] = (state, -unit);
                    len += 1;
                }
            }
            let coloured = layout.visits.iter().position(|&visit| self.visits[visit].signal == signal);
            if let Some(place) = coloured.filter(|_| kind != Kind::Doppler) {
                let first = motion + layout.ambiguities.len();
                let of_kind = if kind == Kind::Phase { 0 } else { layout.visits.len() };
                entries[len] = (first + of_kind + place, weight.sqrt());
                len += 1;
            }
            let trust = self.trust.get(at, kind);
            rows.push(Row { entries, len, value, weight, trust, variance: (alpha + beta * weight) / trust, link: at });
        }
    }

    /// Calls `each` with type, group and row of each measurement of an epoch, and E[e²] given all measurements: with the
    /// common term c | x ~ N(r̄, 1/W) it is (rᵢ − r̄)² + (hᵢ − h̄) P (hᵢ − h̄)ᵀ + 1/W.
    pub fn each_residual(&self, k: usize, smoothed: &Density, mut each: impl FnMut(Kind, usize, &Row, f64)) {
        let mut rows = Vec::new();
        let mut states: Vec<usize> = Vec::new();
        let mut local: Vec<f64> = Vec::new();
        for kind in Kind::ALL {
            for group in 0..self.groups(kind) {
                self.rows(k, kind, group, &mut rows);
                if rows.len() < 2 {
                    continue;
                }
                states.clear();
                for &(state, _) in rows.iter().flat_map(Row::entries) {
                    if !states.contains(&state) {
                        states.push(state);
                    }
                }
                let m = states.len();
                local.clear();
                local.extend(
                    states
                        .iter()
                        .flat_map(|&i| states.iter().map(move |&j| (i, j)))
                        .map(|(i, j)| smoothed.covariance(i, j)),
                );
                let weights: f64 = rows.iter().map(|row| 1.0 / row.variance).sum();
                let place = |state: usize| states.iter().position(|&other| other == state).unwrap_or(0);
                let mut mean_row = vec![0.0; m];
                let mut mean = 0.0;
                for row in &rows {
                    mean += row.residual(&smoothed.mean) / (row.variance * weights);
                    for &(i, h) in row.entries() {
                        mean_row[place(i)] += h / (row.variance * weights);
                    }
                }
                let mut difference = vec![0.0; m];
                for row in &rows {
                    difference.iter_mut().zip(&mean_row).for_each(|(d, mean)| *d = -mean);
                    for &(i, h) in row.entries() {
                        difference[place(i)] += h;
                    }
                    let spread: f64 = difference
                        .iter()
                        .zip(local.chunks_exact(m))
                        .map(|(d, p)| d * p.iter().zip(&difference).map(|(p, d)| p * d).sum::<f64>())
                        .sum();
                    let residual = row.residual(&smoothed.mean) - mean;
                    each(kind, group, row, residual * residual + spread + 1.0 / weights);
                }
            }
        }
    }

    /// Number of groups of a type.
    pub fn groups(&self, kind: Kind) -> usize {
        match kind {
            Kind::Doppler => usize::from(self.tape.config().motion.order() > 1),
            Kind::Code | Kind::Phase => self.tape.groups().len(),
        }
    }

    /// Updates with all measurements of a type.
    fn take(
        &self,
        k: usize,
        kind: Kind,
        density: &mut Density,
        (rows, differences): (&mut Vec<Row>, &mut Differences),
        buffers: &mut [Vec<f64>; 8],
    ) -> Result<Gauge<f64>, UpdateError> {
        let n = density.dim();
        differences.reset(n);
        for group in 0..self.groups(kind) {
            self.rows(k, kind, group, rows);
            differences.push(rows);
        }
        if differences.is_empty() {
            return Ok(Gauge::default());
        }
        let [correction, vectors, innovations, ..] = buffers;
        correction.clear();
        correction.resize(n, 0.0);
        vectors.resize(VECTORS * n, 0.0);
        innovations.clear();
        innovations.extend((0..differences.len()).map(|row| differences.innovation(row, &density.mean)));
        let work = Work { rows: MatMut::new(&mut [], 0, n, n)?, vectors: MatMut::new(vectors, VECTORS, n, n)? };
        // The prior of new states is wide.
        let form = if self.births[k] { Form::Joseph } else { Form::Sequential };
        let mut stage = Stage::begin(form, correction, MatMut::square(&mut density.covariance, n)?, work)?;
        stage.independent(&*differences, 0..differences.len(), |i| innovations[i], |i| differences.variances[i])?;
        let gauge = stage.finish()?;
        density.mean.iter_mut().zip(&*correction).for_each(|(mean, correction)| *mean += correction);
        Ok(gauge)
    }
}

/// Where a state of the layout `now` comes from in the one `before`: its own state and that of the reference of now, as
/// indices of ambiguities, if both were live.
fn continued(before: &Layout, now: &Layout, ambiguity: &Ambiguity) -> Option<[Option<usize>; 2]> {
    let place = |cluster: usize| {
        let state = before.ambiguities.iter().position(|ambiguity| ambiguity.cluster == cluster);
        let is_reference = before.references.get(ambiguity.group).is_some_and(|&r| r == Some(cluster));
        (state.is_some() || is_reference).then_some(state)
    };
    Some([place(ambiguity.cluster)?, place(now.references[ambiguity.group]?)?])
}

/// Phase minus code of each arc over its first epochs.
fn anchors(tape: &Tape) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0usize); tape.arcs().len()];
    for k in 0..tape.epochs().len() {
        for link in tape.links(k) {
            let b = link.phase - link.code;
            if let Some((sum, count)) = sums.get_mut(link.arc as usize).filter(|(_, n)| *n < ANCHOR && !b.is_nan()) {
                *sum += b;
                *count += 1;
            }
        }
    }
    sums.into_iter().map(|(sum, count)| (count > 0).then(|| sum / count as f64)).collect()
}

impl Model for RtkModel<'_> {
    fn epochs(&self) -> usize {
        self.tape.epochs().len()
    }

    fn states(&self, k: usize) -> usize {
        let layout = self.layouts.of(k);
        self.motion_states() + layout.ambiguities.len() + 2 * layout.visits.len()
    }

    fn prior(&self, density: &mut Density) {
        let n = self.states(0);
        density.reset(n);
        let sigmas = [NEW_POSITION, NEW_VELOCITY, NEW_ACCELERATION];
        for (i, sigma) in (0..self.motion_states()).zip(sigmas.iter().flat_map(|sigma| [sigma; 3])) {
            density.covariance[i * n + i] = sigma * sigma;
        }
        let layout = self.layouts.of(0);
        for (i, ambiguity) in (self.motion_states()..).zip(&layout.ambiguities) {
            let (mean, variance) = self.ambiguity_prior(0, layout, ambiguity);
            density.mean[i] = mean;
            density.covariance[i * n + i] = variance;
        }
        for (i, component) in self.coloured_states(0) {
            density.covariance[i * n + i] = self.noise.variance(component);
        }
    }

    fn transition(&self, k: usize, transition: &mut Transition) {
        let (epochs, config) = (self.tape.epochs(), self.tape.config());
        let h = epochs[k + 1].time.since(epochs[k].time);
        let (before, now) = (self.layouts.of(k), self.layouts.of(k + 1));
        let (order, motion) = (config.motion.order(), self.motion_states());
        transition.reset(self.states(k));
        let f = config.motion.transition(h);
        for i in 0..motion {
            let (row, axis) = (i / 3, i % 3);
            let mut entries = [(0, 0.0); 3];
            for (column, entry) in (row..order).enumerate() {
                entries[column] = (3 * entry + axis, f[row][entry]);
            }
            transition.push(0.0, &entries[..order - row]);
        }
        let q = if order == 1 { [[h, 0.0, 0.0], [0.0; 3], [0.0; 3]] } else { config.motion.process_noise(h, 1.0) };
        for axis in 0..3 {
            let states: Vec<usize> = (0..order).map(|derivative| 3 * derivative + axis).collect();
            let shape: Vec<&[f64]> = q[..order].iter().map(|row| &row[..order]).collect();
            let component = Noise::motion(axis);
            transition.noise(&states, &shape, self.noise.variance(component), Some(component));
        }
        for ambiguity in &now.ambiguities {
            let Some([own, reference]) = continued(before, now, ambiguity) else {
                let (mean, variance) = self.ambiguity_prior(k + 1, now, ambiguity);
                transition.birth(mean, variance);
                continue;
            };
            let entries = [(own, 1.0), (reference, -1.0)];
            let mut list = [(0, 0.0); 2];
            let mut len = 0;
            for (state, coefficient) in entries {
                if let Some(state) = state {
                    list[len] = (motion + state, coefficient);
                    len += 1;
                }
            }
            let state = transition.push(0.0, &list[..len]);
            let arc = &self.tape.arcs()[ambiguity.cluster];
            let per_unit = arc.wavelength / arc.unit;
            transition.noise(
                &[state],
                &[&[h * per_unit * per_unit]],
                self.noise.variance(Noise::STAY),
                Some(Noise::STAY),
            );
        }
        let first = motion + before.ambiguities.len();
        for (nth, kind) in [Kind::Phase, Kind::Code].into_iter().enumerate() {
            for &visit in &now.visits {
                let group = self.tape.signals()[self.visits[visit].signal].group;
                let (component, variance) = self.noise.coloured(kind, group);
                let place = before.visits.iter().position(|&other| other == visit);
                match place {
                    Some(place) => {
                        let travel = if kind == Kind::Phase { self.travel(k) / TRAVEL } else { 0.0 };
                        let rho = (-h / self.noise.time_constant(kind) - travel).exp();
                        let state = transition.push(0.0, &[(first + nth * before.visits.len() + place, rho)]);
                        transition.noise(&[state], &[&[1.0 - rho * rho]], variance, Some(component));
                    }
                    None => {
                        let state = transition.push(0.0, &[]);
                        transition.noise(&[state], &[&[1.0]], variance, Some(component));
                    }
                }
            }
        }
    }

    fn update(&self, k: usize, density: &mut Density, scratch: &mut Scratch) -> Result<Gauge<f64>, UpdateError> {
        let mut total = Gauge::default();
        let mut gauges = [Gauge::default(); 3];
        let (mut rows, mut differences) = (Vec::new(), Differences::default());
        // Codes first: they narrow what is wide before phases narrow the rest.
        for kind in Kind::ALL {
            let gauge = self.take(k, kind, density, (&mut rows, &mut differences), &mut scratch.buffers)?;
            gauges[kind as usize] = gauge;
            total.add(gauge);
        }
        let mut sums = self.gauges.0.lock().unwrap_or_else(PoisonError::into_inner);
        sums.iter_mut().zip(gauges).for_each(|(sum, gauge)| sum.add(gauge));
        drop(sums);
        Ok(total)
    }

    /// Of the two parts of a residual, with variances v_a and v_b, E[e_a²] = (v_a/R)² E[e²] + v_a v_b/R. Coloured noise has
    /// its variance from the first epoch on, before any step.
    fn residuals(&self, k: usize, smoothed: &Density, _scratch: &mut Scratch, sums: &mut Sums) {
        if k == 0 {
            for (i, component) in self.coloured_states(0) {
                let square = smoothed.mean[i] * smoothed.mean[i] + smoothed.covariance(i, i);
                sums.add(component, square, 1.0);
            }
        }
        self.each_residual(k, smoothed, |kind, group, row, square| {
            let [a, b] = self.noise.white_components(kind, group);
            let [alpha, beta] = self.noise.white(kind, group);
            let (v_a, v_b, r) = (alpha / row.trust, beta * row.weight / row.trust, row.variance);
            let cross = v_a * v_b / r;
            sums.add(a, ((v_a / r) * (v_a / r) * square + cross) * row.trust, 1.0);
            sums.add(b, ((v_b / r) * (v_b / r) * square + cross) * row.trust / row.weight, 1.0);
        });
    }

    fn parameters(&self) -> &[Parameter] {
        self.noise.parameters()
    }

    fn set_variances(&mut self, variances: &[f64]) {
        self.noise.set(variances);
    }

    fn integers(&self, k: usize, integers: &mut Vec<Integer>) {
        integers.clear();
        let motion = self.motion_states();
        integers.extend(
            self.layouts
                .of(k)
                .ambiguities
                .iter()
                .enumerate()
                .filter_map(|(i, ambiguity)| Some(Integer { state: motion + i, arc: ambiguity.pair? })),
        );
    }

    fn fix(&mut self, _k: usize, integers: &[Integer], values: &[f64]) -> usize {
        let mut contradictions = 0;
        for (integer, &value) in integers.iter().zip(values) {
            let Some(&[cluster, reference]) = self.layouts.pairs.get(integer.arc) else { continue };
            if self.clusters.merge(cluster, reference, value) == Merge::Contradiction {
                contradictions += 1;
            }
        }
        self.contradictions += contradictions;
        contradictions
    }

    fn settle(&mut self) {
        self.lay_out();
    }

    fn release(&mut self) {
        self.clusters = Clusters::new(self.tape.arcs().len());
        self.contradictions = 0;
        self.lay_out();
    }
}
