//! `surefix simulate`, `compare` and `demo` as a user runs them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn surefix(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_surefix")).current_dir(directory).args(arguments).output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_scenario_becomes_the_same_files_every_time() {
    let directory = tempfile::tempdir().unwrap();
    let default = surefix(directory.path(), &["simulate", "--print-default"]);
    assert!(default.status.success());
    let scenario = stdout(&default).replace("duration_s = 600.0", "duration_s = 20.0");
    fs::write(directory.path().join("short.toml"), scenario).unwrap();
    for target in ["a", "b"] {
        let output = surefix(directory.path(), &["simulate", "short.toml", "-o", target]);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    for file in ["rover.obs", "base.obs", "broadcast.nav", "device.log", "truth.csv", "slips.csv", "scenario.toml"] {
        let [a, b] = ["a", "b"].map(|target| fs::read(directory.path().join(target).join(file)).unwrap());
        // RINEX names the time of writing.
        let without_date = |bytes: &[u8]| {
            let text = String::from_utf8_lossy(bytes).into_owned();
            text.lines().filter(|line| !line.contains("PGM / RUN BY / DATE")).collect::<Vec<_>>().join("\n")
        };
        assert_eq!(without_date(&a), without_date(&b), "{file}");
        assert!(!a.is_empty(), "{file}");
    }
    let truth = surefix(directory.path(), &["compare", "a/truth.csv", "b/truth.csv"]);
    assert!(truth.status.success() && stdout(&truth).contains("fix rate       100.00 %"), "{}", stdout(&truth));
}

#[test]
fn the_demo_fixes_and_is_right() {
    let directory = tempfile::tempdir().unwrap();
    let output = surefix(directory.path(), &["demo"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let arguments = ["compare", "surefix-demo/rover.pos", "surefix-demo/truth.csv", "--json"];
    let compared = surefix(directory.path(), &arguments);
    let report: serde_json::Value = serde_json::from_slice(&compared.stdout).unwrap();
    // A drive in good view: what is fixed is right, and nearly all is fixed, slips or not.
    assert!(report["fix_rate"].as_f64().unwrap() > 0.97, "{report}");
    assert_eq!(report["wrong_fixes"], 0, "{report}");
    // The CSV gives the same comparison as the .pos, up to the latter's digits.
    let arguments = ["compare", "surefix-demo/rover.csv", "surefix-demo/truth.csv", "--json"];
    let csv: serde_json::Value = serde_json::from_slice(&surefix(directory.path(), &arguments).stdout).unwrap();
    let rms = |report: &serde_json::Value| report["all"]["rms_3d_m"].as_f64().unwrap();
    assert!((rms(&csv) - rms(&report)).abs() < 1e-4, "{csv} {report}");
    assert_eq!(csv["first_fix_s"], report["first_fix_s"]);
}

#[test]
fn what_cannot_be_used_is_named_with_a_remedy() {
    let directory = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &[u8]| fs::write(directory.path().join(name), content).unwrap();
    file("good.csv", b"week,tow,x,y,z\n2000,1,4000000,800000,4900000\n");
    file("later.csv", b"week,tow,x,y,z\n2000,100,4000000,800000,4900000\n");
    file("no-week.csv", b"tow,x,y,z\n1,4000000,800000,4900000\n");
    file("empty.pos", b"");
    file("noise.pos", b"\xff\xfe\x00 these are\r\nno positions\r\n");
    file("cut.pos.gz", b"\x1f\x8b\x08\x00\x00");
    file("wrong.toml", b"[rover]\nspeed = 3\n");
    file("nan.toml", b"duration_s = nan\n");
    for (arguments, code, messages) in [
        (&["compare", "missing.pos", "good.csv"][..], 3, &["missing.pos", "check the path"][..]),
        (&["compare", "empty.pos", "good.csv"], 3, &["empty.pos", "has no position"]),
        (&["compare", "noise.pos", "good.csv"], 3, &["noise.pos", "first at line 1"]),
        (&["compare", "cut.pos.gz", "good.csv"], 3, &["cut.pos.gz"]),
        (&["compare", "no-week.csv", "good.csv"], 3, &["no-week.csv, line 1", "--week"]),
        (&["compare", "good.csv"], 2, &["TRUTH"]),
        (&["simulate", "missing.toml"], 3, &["missing.toml", "check the path"]),
        (&["simulate", "wrong.toml"], 3, &["wrong.toml", "`rover.speed`", "--print-default"]),
        (&["simulate", "nan.toml"], 3, &["duration_s is NaN"]),
        (&["simulate"], 2, &["SCENARIO"]),
    ] {
        let output = surefix(directory.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", stderr(&output));
        for message in messages {
            assert!(stderr(&output).contains(message), "{arguments:?}: {}", stderr(&output));
        }
    }
    let apart = surefix(directory.path(), &["compare", "good.csv", "later.csv"]);
    assert_eq!(apart.status.code(), Some(1));
    assert!(stdout(&apart).contains("no epoch has a truth"));
}

#[test]
fn help_says_what_there_is() {
    let directory = tempfile::tempdir().unwrap();
    for (command, words) in [
        ("compare", ["--truth-llh", "--wrong-threshold", "Examples"]),
        ("simulate", ["--print-default", "--seed", "Examples"]),
        ("demo", ["--output", "--seed", "tunnel"]),
    ] {
        let help = stdout(&surefix(directory.path(), &[command, "--help"]));
        assert!(words.iter().all(|word| help.contains(word)), "{help}");
    }
}
