//! `cargo xtask peers`: the real cases of `tests/cases.toml` in surefix and in RTKLIB, side by side.
//!
//! There are two RTKLIBs: `rnx2rtkp` of Debian's package `rtklib` (2.4.3), and demo5 (EX 2.5.0) of PyPI's package
//! `pyrtklib5`, run by `demo5.py`. Either is installed where it is missing; one that cannot be had is said and left out.
//!
//! All programs get the same plain files, constellations, base coordinate and antenna heights, run in kinematic (or
//! static) mode, forward and with what is to come (`--smooth --em`; RTKLIB's `combined`), and are judged by `surefix
//! compare`. RTKLIB is told the bands as far as it can be: one (`l1`) or two (`l1+l2`, where its second Galileo band is
//! E5b), and has its defaults else, with continuous ambiguity resolution.
//!
//! Errors are those of all epochs with a position, save the rms of forward solutions: that is of the fixed ones.

use crate::command::{output, run};
use crate::repository;
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[path = "../../tests/src/cases.rs"]
#[allow(dead_code)] // limits are for the tests
mod cases;

use cases::Case;

/// The Python package of demo5, with its version.
const DEMO5: &str = "pyrtklib5==0.2.8";

/// An RTKLIB that takes the arguments of `rnx2rtkp`.
struct Peer {
    name: &'static str,
    program: &'static str,
    /// Its first argument, and where Python finds packages.
    python: Option<[PathBuf; 2]>,
}

impl Peer {
    /// Debian's.
    fn debian() -> Result<Self> {
        if output(Command::new("which").arg("rnx2rtkp")).is_none() {
            let mut install = Command::new("apt-get");
            run(install.args(["install", "-y", "--no-install-recommends", "rtklib"]))
                .context("RTKLIB's rnx2rtkp is missing; install Debian's package `rtklib`")?;
        }
        Ok(Self { name: "RTKLIB", program: "rnx2rtkp", python: None })
    }

    /// That of PyPI, kept below `target`.
    fn demo5() -> Result<Self> {
        let packages = repository().join("target/peers");
        if !packages.join("pyrtklib5").exists() {
            let mut install = Command::new("python3");
            install.args(["-m", "pip", "install", "--quiet", "--no-deps", "--target"]).arg(&packages).arg(DEMO5);
            run(&mut install).with_context(|| {
                let to = packages.display();
                format!("RTKLIB demo5 is missing; install Python's pip and PyPI's {DEMO5} into {to}")
            })?;
        }
        let script = repository().join("xtask/src/demo5.py");
        Ok(Self { name: "demo5", program: "python3", python: Some([script, packages]) })
    }

    /// A run over files.
    fn command(&self, options: &Path, solution: &Path, files: &[PathBuf]) -> Command {
        let mut command = Command::new(self.program);
        if let Some([script, packages]) = &self.python {
            command.arg(script).env("PYTHONPATH", packages);
        }
        command.arg("-k").arg(options).arg("-o").arg(solution).args(files);
        command
    }
}

/// What a run took.
struct Cost {
    time: Duration,
    /// Greatest resident memory [KB]; 0 where the system does not tell.
    memory: u64,
}

/// Prints the table, of the cases of these names, or of all if there are none.
pub fn compare(data: &Path, only: &[String]) -> Result<()> {
    if !data.exists() {
        bail!("{}: no such directory; give that of the real data by --data", data.display());
    }
    let mut build = Command::new("cargo");
    run(build.current_dir(repository()).args([
        "build",
        "--release",
        "--package",
        "surefix",
        "--target-dir",
        "target",
    ]))?;
    let surefix = repository().join("target/release/surefix");
    let peers: Vec<Peer> = [Peer::debian(), Peer::demo5()]
        .into_iter()
        .filter_map(|peer| peer.map_err(|error| println!("left out: {error:#}")).ok())
        .collect();

    let cases = cases::cases().context("tests/cases.toml")?;
    println!(
        "\n{:17}{:17}{:>8}{:>8}{:>10}{:>11}{:>8}{:>6}{:>6}{:>6}{:>8}{:>10}{:>8}",
        "case",
        "program",
        "fixed %",
        "wrong %",
        "rms H cm",
        "rms 3D cm",
        "p95 cm",
        "e/σ",
        "n/σ",
        "u/σ",
        "first s",
        "epochs/s",
        "MB"
    );
    for case in cases.into_iter().filter(|case| only.is_empty() || only.contains(&case.name)) {
        let directory = std::env::temp_dir().join(format!("surefix-peers-{}-{}", std::process::id(), case.name));
        fs::create_dir_all(&directory)?;
        let data = data.join(&case.directory);
        let done = Run::new(&case, &surefix, &peers, &data, &directory).and_then(|run| run.run());
        fs::remove_dir_all(&directory)?;
        done.context(case.name)?;
    }
    Ok(())
}

/// What a solution of an epoch knows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    /// What came before it.
    Forward,
    /// All there is.
    Smoothed,
}

/// The files of a case, unpacked, and those that the programs write.
struct Run<'a> {
    case: &'a Case,
    surefix: &'a Path,
    peers: &'a [Peer],
    data: &'a Path,
    directory: &'a Path,
    files: Vec<PathBuf>,
}

impl<'a> Run<'a> {
    fn new(case: &'a Case, surefix: &'a Path, peers: &'a [Peer], data: &'a Path, directory: &'a Path) -> Result<Self> {
        let names = [&case.rover, &case.base].into_iter().chain(&case.navigation).enumerate();
        let to = |i| match i {
            0 => "rover.obs".to_owned(),
            1 => "base.obs".to_owned(),
            _ => format!("{i}.nav"),
        };
        let unpacked = names.map(|(i, name)| unpack(data, name, directory, &to(i)));
        Ok(Self { case, surefix, peers, data, directory, files: unpacked.collect::<Result<_>>()? })
    }

    /// Runs all programs both ways and prints a row of each.
    fn run(&self) -> Result<()> {
        let mut epochs = 0;
        for (way, program) in [(Way::Forward, "surefix"), (Way::Smoothed, "surefix smoothed")] {
            let cost = measure(&mut self.surefix(way))?;
            let summary: Value = serde_json::from_str(&fs::read_to_string(self.directory.join("rover.json"))?)?;
            epochs = summary["epochs"].as_u64().context("surefix says no number of epochs")?;
            self.row(program, way, &self.directory.join("rover.csv"), epochs, &cost)?;
        }
        for peer in self.peers {
            for (way, direction) in [(Way::Forward, ""), (Way::Smoothed, " combined")] {
                let options = self.directory.join("rtklib.conf");
                fs::write(&options, peer_options(self.case, way))?;
                let solution = self.directory.join("peer.pos");
                let cost = measure(&mut peer.command(&options, &solution, &self.files))?;
                self.row(&format!("{}{direction}", peer.name), way, &solution, epochs, &cost)?;
            }
        }
        Ok(())
    }

    fn surefix(&self, way: Way) -> Command {
        let case = self.case;
        let mut post = Command::new(self.surefix);
        post.arg("post").args(&self.files).args(["--bands", &case.bands]);
        post.arg("--base-xyz").args(case.base_xyz.map(|coordinate| coordinate.to_string()));
        post.args((case.motion.as_deref() == Some("static")).then_some("--static"));
        if way == Way::Smoothed {
            post.args(["--smooth", "--em"]);
        }
        post.arg("-o").arg(self.directory);
        post
    }

    /// Judges a solution and prints its row.
    fn row(&self, program: &str, way: Way, solution: &Path, epochs: u64, cost: &Cost) -> Result<()> {
        let mut compare = Command::new(self.surefix);
        compare.arg("compare").arg(solution).args(["--json", "--epochs", &epochs.to_string()]);
        if let Some(file) = &self.case.truth.file {
            compare.arg(self.data.join(file));
        }
        if let Some(xyz) = self.case.truth.xyz {
            compare.arg("--truth-xyz").args(xyz.map(|coordinate| coordinate.to_string()));
        }
        if let Some(quality) = &self.case.truth.quality {
            compare.args(["--truth-quality", quality]);
        }
        let report = output(&mut compare).with_context(|| format!("{program} has no result to compare"))?;
        let report: Value = serde_json::from_str(&report)?;
        let number = |value: &Value, scale: f64| value.as_f64().map_or("–".into(), |x| format!("{:.2}", scale * x));
        let rms = &report[if way == Way::Forward { "fixed" } else { "all" }];
        let normalized = &report["all_normalized"]["rms"];
        println!(
            "{:17}{program:17}{:>8}{:>8}{:>10}{:>11}{:>8}{:>6}{:>6}{:>6}{:>8}{:>10.0}{:>8}",
            self.case.name,
            number(&report["fix_rate"], 100.0),
            number(&report["wrong_fix_rate"], 100.0),
            number(&rms["rms_horizontal_m"], 100.0),
            number(&rms["rms_3d_m"], 100.0),
            number(&report["all"]["three_d_m"]["p95"], 100.0),
            number(&normalized["east"], 1.0),
            number(&normalized["north"], 1.0),
            number(&normalized["up"], 1.0),
            report["first_fix_s"].as_f64().map_or("–".into(), |seconds| format!("{seconds:.0}")),
            epochs as f64 / cost.time.as_secs_f64(),
            if cost.memory > 0 { (cost.memory / 1024).to_string() } else { "–".into() },
        );
        Ok(())
    }
}

/// RTKLIB's configuration file (RTKLIB 2.4.3 manual, B.4).
fn peer_options(case: &Case, way: Way) -> String {
    let systems = [('G', 1), ('R', 4), ('E', 8), ('J', 16), ('C', 32)];
    let navsys: u32 = systems.iter().filter(|(letter, _)| case.bands.contains(*letter)).map(|(_, bit)| bit).sum();
    let frequency = if case.bands.split(' ').any(|bands| bands.len() > 2) { "l1+l2" } else { "l1" };
    let motion = if case.motion.as_deref() == Some("static") { "static" } else { "kinematic" };
    let direction = if way == Way::Forward { "forward" } else { "combined" };
    let [x, y, z] = case.base_xyz;
    let [rover, base] = case.antennas_m.unwrap_or_default();
    format!(
        "pos1-posmode={motion}\npos1-frequency={frequency}\npos1-soltype={direction}\npos1-navsys={navsys}\n\
         pos2-armode=continuous\nout-solformat=xyz\nout-timesys=gpst\nout-timeform=tow\n\
         ant1-antdelu={rover}\nant2-antdelu={base}\nant2-postype=xyz\n\
         ant2-pos1={x}\nant2-pos2={y}\nant2-pos3={z}\n"
    )
}

/// Copies a file to `directory`, unpacked: RTKLIB would unpack it beside the original.
fn unpack(data: &Path, name: &str, directory: &Path, to: &str) -> Result<PathBuf> {
    let (from, to) = (data.join(name), directory.join(to));
    if name.ends_with(".gz") {
        let status = Command::new("gzip").arg("-dc").arg(&from).stdout(fs::File::create(&to)?).status()?;
        if !status.success() {
            bail!("{}: cannot be unpacked", from.display());
        }
    } else {
        fs::copy(&from, &to).with_context(|| format!("{}: cannot be read", from.display()))?;
    }
    Ok(to)
}

/// Runs a program silently. Its memory is what Linux last said of it, every few milliseconds.
fn measure(command: &mut Command) -> Result<Cost> {
    let program = command.get_program().to_string_lossy().into_owned();
    let start = Instant::now();
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .with_context(|| format!("{program} cannot be started"))?;
    let mut memory = 0;
    let status = loop {
        memory = peak_memory(child.id()).unwrap_or(0).max(memory);
        if let Some(status) = child.try_wait()? {
            break status;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    if !status.success() {
        bail!("{program} failed ({status})");
    }
    Ok(Cost { time: start.elapsed(), memory })
}

/// Greatest resident memory of a running process [KB].
fn peak_memory(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse().ok()
}
