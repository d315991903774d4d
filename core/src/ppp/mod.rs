//! Precise point positioning: one receiver, precise orbits and clocks, real-valued ambiguities, in real time.
//!
//! State and measurements are those of Zhang et al., *Automatic Calibration of Process Noise Matrix and Measurement Noise
//! Covariance for Multi-GNSS PPP*, Remote Sens. 12 (2020), section 2: position, velocity of a moving receiver, receiver
//! clock, inter-system biases, zenith wet delay (and gradients), one ambiguity a satellite for the ionosphere-free
//! combination of any two bands; or, [`config::Ionosphere::Estimated`], both bands as they are with a slant delay a satellite.
//!
//! ```text
//! epoch ─► select ─► clock jump ─► sight (orbits, antennas, tides, troposphere …) ─► slips ─► births, deaths
//!                                        ▲ Products                                     │
//! PppSolution ◄── postfit residuals ◄── update: codes, phases ◄── screen ◄── predict ◄──┘
//! ```
//!
//! * [`config`]: what can be told. [`products`]: what the engine asks the world.
//! * [`select`]: which signals. [`track`]: slips and jumps. [`sight`]: what is modelled. [`states`]: what is estimated.
//! * [`link`]: rows; after an epoch, [`PppFilter::links`] shows what was made of its measurements.
//!
//! Frames: positions are those of the marker in the frame of the orbits, ECEF; metres, ambiguities too.
//!
//! Panic contract: none, on any epoch. Work per epoch: O(rows · n²) for n states. All state and workspace is inside
//! [`PppFilter`], which suits a `static`.

pub mod config;
pub mod link;
pub mod products;
pub mod select;
pub mod sight;
pub mod solution;
mod start;
pub mod states;
#[cfg(test)]
mod tests;
pub mod track;
mod update;

pub use config::PppConfig;
pub use products::Products;
pub use solution::{Estimate, PppSolution};

use crate::filter::gaussian::UpdateWork;
use crate::filter::screen;
use crate::gnss::epoch::EpochView;
use crate::gnss::satellite::{Constellation, SatelliteId, SatelliteSet};
use crate::gnss::solution::{Quality, Reason, Solution};
use crate::gnss::time::GpsTime;
use crate::spp::rows::Rows;
use config::{Ionosphere, Motion};
use heapless::Vec;
use link::{Kind, Link};
use nalgebra::{Matrix3, Vector3};
use products::Missing;
use select::{PairReading, select};
use sight::{Station, sight};
use states::{Label, States};
use track::{ArcEnd, Track, clock_jump};

/// Beyond this standard deviation of the predicted position it is linearised at a single point `[m]`.
const UNSURE: f64 = 5.0;
/// The engine starts anew after so long without a position `[s]`.
const FORGOTTEN: f64 = 3600.0;
/// Beyond this standard deviation there is no position to speak of `[m]`.
const LOST: f64 = 100.0;
/// Time between epochs before it is known `[s]`.
const USUAL_STEP: f64 = 30.0;
/// GLONASS slots.
const SLOTS: usize = 28;

/// An arc that ended in the latest epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndedArc {
    /// Whose.
    pub satellite: SatelliteId,
    /// Its number.
    pub arc: u32,
    /// Why.
    pub end: ArcEnd,
}

/// A filter with room for `S` satellites and `N` states.
///
/// `N` must be at least `S` + 15 (three times `S` + 15 for [`Ionosphere::Estimated`] of all of them, otherwise satellites are left
/// out and counted); a smaller one does not compile.
pub struct PppFilter<const S: usize, const N: usize> {
    config: PppConfig,
    /// Antenna reference point from the marker: east, north, up `[m]`.
    antenna: Vector3<f64>,
    channels: [Option<i8>; SLOTS],
    /// Where a position is expected, if anyone knows.
    approximate: Option<Vector3<f64>>,
    time: Option<GpsTime>,
    /// From the epoch before to this one, as far as is known `[s]`.
    step: f64,
    /// Epochs that the density is made of.
    epochs: u32,
    /// Where the density is linearised.
    position: Vector3<f64>,
    reference: Option<Constellation>,
    states: States<N>,
    tracks: Vec<Track, S>,
    /// Milliseconds that were added to phases, as a distance.
    jump: f64,
    /// Code minus phase of each satellite in the epoch before `[m]`.
    apart: Vec<(SatelliteId, f64), S>,
    next_arc: u32,
    readings: Vec<PairReading, S>,
    links: Vec<Link, S>,
    ended: Vec<EndedArc, S>,
    screen: Vec<screen::Row, S>,
    update: UpdateWork<f64, N>,
    single: Rows<S>,
    station: Option<Station>,
}

impl<const S: usize, const N: usize> PppFilter<S, N> {
    const CAPACITIES_FIT: () = assert!(N >= S + 15 && S > 3, "N must be at least S + 15");

    /// A filter that has seen nothing.
    pub const fn new(config: PppConfig) -> Self {
        let () = Self::CAPACITIES_FIT;
        Self {
            config,
            antenna: Vector3::new(0.0, 0.0, 0.0),
            channels: [None; SLOTS],
            approximate: None,
            time: None,
            step: USUAL_STEP,
            epochs: 0,
            position: Vector3::new(0.0, 0.0, 0.0),
            reference: None,
            states: States::new(),
            tracks: Vec::new(),
            jump: 0.0,
            apart: Vec::new(),
            next_arc: 0,
            readings: Vec::new(),
            links: Vec::new(),
            ended: Vec::new(),
            screen: Vec::new(),
            update: UpdateWork::new(),
            single: Rows::new(),
            station: None,
        }
    }

    /// The configuration.
    pub const fn config(&self) -> &PppConfig {
        &self.config
    }

    /// Says where the antenna reference point is from the marker: east, north, up `[m]`. Effective from the next epoch on.
    pub fn set_antenna(&mut self, antenna: Vector3<f64>) {
        self.antenna = antenna;
    }

    /// Says where the marker is thought to be, ECEF `[m]`: the first position is linearised there, with the prior's standard deviation,
    /// instead of at a single point.
    pub fn set_approximate(&mut self, position: Option<Vector3<f64>>) {
        self.approximate = position;
    }

    /// Says on which channel a GLONASS satellite sends.
    pub fn set_channel(&mut self, satellite: SatelliteId, channel: i8) {
        if let Some(slot) = self.channels.get_mut(usize::from(satellite.number())) {
            *slot = Some(channel);
        }
    }

    /// The measurements of the latest epoch as they were used.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Arcs that ended in the latest epoch.
    pub fn ended(&self) -> &[EndedArc] {
        &self.ended
    }

    /// The receiver as the latest epoch was computed for it.
    pub fn station(&self) -> Option<&Station> {
        self.station.as_ref()
    }

    /// The density after the latest epoch; its first three states are 0 about the position of the solution.
    pub fn states(&self) -> &States<N> {
        &self.states
    }

    /// Forgets everything but the configuration, the antenna, and channels.
    pub fn restart(&mut self) {
        self.states.clear();
        self.tracks.clear();
        self.apart.clear();
        (self.time, self.reference, self.jump) = (None, None, 0.0);
    }

    /// Starts anew with another configuration; the antenna and channels stay.
    pub fn reconfigure(&mut self, config: PppConfig) {
        self.restart();
        self.config = config;
    }

    /// Takes an epoch. One that is not later than the one before is dropped ([`Reason::OutOfOrder`]).
    pub fn push(&mut self, epoch: EpochView<'_>, products: &impl Products) -> PppSolution {
        self.links.clear();
        self.ended.clear();
        let time = epoch.time;
        let none = |reason| PppSolution::none(Solution::none(time, reason));
        if self.time.is_some_and(|latest| time <= latest) {
            return none(Reason::OutOfOrder);
        }
        if self.time.is_some_and(|latest| time.since(latest) > FORGOTTEN) {
            self.restart();
        }
        let channels = self.channels;
        let channel = |satellite: SatelliteId| {
            let glonass = satellite.constellation() == Constellation::Glonass;
            channels.get(usize::from(satellite.number())).copied().flatten().filter(|_| glonass)
        };
        let has_bias = |satellite, signal| products.code_bias(satellite, signal, time).is_some();
        let overflow = select(epoch.observations, &self.config.bands, channel, &has_bias, &mut self.readings);
        let clock_jump = self.repair_clock();

        let mut outcome = none(Reason::TooFewSatellites);
        outcome.overflow = overflow.min(usize::from(u16::MAX)) as u16;
        outcome.clock_jump = clock_jump;
        self.predict(time);
        if let Err(reason) = self.linearize(time, products) {
            outcome.solution.reason = reason;
            let missing = |reading: &&PairReading| {
                sight::at_transmission(reading.satellite, time, reading.bands[0].code, products).is_err()
            };
            outcome.without_products = self.readings.iter().filter(missing).map(|reading| reading.satellite).collect();
            return outcome;
        }
        let station = Station::new(time, &self.position, &self.antenna, products, &self.config);
        self.observe(&station, products, &mut outcome);
        outcome.zenith_hydrostatic = station.troposphere.zenith.hydrostatic;
        let wet = station.troposphere.zenith.wet;
        self.station = Some(station);
        if !self.prepare_states(&mut outcome) {
            return outcome;
        }
        self.screen(&mut outcome.solution);
        match self.take() {
            Ok(()) => self.conclude(&mut outcome, wet),
            Err(reason) => {
                self.restart();
                outcome.solution.reason = reason;
            }
        }
        outcome
    }

    /// Moves phases after codes that moved by whole milliseconds; returns by how much.
    fn repair_clock(&mut self) -> f64 {
        let mut changes: Vec<f64, S> = Vec::new();
        let mut now: Vec<(SatelliteId, f64), S> = Vec::new();
        for reading in &self.readings {
            let apart = reading.codes()[0] - reading.phases()[0];
            let before = self.apart.iter().find(|(satellite, _)| *satellite == reading.satellite);
            if let Some((_, before)) = before {
                let _ = changes.push(apart - before);
            }
            let _ = now.push((reading.satellite, apart));
        }
        self.apart = now;
        let jump = clock_jump(&mut changes);
        self.jump += jump;
        if self.jump != 0.0 {
            for reading in &mut self.readings {
                let wavelengths = reading.pair.wavelengths();
                for (band, wavelength) in reading.bands.iter_mut().zip(wavelengths) {
                    band.phase += self.jump / wavelength;
                }
            }
        }
        jump
    }

    fn predict(&mut self, time: GpsTime) {
        if let Some(before) = self.time {
            self.step = time.since(before);
            self.states.predict(self.step, &self.config);
        }
        self.time = Some(time);
        self.fold();
    }

    /// Takes the position error into the linearisation point.
    fn fold(&mut self) {
        if let Some(mean) = self.states.density.mean_mut().get_mut(..3) {
            for (position, error) in self.position.iter_mut().zip(mean) {
                *position += *error;
                *error = 0.0;
            }
        }
    }

    /// Finds where to linearise: where the filter is, or at a single point.
    fn linearize(&mut self, time: GpsTime, products: &impl Products) -> Result<(), Reason> {
        if self.states.is_empty() {
            self.epochs = 0;
        }
        let unsure = (0..3).any(|axis| self.states.density.covariance(axis, axis) > UNSURE * UNSURE);
        if !self.states.is_empty() && !unsure {
            return Ok(());
        }
        let known = if self.states.is_empty() { self.approximate } else { None };
        let single = match known {
            Some(position) => position,
            None => {
                let start = (!self.states.is_empty()).then_some(self.position);
                start::single_point(time, &self.readings, products, &self.config, start, &mut self.single)?
            }
        };
        if self.states.is_empty() {
            return self.begin(single);
        }
        let moved = self.position - single;
        self.position = single;
        if let Some(mean) = self.states.density.mean_mut().get_mut(..3) {
            for (error, moved) in mean.iter_mut().zip(moved.iter()) {
                *error += moved;
            }
        }
        Ok(())
    }

    /// Begins at a position.
    fn begin(&mut self, position: Vector3<f64>) -> Result<(), Reason> {
        let prior = &self.config.prior;
        let square = |sigma: f64| sigma * sigma;
        let mut labels: Vec<(Label, f64), 10> = Vec::new();
        let mut add = |label, sigma| labels.push((label, square(sigma))).map_err(|_| Reason::Restarted);
        for axis in 0..3 {
            add(Label::Position(axis), prior.position)?;
        }
        if self.config.motion == Motion::Kinematic {
            for axis in 0..3 {
                add(Label::Velocity(axis), prior.velocity)?;
            }
        }
        add(Label::Clock, prior.clock)?;
        add(Label::Zenith, prior.zenith)?;
        if self.config.gradients {
            add(Label::Gradient(0), prior.gradients)?;
            add(Label::Gradient(1), prior.gradients)?;
        }
        for &(label, variance) in &labels {
            self.states.bear(label, 0.0, variance).map_err(|_| Reason::Restarted)?;
        }
        self.position = position;
        Ok(())
    }

    /// Looks at all satellites, and at what became of their arcs.
    fn observe(&mut self, station: &Station, products: &impl Products, outcome: &mut PppSolution) {
        let Self { readings, links, tracks, ended, next_arc, config, .. } = self;
        let time = station.time;
        tracks.retain(|track| time.since(track.time) <= config.screening.gap);
        for reading in readings.iter() {
            let satellite = reading.satellite;
            let place = tracks.iter().position(|track| track.satellite == satellite);
            let wind_up = place.and_then(|place| tracks.get(place)?.wind_up);
            let seen = match sight(station, reading, wind_up, products, config) {
                Ok(Some(seen)) => seen,
                Ok(None) => continue,
                Err(Missing::Orbit | Missing::OrbitGap | Missing::Clock | Missing::ClockGap) => {
                    outcome.without_products.insert(satellite);
                    continue;
                }
            };
            let mut begin = || {
                *next_arc = next_arc.wrapping_add(1);
                Track::begin(reading, time, *next_arc)
            };
            let track = match place.and_then(|place| tracks.get_mut(place)) {
                Some(track) => {
                    if let Some(end) = track.advance(reading, time, &config.screening) {
                        let _ = ended.push(EndedArc { satellite, arc: track.arc, end });
                        outcome.solution.satellites_slipped.insert(satellite);
                        *track = begin();
                    }
                    track
                }
                None => {
                    if tracks.push(begin()).is_err() {
                        outcome.overflow = outcome.overflow.saturating_add(1);
                        continue;
                    }
                    let Some(track) = tracks.last_mut() else { continue };
                    track
                }
            };
            track.wind_up = Some(seen.wind_up);
            if !seen.antenna_known {
                outcome.without_antenna.insert(satellite);
            }
            if !seen.attitude_known {
                outcome.attitude_guessed.insert(satellite);
            }
            let mut link = Link::new(*reading, seen, station, products, config);
            (link.arc, link.age) = (track.arc, track.age);
            let _ = links.push(link);
        }
    }

    /// Bears and buries states; whether there is enough to go on with.
    fn prepare_states(&mut self, outcome: &mut PppSolution) -> bool {
        let prior = self.config.prior;
        let square = |sigma: f64| sigma * sigma;
        let slots = Link::slots(self.config.ionosphere);

        // Clocks by the codes of each constellation.
        let clocks = Constellation::ALL.map(|constellation| self.code_clock(constellation));
        if self.reference.is_none() {
            self.reference =
                Constellation::ALL.into_iter().find(|c| clocks.get(c.index()).is_some_and(Option::is_some));
        }
        let Some(reference) = self.reference else { return false };
        // The clock by the reference, or by another whose bias is known.
        let by_others = || {
            Constellation::ALL.into_iter().find_map(|constellation| {
                let clock = clocks.get(constellation.index()).copied()??;
                Some(clock - self.states.marginal(Label::InterSystem(constellation))?.0)
            })
        };
        let Some(clock) = clocks.get(reference.index()).copied().flatten().or_else(by_others) else { return false };
        let _ = self.states.bear(Label::Clock, clock, square(prior.clock));
        for constellation in Constellation::ALL.into_iter().filter(|&c| c != reference) {
            let label = Label::InterSystem(constellation);
            if let Some(Some(own)) = clocks.get(constellation.index())
                && self.states.index(label).is_none()
            {
                let _ = self.states.bear(label, own - clock, square(prior.inter_system));
            }
        }

        // Ambiguities and delays of satellites whose arc has ended, or that are gone.
        let Self { states, tracks, links, .. } = self;
        states.retain(|label| match label {
            Label::Ambiguity(satellite, _) | Label::Ionosphere(satellite) => {
                tracks.iter().any(|track| track.satellite == satellite)
            }
            _ => true,
        });
        for link in links.iter_mut() {
            let Some(track) = tracks.iter_mut().find(|track| track.satellite == link.satellite) else { continue };
            let own = clocks.get(link.satellite.constellation().index()).copied().flatten().unwrap_or(clock);
            let mut room = true;
            let mut delay = 0.0;
            if self.config.ionosphere == Ionosphere::Estimated {
                let ratio = link.pair.pair.ionosphere_ratio();
                delay = (link.code[1].residual - link.code[0].residual) / (ratio - 1.0);
                let label = Label::Ionosphere(link.satellite);
                match states.marginal(label) {
                    Some((known, _)) => delay = known,
                    None => room &= states.bear(label, delay, square(prior.ionosphere)).is_ok(),
                }
            }
            for slot in 0..slots {
                let label = Label::Ambiguity(link.satellite, slot as u8);
                let offset = &mut track.offset[slot % 2];
                if track.age == 0 || states.index(label).is_none() {
                    let ionosphere = link.ionosphere(Kind::Phase, slot) * delay;
                    *offset = link.phase[slot % 2].residual - own - ionosphere;
                    room &= states.bear(label, 0.0, square(prior.ambiguity)).is_ok();
                }
                link.phase[slot % 2].residual -= *offset;
            }
            if !room {
                outcome.overflow = outcome.overflow.saturating_add(1);
                for slot in 0..slots {
                    link.code[slot % 2].rejected = true;
                    link.phase[slot % 2].rejected = true;
                }
            }
        }
        !self.links.is_empty()
    }

    /// Median of the code residuals of a constellation.
    fn code_clock(&self, constellation: Constellation) -> Option<f64> {
        let mut clocks: Vec<f64, S> = Vec::new();
        for link in self.links.iter().filter(|link| link.satellite.constellation() == constellation) {
            let _ = clocks.push(link.code[0].residual);
        }
        clocks.sort_unstable_by(f64::total_cmp);
        clocks.get(clocks.len() / 2).copied()
    }

    /// The answer from the updated density.
    fn conclude(&mut self, outcome: &mut PppSolution, wet: f64) {
        self.fold();
        self.epochs = self.epochs.saturating_add(1);
        let scale = match self.config.motion {
            Motion::Static => self.config.noise.scale(self.epochs, self.step),
            Motion::Kinematic => 1.0,
        };
        let states = &self.states;
        let estimate = |label| {
            let (value, variance) = states.marginal(label)?;
            Some(Estimate { value, sigma: libm::sqrt(scale * variance) })
        };
        let block = |first: usize| Matrix3::from_fn(|i, j| scale * states.density.covariance(first + i, first + j));
        let solution = &mut outcome.solution;
        solution.position = self.position;
        solution.position_covariance = block(0);
        let used =
            |link: &&Link, kind| link.readings(kind).iter().any(|reading| reading.variance > 0.0 && !reading.rejected);
        let of = |kind: Kind| -> SatelliteSet {
            self.links.iter().filter(|link| used(link, kind)).map(|link| link.satellite).collect()
        };
        let (codes, phases) = (of(Kind::Code), of(Kind::Phase));
        solution.satellites_used = codes;
        phases.iter().for_each(|satellite| {
            solution.satellites_used.insert(satellite);
        });
        solution.ambiguities = phases.len().min(255) as u8;
        if self.config.motion == Motion::Kinematic {
            let mean = states.density.mean();
            solution.velocity = Vector3::from_fn(|axis, _| mean.get(3 + axis).copied().unwrap_or(0.0));
            solution.velocity_covariance = block(3);
        }
        let trace = solution.position_covariance.trace();
        if trace.is_nan() || trace > LOST * LOST {
            solution.reason = Reason::TooFewSatellites;
            return;
        }
        (solution.quality, solution.reason) = match phases.len() {
            0..=3 => (Quality::Code, Reason::TooFewAmbiguities),
            _ => (Quality::Float, Reason::TooFewAmbiguities),
        };
        outcome.clock = estimate(Label::Clock);
        outcome.reference = self.reference;
        outcome.inter_system = Constellation::ALL.map(|constellation| estimate(Label::InterSystem(constellation)));
        outcome.zenith_estimated = estimate(Label::Zenith).map_or(0.0, |zenith| zenith.value);
        outcome.zenith_wet = estimate(Label::Zenith).map(|zenith| Estimate { value: zenith.value + wet, ..zenith });
        outcome.gradients = [0, 1].map(|axis| estimate(Label::Gradient(axis)));
    }
}
