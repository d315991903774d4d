//! The engine under a made-up sky whose truth is known.
//!
//! Satellites fly circles; observations are computed with the engine's own models of what is not estimated (they have tests
//! of their own against other programs) and with made-up values of what is.

use super::config::{Ionosphere, Motion, PppConfig};
use super::products::{Missing, PreciseState, Products};
use super::select::PairReading;
use super::sight::{Station, sight};
use super::track::ArcEnd;
use super::{PppFilter, PppSolution};
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::antenna::Calibration;
use crate::gnss::attitude::Block;
use crate::gnss::earth_rotation::EarthOrientation;
use crate::gnss::epoch::{EpochView, Observation};
use crate::gnss::geodesy::{EARTH_ROTATION_RATE, Geodetic};
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::gnss::solution::{Quality, Reason};
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;
use proptest::prelude::*;
use std::cell::RefCell;
use std::collections::BTreeMap;

/// Circular orbits: 24 GPS and 24 Galileo satellites, clocks constant.
struct Sky;

impl Products for Sky {
    fn state(&self, satellite: SatelliteId, time: GpsTime) -> Result<PreciseState, Missing> {
        let galileo = match satellite.constellation() {
            Constellation::Gps => false,
            Constellation::Galileo => true,
            _ => return Err(Missing::Orbit),
        };
        if satellite.number() > 24 {
            return Err(Missing::Clock);
        }
        let n = f64::from(satellite.number() - 1);
        let (radius, period) = if galileo { (29_600e3, 50_700.0) } else { (26_560e3, 43_080.0) };
        let rate = std::f64::consts::TAU / period;
        let t = time.since(GpsTime::from_week_tow(2111, 0.0));
        let node = (n % 6.0) * 1.047 + if galileo { 0.5 } else { 0.0 } - EARTH_ROTATION_RATE * t;
        let angle = (n / 6.0).floor() * 1.571 + (n % 6.0) * 0.4 + rate * t;
        let place = |angle: f64, node: f64| {
            let (s, c) = angle.sin_cos();
            let (si, ci) = 0.96f64.sin_cos();
            let (sn, cn) = node.sin_cos();
            Vector3::new(c * cn - s * ci * sn, c * sn + s * ci * cn, s * si) * radius
        };
        let position = place(angle, node);
        let velocity = (place(angle + rate, node - EARTH_ROTATION_RATE) - position) / 1.0;
        Ok(PreciseState { position, velocity, clock: 1e-5 * n, variance: 0.0, phase_centre: false })
    }
    fn block(&self, _: SatelliteId, _: GpsTime) -> Block {
        Block::from_antex("BLOCK IIR-M")
    }
    fn satellite_antenna(&self, _: SatelliteId, _: GpsTime, _: Signal) -> Option<Calibration<'_>> {
        None
    }
    fn receiver_antenna(&self, _: Constellation, _: Signal) -> Option<Calibration<'_>> {
        None
    }
    fn code_bias(&self, _: SatelliteId, _: Signal, _: GpsTime) -> Option<f64> {
        None
    }
    fn earth_orientation(&self, _: GpsTime) -> Option<EarthOrientation> {
        None
    }
    fn ocean_loading(&self, _: GpsTime) -> Option<Vector3<f64>> {
        None
    }
}

/// The truth that observations are made of.
#[derive(Clone, Copy)]
struct Truth {
    clock: f64,
    inter_system: f64,
    zenith: f64,
    noise: f64,
    /// Part of the clock that codes show and phases do not `[m]`.
    code_jump: f64,
}

const TRUTH: Truth = Truth { clock: 1234.5, inter_system: 17.0, zenith: 0.04, noise: 1.0, code_jump: 0.0 };

fn home() -> Vector3<f64> {
    Geodetic { latitude: 0.83, longitude: 0.2, height: 300.0 }.to_ecef()
}

fn at(seconds: f64) -> GpsTime {
    GpsTime::from_week_tow(2111, 345_600.0 + seconds)
}

/// A number in −1…1 from an epoch and a place in it, the same in every run.
fn jitter(seed: u64) -> f64 {
    let x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (seed >> 7).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 31)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 29)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// What a receiver at `position` measures.
fn observe(time: GpsTime, position: &Vector3<f64>, truth: Truth, config: &PppConfig) -> Vec<Observation> {
    thread_local!(static TURNS: RefCell<BTreeMap<SatelliteId, f64>> = const { RefCell::new(BTreeMap::new()) });
    let turns = |satellite| TURNS.with_borrow(|turns| turns.get(&satellite).copied());
    let station = Station::new(time, position, &Vector3::zeros(), &Sky, config);
    let mut all = Vec::new();
    for (constellation, names) in [(Constellation::Gps, ["1W", "2W"]), (Constellation::Galileo, ["1C", "5Q"])] {
        for number in 1..=24 {
            let satellite = SatelliteId::new(constellation, number).unwrap();
            let signals = names.map(|name| name.parse::<Signal>().unwrap());
            let frequencies = signals.map(|signal| signal.frequency(constellation, None).unwrap());
            let bias = if constellation == Constellation::Gps { 0.0 } else { truth.inter_system };
            let mut code = 2.3e7;
            let mut seen = None;
            for _ in 0..6 {
                let reading = reading(satellite, signals, frequencies, [code; 2]);
                seen = sight(&station, &reading, turns(satellite), &Sky, config).unwrap();
                let Some(seen) = &seen else { break };
                code = seen.range + seen.common + seen.wet * truth.zenith + truth.clock + truth.code_jump + bias;
            }
            let Some(seen) = seen else { continue };
            TURNS.with_borrow_mut(|turns| turns.insert(satellite, seen.wind_up));
            let seed =
                (time.nanoseconds() / 1_000_000) as u64 ^ (u64::from(number) << 40) ^ ((bias != 0.0) as u64) << 50;
            for (i, signal) in signals.into_iter().enumerate() {
                let lambda = SPEED_OF_LIGHT / frequencies[i];
                // A thin shell at 450 km over 3 m at the zenith.
                let inside = 6371.0 / (6371.0 + 450.0) * seen.look.elevation.cos();
                let delay = 3.0 / (1.0 - inside * inside).sqrt() * (frequencies[0] / frequencies[i]).powi(2);
                let mut observation = Observation::new(satellite, signal);
                observation.code = Some(code + delay + truth.noise * 0.5 * jitter(seed ^ i as u64));
                let phase = code - truth.code_jump - delay + truth.noise * 0.004 * jitter(seed ^ (2 + i as u64));
                observation.phase = Some(phase / lambda + seen.wind_up + 1000.0 * f64::from(number) + i as f64);
                all.push(observation);
            }
        }
    }
    all
}

fn reading(satellite: SatelliteId, signals: [Signal; 2], frequencies: [f64; 2], codes: [f64; 2]) -> PairReading {
    let band = |i: usize| super::select::BandReading {
        code_signal: signals[i],
        phase_signal: signals[i],
        frequency: frequencies[i],
        code: codes[i],
        phase: 0.0,
        loss_of_lock: false,
        cn0: None,
    };
    let pair = crate::model::combination::FrequencyPair::new(frequencies[0], frequencies[1]).unwrap();
    PairReading { satellite, bands: [band(0), band(1)], pair }
}

type Engine = PppFilter<32, 111>;

fn engine(config: PppConfig) -> Box<Engine> {
    Box::new(PppFilter::new(config))
}

/// Runs `epochs` epochs 30 s apart; `change` may spoil the observations.
fn run(
    engine: &mut Engine,
    epochs: std::ops::Range<u32>,
    place: impl Fn(f64) -> Vector3<f64>,
    truth: Truth,
    change: impl Fn(u32, &mut Vec<Observation>),
) -> Vec<PppSolution> {
    let config = *engine.config();
    let step = |k: u32| {
        let seconds = 30.0 * f64::from(k);
        let mut observations = observe(at(seconds), &place(seconds), truth, &config);
        change(k, &mut observations);
        engine.push(EpochView { time: at(seconds), observations: &observations }, &Sky)
    };
    epochs.map(step).collect()
}

fn nothing(_: u32, _: &mut Vec<Observation>) {}

#[test]
fn a_receiver_at_rest_is_found_to_centimetres_with_its_clock_bias_and_zenith_delay() {
    for ionosphere in [Ionosphere::Free, Ionosphere::Estimated] {
        let mut engine = engine(PppConfig { ionosphere, ..PppConfig::DEFAULT });
        let last = *run(&mut engine, 0..240, |_| home(), TRUTH, nothing).last().unwrap();
        let error = (last.solution.position - home()).norm();
        assert_eq!(last.solution.quality, Quality::Float);
        assert!(error < 0.02, "{ionosphere:?}: {error}");
        let close = |estimate: Option<super::Estimate>, truth: f64, sigmas: f64, floor: f64| {
            let estimate = estimate.unwrap();
            assert!(
                (estimate.value - truth).abs() < sigmas * estimate.sigma + floor,
                "{ionosphere:?} {estimate:?} {truth}"
            );
        };
        // Codes are uniform within ± 0.5 m: the clock is theirs.
        close(last.clock, TRUTH.clock, 4.0, 0.05);
        close(last.inter_system[1], TRUTH.inter_system, 4.0, 0.05);
        let wet = engine.station().unwrap().troposphere.zenith.wet;
        close(last.zenith_wet, TRUTH.zenith + wet, 4.0, 0.005);
        let expected = last.zenith_hydrostatic + last.zenith_wet.unwrap().value;
        assert_eq!(last.zenith_total(), Some(expected));
    }
}

/// Delays that walk as far as their process noise says are no slips. (They were screened as if they stood still.)
#[test]
fn a_lively_ionosphere_ends_no_arcs() {
    let mut engine = engine(PppConfig { ionosphere: Ionosphere::Estimated, ..PppConfig::DEFAULT });
    let ripple = |k: u32, observations: &mut Vec<Observation>| {
        for observation in observations {
            let (constellation, number) = (observation.satellite.constellation(), observation.satellite.number());
            let frequency = observation.signal.frequency(constellation, None).unwrap();
            // Up to 4.7 cm from epoch to epoch on the first band; its walk is 11 cm (1 σ).
            let turns = f64::from(k) / 20.0 + f64::from(number) * 0.13;
            let delay = 0.15 * (std::f64::consts::TAU * turns).sin() * (1_575.42e6 / frequency).powi(2);
            observation.code = observation.code.map(|code| code + delay);
            observation.phase = observation.phase.map(|phase| phase - delay * frequency / SPEED_OF_LIGHT);
        }
    };
    let mut last = None;
    for k in 0..120 {
        last = run(&mut engine, k..k + 1, |_| home(), TRUTH, ripple).pop();
        assert!(engine.ended().is_empty(), "epoch {k}: {:?}", engine.ended());
    }
    assert!((last.unwrap().solution.position - home()).norm() < 0.05);
}

/// Without noise nothing is left of any residual: rows, births and offsets fit together.
#[test]
fn without_noise_residuals_vanish() {
    let mut engine = engine(PppConfig::DEFAULT);
    let truth = Truth { noise: 0.0, ..TRUTH };
    let last = *run(&mut engine, 0..120, |_| home(), truth, nothing).last().unwrap();
    assert!((last.solution.position - home()).norm() < 2e-3);
    for link in engine.links() {
        let of_sigma = |reading: super::link::Reading| reading.postfit.abs() / reading.variance.sqrt();
        assert!(of_sigma(link.phase[0]) < 0.01 && of_sigma(link.code[0]) < 0.01, "{link:?}");
    }
}

#[test]
fn a_moving_receiver_is_followed_with_its_velocity() {
    let velocity = Vector3::new(3.0, -2.0, 1.5);
    let mut engine = engine(PppConfig { motion: Motion::Kinematic, ..PppConfig::DEFAULT });
    let place = |seconds: f64| home() + velocity * seconds;
    let last = *run(&mut engine, 0..240, place, TRUTH, nothing).last().unwrap();
    let error = last.solution.position - place(239.0 * 30.0);
    assert!(error.norm() < 0.06, "{error}");
    assert!((last.solution.velocity - velocity).norm() < 0.5, "{}", last.solution.velocity);
}

#[test]
fn an_approximate_position_replaces_the_single_point_and_may_be_100_m_off() {
    let mut engine = engine(PppConfig::DEFAULT);
    engine.set_approximate(Some(home() + Vector3::new(60.0, -60.0, 50.0)));
    let last = *run(&mut engine, 0..240, |_| home(), TRUTH, nothing).last().unwrap();
    assert!((last.solution.position - home()).norm() < 0.03, "{}", last.solution.position - home());
}

#[test]
fn slips_are_survived_and_named() {
    let slips = |k: u32, observations: &mut Vec<Observation>| {
        for observation in observations.iter_mut() {
            let first = observation.signal.band() == b'1';
            // G-satellites with an even number slip at epoch 130 on the first band by 5 cycles.
            let even = observation.satellite.number() % 2 == 0;
            if k >= 130 && even && first && observation.satellite.constellation() == Constellation::Gps {
                observation.phase = observation.phase.map(|phase| phase + 5.0);
            }
        }
    };
    let mut engine = engine(PppConfig::DEFAULT);
    let solutions = run(&mut engine, 0..240, |_| home(), TRUTH, slips);
    assert!(solutions[130].solution.satellites_slipped.len() >= 2);
    assert!(solutions[131..].iter().all(|solution| solution.solution.satellites_slipped.is_empty()));
    let worst = solutions[130..].iter().map(|s| (s.solution.position - home()).norm()).fold(0.0, f64::max);
    assert!(worst < 0.05, "{worst}");
}

/// 9 and 7 cycles: 3 mm of the geometry-free phase, 1.7 m of the combination; the wide lane and the innovations see it.
#[test]
fn a_slip_that_the_geometry_free_phase_cannot_see_is_found() {
    let slip = |k: u32, observations: &mut Vec<Observation>| {
        let victim = observations.iter().find(|o| o.satellite.constellation() == Constellation::Gps).unwrap().satellite;
        for observation in observations.iter_mut().filter(|o| k >= 150 && o.satellite == victim) {
            let cycles = if observation.signal.band() == b'1' { 9.0 } else { 7.0 };
            observation.phase = observation.phase.map(|phase| phase + cycles);
        }
    };
    let mut engine = engine(PppConfig::DEFAULT);
    let solutions = run(&mut engine, 0..170, |_| home(), TRUTH, slip);
    assert!(solutions[150..153].iter().any(|s| !s.solution.satellites_slipped.is_empty()));
    let worst = solutions[150..].iter().map(|s| (s.solution.position - home()).norm()).fold(0.0, f64::max);
    assert!(worst < 0.05, "{worst}");
}

/// Some receivers move their codes by a millisecond and leave their phases alone.
#[test]
fn millisecond_jumps_of_codes_alone_are_repaired() {
    let millisecond = 1e-3 * SPEED_OF_LIGHT;
    let jumps = |k: u32| f64::from(u8::from(k >= 130)) - 2.0 * f64::from(u8::from(k >= 140));
    let mut engine = engine(PppConfig::DEFAULT);
    let mut solutions = Vec::new();
    for k in 0..200 {
        let truth = Truth { code_jump: jumps(k) * millisecond, ..TRUTH };
        solutions.extend(run(&mut engine, k..k + 1, |_| home(), truth, nothing));
    }
    assert!(
        (solutions[130].clock_jump - millisecond).abs() < 1e-9
            && (solutions[140].clock_jump + 2.0 * millisecond).abs() < 1e-9
    );
    assert!(solutions.iter().all(|s| s.solution.satellites_slipped.is_empty()));
    let worst = solutions[130..].iter().map(|s| (s.solution.position - home()).norm()).fold(0.0, f64::max);
    assert!(worst < 0.05, "{worst}");
}

#[test]
fn a_wrong_code_and_a_wrong_phase_are_left_out() {
    let wrong = |k: u32, observations: &mut Vec<Observation>| {
        if k == 150 {
            let victim = observations[0].satellite;
            for observation in observations.iter_mut().filter(|o| o.satellite == victim) {
                observation.code = observation.code.map(|code| code + 40.0);
            }
        }
    };
    let mut engine = engine(PppConfig::DEFAULT);
    let solutions = run(&mut engine, 0..160, |_| home(), TRUTH, wrong);
    assert!(
        !solutions[150].solution.satellites_rejected.is_empty()
            || !solutions[150].solution.satellites_slipped.is_empty()
    );
    assert!((solutions[159].solution.position - home()).norm() < 0.04);
}

#[test]
fn gaps_and_disorder_are_handled() {
    let mut engine = engine(PppConfig::DEFAULT);
    run(&mut engine, 0..100, |_| home(), TRUTH, nothing);
    let config = *engine.config();
    let observations = observe(at(0.0), &home(), TRUTH, &config);
    let late = engine.push(EpochView { time: at(0.0), observations: &observations }, &Sky);
    assert_eq!((late.solution.quality, late.solution.reason), (Quality::None, Reason::OutOfOrder));
    // Ten minutes later: all ambiguities are new, the position is not.
    let after = run(&mut engine, 120..122, |_| home(), TRUTH, nothing);
    assert!((after[1].solution.position - home()).norm() < 0.1 && after[0].solution.quality == Quality::Float);
    assert!(engine.links().iter().all(|link| link.age <= 1));
    // Nothing in sight.
    let empty = engine.push(EpochView { time: at(3700.0), observations: &[] }, &Sky);
    assert_eq!(empty.solution.quality, Quality::None);
}

#[test]
fn satellites_without_products_are_named() {
    let mut engine = engine(PppConfig::DEFAULT);
    let add = |_: u32, observations: &mut Vec<Observation>| {
        let stranger = "G30".parse().unwrap();
        for (signal, cycles) in [("1W", 1.2e8), ("2W", 9e7)] {
            let mut observation = Observation::new(stranger, signal.parse().unwrap());
            (observation.code, observation.phase) = (Some(2.2e7), Some(cycles));
            observations.push(observation);
        }
    };
    let last = *run(&mut engine, 0..3, |_| home(), TRUTH, add).last().unwrap();
    assert!(last.without_products.contains("G30".parse().unwrap()) && last.solution.quality == Quality::Float);
    assert!(!last.without_antenna.is_empty());
}

#[test]
fn the_end_of_an_arc_is_explained() {
    let mut engine = engine(PppConfig::DEFAULT);
    let lose = |k: u32, observations: &mut Vec<Observation>| {
        if k == 5 {
            observations[0].loss_of_lock = true;
        }
    };
    let mut found = false;
    let config = *engine.config();
    for k in 0..8u32 {
        let mut observations = observe(at(30.0 * f64::from(k)), &home(), TRUTH, &config);
        lose(k, &mut observations);
        engine.push(EpochView { time: at(30.0 * f64::from(k)), observations: &observations }, &Sky);
        found |= engine
            .ended()
            .iter()
            .any(|ended| ended.end == ArcEnd::LossOfLock && ended.satellite == observations[0].satellite);
    }
    assert!(found);
}

#[test]
fn a_full_engine_leaves_satellites_out_and_counts_them() {
    let mut engine =
        Box::new(PppFilter::<6, 21>::new(PppConfig { ionosphere: Ionosphere::Estimated, ..PppConfig::DEFAULT }));
    let config = *engine.config();
    let observations = observe(at(0.0), &home(), TRUTH, &config);
    let solution = engine.push(EpochView { time: at(0.0), observations: &observations }, &Sky);
    assert!(solution.overflow > 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever is in the observations: no panic, and a position that is given is on the Earth and has a covariance.
    #[test]
    fn garbage_is_survived(
        seed: u64,
        damage in proptest::collection::vec((0usize..60, 0u8..6, prop::num::f64::ANY), 0..40),
        kinematic: bool, estimated: bool,
    ) {
        let config = PppConfig {
            motion: if kinematic { Motion::Kinematic } else { Motion::Static },
            ionosphere: if estimated { Ionosphere::Estimated } else { Ionosphere::Free },
            ..PppConfig::DEFAULT
        };
        let mut engine = engine(config);
        for k in 0..12u32 {
            let time = at(30.0 * f64::from(k));
            let mut observations = observe(time, &home(), TRUTH, &config);
            for (i, &(at, what, value)) in damage.iter().enumerate() {
                let n = observations.len();
                if (seed >> (i % 60)) & 1 == u64::from(k & 1) && n > 0 {
                    let observation = &mut observations[at % n];
                    match what {
                        0 => observation.code = Some(value),
                        1 => observation.phase = Some(value),
                        2 => observation.code = None,
                        3 => observation.loss_of_lock = true,
                        4 => observation.code = observation.code.map(|code| code + value % 1e4),
                        _ => observation.phase = observation.phase.map(|phase| phase + value % 1e5),
                    }
                }
            }
            let solution = engine.push(EpochView { time, observations: &observations }, &Sky).solution;
            if solution.quality != Quality::None {
                prop_assert!((6.0e6..7.0e6).contains(&solution.position.norm()), "{}", solution.position);
                prop_assert!(solution.position_covariance.diagonal().iter().all(|v| *v > 0.0 && v.is_finite()));
            }
        }
    }
}
