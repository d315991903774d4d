//! `cargo xtask peers`: the real cases of `tests/cases.toml` in surefix and in RTKLIB's `rnx2rtkp`, side by side.
//!
//! Both programs get the same plain files, constellations, base coordinate and antenna heights, run forward in kinematic
//! (or static) mode, and are judged by `surefix compare`. RTKLIB is told the bands as far as it can be: one (`l1`) or two
//! (`l1+l2`, where its second Galileo band is E5b), and has its defaults else, with continuous ambiguity resolution.

use crate::command::{output, run};
use crate::repository;
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const PEER: &str = "rnx2rtkp";

/// A case, as far as it matters here; see the head of the file.
#[derive(Deserialize)]
struct Case {
    name: String,
    directory: String,
    rover: String,
    base: String,
    navigation: Vec<String>,
    base_xyz: [f64; 3],
    antennas_m: Option<[f64; 2]>,
    bands: String,
    motion: Option<String>,
    truth: Truth,
}

#[derive(Deserialize)]
struct Truth {
    xyz: Option<[f64; 3]>,
    file: Option<String>,
    quality: Option<String>,
}

/// What a run took.
struct Cost {
    time: Duration,
    /// Greatest resident memory [KB]; 0 where the system does not tell.
    memory: u64,
}

/// Prints the table.
pub fn compare(data: &Path) -> Result<()> {
    if output(Command::new("which").arg(PEER)).is_none() {
        let mut install = Command::new("apt-get");
        run(install.args(["install", "-y", "--no-install-recommends", "rtklib"]))
            .context("RTKLIB's rnx2rtkp is missing; install Debian's package `rtklib`")?;
    }
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

    let file = repository().join("tests/cases.toml");
    let text = fs::read_to_string(&file).with_context(|| format!("{}: cannot be read", file.display()))?;
    let mut table: std::collections::BTreeMap<String, Vec<Case>> = toml::from_str(&text)?;
    println!(
        "\n{:17}{:9}{:>8}{:>8}{:>10}{:>11}{:>8}{:>10}{:>8}",
        "case", "program", "fixed %", "wrong %", "rms H cm", "rms 3D cm", "first s", "epochs/s", "MB"
    );
    for case in table.remove("case").unwrap_or_default() {
        let directory = std::env::temp_dir().join(format!("surefix-peers-{}-{}", std::process::id(), case.name));
        fs::create_dir_all(&directory)?;
        let done = case.run(&surefix, data, &directory);
        fs::remove_dir_all(&directory)?;
        done.with_context(|| case.name.clone())?;
    }
    Ok(())
}

impl Case {
    /// Runs both programs in `directory` and prints a row of each.
    fn run(&self, surefix: &Path, data: &Path, directory: &Path) -> Result<()> {
        let data = data.join(&self.directory);
        let rover = unpack(&data, &self.rover, directory, "rover.obs")?;
        let base = unpack(&data, &self.base, directory, "base.obs")?;
        let unpack_navigation = |(i, name): (usize, &String)| unpack(&data, name, directory, &format!("{i}.nav"));
        let navigation = self.navigation.iter().enumerate().map(unpack_navigation).collect::<Result<Vec<_>>>()?;
        let files = || [&rover, &base].into_iter().chain(&navigation);
        let base_xyz = self.base_xyz.map(|coordinate| coordinate.to_string());

        let mut post = Command::new(surefix);
        post.arg("post").args(files()).arg("--base-xyz").args(&base_xyz).args(["--bands", &self.bands]);
        post.args((self.motion.as_deref() == Some("static")).then_some("--static")).arg("-o").arg(directory);
        let cost = measure(&mut post)?;
        let summary: Value = serde_json::from_str(&fs::read_to_string(directory.join("rover.json"))?)?;
        let epochs = summary["epochs"].as_u64().context("surefix says no number of epochs")?;
        self.row("surefix", surefix, &data, &directory.join("rover.csv"), epochs, &cost)?;

        let options = directory.join("rnx2rtkp.conf");
        fs::write(&options, self.peer_options())?;
        let solution = directory.join("peer.pos");
        let mut peer = Command::new(PEER);
        peer.arg("-k").arg(&options).arg("-o").arg(&solution).args(files());
        let cost = measure(&mut peer)?;
        self.row("RTKLIB", surefix, &data, &solution, epochs, &cost)
    }

    /// Judges a solution and prints its row.
    fn row(&self, program: &str, surefix: &Path, data: &Path, solution: &Path, epochs: u64, cost: &Cost) -> Result<()> {
        let mut compare = Command::new(surefix);
        compare.arg("compare").arg(solution).args(["--json", "--epochs", &epochs.to_string()]);
        if let Some(file) = &self.truth.file {
            compare.arg(data.join(file));
        }
        if let Some(xyz) = self.truth.xyz {
            compare.arg("--truth-xyz").args(xyz.map(|coordinate| coordinate.to_string()));
        }
        if let Some(quality) = &self.truth.quality {
            compare.args(["--truth-quality", quality]);
        }
        let report = output(&mut compare).with_context(|| format!("{program} has no result to compare"))?;
        let report: Value = serde_json::from_str(&report)?;
        let number = |value: &Value, scale: f64| value.as_f64().map_or("–".into(), |x| format!("{:.2}", scale * x));
        println!(
            "{:17}{program:9}{:>8}{:>8}{:>10}{:>11}{:>8}{:>10.0}{:>8}",
            self.name,
            number(&report["fix_rate"], 100.0),
            number(&report["wrong_fix_rate"], 100.0),
            number(&report["fixed"]["rms_horizontal_m"], 100.0),
            number(&report["fixed"]["rms_3d_m"], 100.0),
            report["first_fix_s"].as_f64().map_or("–".into(), |seconds| format!("{seconds:.0}")),
            epochs as f64 / cost.time.as_secs_f64(),
            if cost.memory > 0 { (cost.memory / 1024).to_string() } else { "–".into() },
        );
        Ok(())
    }

    /// RTKLIB's configuration file (RTKLIB 2.4.3 manual, B.4).
    fn peer_options(&self) -> String {
        let systems = [('G', 1), ('R', 4), ('E', 8), ('J', 16), ('C', 32)];
        let navsys: u32 = systems.iter().filter(|(letter, _)| self.bands.contains(*letter)).map(|(_, bit)| bit).sum();
        let frequency = if self.bands.split(' ').any(|bands| bands.len() > 2) { "l1+l2" } else { "l1" };
        let motion = if self.motion.as_deref() == Some("static") { "static" } else { "kinematic" };
        let [x, y, z] = self.base_xyz;
        let [rover, base] = self.antennas_m.unwrap_or_default();
        format!(
            "pos1-posmode={motion}\npos1-frequency={frequency}\npos1-soltype=forward\npos1-navsys={navsys}\n\
             pos2-armode=continuous\nout-solformat=xyz\nout-timesys=gpst\nout-timeform=tow\n\
             ant1-antdelu={rover}\nant2-antdelu={base}\nant2-postype=xyz\n\
             ant2-pos1={x}\nant2-pos2={y}\nant2-pos3={z}\n"
        )
    }
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
