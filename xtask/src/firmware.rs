//! Building `firmware-sim` and checking what its programs say.
//!
//! Each program `firmware-sim/src/bin/x.rs` that runs without input has its expected defmt messages beside it in
//! `x.out`. In it `{core}` stands for the name of the machine's core.

use crate::command::run;
use crate::machine::Machine;
use crate::panics;
use crate::qemu::{self, Image};
use crate::repository;
use crate::toolchain::{CortexM, TARGET};
use anyhow::{Context, Result, ensure};
use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

/// Length of the serial line's test.
const UART_TEST_BYTES: u32 = 100_000;

/// Builds all programs for a machine and returns where they are.
pub fn build(toolchain: &CortexM, machine: Machine) -> Result<Programs> {
    build_some(toolchain, machine, &["--bins"])
}

/// Builds one program for a machine.
pub fn build_one(toolchain: &CortexM, machine: Machine, program: &str) -> Result<Image> {
    build_some(toolchain, machine, &["--bin", program])?.get(program)
}

fn build_some(toolchain: &CortexM, machine: Machine, which: &[&str]) -> Result<Programs> {
    let source = repository().join("firmware-sim");
    let target = source.join("target").join(machine.name());
    // From its own directory, so that its own cargo configuration holds.
    run(toolchain
        .cargo("build", machine)
        .current_dir(&source)
        .args(["--release", "--quiet"])
        .args(which)
        .arg("--target-dir")
        .arg(&target))?;
    Ok(Programs { machine, directory: target.join(TARGET).join("release") })
}

/// The programs built for a machine.
#[derive(Clone, Debug)]
pub struct Programs {
    machine: Machine,
    directory: PathBuf,
}

impl Programs {
    /// The program of a name.
    pub fn get(&self, name: &str) -> Result<Image> {
        Image::load(self.machine, self.directory.join(name))
    }
}

impl fmt::Display for Programs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.machine.qemu_name())
    }
}

/// Builds the programs for a machine and checks each.
pub fn test(toolchain: &CortexM, machine: Machine) -> Result<()> {
    let programs = build(toolchain, machine)?;
    for (name, expected) in expectations()? {
        check_messages(&programs, &name, &expected.replace("{core}", machine.core()))?;
    }
    check_uart(&programs, UART_TEST_BYTES)?;
    check_overflow(&programs)?;
    panics::test(&programs)
}

/// A program without input must end well and say what is expected.
fn check_messages(programs: &Programs, name: &str, expected: &str) -> Result<()> {
    let run = qemu::run(&programs.get(name)?, &[])?;
    ensure!(run.success(), "{programs}: {name} failed: {run}");
    let said = run.messages.join("\n");
    ensure!(said == expected.trim_end(), "{programs}: {name}\n--- expected\n{expected}--- said\n{said}");
    println!("{programs}: {name}: exit code and {} messages as expected", run.messages.len());
    Ok(())
}

/// No byte may be lost or changed on the serial line, in neither direction.
fn check_uart(programs: &Programs, length: u32) -> Result<()> {
    let payload: Vec<u8> = (0..length).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let input = [&length.to_le_bytes()[..], &payload].concat();
    let started = Instant::now();
    let run = qemu::run(&programs.get("uart")?, &input)?;
    ensure!(run.success(), "{programs}: uart failed: {run}");
    let expected: Vec<u8> = payload.into_iter().step_by(5).collect();
    ensure!(run.uart == expected, "{programs}: uart: {} bytes came back, or changed: {run}", run.uart.len());
    let rate = f64::from(length) / 1e3 / started.elapsed().as_secs_f64();
    println!("{programs}: uart: {length} bytes in, {} out, none lost ({rate:.0} kB/s)", expected.len());
    Ok(())
}

/// A stack overflow must stop the machine.
fn check_overflow(programs: &Programs) -> Result<()> {
    let run = qemu::run(&programs.get("overflow")?, &[])?;
    let announced = run.messages.len() == 1;
    ensure!(announced && !run.success(), "{programs}: a stack overflow went unnoticed: {run}");
    println!("{programs}: overflow: the machine stopped");
    Ok(())
}

/// Name and expected messages of each program that has such a file, by name.
fn expectations() -> Result<Vec<(String, String)>> {
    let directory = repository().join("firmware-sim/src/bin");
    let mut found = Vec::new();
    for entry in directory.read_dir().with_context(|| format!("{} cannot be read", directory.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "out") {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let messages =
                std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
            found.push((name, messages));
        }
    }
    found.sort();
    Ok(found)
}
