//! Recorded epochs of the multi-band models (DD-IF and SD-IF) of Greiff et al. (2023), as the smoother takes them.
//!
//! The same satellites at every epoch. Ambiguities move by a random walk whose variance rises where the detector flags a
//! slip ([`Model::detect`]); fixed ones are dropped from the states and C_n n from the measurements, epoch by epoch.
//! With fixed integers the transition brings no likelihood of their jumps, as the paper's jump process has none.
//!
//! Parameters: σ_x², σ_y², σ_z², σ_I², σ_T² [, σ_t²], then the variances of code, phase, Doppler, ionosphere, troposphere
//! [, clock].
//!
//! Memory: the records, and some words for each ambiguity and epoch. Cost of an epoch: a transition and a detection are
//! linear in the number of states, an update is cubic ([`update`]). Panics where an epoch is asked for that is not there;
//! records that do not fit are refused by [`MultiBand::new`].

mod groups;
mod places;
mod settings;
#[cfg(test)]
mod tests;
mod update;

pub use settings::{Prior, Record, Settings};

use super::model::{Density, Integer, Model, Parameter, Scratch, Sums, Transition};
use groups::Groups;
use places::Places;
use surefix_core::filter::slip::jumped;
use surefix_core::filter::update::{Gauge, UpdateError};
use surefix_core::model::multi_band::{BANDS, Component, Layout, MultiBandModel, Signal};
use surefix_core::model::partially_linear::Nonlinear;
use thiserror::Error;

/// Why records do not make a model.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MultiBandError {
    /// There are none, or none with two satellites.
    #[error("there is no epoch with two satellites or more")]
    Empty,
    /// An epoch differs from the first in its numbers of satellites or measurements.
    #[error("epoch {epoch} has not the satellites and measurements of epoch 0; leave it out")]
    Epoch {
        /// Its number.
        epoch: usize,
    },
}

/// The model of all recorded epochs.
#[derive(Clone, Debug)]
pub struct MultiBand {
    settings: Settings,
    layout: Layout,
    records: Vec<Record>,
    parameters: Vec<Parameter>,
    /// For each step k → k + 1, which ambiguities slip.
    flags: Vec<Vec<bool>>,
    /// For each epoch, the number of slips of each ambiguity before it.
    slips: Vec<Vec<usize>>,
    /// For each epoch and ambiguity its value, NaN where it is free.
    fixed: Vec<Vec<f64>>,
    places: Vec<Places>,
    ambiguous: Groups,
    unambiguous: Groups,
    virtual_states: Vec<usize>,
}

impl MultiBand {
    /// Takes recorded epochs at equal intervals.
    pub fn new(settings: Settings, records: Vec<Record>) -> Result<Self, MultiBandError> {
        let first = records.first().filter(|first| first.satellites.len() > 1).ok_or(MultiBandError::Empty)?;
        let model = settings.model(&first.satellites);
        let layout = model.layout();
        let ambiguities = layout.ambiguities().len();
        let fits = |record: &Record| {
            record.satellites.len() == layout.satellites
                && record.virtual_rows.len() == model.virtual_rows()
                && record.signals.iter().all(|signal| signal.len() == ambiguities)
        };
        if let Some(epoch) = records.iter().position(|record| !fits(record)) {
            return Err(MultiBandError::Epoch { epoch });
        }
        let (ambiguous, unambiguous) = (Groups::new(&model, true), Groups::new(&model, false));
        let states = (0..model.virtual_rows()).filter_map(|row| model.virtual_row(row)).map(|(state, _)| state);
        let count = records.len();
        Ok(Self {
            parameters: parameters(&settings, layout.clocks),
            layout,
            flags: vec![vec![false; ambiguities]; count - 1],
            slips: vec![vec![0; ambiguities]; count],
            fixed: vec![vec![f64::NAN; ambiguities]; count],
            places: vec![Places::new(&layout, |_| false); count],
            ambiguous,
            unambiguous,
            virtual_states: states.collect(),
            records,
            settings,
        })
    }

    /// Where the states of the whole model are.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Its settings; variances are those in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// For each step k → k + 1, which ambiguities are flagged.
    pub fn flags(&self) -> &[Vec<bool>] {
        &self.flags
    }

    /// The values of an epoch's ambiguities `[cycles]`, NaN where they are free.
    pub fn fixed(&self, k: usize) -> &[f64] {
        &self.fixed[k]
    }

    /// Sets flags, as if they were detected.
    pub fn set_flags(&mut self, flags: &[Vec<bool>]) {
        for (step, flags) in flags.iter().enumerate().take(self.flags.len()) {
            self.flags[step].clone_from(flags);
            self.count_slips(step);
        }
    }

    /// Counts slips up to the end of a step from those up to its start.
    fn count_slips(&mut self, step: usize) {
        let (before, after) = self.slips.split_at_mut(step + 1);
        for ((after, before), &slip) in after[0].iter_mut().zip(&before[step]).zip(&self.flags[step]) {
            *after = before + usize::from(slip);
        }
    }

    /// The model of an epoch.
    fn at(&self, k: usize) -> MultiBandModel<'_> {
        self.settings.model(&self.records[k].satellites)
    }

    /// Whether all ambiguities of an epoch are fixed.
    fn resolved(&self, k: usize) -> bool {
        self.places[k].count() + self.layout.ambiguities().len() == self.layout.states()
    }

    /// The groups of rows of an epoch.
    fn groups(&self, k: usize) -> &Groups {
        if self.resolved(k) { &self.unambiguous } else { &self.ambiguous }
    }

    /// First parameter that belongs to the measurements.
    fn noise_parameter(&self) -> usize {
        components(self.layout.clocks)
    }
}

/// Number of components of the process noise.
fn components(clocks: bool) -> usize {
    if clocks { Component::ALL.len() } else { Component::ALL.len() - 1 }
}

/// Names and units of the parameters of the process noise.
const MOTION: [(&str, &str); Component::ALL.len()] = [
    ("random walk of p^X", "m/√s"),
    ("random walk of p^Y", "m/√s"),
    ("random walk of v^Z", "m/s^1.5"),
    ("random walk of the ionosphere's rate", "m/s^1.5"),
    ("random walk of the troposphere's rate", "m/s^1.5"),
    ("random walk of the clocks' rate", "m/s^1.5"),
];

/// Bounds of all variances: standard deviations from a micrometre to a kilometre.
const BOUNDS: [f64; 2] = [1e-12, 1e6];

fn parameters(settings: &Settings, clocks: bool) -> Vec<Parameter> {
    let motion = MOTION.iter().zip(settings.motion.variances).take(components(clocks));
    let motion = motion.map(|(&(name, unit), variance)| (name, unit, variance, true));
    let variances = settings.variances;
    let noise = [
        ("code noise", "m", variances.code),
        ("phase noise", "m", variances.phase),
        ("Doppler noise", "m/s", variances.doppler),
        ("noise of the ionosphere's model", "m", variances.ionosphere),
        ("noise of the troposphere's model", "m", variances.troposphere),
        ("noise of the clocks' model", "m", variances.clock),
    ];
    let noise = noise.into_iter().take(components(clocks));
    let noise = noise.map(|(name, unit, variance)| (name, unit, variance, settings.learn_noise));
    let parameter = |(name, unit, variance, learned): (&str, &'static str, f64, bool)| Parameter {
        name: name.to_owned(),
        unit,
        variance,
        bounds: BOUNDS,
        learned,
    };
    motion.chain(noise).map(parameter).collect()
}

impl Model for MultiBand {
    fn epochs(&self) -> usize {
        self.records.len()
    }

    fn states(&self, k: usize) -> usize {
        self.places[k].count()
    }

    fn prior(&self, density: &mut Density) {
        let (places, prior, ambiguities) = (&self.places[0], &self.settings.prior, self.layout.ambiguities());
        let n = places.count();
        density.reset(n);
        for (place, &state) in places.left().iter().enumerate() {
            density.covariance[place * n + place] = match prior.kinematic.get(state) {
                Some(&variance) => variance,
                None if ambiguities.contains(&state) => prior.ambiguity,
                None => prior.bias,
            };
        }
    }

    fn transition(&self, k: usize, transition: &mut Transition) {
        let (before, after) = (&self.places[k], &self.places[k + 1]);
        let ambiguities = self.layout.ambiguities();
        transition.reset(before.count());
        for &state in after.left() {
            let rate = self.layout.rate(state).and_then(|rate| before.of(rate));
            match (before.of(state), rate) {
                (Some(state), Some(rate)) => {
                    transition.push(0.0, &[(state, 1.0), (rate, self.settings.motion.interval)])
                }
                (Some(state), None) => transition.push(0.0, &[(state, 1.0)]),
                (None, _) => transition.push(self.fixed[k][state - ambiguities.start], &[]),
            };
        }
        let slipped = |i: usize| self.flags[k][i];
        self.at(k + 1).process_noise(&self.settings.motion, slipped, &mut |mut block| {
            for state in &mut block.states[..block.dim] {
                match after.of(*state) {
                    Some(place) => *state = place,
                    None => return,
                }
            }
            transition.noise.push(block);
        });
    }

    fn forget_detections(&mut self) {
        self.flags.iter_mut().for_each(|flags| flags.fill(false));
        self.slips.iter_mut().for_each(|slips| slips.fill(0));
    }

    fn detect(&mut self, k: usize, predicted: &Density, scratch: &mut Scratch) -> bool {
        let Some(step) = k.checked_sub(1) else { return false };
        let (m, places) = (self.layout.differences(), &self.places[k]);
        let values = &mut scratch.buffers[0];
        values.clear();
        values.resize(2 * m, 0.0);
        let model = self.at(k);
        model.evaluate(&predicted.mean[Layout::Z], values);
        let mut flags = std::mem::take(&mut scratch.flags);
        flags.clear();
        for band in 0..BANDS {
            let (combination, wavelength) = (self.settings.bands.raw()[band], self.settings.bands.wavelength(band));
            for (i, range) in values.iter().take(m).enumerate() {
                // Fixed ambiguities do not slip: the fix says what they are.
                if places.of(self.layout.ambiguity(band, i)).is_none() {
                    flags.push(false);
                    continue;
                }
                let mut innovation = self.records[k].signal(Signal::Phase, band, i) - range;
                model.linear_entries(Signal::Phase, &combination, i, &mut |state, coefficient| {
                    if let Some(place) = places.of(state) {
                        innovation -= coefficient * predicted.mean[place];
                    }
                });
                flags.push(jumped(innovation / wavelength, self.settings.threshold));
            }
        }
        let changed = flags != self.flags[step];
        self.flags[step].clone_from(&flags);
        scratch.flags = flags;
        self.count_slips(step);
        changed
    }

    fn update(&self, k: usize, density: &mut Density, scratch: &mut Scratch) -> Result<Gauge<f64>, UpdateError> {
        if k == 0 && !self.settings.first_epoch && !self.resolved(k) {
            return Ok(Gauge::default());
        }
        self.take_measurements(k, density, scratch)
    }

    fn residuals(&self, k: usize, smoothed: &Density, scratch: &mut Scratch, sums: &mut Sums) {
        if k > 0 || self.settings.first_epoch || self.resolved(k) {
            self.sum_residuals(k, smoothed, scratch, sums);
        }
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn set_variances(&mut self, variances: &[f64]) {
        for (parameter, &variance) in self.parameters.iter_mut().zip(variances) {
            parameter.variance = variance;
        }
        let split = self.noise_parameter().min(variances.len());
        let (motion, noise) = variances.split_at(split);
        let to = &mut self.settings.variances;
        let noises =
            [&mut to.code, &mut to.phase, &mut to.doppler, &mut to.ionosphere, &mut to.troposphere, &mut to.clock];
        noises.into_iter().zip(noise).for_each(|(to, &variance)| *to = variance);
        self.settings.motion.variances.iter_mut().zip(motion).for_each(|(to, &variance)| *to = variance);
    }

    fn integers(&self, k: usize, integers: &mut Vec<Integer>) {
        integers.clear();
        let count = self.layout.ambiguities().len();
        for (i, state) in self.layout.ambiguities().enumerate() {
            if let Some(state) = self.places[k].of(state) {
                integers.push(Integer { state, arc: self.slips[k][i] * count + i });
            }
        }
    }

    fn fix(&mut self, k: usize, integers: &[Integer], values: &[f64]) -> usize {
        let count = self.layout.ambiguities().len();
        let mut contradictions = 0;
        for (integer, &value) in integers.iter().zip(values) {
            let fixed = &mut self.fixed[k][integer.arc % count];
            if fixed.is_nan() || *fixed == value {
                *fixed = value;
            } else {
                contradictions += 1;
            }
        }
        contradictions
    }

    fn settle(&mut self) {
        for (places, fixed) in self.places.iter_mut().zip(&self.fixed) {
            *places = Places::new(&self.layout, |i| !fixed[i].is_nan());
        }
    }

    fn release(&mut self) {
        self.fixed.iter_mut().for_each(|fixed| fixed.fill(f64::NAN));
        self.settle();
    }
}
