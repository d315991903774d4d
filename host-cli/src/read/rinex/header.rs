//! The header of a RINEX file: what kind of file it is, and what an observation file says of station and columns.

use super::compact::ExpandedLines;
use super::observation_types::Layout;
use super::time_scale::TimeScale;
use crate::read::field::{columns, integer, real, scientific, text};
use crate::read::lines::Lines;
use crate::read::{FileKind, ReadError, ReadReport};
use std::collections::BTreeMap;
use std::fmt;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;

/// Version of the RINEX format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// 2 or 3.
    pub major: u8,
    /// Hundredths: 11 in 2.11, 5 in 3.05.
    pub minor: u8,
}

impl Version {
    /// The version with its own numbering of BeiDou bands.
    pub(super) const V3_02: Self = Self { major: 3, minor: 2 };

    fn parse(field: &[u8]) -> Option<Self> {
        let hundredths = real(field).filter(|version| (0.0..100.0).contains(version))? * 100.0;
        let hundredths = hundredths.round() as u16;
        Some(Self { major: (hundredths / 100) as u8, minor: (hundredths % 100) as u8 })
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:02}", self.major, self.minor)
    }
}

/// The first line of a RINEX file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FirstLine {
    /// Version of the format.
    pub version: Version,
    /// Letter of the file type (`O`, `N`, `G`, …).
    pub file_type: u8,
    /// Letter of the satellite system (`G`, `M`, …), blank where not given.
    pub system: u8,
}

/// Checks that the current line is the first line of a RINEX 2 or 3 file of the kind `expected`.
pub fn first_line(lines: &Lines, expected: FileKind) -> Result<FirstLine, ReadError> {
    let line = lines.line();
    let file = || lines.file().to_owned();
    let version = Version::parse(columns(line, 0, 9));
    let (Some(version), true) = (version, label(line) == b"RINEX VERSION / TYPE") else {
        let (found, remedy) = guess(line);
        return Err(ReadError::NotRinex { file: file(), found, remedy });
    };
    let file_type = line.get(20).copied().unwrap_or(b' ');
    let found = match file_type {
        b'O' => FileKind::Observation,
        b'N' | b'G' | b'H' | b'L' | b'J' | b'E' => FileKind::Navigation,
        b'M' => FileKind::Meteorology,
        b'C' => FileKind::Clock,
        _ => return Err(ReadError::NotRinex { file: file(), found: "an unknown kind of RINEX", remedy: FIRST_LINE }),
    };
    if found != expected {
        return Err(ReadError::WrongKind { file: file(), found, expected });
    }
    // RINEX 4 left observation records as they were in 3.05, but not navigation records.
    let supported = matches!(version.major, 2 | 3) || version.major == 4 && expected == FileKind::Observation;
    if !supported {
        return Err(ReadError::Version { file: file(), version: format!("RINEX {version}") });
    }
    Ok(FirstLine { version, file_type, system: line.get(40).copied().unwrap_or(b' ') })
}

const FIRST_LINE: &str = "its first line should end in \"RINEX VERSION / TYPE\" and say O or N in column 21";

/// What a first line that is not RINEX looks like, and what to do about it.
fn guess(line: &[u8]) -> (&'static str, &'static str) {
    match line {
        [0xb5, 0x62, ..] => ("a u-blox log", "convert it to RINEX (for instance with convbin)"),
        [0xd3, 0x00..=0x03, ..] => ("an RTCM 3 stream", "convert it to RINEX (for instance with convbin)"),
        [b'$', b'@', ..] => ("a Septentrio log", "convert it to RINEX (for instance with sbf2rin)"),
        [0x1f, 0x9d, ..] => ("a .Z file", "unpack it first (gzip -d does)"),
        [b'P', b'K', 3, 4, ..] => ("a zip file", "unpack it first"),
        [b'#', b'a'..=b'd', ..] => ("an SP3 orbit file", "it is not used here, leave it out"),
        _ => ("something else", FIRST_LINE),
    }
}

/// The label of a header line, columns 61–80.
pub fn label(line: &[u8]) -> &[u8] {
    columns(line, 60, 80).trim_ascii()
}

/// The error of a file that ends before its header does.
pub fn unfinished(lines: &Lines) -> ReadError {
    ReadError::Header {
        file: lines.file().to_owned(),
        line: lines.number(),
        problem: "the file ends within its header (no END OF HEADER)".to_owned(),
        remedy: "fetch or write it again",
    }
}

/// What the header of an observation file says.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationHeader {
    /// Version of the format.
    pub version: Version,
    /// Name of the marker; empty if not given.
    pub marker: String,
    /// Receiver type.
    pub receiver: String,
    /// Antenna type with radome.
    pub antenna: String,
    /// Approximate position of the marker, ECEF `[m]`.
    pub approximate_position: Option<[f64; 3]>,
    /// Antenna reference point above, east and north of the marker `[m]`.
    pub antenna_delta_hen: [f64; 3],
    /// Interval of the epochs `[s]`.
    pub interval: Option<f64>,
    /// Time scale of the epochs in the file; all times we give are GPST.
    pub time_scale: TimeScale,
    /// GLONASS frequency channels by slot number.
    pub glonass_channels: BTreeMap<u8, i8>,
    /// GPST − UTC `[s]`.
    pub leap_seconds: Option<i32>,
    /// Letter of satellites without one (RINEX 2).
    pub(super) default_system: u8,
    /// Columns of the records by [`Constellation::index`].
    pub(super) layouts: [Layout; 5],
    /// Observation types (RINEX 2).
    pub(super) types: Vec<[u8; 2]>,
    /// Wavelength factors of L1 and L2 (RINEX 2), 2 for squaring receivers, by default and by satellite.
    pub(super) wavelength_factors: ([i32; 2], BTreeMap<SatelliteId, [i32; 2]>),
    continued: Continued,
}

/// The list that a continuation line belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Continued {
    /// Constellation of the last SYS / # / OBS TYPES line, if supported.
    types: Option<Constellation>,
    /// Observation types (RINEX 2) still to come.
    types_left: usize,
    /// Constellation and factor of the last SYS / SCALE FACTOR line.
    scale: Option<(Constellation, f64)>,
}

impl ObservationHeader {
    /// Reads from the first line, which is current, to END OF HEADER.
    pub(super) fn read(expanded: &mut ExpandedLines, report: &mut ReadReport) -> Result<Self, ReadError> {
        let first = first_line(expanded.header_lines(), FileKind::Observation)?;
        let system = if first.system == b' ' { b'G' } else { first.system };
        let mut header = Self {
            version: first.version,
            marker: String::new(),
            receiver: String::new(),
            antenna: String::new(),
            approximate_position: None,
            antenna_delta_hen: [0.0; 3],
            interval: None,
            time_scale: match system {
                b'R' => TimeScale::Utc,
                b'C' => TimeScale::BeiDou,
                _ => TimeScale::Gps,
            },
            glonass_channels: BTreeMap::new(),
            leap_seconds: None,
            default_system: if system == b'M' { b'G' } else { system },
            layouts: Default::default(),
            types: Vec::new(),
            wavelength_factors: ([1, 1], BTreeMap::new()),
            continued: Continued::default(),
        };
        loop {
            let lines = expanded.header_lines();
            if !lines.advance(report)? {
                return Err(unfinished(lines));
            }
            if label(lines.line()) == b"END OF HEADER" {
                break;
            }
            header.apply(lines.line());
            expanded.observe_header();
        }
        if header.layouts.iter().all(|layout| layout.signals.is_empty()) {
            return Err(ReadError::Header {
                file: expanded.header_lines().file().to_owned(),
                line: expanded.number(),
                problem: "the header declares no observation types of GPS, Galileo, BeiDou, QZSS or GLONASS".to_owned(),
                remedy: "add the SYS / # / OBS TYPES (RINEX 3) or # / TYPES OF OBSERV (RINEX 2) lines, \
                         or write the file again",
            });
        }
        Ok(header)
    }

    /// Signals that the file declares for a constellation.
    pub fn signals(&self, constellation: Constellation) -> &[Signal] {
        &self.layouts[constellation.index()].signals
    }

    /// Applies one header line; also within the file, where events bring new ones.
    pub(super) fn apply(&mut self, line: &[u8]) {
        match label(line) {
            b"MARKER NAME" => self.marker = text(line, 0, 60),
            b"REC # / TYPE / VERS" => self.receiver = text(line, 20, 40),
            b"ANT # / TYPE" => self.antenna = text(line, 20, 40),
            b"APPROX POSITION XYZ" => {
                self.approximate_position = three(line).filter(|xyz| xyz.iter().any(|&x| x != 0.0));
            }
            b"ANTENNA: DELTA H/E/N" => self.antenna_delta_hen = three(line).unwrap_or_default(),
            b"INTERVAL" => self.interval = real(columns(line, 0, 10)).filter(|&interval| interval > 0.0),
            b"LEAP SECONDS" => self.leap_seconds = integer(columns(line, 0, 6)),
            b"TIME OF FIRST OBS" => match columns(line, 48, 51) {
                b"GLO" => self.time_scale = TimeScale::Utc,
                b"BDT" => self.time_scale = TimeScale::BeiDou,
                b"GPS" | b"GAL" | b"QZS" | b"IRN" => self.time_scale = TimeScale::Gps,
                _ => {}
            },
            b"GLONASS SLOT / FRQ #" => {
                for entry in columns(line, 4, 60).chunks(7) {
                    let slot = integer(columns(entry, 1, 3)).and_then(|slot| u8::try_from(slot).ok());
                    let channel = integer(columns(entry, 4, 6)).and_then(|channel| i8::try_from(channel).ok());
                    if let (Some(slot @ 1..), Some(channel @ -7..=6), b'R') = (slot, channel, entry[0]) {
                        self.glonass_channels.insert(slot, channel);
                    }
                }
            }
            b"SYS / # / OBS TYPES" => self.apply_types_3(line),
            b"# / TYPES OF OBSERV" => self.apply_types_2(line),
            b"SYS / SCALE FACTOR" => self.apply_scale(line),
            b"WAVELENGTH FACT L1/2" => self.apply_wavelength_factors(line),
            _ => {}
        }
    }

    fn apply_types_3(&mut self, line: &[u8]) {
        let letter = line.first().copied().unwrap_or(b' ');
        if letter != b' ' {
            self.continued.types = Constellation::from_letter(letter as char);
            if let Some(constellation) = self.continued.types {
                self.layouts[constellation.index()] = Layout::default();
            }
        }
        if let Some(constellation) = self.continued.types {
            let layout = &mut self.layouts[constellation.index()];
            for code in columns(line, 7, 60).chunks(4).map(<[u8]>::trim_ascii).filter(|code| !code.is_empty()) {
                layout.push_code(code, constellation, self.version);
            }
        }
    }

    fn apply_types_2(&mut self, line: &[u8]) {
        if let Some(count) = integer(columns(line, 0, 6)) {
            self.types.clear();
            self.continued.types_left = usize::try_from(count).unwrap_or(0);
        }
        for entry in columns(line, 6, 60).chunks(6).map(<[u8]>::trim_ascii) {
            if let ([letter, band], 1..) = (entry, self.continued.types_left) {
                self.types.push([*letter, *band]);
                self.continued.types_left -= 1;
            }
        }
        for constellation in Constellation::ALL {
            let layout = &mut self.layouts[constellation.index()];
            *layout = Layout::default();
            self.types.iter().for_each(|entry| layout.push_type(entry, constellation, &self.types));
        }
    }

    fn apply_scale(&mut self, line: &[u8]) {
        if let Some(constellation) = line.first().and_then(|&letter| Constellation::from_letter(letter as char)) {
            let factor = integer(columns(line, 2, 6)).filter(|factor| [1, 10, 100, 1000].contains(factor));
            self.continued.scale = factor.map(|factor| (constellation, f64::from(factor)));
            if let (Some((constellation, factor)), None | Some(0)) =
                (self.continued.scale, integer(columns(line, 8, 10)))
            {
                self.layouts[constellation.index()].set_scale(None, factor);
            }
        }
        if let Some((constellation, factor)) = self.continued.scale {
            let layout = &mut self.layouts[constellation.index()];
            for code in columns(line, 10, 60).chunks(4).map(<[u8]>::trim_ascii).filter(|code| !code.is_empty()) {
                layout.set_scale(Some(code), factor);
            }
        }
    }

    fn apply_wavelength_factors(&mut self, line: &[u8]) {
        let factors = [integer(columns(line, 0, 6)).unwrap_or(1), integer(columns(line, 6, 12)).unwrap_or(1)];
        match integer(columns(line, 12, 18)) {
            None | Some(0) => self.wavelength_factors.0 = factors,
            Some(_) => {
                for name in columns(line, 18, 60).chunks(6).map(<[u8]>::trim_ascii) {
                    let satellite = std::str::from_utf8(name).ok().and_then(|name| name.parse().ok());
                    satellite.and_then(|satellite| self.wavelength_factors.1.insert(satellite, factors));
                }
            }
        }
    }

    /// Whether phases on L1 and L2 of a satellite are half cycles by the header (squaring receivers, RINEX 2).
    pub(super) fn half_cycles(&self, satellite: SatelliteId) -> [bool; 2] {
        let (default, by_satellite) = &self.wavelength_factors;
        by_satellite.get(&satellite).unwrap_or(default).map(|factor| factor == 2)
    }
}

/// Three numbers of 14 columns each.
fn three(line: &[u8]) -> Option<[f64; 3]> {
    let field = |i: usize| scientific(columns(line, 14 * i, 14 * i + 14));
    Some([field(0)?, field(1)?, field(2)?])
}
