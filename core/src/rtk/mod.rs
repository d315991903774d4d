//! The real-time kinematic engine: push epochs of base and rover, get a [`Solution`].
//!
//! Two densities (Greiff 2021, Algorithm 1). The *relaxed* density holds position, velocity (and acceleration) of the
//! rover and the double-difference ambiguities as real numbers, and lives on from epoch to epoch. The *constrained*
//! density is the relaxed one given those integers that were accepted in this epoch; it is what a fixed solution
//! reports, and it never flows back. So a wrong fix lasts for an epoch, not for a drive.
//!
//! ```text
//! push_base ──► latest base epoch ─┐
//! push_rover ─► single point ──────┴► links ─► predict ─► births, deaths, slips ─► screen ─► update ─► integers ─► Solution
//! ```
//!
//! * [`config`]: what can be told; [`RtkConfig::default`] is meant for every case.
//! * `link`: single differences, observed minus computed.
//! * `channel`: which ambiguity sits where; exact change of reference.
//! * `track`: births, deaths, slips, outliers.
//! * `fix`: integers and the constrained density. `partial`: which part of them, where not all.
//! * `moving_base`: a base that moves. `length`: a baseline of known length. `adaptation`: noise that follows the data.
//! * `monitor`: protection levels. `fault`: faults of one satellite.
//! * [`evidence`]: the measurements of an epoch as they were used, to be used again.
//!
//! Frames: ECEF; metres, metres per second; ambiguities in cycles, reference minus satellite.
//!
//! Panic contract: none, on any epoch. Work per epoch: O(rows · n²) for the update with n states, plus a bounded integer
//! search. All state and workspace is inside [`RtkFilter`], which suits a `static`; the stack holds at most one word per
//! signal of its capacity.

mod adaptation;
mod channel;
pub mod config;
mod constrained;
pub mod evidence;
mod fault;
#[cfg(feature = "log")]
pub mod feed;
mod fix;
mod length;
mod link;
mod monitor;
mod moving_base;
mod partial;
pub mod preset;
mod range;
mod rows;
#[cfg(test)]
mod sky;
#[cfg(test)]
mod tests;
mod track;

pub use config::RtkConfig;

use crate::filter::common_term::CommonTerm;
use crate::filter::gaussian::{Gaussian, UpdateWork};
use crate::filter::screen::Row;
use crate::filter::update::Gauge;
use crate::gnss::atmosphere::Klobuchar;
use crate::gnss::ephemeris::Ephemeris;
use crate::gnss::epoch::{EpochView, Observation};
use crate::gnss::orbit::store::{EphemerisStore, SelectionRule};
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::gnss::solution::{Quality, Reason, Solution};
use crate::gnss::time::GpsTime;
use crate::spp::rows::Rows;
use crate::spp::{self, SinglePoint, single_point};
use adaptation::Adaptive;
use channel::{Channels, GROUPS};
use constrained::Constrained;
use heapless::Vec;
use link::{Carrier, Link, Sight, Station, select};
use monitor::Monitor;
use moving_base::BaseMotion;
use nalgebra::{Matrix3, Vector3};
use rows::KinematicRow;

/// Beyond this standard deviation of the predicted position `[m]` it is taken from the single point.
const LOST_POSITION: f64 = 30.0;
/// Standard deviation of a position taken from a single point, wide enough to carry no information `[m]`.
const NEW_POSITION: f64 = 100.0;
/// Standard deviation of a velocity before the first Doppler `[m/s]`.
const NEW_VELOCITY: f64 = 50.0;
/// Standard deviation of an acceleration before it was observed `[m/s²]`.
const NEW_ACCELERATION: f64 = 10.0;
/// A filter position farther than this from the one by codes alone, in standard deviations plus a distance
/// ([`LOST_POSITION`] for single points, [`CODE_BIAS`] for differences), is wrong.
const DISAGREEMENT: f64 = 10.0;
/// What multipath may do to a position by differences of codes for long `[m]`.
const CODE_BIAS: f64 = 10.0;
/// For how long differences of codes may disagree with the filter before it starts anew `[s]`.
const CONTRADICTED: f64 = 5.0;
/// Variance growth of a satellite clock's prediction between base and rover epoch, per second of age `[m/s]`.
const CLOCK_STABILITY: f64 = 1.5e-3;

/// A difference of two receivers' phases beyond this cannot be kept to the millimetre in `f64`; none has it `[m]`.
const MAX_PHASE: f64 = 1e10;

/// The latest base epoch.
#[derive(Clone, Debug)]
struct Base<const C: usize> {
    time: Option<GpsTime>,
    observations: Vec<Observation, C>,
    /// A rover epoch has used it, and with it its loss-of-lock flags.
    used: bool,
}

/// A real-time kinematic filter with room for `C` signals (of all bands), `N` states and `E` ephemerides.
///
/// `N` must be at least `C` + 9 and `C` at most 255; a smaller one does not compile. See the presets in this module.
pub struct RtkFilter<const C: usize, const N: usize, const E: usize> {
    config: RtkConfig,
    /// Antenna reference point of the base.
    base_position: Option<Vector3<f64>>,
    /// Motion of a moving base, as of its latest epoch.
    base_motion: Option<BaseMotion>,
    /// Base epoch that the relaxed density refers to.
    base_used: Option<GpsTime>,
    /// Antenna reference point of the rover above its marker: up, east, north.
    #[cfg(feature = "log")]
    rover_antenna: [f64; 3],
    ionosphere: Option<Klobuchar>,
    ephemerides: EphemerisStore<E>,
    base: Base<C>,
    /// Attributes last used by the rover, and by the base, for each group.
    attributes: [[u8; GROUPS]; 2],
    /// Epoch of the relaxed density.
    time: Option<GpsTime>,
    /// Latest rover epoch, used or not.
    latest: Option<GpsTime>,
    /// Where the relaxed density is linearised; its first three states are the position error.
    position: Vector3<f64>,
    /// Where the links of the latest epoch were computed.
    linearized: Vector3<f64>,
    density: Gaussian<f64, N>,
    channels: Channels<C>,
    observations: Vec<Observation, C>,
    links: Vec<Link, C>,
    rows: Vec<Row, C>,
    common: CommonTerm<f64, N>,
    update_work: UpdateWork<f64, N>,
    spp_rows: Rows<C>,
    integers: fix::Integers<C>,
    constrained: Constrained,
    /// Variance factors of codes and phases against their configured noise.
    code_factor: track::VarianceFactor,
    phase_factor: track::VarianceFactor,
    /// Codes used of late.
    codes: Vec<track::CodeUse, C>,
    /// Since when the codes put the rover elsewhere.
    contradicted_since: Option<GpsTime>,
    monitor: Monitor,
    /// Noise that was learned.
    adaptive: Adaptive<C>,
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    const CAPACITIES_FIT: () = assert!(N >= C + 9 && C <= 255, "N must be at least C + 9, and C at most 255");

    /// A filter that has seen nothing. `base_position` is the antenna reference point of the base, ECEF `[m]`; without
    /// it there are only single points.
    pub const fn new(config: RtkConfig, base_position: Option<Vector3<f64>>) -> Self {
        let () = Self::CAPACITIES_FIT;
        Self {
            config,
            base_position,
            base_motion: None,
            base_used: None,
            #[cfg(feature = "log")]
            rover_antenna: [0.0; 3],
            ionosphere: None,
            ephemerides: EphemerisStore::new(),
            base: Base { time: None, observations: Vec::new(), used: false },
            attributes: [[0; GROUPS]; 2],
            time: None,
            latest: None,
            position: Vector3::new(0.0, 0.0, 0.0),
            linearized: Vector3::new(0.0, 0.0, 0.0),
            density: Gaussian::new(),
            channels: Channels::new(),
            observations: Vec::new(),
            links: Vec::new(),
            rows: Vec::new(),
            common: CommonTerm::new(),
            update_work: UpdateWork::new(),
            spp_rows: Rows::new(),
            integers: fix::Integers::new(),
            constrained: Constrained::new(),
            code_factor: track::VarianceFactor::NOMINAL,
            phase_factor: track::VarianceFactor::NOMINAL,
            codes: Vec::new(),
            contradicted_since: None,
            monitor: Monitor::new(),
            adaptive: Adaptive::new(),
        }
    }

    /// Changes the configuration and forgets everything that was estimated under the old one, where a base that moved was
    /// too.
    pub fn configure(&mut self, config: RtkConfig) {
        if self.config.moving_base {
            self.base_position = None;
        }
        self.forget_base_motion();
        self.config = config;
        self.restart();
    }

    /// The configuration.
    pub const fn config(&self) -> &RtkConfig {
        &self.config
    }

    /// Takes a broadcast ephemeris.
    pub fn push_ephemeris(&mut self, ephemeris: Ephemeris) {
        self.ephemerides.insert(ephemeris);
    }

    /// Takes the broadcast ionosphere parameters, used for single points.
    pub fn push_ionosphere(&mut self, ionosphere: Klobuchar) {
        self.ionosphere = Some(ionosphere);
    }

    /// Takes an epoch of the base. One that is not later than the latest is dropped; returns whether it was taken.
    pub fn push_base(&mut self, epoch: EpochView<'_>) -> bool {
        if self.base.time.is_some_and(|latest| epoch.time <= latest) {
            return false;
        }
        // Flags of an epoch that no rover epoch used must not be lost.
        let mut before: Vec<(SatelliteId, Signal, bool), C> = Vec::new();
        if !self.base.used {
            for o in &self.base.observations {
                let _ = before.push((o.satellite, o.signal, o.loss_of_lock));
            }
        }
        let preferred = if self.time.is_some() { self.attributes[0] } else { self.attributes[1] };
        select(epoch.observations, &self.config.bands, &preferred, &mut self.base.observations);
        for observation in &mut self.base.observations {
            let (satellite, signal) = (observation.satellite, observation.signal);
            let same = before.iter().find(|(id, other, _)| *id == satellite && other.band() == signal.band());
            observation.loss_of_lock |= same.is_some_and(|&(_, other, lost)| lost || other != signal);
        }
        self.base.time = Some(epoch.time);
        self.base.used = false;
        if self.config.moving_base {
            self.locate_base(epoch);
        }
        true
    }

    /// Takes an epoch of the rover and answers.
    pub fn push_rover(&mut self, epoch: EpochView<'_>) -> Solution {
        let mut solution = self.answer(epoch);
        self.monitor.bound(&self.config.integrity, &mut solution);
        solution
    }

    fn answer(&mut self, epoch: EpochView<'_>) -> Solution {
        if self.latest.is_some_and(|latest| epoch.time <= latest) {
            return Solution::none(epoch.time, Reason::OutOfOrder);
        }
        self.latest = Some(epoch.time);
        select(epoch.observations, &self.config.bands, &self.attributes[0], &mut self.observations);
        self.note_slips();

        let single = self.single_point_of(epoch, self.time.map(|_| self.position));
        let single = single.as_ref();
        self.monitor.note_code(single.map_or(1.0, SinglePoint::inflation));
        let located = self.base_position.filter(|_| !self.config.moving_base || self.base_motion.is_some());
        let age = located.and(self.base.time).map(|time| epoch.time.since(time));
        let unusable = match age {
            None => Some(Reason::NoBase),
            Some(age) if libm::fabs(age) > self.config.max_age => Some(Reason::BaseTooOld),
            Some(_) => None,
        };
        if let Some(reason) = unusable {
            return code_solution(epoch.time, single, reason);
        }
        if !self.predict(epoch.time, single) {
            return code_solution(epoch.time, single, Reason::PositionFailed);
        }
        self.constrained.prepare(&self.density, self.position, self.config.motion.states());
        self.build_links(epoch.time);
        if self.links.iter().filter(|link| link.code.is_some() || link.phase.is_some()).count() < 4 {
            self.forget_position();
            return code_solution(epoch.time, single, Reason::TooFewCommonSatellites);
        }
        self.base.used = true;
        let mut solution = Solution::none(epoch.time, Reason::TooFewAmbiguities);
        solution.age = age.unwrap_or(0.0);
        if !self.screen_code(&mut solution) {
            self.restart();
            return code_solution(epoch.time, single, Reason::Restarted);
        }
        self.track(epoch.time, &mut solution);
        self.screen_doppler();
        let updated = self.update();
        self.absorb_position();
        self.time = Some(epoch.time);
        self.base_used = self.base.time;
        let Some(gauge) = updated.filter(|_| self.is_sound(single)) else {
            self.restart();
            return code_solution(epoch.time, single, Reason::Restarted);
        };
        self.adapt(epoch.time);
        self.measure_length(epoch.time, single);
        self.settle(epoch.time, &mut solution);
        self.monitor.note(gauge, solution.position_covariance);
        self.fix(&mut solution, single);
        if self.look_for_faults(&mut solution) {
            self.keep_length(&mut solution, single);
        }
        self.report_vector(&mut solution, single);
        solution
    }

    /// The rover's marker, for a position of its antenna reference point.
    fn marker(&self, antenna: Vector3<f64>) -> Vector3<f64> {
        #[cfg(feature = "log")]
        return antenna - feed::above_marker(&antenna, &self.rover_antenna);
        #[cfg(not(feature = "log"))]
        antenna
    }

    /// Forgets everything but configuration and ephemerides.
    fn restart(&mut self) {
        self.time = None;
        self.density.clear();
        self.channels.clear();
        self.codes.clear();
        self.contradicted_since = None;
        self.constrained.end();
        self.monitor.clear();
        self.adaptive.clear();
    }

    /// Without enough satellites the motion model alone would carry the position: let the next epoch start it anew.
    fn forget_position(&mut self) {
        if self.time.is_some() {
            self.density.inflate(0, NEW_POSITION * NEW_POSITION);
            self.constrained.end();
        }
    }

    /// The position by code alone, of rover or base, sought from `start` on.
    fn single_point_of(&mut self, epoch: EpochView<'_>, start: Option<Vector3<f64>>) -> Option<SinglePoint> {
        let mut config = spp::Config { elevation_mask: self.config.elevation_mask, ..spp::Config::DEFAULT };
        for constellation in Constellation::ALL {
            if let Some(band) = self.config.bands.bands(constellation).next() {
                config.bands[constellation.index()] = band;
            }
        }
        single_point(epoch, &self.ephemerides, self.ionosphere, &config, start, &mut self.spp_rows).ok()
    }

    /// Brings the kinematic states to the time of the epoch; false if there is no position to start from.
    fn predict(&mut self, time: GpsTime, single: Option<&SinglePoint>) -> bool {
        let motion = self.config.motion;
        match self.time {
            Some(before) => {
                let h = time.since(before);
                let noise = motion.process_noise(h, self.config.motion_noise);
                let transition = motion.transition(h);
                self.density.propagate(motion.order(), &transition, &[noise; 3]);
                self.constrained.propagate(motion.order(), &transition, &noise);
                self.absorb_position();
                self.follow_base(h);
                // Noisy phases drift more as well: multipath and foliage.
                let sigma_stay = self.config.screening.sigma_stay;
                let stay = sigma_stay * sigma_stay * h * self.phase_factor.above(track::USUAL_PHASE);
                for channel in self.channels.as_slice() {
                    if let Some(state) = channel.state {
                        let per_unit = channel.wavelength / channel.unit();
                        self.density.inflate(state, stay * per_unit * per_unit);
                    }
                }
                let variance: f64 = (0..3).map(|i| self.density.covariance(i, i)).sum();
                if variance < LOST_POSITION * LOST_POSITION {
                    return true;
                }
            }
            None => {
                self.restart();
                for _ in 0..motion.states() {
                    // The capacity is at least nine states.
                    let _ = self.density.push(0.0, 1.0);
                }
            }
        }
        let Some(single) = single else { return false };
        self.position = single.position;
        for axis in 0..3 {
            self.density.renew(axis, 0.0, NEW_POSITION * NEW_POSITION);
            if motion.order() > 1 {
                self.density.renew(3 + axis, 0.0, NEW_VELOCITY * NEW_VELOCITY);
            }
            if motion.order() > 2 {
                self.density.renew(6 + axis, 0.0, NEW_ACCELERATION * NEW_ACCELERATION);
            }
        }
        true
    }

    /// Moves the mean of the position error into the point of linearisation.
    fn absorb_position(&mut self) {
        if let Some(error) = self.density.mean_mut().get_mut(..3) {
            self.position += Vector3::new(error[0], error[1], error[2]);
            error.fill(0.0);
        }
    }

    /// Single differences of all signals that both stations observe now.
    fn build_links(&mut self, time: GpsTime) {
        self.links.clear();
        let (Some(base_time), Some(base_position)) = (self.base.time, self.base_position) else { return };
        self.linearized = self.position;
        let rover_station = Station::new(time, self.position);
        let base_station = Station::new(base_time, base_position);
        let age = time.since(base_time);
        let kilometres = (self.position - base_position).norm() / 1000.0;
        let atmosphere = self.config.atmosphere * kilometres;
        let clock = CLOCK_STABILITY * age;
        type Clocked = (Sight, f64);
        let mut sights: Option<(SatelliteId, Option<(Clocked, Clocked)>)> = None;
        // The observations are sorted by satellite here, so that each satellite is computed once.
        self.observations.sort_unstable_by_key(|o| (o.satellite, o.signal));
        for rover in &self.observations {
            let id = rover.satellite;
            let base_of = |band| self.base.observations.iter().find(|o| o.satellite == id && o.signal.band() == band);
            let Some(base) = base_of(rover.signal.band()) else { continue };
            let Some(ephemeris) = self.ephemerides.select(id, time, &SelectionRule::SAFE) else { continue };
            if !ephemeris.healthy() {
                continue;
            }
            let pair = match sights {
                Some((satellite, pair)) if satellite == id => pair,
                _ => {
                    // Any code will do for the time of transmission; without one the satellite cannot be placed.
                    let code = |observations: &[Observation]| {
                        observations.iter().filter(|o| o.satellite == id).find_map(|o| o.code)
                    };
                    let clocked = |station: &Station, code: Option<f64>| {
                        let sight = station.sight(ephemeris, code?)?;
                        Some((sight, code? - sight.computed))
                    };
                    let pair = clocked(&rover_station, code(&self.observations))
                        .zip(clocked(&base_station, code(&self.base.observations)));
                    sights = Some((id, pair));
                    pair
                }
            };
            let Some(((rover_sight, rover_clock), (base_sight, base_clock))) = pair else { continue };
            let constellation = id.constellation();
            let (Some(wavelength), Some(slot)) = (
                rover.signal.wavelength(constellation, self.ephemerides.glonass_channel(id)),
                self.config.bands.slot(constellation, rover.signal.band()),
            ) else {
                continue;
            };
            let sine = rover_sight.sin_elevation;
            let low = sine < libm::sin(self.config.elevation_mask);
            let weak = [rover, base].iter().any(|o| o.cn0.is_some_and(|cn0| cn0 < self.config.cn0_mask));
            if low || weak {
                continue;
            }
            let common = atmosphere * atmosphere / (sine * sine).max(0.0025) + clock * clock;
            let fdma = if constellation == Constellation::Glonass { 25.0 } else { 1.0 };
            let of =
                |observation: &Observation, noise: &crate::model::noise::Noise| noise.variance(sine, observation.cn0);
            let computed = rover_sight.computed - base_sight.computed;
            let rate = match self.base_motion {
                None => rover.doppler.map(|d| -wavelength * d - rover_sight.computed_rate),
                Some(motion) => rover.doppler.zip(base.doppler).map(|(r, b)| {
                    let computed = rover_sight.computed_rate - base_sight.computed_rate;
                    let carried = (rover_sight.direction - base_sight.direction).dot(&motion.velocity);
                    -wavelength * (r - b) - computed + carried
                }),
            };
            let rates = if self.base_motion.is_some() { 2.0 } else { 1.0 };
            let carrier = rover.phase.zip(rover.doppler);
            let code_variance = fdma * (of(rover, &self.config.code) + of(base, &self.config.code)) + common;
            let phase_variance = of(rover, &self.config.phase) + of(base, &self.config.phase) + common;
            let link = Link {
                satellite: id,
                slot,
                signals: [rover.signal, base.signal],
                wavelength,
                direction: rover_sight.direction,
                range: rover_sight.range,
                sin_elevation: sine,
                code: rover.code.zip(base.code).map(|(r, b)| r - b - computed).filter(|x| x.is_finite()),
                code_variance,
                single_code_variance: code_variance,
                phase: rover
                    .phase
                    .zip(base.phase)
                    .map(|(r, b)| wavelength * (r - b) - computed)
                    .filter(|x| libm::fabs(*x) < MAX_PHASE),
                phase_variance,
                single_phase_variance: phase_variance,
                doppler: rate.filter(|x| x.is_finite()),
                doppler_variance: rates * self.config.doppler * self.config.doppler / (sine * sine),
                clocks: [rover_clock, base_clock],
                carrier: carrier.map(|(phase, d)| Carrier { phase: wavelength * phase, rate: -wavelength * d }),
                loss_of_lock: rover.loss_of_lock || base.loss_of_lock,
                half_cycle: rover.half_cycle || base.half_cycle,
                channel: None,
                code_rejected: false,
                phase_rejected: false,
                slipped: false,
                reopened: false,
            };
            let group = channel::group(constellation, slot);
            for (attributes, signal) in self.attributes.iter_mut().zip(link.signals) {
                if let Some(attribute) = attributes.get_mut(group) {
                    *attribute = signal.attribute();
                }
            }
            // Capacity is that of the observations.
            let _ = self.links.push(link);
        }
        link::drop_misplaced(&mut self.links);
        self.adaptive.apply(&self.config.adaptation, &mut self.links);
        let covariance = Matrix3::from_fn(|i, j| self.density.covariance(i, j));
        range::relinearize(&mut self.links, self.config.estimation.rule, &covariance);
        // The best first: the first row of a group defines its common term.
        self.links.sort_unstable_by(|a, b| b.sin_elevation.total_cmp(&a.sin_elevation).then(a.slot.cmp(&b.slot)));
    }

    /// Updates the relaxed density with all that was not rejected: Doppler, phase, code. None if it cannot take them.
    fn update(&mut self) -> Option<Gauge<f64>> {
        let Self { density, common, links, channels, update_work, config, .. } = self;
        let (n, with_velocity) = (density.dim(), config.motion.order() > 1);
        let outcome = density.update(config.estimation.form, update_work, |stage, mean| {
            let mut take = |common: &mut CommonTerm<f64, N>, row: KinematicRow, ambiguity: Option<(usize, f64)>| {
                let [x, y, z] = row.entries;
                let entries = [x, y, z, ambiguity.unwrap_or((n, 0.0))];
                let difference = common.difference(n, &entries, row.value, row.variance);
                difference.map_or(Ok(()), |difference| difference.update(stage, mean))
            };
            common.reset();
            for row in rows::doppler(links).filter(|_| with_velocity) {
                take(common, row, None)?;
            }
            for group in 0..GROUPS {
                common.reset();
                for (row, channel) in rows::phase(links, channels.as_slice(), group) {
                    take(common, row, channel.state.map(|state| (state, -channel.unit())))?;
                }
                common.reset();
                for row in rows::code(links, group) {
                    take(common, row, None)?;
                }
            }
            Ok(())
        });
        outcome.ok()
    }

    /// Whether the density is still one, and agrees with the single point.
    fn is_sound(&self, single: Option<&SinglePoint>) -> bool {
        let agrees = single.is_none_or(|single| {
            let sigma = libm::sqrt(single.covariance.trace().max(0.0));
            (self.position - single.position).norm() < DISAGREEMENT * sigma + LOST_POSITION
        });
        self.density.is_sound() && self.position.iter().all(|x| x.is_finite()) && agrees
    }

    /// Position and velocity of the relaxed density.
    fn report_relaxed(&self, solution: &mut Solution) {
        solution.quality = Quality::Float;
        solution.position = self.position;
        solution.position_covariance = Matrix3::from_fn(|i, j| self.density.covariance(i, j));
        if self.config.motion.order() > 1 {
            solution.velocity = Vector3::from_fn(|i, _| self.density.mean().get(3 + i).copied().unwrap_or(0.0));
            solution.velocity_covariance = Matrix3::from_fn(|i, j| self.density.covariance(3 + i, 3 + j));
        }
    }
}

/// The answer where only a single point is to be had, or nothing.
fn code_solution(time: GpsTime, single: Option<&SinglePoint>, reason: Reason) -> Solution {
    let mut solution = Solution::none(time, reason);
    if let Some(single) = single {
        solution.quality = Quality::Code;
        solution.position = single.position;
        solution.position_covariance = single.covariance;
        if let Some(velocity) = &single.velocity {
            solution.velocity = velocity.velocity;
            solution.velocity_covariance = velocity.covariance;
        }
        solution.satellites_used = single.used;
        solution.satellites_rejected = single.rejected;
    }
    solution
}
