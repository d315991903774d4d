//! Precise products from files, as the PPP engine asks for them.
//!
//! Orbits are those of SP3 files; clocks those of clock files where they have the satellite, else of the SP3 files;
//! satellites that neither knows come from broadcast messages, if there are any, with their uncertainty. What is missing is
//! known by [`HostProducts::warnings`], with what it costs.

use crate::read::antex::{Antex, ReceiverAntenna};
use crate::read::bias::BiasData;
use crate::read::clock::Clocks;
use crate::read::erp::EarthOrientationSeries;
use crate::read::sp3::Sp3;
use nalgebra::Vector3;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::antenna::{AntennaBand, Calibration, choose_receiver, choose_satellite};
use surefix_core::gnss::attitude::Block;
use surefix_core::gnss::earth_rotation::EarthOrientation;
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::orbit::store::SelectionRule;
use surefix_core::gnss::precise::{self, ClockValue, PreciseError};
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
/// Random walk of a satellite clock `[s/√s]` by constellation index: GPS, Galileo, BeiDou, QZSS, GLONASS.
///
/// Records 300 s apart predict those of 30 s to 9.5e-11 s rms for GPS and 7.9e-12 s for Galileo (GRG, 25 June 2020); a bridge of
/// length T has the mean variance q T/6, so that √q = 1.3e-11 and 1.1e-12. But the rms of GPS is that of its few bad clocks, and
/// weights for those spoil the rest: with 3e-12 two days of ZIMM by 15-minute clocks end 1.1 and 1.0 cm off, with 1.3e-11
/// 1.7 and 1.2 cm; an hour of JFNG 10 cm and 33 cm. The others are not measured.
const CLOCK_WALK: [f64; 5] = [3e-12, 1.1e-12, 3e-12, 3e-12, 3e-12];
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
}

impl HostProducts {
    /// A clock and the variance of its interpolation `[s, m²]`.
    fn clock(&self, satellite: SatelliteId, time: GpsTime) -> Result<(f64, f64), Missing> {
        let own = self.clocks.as_ref().map(|clocks| clocks.clock(satellite)).filter(|nodes| !nodes.is_empty());
        let nodes = match own {
            Some(nodes) => nodes,
            None => self.orbits.as_ref().map_or(&[][..], |orbits| orbits.clock(satellite)),
        };
        let value = precise::clock(nodes, time, CLOCK_GAP).map_err(|error| match error {
            PreciseError::NoData => Missing::Clock,
            _ => Missing::ClockGap,
        })?;
        let ClockValue { bias, distance, spacing } = value;
        // Between two nodes a random walk is a bridge: nothing at its ends, most in the middle.
        let walk = SPEED_OF_LIGHT * CLOCK_WALK[satellite.constellation().index()];
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
