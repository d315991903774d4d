//! A simulated sky for tests: thirty-two GPS-like satellites on exact orbits, two receivers with clocks of their own,
//! and noise from a fixed seed.

use super::link::Station;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::ephemeris::{Ephemeris, KeplerEphemeris, NavigationMessage};
use crate::gnss::epoch::Observation;
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The first receiver is the rover.
pub const ROVER: usize = 0;
pub const BASE: usize = 1;

/// Start of all simulations.
pub fn start() -> GpsTime {
    GpsTime::from_week_tow(2100, 345_600.0)
}

pub struct Sky {
    pub ephemerides: Vec<Ephemeris>,
    pub bands: Vec<Signal>,
    /// Standard deviation of a code and of a phase `[m]`.
    pub noise: [f64; 2],
    /// Cycles added to the phases of a receiver's satellite.
    pub slips: BTreeMap<(usize, SatelliteId), f64>,
    /// Metres added to the codes of a receiver's satellite.
    pub code_errors: BTreeMap<(usize, SatelliteId), f64>,
    /// Metres added to its phases.
    pub phase_errors: BTreeMap<(usize, SatelliteId), f64>,
    seed: u64,
}

impl Sky {
    pub fn new(bands: &[&str]) -> Self {
        let satellite = |i: u8| {
            let (plane, place) = (f64::from(i / 6), f64::from(i % 6));
            Ephemeris::Kepler(KeplerEphemeris {
                satellite: SatelliteId::new(Constellation::Gps, i + 1).unwrap(),
                message: NavigationMessage::Lnav,
                iode: 1,
                toe: start(),
                toc: start(),
                sqrt_a: 5153.7,
                e: 0.005,
                m0: (place * 60.0 + plane * 25.0).to_radians(),
                delta_n: 0.0,
                i0: 55f64.to_radians(),
                idot: 0.0,
                omega0: (plane * 60.0).to_radians(),
                omega: 0.5,
                omega_dot: 0.0,
                cuc: 0.0,
                cus: 0.0,
                crc: 0.0,
                crs: 0.0,
                cic: 0.0,
                cis: 0.0,
                af0: 1e-5 * f64::from(i),
                af1: 0.0,
                af2: 0.0,
                group_delay: [0.0; 2],
                health: 0,
                accuracy: 2.0,
                fit_interval: 4.0,
            })
        };
        Self {
            ephemerides: (0..32).map(satellite).collect(),
            bands: bands.iter().map(|band| band.parse().unwrap()).collect(),
            noise: [0.3, 0.002],
            slips: BTreeMap::new(),
            code_errors: BTreeMap::new(),
            phase_errors: BTreeMap::new(),
            seed: 1,
        }
    }

    /// SplitMix64 (Steele, Lea & Flood 2014); twelve uniforms make a normal near enough.
    fn normal(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.seed = self.seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = (self.seed ^ (self.seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            sum += ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }

    /// What a receiver observes of all satellites above 10°, the highest first.
    pub fn observe(
        &mut self,
        receiver: usize,
        time: GpsTime,
        at: Vector3<f64>,
        moving: Vector3<f64>,
    ) -> Vec<Observation> {
        let elapsed = time.since(start());
        let (clock, drift) = ([150.0, -80.0][receiver] + 3.0 * elapsed, 3.0);
        // The receiver's time tag is late by its clock error.
        let station = Station::new(time, at);
        let mut seen = Vec::new();
        for ephemeris in self.ephemerides.clone() {
            let satellite = ephemeris.satellite();
            let mut range = 0.075 * SPEED_OF_LIGHT;
            for _ in 0..4 {
                let Some(sight) = station.sight(&ephemeris, range) else { break };
                range = sight.computed;
            }
            let Some(sight) = station.sight(&ephemeris, range).filter(|s| s.sin_elevation > 0.174) else { continue };
            for signal in self.bands.clone() {
                let wavelength = signal.wavelength(Constellation::Gps, None).unwrap();
                let mut observation = Observation::new(satellite, signal);
                let slip = self.slips.get(&(receiver, satellite)).copied().unwrap_or(0.0);
                let error = self.code_errors.get(&(receiver, satellite)).copied().unwrap_or(0.0);
                let shift = self.phase_errors.get(&(receiver, satellite)).copied().unwrap_or(0.0);
                let whole = f64::from(satellite.number()) * 1234.0 + receiver as f64 * 77.0 + slip;
                observation.code = Some(range + clock + self.noise[0] * self.normal() + error);
                observation.phase = Some((range + clock + shift + self.noise[1] * self.normal()) / wavelength + whole);
                let rate = sight.computed_rate - sight.direction.dot(&moving) + drift + 0.02 * self.normal();
                observation.doppler = Some(-rate / wavelength);
                observation.cn0 = Some(47.0);
                seen.push((sight.sin_elevation, observation));
            }
        }
        seen.sort_by(|a, b| b.0.total_cmp(&a.0));
        seen.into_iter().map(|(_, observation)| observation).collect()
    }
}
