//! Precise orbits and clocks: SP3, versions a to d.
//!
//! Source: S. Hilla, *The Extended Standard Product 3 Orbit Format (SP3-d)* (NGS/IGS, 2016). Positions in km and clocks in
//! µs become metres and seconds. Velocity (`V`) and correlation (`EP`, `EV`) records are passed over. A position of three
//! zeros and a clock of 999999.999999 mean that there is none. A clock that jumped (flag E) or a satellite that was
//! manoeuvred (flag M) since the node before must not be interpolated across: that node is left out, which makes a gap.

use super::error::{FileKind, ReadError};
use super::field::{columns, real, text};
use super::kind::kind_of_line;
use super::lines::Lines;
use super::nodes::Nodes;
use super::report::{ReadReport, Reason};
use super::rinex::TimeScale;
use nalgebra::Vector3;
use std::io::BufRead;
use std::path::Path;
use surefix_core::gnss::precise::{ClockNode, OrbitNode};
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;

/// TAI − GPST `[s]`.
const TAI_MINUS_GPST: f64 = 19.0;
/// Clocks from here on mean that there is none `[µs]`.
const NO_CLOCK: f64 = 999_999.0;
/// Distances of navigation satellites from the Earth's centre, with room to spare `[m]`.
const RADII: std::ops::RangeInclusive<f64> = 6.0e6..=1.0e8;

/// What the header of an SP3 file says.
#[derive(Clone, Debug, PartialEq)]
pub struct Sp3Header {
    /// The file.
    pub file: String,
    /// Version of the format, `a` to `d`.
    pub version: char,
    /// Name of the terrestrial frame, as `IGb14`.
    pub frame: String,
    /// Kind of orbit, as `FIT`, `HLM`, `BHN`.
    pub orbit_type: String,
    /// Agency that computed it.
    pub agency: String,
    /// Time between epochs as stated `[s]`.
    pub interval: f64,
    /// Antenna model that the product was made with (`IGS14_2108`), from the comment `PCV:`, where given.
    pub antenna_model: Option<String>,
}

/// Precise orbits and clocks of SP3 files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sp3 {
    /// Headers, one a file.
    pub headers: Vec<Sp3Header>,
    /// Nodes of the kept positions that are predicted (flag P).
    pub predicted_positions: u64,
    /// Nodes of the kept clocks that are predicted (flag P).
    pub predicted_clocks: u64,
    /// What was read and dropped, a report a file.
    pub reports: Vec<ReadReport>,
    orbits: Nodes<OrbitNode>,
    clocks: Nodes<ClockNode>,
}

impl Sp3 {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::from_lines(Lines::open(path)?)
    }

    /// Reads `input`, called `file` in messages.
    pub fn new(file: &str, input: impl BufRead + Send + 'static) -> Result<Self, ReadError> {
        Self::from_lines(Lines::new(file, input))
    }

    /// Adds the nodes of another file, as those of the next day. Where both have a node (the end of one day is the
    /// beginning of the next) the own one stays; the other's report counts them.
    pub fn merge(&mut self, mut other: Self) {
        let duplicates = self.orbits.merge(other.orbits) + self.clocks.merge(other.clocks);
        if let Some(report) = other.reports.first_mut() {
            report.drop_many(Reason::NodeDuplicate, duplicates, 0);
        }
        self.headers.append(&mut other.headers);
        self.reports.append(&mut other.reports);
        self.predicted_positions += other.predicted_positions;
        self.predicted_clocks += other.predicted_clocks;
    }

    /// Positions of a satellite's centre of mass, sorted by time.
    pub fn orbit(&self, satellite: SatelliteId) -> &[OrbitNode] {
        self.orbits.of(satellite)
    }

    /// Clocks of a satellite, sorted by time, without the periodic relativistic term.
    pub fn clock(&self, satellite: SatelliteId) -> &[ClockNode] {
        self.clocks.of(satellite)
    }

    /// The satellites that have positions.
    pub fn satellites(&self) -> impl Iterator<Item = SatelliteId> + '_ {
        self.orbits.satellites()
    }

    /// First and last time that has a position.
    pub fn span(&self) -> Option<(GpsTime, GpsTime)> {
        self.orbits.span()
    }

    /// The time between neighbouring positions that occurs most often `[s]`.
    pub fn spacing(&self) -> Option<f64> {
        self.orbits.spacing()
    }

    fn from_lines(lines: Lines) -> Result<Self, ReadError> {
        let report = ReadReport::new(lines.file());
        Reader { report, lines, sp3: Self::default(), time: None, scale: Scale::Dates(TimeScale::Gps) }.read()
    }
}

/// The scale of dates.
#[derive(Clone, Copy)]
enum Scale {
    Dates(TimeScale),
    Tai,
}

impl Scale {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"GPS" | b"GAL" | b"QZS" | b"IRN" | b"ccc" | b"" => Self::Dates(TimeScale::Gps),
            b"BDT" | b"BDS" => Self::Dates(TimeScale::BeiDou),
            b"UTC" | b"GLO" => Self::Dates(TimeScale::Utc),
            b"TAI" => Self::Tai,
            _ => return None,
        })
    }

    fn time(self, line: &[u8]) -> Option<GpsTime> {
        let on = |scale: TimeScale| scale.time(columns(line, 3, 7), columns(line, 7, 19), columns(line, 20, 31));
        match self {
            Self::Dates(scale) => on(scale),
            Self::Tai => on(TimeScale::Gps).map(|time| time.plus_seconds(-TAI_MINUS_GPST)),
        }
    }
}

struct Reader {
    report: ReadReport,
    lines: Lines,
    sp3: Sp3,
    /// Of the current epoch; `None` before the first and where its line is unreadable.
    time: Option<GpsTime>,
    scale: Scale,
}

impl Reader {
    fn read(mut self) -> Result<Sp3, ReadError> {
        self.header()?;
        let mut ended = false;
        while self.lines.advance(&mut self.report)? {
            match self.lines.line() {
                [b'E', b'O', b'F', ..] => {
                    ended = true;
                    break;
                }
                [b'*', ..] => {
                    self.time = self.scale.time(self.lines.line());
                    match self.time {
                        Some(_) => self.report.records += 1,
                        None => self.report.drop_one(Reason::LineUnreadable, self.lines.number()),
                    }
                }
                [b'P', ..] => self.position(),
                [b'V', ..] | [b'E', ..] | [b'/', b'*', ..] => {}
                line if line.trim_ascii().is_empty() => {}
                _ => self.report.drop_one(Reason::LineUnreadable, self.lines.number()),
            }
        }
        let line = self.lines.number();
        if !ended {
            self.report.drop_one(Reason::EndMissing, line);
        }
        let duplicates = self.sp3.orbits.sort() + self.sp3.clocks.sort();
        self.report.drop_many(Reason::NodeDuplicate, duplicates, line);
        self.report.observations = (self.sp3.orbits.len() + self.sp3.clocks.len()) as u64;
        if self.sp3.orbits.len() == 0 {
            return Err(ReadError::Header {
                file: self.lines.file().to_owned(),
                line,
                problem: "the file has no position of a satellite".to_owned(),
                remedy: "fetch or write it again",
            });
        }
        self.sp3.reports.push(self.report);
        Ok(self.sp3)
    }

    /// The lines before the first epoch, which stays to be read.
    fn header(&mut self) -> Result<(), ReadError> {
        let file = self.lines.file().to_owned();
        if !self.lines.advance(&mut self.report)? {
            return Err(ReadError::Empty { file });
        }
        let line = self.lines.line();
        if kind_of_line(line) != Some(FileKind::PreciseOrbit) {
            const REMEDY: &str =
                "its first line should begin with #a, #b, #c or #d; give the orbits of an analysis centre";
            return Err(ReadError::NotOfKind { file, expected: FileKind::PreciseOrbit, remedy: REMEDY });
        }
        let mut header = Sp3Header {
            file: file.clone(),
            version: line.get(1).map_or(' ', |&byte| byte as char),
            frame: text(line, 46, 51),
            orbit_type: text(line, 52, 55),
            agency: text(line, 56, 60),
            interval: 0.0,
            antenna_model: None,
        };
        let mut scale_lines = 0;
        while self.lines.advance(&mut self.report)? {
            let line = self.lines.line();
            match line {
                [b'*', ..] => {
                    self.lines.unread();
                    break;
                }
                [b'#', b'#', ..] => {
                    header.interval = real(columns(line, 24, 38)).filter(|&interval| interval > 0.0).unwrap_or(0.0);
                }
                [b'%', b'c', ..] => {
                    scale_lines += 1;
                    let name = columns(line, 9, 12).trim_ascii();
                    if scale_lines == 1 {
                        self.scale = Scale::named(name).ok_or_else(|| ReadError::Header {
                            file: file.clone(),
                            line: self.lines.number(),
                            problem: format!("the time system \"{}\" is not known", text(line, 9, 12)),
                            remedy: "give orbits in GPS time, as the IGS publishes them",
                        })?;
                    }
                }
                [b'/', b'*', rest @ ..] => {
                    header.antenna_model = header.antenna_model.or_else(|| antenna_model(rest));
                }
                _ => {}
            }
        }
        self.sp3.headers.push(header);
        Ok(())
    }

    fn position(&mut self) {
        let number = self.lines.number();
        let line = self.lines.line();
        let Some(time) = self.time else { return self.report.drop_one(Reason::LineUnreadable, number) };
        let satellite = match satellite(columns(line, 1, 4)) {
            Ok(satellite) => satellite,
            Err(reason) => return self.report.drop_one(reason, number),
        };
        let coordinate = |i: usize| real(columns(line, 4 + 14 * i, 18 + 14 * i));
        let (Some(x), Some(y), Some(z)) = (coordinate(0), coordinate(1), coordinate(2)) else {
            // (A last line without its end may have lost digits; they are all needed.)
            let reason = if self.lines.is_whole() { Reason::ValueUnreadable } else { Reason::Truncated };
            return self.report.drop_one(reason, number);
        };
        let clock = real(columns(line, 46, 60));
        if !self.lines.is_whole() && line.len() < 60 {
            return self.report.drop_one(Reason::Truncated, number);
        }
        let flag = |column: usize, letter: u8| line.get(column) == Some(&letter);
        let (event, clock_predicted) = (flag(74, b'E'), flag(75, b'P'));
        let (manoeuvre, orbit_predicted) = (flag(78, b'M'), flag(79, b'P'));

        let position = Vector3::new(x, y, z) * 1e3;
        if position == Vector3::zeros() {
            self.report.drop_one(Reason::PositionAbsent, number);
        } else if !RADII.contains(&position.norm()) {
            self.report.drop_one(Reason::ValueAbsurd, number);
        } else if manoeuvre {
            self.report.drop_one(Reason::Manoeuvre, number);
        } else {
            self.sp3.orbits.push(satellite, OrbitNode { time, position });
            self.sp3.predicted_positions += u64::from(orbit_predicted);
        }

        match clock {
            None if columns(line, 46, 60).trim_ascii().is_empty() => self.report.drop_one(Reason::ClockAbsent, number),
            None => self.report.drop_one(Reason::ValueUnreadable, number),
            Some(bias) if bias.abs() >= NO_CLOCK => self.report.drop_one(Reason::ClockAbsent, number),
            Some(_) if event => self.report.drop_one(Reason::ClockEvent, number),
            Some(bias) => {
                self.sp3.clocks.push(satellite, ClockNode { time, bias: bias * 1e-6 });
                self.sp3.predicted_clocks += u64::from(clock_predicted);
            }
        }
    }
}

/// `G01`, `G 1`, or ` 1` of SP3-a, which has GPS alone.
pub(super) fn satellite(field: &[u8]) -> Result<SatelliteId, Reason> {
    let [letter, number @ ..] = field else { return Err(Reason::SatelliteUnreadable) };
    let constellation = match letter {
        b' ' => Constellation::Gps,
        b'S' | b'I' | b'L' => return Err(Reason::SatelliteUnsupported),
        &letter => Constellation::from_letter(letter as char).ok_or(Reason::SatelliteUnreadable)?,
    };
    let number = super::field::integer(number).and_then(|number| u8::try_from(number).ok());
    number.and_then(|number| SatelliteId::new(constellation, number)).ok_or(Reason::SatelliteUnreadable)
}

/// `IGS14_2108` of a comment `PCV:IGS14_2108 OL/AL:…`.
fn antenna_model(comment: &[u8]) -> Option<String> {
    let comment = comment.trim_ascii().strip_prefix(b"PCV:")?;
    let word = comment.split(u8::is_ascii_whitespace).next()?;
    Some(word.iter().map(|&byte| byte as char).collect()).filter(|name: &String| !name.is_empty())
}

#[cfg(test)]
#[path = "sp3_tests.rs"]
mod tests;
