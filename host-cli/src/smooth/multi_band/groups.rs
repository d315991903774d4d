//! Measurements of an epoch in groups of rows with independent noise between the groups.
//!
//! Orthonormal combinations of the bands keep their noise independent. Signals without (free) ambiguities see geometry and
//! ionosphere only, hence two combinations say all and the third is noise alone: it enters the likelihood, not the state.
//! Phases with ambiguities are taken band by band. For ten satellites these are 63 rows for the paper's 81; with all
//! ambiguities fixed, 54.
//!
//! Cost: the groups of a model are made once, some kilobytes; a row is walked in as many steps as it has coefficients. States
//! that are gone are left out. Panics where a row or a state is not one of the model's, which [`super::MultiBand`] never asks.

use super::places::Places;
use surefix_core::filter::update::Rows;
use surefix_core::model::multi_band::{Combination, Layout, MultiBandModel, Signal};

/// Rows of one signal and combination, a row for each difference.
#[derive(Clone, Debug)]
pub struct Group {
    /// The signal.
    pub signal: Signal,
    /// Coefficients of the bands, of length 1.
    pub combination: Combination,
    /// Factor of the nonlinear part.
    pub geometry: f64,
    /// The linear part of each row, by states of the whole model.
    pub entries: Vec<Vec<(usize, f64)>>,
}

/// The groups of an epoch.
#[derive(Clone, Debug)]
pub struct Groups {
    /// Those that depend on states.
    pub informative: Vec<Group>,
    /// Signals and combinations that are noise alone.
    pub noise: Vec<(Signal, Combination)>,
}

impl Groups {
    /// For epochs with free ambiguities, or with none.
    pub fn new(model: &MultiBandModel, ambiguous: bool) -> Self {
        let mut groups = Self { informative: vec![], noise: vec![] };
        let [mean, ionosphere, neither] = model.bands.orthonormal();
        for signal in Signal::ALL {
            if signal == Signal::Phase && ambiguous {
                groups.informative.extend(model.bands.raw().map(|combination| Group::new(model, signal, combination)));
            } else {
                groups.informative.extend([mean, ionosphere].map(|combination| Group::new(model, signal, combination)));
                groups.noise.push((signal, neither));
            }
        }
        groups
    }
}

impl Group {
    fn new(model: &MultiBandModel, signal: Signal, combination: Combination) -> Self {
        let row = |difference: usize| {
            let mut entries = vec![];
            model.linear_entries(signal, &combination, difference, &mut |state, value| entries.push((state, value)));
            entries
        };
        let geometry = model.geometry_factor(&combination);
        Self { signal, combination, geometry, entries: (0..model.layout().differences()).map(row).collect() }
    }

    /// Number of the first row of the compact nonlinear part that this group sees, for m differences.
    pub fn nonlinear_row(&self, m: usize) -> usize {
        if self.signal == Signal::Doppler { m } else { 0 }
    }
}

/// The rows of an epoch's groups, one group after another, on the states that are left.
pub struct GroupRows<'a> {
    /// The groups.
    pub groups: &'a [Group],
    /// N_s − 1, the rows of a group.
    pub differences: usize,
    /// ∂/∂z of the compact nonlinear part, by rows.
    pub slope: &'a [f64],
    /// Where states are.
    pub places: &'a Places,
}

impl Rows<f64> for GroupRows<'_> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        let group = &self.groups[row / self.differences];
        let difference = row % self.differences;
        if group.geometry != 0.0 {
            let inputs = Layout::Z.len();
            let start = (group.nonlinear_row(self.differences) + difference) * inputs;
            for (state, slope) in Layout::Z.zip(&self.slope[start..start + inputs]) {
                if *slope != 0.0 {
                    entry(state, group.geometry * slope);
                }
            }
        }
        for &(state, coefficient) in &group.entries[difference] {
            if let Some(place) = self.places.of(state) {
                entry(place, coefficient);
            }
        }
    }
}

/// Virtual measurements: one state each.
pub struct VirtualRows<'a> {
    /// States of the whole model.
    pub states: &'a [usize],
    /// Where they are.
    pub places: &'a Places,
}

impl Rows<f64> for VirtualRows<'_> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        if let Some(place) = self.places.of(self.states[row]) {
            entry(place, 1.0);
        }
    }
}
