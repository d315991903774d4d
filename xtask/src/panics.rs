//! `cargo xtask panics`: which places of the core can still panic, as far as the compiler can tell.
//!
//! The core promises that it never panics. Most bounds checks vanish in the optimised program, because the compiler
//! proves them; each that remains leaves its place in the source behind, a [`core::panic::Location`] in the read-only
//! data. This lists those places, and fails if there is one: an index that cannot fail is written so that the compiler
//! sees it.

use crate::firmware::{self, Programs};
use crate::machine::Machine;
use crate::toolchain::CortexM;
use anyhow::{Context, Result, ensure};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, elf};
use std::collections::BTreeSet;
use std::fmt;

/// A place in the source.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    file: String,
    line: u32,
    column: u32,
}

impl Place {
    /// File below `core/src`, if it is there and not in the standard library's crate of that name, whose sources are below
    /// `rustlib` where they are installed and `/rustc/HASH` where they are not.
    fn in_core(&self) -> Option<&str> {
        self.file.rsplit_once("core/src/").map(|(_, file)| file).filter(|_| !self.file.contains("library/core/src/"))
    }

    /// Whether it is the one of `clamp`, which does not say who called it, and panics where the bounds are not in order.
    fn is_clamp(&self) -> bool {
        ["f32.rs", "f64.rs"].iter().any(|file| self.file.ends_with(&format!("library/core/src/num/{file}")))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.in_core() {
            Some(file) => write!(f, "core/src/{file}:{}:{}", self.line, self.column),
            None => write!(f, "a `clamp` of floats whose bounds may be out of order"),
        }
    }
}

/// Builds the firmware and checks it.
pub fn run(toolchain: &CortexM) -> Result<()> {
    test(&firmware::build(toolchain, Machine::An500)?)
}

/// Checks programs that are built.
pub fn test(programs: &Programs) -> Result<()> {
    check(&places(programs)?)?;
    println!("panics: none is reachable in {}", PROGRAMS.join(", "));
    Ok(())
}

fn check(places: &BTreeSet<Place>) -> Result<()> {
    let places: Vec<String> = places.iter().map(ToString::to_string).collect();
    ensure!(
        places.is_empty(),
        "the core must not panic on any input, but the compiler cannot rule out a panic here; replace the index or the \
         arithmetic by one that cannot fail, such as `get`:\n  {}",
        places.join("\n  ")
    );
    Ok(())
}

/// Programs that are looked at: the largest of each filter, and two that link the kernels and models that these do not use.
const PROGRAMS: [&str; 7] = ["replay64", "section_v64", "moving_base64", "fixed_lag64", "ppp64", "kernels", "models"];

/// Places of the core from which a panic is reachable in the programs.
fn places(programs: &Programs) -> Result<BTreeSet<Place>> {
    let mut all = BTreeSet::new();
    for name in PROGRAMS {
        all.extend(places_in(programs.get(name)?.elf())?);
    }
    Ok(all)
}

/// Places of the core from which a panic is reachable in a program.
fn places_in(program: &[u8]) -> Result<BTreeSet<Place>> {
    let header = elf::FileHeader32::<Endianness>::parse(program).context("not an ELF file")?;
    let endian = header.endian()?;
    let segments: Vec<(u32, &[u8])> = header
        .program_headers(endian, program)?
        .iter()
        .filter(|segment| segment.p_type(endian) == elf::PT_LOAD)
        .filter_map(|segment| Some((segment.p_vaddr(endian), segment.data(endian, program).ok()?)))
        .collect();
    let found = segments.iter().flat_map(|(_, data)| {
        data.windows(16)
            .step_by(4)
            .filter_map(|record| location(record, &segments))
            .filter(|p| p.in_core().is_some() || p.is_clamp())
    });
    Ok(found.collect())
}

/// Reads 16 bytes as a `Location`: address and length of the file name, line, column.
fn location(record: &[u8], segments: &[(u32, &[u8])]) -> Option<Place> {
    let mut words = record.chunks_exact(4).filter_map(|word| Some(u32::from_le_bytes(word.try_into().ok()?)));
    let (address, length, line, column) = (words.next()?, words.next()?, words.next()?, words.next()?);
    let is_plausible = (4..400).contains(&length) && (1..100_000).contains(&line) && (1..1000).contains(&column);
    if !is_plausible {
        return None;
    }
    let name = segments.iter().find_map(|(start, data)| {
        let from = usize::try_from(address.checked_sub(*start)?).ok()?;
        data.get(from..from.checked_add(usize::try_from(length).ok()?)?)
    })?;
    let file = std::str::from_utf8(name).ok().filter(|file| file.ends_with(".rs"))?;
    Some(Place { file: file.to_owned(), line, column })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(file: &str) -> Place {
        Place { file: file.to_owned(), line: 7, column: 9 }
    }

    #[test]
    fn a_location_is_read_from_its_bytes() {
        let name = b"/home/me/core/src/gnss/time.rs";
        let segments: [(u32, &[u8]); 1] = [(0x400, name)];
        let record = |words: [u32; 4]| words.map(u32::to_le_bytes).concat();
        let read = |words| location(&record(words), &segments);
        let found = read([0x400, 30, 7, 9]).unwrap();
        assert_eq!(found, place("/home/me/core/src/gnss/time.rs"));
        assert_eq!(found.to_string(), "core/src/gnss/time.rs:7:9");
        // Beyond the segment, not a source file, no line.
        assert_eq!([[0x401, 30, 7, 9], [0x400, 29, 7, 9], [0x400, 30, 0, 9]].map(read), [None, None, None]);
    }

    #[test]
    fn a_place_in_the_core_fails_the_check() {
        assert!(check(&BTreeSet::new()).is_ok());
        let error = check(&BTreeSet::from([place("/home/me/core/src/log/frame.rs")])).unwrap_err();
        assert!(error.to_string().ends_with("\n  core/src/log/frame.rs:7:9"), "{error}");
    }

    /// Bug: without installed sources of the standard library its own core was taken for ours.
    #[test]
    fn the_core_of_the_standard_library_is_another() {
        for file in
            ["/usr/lib/rustlib/src/rust/library/core/src/slice/x.rs", "/rustc/59807/library/core/src/slice/x.rs"]
        {
            assert_eq!(place(file).in_core(), None);
        }
    }

    /// Bug: an ionosphere map without rows panicked in `f64::clamp`, of which only the standard library's place is left.
    #[test]
    fn a_clamp_that_can_fail_is_found_in_the_standard_library() {
        let clamp = place("/rustc/59807/library/core/src/num/f64.rs");
        assert!(clamp.is_clamp() && !place("/home/me/core/src/gnss/time.rs").is_clamp());
        assert!(check(&BTreeSet::from([clamp])).unwrap_err().to_string().contains("`clamp`"));
    }
}
