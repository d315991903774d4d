//! Bad input as a user meets it: each either is refused with exit code 3 and a message that names file, place and
//! remedy, or is dropped and counted while the rest is processed (exit code 0).
//!
//! Every test spoils one of the files of a short simulation.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use surefix::log::LogWriter;
use surefix::process::stream::Input;
use surefix::simulate::files::Files;
use surefix::simulate::scenario::{MotionKind, Scenario};
use surefix::simulate::{Simulation, simulate};
use surefix_core::log::Header;
use tempfile::TempDir;

/// Epochs of the simulation.
const EPOCHS: usize = 10;

/// Ten epochs of a rover at rest, one a second, that starts `seconds` late.
fn scenario(seconds: f64) -> Scenario {
    let mut scenario = Scenario { duration_s: (EPOCHS - 1) as f64, ..Scenario::default() };
    scenario.tow_s += seconds;
    scenario.rover.motion.kind = MotionKind::Static;
    for receiver in [&mut scenario.rover.receiver, &mut scenario.base.receiver] {
        receiver.interval_s = 1.0;
        receiver.slips.per_hour = 0.0;
        receiver.outages.clear();
    }
    scenario
}

/// A directory with the files of a simulation, to be spoiled.
struct Workspace {
    directory: TempDir,
    simulation: Simulation,
}

impl Workspace {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let scenario = scenario(0.0);
        let simulation = simulate(&scenario).unwrap();
        Files::write(directory.path(), &scenario, &simulation).unwrap();
        Self { directory, simulation }
    }

    fn path(&self) -> &Path {
        self.directory.path()
    }

    fn read(&self, file: &str) -> String {
        fs::read_to_string(self.path().join(file)).unwrap()
    }

    fn write(&self, file: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path().join(file), content).unwrap();
    }

    fn surefix(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_surefix")).current_dir(self.path()).args(arguments).output().unwrap()
    }

    /// `surefix post` of rover, base and navigation into `out`, with more arguments.
    fn post(&self, more: &[&str]) -> Output {
        self.surefix(&[&["post", "rover.obs", "base.obs", "broadcast.nav", "-o", "out"], more].concat())
    }

    /// The table of solutions that `post` wrote.
    fn solutions(&self) -> String {
        self.read("out/rover.csv")
    }

    /// How many records the summary says were dropped for a reason.
    fn dropped(&self, reason: &str) -> u64 {
        let summary: serde_json::Value = serde_json::from_str(&self.read("out/rover.json")).unwrap();
        let dropped = summary["dropped"].as_object().unwrap();
        dropped.iter().filter(|(name, _)| name.ends_with(reason)).map(|(_, count)| count.as_u64().unwrap()).sum()
    }
}

#[track_caller]
fn refused(output: &Output, parts: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.lines().any(|line| line.starts_with("error: ")), "{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[track_caller]
fn done(output: &Output) -> String {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{message}");
    message
}

/// Header and epochs of an observation file.
fn epochs(text: &str) -> (String, Vec<String>) {
    let mut parts = text.split("\n>");
    let header = format!("{}\n", parts.next().unwrap());
    (header, parts.map(|epoch| format!(">{}\n", epoch.trim_end())).collect())
}

#[test]
fn the_files_are_good_before_they_are_spoiled() {
    let workspace = Workspace::new();
    let output = workspace.post(&[]);
    done(&output);
    assert_eq!(workspace.solutions().lines().count(), 1 + EPOCHS);
    assert!(!workspace.solutions().contains(",none,"), "{}", workspace.solutions());
}

#[test]
fn a_missing_file() {
    let workspace = Workspace::new();
    for file in ["rover.obs", "base.obs", "broadcast.nav"] {
        let content = workspace.read(file);
        fs::remove_file(workspace.path().join(file)).unwrap();
        refused(&workspace.post(&[]), &[file, "cannot be opened", "check the path"]);
        workspace.write(file, content);
    }
    refused(&workspace.surefix(&["replay", "none.log"]), &["none.log: cannot be opened", "check the path"]);
    refused(&workspace.post(&["--config", "none.toml"]), &["none.toml: cannot be read"]);
}

#[test]
fn an_empty_file() {
    let workspace = Workspace::new();
    for file in ["rover.obs", "base.obs", "broadcast.nav"] {
        let content = workspace.read(file);
        workspace.write(file, "");
        refused(&workspace.post(&[]), &[file, "is empty", "downloaded or written to the end?"]);
        workspace.write(file, content);
    }
    workspace.write("device.log", "");
    refused(&workspace.surefix(&["replay", "device.log"]), &["device.log: is empty"]);
}

#[test]
fn a_file_that_ends_in_the_middle_of_an_epoch() {
    let workspace = Workspace::new();
    let (header, epochs) = epochs(&workspace.read("rover.obs"));
    let half = epochs[4].len() / 2;
    workspace.write("rover.obs", format!("{header}{}{}", epochs[..4].concat(), &epochs[4][..half]));
    let message = done(&workspace.post(&[]));
    assert!(message.contains("records cut off by the end of the file (first at line"), "{message}");
    assert_eq!(workspace.solutions().lines().count(), 1 + 5);
    assert!(workspace.dropped("records cut off by the end of the file") > 0);
}

#[test]
fn a_file_of_another_kind() {
    let workspace = Workspace::new();
    let kind = |files: [&str; 3]| workspace.surefix(&["post", files[0], files[1], files[2], "-o", "out"]);
    let navigation =
        ["broadcast.nav: this is a navigation file, where an observation file is needed", "give it as NAV"];
    refused(&kind(["broadcast.nav", "base.obs", "broadcast.nav"]), &navigation);
    refused(&kind(["rover.obs", "broadcast.nav", "broadcast.nav"]), &navigation);
    let observation = ["rover.obs: this is an observation file", "give it as ROVER or BASE"];
    refused(&kind(["rover.obs", "base.obs", "rover.obs"]), &observation);
    refused(&kind(["device.log", "base.obs", "broadcast.nav"]), &["device.log, line 1: is not RINEX"]);
    let replayed = workspace.surefix(&["replay", "rover.obs"]);
    refused(&replayed, &["rover.obs: is not a device log but RINEX", "surefix log pack"]);
}

#[test]
fn line_ends_of_windows_and_bytes_that_are_not_utf8() {
    let workspace = Workspace::new();
    done(&workspace.post(&[]));
    let expected = workspace.solutions();
    for file in ["rover.obs", "base.obs", "broadcast.nav"] {
        let mut bytes = workspace.read(file).replace('\n', "\r\n").into_bytes();
        let comment = [b"\xe9\xff\x80 caf\xe9".as_slice(), &[b' '; 52], b"COMMENT             \r\n"].concat();
        let second_line = bytes.iter().position(|&byte| byte == b'\n').unwrap() + 1;
        bytes.splice(second_line..second_line, comment);
        workspace.write(file, bytes);
    }
    done(&workspace.post(&[]));
    assert_eq!(workspace.solutions(), expected);
}

#[test]
fn epochs_out_of_order_and_duplicated() {
    let workspace = Workspace::new();
    done(&workspace.post(&[]));
    let expected = workspace.solutions();
    for file in ["rover.obs", "base.obs"] {
        let (header, epochs) = epochs(&workspace.read(file));
        let spoiled = [&epochs[..4], &epochs[3..4], &epochs[1..3], &epochs[4..]].concat();
        workspace.write(file, header + &spoiled.concat());
    }
    let message = done(&workspace.post(&[]));
    assert!(message.contains("dropped 2 epochs out of order (first at line"), "{message}");
    assert!(message.contains("dropped 1 duplicated epochs (first at line"), "{message}");
    assert_eq!((workspace.dropped("epochs out of order"), workspace.dropped("duplicated epochs")), (4, 2));
    assert_eq!(workspace.solutions(), expected);
}

#[test]
fn rover_and_base_of_different_times() {
    let workspace = Workspace::new();
    let later = scenario(1_800.0);
    let other = tempfile::tempdir().unwrap();
    let files = Files::write(other.path(), &later, &simulate(&later).unwrap()).unwrap();
    fs::copy(files.base, workspace.path().join("base.obs")).unwrap();
    refused(&workspace.post(&[]), &["rover (", ") and base (", ") do not overlap; give files of the same time"]);
    assert!(!workspace.path().join("out/rover.csv").exists());
}

#[test]
fn no_ephemeris() {
    let workspace = Workspace::new();
    let navigation = workspace.read("broadcast.nav");
    let end = "END OF HEADER";
    let header = navigation[..navigation.find(end).unwrap() + end.len()].to_owned() + "       \n";
    workspace.write("broadcast.nav", header);
    refused(&workspace.post(&[]), &["there is no broadcast ephemeris; give a navigation file"]);

    let later = scenario(86_400.0);
    let other = tempfile::tempdir().unwrap();
    let files = Files::write(other.path(), &later, &simulate(&later).unwrap()).unwrap();
    fs::copy(files.navigation, workspace.path().join("broadcast.nav")).unwrap();
    refused(
        &workspace.post(&[]),
        &["no ephemeris is of the time of the rover (", "give the navigation file of that day"],
    );
}

#[test]
fn observables_that_are_zero_or_absurd() {
    let workspace = Workspace::new();
    let (header, mut epochs) = epochs(&workspace.read("rover.obs"));
    // The first code of the first satellite: 14 columns behind its name. RINEX says that 0 means no value.
    for (epoch, value) in [(2, 0.0), (3, 7.0), (4, 9_999_999_999.0), (5, -20_000_000.0)] {
        let first = epochs[epoch].find('\n').unwrap() + 1 + 3;
        epochs[epoch].replace_range(first..first + 14, &format!("{value:14.3}"));
    }
    workspace.write("rover.obs", header + &epochs.concat());
    let message = done(&workspace.post(&[]));
    assert!(message.contains("dropped 3 absurd values (first at line"), "{message}");
    assert_eq!(workspace.dropped("absurd values"), 3);
    assert_eq!(workspace.solutions().lines().count(), 1 + EPOCHS);
}

#[test]
fn numbers_in_a_device_log_that_are_none() {
    let workspace = Workspace::new();
    let Simulation { base_position, ephemerides, base, mut rover, .. } = workspace.simulation.clone();
    rover[3].observations[0].code = Some(f64::NAN);
    rover[4].observations[1].phase = Some(f64::INFINITY);
    rover[5].observations[2].doppler = Some(f64::NAN);
    let mut log = LogWriter::new(Vec::new());
    log.input(&Input::Header(Header { base_position: Some(base_position.into()), ..Header::default() })).unwrap();
    ephemerides.into_iter().for_each(|ephemeris| log.input(&Input::Ephemeris(ephemeris)).unwrap());
    for (rover, base) in rover.into_iter().zip(base) {
        log.input(&Input::Base(base)).unwrap();
        log.input(&Input::Rover(rover)).unwrap();
    }
    workspace.write("device.log", log.finish().unwrap());
    let output = workspace.surefix(&["replay", "device.log"]);
    let message = done(&output);
    assert!(message.contains("device.log: 0 damaged frames, 0 incomplete epochs, 3 values not finite"), "{message}");
    let result = String::from_utf8_lossy(&output.stdout);
    assert!(result.contains(&format!("{EPOCHS} epochs, {EPOCHS} with a position")), "{result}");
}

#[test]
fn a_device_log_that_was_cut_off() {
    let workspace = Workspace::new();
    let log = fs::read(workspace.path().join("device.log")).unwrap();
    workspace.write("device.log", &log[..log.len() * 2 / 3]);
    let message = done(&workspace.surefix(&["replay", "device.log"]));
    assert!(message.contains("device.log: ") && message.contains("the end is missing"), "{message}");
    assert!(message.contains("`surefix log dump` shows the places"), "{message}");

    workspace.write("device.log", &log[..10]);
    refused(&workspace.surefix(&["replay", "device.log"]), &["device.log: not one of its 10 bytes belongs to"]);
}

#[test]
fn a_base_coordinate_that_is_elsewhere() {
    let workspace = Workspace::new();
    let base = workspace.simulation.base_position;
    let east = nalgebra::Vector3::new(-base.y, base.x, 0.0).normalize();
    let [x, y, z] = <[f64; 3]>::from(base + 100e3 * east).map(|coordinate| coordinate.to_string());
    let message =
        ["the base coordinate is 100.0 km from where the observations of the base put it", "--base-xyz X Y Z"];
    let output = workspace.post(&["--base-xyz", &x, &y, &z]);
    refused(&output, &message);
    assert!(!workspace.path().join("out/rover.csv").exists());
    refused(&workspace.post(&["--base-xyz", "49.1", "12.9", "666"]), &["is not near the ground; give ECEF metres"]);
}

#[test]
fn a_base_without_a_coordinate() {
    let workspace = Workspace::new();
    let base = workspace.read("base.obs");
    let without: Vec<&str> = base.lines().filter(|line| !line.contains("APPROX POSITION XYZ")).collect();
    workspace.write("base.obs", without.join("\n") + "\n");
    let remedy = ["base.obs: its header has no APPROX POSITION XYZ", "give the coordinate by --base-xyz X Y Z"];
    refused(&workspace.post(&[]), &remedy);
    let xyz: [f64; 3] = workspace.simulation.base_position.into();
    let [x, y, z] = xyz.map(|coordinate| coordinate.to_string());
    done(&workspace.post(&["--base-xyz", &x, &y, &z]));
}

#[test]
fn settings_that_make_no_sense() {
    let workspace = Workspace::new();
    workspace.write("settings.toml", "elevation_mask_deg = 10.0\nfix_ration = 3.0\n");
    let unknown = ["settings.toml: ", "line 2", "unknown field `fix_ration`", "`fix_ratio`"];
    refused(&workspace.post(&["--config", "settings.toml"]), &unknown);
    workspace.write("settings.toml", "elevation_mask_deg = 100.0\n");
    refused(&workspace.post(&["--config", "settings.toml"]), &["elevation_mask_deg = 100: give degrees from 0"]);
    for (text, message) in [
        (
            "fix_partial = \"decorrelated\"\nfix_assist = true\n",
            "fix_partial = Decorrelated: fixes combinations, which",
        ),
        ("[integrity.fault]\np_fa = 1.0\n", "integrity: fault.p_fa and fault.p_md are probabilities: give numbers"),
        ("[baseline_length]\nlength = 1.0\nsigma = 1.0\nuse = \"measure\"\n", "baseline_length.sigma = 1: give metres"),
    ] {
        workspace.write("settings.toml", text);
        refused(&workspace.post(&["--config", "settings.toml"]), &["settings.toml: ", message]);
    }
    refused(&workspace.post(&["--bands", "G1X"]), &["bands = \"G1X\": write L1, L1L2, L1L2L5", "\"G12 E15\""]);
    let usage = workspace.surefix(&["post", "rover.obs"]);
    assert_eq!(usage.status.code(), Some(2));
}
