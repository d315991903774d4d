//! Host against target: the firmware's answer to a device log is the host's, byte for byte, on both simulated cores.
//!
//! The firmware is built and run by the task runner, whose path `cargo xtask test` gives in `SUREFIX_XTASK`. Under plain
//! `cargo test` these tests skip, as they need a Cortex-M toolchain and QEMU.

#[path = "../../firmware-sim/src/fixed_lag/drive.rs"]
mod drive;
#[path = "../../firmware-sim/src/ppp/drive.rs"]
mod ppp;
#[path = "../../firmware-sim/src/random.rs"]
mod random;
#[path = "../../firmware-sim/src/moving_base/drive.rs"]
mod vehicles;

use drive::{Drive, EPOCHS, LAG};
use nalgebra::Vector3;
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::process::Command;
use surefix::cli::files::Files;
use surefix::log::section_v::replay;
use surefix::log::{LogInputs, LogReader, LogWriter};
use surefix::process::run::Engine;
use surefix_core::gnss::solution::Quality;
use surefix_core::ppp::PppSolution;
use surefix_core::real::Real;
use surefix_core::rtk::RtkConfig;
use surefix_tests::{section_v, shared};

const MACHINES: [&str; 2] = ["an386", "an500"];

/// The answer of the host to a log, and the number of epochs answered.
fn host(log: &[u8]) -> (Vec<u8>, usize) {
    let mut engine = Engine::new(RtkConfig::default());
    let mut answer = LogWriter::new(Vec::new());
    let mut epochs = 0;
    for input in LogInputs::new("log", log).unwrap() {
        if let Some(solution) = engine.feed(&input.unwrap()) {
            answer.solution(&solution).unwrap();
            epochs += 1;
        }
    }
    (answer.finish().unwrap(), epochs)
}

/// The answer of a program of the firmware on a machine.
fn target(xtask: &Path, program: &str, machine: &str, log: &[u8]) -> Vec<u8> {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = |what: &str| directory.join(format!("host_target_{}_{program}_{machine}_{what}.log", log.len()));
    let (question, answer) = (file("question"), file("answer"));
    std::fs::write(&question, log).unwrap();
    let run = Command::new(xtask)
        .args(["replay", "--program", program, "--machine", machine, "--output"])
        .args([&answer, &question])
        .output()
        .unwrap();
    let said = [run.stdout, run.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(run.status.success(), "{machine}: {said}");
    println!("{machine}: {said}");
    std::fs::read(answer).unwrap()
}

fn xtask() -> Option<PathBuf> {
    let path = std::env::var_os("SUREFIX_XTASK").map(PathBuf::from);
    if path.is_none() {
        println!("skipped: needs the firmware; run it by `cargo xtask test`");
    }
    path
}

fn assert_equal(xtask: &Path, log: &[u8], least_epochs: usize) {
    let (expected, epochs) = host(log);
    assert!(epochs >= least_epochs, "{epochs} epochs");
    for machine in MACHINES {
        assert_same(machine, &target(xtask, "replay64", machine, log), &expected);
    }
}

fn assert_same(machine: &str, answer: &[u8], expected: &[u8]) {
    let differs = answer.iter().zip(expected).position(|(a, b)| a != b);
    assert_eq!((differs, answer.len()), (None, expected.len()), "{machine}: place of the first difference, length");
}

#[test]
fn a_simulated_drive_is_answered_alike() {
    let Some(xtask) = xtask() else { return };
    let log = include_bytes!("../../firmware-sim/smoke/drive.log");
    assert_equal(&xtask, log, 30);
}

/// Some bytes of every fifth frame are wrong, and the end is cut off.
#[test]
fn a_damaged_log_is_answered_alike() {
    let Some(xtask) = xtask() else { return };
    let mut log = include_bytes!("../../firmware-sim/smoke/drive.log").to_vec();
    for place in (700..log.len()).step_by(5000) {
        log[place] ^= 0x10;
    }
    log.truncate(log.len() - 40);
    assert_equal(&xtask, &log, 20);
}

#[test]
fn a_real_drive_is_answered_alike() {
    let Some(xtask) = xtask() else { return };
    let Some(data) = shared("data/kinematic_ucr_car_2020194_10min") else { return };
    let files = Files {
        rover: data.join("rover.obs.gz"),
        base: data.join("base.obs.gz"),
        navigation: vec![data.join("rover.nav.gz")],
        base_xyz: None,
        base_antenna: None,
        moving_base: false,
    };
    let mut files = files.open().unwrap();
    let mut log = LogWriter::new(Vec::new());
    for input in files.stream() {
        log.input(&input.unwrap()).unwrap();
    }
    assert_equal(&xtask, &log.finish().unwrap(), 300);
}

/// The host's answer of the filter of Section V to a log, and the constrained position at each epoch.
fn host_section_v<T: Real>(log: &[u8]) -> (Vec<u8>, Vec<Vector3<f64>>) {
    let mut frames = LogWriter::new(Vec::new());
    let mut positions = Vec::new();
    replay::<T, _>(&mut LogReader::new("log", log).unwrap(), |answer| {
        let estimate = answer.estimate();
        assert_eq!(estimate.refusal, None);
        positions.push(Vector3::from(estimate.constrained.mean));
        frames.estimate(&estimate, answer.ambiguities())
    })
    .unwrap();
    (frames.finish().unwrap(), positions)
}

/// Thirty seconds at 10 Hz: in double precision on the Cortex-M7, in single precision on the Cortex-M4F, whose position
/// stays within 2 mm of double precision. The answers hold a checksum of both densities.
#[test]
fn the_filter_of_section_v_answers_alike() {
    let Some(xtask) = xtask() else { return };
    let (log, _) = section_v::run(0, 300);
    let (double, positions) = host_section_v::<f64>(&log);
    let (single, single_positions) = host_section_v::<f32>(&log);
    assert_eq!(positions.len(), 300);
    assert_same("an500", &target(&xtask, "section_v64", "an500", &log), &double);
    assert_same("an386", &target(&xtask, "section_v32", "an386", &log), &single);
    let distances = positions.iter().zip(&single_positions).map(|(a, b)| (a - b).norm());
    let worst = distances.fold(0.0, f64::max);
    println!("single precision: {worst:.1e} m from double at most");
    assert!(worst < 0.002, "{worst} m");
}

/// Some frames are damaged on the way; or the first, which holds the setup, so that every epoch is refused.
#[test]
fn a_damaged_log_of_section_v_is_answered_alike() {
    let Some(xtask) = xtask() else { return };
    for (first, setup_is_lost) in [(400, false), (50, true)] {
        let (mut log, _) = section_v::run(1, 40);
        for place in (first..log.len()).step_by(6000) {
            log[place] ^= 0x10;
        }
        let mut answer = LogWriter::new(Vec::new());
        replay::<f64, _>(&mut LogReader::new("log", &log[..]).unwrap(), |epoch| {
            assert_eq!(epoch.outcome.is_err(), setup_is_lost);
            answer.estimate(&epoch.estimate(), epoch.ambiguities())
        })
        .unwrap();
        assert_same("an500", &target(&xtask, "section_v64", "an500", &log), &answer.finish().unwrap());
    }
}

/// The smoothed densities of the firmware's example as bytes; and the position errors, filtered and smoothed, of the
/// epochs that were smoothed `[m]`.
fn host_drive<T: Real>() -> (Vec<u8>, [Vec<Vector3<f64>>; 2]) {
    let mut drive = Box::new(Drive::<T>::new());
    let mut answer = Vec::new();
    let [mut filtered, mut smoothed] = [Vec::new(), Vec::new()];
    let error = |found, epoch| Vector3::from(found) - Vector3::from(drive::position(epoch));
    for epoch in 0..EPOCHS {
        filtered.push(error(drive.advance().unwrap(), epoch));
        if let Some(density) = drive.smooth() {
            let density = density.unwrap();
            smoothed.push(error(drive::position_of(density.mean), epoch - LAG as u32));
            drive::write(density, |bytes| {
                answer.extend_from_slice(bytes);
                Ok::<(), Infallible>(())
            })
            .unwrap();
        }
    }
    filtered.truncate(smoothed.len());
    (answer, [filtered, smoothed])
}

/// What the ring is for: ten epochs later a position is known better. In single precision it is as good.
#[test]
fn smoothing_with_a_lag_makes_the_drive_better() {
    let rms =
        |errors: &[Vector3<f64>]| (errors.iter().map(Vector3::norm_squared).sum::<f64>() / errors.len() as f64).sqrt();
    let [filtered, smoothed] = host_drive::<f64>().1;
    let single = &host_drive::<f32>().1[1];
    assert_eq!(smoothed.len(), EPOCHS as usize - LAG);
    let apart = smoothed.iter().zip(single).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    println!(
        "filtered {:.4} m, smoothed {:.4} m, single precision {apart:.1e} m apart",
        rms(&filtered),
        rms(&smoothed)
    );
    assert!(rms(&smoothed) < 0.7 * rms(&filtered));
    assert!(apart < 0.002);
}

/// In double precision on both cores, in single precision on the Cortex-M4F.
#[test]
fn the_fixed_lag_smoother_answers_alike() {
    let Some(xtask) = xtask() else { return };
    let (double, single) = (host_drive::<f64>().0, host_drive::<f32>().0);
    for machine in MACHINES {
        assert_same(machine, &target(&xtask, "fixed_lag64", machine, &[]), &double);
    }
    assert_same("an386", &target(&xtask, "fixed_lag32", "an386", &[]), &single);
}

/// The answers of both filters between two vehicles as bytes, and their errors `[m]`.
fn host_vehicles<T: Real>() -> (Vec<u8>, [Vec<f64>; 2]) {
    let mut answers = Vec::new();
    let errors = [vehicles::Kind::Plain, vehicles::Kind::Adaptive].map(|kind| {
        let mut drive = Box::new(vehicles::Drive::<T>::new(kind));
        let epochs = (0..vehicles::EPOCHS).map(|epoch| {
            let sights = drive.observe();
            let answer = drive.advance(&sights).unwrap();
            vehicles::write(&answer, |bytes| {
                answers.extend_from_slice(bytes);
                Ok::<(), Infallible>(())
            })
            .unwrap();
            (answer.position - vehicles::vector(epoch).0).norm()
        });
        epochs.collect()
    });
    (answers, errors)
}

/// In single precision the answers between two vehicles are those in double precision to a millimetre, once fixed.
#[test]
fn single_precision_is_enough_between_vehicles() {
    let (double, single) = (host_vehicles::<f64>().1, host_vehicles::<f32>().1);
    for (kind, (double, single)) in double.iter().zip(&single).enumerate() {
        let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        let settled = |errors: &[f64]| rms(&errors[20..]);
        println!("{kind}: {:.4} m, in single precision {:.4} m", settled(double), settled(single));
        assert!(settled(double) < 0.03 && (settled(single) - settled(double)).abs() < 0.001);
    }
}

/// In double precision on both cores, in single precision on the Cortex-M4F. The program itself fails where the adaptive
/// filter takes more than a quarter more instructions than the plain one.
#[test]
fn the_filter_between_vehicles_answers_alike() {
    let Some(xtask) = xtask() else { return };
    let (double, single) = (host_vehicles::<f64>().0, host_vehicles::<f32>().0);
    for machine in MACHINES {
        assert_same(machine, &target(&xtask, "moving_base64", machine, &[]), &double);
    }
    assert_same("an386", &target(&xtask, "moving_base32", "an386", &[]), &single);
}

/// The answers of precise point positioning as bytes; and for each kind of drive the answers and their errors `[m]`.
fn host_ppp() -> (Vec<u8>, [Vec<(PppSolution, f64)>; 4]) {
    let mut drive = Box::new(ppp::Drive::new());
    let mut bytes = Vec::new();
    let answers = ppp::Kind::ALL.map(|kind| {
        drive.start(kind);
        let epochs = (0..ppp::EPOCHS).map(|_| {
            let observations = drive.observe();
            let answer = drive.advance(&observations);
            ppp::write(&answer, |more| {
                bytes.extend_from_slice(more);
                Ok::<(), Infallible>(())
            })
            .unwrap();
            (answer, drive.error(&answer))
        });
        epochs.collect()
    });
    (bytes, answers)
}

/// The made-up drive is one that means something: the position is found within three standard deviations, and what goes wrong
/// in it is noticed: a wrong code and a slip, which both end an arc, and one jump of the clock.
#[test]
fn the_made_up_sky_of_ppp_gives_positions() {
    for (kind, answers) in ppp::Kind::ALL.into_iter().zip(host_ppp().1) {
        let (last, error) = answers.last().unwrap();
        let sigma = last.solution.position_covariance.trace().sqrt();
        let of = |count: fn(&PppSolution) -> usize| answers.iter().map(move |(answer, _)| count(answer));
        let used = |answer: &PppSolution| answer.solution.satellites_used.len();
        let slipped = of(|answer| answer.solution.satellites_slipped.len()).sum::<usize>();
        let rejected = of(|answer| answer.solution.satellites_rejected.len()).sum::<usize>();
        let jumps = of(|answer| usize::from(answer.clock_jump != 0.0)).sum::<usize>();
        let left_out = of(|answer| usize::from(answer.overflow)).sum::<usize>();
        println!(
            "{}: {error:.4} m, sigma {sigma:.4} m, {:?} to {:?} satellites, {slipped} slipped, {rejected} rejected, \
             {jumps} jumps, {left_out} without room",
            kind.name(),
            of(used).min(),
            of(used).max()
        );
        assert!(*error < 3.0 * sigma && sigma < 1.0);
        assert!(answers.iter().all(|(answer, _)| answer.solution.quality == Quality::Float));
        assert!(slipped >= 2 && rejected >= 1 && jumps == 1 && left_out == 0);
    }
}

/// In double precision on both cores.
#[test]
fn precise_point_positioning_answers_alike() {
    let Some(xtask) = xtask() else { return };
    let (expected, _) = host_ppp();
    for machine in MACHINES {
        assert_same(machine, &target(&xtask, "ppp64", machine, &[]), &expected);
    }
}
