//! `surefix log` as a user runs it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn surefix(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_surefix")).current_dir(directory).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn line(content: &str, label: &str) -> String {
    format!("{content:<60}{label:<20}\n")
}

/// An observation file of two GPS satellites at second 0 and 1 of an hour.
fn observations(hour: u32, xyz: &str) -> String {
    let mut file = line("     3.03           OBSERVATION DATA    G", "RINEX VERSION / TYPE")
        + &line(xyz, "APPROX POSITION XYZ")
        + &line("        1.5000        0.0000        0.0000", "ANTENNA: DELTA H/E/N")
        + &line("G    2 C1C L1C", "SYS / # / OBS TYPES")
        + &line("", "END OF HEADER");
    for second in 0..2 {
        file += &format!("> 2020 07 12 {hour:02} 00 {second:>2}.0000000  0  2\n");
        file += "G05  21345678.123   112345678.456 7\nG12  23345678.001   122345678.999 7\n";
    }
    file
}

/// A navigation file of one GPS message with that time of ephemeris.
fn navigation() -> String {
    let mut file =
        line("     3.03           N: GNSS NAV DATA    G: GPS", "RINEX VERSION / TYPE") + &line("", "END OF HEADER");
    file += "G05 2020 07 12 02 00 00 1.000000000000e-05 0.000000000000e+00 0.000000000000e+00\n";
    for orbit in [
        [33.0, 1.0, 4.0e-9, 0.5],
        [1.0e-6, 0.01, 5.0e-6, 5153.7],
        [7200.0, 1.0e-8, -1.0, 1.0e-8],
        [0.97, 200.0, 0.9, -8.0e-9],
        [1.0e-10, 1.0, 2114.0, 0.0],
        [2.0, 0.0, -1.0e-8, 33.0],
        [7000.0, 4.0, 0.0, 0.0],
    ] {
        let fields: String = orbit.iter().map(|&x: &f64| format!("{:>19}", exponent(x))).collect();
        file += &format!("    {fields}\n");
    }
    file
}

/// As Fortran's D19.12 has it, with a two-digit exponent.
fn exponent(x: f64) -> String {
    let text = format!("{x:.12e}");
    let (mantissa, exponent) = text.split_once('e').unwrap();
    format!("{mantissa}e{:+03}", exponent.parse::<i32>().unwrap())
}

const BASE: &str = "  3582105.2910   532589.7313  5232754.8054";

fn directory() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("rover.obs"), observations(1, BASE)).unwrap();
    fs::write(directory.path().join("base.obs"), observations(1, BASE)).unwrap();
    fs::write(directory.path().join("brdc.nav"), navigation()).unwrap();
    directory
}

const PACK: [&str; 7] = ["log", "pack", "rover.obs", "base.obs", "brdc.nav", "-o", "drive.sfl"];

#[test]
fn files_are_packed_and_dumped() {
    let directory = directory();
    let packed = surefix(directory.path(), &PACK);
    assert_eq!(packed.status.code(), Some(0), "{}", text(&packed.stderr));
    assert!(text(&packed.stderr).contains("is that in the header of base.obs"), "{}", text(&packed.stderr));
    let dumped = surefix(directory.path(), &["log", "dump", "drive.sfl"]);
    assert_eq!((dumped.status.code(), text(&dumped.stderr)), (Some(0), ""));
    let kinds: Vec<_> = text(&dumped.stdout).lines().map(|line| line.split_whitespace().nth(1).unwrap()).collect();
    assert_eq!(kinds, ["config", "header", "ephemeris", "base", "rover", "base", "rover", "event"]);

    let json = surefix(directory.path(), &["log", "dump", "--json", "drive.sfl"]);
    let records: Vec<serde_json::Value> =
        text(&json.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(records[1]["base_position"][0], 3_582_105.291);
    assert_eq!(records[1]["base_antenna"][0], 1.5);
    assert_eq!(records[4]["observations"][1]["phase_cycles"], 122_345_678.999);

    let csv = surefix(directory.path(), &["log", "dump", "--csv", "drive.sfl"]);
    let row = text(&csv.stdout).lines().nth(3).unwrap().to_owned();
    assert_eq!(row, "2114,3600,rover,G05,1C,21345678.123,112345678.456,,44.5,0,0");
}

#[test]
fn a_coordinate_that_is_given_is_used() {
    let directory = directory();
    let given = ["--base-xyz", "-3582105.5", "532589.25", "5232754.125", "--base-antenna", "-0.25", "0", "0"];
    let packed = surefix(directory.path(), &[&PACK[..], &given].concat());
    assert_eq!(packed.status.code(), Some(0));
    assert!(text(&packed.stderr).contains("--base-xyz is 7164.2 km from the approximate position"));
    let dumped = surefix(directory.path(), &["log", "dump", "drive.sfl"]);
    assert!(text(&dumped.stdout).contains("base -3582105.5000 532589.2500 5232754.1250"));
    assert!(text(&dumped.stdout).contains("antennas above markers: base -0.2500 rover 1.5000"));
    let on_the_moon = surefix(directory.path(), &[&PACK[..], &["--base-xyz", "384400000", "0", "0"]].concat());
    assert_eq!(on_the_moon.status.code(), Some(3));
    assert!(text(&on_the_moon.stderr).contains("not near the ground; give ECEF metres"));
}

#[test]
fn files_that_do_not_go_together_make_no_log() {
    let directory = directory();
    let refused = |message: &str| {
        let packed = surefix(directory.path(), &PACK);
        assert_eq!(packed.status.code(), Some(3));
        assert!(text(&packed.stderr).contains(message), "{}", text(&packed.stderr));
        assert!(!fs::exists(directory.path().join("drive.sfl")).unwrap());
        assert!(!fs::exists(directory.path().join("drive.sfl.partial")).unwrap());
    };
    fs::write(directory.path().join("base.obs"), observations(5, BASE)).unwrap();
    refused("rover (2020-07-12 01:00:00–2020-07-12 01:00:01) and base (2020-07-12 05:00:00–");
    fs::write(directory.path().join("base.obs"), observations(1, "")).unwrap();
    refused("base.obs: its header has no APPROX POSITION XYZ; give the coordinate by --base-xyz X Y Z");
    fs::write(directory.path().join("base.obs"), observations(9, BASE)).unwrap();
    fs::write(directory.path().join("rover.obs"), observations(9, BASE)).unwrap();
    refused("no ephemeris is of the time of the rover");
    fs::write(directory.path().join("base.obs"), navigation()).unwrap();
    refused("base.obs: this is a navigation file, where an observation file is needed");
}

#[test]
fn damage_is_shown_where_it_is_and_exits_with_1() {
    let directory = directory();
    surefix(directory.path(), &PACK);
    let path = directory.path().join("drive.sfl");
    let log = fs::read(&path).unwrap();

    let mut damaged = log.clone();
    damaged[40] ^= 0x10;
    fs::write(&path, &damaged).unwrap();
    let dumped = surefix(directory.path(), &["log", "dump", "drive.sfl"]);
    assert_eq!(dumped.status.code(), Some(1));
    assert!(text(&dumped.stdout).starts_with("         1  BAD         checksum is wrong"));
    assert_eq!(text(&dumped.stdout).lines().count(), 8);
    let message = "drive.sfl: 1 of 8 frames are damaged (1 wrong checksum), the first at byte 1; all others are intact";
    assert!(text(&dumped.stderr).contains(message), "{}", text(&dumped.stderr));

    fs::write(&path, &log[..log.len() - 30]).unwrap();
    let dumped = surefix(directory.path(), &["log", "dump", "drive.sfl"]);
    assert_eq!(dumped.status.code(), Some(1));
    assert!(text(&dumped.stdout).contains("cut off by the end of the file"));
    assert!(text(&dumped.stderr).contains("drive.sfl: has no end mark: it was cut off, or the device lost power"));

    let rinex = surefix(directory.path(), &["log", "dump", "rover.obs"]);
    assert_eq!(rinex.status.code(), Some(3));
    assert!(text(&rinex.stderr).contains("rover.obs: is not a device log but RINEX"), "{}", text(&rinex.stderr));
}
