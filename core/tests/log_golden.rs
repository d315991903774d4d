//! The byte layout of the device log is frozen: these records are these files.
//!
//! A test fails here if the layout changes: then give the record a new kind, or the format a new version, and keep the
//! old files and the code that reads them. `cargo test -p surefix-core --test log_golden -- --ignored` writes the files
//! of records that have none yet.

use nalgebra::{Matrix3, Vector3};
use std::path::PathBuf;
use surefix_core::filter::linearize::Rule;
use surefix_core::filter::mixed_integer::{Detector, Fixing, Options, Output};
use surefix_core::filter::section_v::{CONFIG_SCHEMA, Prior, Setup};
use surefix_core::filter::update::Form;
use surefix_core::gnss::atmosphere::Klobuchar;
use surefix_core::gnss::ephemeris::{Ephemeris, GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use surefix_core::gnss::epoch::{Epoch, Observation};
use surefix_core::gnss::satellite::{Constellation, SatelliteId, SatelliteSet};
use surefix_core::gnss::solution::{Quality, Reason, Solution};
use surefix_core::gnss::time::GpsTime;
use surefix_core::integrity::protection::{Levels, Status};
use surefix_core::log::*;
use surefix_core::model::virtual_bias::VirtualBiasParameters;

fn time() -> GpsTime {
    GpsTime::from_week_tow(2114, 5_783.994)
}

fn satellite(name: &str) -> SatelliteId {
    name.parse().unwrap()
}

fn header() -> Header {
    Header {
        base_position: Some([-2_414_266.919_7, -4_778_768.262, 3.0]),
        base_antenna: [0.008, 0.0, -0.25],
        rover_antenna: [1.5, 0.125, 0.0],
    }
}

fn ionosphere() -> Ionosphere {
    Ionosphere {
        constellation: Constellation::Gps,
        klobuchar: Klobuchar {
            alpha: [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7],
            beta: [81_920.0, 98_304.0, -65_536.0, -524_290.0],
        },
    }
}

/// Every field different, so that an exchange of two shows.
fn kepler() -> Ephemeris {
    let x = |n: u32| f64::from(n) + 1.0 / 3.0;
    Ephemeris::Kepler(KeplerEphemeris {
        satellite: satellite("E36"),
        message: NavigationMessage::Fnav,
        iode: 1023,
        toe: time(),
        toc: time().plus_seconds(-600.0),
        sqrt_a: x(1),
        e: x(2),
        m0: x(3),
        delta_n: x(4),
        i0: x(5),
        idot: x(6),
        omega0: x(7),
        omega: x(8),
        omega_dot: x(9),
        cuc: x(10),
        cus: x(11),
        crc: x(12),
        crs: x(13),
        cic: x(14),
        cis: x(15),
        af0: x(16),
        af1: x(17),
        af2: x(18),
        group_delay: [x(19), x(20)],
        health: 0x145,
        accuracy: x(21),
        fit_interval: x(22),
    })
}

fn glonass() -> Ephemeris {
    let x = |n: u32| -f64::from(n) - 1.0 / 3.0;
    Ephemeris::Glonass(GlonassEphemeris {
        satellite: satellite("R24"),
        iode: 95,
        channel: -7,
        toe: time(),
        position: [x(1), x(2), x(3)],
        velocity: [x(4), x(5), x(6)],
        acceleration: [x(7), x(8), x(9)],
        clock_bias: x(10),
        frequency_bias: x(11),
        health: 4,
        age: x(12),
    })
}

/// One observation with three decimals, one with any numbers, one with nothing, of all constellations.
fn epoch() -> Epoch<8> {
    let mut epoch = Epoch::new(time());
    for (name, signal) in [("G01", "1C"), ("E36", "8X"), ("C63", "2I"), ("J10", "9Z"), ("R24", "1 ")] {
        epoch.observations.push(Observation::new(satellite(name), signal.parse().unwrap())).unwrap();
    }
    epoch.observations[0].code = Some(21_345_678.123);
    epoch.observations[0].phase = Some(-112_345_678.901);
    epoch.observations[0].doppler = Some(-3_456.789);
    epoch.observations[0].cn0 = Some(45.25);
    epoch.observations[1].code = Some(1.0 / 3.0);
    epoch.observations[1].phase = Some(-0.0);
    epoch.observations[1].doppler = Some(1e-300);
    epoch.observations[1].cn0 = Some(1.0 / 3.0);
    epoch.observations[2].loss_of_lock = true;
    epoch.observations[3].half_cycle = true;
    epoch
}

fn solution() -> Solution {
    let set = |names: [&str; 2]| names.iter().map(|name| satellite(name)).collect::<SatelliteSet>();
    Solution {
        time: time(),
        quality: Quality::Partial,
        reason: Reason::SubsetOnly,
        position: Vector3::new(1.1, 2.2, 3.3),
        position_covariance: Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0) / 7.0,
        velocity: Vector3::new(-1.1, -2.2, -3.3),
        velocity_covariance: Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0) / 3.0,
        ambiguities_fixed: 11,
        ambiguities: 200,
        ratio: f64::INFINITY,
        success_rate: 0.999_9,
        age: 1.5,
        satellites_used: set(["G01", "C63"]),
        satellites_rejected: set(["E05", "R24"]),
        satellites_slipped: set(["J10", "G32"]),
        protection: None,
        integrity: Status::Unmonitored,
        base: None,
    }
}

/// With protection levels, from a base that moves.
fn bounded_solution() -> Solution {
    Solution {
        protection: Some(Levels { horizontal: 0.25, vertical: 1.0 / 3.0 }),
        integrity: Status::Alert,
        base: Some(Vector3::new(4.4, -5.5, 6.6)),
        ..solution()
    }
}

fn satellites() -> [Vector3<f64>; 2] {
    [Vector3::new(1.1e7, -2.2e7, 3.3e6), Vector3::new(-0.0, 1.0 / 3.0, 1e-300)]
}

fn values() -> [f64; 3] {
    [0.5, -1.0 / 3.0, 21_345_678.123]
}

fn estimate() -> Estimate {
    let density = |n: i32| PositionDensity {
        mean: [1, 2, 3].map(|i| f64::from(n + i) / 3.0),
        covariance: [4, 5, 6, 7, 8, 9].map(|i| f64::from(n + i) / 7.0),
    };
    Estimate {
        time: time(),
        refusal: Some(Refusal::Undetermined),
        relaxed: density(0),
        constrained: density(10),
        relaxed_nis: 62.5,
        constrained_nis: 63.25,
        best_norm: 1.0 / 3.0,
        second_norm: f64::INFINITY,
        success_rate: 0.999_9,
        nodes: 300,
        bootstrapped: true,
        gated: true,
        common_jump: Some(-300),
        checksum: 0xdead_beef,
    }
}

fn ambiguities() -> [AmbiguityEstimate; 2] {
    let ambiguity = |mean: f64, integer, slipped| AmbiguityEstimate {
        mean,
        variance: mean / 7.0,
        integer,
        slip_estimate: mean / 3.0,
        slipped,
    };
    [ambiguity(6.9, 7, false), ambiguity(-1e8 / 3.0, -33_333_333, true)]
}

/// The settings of the filter of Section V are frozen too; a change of them takes a new schema number.
fn section_v_setup() -> Setup {
    Setup {
        parameters: VirtualBiasParameters {
            interval: 1.0,
            acceleration: 2.0,
            bias_walk: 3.0,
            wavelength: 4.0,
            sigma_code: 5.0,
            sigma_phase: 6.0,
            sigma_bias: 7.0,
        },
        prior: Prior {
            position: [8.0, 9.0, 10.0],
            sigma_position: 11.0,
            sigma_velocity: 12.0,
            sigma_bias: 13.0,
            sigma_ambiguity: 14.0,
        },
        options: Options {
            rule: Rule::Unscented { alpha: 15.0, beta: 16.0, kappa: 17.0 },
            form: Form::Array,
            detector: Detector::Weighted,
            threshold: 18.0,
            sigma_jump: 19.0,
            sigma_stay: 20.0,
            common_jump: true,
            fixing: Fixing::Bootstrapping,
            search_budget: 300,
            output: Output::ConditionalFix,
            gate: 21.0,
        },
    }
}

/// Each record by name, as written now.
fn records() -> Vec<(&'static str, Vec<u8>)> {
    let frame = |write: &dyn Fn(&mut [u8]) -> Result<usize, WriteError>| {
        let mut frame = vec![0; MAX_FRAME];
        let length = write(&mut frame).unwrap();
        frame.truncate(length);
        frame
    };
    vec![
        ("header", frame(&|out| write_header(&header(), out))),
        ("ionosphere", frame(&|out| write_ionosphere(&ionosphere(), out))),
        ("kepler", frame(&|out| write_ephemeris(&kepler(), out))),
        ("glonass", frame(&|out| write_ephemeris(&glonass(), out))),
        ("epoch", frame(&|out| write_epoch_part(Station::Base, epoch().view(), 0, out))),
        ("solution", frame(&|out| write_solution(&solution(), out))),
        ("bounded_solution", frame(&|out| write_solution(&bounded_solution(), out))),
        ("event_end", frame(&|out| write_event(&Event::End, out))),
        ("event_reset", frame(&|out| write_event(&Event::Reset, out))),
        ("event_dropped", frame(&|out| write_event(&Event::Dropped(300), out))),
        ("event_marker", frame(&|out| write_event(&Event::Marker(u32::MAX), out))),
        ("config", frame(&|out| write_config(515, &(true, 0.15, [1u16, 300]), out))),
        ("measurements", frame(&|out| write_measurements(time(), &satellites(), &values(), out))),
        ("estimate", frame(&|out| write_estimate(&estimate(), ambiguities().into_iter(), out))),
        ("section_v_setup", frame(&|out| write_config(CONFIG_SCHEMA, &section_v_setup(), out))),
    ]
}

fn golden(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/log_v1_{name}.bin"))
}

#[test]
fn records_are_written_as_ever() {
    for (name, bytes) in records() {
        let frozen = std::fs::read(golden(name)).unwrap();
        assert_eq!(bytes, frozen, "the layout of {name} has changed");
    }
}

#[test]
fn records_are_read_as_ever() {
    let read = |name: &str, check: &dyn Fn(Record<'_>)| {
        let mut reader: RecordReader = RecordReader::new();
        let mut records = 0;
        for byte in std::fs::read(golden(name)).unwrap() {
            if let Some(record) = reader.push(byte) {
                check(record.unwrap());
                records += 1;
            }
        }
        assert_eq!(records, 1);
    };
    read("header", &|record| assert!(matches!(record, Record::Header(h) if h == header())));
    read("ionosphere", &|record| assert!(matches!(record, Record::Ionosphere(i) if i == ionosphere())));
    read("kepler", &|record| assert!(matches!(record, Record::Ephemeris(e) if e == kepler())));
    read("glonass", &|record| assert!(matches!(record, Record::Ephemeris(e) if e == glonass())));
    read("epoch", &|record| {
        let Record::Epoch(part) = record else { panic!("{record:?}") };
        assert_eq!((part.station, part.time, part.first, part.total), (Station::Base, time(), 0, 5));
        let observations: Vec<_> = part.observations().collect();
        assert_eq!(observations, epoch().observations.as_slice());
        assert_eq!(observations[1].phase.map(f64::to_bits), Some((-0.0f64).to_bits()));
    });
    read("solution", &|record| assert!(matches!(record, Record::Solution(s) if s == solution())));
    read("bounded_solution", &|record| assert!(matches!(record, Record::Solution(s) if s == bounded_solution())));
    for (name, event) in [
        ("event_end", Event::End),
        ("event_reset", Event::Reset),
        ("event_dropped", Event::Dropped(300)),
        ("event_marker", Event::Marker(u32::MAX)),
    ] {
        read(name, &|record| assert!(matches!(record, Record::Event(e) if e == event)));
    }
    read("config", &|record| {
        let Record::Config(config) = record else { panic!("{record:?}") };
        assert_eq!((config.schema, config.value()), (515, Some((true, 0.15, [1u16, 300]))));
        assert_eq!(config.value::<u8>(), None);
    });
    read("measurements", &|record| {
        let Record::Measurements(m) = record else { panic!("{record:?}") };
        assert_eq!((m.time, m.satellites().len(), m.values().len()), (time(), 2, 3));
        assert!(m.satellites().eq(satellites()) && m.values().eq(values()));
        assert!(m.satellites().last().unwrap().x.is_sign_negative());
    });
    read("estimate", &|record| {
        let Record::Estimate(record) = record else { panic!("{record:?}") };
        assert_eq!(record.estimate, estimate());
        assert!(record.ambiguities().eq(ambiguities()));
    });
    read("section_v_setup", &|record| {
        let Record::Config(config) = record else { panic!("{record:?}") };
        assert_eq!((config.schema, config.value()), (0x0101, Some(section_v_setup())));
    });
}

/// By hand from the documentation: `53 01 09`, time in nanoseconds as zigzag varint of −1, one satellite, one value, four
/// numbers; CRC-32 by Python's `zlib.crc32`.
#[test]
fn measurements_by_hand() {
    let mut frame = [0; MAX_FRAME];
    let one = Vector3::new(1.0, 1.0, 1.0);
    let length = write_measurements(GpsTime::from_nanoseconds(-1), &[one], &[1.0], &mut frame).unwrap();
    let head = [0x00, 0x07, 0x53, 0x01, 0x09, 0x01, 0x01, 0x01];
    let number = [1, 1, 1, 1, 1, 3, 0xf0, 0x3f]; // 00 00 00 00 00 00 f0 3f
    let last = [1, 1, 1, 1, 1, 7, 0xf0, 0x3f, 0xa6, 0xec, 0xa2, 0x01, 0x00]; // the CRC behind it
    let expected = [&head[..], &number, &number, &number, &last].concat();
    assert_eq!(frame[..length], expected);
}

/// By hand from the documentation of the module: `53 01 07`, code 2, 300 as varint `ac 02`, CRC-32 by Python's
/// `zlib.crc32`.
#[test]
fn a_frame_by_hand() {
    let frozen = std::fs::read(golden("event_dropped")).unwrap();
    assert_eq!(frozen, [0x00, 0x0b, 0x53, 0x01, 0x07, 0x02, 0xac, 0x02, 0x54, 0x8c, 0x57, 0x74, 0x00]);
}

#[test]
#[ignore = "writes the golden files of records that have none"]
fn write_missing_golden_files() {
    for (name, bytes) in records() {
        if !golden(name).exists() {
            std::fs::create_dir_all(golden(name).parent().unwrap()).unwrap();
            std::fs::write(golden(name), bytes).unwrap();
        }
    }
}
