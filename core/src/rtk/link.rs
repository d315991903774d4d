//! From the raw observations of rover and base to single differences: selection of signals, residuals, noise.
//!
//! Residuals are observed minus computed, in metres, with
//!
//! ```text
//! code:   P  − (ρ − c·dtˢ + T)      phase: λφ − (ρ − c·dtˢ + T)      Doppler: −λD − (e·vˢ − c·ḋtˢ)
//! ```
//!
//! ρ the light-time range, dtˢ the broadcast clock at transmission and T the tropospheric delay (Saastamoinen); the
//! ionosphere cancels on the baselines this is for, and its residual is part of the noise. Each station is computed at
//! its own time of reception, so that base data of any age may be used.
//!
//! Panic contract: none. What cannot be computed is left out.

use super::channel::{GROUPS, group};
use super::config::BandPlan;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::atmosphere::{Mapping, StandardAtmosphere, ZenithDelay};
use crate::gnss::ephemeris::Ephemeris;
use crate::gnss::epoch::Observation;
use crate::gnss::geodesy::{Geodetic, line_of_sight};
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::gnss::time::GpsTime;
use heapless::Vec;
use nalgebra::Vector3;

/// The carrier of one receiver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carrier {
    /// λφ `[m]`.
    pub phase: f64,
    /// −λD `[m/s]`.
    pub rate: f64,
}

impl Carrier {
    /// By how much the phase moved beyond what the mean of the rates at both ends of `step` seconds predicts `[m]`. The
    /// trapezoid is exact for constant acceleration.
    pub fn jump_since(&self, before: &Self, step: f64) -> f64 {
        self.phase - before.phase - 0.5 * (self.rate + before.rate) * step
    }
}

/// A single difference, rover minus base, of one signal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub satellite: SatelliteId,
    pub slot: usize,
    pub signals: [Signal; 2],
    pub wavelength: f64,
    /// Unit vector from rover to satellite, ECEF (or the negative mean slope of the range, see [`super::range`]).
    pub direction: Vector3<f64>,
    /// Geometric range from the rover `[m]`.
    pub range: f64,
    pub sin_elevation: f64,
    /// Code residual `[m]`.
    pub code: Option<f64>,
    pub code_variance: f64,
    /// The same before correlation with codes before and what was learned of its receiver.
    pub single_code_variance: f64,
    /// Likewise of the phase.
    pub single_phase_variance: f64,
    /// Phase residual `[m]`, whole cycles included.
    pub phase: Option<f64>,
    pub phase_variance: f64,
    /// Rover range rate residual for a rover at rest `[m/s]`.
    pub doppler: Option<f64>,
    pub doppler_variance: f64,
    /// The codes that placed the satellite less their computed ranges: the clocks of rover and base `[m]`.
    pub clocks: [f64; 2],
    /// The rover's carrier as it came: phase and range rate −λD, clocks included `[m, m/s]`.
    pub carrier: Option<Carrier>,
    /// Either receiver reported a loss of lock.
    pub loss_of_lock: bool,
    /// Either receiver reported an unresolved half cycle.
    pub half_cycle: bool,
    /// Its channel, once it has one.
    pub channel: Option<usize>,
    /// The code contradicts the rest and is not used.
    pub code_rejected: bool,
    /// The phase contradicts the rest and is not used.
    pub phase_rejected: bool,
    /// A cycle slip since the channel's last epoch is possible or was found.
    pub slipped: bool,
    /// The prior of the slipped ambiguity has been widened.
    pub reopened: bool,
}

/// A code that differs by more than this from the others is absurd; systems' clocks may differ by less `[m]`.
const MISPLACED: f64 = 1000.0;

/// Leaves out satellites whose code contradicts the clock that most satellites agree on: they were computed for a wrong
/// time of transmission, so that their phases and Doppler are of no use either.
pub(super) fn drop_misplaced<const C: usize>(links: &mut Vec<Link, C>) {
    for station in 0..2 {
        let mut clocks: Vec<f64, C> = Vec::new();
        for link in links.iter() {
            let _ = clocks.push(link.clocks[station]);
        }
        clocks.sort_unstable_by(f64::total_cmp);
        if let Some(&median) = clocks.get(clocks.len() / 2) {
            links.retain(|link| libm::fabs(link.clocks[station] - median) < MISPLACED);
        }
    }
}

/// Order of preference of attributes within a band: civil code first, on GPS L2 the P(Y) code that all satellites send.
fn rank(constellation: Constellation, signal: Signal) -> usize {
    let order: &[u8] = match (constellation, signal.band()) {
        (Constellation::Gps, b'2') => b"WPYCLSXMND",
        _ => b"CWPQIXLSDBAZYMN",
    };
    order.iter().position(|&attribute| attribute == signal.attribute()).unwrap_or(order.len())
}

/// Keeps one observation for each satellite and band of the plan: that with the attribute `preferred` for its group if
/// there is one, else the first in order of preference; a phase before none. Where there are more than C, those of the
/// first bands stay and then the lower satellites, whatever their order in the file, so that both stations keep the
/// same. Returns how many found no room.
pub(super) fn select<const C: usize>(
    observations: &[Observation],
    plan: &BandPlan,
    preferred: &[u8; GROUPS],
    chosen: &mut Vec<Observation, C>,
) -> usize {
    chosen.clear();
    let mut overflow = 0;
    for observation in observations {
        let constellation = observation.satellite.constellation();
        let band = observation.signal.band();
        let Some(slot) = plan.slot(constellation, band) else { continue };
        if observation.code.is_none() && observation.phase.is_none() {
            continue;
        }
        let merit = |o: &Observation| {
            let wanted = preferred.get(group(constellation, slot)).copied();
            (o.phase.is_none(), Some(o.signal.attribute()) != wanted, rank(constellation, o.signal))
        };
        let is_same = |o: &&mut Observation| o.satellite == observation.satellite && o.signal.band() == band;
        if let Some(other) = chosen.iter_mut().find(is_same) {
            if merit(observation) < merit(other) {
                *other = *observation;
            }
        } else if chosen.push(*observation).is_err() {
            overflow += 1;
            let order = |o: &Observation| (plan.slot(o.satellite.constellation(), o.signal.band()), o.satellite);
            if let Some(last) = chosen.iter_mut().max_by_key(|o| order(o))
                && order(observation) < order(last)
            {
                *last = *observation;
            }
        }
    }
    overflow
}

/// One satellite as seen from one station.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Unit vector from station to satellite, ECEF of reception.
    pub direction: Vector3<f64>,
    pub sin_elevation: f64,
    /// Geometric range `[m]`.
    pub range: f64,
    /// Computed range ρ − c·dtˢ + T `[m]`.
    pub computed: f64,
    /// Computed range rate for a station at rest, e·vˢ − c·ḋtˢ `[m/s]`.
    pub computed_rate: f64,
}

/// Relative humidity assumed for the wet delay.
const HUMIDITY: f64 = 0.7;

/// A receiver at a place and time, with what all its satellites share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    time: GpsTime,
    position: Vector3<f64>,
    geodetic: Geodetic,
    up: Vector3<f64>,
    zenith: ZenithDelay,
    day_of_year: f64,
}

impl Station {
    pub fn new(time: GpsTime, position: Vector3<f64>) -> Self {
        let geodetic = Geodetic::from_ecef(&position);
        let zenith = StandardAtmosphere::at_height(geodetic.height, HUMIDITY).zenith_delay(&geodetic);
        let up = geodetic.enu_rotation().row(2).transpose();
        Self { time, position, geodetic, up, zenith, day_of_year: time.day_of_year() }
    }

    /// How this station sees the satellite of `ephemeris`, which sent the signal whose code is `pseudorange` `[m]`.
    pub fn sight(&self, ephemeris: &Ephemeris, pseudorange: f64) -> Option<Sight> {
        let state = ephemeris.state_at_transmission(self.time, pseudorange).ok()?;
        let line = line_of_sight(&self.position, &state.position);
        let sin_elevation = line.direction.dot(&self.up);
        let elevation = libm::asin(sin_elevation.clamp(-1.0, 1.0));
        let troposphere = Mapping::Niell.slant(self.zenith, self.day_of_year, &self.geodetic, elevation)?;
        Some(Sight {
            direction: line.direction,
            range: line.range,
            sin_elevation,
            computed: line.range - SPEED_OF_LIGHT * state.clock + troposphere,
            computed_rate: line.direction.dot(&line.rotate(&state.velocity)) - SPEED_OF_LIGHT * state.clock_drift,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observation(satellite: &str, signal: &str) -> Observation {
        let mut observation = Observation::new(satellite.parse().unwrap(), signal.parse().unwrap());
        observation.phase = Some(1.0);
        observation
    }

    fn names(chosen: &[Observation]) -> Vec<String> {
        let mut names: Vec<String> = chosen.iter().map(|o| format!("{}{}", o.satellite, o.signal)).collect();
        names.sort();
        names
    }

    type Chosen<const C: usize> = heapless::Vec<Observation, C>;
    use std::vec::Vec;

    #[test]
    fn one_signal_of_each_band_is_chosen_and_the_attribute_stays() {
        let mut all =
            [observation("G01", "1W"), observation("G01", "1C"), observation("G01", "2W"), observation("E05", "6C")];
        let mut chosen = Chosen::<8>::new();
        let mut preferred = [0; GROUPS];
        assert_eq!(select(&all, &BandPlan::L1L2, &preferred, &mut chosen), 0);
        assert_eq!(names(&chosen), ["G011C", "G012W"]);
        preferred[group(Constellation::Gps, 0)] = b'W';
        select(&all, &BandPlan::L1L2, &preferred, &mut chosen);
        assert_eq!(names(&chosen), ["G011W", "G012W"]);
        // A phase before none, whatever was preferred.
        all[0].phase = None;
        all[0].code = Some(2e7);
        select(&all, &BandPlan::L1L2, &preferred, &mut chosen);
        assert_eq!(names(&chosen), ["G011C", "G012W"]);
    }

    #[test]
    fn with_too_little_room_the_first_bands_stay_in_any_order() {
        let mut all = [
            observation("G01", "2W"),
            observation("G01", "1C"),
            observation("G02", "2W"),
            observation("G02", "1C"),
            observation("G03", "1C"),
        ];
        for _ in 0..all.len() {
            all.rotate_left(1);
            let mut chosen = Chosen::<3>::new();
            assert_eq!(select(&all, &BandPlan::L1L2, &[0; GROUPS], &mut chosen), 2);
            assert_eq!(names(&chosen), ["G011C", "G021C", "G031C"]);
        }
    }

    /// s(t) = 20 + 3 t + 2 t² over two seconds: rates 3 and 11 m/s, so nothing is left but the jump.
    #[test]
    fn a_phase_agrees_with_its_doppler_under_constant_acceleration() {
        let before = Carrier { phase: 20.0, rate: 3.0 };
        let now = Carrier { phase: 20.0 + 6.0 + 8.0 + 0.19, rate: 11.0 };
        assert!((now.jump_since(&before, 2.0) - 0.19).abs() < 1e-12);
    }
}
