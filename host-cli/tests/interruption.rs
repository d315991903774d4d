//! Ctrl-C while files are being written: the process ends with exit code 130 and leaves none of them, and what was there
//! before stays.
//!
//! The rover's observations come from a named pipe that stops in the middle, so that the program is sure to be at work
//! when the signal comes.
#![cfg(unix)]

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use surefix::simulate::files::Files;
use surefix::simulate::scenario::Scenario;
use surefix::simulate::simulate;

/// A minute of the default drive.
fn simulated(directory: &Path) {
    let scenario = Scenario { duration_s: 60.0, ..Scenario::default() };
    Files::write(directory, &scenario, &simulate(&scenario).unwrap()).unwrap();
}

/// Replaces a file by a pipe, and fills it with the first half of the file for as long as the answer lives.
fn feed_half(path: &Path, mut during: impl FnMut()) {
    let content = fs::read(path).unwrap();
    fs::remove_file(path).unwrap();
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    let path = path.to_owned();
    let (done, wait) = std::sync::mpsc::channel::<()>();
    let feeder = std::thread::spawn(move || {
        let mut pipe = File::create(path).unwrap(); // waits for the reader
        // A reader that is interrupted before it has read that much breaks the pipe.
        let _ = pipe.write_all(&content[..content.len() / 2]);
        let _ = wait.recv();
    });
    during();
    drop(done);
    feeder.join().unwrap();
}

fn spawn(directory: &Path, arguments: &[&str]) -> Child {
    let mut surefix = Command::new(env!("CARGO_BIN_EXE_surefix"));
    surefix.current_dir(directory).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Interrupts a process once something is there; its exit code and what it said.
fn interrupt_when(
    mut child: Child,
    what: &str,
    signal: &str,
    is_there: impl Fn(&Child) -> bool,
) -> (Option<i32>, String) {
    let start = Instant::now();
    while !is_there(&child) {
        let late = start.elapsed() > Duration::from_secs(60);
        if late || child.try_wait().unwrap().is_some() {
            let _ = child.kill();
            let output = child.wait_with_output().unwrap();
            panic!("{what} does not come: {}", String::from_utf8_lossy(&output.stderr));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Interrupts a process once a file is there; its exit code and what it said.
fn interrupt_at(child: Child, file: &Path, signal: &str) -> (Option<i32>, String) {
    interrupt_when(child, &file.display().to_string(), signal, |_| file.exists())
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn post_leaves_nothing_half_written() {
    for signal in ["-INT", "-TERM"] {
        let directory = tempfile::tempdir().unwrap();
        simulated(directory.path());
        let output = directory.path().join("out");
        fs::create_dir(&output).unwrap();
        fs::write(output.join("rover.csv"), "of an earlier run").unwrap();
        feed_half(&directory.path().join("rover.obs"), || {
            let child = spawn(directory.path(), &["post", "rover.obs", "base.obs", "broadcast.nav", "-o", "out"]);
            let (code, message) = interrupt_at(child, &output.join("rover.json.partial"), signal);
            assert_eq!(code, Some(130), "{message}");
            assert!(message.contains("interrupted; files that were not complete are removed"), "{message}");
            assert_eq!(names(&output), ["rover.csv"], "{message}");
        });
        assert_eq!(fs::read_to_string(output.join("rover.csv")).unwrap(), "of an earlier run");
    }
}

/// Once the progress bar has its thread, the process is smoothing.
#[cfg(target_os = "linux")]
#[test]
fn smoothing_leaves_nothing_half_written() {
    let directory = tempfile::tempdir().unwrap();
    let mut scenario = Scenario { duration_s: 239.0, ..Scenario::default() };
    for receiver in [&mut scenario.rover.receiver, &mut scenario.base.receiver] {
        receiver.interval_s = 1.0;
    }
    Files::write(directory.path(), &scenario, &simulate(&scenario).unwrap()).unwrap();
    let [output, temporary] = ["out", "temporary"].map(|name| directory.path().join(name));
    [&output, &temporary].iter().for_each(|path| fs::create_dir(path).unwrap());
    fs::write(output.join("rover.csv"), "of an earlier run").unwrap();
    let post = ["post", "rover.obs", "base.obs", "broadcast.nav", "-o", "out", "--smooth", "--em"];
    let mut surefix = Command::new(env!("CARGO_BIN_EXE_surefix"));
    surefix.current_dir(directory.path()).args(post).env("TMPDIR", &temporary);
    let child = surefix.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let is_smoothing = |child: &Child| {
        let threads = fs::read_dir(format!("/proc/{}/task", child.id())).into_iter().flatten();
        let mut names = threads.filter_map(|thread| fs::read_to_string(thread.ok()?.path().join("comm")).ok());
        names.any(|name| name.trim() == "progress")
    };
    let (code, message) = interrupt_when(child, "smoothing", "-INT", is_smoothing);
    assert_eq!(code, Some(130), "{message}");
    assert!(message.contains("interrupted; files that were not complete are removed"), "{message}");
    assert_eq!(names(&output), ["rover.csv"], "{message}");
    assert_eq!(fs::read_to_string(output.join("rover.csv")).unwrap(), "of an earlier run");
    assert!(names(&temporary).is_empty(), "{:?}", names(&temporary));
}

#[test]
fn replay_leaves_nothing_half_written() {
    let directory = tempfile::tempdir().unwrap();
    simulated(directory.path());
    feed_half(&directory.path().join("device.log"), || {
        let child = spawn(directory.path(), &["replay", "device.log", "-o", "answers.sfl", "-r", "out"]);
        let (code, message) = interrupt_at(child, &directory.path().join("out/device.json.partial"), "-INT");
        assert_eq!(code, Some(130), "{message}");
        assert!(names(&directory.path().join("out")).is_empty());
        assert!(names(directory.path()).iter().all(|name| !name.starts_with("answers")));
    });
}

#[test]
fn an_error_leaves_nothing_half_written_and_success_nothing_partial() {
    let directory = tempfile::tempdir().unwrap();
    simulated(directory.path());
    let post = || {
        let child = spawn(directory.path(), &["post", "rover.obs", "base.obs", "broadcast.nav", "-o", "out"]);
        child.wait_with_output().unwrap().status.code()
    };
    // A base that ends before the rover starts is noticed at the end of the run.
    let base = directory.path().join("base.obs");
    let whole = fs::read_to_string(&base).unwrap();
    fs::write(&base, &whole[..whole.find("\n>").unwrap() + 1]).unwrap();
    assert_eq!(post(), Some(3));
    assert!(names(&directory.path().join("out")).is_empty());
    fs::write(&base, whole).unwrap();
    assert_eq!(post(), Some(0));
    assert_eq!(names(&directory.path().join("out")), ["rover.csv", "rover.json", "rover.pos"]);
}
