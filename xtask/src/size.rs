//! `cargo xtask size`: what the filter takes on a Cortex-M, as a table for the README.
//!
//! Flash and static RAM are those of the whole program: filter, device log, serial line and messages. Stack and
//! instructions are measured while it replays the smoke test's log: 16 satellites on two bands for the presets of the RTK
//! filter, 13 satellites of Section V of Greiff et al. (2021) for the mixed-integer filter, nine to two besides a reference for the filter between two
//! vehicles, whose noise follows the data; 9 to 15 satellites on two bands for precise point positioning of a moving receiver
//! with a state for each ionospheric delay; for the fixed-lag smoother,
//! which needs no log, while it smooths a drive of up to 15 states ten epochs back, its filter not counted. Instructions are
//! counted by QEMU's virtual clock; they are not cycles.

use crate::firmware::{self, Programs};
use crate::machine::Machine;
use crate::qemu;
use crate::repository;
use crate::toolchain::CortexM;
use anyhow::{Context, Result, ensure};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, elf};
use std::fmt::Write;

const DRIVE: &[u8] = include_bytes!("../../firmware-sim/smoke/drive.log");
const SECTION_V: &[u8] = include_bytes!("../../firmware-sim/smoke/section_v.log");
/// What is measured: program, name of the filter, log, and the machine if it is for one only.
const CASES: [(&str, &str, &[u8], Option<Machine>); 10] = [
    ("replay16", "Rtk16", DRIVE, None),
    ("replay32", "Rtk32", DRIVE, None),
    ("replay64", "Rtk64", DRIVE, None),
    ("section_v64", "SectionV<f64>", SECTION_V, Some(Machine::An500)),
    ("section_v32", "SectionV<f32>", SECTION_V, Some(Machine::An386)),
    ("moving_base64", "DoubleDifference22<f64>", &[], None),
    ("moving_base32", "DoubleDifference22<f32>", &[], Some(Machine::An386)),
    ("ppp64", "PppFilter<16, 63>", &[], None),
    ("fixed_lag64", "FixedLag<f64>", &[], None),
    ("fixed_lag32", "FixedLag<f32>", &[], Some(Machine::An386)),
];
/// Where RAM begins in `memory.x`.
const RAM: u32 = 0x2000_0000;
const BEGIN: &str = "<!-- cargo xtask size: begin -->\n";
const END: &str = "<!-- cargo xtask size: end -->";

/// Measures, prints the table, and writes it into the README if that has the place for it.
pub fn run(toolchain: &CortexM) -> Result<()> {
    let mut table = String::from(
        "| filter | core | flash KB | static RAM KB | peak stack KB | instructions per epoch, mean | most |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for machine in Machine::ALL {
        let programs = firmware::build(toolchain, machine)?;
        for (program, filter, log, only) in CASES {
            if only.is_none_or(|only| only == machine) {
                writeln!(table, "{}", row(&programs, machine, program, filter, log)?)?;
            }
        }
    }
    println!("\n{table}");
    write_between_marks(&table)
}

fn row(programs: &Programs, machine: Machine, program: &str, filter: &str, log: &[u8]) -> Result<String> {
    let image = programs.get(program)?;
    let (flash, ram) = memory(image.elf())?;
    let run = qemu::run(&image, log)?;
    ensure!(run.success(), "{program} failed: {run}");
    let value = |name| {
        let found = run.messages.iter().find_map(|message| message.strip_prefix(&format!("INFO {name}: ")));
        found.and_then(|value| value.parse::<f64>().ok()).with_context(|| format!("no message `{name}`: {run}"))
    };
    Ok(format!(
        "| `{filter}` | {} | {:.0} | {:.0} | {:.1} | {:.2} M | {:.2} M |",
        machine.core(),
        f64::from(flash) / 1e3,
        f64::from(ram) / 1e3,
        value("peak stack")? / 1e3,
        value("instructions per epoch, mean")? / 1e6,
        value("instructions per epoch, most")? / 1e6,
    ))
}

/// Bytes of flash and of static RAM that a program takes.
fn memory(program: &[u8]) -> Result<(u32, u32)> {
    let header = elf::FileHeader32::<Endianness>::parse(program).context("not an ELF file")?;
    let endian = header.endian()?;
    let (mut flash, mut ram) = (0, 0);
    for segment in header.program_headers(endian, program)?.iter().filter(|s| s.p_type(endian) == elf::PT_LOAD) {
        // Initialised data lies in flash and is copied to RAM.
        flash += segment.p_filesz(endian);
        if segment.p_vaddr(endian) >= RAM {
            ram += segment.p_memsz(endian);
        }
    }
    Ok((flash, ram))
}

fn write_between_marks(table: &str) -> Result<()> {
    let path = repository().join("README.md");
    let text = std::fs::read_to_string(&path).context("README.md cannot be read")?;
    let place = text.split_once(BEGIN).and_then(|(before, rest)| Some((before, rest.split_once(END)?.1)));
    let (before, after) = place.with_context(|| format!("README.md has no lines {BEGIN}and {END}"))?;
    std::fs::write(&path, format!("{before}{BEGIN}\n{table}\n{END}{after}")).context("README.md cannot be written")
}
