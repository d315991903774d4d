//! Antenna phase centres: ANTEX 1.4 (and what of 1.3 is the same).
//!
//! Source: M. Rothacher, R. Schmid, *ANTEX: The Antenna Exchange Format, Version 1.4* (IGS, 2010). Millimetres become
//! metres. Satellites are found by number and time, because numbers are given to one spacecraft after another; receivers
//! by their name of 20 columns, antenna and radome. RMS values are passed over.

use super::error::{FileKind, ReadError};
use super::field::{columns, integer, real, text};
use super::kind::kind_of_line;
use super::lines::Lines;
use super::report::{ReadReport, Reason};
use super::rinex::TimeScale;
use std::io::BufRead;
use std::path::Path;
use surefix_core::gnss::antenna::{AntennaBand, Calibration, Variations};
use surefix_core::gnss::attitude::Block;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;

/// Values of a grid row: angles 0…90° in steps from 0.1° on.
const MOST_ANGLES: usize = 1_000;
/// Rows of a grid: azimuths 0…360° in steps from 0.5° on.
const MOST_AZIMUTHS: usize = 721;

/// The calibration of an antenna for one frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct AntexCalibration {
    /// The frequency.
    pub band: AntennaBand,
    /// Offset `[m]`: x, y, z of a satellite, **north, east, up** of a receiver antenna.
    pub offset: [f64; 3],
    first: f64,
    step: f64,
    mean: Vec<f64>,
    azimuth_step: f64,
    rows: Vec<f64>,
}

impl AntexCalibration {
    /// As the models take it.
    pub fn view(&self) -> Calibration<'_> {
        let Self { band, offset, first, step, ref mean, azimuth_step, ref rows } = *self;
        Calibration { band, offset, variations: Variations { first, step, mean, azimuth_step, rows } }
    }
}

/// The antenna of a satellite.
#[derive(Clone, Debug, PartialEq)]
pub struct SatelliteAntenna {
    /// The satellite's number in its time.
    pub satellite: SatelliteId,
    /// Antenna type, as `BLOCK IIF`.
    pub antenna_type: String,
    /// The kind of satellite that this says.
    pub block: Block,
    /// Spacecraft number, as `G063`.
    pub spacecraft: String,
    /// From when; always if not given.
    pub from: Option<GpsTime>,
    /// Until when; still if not given.
    pub until: Option<GpsTime>,
    /// Name of the model for SINEX files, as `IGS14_2134`.
    pub model: String,
    /// Calibrations by frequency.
    pub calibrations: Vec<AntexCalibration>,
}

/// The antenna of a receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceiverAntenna {
    /// Type, 16 columns without trailing blanks.
    pub antenna: String,
    /// Radome, 4 columns; `NONE` without.
    pub radome: String,
    /// Serial number, for a single one; empty for the type.
    pub serial: String,
    /// Name of the model for SINEX files.
    pub model: String,
    /// Calibrations by frequency.
    pub calibrations: Vec<AntexCalibration>,
}

/// Bands that a receiver antenna may be asked for, beside those of GPS: constellation and RINEX digits.
const WANTED: [(Constellation, &[u8]); 4] = [
    (Constellation::Galileo, b"15678"),
    (Constellation::BeiDou, b"125678"),
    (Constellation::Qzss, b"1256"),
    (Constellation::Gps, b"5"),
];

impl ReceiverAntenna {
    /// Adds calibrations for the frequencies that have none: those of GPS L1 and L2, carried on linearly in the wavelength.
    /// Returns for which.
    ///
    /// Taking L2 as it is for E5a, as is usual, puts the ionosphere-free phase centre of Galileo off by 0.29 times the difference
    /// of both offsets: 8 mm in height for a choke ring antenna.
    pub fn complete(&mut self) -> Vec<AntennaBand> {
        let of_gps = |digit| AntennaBand::new(Constellation::Gps, digit);
        let find = |band: Option<AntennaBand>| self.calibrations.iter().find(|own| Some(own.band) == band).cloned();
        let (Some(l1), Some(l2)) = (find(of_gps(b'1')), find(of_gps(b'2'))) else { return Vec::new() };
        let alike = l1.mean.len() == l2.mean.len()
            && l1.rows.len() == l2.rows.len()
            && (l1.first, l1.step, l1.azimuth_step) == (l2.first, l2.step, l2.azimuth_step);
        let wavelength = |band: AntennaBand| band.frequency().map(|frequency| 1.0 / frequency);
        let (Some(short), Some(long), true) = (wavelength(l1.band), wavelength(l2.band), alike) else {
            return Vec::new();
        };
        let mut added = Vec::new();
        for (constellation, digits) in WANTED {
            for band in digits.iter().filter_map(|&digit| AntennaBand::new(constellation, digit)) {
                let Some(own) = wavelength(band).filter(|_| self.calibrations.iter().all(|known| known.band != band))
                else {
                    continue;
                };
                let share = (own - short) / (long - short);
                let between = |a: f64, b: f64| a + share * (b - a);
                let grid = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(&a, &b)| between(a, b)).collect();
                self.calibrations.push(AntexCalibration {
                    band,
                    offset: std::array::from_fn(|i| between(l1.offset[i], l2.offset[i])),
                    mean: grid(&l1.mean, &l2.mean),
                    rows: grid(&l1.rows, &l2.rows),
                    ..l1.clone()
                });
                added.push(band);
            }
        }
        added
    }
}

/// A receiver antenna that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<'a> {
    /// The antenna.
    pub antenna: &'a ReceiverAntenna,
    /// Whether it is the radome asked for; otherwise that without a radome stands in.
    pub radome_known: bool,
}

/// An ANTEX file.
#[derive(Clone, Debug, PartialEq)]
pub struct Antex {
    /// Satellite antennas, by satellite and time.
    pub satellites: Vec<SatelliteAntenna>,
    /// Receiver antennas, by name.
    pub receivers: Vec<ReceiverAntenna>,
    /// The model that most antennas are of (`IGS14_2134`), for comparison with that of orbits and clocks.
    pub model: Option<String>,
    /// Whether variations are absolute; relative ones must not be used with present products.
    pub absolute: bool,
    /// What was read and dropped.
    pub report: ReadReport,
}

impl Antex {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::from_lines(Lines::open(path)?)
    }

    /// Reads `input`, called `file` in messages.
    pub fn new(file: &str, input: impl BufRead + Send + 'static) -> Result<Self, ReadError> {
        Self::from_lines(Lines::new(file, input))
    }

    /// The antenna of a satellite at a time.
    pub fn satellite(&self, satellite: SatelliteId, time: GpsTime) -> Option<&SatelliteAntenna> {
        let start = self.satellites.partition_point(|antenna| antenna.satellite < satellite);
        let own = self.satellites.get(start..)?.iter().take_while(|antenna| antenna.satellite == satellite);
        let valid = |antenna: &&SatelliteAntenna| {
            antenna.from.is_none_or(|from| from <= time) && antenna.until.is_none_or(|until| time <= until)
        };
        own.filter(valid).last()
    }

    /// The antenna of a receiver by its name as in observation files: type and radome (`LEIAR25.R3      LEIT`), blank
    /// radome meaning none. Without a calibration of that radome, the one without a radome is given, which is said.
    pub fn receiver(&self, name: &str) -> Option<Found<'_>> {
        let (antenna, radome) = type_and_radome(name.as_bytes());
        let of = |radome: &str| {
            let key = (antenna.as_str(), radome, "");
            let at = self.receivers.binary_search_by(|entry| {
                (entry.antenna.as_str(), entry.radome.as_str(), entry.serial.as_str()).cmp(&key)
            });
            at.ok().and_then(|index| self.receivers.get(index))
        };
        of(&radome)
            .map(|antenna| Found { antenna, radome_known: true })
            .or_else(|| of("NONE").map(|antenna| Found { antenna, radome_known: false }))
    }

    fn from_lines(mut lines: Lines) -> Result<Self, ReadError> {
        let mut report = ReadReport::new(lines.file());
        let absolute = header(&mut lines, &mut report)?;
        let (mut satellites, mut receivers) = (Vec::new(), Vec::new());
        let mut current: Option<Record> = None;
        while lines.advance(&mut report)? {
            let (line, number) = (lines.line(), lines.number());
            match label(line) {
                b"START OF ANTENNA" => {
                    if let Some(unfinished) = current.replace(Record::new(number)) {
                        report.drop_one(Reason::AntennaUnreadable, unfinished.line);
                    }
                }
                b"END OF ANTENNA" => {
                    let Some(record) = current.take() else {
                        report.drop_one(Reason::LineUnreadable, number);
                        continue;
                    };
                    let line = record.line;
                    match record.finish() {
                        Ok(Antenna::Satellite(antenna)) => satellites.push(antenna),
                        Ok(Antenna::Receiver(antenna)) => receivers.push(antenna),
                        Err(reason) => report.drop_one(reason, line),
                    }
                }
                _ => match &mut current {
                    Some(record) => record.line(line),
                    None if line.trim_ascii().is_empty() || label(line) == b"COMMENT" => {}
                    None => report.drop_one(Reason::LineUnreadable, number),
                },
            }
        }
        if let Some(unfinished) = current {
            report.drop_one(Reason::Truncated, unfinished.line);
        }
        if satellites.is_empty() && receivers.is_empty() {
            return Err(ReadError::Header {
                file: lines.file().to_owned(),
                line: lines.number(),
                problem: "the file has no antenna".to_owned(),
                remedy: "fetch or write it again",
            });
        }
        report.records = (satellites.len() + receivers.len()) as u64;
        satellites.sort_by_key(|antenna: &SatelliteAntenna| (antenna.satellite, antenna.from));
        let key = |antenna: &ReceiverAntenna| (antenna.antenna.clone(), antenna.radome.clone(), antenna.serial.clone());
        receivers.sort_by_cached_key(key);
        let model = most_frequent(
            satellites.iter().map(|antenna| &antenna.model).chain(receivers.iter().map(|antenna| &antenna.model)),
        );
        Ok(Self { satellites, receivers, model, absolute, report })
    }
}

/// Reads the header; whether variations are absolute.
fn header(lines: &mut Lines, report: &mut ReadReport) -> Result<bool, ReadError> {
    let file = lines.file().to_owned();
    if !lines.advance(report)? {
        return Err(ReadError::Empty { file });
    }
    if kind_of_line(lines.line()) != Some(FileKind::Antenna) {
        const REMEDY: &str = "its first line should end in \"ANTEX VERSION / SYST\"; give a file as igs20.atx";
        return Err(ReadError::NotOfKind { file, expected: FileKind::Antenna, remedy: REMEDY });
    }
    let mut absolute = true;
    while lines.advance(report)? {
        match label(lines.line()) {
            b"PCV TYPE / REFANT" => absolute = lines.line().first() != Some(&b'R'),
            b"END OF HEADER" => return Ok(absolute),
            // A file without the line that ends the header.
            b"START OF ANTENNA" => {
                lines.unread();
                return Ok(absolute);
            }
            _ => {}
        }
    }
    Err(ReadError::Header {
        file,
        line: lines.number(),
        problem: "the file ends within its header (no END OF HEADER)".to_owned(),
        remedy: "fetch or write it again",
    })
}

/// The label of a line, columns 61–80.
fn label(line: &[u8]) -> &[u8] {
    columns(line, 60, 80).trim_ascii()
}

/// Antenna and radome of a name of 20 columns.
fn type_and_radome(name: &[u8]) -> (String, String) {
    let (antenna, radome) = (text(name, 0, 16), text(name, 16, 20));
    (antenna, if radome.is_empty() { "NONE".to_owned() } else { radome })
}

/// The value that occurs most often, not empty.
fn most_frequent<'a>(values: impl Iterator<Item = &'a String>) -> Option<String> {
    let mut counts = std::collections::BTreeMap::new();
    values.filter(|value| !value.is_empty()).for_each(|value| *counts.entry(value).or_insert(0_usize) += 1);
    counts.into_iter().max_by_key(|entry| entry.1).map(|entry| entry.0.clone())
}

enum Antenna {
    Satellite(SatelliteAntenna),
    Receiver(ReceiverAntenna),
}

/// An antenna while it is read.
struct Record {
    /// Line of its beginning.
    line: u64,
    name: Vec<u8>,
    serial: String,
    spacecraft: String,
    from: Option<GpsTime>,
    until: Option<GpsTime>,
    model: String,
    /// First, last and step of the zenith or nadir angle, and step of azimuth `[deg]`.
    grid: Option<[f64; 3]>,
    azimuth_step: f64,
    calibrations: Vec<AntexCalibration>,
    /// The frequency whose lines are being read: `None` outside, `Some(None)` in one that is passed over.
    frequency: Option<Option<AntexCalibration>>,
    rms: bool,
    damaged: bool,
}

impl Record {
    fn new(line: u64) -> Self {
        Self {
            line,
            name: Vec::new(),
            serial: String::new(),
            spacecraft: String::new(),
            from: None,
            until: None,
            model: String::new(),
            grid: None,
            azimuth_step: 0.0,
            calibrations: Vec::new(),
            frequency: None,
            rms: false,
            damaged: false,
        }
    }

    fn line(&mut self, line: &[u8]) {
        match label(line) {
            b"TYPE / SERIAL NO" => {
                self.name = columns(line, 0, 20).to_vec();
                self.serial = text(line, 20, 40);
                self.spacecraft = text(line, 40, 50);
            }
            b"DAZI" => self.azimuth_step = self.number(columns(line, 2, 8)),
            b"ZEN1 / ZEN2 / DZEN" => {
                let [first, last, step] = [2, 8, 14].map(|start| self.number(columns(line, start, start + 6)));
                self.grid = Some([first, last, step]);
            }
            b"VALID FROM" => self.from = self.date(line),
            b"VALID UNTIL" => self.until = self.date(line),
            b"SINEX CODE" => self.model = text(line, 0, 10),
            b"START OF FREQUENCY" => self.frequency = Some(self.calibration(line)),
            b"END OF FREQUENCY" => match self.frequency.take() {
                Some(calibration) => self.calibrations.extend(calibration),
                None => self.damaged = true,
            },
            b"START OF FREQ RMS" => self.rms = true,
            b"END OF FREQ RMS" => self.rms = false,
            b"NORTH / EAST / UP" if !self.rms => {
                let offset = [0, 10, 20].map(|start| self.number(columns(line, start, start + 10)) * 1e-3);
                if let Some(Some(calibration)) = &mut self.frequency {
                    calibration.offset = offset;
                }
            }
            b"METH / BY / # / DATE" | b"# OF FREQUENCIES" | b"COMMENT" => {}
            _ if self.rms => {}
            _ => self.values(line),
        }
    }

    fn number(&mut self, field: &[u8]) -> f64 {
        real(field).unwrap_or_else(|| {
            self.damaged = true;
            0.0
        })
    }

    fn date(&mut self, line: &[u8]) -> Option<GpsTime> {
        // Year to minute six columns each, seconds 13.
        let mut month_to_minute = Vec::with_capacity(12);
        for start in [6, 12, 18, 24] {
            month_to_minute.extend_from_slice(columns(line, start + 3, start + 6));
        }
        let year = columns(line, 0, 6);
        let time = if integer(year).is_some_and(|year| (1950..1980).contains(&year)) {
            // Before there was GPS time.
            Some(GpsTime::default())
        } else {
            TimeScale::Gps.time(year, &month_to_minute, columns(line, 30, 43))
        };
        self.damaged |= time.is_none();
        time
    }

    /// The empty calibration of a frequency; `None` for those of constellations that are not supported.
    fn calibration(&mut self, line: &[u8]) -> Option<AntexCalibration> {
        let (letter, band) = (line.get(3).copied()?, line.get(5).copied()?);
        let band = AntennaBand::new(Constellation::from_letter(letter as char)?, band)?;
        let [first, _, step] = self.grid.unwrap_or_default();
        let (mean, rows) = (Vec::new(), Vec::new());
        Some(AntexCalibration { band, offset: [0.0; 3], first, step, mean, azimuth_step: self.azimuth_step, rows })
    }

    /// A row of variations: `NOAZI`, or an azimuth.
    fn values(&mut self, line: &[u8]) {
        let Some(Some(calibration)) = &mut self.frequency else { return };
        let (name, values) = line.split_at_checked(8).unwrap_or((line, &[]));
        let mut row = Vec::with_capacity(values.len() / 8 + 1);
        for field in values.chunks(8).filter(|field| !field.trim_ascii().is_empty()) {
            match real(field) {
                Some(value) => row.push(value * 1e-3),
                None => self.damaged = true,
            }
        }
        if name.trim_ascii() == b"NOAZI" {
            calibration.mean = row;
        } else if real(name).is_some() {
            calibration.rows.append(&mut row);
        } else {
            self.damaged = true;
        }
    }

    /// The antenna, if what was read of it makes one.
    fn finish(self) -> Result<Antenna, Reason> {
        let unreadable = Reason::AntennaUnreadable;
        let [first, last, step] = self.grid.ok_or(unreadable)?;
        let count = ((last - first) / step).round() + 1.0;
        let azimuths = if self.azimuth_step > 0.0 { (360.0 / self.azimuth_step).round() + 1.0 } else { 0.0 };
        let sensible = step > 0.0 && (1.0..=MOST_ANGLES as f64).contains(&count) && azimuths <= MOST_AZIMUTHS as f64;
        let complete = |calibration: &AntexCalibration| {
            calibration.mean.len() == count as usize && calibration.rows.len() == count as usize * azimuths as usize
        };
        if self.damaged || self.frequency.is_some() || !sensible || !self.calibrations.iter().all(complete) {
            return Err(unreadable);
        }
        let (antenna, radome) = type_and_radome(&self.name);
        let Self { calibrations, model, serial, .. } = self;
        // A satellite antenna has the satellite's name where others have a serial number, and a spacecraft number.
        if self.spacecraft.is_empty() {
            return Ok(Antenna::Receiver(ReceiverAntenna { antenna, radome, serial, model, calibrations }));
        }
        let satellite = super::sp3::satellite(serial.as_bytes())?;
        let antenna_type = text(&self.name, 0, 20);
        Ok(Antenna::Satellite(SatelliteAntenna {
            satellite,
            block: Block::from_antex(&antenna_type),
            antenna_type,
            spacecraft: self.spacecraft,
            from: self.from,
            until: self.until,
            model,
            calibrations,
        }))
    }
}

#[cfg(test)]
#[path = "antex_tests.rs"]
mod tests;
