//! Host against target: the firmware's answer to a device log is the host's, byte for byte, on both simulated cores.
//!
//! The firmware is built and run by the task runner, whose path `cargo xtask test` gives in `SUREFIX_XTASK`. Under plain
//! `cargo test` these tests skip, as they need a Cortex-M toolchain and QEMU.

use std::path::{Path, PathBuf};
use std::process::Command;
use surefix::cli::files::Files;
use surefix::log::{LogInputs, LogWriter};
use surefix::process::run::Engine;
use surefix_core::rtk::RtkConfig;
use surefix_tests::shared;

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

/// The answer of the firmware on a machine.
fn target(xtask: &Path, machine: &str, log: &[u8]) -> Vec<u8> {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = |what: &str| directory.join(format!("host_target_{}_{machine}_{what}.log", log.len()));
    let (question, answer) = (file("question"), file("answer"));
    std::fs::write(&question, log).unwrap();
    let run = Command::new(xtask)
        .args(["replay", "--machine", machine, "--output"])
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
        let answer = target(xtask, machine, log);
        let differs = answer.iter().zip(&expected).position(|(a, b)| a != b);
        assert_eq!((differs, answer.len()), (None, expected.len()), "{machine}: place of the first difference, length");
    }
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
    };
    let mut files = files.open().unwrap();
    let mut log = LogWriter::new(Vec::new());
    for input in files.stream() {
        log.input(&input.unwrap()).unwrap();
    }
    assert_equal(&xtask, &log.finish().unwrap(), 300);
}
