//! A satellite of an epoch: what was measured, less all that is not estimated, and which states it depends on.
//!
//! Panic contract: none.

use super::config::{Ionosphere, PppConfig};
use super::products::Products;
use super::select::PairReading;
use super::sight::{Sight, Station};
use super::states::{Label, States};
use crate::filter::update::Rows;
use crate::gnss::satellite::{Constellation, SatelliteId};
use heapless::Vec;

/// Code or carrier phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Kind {
    /// Code.
    Code,
    /// Carrier phase.
    Phase,
}

impl Kind {
    /// Both, codes first: they narrow what is wide before phases narrow the rest.
    pub const ALL: [Self; 2] = [Self::Code, Self::Phase];
}

/// One measurement of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Observed minus computed at the linearisation point, all states 0 `[m]`.
    pub residual: f64,
    /// Variance of its noise `[m²]`.
    pub variance: f64,
    /// Whether it contradicted the others and was left out.
    pub rejected: bool,
    /// Observed minus computed with the updated states `[m]`.
    pub postfit: f64,
}

/// A satellite of an epoch. In ionosphere-free mode only the first reading of each kind is in use, that of the combination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Which.
    pub satellite: SatelliteId,
    /// What came from the receiver.
    pub pair: PairReading,
    /// How it is seen.
    pub sight: Sight,
    /// Number of its arc.
    pub arc: u32,
    /// Epochs since the arc began.
    pub age: u32,
    /// Codes.
    pub code: [Reading; 2],
    /// Phases, less the offset of the arc.
    pub phase: [Reading; 2],
    /// Whether a code was taken without a known bias, though biases of the satellite's other signals are known.
    pub bias_unknown: bool,
}

impl Link {
    /// Readings of a kind.
    pub fn readings(&self, kind: Kind) -> &[Reading; 2] {
        match kind {
            Kind::Code => &self.code,
            Kind::Phase => &self.phase,
        }
    }

    /// Readings of a kind, to be changed.
    pub fn readings_mut(&mut self, kind: Kind) -> &mut [Reading; 2] {
        match kind {
            Kind::Code => &mut self.code,
            Kind::Phase => &mut self.phase,
        }
    }

    /// Number of readings of a kind that are in use.
    pub const fn slots(ionosphere: Ionosphere) -> usize {
        match ionosphere {
            Ionosphere::Free => 1,
            Ionosphere::Estimated => 2,
        }
    }

    /// Factor of the slant delay on the first band in a reading.
    pub fn ionosphere(&self, kind: Kind, slot: usize) -> f64 {
        let ratio = if slot == 0 { 1.0 } else { self.pair.pair.ionosphere_ratio() };
        match kind {
            Kind::Code => ratio,
            Kind::Phase => -ratio,
        }
    }

    /// A link from what was read and seen; phases are not yet freed of their arc's offset.
    pub fn new(
        pair: PairReading,
        sight: Sight,
        station: &Station,
        products: &impl Products,
        config: &PppConfig,
    ) -> Self {
        let satellite = pair.satellite;
        let bias = pair.bands.map(|band| products.code_bias(satellite, band.code_signal, station.time));
        let raw_codes: [f64; 2] = core::array::from_fn(|i| pair.codes()[i] - bias[i].unwrap_or(0.0));
        let wavelengths = pair.pair.wavelengths();
        let raw_phases: [f64; 2] = core::array::from_fn(|i| pair.phases()[i] - wavelengths[i] * sight.wind_up);
        let modelled: [f64; 2] = core::array::from_fn(|i| sight.range + sight.common + sight.antennas[i]);
        let index = satellite.constellation().index();
        let factor = |factors: &[f64; 5]| factors.get(index).copied().unwrap_or(1.0);
        let sine = libm::sin(sight.look.elevation).max(0.02);
        let slope = 1.0 / (sine * sine);
        let square = |x: f64| x * x;
        let noise = &config.noise;
        let code = square(noise.code * factor(&noise.code_factor)) * 0.5 * (1.0 + slope);
        let phase = square(noise.phase * factor(&noise.phase_factor)) * slope;
        let readings = |raw: [f64; 2], variance: f64| -> [Reading; 2] {
            let difference: [f64; 2] = core::array::from_fn(|i| raw[i] - modelled[i]);
            let reading =
                |residual, variance| Reading { residual, variance: variance + sight.variance, ..Reading::default() };
            match config.ionosphere {
                Ionosphere::Free => {
                    let spread = square(pair.pair.ionosphere_free_noise());
                    [reading(pair.pair.ionosphere_free(difference), variance * spread), Reading::default()]
                }
                Ionosphere::Estimated => difference.map(|residual| reading(residual, variance)),
            }
        };
        Self {
            satellite,
            pair,
            sight,
            arc: 0,
            age: 0,
            code: readings(raw_codes, code),
            phase: readings(raw_phases, phase),
            bias_unknown: bias.iter().any(Option::is_none),
        }
    }
}

/// Most entries of a row: position, clock, bias, zenith, gradients, delay, ambiguity.
const ENTRIES: usize = 10;

/// One row of an update.
#[derive(Clone, Debug)]
pub struct Row {
    /// States and their coefficients.
    pub entries: Vec<(usize, f64), ENTRIES>,
    /// y − h(x), all states 0 `[m]`.
    pub residual: f64,
    /// Variance of the noise `[m²]`.
    pub variance: f64,
}

impl Row {
    /// The row of a reading, `None` if a state that it needs is not there.
    pub fn of<const N: usize>(
        link: &Link,
        kind: Kind,
        slot: usize,
        states: &Labels,
        density: &States<N>,
        config: &PppConfig,
    ) -> Option<Self> {
        let reading = link.readings(kind).get(slot)?;
        let mut entries = Vec::new();
        let mut push = |index: usize, coefficient: f64| entries.push((index, coefficient)).ok();
        for (axis, component) in link.sight.direction.iter().enumerate() {
            push(axis, -component)?;
        }
        push(states.clock?, 1.0)?;
        let constellation = link.satellite.constellation();
        if states.reference != Some(constellation) {
            push(states.inter_system.get(constellation.index()).copied()??, 1.0)?;
        }
        push(states.zenith?, link.sight.wet)?;
        if let [Some(north), Some(east)] = states.gradients {
            push(north, link.sight.gradients[0])?;
            push(east, link.sight.gradients[1])?;
        }
        if config.ionosphere == Ionosphere::Estimated {
            push(density.index(Label::Ionosphere(link.satellite))?, link.ionosphere(kind, slot))?;
        }
        if kind == Kind::Phase {
            push(density.index(Label::Ambiguity(link.satellite, slot as u8))?, 1.0)?;
        }
        Some(Self { entries, residual: reading.residual, variance: reading.variance })
    }

    /// y − h(x) at the given mean.
    pub fn innovation(&self, mean: &[f64]) -> f64 {
        let explained = self.entries.iter().filter_map(|&(i, h)| Some(h * mean.get(i)?));
        self.residual - explained.sum::<f64>()
    }
}

/// A single row as the update takes it.
impl Rows<f64> for Row {
    fn for_each(&self, _row: usize, entry: &mut dyn FnMut(usize, f64)) {
        self.entries.iter().for_each(|&(state, coefficient)| entry(state, coefficient));
    }
}

/// Several rows as the update takes them.
pub struct RowList<'a>(pub &'a [Row]);

impl Rows<f64> for RowList<'_> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        if let Some(row) = self.0.get(row) {
            row.entries.iter().for_each(|&(state, coefficient)| entry(state, coefficient));
        }
    }
}

/// Where the states are that all rows share.
#[derive(Clone, Copy, Debug, Default)]
pub struct Labels {
    /// The receiver clock.
    pub clock: Option<usize>,
    /// The constellation whose time the clock is against.
    pub reference: Option<Constellation>,
    /// Inter-system biases by constellation.
    pub inter_system: [Option<usize>; 5],
    /// Zenith wet delay.
    pub zenith: Option<usize>,
    /// Gradients.
    pub gradients: [Option<usize>; 2],
}

impl Labels {
    /// Finds them.
    pub fn of<const N: usize>(states: &States<N>, reference: Option<Constellation>) -> Self {
        Self {
            clock: states.index(Label::Clock),
            reference,
            inter_system: Constellation::ALL.map(|constellation| states.index(Label::InterSystem(constellation))),
            zenith: states.index(Label::Zenith),
            gradients: [0, 1].map(|axis| states.index(Label::Gradient(axis))),
        }
    }
}
