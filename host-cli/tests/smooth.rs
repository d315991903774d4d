//! `surefix post … --smooth` and `surefix replay … --smooth` as a user runs them, on two minutes of a simulated drive with
//! GPS on one band, of which the filter fixes not even half.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use surefix::simulate::files::Files;
use surefix::simulate::scenario::Scenario;
use surefix::simulate::simulate;
use tempfile::TempDir;

fn simulated() -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let mut scenario = Scenario { duration_s: 119.0, ..Scenario::default() };
    for receiver in [&mut scenario.rover.receiver, &mut scenario.base.receiver] {
        receiver.interval_s = 1.0;
        receiver.outages.clear();
    }
    Files::write(directory.path(), &scenario, &simulate(&scenario).unwrap()).unwrap();
    directory
}

fn surefix(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_surefix")).current_dir(directory).args(arguments).output().unwrap()
}

const POST: [&str; 6] = ["post", "rover.obs", "base.obs", "broadcast.nav", "--bands", "G1"];

#[track_caller]
fn done(directory: &Path, arguments: &[&str], more: &[&str]) -> String {
    let output = surefix(directory, &[arguments, more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[track_caller]
fn refused(directory: &Path, arguments: &[&str], code: i32, parts: &[&str]) {
    let output = surefix(directory, arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Rms of the errors of all epochs `[m]` and the rate of fixed ones.
fn errors(directory: &Path, solution: &str) -> (f64, f64) {
    let report = done(directory, &["compare", solution, "truth.csv", "--json"], &[]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["wrong_fixes"], 0, "{report}");
    (report["all"]["rms_3d_m"].as_f64().unwrap(), report["fix_rate"].as_f64().unwrap())
}

#[test]
fn every_epoch_gains_from_all_others() {
    let directory = simulated();
    let path = directory.path();
    let forward = done(path, &POST, &["-o", "forward"]);
    assert!(!forward.contains("smoothing"), "{forward}");
    assert!(json(&path.join("forward/rover.json")).get("smoothing").is_none());

    let text = done(path, &POST, &["-o", "smoothed", "--smooth", "--em"]);
    for part in ["smoothing", "integers", "innovations²/σ²", "(1 is expected)", "noise", "learned"] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    let summary = json(&path.join("smoothed/rover.json"));
    assert_eq!(summary["epochs"], 120);
    let smoothing = &summary["smoothing"];
    let parameters = smoothing["parameters"].as_array().unwrap();
    assert!(parameters.iter().any(|parameter| parameter["learned"] == true && parameter["start"] != parameter["end"]));
    let likelihoods = smoothing["negative_log_likelihood"].as_array().unwrap();
    assert!(likelihoods.len() > 1, "{smoothing}");
    for types in smoothing["consistency"].as_array().unwrap() {
        let mean = types["mean"].as_f64().unwrap();
        assert!((0.5..2.0).contains(&mean), "{types}");
    }
    assert!(smoothing["arcs"]["fixed"].as_u64().unwrap() > 0, "{smoothing}");
    assert!(smoothing["engine"]["epochs"].as_u64().unwrap() > 0, "{smoothing}");

    let ((forward, forward_rate), (smoothed, rate)) =
        (errors(path, "forward/rover.csv"), errors(path, "smoothed/rover.csv"));
    // Forward it takes a minute and more until the integers are known; backward they are known from the first epoch on.
    assert!(forward_rate < 0.5 && forward > 1.0, "{forward_rate} {forward}");
    assert!(rate == 1.0 && smoothed < 0.05, "{rate} {smoothed}");
}

#[test]
fn integers_and_starts_are_as_the_settings_say() {
    let directory = simulated();
    let path = directory.path();
    // Without `robust` nothing is learned after the starts.
    let settings = "[smoothing]\nem_starts = [[1e-3, 1e3]]\nrobust = false\ninteger_scope = \"epoch\"\n\
                    integer_search = \"bootstrapping\"\n";
    fs::write(path.join("settings.toml"), settings).unwrap();
    let text = done(path, &POST, &["-o", "out", "--smooth", "--em", "--config", "settings.toml"]);
    for part in ["starts            motion ×1, measurements ×1: ", "motion ×0.001, measurements ×1000: ", " (taken)"]
    {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    let smoothing = &json(&path.join("out/rover.json"))["smoothing"];
    let starts = smoothing["starts"].as_array().unwrap();
    let [configured, further] = [0, 1].map(|i| starts[i]["negative_log_likelihood"].as_f64().unwrap());
    let taken = [0, 1].map(|i| starts[i]["taken"].as_bool().unwrap());
    assert_eq!(taken, [configured <= further, configured > further], "{smoothing}");
    assert_eq!(starts[1]["measurements"], 1e3);
    let last = smoothing["negative_log_likelihood"].as_array().unwrap().last().unwrap().as_f64().unwrap();
    let likeliest = configured.min(further);
    assert!((last - likeliest).abs() < 1e-6 * likeliest.abs(), "it goes on from the likeliest: {smoothing}");
    let (_, rate) = errors(path, "out/rover.csv");
    assert!(rate > 0.5, "{rate}");
}

#[test]
fn a_device_log_gives_the_same_positions() {
    let directory = simulated();
    let path = directory.path();
    done(path, &POST, &["-o", "out", "--smooth"]);
    done(path, &["log", "pack"], &[&POST[1..], &["-o", "drive.sfl"]].concat());
    done(path, &["replay", "drive.sfl", "-r", "out", "--smooth"], &[]);
    let table = |name: &str| fs::read_to_string(path.join("out").join(name)).unwrap();
    assert_eq!(table("drive.csv"), table("rover.csv"));
    assert_eq!(json(&path.join("out/drive.json"))["smoothing"], json(&path.join("out/rover.json"))["smoothing"]);
}

#[test]
fn wrong_wishes_are_refused_with_a_remedy() {
    let directory = simulated();
    let path = directory.path();
    let with = |more: &[&'static str]| [&POST[..], more].concat();
    refused(path, &with(&["--em"]), 2, &["--smooth"]);
    refused(path, &["replay", "device.log", "--smooth"], 3, &["give a directory by --results DIR"]);
    refused(path, &with(&["--smooth", "-o", "rover.obs"]), 3, &["rover.obs: the directory cannot be made"]);
    refused(path, &["replay", "none.sfl", "--smooth", "-r", "out"], 3, &["none.sfl: cannot be opened"]);
    fs::write(path.join("settings.toml"), "[smoothing]\nmemory_mib = 0\n").unwrap();
    let settings = ["--smooth", "--config", "settings.toml"];
    refused(path, &with(&settings), 3, &["settings.toml: smoothing.memory_mib = 0: give a number above 0"]);
    fs::write(path.join("settings.toml"), "[smoothing]\nem_starts = [[0.1, -10.0]]\n").unwrap();
    refused(
        path,
        &with(&settings),
        3,
        &["settings.toml: smoothing.em_starts = -10: give pairs of factors", "[[0.1, 10.0]]"],
    );
    fs::write(path.join("settings.toml"), "[smoothing]\ninteger_scope = \"day\"\n").unwrap();
    refused(path, &with(&settings), 3, &["settings.toml: ", "line 2", "integer_scope", "expected `epoch` or `arc`"]);
    fs::write(path.join("settings.toml"), "[smoothing]\nmemory = 100\n").unwrap();
    refused(path, &with(&settings), 3, &["settings.toml: ", "line 2", "unknown field `memory`", "`memory_mib`"]);
    fs::write(path.join("base.obs"), "").unwrap();
    refused(path, &with(&["--smooth", "-o", "out"]), 3, &["base.obs", "is empty"]);
    assert!(!path.join("out").exists() || fs::read_dir(path.join("out")).unwrap().count() == 0);
}
