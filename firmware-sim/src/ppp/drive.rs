//! One receiver under a made-up sky, and what precise point positioning makes of it: at rest and moving, with the ionosphere
//! combined away and estimated.
//!
//! GPS and Galileo fly circles. Observations are computed with the engine's own models of what is not estimated, all of
//! which are at work: antennas of both ends, code biases, attitude, tides of the solid Earth, the pole and the ocean. A
//! satellite in view hides for four epochs of 31 each; one slips, one has a wrong code, and once codes jump by a
//! millisecond. Noise comes from a linear congruential generator.
//!
//! This file needs nothing but the core and `random.rs`: the test that compares host and target includes both too.

use crate::random::Noise;
use core::f64::consts::TAU;
use heapless::Vec;
use nalgebra::Vector3;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::antenna::{AntennaBand, Calibration, Variations};
use surefix_core::gnss::attitude::Block;
use surefix_core::gnss::earth_rotation::EarthOrientation;
use surefix_core::gnss::epoch::{EpochView, Observation};
use surefix_core::gnss::geodesy::{EARTH_ROTATION_RATE, Geodetic};
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::tide::OceanLoading;
use surefix_core::gnss::time::GpsTime;
use surefix_core::model::combination::FrequencyPair;
use surefix_core::ppp::config::{Ionosphere, Motion};
use surefix_core::ppp::products::{Missing, PreciseState};
use surefix_core::ppp::select::{BandReading, PairReading};
use surefix_core::ppp::sight::{Sight, Station, sight};
use surefix_core::ppp::{PppConfig, PppFilter, PppSolution, Products};

/// Epochs of each kind of drive.
pub const EPOCHS: u32 = 40;
/// Seconds between them.
const STEP: f64 = 30.0;
/// Satellites of the filter.
const SATELLITES: usize = 16;
/// States of the filter: enough for a delay and two ambiguities of each satellite.
const STATES: usize = 63;
/// Satellites of each constellation.
const FLEET: u8 = 24;
/// Their signals.
const SIGNALS: [(Constellation, [Signal; 2]); 2] = [
    (Constellation::Gps, [signal(*b"1W"), signal(*b"2W")]),
    (Constellation::Galileo, [signal(*b"1C"), signal(*b"5Q")]),
];
/// Standard deviations of code and phase `[m]`.
const SIGMAS: [f64; 2] = [0.2, 0.002];
/// Receiver clock, and Galileo's bias to it `[m]`.
const CLOCKS: [f64; 2] = [1234.5, 17.0];
/// Zenith wet delay beyond the model `[m]`.
const ZENITH: f64 = 0.04;
/// Velocity of the receiver when it moves, ECEF `[m/s]`.
const VELOCITY: [f64; 3] = [3.0, -2.0, 1.5];
/// Antenna reference point from the marker: east, north, up `[m]`.
const ANTENNA: Vector3<f64> = Vector3::new(0.0, 0.0, 1.2);
/// Variations over nadir angle, as coarse as in ANTEX files of old `[m]`.
const NADIR: [f64; 4] = [-0.001, -0.002, 0.001, 0.005];
/// Variations over zenith angle `[m]`, and for azimuth 0, 180 and 360°.
const OVER_ZENITH: [f64; 4] = [0.0, -0.002, -0.003, 0.002];
const OVER_AZIMUTH: [f64; 12] = [0.0, -0.002, -0.002, 0.003, 0.0, -0.002, -0.004, 0.001, 0.0, -0.002, -0.002, 0.003];

const fn signal([band, attribute]: [u8; 2]) -> Signal {
    match Signal::new(band, attribute) {
        Some(signal) => signal,
        None => panic!("not a signal"),
    }
}

/// Which drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// How the receiver moves.
    pub motion: Motion,
    /// What is done about the ionosphere.
    pub ionosphere: Ionosphere,
}

impl Kind {
    /// All, in the order in which they are driven.
    pub const ALL: [Self; 4] = [
        Self { motion: Motion::Static, ionosphere: Ionosphere::Free },
        Self { motion: Motion::Kinematic, ionosphere: Ionosphere::Free },
        Self { motion: Motion::Static, ionosphere: Ionosphere::Estimated },
        Self { motion: Motion::Kinematic, ionosphere: Ionosphere::Estimated },
    ];

    /// What it is called.
    pub const fn name(self) -> &'static str {
        match (self.motion, self.ionosphere) {
            (Motion::Static, Ionosphere::Free) => "static, ionosphere-free",
            (Motion::Kinematic, Ionosphere::Free) => "kinematic, ionosphere-free",
            (Motion::Static, Ionosphere::Estimated) => "static, ionosphere estimated",
            (Motion::Kinematic, Ionosphere::Estimated) => "kinematic, ionosphere estimated",
        }
    }

    const fn config(self) -> PppConfig {
        PppConfig { motion: self.motion, ionosphere: self.ionosphere, ..PppConfig::DEFAULT }
    }

    /// Where the marker is at an epoch, ECEF `[m]`.
    pub fn place(self, epoch: u32) -> Vector3<f64> {
        let home = Geodetic { latitude: 0.83, longitude: 0.2, height: 300.0 }.to_ecef();
        match self.motion {
            Motion::Static => home,
            Motion::Kinematic => home + Vector3::from(VELOCITY) * (STEP * f64::from(epoch)),
        }
    }
}

/// The time of an epoch.
fn time(epoch: u32) -> GpsTime {
    GpsTime::from_week_tow(2111, 345_600.0 + STEP * f64::from(epoch))
}

/// Circular orbits and clocks that stand still, with all that belongs to them.
struct Sky {
    ocean: Option<OceanLoading>,
}

impl Sky {
    /// Knows all but the ocean.
    const NEW: Self = Self { ocean: None };

    /// Comes to know the ocean.
    fn load(&mut self) {
        let amplitudes = [0.006, 0.002, 0.0015].map(|m2| core::array::from_fn(|k| m2 / (k + 1) as f64));
        let phases = [0.7, 1.9, -2.2].map(|first| core::array::from_fn(|k| first + 0.3 * k as f64));
        self.ocean = Some(OceanLoading::new(&amplitudes, &phases));
    }
}

impl Products for Sky {
    fn state(&self, satellite: SatelliteId, time: GpsTime) -> Result<PreciseState, Missing> {
        let (radius, period, first) = match satellite.constellation() {
            Constellation::Gps => (26_560e3, 43_080.0, 0.0),
            Constellation::Galileo => (29_600e3, 50_700.0, 0.5),
            _ => return Err(Missing::Orbit),
        };
        let (plane, place) = ((satellite.number() - 1) % 6, (satellite.number() - 1) / 6);
        let rate = TAU / period;
        let t = time.since(GpsTime::from_week_tow(2111, 0.0));
        let node = 1.047 * f64::from(plane) + first - EARTH_ROTATION_RATE * t;
        let angle = 1.571 * f64::from(place) + 0.4 * f64::from(plane) + rate * t;
        let (sin_i, cos_i) = libm::sincos(0.96);
        let (sin_n, cos_n) = libm::sincos(node);
        let (sin, cos) = libm::sincos(angle);
        let across = Vector3::new(-cos_i * sin_n, cos_i * cos_n, sin_i);
        let along = Vector3::new(cos_n, sin_n, 0.0);
        let position = (along * cos + across * sin) * radius;
        let inertial = (across * cos - along * sin) * (radius * rate);
        let velocity = inertial + Vector3::new(position.y, -position.x, 0.0) * EARTH_ROTATION_RATE;
        let clock = 1e-5 * f64::from(satellite.number());
        Ok(PreciseState { position, velocity, clock, variance: 0.0, phase_centre: false })
    }

    fn block(&self, satellite: SatelliteId, _: GpsTime) -> Block {
        if satellite.constellation() == Constellation::Gps { Block::GpsIIR } else { Block::GalileoFoc }
    }

    fn satellite_antenna(&self, satellite: SatelliteId, _: GpsTime, signal: Signal) -> Option<Calibration<'_>> {
        let variations = Variations { first: 0.0, step: 5.0, mean: &NADIR, azimuth_step: 0.0, rows: &[] };
        let offset = [0.1, -0.02, if signal.band() == b'1' { 1.1 } else { 1.0 }];
        Some(Calibration { band: AntennaBand::of(satellite.constellation(), signal), offset, variations })
    }

    fn receiver_antenna(&self, constellation: Constellation, signal: Signal) -> Option<Calibration<'_>> {
        let variations =
            Variations { first: 0.0, step: 30.0, mean: &OVER_ZENITH, azimuth_step: 180.0, rows: &OVER_AZIMUTH };
        let offset = [0.001, -0.0005, if signal.band() == b'1' { 0.09 } else { 0.12 }];
        Some(Calibration { band: AntennaBand::of(constellation, signal), offset, variations })
    }

    fn code_bias(&self, satellite: SatelliteId, signal: Signal, _: GpsTime) -> Option<f64> {
        let known = satellite.constellation() == Constellation::Gps;
        known.then(|| 0.1 * f64::from(satellite.number() % 5) - 0.05 * f64::from(signal.band() - b'1'))
    }

    fn earth_orientation(&self, _: GpsTime) -> Option<EarthOrientation> {
        Some(EarthOrientation { xp: 8e-7, yp: 2.1e-6, ut1_minus_utc: -0.2 })
    }

    fn ocean_loading(&self, time: GpsTime) -> Option<Vector3<f64>> {
        self.ocean.as_ref().map(|ocean| ocean.displacement(time))
    }
}

/// A receiver's drive and the engine; for a `static`.
pub struct Drive {
    filter: PppFilter<SATELLITES, STATES>,
    sky: Sky,
    kind: Kind,
    noise: Noise,
    turns: [[Option<f64>; FLEET as usize]; 2],
    epoch: u32,
}

impl Drive {
    /// Before the start of the first kind.
    pub const fn new() -> Self {
        let [kind, ..] = Kind::ALL;
        Self {
            filter: PppFilter::new(kind.config()),
            sky: Sky::NEW,
            kind,
            noise: Noise::new(2111),
            turns: [[None; FLEET as usize]; 2],
            epoch: 0,
        }
    }

    /// Starts a drive.
    pub fn start(&mut self, kind: Kind) {
        self.sky.load();
        self.filter.reconfigure(kind.config());
        self.filter.set_antenna(ANTENNA);
        (self.kind, self.turns, self.epoch) = (kind, [[None; FLEET as usize]; 2], 0);
    }

    /// What the receiver measures in the next epoch.
    pub fn observe(&mut self) -> Vec<Observation, { 2 * SATELLITES }> {
        let (epoch, kind, mut all) = (self.epoch, self.kind, Vec::new());
        let station = Station::new(time(epoch), &kind.place(epoch), &ANTENNA, &self.sky, &kind.config());
        for ((constellation, signals), turns) in SIGNALS.into_iter().zip(&mut self.turns) {
            let galileo = constellation == Constellation::Galileo;
            for (number, turns) in (1..=FLEET).zip(turns) {
                let Some(satellite) = SatelliteId::new(constellation, number) else { continue };
                let hidden = (epoch + 7 * u32::from(number)) % 31 < 4;
                // A clock that jumps shows in codes and in when signals were sent; these receivers leave phases alone.
                let jump = if epoch >= EPOCHS / 2 { 1e-3 * SPEED_OF_LIGHT } else { 0.0 };
                let clock = CLOCKS[0] + if galileo { CLOCKS[1] } else { 0.0 } + jump;
                let Some((code, seen)) = range(satellite, signals, &station, *turns, clock, &self.sky, &kind.config())
                else {
                    continue;
                };
                *turns = Some(seen.wind_up);
                // A thin shell at 450 km over 3 m at the zenith.
                let inside = 6371.0 / (6371.0 + 450.0) * libm::cos(seen.look.elevation);
                let delay = 3.0 / libm::sqrt(1.0 - inside * inside);
                for (band, signal) in signals.into_iter().enumerate() {
                    let frequency = |band: Signal| band.frequency(constellation, None).unwrap_or(1.0);
                    let (wavelength, ratio) =
                        (SPEED_OF_LIGHT / frequency(signal), frequency(signals[0]) / frequency(signal));
                    let noise = SIGMAS.map(|sigma| sigma * self.noise.normal());
                    let bias = self.sky.code_bias(satellite, signal, station.time).unwrap_or(0.0);
                    let reach = code + seen.antennas[band % 2];
                    let wrong = if epoch == 25 && number % 12 == 3 { 30.0 } else { 0.0 };
                    let slip = if epoch >= 30 && number % 12 == 3 && band == 0 { 5.0 } else { 0.0 };
                    let mut observation = Observation::new(satellite, signal);
                    observation.code = Some(reach + delay * ratio * ratio + bias + wrong + noise[0]);
                    let phase = reach - jump - delay * ratio * ratio + noise[1];
                    let cycles = 1000.0 * f64::from(number) + band as f64 + slip;
                    observation.phase = Some(phase / wavelength + seen.wind_up + cycles);
                    if !hidden {
                        let _ = all.push(observation);
                    }
                }
            }
        }
        all
    }

    /// The engine's epoch.
    pub fn advance(&mut self, observations: &[Observation]) -> PppSolution {
        let epoch = EpochView { time: time(self.epoch), observations };
        self.epoch += 1;
        self.filter.push(epoch, &self.sky)
    }

    /// How far an answer to the latest epoch is from the truth `[m]`.
    pub fn error(&self, answer: &PppSolution) -> f64 {
        (answer.solution.position - self.kind.place(self.epoch.saturating_sub(1))).norm()
    }
}

impl Default for Drive {
    fn default() -> Self {
        Self::new()
    }
}

/// The pseudorange of a satellite without antennas, noise and the ionosphere `[m]`, and how it is seen; `None` below the horizon.
fn range(
    satellite: SatelliteId,
    signals: [Signal; 2],
    station: &Station,
    turns: Option<f64>,
    clock: f64,
    sky: &Sky,
    config: &PppConfig,
) -> Option<(f64, Sight)> {
    let constellation = satellite.constellation();
    let [first, second] = signals.map(|signal| signal.frequency(constellation, None).unwrap_or(1.0));
    let pair = FrequencyPair::new(first, second)?;
    let mut code = 2.3e7;
    let mut seen = None;
    // When the signal was sent follows from the pseudorange.
    for _ in 0..4 {
        let band = |signal, frequency| BandReading {
            code_signal: signal,
            phase_signal: signal,
            frequency,
            code,
            phase: 0.0,
            loss_of_lock: false,
            cn0: None,
        };
        let [one, two] = signals;
        let reading = PairReading { satellite, bands: [band(one, first), band(two, second)], pair };
        let now = sight(station, &reading, turns, sky, config).ok()??;
        code = now.range + now.common + now.wet * ZENITH + clock;
        seen = Some(now);
    }
    Some((code, seen?))
}

/// Gives `sink` an answer as bytes: position, velocity, their covariances, clock, zenith delay, numbers of satellites used,
/// rejected and slipped, as `f64`, little endian.
pub fn write<E>(answer: &PppSolution, mut sink: impl FnMut(&[u8]) -> Result<(), E>) -> Result<(), E> {
    let solution = &answer.solution;
    let vectors = solution.position.iter().chain(&solution.velocity);
    let covariances = solution.position_covariance.iter().chain(&solution.velocity_covariance);
    let estimates = [answer.clock, answer.zenith_wet, answer.inter_system[1]].map(Option::unwrap_or_default);
    let sets = [solution.satellites_used, solution.satellites_rejected, solution.satellites_slipped];
    let mut all = vectors
        .chain(covariances)
        .copied()
        .chain(estimates.into_iter().flat_map(|estimate| [estimate.value, estimate.sigma]))
        .chain(sets.into_iter().map(|set| set.len() as f64))
        .chain([f64::from(answer.overflow), answer.clock_jump]);
    all.try_for_each(|number| sink(&number.to_le_bytes()))
}
