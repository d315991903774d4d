//! Cities made of simulated drives, whose observations are known to a thousandth.

use super::events::{Event, What};
use super::scenario::Scenario;
use super::sky::{Place, Sky};
use super::*;
use crate::read::rinex::{ObservationEpoch, ObservationReader};
use crate::simulate::scenario::{MotionKind, Scenario as Simulated};
use crate::simulate::simulate;
use proptest::prelude::*;
use surefix_core::gnss::geodesy::Geodetic;

/// 500 s of a rover on two bands without slips or gaps of its own, and what the satellites broadcast.
fn drive(kind: MotionKind) -> (Vec<ObservationEpoch>, NavigationData) {
    let mut simulated = Simulated { duration_s: 500.0, ..Simulated::default() };
    simulated.rover.motion.kind = kind;
    simulated.rover.receiver.slips.per_hour = 0.0;
    simulated.rover.receiver.outages.clear();
    let simulation = simulate(&simulated).unwrap();
    let epoch = |epoch: &crate::process::stream::OwnedEpoch| ObservationEpoch {
        time: epoch.time,
        power_failure: false,
        clock_offset: None,
        observations: epoch.observations.clone(),
    };
    let epochs = simulation.rover.iter().map(epoch).collect();
    (epochs, NavigationData { ephemerides: simulation.ephemerides, ..NavigationData::default() })
}

/// The default city without anything that is no whole number of cycles.
fn without_reflections(seed: u64) -> Scenario {
    let mut scenario = Scenario { seed, ..Scenario::default() };
    scenario.reflections.amplitude = 0.0;
    scenario.nlos.probability = 0.0;
    scenario
}

/// Phases of a signal in two lists of epochs, where both have one: time, output − input.
fn differences(
    input: &[ObservationEpoch],
    output: &[ObservationEpoch],
    satellite: SatelliteId,
    signal: Signal,
) -> Vec<(surefix_core::gnss::time::GpsTime, f64)> {
    let phase = |epoch: &ObservationEpoch| {
        let same = |o: &&Observation| (o.satellite, o.signal) == (satellite, signal);
        epoch.observations.iter().find(same).and_then(|observation| observation.phase)
    };
    let pairs = input.iter().zip(output);
    pairs.filter_map(|(before, after)| Some((before.time, phase(after)? - phase(before)?))).collect()
}

fn signals(epochs: &[ObservationEpoch]) -> BTreeSet<(SatelliteId, Signal)> {
    epochs.iter().flat_map(|epoch| &epoch.observations).map(|o| (o.satellite, o.signal)).collect()
}

#[test]
fn the_same_seed_gives_the_same_city_and_another_does_not() {
    let (epochs, navigation) = drive(MotionKind::Drive);
    let run = |seed| degrade(&epochs, &navigation, &Scenario { seed, ..Scenario::default() }).unwrap();
    let (first, again, other) = (run(1), run(1), run(2));
    assert_eq!((&first.epochs, &first.events), (&again.epochs, &again.events));
    assert_ne!(first.epochs, other.epochs);
    assert!(first.unknown.is_empty());
    assert_eq!(first.epochs.len(), epochs.len());
}

/// Jumps in the list are the jumps of the phase against the input, each at its epoch, and there are no others; every loss
/// of lock that was added is in the list as flagged.
#[test]
fn jumps_are_those_of_the_phase() {
    let (epochs, navigation) = drive(MotionKind::Drive);
    let mut scenario = without_reflections(3);
    scenario.slips.per_hour = 120.0;
    let degraded = degrade(&epochs, &navigation, &scenario).unwrap();
    let mut jumps = 0;
    for (satellite, signal) in signals(&epochs) {
        let of_signal = |event: &&Event| (event.satellite, event.signal) == (Some(satellite), Some(signal));
        let events: Vec<&Event> = degraded.events.iter().filter(of_signal).collect();
        let mut cycles = 0.0;
        let mut next = events.iter().peekable();
        for (time, difference) in differences(&epochs, &degraded.epochs, satellite, signal) {
            if let Some(event) = next.next_if(|event| event.time == time) {
                cycles += event.size;
                let mut at = degraded.epochs.iter().filter(|epoch| epoch.time == time);
                let same = |o: &&Observation| (o.satellite, o.signal) == (satellite, signal);
                let observation = at.next().and_then(|epoch| epoch.observations.iter().find(same)).unwrap();
                assert_eq!(Some(observation.loss_of_lock), event.flagged, "{event:?}");
                jumps += 1;
            }
            // Both are on the grid of a thousandth; numbers are up to 1e9.
            assert!((difference - cycles).abs() < 1e-5, "{satellite} {signal} {time}: {difference} {cycles}");
        }
        assert!(next.next().is_none());
    }
    let count = |what| degraded.events.iter().filter(|event| event.what == what).count();
    assert!(count(What::Slip) > 10 && count(What::Reacquired) > 10, "{:?}", degraded.events);
    assert_eq!(jumps, count(What::Slip) + count(What::Reacquired));
    let sizes = degraded.events.iter().filter(|event| event.what == What::Slip).map(|event| event.size.abs());
    assert!(sizes.clone().all(|size| (1.0..=5.0).contains(&size) && size.fract() == 0.0));
}

/// In a street that leads north with roofs at 60°, nothing is left across it below that, all is left along it, and
/// outside of stretches all is left and no code or C/N0 changed.
#[test]
fn blocked_sectors_are_empty_and_the_rest_is_not() {
    let (epochs, navigation) = drive(MotionKind::Static);
    let mut scenario = without_reflections(1);
    scenario.canyons.follow_heading = false;
    (scenario.canyons.mask_deg, scenario.canyons.gap) = ([60.0, 60.0], 0.0);
    scenario.canyons.duration_s = [100.0, 100.0];
    let degraded = degrade(&epochs, &navigation, &scenario).unwrap();
    let sky = Sky::new(&navigation, [epochs[0].time, epochs[500].time]);
    let places = sky.places(&epochs).unwrap();
    let (mut removed, mut kept) = (0, 0);
    for ((before, after), place) in epochs.iter().zip(&degraded.epochs).zip(&places) {
        let seconds = before.time.since(epochs[0].time);
        let canyon = (120.0..220.0).contains(&seconds) || seconds >= 420.0;
        for observation in &before.observations {
            let same = |o: &&Observation| (o.satellite, o.signal) == (observation.satellite, observation.signal);
            let left = after.observations.iter().find(same);
            let look = sky.look(observation.satellite, before.time, &place.position).unwrap();
            let roof = (60_f64.to_radians().tan() * look.azimuth.sin().abs()).atan();
            assert_eq!(left.is_some(), !canyon || look.elevation >= roof, "{observation:?} {look:?}");
            removed += usize::from(left.is_none());
            if let (Some(left), false) = (left, canyon) {
                kept += 1;
                assert_eq!(
                    (left.code, left.doppler, left.cn0),
                    (observation.code, observation.doppler, observation.cn0)
                );
            }
        }
    }
    assert!(removed > 1000 && kept > 1000, "{removed} {kept}");
}

#[test]
fn a_satellite_more_changes_no_other() {
    let (epochs, navigation) = drive(MotionKind::Drive);
    let sky = Sky::new(&navigation, [epochs[0].time, epochs[500].time]);
    let places = sky.places(&epochs).unwrap();
    let gone = epochs[200].observations[0].satellite;
    let fewer: Vec<ObservationEpoch> = epochs
        .iter()
        .map(|epoch| {
            let observations = epoch.observations.iter().filter(|o| o.satellite != gone).copied().collect();
            ObservationEpoch { observations, ..*epoch }
        })
        .collect();
    let (all, less) = [&epochs, &fewer].map(|epochs| degrade_at(epochs, &places, &sky, &Scenario::default())).into();
    for (all, less) in all.epochs.iter().zip(&less.epochs) {
        let rest: Vec<Observation> = all.observations.iter().filter(|o| o.satellite != gone).copied().collect();
        assert_eq!(rest, less.observations);
    }
}

#[test]
fn what_is_written_is_read_again_as_it_was() {
    let (epochs, navigation) = drive(MotionKind::Drive);
    let directory = tempfile::tempdir().unwrap();
    let simulated = directory.path().join("in.obs");
    // Through a file, which gives a header.
    let station = crate::write::rinex_observation::Station {
        marker: "ROVER".into(),
        receiver: "R".into(),
        antenna: "A".into(),
        approximate_position: [4e6, 1e6, 4.8e6],
        antenna_delta_hen: [0.1, 0.0, 0.0],
        interval: Some(1.0),
        first_epoch: epochs[0].time,
        signals: std::array::from_fn(
            |i| if i < 2 { vec!["1C".parse().unwrap(), "5Q".parse().unwrap()] } else { vec![] },
        ),
        glonass_channels: Default::default(),
    };
    let file = std::fs::File::create(&simulated).unwrap();
    let mut writer = crate::write::rinex_observation::ObservationWriter::new(file, &station).unwrap();
    epochs.iter().for_each(|epoch| writer.write(epoch.view(), false).unwrap());
    writer.finish().unwrap();
    let reader = ObservationReader::open(&simulated).unwrap();
    let scenario = Scenario::default();
    let degraded = degrade(&epochs, &navigation, &scenario).unwrap();
    let [observations, events, toml] = files::write(directory.path(), reader.header(), &scenario, &degraded).unwrap();
    let mut again = ObservationReader::open(&observations).unwrap();
    assert_eq!(again.header().antenna_delta_hen, [0.1, 0.0, 0.0]);
    for epoch in &degraded.epochs {
        let mut epoch = epoch.clone();
        epoch.observations.sort_by_key(|o| (o.satellite, o.signal));
        assert_eq!(again.next_epoch().unwrap().unwrap(), epoch);
    }
    let rows = std::fs::read_to_string(&events).unwrap();
    assert_eq!(rows.lines().count(), 1 + degraded.events.len());
    assert_eq!(Scenario::from_toml("t", &std::fs::read_to_string(&toml).unwrap()).unwrap(), scenario);
}

#[test]
fn what_cannot_be_degraded_is_said() {
    let (epochs, navigation) = drive(MotionKind::Static);
    let error = |epochs: &[ObservationEpoch], navigation: &NavigationData, scenario: &Scenario| {
        degrade(epochs, navigation, scenario).unwrap_err().to_string()
    };
    assert!(error(&[], &navigation, &Scenario::default()).contains("no epoch"));
    assert!(error(&epochs, &NavigationData::default(), &Scenario::default()).contains("navigation file"));
    let mut scenario = Scenario::default();
    scenario.nlos.phase = -1.0;
    assert!(error(&epochs, &navigation, &scenario).contains("nlos.phase is -1"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever the seed: reflections that come with the direct signal stay below a quarter of a wavelength of phase, those
    /// seen alone lengthen codes by 0 to 70 m (60 m and 20 σ of variation), and nothing appears that was not there.
    #[test]
    fn reflections_are_bounded(seed: u64) {
        let (epochs, navigation) = drive(MotionKind::Drive);
        let mut scenario = Scenario { seed, ..Scenario::default() };
        (scenario.slips.per_hour, scenario.reflections.amplitude) = (0.0, 0.9);
        let place = Place { position: Geodetic { latitude: 0.8577, longitude: 0.2248, height: 666.0 }.to_ecef(), heading: 0.3 };
        let sky = Sky::new(&navigation, [epochs[0].time, epochs[500].time]);
        let degraded = degrade_at(&epochs, &vec![place; epochs.len()], &sky, &scenario);
        let mut reflected = BTreeSet::new();
        let mut events = degraded.events.iter().peekable();
        for (before, after) in epochs.iter().zip(&degraded.epochs) {
            while let Some(event) = events.next_if(|event| event.time <= before.time) {
                if let (Some(satellite), None) = (event.satellite, event.signal) {
                    if event.what == What::Reflected { reflected.insert(satellite) } else { reflected.remove(&satellite) };
                }
            }
            for o in &after.observations {
                let same = |i: &&Observation| (i.satellite, i.signal) == (o.satellite, o.signal);
                let input = before.observations.iter().find(same).unwrap();
                let longer = o.code.unwrap() - input.code.unwrap();
                if reflected.contains(&o.satellite) {
                    prop_assert!((-1e-3..70.0).contains(&longer), "{longer}");
                } else {
                    // 0.95 of the greatest delay, 20 m.
                    prop_assert!(longer.abs() <= 19.001, "{longer}");
                    let part = (o.phase.unwrap() - input.phase.unwrap()).rem_euclid(1.0);
                    prop_assert!(part.min(1.0 - part) <= 0.251, "{part}");
                }
            }
        }
    }
}
