//! Channels: which ambiguity sits where in the density, and what is known of each signal's history.
//!
//! The single difference (rover − base) of a carrier phase is, in metres,
//!
//! ```text
//! sᵢ = λ(φ_rover − φ_base − offsetᵢ) − (model difference) = u − λ nᵢ − eᵢ·δp + noise
//! ```
//!
//! with a term u common to the group (constellation and band), the line of sight eᵢ and the position error δp. The
//! double-difference ambiguity nᵢ `[cycles]` is reference minus satellite, N_ref − Nᵢ (Greiff 2021, M = [1 −I]), so the
//! reference itself has nᵢ = 0 and no state. `offset` is a whole number of cycles chosen at birth that keeps nᵢ small.
//! GLONASS channels hold the double difference of λN in metres (unit 1 m): a float that is never fixed.
//!
//! Panic contract: none; indices that do not exist are ignored.

use super::link::Carrier;
use crate::filter::gaussian::{CapacityError, Gaussian};
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::gnss::time::GpsTime;
use heapless::Vec;

/// One tracked signal pair of rover and base.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    pub satellite: SatelliteId,
    /// Position of the band in its constellation's band plan.
    pub slot: usize,
    /// Signals of rover and base.
    pub signals: [Signal; 2],
    /// Carrier wavelength `[m]`.
    pub wavelength: f64,
    /// Whole cycles subtracted from the single-difference phase.
    pub offset: f64,
    /// Where nᵢ is in the density; `None` for the reference of the group.
    pub state: Option<usize>,
    /// Epoch of the last phase that was used.
    pub last_seen: GpsTime,
    /// Epochs used since birth or the last slip.
    pub lock: u32,
    /// A loss of lock was reported that has not been dealt with yet.
    pub slip_pending: bool,
    /// The phase may be off by half a cycle.
    pub half_cycle: bool,
    /// Sine of the elevation at the last use.
    pub sin_elevation: f64,
    /// Single-difference phase `[m]` with offset at the last use, for the geometry-free check.
    pub phase: f64,
    /// The rover's carrier at the last use, for the Doppler check.
    pub carrier: Option<Carrier>,
    /// The accepted integer nᵢ, 0 for the reference.
    pub fixed: Option<f64>,
    /// Number of its arc, see [`Channels::new_arc`].
    pub arc: u32,
}

impl Channel {
    /// Metres of one unit of the ambiguity state.
    pub fn unit(&self) -> f64 {
        if self.satellite.constellation() == Constellation::Glonass { 1.0 } else { self.wavelength }
    }

    /// Index of its group: all channels of a constellation and band.
    pub fn group(&self) -> usize {
        group(self.satellite.constellation(), self.slot)
    }

    /// Whether its ambiguity is an integer.
    pub fn is_integer(&self) -> bool {
        !self.half_cycle && self.satellite.constellation() != Constellation::Glonass
    }
}

/// Number of groups: five constellations with up to three bands.
pub(super) const GROUPS: usize = 15;

/// Index of the group of a constellation and band slot, below [`GROUPS`].
pub(super) fn group(constellation: Constellation, slot: usize) -> usize {
    constellation.index() * super::config::MAX_BANDS + slot
}

/// All channels and their bookkeeping with the density.
#[derive(Clone, Debug)]
pub(super) struct Channels<const C: usize> {
    list: Vec<Channel, C>,
    /// Arcs so far.
    arcs: u32,
}

impl<const C: usize> Channels<C> {
    pub const fn new() -> Self {
        Self { list: Vec::new(), arcs: 0 }
    }

    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// A number for an arc, a span over which an ambiguity stays the same; none is given twice.
    pub fn new_arc(&mut self) -> u32 {
        self.arcs = self.arcs.wrapping_add(1);
        self.arcs
    }

    pub fn as_slice(&self) -> &[Channel] {
        &self.list
    }

    pub fn as_mut_slice(&mut self) -> &mut [Channel] {
        &mut self.list
    }

    pub fn find(&self, satellite: SatelliteId, slot: usize) -> Option<usize> {
        self.list.iter().position(|channel| channel.satellite == satellite && channel.slot == slot)
    }

    /// The reference of a group.
    pub fn reference(&self, group: usize) -> Option<usize> {
        self.list.iter().position(|channel| channel.state.is_none() && channel.group() == group)
    }

    /// Birth: appends a channel, as the reference if its group has none, else with a state of the given mean and
    /// variance (in units of the state).
    pub fn add<const N: usize>(
        &mut self,
        density: &mut Gaussian<f64, N>,
        mut channel: Channel,
        mean: f64,
        variance: f64,
    ) -> Result<usize, CapacityError> {
        if self.list.is_full() {
            return Err(CapacityError);
        }
        channel.state = match self.reference(channel.group()) {
            Some(_) => Some(density.push(mean, variance)?),
            None => None,
        };
        let index = self.list.len();
        self.list.push(channel).map_err(|_| CapacityError)?;
        Ok(index)
    }

    /// Death: marginalises a channel. A reference first hands over to the best other channel of its group.
    pub fn remove<const N: usize>(&mut self, density: &mut Gaussian<f64, N>, index: usize) {
        let Some(channel) = self.list.get(index) else { return };
        if channel.state.is_none()
            && let Some(heir) = self.best_reference(channel.group(), |i, _| i != index)
        {
            self.make_reference(density, heir);
        }
        let channel = self.list.remove(index);
        if let Some(state) = channel.state {
            density.remove(state);
            for other in &mut self.list {
                other.state = other.state.map(|s| if s > state { s - 1 } else { s });
            }
        }
    }

    /// The channel of a group that serves best as its reference, among those for which `eligible` holds: whole cycles
    /// before half ones, locked before new ones, then the highest.
    pub fn best_reference(&self, group: usize, eligible: impl Fn(usize, &Channel) -> bool) -> Option<usize> {
        let merit = |channel: &Channel| (!channel.half_cycle, channel.lock > 0, channel.sin_elevation);
        let mut best: Option<(usize, (bool, bool, f64))> = None;
        for (i, channel) in self.list.iter().enumerate() {
            if channel.group() == group
                && eligible(i, channel)
                && best.is_none_or(|(_, most)| merit(channel).partial_cmp(&most) == Some(core::cmp::Ordering::Greater))
            {
                best = Some((i, merit(channel)));
            }
        }
        best.map(|(i, _)| i)
    }

    /// Makes a channel the reference of its group: an exact unimodular change of the states of the group, and of the
    /// accepted integers.
    pub fn make_reference<const N: usize>(&mut self, density: &mut Gaussian<f64, N>, index: usize) {
        let Some(&new) = self.list.get(index) else { return };
        let (Some(state), Some(old)) = (new.state, self.reference(new.group())) else { return };
        let mut states: Vec<usize, C> = Vec::new();
        for channel in self.list.iter().filter(|channel| channel.group() == new.group()) {
            // Capacity is that of the list itself.
            let _ = channel.state.map(|s| states.push(s));
        }
        density.change_reference(state, &states);
        self.list[old].state = Some(state);
        self.list[index].state = None;
        for channel in self.list.iter_mut().filter(|channel| channel.group() == new.group()) {
            channel.fixed = match (channel.fixed, new.fixed) {
                (Some(n), Some(n_new)) => Some(n - n_new),
                _ => None,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn channel(satellite: &str, sin_elevation: f64) -> Channel {
        let signal: Signal = "1C".parse().unwrap();
        Channel {
            satellite: satellite.parse().unwrap(),
            slot: 0,
            signals: [signal; 2],
            wavelength: 0.19,
            offset: 0.0,
            state: None,
            last_seen: GpsTime::from_week_tow(2100, 0.0),
            lock: 1,
            slip_pending: false,
            half_cycle: false,
            sin_elevation,
            phase: 0.0,
            carrier: None,
            fixed: None,
            arc: 0,
        }
    }

    /// Three GPS channels, the first as reference, with ambiguities 4 and −7, and one of Galileo.
    fn three() -> (Channels<4>, Gaussian<f64, 8>) {
        let (mut channels, mut density) = (Channels::new(), Gaussian::new());
        channels.add(&mut density, channel("G01", 0.9), 0.0, 1.0).unwrap();
        channels.add(&mut density, channel("G02", 0.8), 4.0, 1.0).unwrap();
        channels.add(&mut density, channel("E03", 0.3), 0.0, 1.0).unwrap();
        channels.add(&mut density, channel("G04", 0.5), -7.0, 1.0).unwrap();
        for (channel, fixed) in channels.as_mut_slice().iter_mut().zip([0.0, 4.0, 0.0, -7.0]) {
            channel.fixed = Some(fixed);
        }
        (channels, density)
    }

    #[test]
    fn the_first_of_a_group_is_its_reference_and_has_no_state() {
        let (channels, density) = three();
        let states: Vec<Option<usize>> = channels.as_slice().iter().map(|channel| channel.state).collect();
        assert_eq!(states, [None, Some(0), None, Some(1)]);
        assert_eq!(density.mean(), [4.0, -7.0]);
    }

    #[test]
    fn without_room_nothing_is_born() {
        let (mut channels, mut density) = three();
        assert!(channels.add(&mut density, channel("G05", 0.9), 0.0, 1.0).is_err());
        assert_eq!(density.dim(), 2);
    }

    #[test]
    fn a_new_reference_carries_states_and_integers_over() {
        let (mut channels, mut density) = three();
        channels.make_reference(&mut density, 1);
        // n' = n − n_new: G01 0 − 4, G04 −7 − 4.
        assert_eq!(density.mean(), [-4.0, -11.0]);
        let of = |name: &str| *channels.as_slice().iter().find(|c| c.satellite == name.parse().unwrap()).unwrap();
        assert_eq!((of("G01").state, of("G01").fixed), (Some(0), Some(-4.0)));
        assert_eq!((of("G02").state, of("G02").fixed), (None, Some(0.0)));
        assert_eq!((of("G04").state, of("G04").fixed), (Some(1), Some(-11.0)));
        assert_eq!(of("E03").fixed, Some(0.0));
    }

    #[test]
    fn a_reference_that_dies_hands_over_to_the_highest() {
        let (mut channels, mut density) = three();
        channels.remove(&mut density, 0);
        assert_eq!(density.mean(), [-11.0]);
        let states: Vec<Option<usize>> = channels.as_slice().iter().map(|channel| channel.state).collect();
        assert_eq!(states, [None, None, Some(0)]);
        channels.remove(&mut density, 99);
        channels.remove(&mut density, 2);
        channels.remove(&mut density, 0);
        assert_eq!((channels.as_slice().len(), density.dim()), (1, 0));
    }

    #[test]
    fn half_cycles_and_glonass_are_no_integers() {
        let mut half = channel("G01", 0.5);
        assert!(half.is_integer() && half.unit() == 0.19);
        half.half_cycle = true;
        assert!(!half.is_integer());
        let glonass = channel("R01", 0.5);
        assert!(!glonass.is_integer() && glonass.unit() == 1.0);
    }
}
