//! Precise products from files, as the PPP engine asks for them.
//!
//! Orbits are those of SP3 files; clocks those of clock files where they have the satellite, else of the SP3 files;
//! satellites that neither knows come from broadcast messages, if there are any, with their uncertainty. Between records far
//! apart, a clock has the variance of a random walk that is pinned at both, as its own records say that it walks. What is missing is
//! known by [`HostProducts::warnings`], with what it costs.

use crate::read::antex::{Antex, ReceiverAntenna};
use crate::read::bias::BiasData;
use crate::read::clock::Clocks;
use crate::read::erp::EarthOrientationSeries;
use crate::read::sp3::Sp3;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::antenna::{AntennaBand, Calibration, choose_receiver, choose_satellite};
use surefix_core::gnss::attitude::Block;
use surefix_core::gnss::earth_rotation::EarthOrientation;
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::orbit::store::SelectionRule;
use surefix_core::gnss::precise::{self, ClockNode, ClockValue, PreciseError};
use surefix_core::gnss::relativity::clock_correction;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::tide::OceanLoading;
use surefix_core::gnss::time::GpsTime;
use surefix_core::ppp::products::{Missing, PreciseState, Products};

/// Clocks farther apart than this are not interpolated between `[s]`.
const CLOCK_GAP: f64 = 930.0;
/// Clocks nearer than this are interpolated without loss `[s]`.
const DENSE: f64 = 60.0;
/// Random walk of a satellite clock of which there are too few records to tell `[s/√s]`, by constellation index: GPS, Galileo,
/// BeiDou, QZSS, GLONASS.
///
/// A bridge of length T has the mean variance q T/6: records of Galileo 300 s apart predict those of 30 s to 7.9e-12 s rms (GRG,
/// 25 June 2020). The number of the others is that with which two days of GPS with clocks of 15 minutes came out best.
const CLOCK_WALK: [f64; 5] = [3e-12, 1.1e-12, 3e-12, 3e-12, 3e-12];
/// So many second differences of its records tell a clock's walk.
const DIFFERENCES: usize = 20;
/// Standard deviation of broadcast orbits and clocks along the line of sight `[m]`.
const BROADCAST: f64 = 0.8;

/// What files say.
#[derive(Default)]
pub struct HostProducts {
    /// Orbits, and clocks at their epochs.
    pub orbits: Option<Sp3>,
    /// Clocks.
    pub clocks: Option<Clocks>,
    /// Antennas.
    pub antennas: Vec<Antex>,
    /// The receiver's antenna, of the same file.
    pub receiver: Option<ReceiverAntenna>,
    /// Code biases.
    pub biases: Option<BiasData>,
    /// Ocean loading at the station.
    pub ocean: Option<OceanLoading>,
    /// The Earth's orientation.
    pub orientation: Option<EarthOrientationSeries>,
    /// Broadcast messages, in order of satellite and reference time.
    pub broadcast: Vec<Ephemeris>,
    /// Random walks of the satellites' clocks `[s/√s]`, see [`HostProducts::learn_clocks`].
    pub walks: BTreeMap<SatelliteId, f64>,
}

/// Random walk of a clock `[s/√s]`, from the second differences of its records, whose variance is 2 q h if they are h apart.
/// Their median counts, as clocks jump. `None` if there are too few.
fn clock_walk(nodes: &[ClockNode]) -> Option<f64> {
    let mut walks: Vec<f64> = nodes
        .windows(3)
        .filter_map(|of| {
            let [h, next] = [of[1].time.since(of[0].time), of[2].time.since(of[1].time)];
            let difference = of[2].bias - 2.0 * of[1].bias + of[0].bias;
            ((h - next).abs() < 1.0 && h > 0.0).then(|| difference.abs() / (2.0 * h).sqrt())
        })
        .collect();
    walks.sort_by(f64::total_cmp);
    // Half of a normal distribution lies within 0.674 49 standard deviations.
    (walks.len() >= DIFFERENCES).then(|| walks[walks.len() / 2] / 0.674_49)
}

impl HostProducts {
    /// Finds out how much the clocks walk, from their own records: caesium clocks several times as much as rubidium clocks and
    /// masers. To be called when all files are read.
    pub fn learn_clocks(&mut self) {
        let of_orbits = self.orbits.iter().flat_map(Sp3::satellites);
        let satellites: Vec<SatelliteId> = of_orbits.collect();
        let walk = |satellite: &SatelliteId| Some((*satellite, clock_walk(self.records(*satellite))?));
        self.walks = satellites.iter().filter_map(walk).collect();
    }

    /// Records of a satellite's clock: of clock files, else of SP3 files.
    fn records(&self, satellite: SatelliteId) -> &[ClockNode] {
        let own = self.clocks.as_ref().map(|clocks| clocks.clock(satellite)).filter(|nodes| !nodes.is_empty());
        own.unwrap_or_else(|| self.orbits.as_ref().map_or(&[][..], |orbits| orbits.clock(satellite)))
    }

    /// A clock and the variance of its interpolation `[s, m²]`.
    fn clock(&self, satellite: SatelliteId, time: GpsTime) -> Result<(f64, f64), Missing> {
        let value = precise::clock(self.records(satellite), time, CLOCK_GAP).map_err(|error| match error {
            PreciseError::NoData => Missing::Clock,
            _ => Missing::ClockGap,
        })?;
        let ClockValue { bias, distance, spacing } = value;
        // Between two nodes a random walk is a bridge: nothing at its ends, most in the middle.
        let usual = || CLOCK_WALK[satellite.constellation().index()];
        let walk = SPEED_OF_LIGHT * self.walks.get(&satellite).copied().unwrap_or_else(usual);
        let bridge = if spacing > DENSE { walk * walk * distance * (spacing - distance) / spacing } else { 0.0 };
        Ok((bias, bridge))
    }

    fn precise(&self, satellite: SatelliteId, time: GpsTime) -> Result<PreciseState, Missing> {
        let nodes = self.orbits.as_ref().map_or(&[][..], |orbits| orbits.orbit(satellite));
        let orbit = precise::orbit(nodes, time).map_err(|error| match error {
            PreciseError::NoData => Missing::Orbit,
            _ => Missing::OrbitGap,
        })?;
        let (bias, variance) = self.clock(satellite, time)?;
        let clock = bias + clock_correction(&orbit.position, &orbit.velocity);
        Ok(PreciseState { position: orbit.position, velocity: orbit.velocity, clock, variance, phase_centre: false })
    }

    fn broadcast_state(&self, satellite: SatelliteId, time: GpsTime) -> Option<PreciseState> {
        let start = self.broadcast.partition_point(|ephemeris| ephemeris.satellite() < satellite);
        let own = self.broadcast.get(start..)?.iter().take_while(|ephemeris| ephemeris.satellite() == satellite);
        let age = |ephemeris: &&Ephemeris| time.since(ephemeris.toe()).abs();
        let nearest = own
            .filter(|ephemeris| {
                ephemeris.health() == 0 && age(ephemeris) <= SelectionRule::SAFE.past[satellite.constellation().index()]
            })
            .min_by(|a, b| age(a).total_cmp(&age(b)))?;
        let state = nearest.state(time).ok()?;
        Some(PreciseState {
            position: state.position,
            velocity: state.velocity,
            clock: state.clock,
            variance: BROADCAST * BROADCAST,
            phase_centre: true,
        })
    }

    /// Whether any orbit is from a precise product.
    pub fn is_precise(&self) -> bool {
        self.orbits.is_some()
    }
}

impl Products for HostProducts {
    fn state(&self, satellite: SatelliteId, time: GpsTime) -> Result<PreciseState, Missing> {
        match self.precise(satellite, time) {
            // A satellite of the products that has a gap is better left out than taken from elsewhere.
            Err(missing) if self.orbits.is_none() => self.broadcast_state(satellite, time).ok_or(missing),
            other => other,
        }
    }

    fn block(&self, satellite: SatelliteId, time: GpsTime) -> Block {
        let antenna = self.antennas.iter().find_map(|antennas| antennas.satellite(satellite, time));
        antenna.map_or(Block::Unknown, |antenna| antenna.block)
    }

    fn satellite_antenna(&self, satellite: SatelliteId, time: GpsTime, signal: Signal) -> Option<Calibration<'_>> {
        let antenna = self.antennas.iter().find_map(|antennas| antennas.satellite(satellite, time))?;
        let wanted = AntennaBand::of(satellite.constellation(), signal);
        let choice = choose_satellite(antenna.calibrations.iter().map(|calibration| calibration.band), wanted)?;
        Some(antenna.calibrations.get(choice.index)?.view())
    }

    fn receiver_antenna(&self, constellation: Constellation, signal: Signal) -> Option<Calibration<'_>> {
        let antenna = self.receiver.as_ref()?;
        let wanted = AntennaBand::of(constellation, signal);
        let choice = choose_receiver(antenna.calibrations.iter().map(|calibration| calibration.band), wanted)?;
        Some(antenna.calibrations.get(choice.index)?.view())
    }

    fn code_bias(&self, satellite: SatelliteId, signal: Signal, time: GpsTime) -> Option<f64> {
        self.biases.as_ref()?.code_bias(satellite, signal, time)
    }

    fn earth_orientation(&self, time: GpsTime) -> Option<EarthOrientation> {
        self.orientation.as_ref()?.at(time)
    }

    fn ocean_loading(&self, time: GpsTime) -> Option<Vector3<f64>> {
        Some(self.ocean.as_ref()?.displacement(time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// A drawn walk on a drift, with a jump; the median of 95 second differences scatters by about a tenth.
    #[test]
    fn a_clock_tells_its_walk() {
        let (h, walk) = (900.0f64, 4e-12);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut bias = 1e-4;
        let node = |k: i32| {
            let step: f64 = random.sample(StandardNormal);
            bias += 1e-11 * h + walk * h.sqrt() * step + if k == 50 { 1e-6 } else { 0.0 };
            ClockNode { time: GpsTime::from_week_tow(2111, h * f64::from(k)), bias }
        };
        let nodes: Vec<ClockNode> = (0..97).map(node).collect();
        let found = clock_walk(&nodes).unwrap();
        assert!((found / walk - 1.0).abs() < 0.35, "{found}");
        assert_eq!(clock_walk(&nodes[..21]), None);
        assert_eq!(clock_walk(&[]), None);
    }
}
