//! Logs that are written come back; damaged ones and other files are told from them.

use super::*;
use crate::process::stream::{Input, OwnedEpoch};
use proptest::prelude::*;
use surefix_core::gnss::atmosphere::Klobuchar;
use surefix_core::gnss::ephemeris::{Ephemeris, GlonassEphemeris};
use surefix_core::gnss::epoch::Observation;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;
use surefix_core::log::{Event, FrameError, Header, Ionosphere, Station};

fn observation(number: u8, values: [Option<f64>; 3], flags: u8) -> Observation {
    let satellite = SatelliteId::new(Constellation::Galileo, number).unwrap();
    let mut observation = Observation::new(satellite, "5Q".parse().unwrap());
    [observation.code, observation.phase, observation.doppler] = values;
    observation.cn0 = values[0].map(|x| (x / 1e6) as f32).filter(|x| x.is_finite());
    (observation.loss_of_lock, observation.half_cycle) = (flags & 1 != 0, flags & 2 != 0);
    observation
}

fn epochs() -> impl Strategy<Value = OwnedEpoch> {
    let value = prop::option::of(
        (any::<i32>(), any::<bool>()).prop_map(
            |(n, decimal)| {
                if decimal { f64::from(n) / 1000.0 } else { f64::from(n) / 3.0 }
            },
        ),
    );
    let observation = (1u8..=63, prop::array::uniform3(value), 0u8..4)
        .prop_map(|(number, values, flags)| observation(number, values, flags));
    (any::<i64>(), prop::collection::vec(observation, 0..130))
        .prop_map(|(ns, observations)| OwnedEpoch { time: GpsTime::from_nanoseconds(ns), observations })
}

fn inputs() -> impl Strategy<Value = Input> {
    let numbers = || prop::array::uniform3(-1e9..1e9);
    prop_oneof![
        8 => epochs().prop_map(Input::Rover),
        8 => epochs().prop_map(Input::Base),
        1 => (prop::option::of(numbers()), numbers(), numbers()).prop_map(|(base_position, base_antenna, rover_antenna)| {
            Input::Header(Header { base_position, base_antenna, rover_antenna })
        }),
        1 => prop::array::uniform4(-1e6..1e6).prop_map(|alpha| Input::Ionosphere(Ionosphere {
            constellation: Constellation::BeiDou,
            klobuchar: Klobuchar { alpha, beta: alpha.map(|x: f64| -x) },
        })),
        1 => numbers().prop_map(|position| Input::Ephemeris(ephemeris(position))),
        1 => (any::<u16>(), prop::collection::vec(any::<u8>(), 0..300)).prop_map(|(schema, data)| Input::Config(schema, data)),
        1 => Just(Input::Reset),
    ]
}

fn ephemeris(position: [f64; 3]) -> Ephemeris {
    Ephemeris::Glonass(GlonassEphemeris {
        satellite: "R07".parse().unwrap(),
        iode: 3,
        channel: 5,
        toe: GpsTime::from_week_tow(2300, 900.0),
        position,
        velocity: [1.0, -2.0, 3.5],
        acceleration: [0.0, 1e-6, -1e-6],
        clock_bias: 1e-5,
        frequency_bias: 1e-12,
        health: 0,
        age: 1.0,
    })
}

fn written(inputs: &[Input]) -> Vec<u8> {
    let mut log = LogWriter::new(Vec::new());
    inputs.iter().for_each(|input| log.input(input).unwrap());
    log.finish().unwrap()
}

fn read(bytes: &[u8]) -> (Vec<Input>, Damage) {
    let mut log = LogInputs::new("test.sfl", bytes).unwrap();
    let inputs = log.by_ref().map(Result::unwrap).collect();
    (inputs, log.damage().clone())
}

proptest! {
    #[test]
    fn inputs_come_back(inputs in prop::collection::vec(inputs(), 0..20)) {
        let (back, damage) = read(&written(&inputs));
        prop_assert!(damage.is_none(), "{damage:?}");
        prop_assert_eq!(back, inputs);
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 1..5000)) {
        if let Ok(log) = LogInputs::new("test.sfl", &bytes[..]) {
            let told: Vec<_> = log.collect();
            prop_assert!(told.iter().any(Result::is_err));
        }
    }
}

#[test]
fn a_frame_is_where_it_is_said_to_be() {
    let mut bytes = written(&[Input::Reset, Input::Ephemeris(ephemeris([1.0, 2.0, 3.0]))]);
    let second = 1 + bytes[1..].iter().position(|&byte| byte == 0).unwrap() + 2;
    bytes[second + 4] ^= 1; // in the number of the satellite
    let end = bytes.len() - 1;
    let mut log = LogReader::new("test.sfl", &bytes[..end]).unwrap();
    let first = log.next_frame().unwrap().unwrap();
    assert_eq!((first.offset, first.length, first.record.is_ok()), (1, second as u64 - 3, true));
    let bad = log.next_frame().unwrap().unwrap();
    assert_eq!((bad.offset, bad.record.err(), bad.cut_off), (second as u64, Some(FrameError::Checksum), false));
    let last = log.next_frame().unwrap().unwrap();
    assert!(last.record.is_ok() && last.cut_off && last.offset + last.length == end as u64);
    assert!(log.next_frame().unwrap().is_none());

    let (inputs, damage) = read(&bytes);
    assert_eq!((inputs.len(), damage.frames, damage.bad), (1, vec![(second as u64, FrameError::Checksum)], 1));
}

#[test]
fn a_missing_end_lost_records_and_nan_are_told() {
    let mut log = LogWriter::new(Vec::new());
    let mut nan = OwnedEpoch { time: GpsTime::from_nanoseconds(1), observations: Vec::new() };
    nan.observations.push(observation(7, [Some(f64::NAN), Some(1.5), None], 0));
    log.input(&Input::Rover(nan.clone())).unwrap();
    log.event(Event::Dropped(17)).unwrap();
    let bytes = log.finish().unwrap();
    let (inputs, damage) = read(&bytes);
    nan.observations[0].code = None;
    assert_eq!(inputs, [Input::Rover(nan)]);
    assert_eq!(damage, Damage { dropped: 17, not_finite: 1, ..Damage::default() });
    let (_, damage) = read(&bytes[..bytes.len() - 12]);
    assert!(damage.no_end && damage.bad == 0, "{damage:?}");
}

#[test]
fn an_epoch_with_a_lost_part_is_counted() {
    let mut log = LogWriter::new(Vec::new());
    let observations = (0..100).map(|i| observation(1 + i % 63, [Some(f64::from(i)), None, None], 0)).collect();
    let epoch = OwnedEpoch { time: GpsTime::from_nanoseconds(1), observations };
    log.epoch(Station::Base, epoch.view()).unwrap();
    let mut bytes = log.finish().unwrap();
    bytes[40] ^= 1; // in the first of three parts
    let (inputs, damage) = read(&bytes);
    let Input::Base(read) = &inputs[0] else { panic!("{inputs:?}") };
    assert_eq!(read.observations, epoch.observations[40..]);
    assert_eq!((damage.bad, damage.incomplete), (1, 1));
}

#[test]
fn other_files_are_told_from_logs() {
    let message = |bytes: &[u8]| match LogReader::new("x", bytes) {
        Err(error) => error.to_string(),
        Ok(mut log) => loop {
            match log.next_frame() {
                Err(error) => break error.to_string(),
                Ok(frame) => assert!(frame.is_some(), "not refused"),
            }
        },
    };
    let rinex = format!("{:<60}{:<20}\n", "     3.03           OBSERVATION DATA    M", "RINEX VERSION / TYPE");
    assert!(message(rinex.as_bytes()).contains("not a device log but RINEX; make a log of it with `surefix log pack"));
    assert!(message(&[0x1f, 0x8b, 8, 0]).contains("gunzip"));
    assert!(message(b"").contains("x: is empty"));
    assert!(message(b"% program   : RTKLIB\n").contains("not one of its 21 bytes"));
    let missing = LogInputs::open("no/such/file.sfl".as_ref()).err().unwrap().to_string();
    assert!(missing.starts_with("no/such/file.sfl: cannot be opened") && missing.contains("check the path"));
}
