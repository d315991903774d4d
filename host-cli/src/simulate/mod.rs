//! Simulation of a rover and a base: observations, ephemerides, and the truth about them.
//!
//! [`simulate`] turns a [`Scenario`] into a [`Simulation`] in memory; [`files`] writes it. Observables are exact physics
//! ([`range`]) plus errors of stated size ([`errors`], [`tracking`]), rounded to thousandths as RINEX has them. Every
//! signal of every satellite at every receiver draws from its own stream of random numbers, all from one seed: the
//! same scenario gives the same bytes, and adding a satellite changes no other.

pub mod errors;
pub mod files;
pub mod motion;
pub mod range;
pub mod scenario;
pub mod sky;
pub mod tracking;

use crate::process::stream::OwnedEpoch;
use errors::Errors;
use motion::Path;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use range::{Antenna, Link};
use scenario::{Receiver, Scenario, ScenarioError};
use sky::{F_L1, Satellite};
use std::collections::BTreeMap;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::epoch::Observation;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;
use tracking::{AmbiguityChange, Tracker};

pub use sky::KLOBUCHAR;

/// The truth at a rover epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// What the rover's clock reads, as its epochs and solutions say (GPST).
    pub time: GpsTime,
    /// Where the rover's antenna is at the instant of that measurement, ECEF `[m]`.
    pub position: Vector3<f64>,
    /// Its velocity, ECEF `[m/s]`.
    pub velocity: Vector3<f64>,
    /// How far the rover's clock is ahead of GPST `[s]`.
    pub clock: f64,
}

/// What a scenario comes to.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// What the rover recorded.
    pub rover: Vec<OwnedEpoch>,
    /// What the base recorded.
    pub base: Vec<OwnedEpoch>,
    /// Base position, ECEF `[m]`.
    pub base_position: Vector3<f64>,
    /// What the satellites broadcast, in order of reference time.
    pub ephemerides: Vec<Ephemeris>,
    /// The truth, of all rover epochs, also of those without observations.
    pub truth: Vec<Truth>,
    /// Changes of the rover's ambiguities, in order of time.
    pub rover_changes: Vec<AmbiguityChange>,
    /// Changes of the base's ambiguities, in order of time.
    pub base_changes: Vec<AmbiguityChange>,
}

/// Runs a scenario.
pub fn simulate(scenario: &Scenario) -> Result<Simulation, ScenarioError> {
    scenario.validate()?;
    let satellites = sky::satellites(scenario)?;
    let rover_path = Path::new(&scenario.rover.motion, scenario.rover.start_enu_m.into(), scenario.duration_s);
    let base_path = Path::Rest(Vector3::zeros());
    let wet_bias = scenario.troposphere.rover_wet_bias_m;
    let rover = Antenna { scenario, path: &rover_path, receiver: &scenario.rover.receiver, wet_bias };
    let base = Antenna { scenario, path: &base_path, receiver: &scenario.base.receiver, wet_bias: 0.0 };

    let (rover_epochs, rover_changes) = record(&rover, &satellites, 0);
    let (base_epochs, base_changes) = record(&base, &satellites, 1);
    let mut ephemerides: Vec<Ephemeris> = satellites.iter().flat_map(|s| s.ephemerides.iter().copied()).collect();
    ephemerides.sort_by_key(|ephemeris| (ephemeris.toe(), ephemeris.satellite()));
    let truth = |time| {
        let state = rover.state(time);
        Truth { time, position: state.position, velocity: state.velocity, clock: rover.clock_offset(time) }
    };
    Ok(Simulation {
        base_position: scenario.base_position(),
        truth: tags(scenario, &scenario.rover.receiver).map(truth).collect(),
        rover: rover_epochs,
        base: base_epochs,
        ephemerides,
        rover_changes,
        base_changes,
    })
}

/// Times of a receiver's epochs.
fn tags(scenario: &Scenario, receiver: &Receiver) -> impl Iterator<Item = GpsTime> + use<> {
    let (start, interval) = (scenario.start(), receiver.interval_s);
    let last = (scenario.duration_s / interval + 1e-9).floor() as u32;
    (0..=last).map(move |k| start.plus_seconds(f64::from(k) * interval))
}

/// What a receiver does with one signal of one satellite.
struct Channel {
    errors: Errors,
    tracker: Tracker,
}

/// All epochs of a receiver, and the changes of its ambiguities. `station` tells the receivers' random numbers apart.
fn record(antenna: &Antenna<'_>, satellites: &[Satellite], station: u64) -> (Vec<OwnedEpoch>, Vec<AmbiguityChange>) {
    let (scenario, receiver) = (antenna.scenario, antenna.receiver);
    let mask = scenario.elevation_mask_deg.to_radians();
    let mut channels: BTreeMap<(SatelliteId, Signal), Channel> = satellites
        .iter()
        .flat_map(|satellite| satellite.signals.iter().map(|&signal| (satellite.id, signal)))
        .map(|(id, signal)| ((id, signal), Channel::new(scenario.seed, station, id, signal)))
        .collect();
    let (mut epochs, mut changes) = (Vec::new(), Vec::new());
    for time in tags(scenario, receiver) {
        let seconds = time.since(scenario.start());
        let mut observations = Vec::new();
        for satellite in satellites {
            let link = antenna.link(satellite, time).filter(|link| {
                let blocked = receiver.outages.iter().any(|outage| outage.blocks(seconds, link.elevation));
                link.elevation >= mask && !blocked
            });
            for &signal in &satellite.signals {
                let Some(channel) = channels.get_mut(&(satellite.id, signal)) else { continue };
                match &link {
                    Some(link) => {
                        observations.extend(channel.observe(time, satellite, signal, link, receiver, &mut changes));
                    }
                    None => channel.tracker.lose(),
                }
            }
        }
        if !observations.is_empty() {
            epochs.push(OwnedEpoch { time, observations });
        }
    }
    (epochs, changes)
}

impl Channel {
    fn new(seed: u64, station: u64, satellite: SatelliteId, signal: Signal) -> Self {
        let stream = |purpose: u64| {
            let satellite = (satellite.constellation().index() as u64) << 8 | u64::from(satellite.number());
            let signal = u64::from(signal.band()) << 8 | u64::from(signal.attribute());
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            // Streams below 2^16 are the satellites'.
            rng.set_stream((1 + purpose) << 48 | station << 40 | satellite << 16 | signal);
            rng
        };
        Self { errors: Errors::new(stream(0)), tracker: Tracker::new(satellite, signal, stream(1)) }
    }

    fn observe(
        &mut self,
        time: GpsTime,
        satellite: &Satellite,
        signal: Signal,
        link: &Link,
        receiver: &Receiver,
        changes: &mut Vec<AmbiguityChange>,
    ) -> Option<Observation> {
        let frequency = signal.frequency(satellite.id.constellation(), None)?;
        let wavelength = SPEED_OF_LIGHT / frequency;
        let gamma = (F_L1 / frequency).powi(2);
        let group_delay = SPEED_OF_LIGHT * satellite.group_delay(signal, time)?;
        let error = self.errors.next(time, link.elevation, &receiver.noise, &receiver.multipath);
        let tracked = self.tracker.track(time, &receiver.slips, changes);

        let code = link.nondispersive + gamma * link.ionosphere + group_delay + error.code;
        let phase = (link.nondispersive - gamma * link.ionosphere + error.phase) / wavelength + tracked.cycles;
        let rate = link.nondispersive_rate - gamma * link.ionosphere_rate + error.rate;
        Some(Observation {
            code: Some(thousandths(code)),
            phase: Some(thousandths(phase)),
            doppler: Some(thousandths(-rate / wavelength)),
            cn0: Some(thousandths(error.cn0.max(0.0)) as f32),
            loss_of_lock: tracked.loss_of_lock,
            half_cycle: tracked.half_cycle,
            ..Observation::new(satellite.id, signal)
        })
    }
}

/// Rounded to three decimals, as files have them.
pub(crate) fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::scenario::{MotionKind, Multipath, Noise, Outage};
    use super::*;
    use surefix_core::gnss::geodesy::line_of_sight;
    use surefix_core::gnss::orbit::store::{EphemerisStore, SelectionRule};

    /// The default drive without any error, atmosphere or outage.
    fn perfect() -> Scenario {
        let mut scenario = Scenario { duration_s: 120.0, ..Scenario::default() };
        scenario.satellites.orbit_sigma_m = 0.0;
        scenario.satellites.clock_sigma_m = 0.0;
        scenario.satellites.galileo = ["1C", "5Q", "7Q"].map(String::from).to_vec();
        scenario.satellites.gps = ["1C", "2W"].map(String::from).to_vec();
        scenario.ionosphere.scale = 0.0;
        scenario.ionosphere.gradient_mm_km = [0.0; 2];
        scenario.troposphere.scale = 0.0;
        for receiver in [&mut scenario.base.receiver, &mut scenario.rover.receiver] {
            let silent = Noise { code_m: 0.0, phase_m: 0.0, doppler_m_s: 0.0, cn0_sigma: 0.0, ..receiver.noise };
            receiver.noise = silent;
            receiver.multipath = Multipath { code_m: 0.0, phase_m: 0.0, time_s: 1.0 };
            receiver.slips.per_hour = 0.0;
            receiver.inter_system_bias_m = 0.0;
            receiver.outages.clear();
        }
        scenario
    }

    /// Code and phase `[m]` of an observation minus the model that a positioning engine uses: the core's ephemeris
    /// selection, transmission time from the pseudorange itself, clock, group delay, at the true position and clock.
    fn residuals(simulation: &Simulation, truth: &Truth, observation: &Observation) -> (f64, f64) {
        let mut store: EphemerisStore<256> = EphemerisStore::new();
        for &ephemeris in &simulation.ephemerides {
            store.insert(ephemeris);
        }
        let ephemeris = store.select(observation.satellite, truth.time, &SelectionRule::SAFE).unwrap();
        let state = ephemeris.state_at_transmission(truth.time, observation.code.unwrap()).unwrap();
        let range = line_of_sight(&truth.position, &state.position).range;
        let common = range + SPEED_OF_LIGHT * (truth.clock - state.clock);
        let wavelength = observation.signal.wavelength(observation.satellite.constellation(), None).unwrap();
        let group_delay = SPEED_OF_LIGHT * ephemeris.group_delay(observation.signal).unwrap();
        (observation.code.unwrap() - common - group_delay, wavelength * observation.phase.unwrap() - common)
    }

    #[test]
    fn without_errors_observations_are_the_cores_model_to_a_millimetre() {
        for jumps in [false, true] {
            let mut scenario = perfect();
            let clock = &mut scenario.rover.receiver.clock;
            (clock.drift, clock.offset_s, clock.millisecond_jumps) = (1e-5, 4e-4, jumps); // 1.6 ms at the end
            let simulation = simulate(&scenario).unwrap();
            assert_eq!((simulation.rover.len(), simulation.truth.len()), (121, 121));
            assert_eq!(simulation.truth.iter().any(|truth| truth.clock.abs() > 5.1e-4), !jumps);
            let mut ambiguities: BTreeMap<(SatelliteId, Signal), f64> = BTreeMap::new();
            for (epoch, truth) in simulation.rover.iter().zip(&simulation.truth) {
                assert_eq!(epoch.time, truth.time);
                for observation in &epoch.observations {
                    let (code, phase) = residuals(&simulation, truth, observation);
                    // Half of a thousandth by rounding, and 0.1 mm of the model's clock (see state_at_transmission).
                    assert!(code.abs() < 0.8e-3, "{observation:?}: {code}");
                    let key = (observation.satellite, observation.signal);
                    let wavelength = observation.signal.wavelength(key.0.constellation(), None).unwrap();
                    let cycles = phase / wavelength;
                    let ambiguity = ambiguities.entry(key).or_insert(cycles.round());
                    assert!((cycles - *ambiguity).abs() * wavelength < 0.3e-3, "{observation:?}: {cycles}");
                }
            }
            assert!(ambiguities.len() > 30);
        }
    }

    #[test]
    fn noise_of_the_configured_size_is_all_that_is_added() {
        let mut scenario = perfect();
        scenario.duration_s = 300.0;
        let noise = &mut scenario.rover.receiver.noise;
        (noise.code_m, noise.phase_m) = (0.3, 0.003);
        let noise = *noise;
        let simulation = simulate(&scenario).unwrap();
        let mut ambiguities: BTreeMap<(SatelliteId, Signal), f64> = BTreeMap::new();
        let (mut code_squares, mut phase_squares, mut count) = (0.0, 0.0, 0.0);
        for (epoch, truth) in simulation.rover.iter().zip(&simulation.truth) {
            for observation in &epoch.observations {
                let (code, phase) = residuals(&simulation, truth, observation);
                let key = (observation.satellite, observation.signal);
                let wavelength = observation.signal.wavelength(key.0.constellation(), None).unwrap();
                let ambiguity = *ambiguities.entry(key).or_insert((phase / wavelength).round());
                // C/N0 is noiseless here: it tells how much weaker than at the zenith the signal is.
                let weakness = 10_f64.powf((noise.cn0_zenith - f64::from(observation.cn0.unwrap())) / 20.0);
                code_squares += (code / (weakness * noise.code_m)).powi(2);
                phase_squares += ((phase - wavelength * ambiguity) / (weakness * noise.phase_m)).powi(2);
                count += 1.0;
            }
        }
        // 11 000 samples give the mean square to 1.4 % (1σ).
        assert!(count > 10_000.0, "{count}");
        for square in [code_squares / count, phase_squares / count] {
            assert!((square - 1.0).abs() < 0.05, "{square}");
        }
    }

    #[test]
    fn doppler_is_the_rate_of_phase() {
        let mut scenario = perfect();
        scenario.rover.receiver.interval_s = 0.05;
        scenario.duration_s = 40.0;
        let simulation = simulate(&scenario).unwrap();
        for window in simulation.rover.windows(3) {
            for observation in &window[1].observations {
                let find = |epoch: &OwnedEpoch| {
                    let same =
                        |o: &&Observation| (o.satellite, o.signal) == (observation.satellite, observation.signal);
                    epoch.observations.iter().find(same).and_then(|o| o.phase)
                };
                let Some((before, after)) = find(&window[0]).zip(find(&window[2])) else { continue };
                let rate = (after - before) / 0.1;
                // Rounding: twice half a thousandth of a cycle over 0.1 s, and half a thousandth of a Hertz.
                assert!((observation.doppler.unwrap() + rate).abs() < 0.011, "{observation:?}, {rate}");
            }
        }
    }

    #[test]
    fn the_atmosphere_has_its_signs() {
        let mut scenario = perfect();
        scenario.duration_s = 1.0;
        scenario.ionosphere.scale = 2.0;
        scenario.troposphere.scale = 1.0;
        let simulation = simulate(&scenario).unwrap();
        let plain = simulate(&Scenario { duration_s: 1.0, ..perfect() }).unwrap();
        for (with, without) in simulation.rover[0].observations.iter().zip(&plain.rover[0].observations) {
            let wavelength = with.signal.wavelength(with.satellite.constellation(), None).unwrap();
            let code = with.code.unwrap() - without.code.unwrap();
            let phase = wavelength * (with.phase.unwrap() - without.phase.unwrap());
            let (troposphere, ionosphere) = ((code + phase) / 2.0, (code - phase) / 2.0);
            // Zenith 2.2 m at 650 m height, times up to 5.6 at 10°; twice Klobuchar's 1.5 m or more, obliquity 1…3.
            assert!((2.1..12.5).contains(&troposphere), "{troposphere}");
            assert!((3.0..60.0).contains(&ionosphere), "{ionosphere}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_observations_and_another_does_not() {
        let run = |seed| simulate(&Scenario { seed, duration_s: 60.0, ..Scenario::default() }).unwrap();
        let (first, again, other) = (run(1), run(1), run(2));
        assert_eq!((&first.rover, &first.base, &first.ephemerides), (&again.rover, &again.base, &again.ephemerides));
        assert_ne!(first.rover, other.rover);
    }

    #[test]
    fn outages_take_satellites_away_and_slips_are_listed() {
        let mut scenario = Scenario { duration_s: 60.0, ..Scenario::default() };
        scenario.rover.motion.kind = MotionKind::Static;
        scenario.rover.receiver.slips.per_hour = 0.0;
        scenario.rover.receiver.outages = vec![
            Outage { start_s: 10.0, duration_s: 5.0, below_deg: None },
            Outage { start_s: 30.0, duration_s: 5.0, below_deg: Some(40.0) },
        ];
        let simulation = simulate(&scenario).unwrap();
        assert_eq!((simulation.truth.len(), simulation.rover.len()), (61, 56));
        let at = |seconds: f64| {
            let time = scenario.start().plus_seconds(seconds);
            simulation.rover.iter().find(|epoch| epoch.time == time).unwrap()
        };
        assert!(at(32.0).observations.len() < at(29.0).observations.len());
        assert!(at(15.0).observations.iter().all(|observation| observation.loss_of_lock));
        assert!(at(16.0).observations.iter().all(|observation| !observation.loss_of_lock));
        assert!(simulation.rover_changes.iter().all(|change| change.change == tracking::Change::Reacquired));
        assert_eq!(simulation.base.len(), 61);
    }
}
