//! `surefix study` as its user sees it.

use std::path::Path;
use std::process::{Command, Output};

fn study(directory: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_surefix"));
    command.args(["study", "mixed-integer", "-o"]).arg(directory).args(arguments).output().unwrap()
}

/// The same numbers from one thread and from two; nothing but the tables in a pipe.
#[test]
fn output_does_not_depend_on_threads() {
    let directory = tempfile::tempdir().unwrap();
    let run = |threads| study(directory.path(), &["--runs", "2", "--only", "integers,figure", "--threads", threads]);
    let one = run("1");
    let table = std::fs::read(directory.path().join("configurations.csv")).unwrap();
    let two = run("2");
    assert_eq!((one.status.code(), two.status.code()), (Some(0), Some(0)));
    assert!(one.stderr.is_empty() && one.stdout == two.stdout);
    assert_eq!(table, std::fs::read(directory.path().join("configurations.csv")).unwrap());
    assert!(std::fs::read(directory.path().join("figure1.png")).unwrap().starts_with(b"\x89PNG\r\n"));
}

/// A single run has but 17 slips: its rates cannot all lie in bands made for a thousand. Seed 1 flags all of them.
#[test]
fn a_missed_band_is_exit_code_1() {
    let directory = tempfile::tempdir().unwrap();
    let output = study(directory.path(), &["--runs", "1", "--only", "acceptance"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("OUTSIDE"));
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn wrong_usage_is_exit_code_2_and_a_bad_directory_3() {
    let directory = tempfile::tempdir().unwrap();
    assert_eq!(study(directory.path(), &["--runs", "0"]).status.code(), Some(2));
    assert_eq!(study(directory.path(), &["--only", "everything"]).status.code(), Some(2));
    let file = directory.path().join("file");
    std::fs::write(&file, "").unwrap();
    let output = study(&file, &["--runs", "1", "--only", "figure"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot be written"));
}
