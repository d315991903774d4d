//! Navigation messages of RINEX 2 and 3.
//!
//! Times: a date of a Kepler record is on the time scale of its constellation (GPST; BDT for BeiDou), one of a GLONASS
//! record is UTC. The time of ephemeris is given as second of week; its week is taken from the date (the nearest one),
//! because the week fields of files count differently and disagree around a change of week.

use super::header::{FirstLine, first_line, label, unfinished};
use super::time_scale::TimeScale;
use crate::read::field::{columns, integer, scientific};
use crate::read::lines::Lines;
use crate::read::{FileKind, ReadError, ReadReport, Reason};
use std::io::BufRead;
use std::ops::RangeInclusive;
use std::path::Path;
use surefix_core::gnss::atmosphere::Klobuchar;
use surefix_core::gnss::ephemeris::{Ephemeris, GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::scales::GPST_MINUS_BDT;
use surefix_core::gnss::time::{GpsTime, SECONDS_PER_WEEK};

/// What navigation files say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NavigationData {
    /// The ephemerides, in order of their reference time, then satellite.
    pub ephemerides: Vec<Ephemeris>,
    /// Broadcast ionosphere by [`Constellation::index`], where given.
    pub klobuchar: [Option<Klobuchar>; 5],
    /// Galileo's effective ionisation level coefficients a_i0, a_i1, a_i2 (NeQuick), where given.
    pub galileo_ionosphere: Option<[f64; 3]>,
    /// GPST − UTC `[s]`, where given.
    pub leap_seconds: Option<i32>,
    /// What was read and dropped, a report a file.
    pub reports: Vec<ReadReport>,
}

/// Lines of a record after its first.
const MOST_ORBIT_LINES: usize = 7;
/// Values of a record.
const VALUES: usize = 3 + 4 * MOST_ORBIT_LINES;
/// Columns of a value.
const VALUE: usize = 19;

/// A record as numbers.
struct Record {
    satellite: SatelliteId,
    /// Date of the first line.
    time: GpsTime,
    /// The three of the first line, then four a line; NaN where blank.
    values: [f64; VALUES],
}

impl NavigationData {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::from_lines(Lines::open(path)?)
    }

    /// Reads `input`, called `file` in messages.
    pub fn new(file: &str, input: impl BufRead + Send + 'static) -> Result<Self, ReadError> {
        Self::from_lines(Lines::new(file, input))
    }

    /// Adds what another file says. Messages that are there already are counted in the other's report; header values
    /// that are there already stay.
    pub fn merge(&mut self, mut other: Self) {
        let mut duplicates = 0;
        for ephemeris in other.ephemerides {
            if !self.insert(ephemeris) {
                duplicates += 1;
            }
        }
        if let Some(report) = other.reports.first_mut() {
            report.records = report.records.saturating_sub(duplicates);
            report.drop_many(Reason::MessageDuplicate, duplicates, 0);
        }
        for (own, others) in self.klobuchar.iter_mut().zip(other.klobuchar) {
            *own = own.or(others);
        }
        self.galileo_ionosphere = self.galileo_ionosphere.or(other.galileo_ionosphere);
        self.leap_seconds = self.leap_seconds.or(other.leap_seconds);
        self.reports.append(&mut other.reports);
    }

    /// Inserts in order; false if the same message is there already.
    fn insert(&mut self, ephemeris: Ephemeris) -> bool {
        let key = |e: &Ephemeris| (e.toe(), e.satellite());
        let start = self.ephemerides.partition_point(|e| key(e) < key(&ephemeris));
        let equals = self.ephemerides[start..].iter().take_while(|e| key(e) == key(&ephemeris));
        let end = start + equals.clone().count();
        if equals.clone().any(|known| *known == ephemeris) {
            return false;
        }
        self.ephemerides.insert(end, ephemeris);
        true
    }

    fn from_lines(mut lines: Lines) -> Result<Self, ReadError> {
        let mut report = ReadReport::new(lines.file());
        if !lines.advance(&mut report)? {
            return Err(ReadError::Empty { file: lines.file().to_owned() });
        }
        let first = first_line(&lines, FileKind::Navigation)?;
        let mut data = Self::default();
        data.read_header(&mut lines, first, &mut report)?;
        let mut more = lines.advance(&mut report)?;
        while more {
            if lines.line().trim_ascii().is_empty() {
                more = lines.advance(&mut report)?;
                continue;
            }
            let line_number = lines.number();
            let (message, ended) = read_message(&mut lines, first, &mut report)?;
            more = !ended;
            match message {
                Ok(ephemeris) if data.insert(ephemeris) => report.records += 1,
                Ok(_) => report.drop_one(Reason::MessageDuplicate, line_number),
                Err(reason) => report.drop_one(reason, line_number),
            }
        }
        data.reports.push(report);
        Ok(data)
    }

    fn read_header(&mut self, lines: &mut Lines, first: FirstLine, report: &mut ReadReport) -> Result<(), ReadError> {
        let mut alpha = [None; 5];
        let mut beta = [None; 5];
        while lines.advance(report)? {
            let line = lines.line();
            let four =
                |start: usize| [0, 1, 2, 3].map(|i| scientific(columns(line, start + 12 * i, start + 12 * i + 12)));
            let mut set = |constellation: Constellation, part: u8, values: [Option<f64>; 4]| {
                let [Some(a), Some(b), Some(c), Some(d)] = values else { return };
                let half = if part == b'A' { &mut alpha } else { &mut beta };
                half[constellation.index()].get_or_insert([a, b, c, d]);
            };
            match label(line) {
                b"ION ALPHA" => set(Constellation::Gps, b'A', four(2)),
                b"ION BETA" => set(Constellation::Gps, b'B', four(2)),
                b"IONOSPHERIC CORR" => match (columns(line, 0, 4), four(5)) {
                    (b"GAL ", [Some(a0), Some(a1), Some(a2), _]) => self.galileo_ionosphere = Some([a0, a1, a2]),
                    ([b'G', b'P', b'S', part], values) => set(Constellation::Gps, *part, values),
                    ([b'B', b'D', b'S', part], values) => set(Constellation::BeiDou, *part, values),
                    ([b'Q', b'Z', b'S', part], values) => set(Constellation::Qzss, *part, values),
                    _ => {}
                },
                b"LEAP SECONDS" => {
                    // BeiDou's count begins in 2006, where GPST − UTC was 14 s.
                    let beidou = columns(line, 24, 27) == b"BDS" || first.system == b'C';
                    let since_1980 = if beidou { GPST_MINUS_BDT as i32 } else { 0 };
                    self.leap_seconds = integer(columns(line, 0, 6)).map(|seconds| seconds + since_1980);
                }
                b"END OF HEADER" => {
                    let both = |i: usize| Some(Klobuchar { alpha: alpha[i]?, beta: beta[i]? });
                    self.klobuchar = [0, 1, 2, 3, 4].map(both);
                    return Ok(());
                }
                _ => {}
            }
        }
        Err(unfinished(lines))
    }
}

/// Reads the message that begins at the current line and goes to the line after it; the second value says that the
/// file ended.
fn read_message(
    lines: &mut Lines,
    first: FirstLine,
    report: &mut ReadReport,
) -> Result<(Result<Ephemeris, Reason>, bool), ReadError> {
    let indent = if first.version.major == 2 { 3 } else { 4 };
    let start = read_start(lines.line(), first);
    let mut values = [f64::NAN; VALUES];
    let mut readable = read_values(lines.line(), indent + VALUE, &mut values[..3]);
    let mut orbit_lines = 0;
    let ended = loop {
        if !lines.advance(report)? {
            break true;
        }
        let line = lines.line();
        if line.is_empty() || columns(line, 0, 3).iter().any(|&byte| byte != b' ') {
            break false;
        }
        if let Some(values) = values.get_mut(3 + 4 * orbit_lines..7 + 4 * orbit_lines) {
            readable &= read_values(line, indent, values);
        }
        orbit_lines += 1;
    };
    let message = start.and_then(|(satellite, time)| {
        let record = Record { satellite, time, values };
        let needed = if satellite.constellation() == Constellation::Glonass { 3 } else { 7 };
        match readable {
            _ if orbit_lines < needed && ended => Err(Reason::Truncated),
            true if orbit_lines >= needed => record.ephemeris(),
            _ => Err(Reason::MessageUnreadable),
        }
    });
    Ok((message, ended))
}

/// Satellite and date of the first line of a record.
fn read_start(line: &[u8], first: FirstLine) -> Result<(SatelliteId, GpsTime), Reason> {
    let version_2 = first.version.major == 2;
    let (letter, number, year, date, seconds) = if version_2 {
        let letter = match first.file_type {
            b'N' => b'G',
            b'G' => b'R',
            b'L' | b'E' => b'E',
            b'J' => b'J',
            _ => b'S',
        };
        (letter, columns(line, 0, 2), columns(line, 2, 5), columns(line, 5, 17), columns(line, 17, 22))
    } else {
        let letter = line.first().copied().unwrap_or(b' ');
        (letter, columns(line, 1, 3), columns(line, 3, 8), columns(line, 8, 20), columns(line, 20, 23))
    };
    if matches!(letter, b'S' | b'I') {
        return Err(Reason::MessageUnsupported);
    }
    let read = || {
        let constellation = Constellation::from_letter(letter as char)?;
        let satellite = SatelliteId::new(constellation, u8::try_from(integer(number)?).ok()?)?;
        let scale = match constellation {
            Constellation::BeiDou => TimeScale::BeiDou,
            Constellation::Glonass => TimeScale::Utc,
            _ => TimeScale::Gps,
        };
        Some((satellite, scale.time(year, date, seconds)?))
    };
    read().ok_or(Reason::MessageUnreadable)
}

/// Reads values of 19 columns from `start` on; NaN where blank. False if one is no number or cut off.
fn read_values(line: &[u8], start: usize, values: &mut [f64]) -> bool {
    values.iter_mut().enumerate().all(|(i, value)| {
        let field = columns(line, start + VALUE * i, start + VALUE * (i + 1));
        let whole = field.get(VALUE - 1).is_some_and(u8::is_ascii_digit);
        match scientific(field).filter(|_| whole) {
            Some(number) => *value = number,
            None => return field.trim_ascii().is_empty(),
        }
        true
    })
}

impl Record {
    fn ephemeris(&self) -> Result<Ephemeris, Reason> {
        if self.satellite.constellation() == Constellation::Glonass { self.glonass() } else { self.kepler() }
    }

    /// Value `i`, 0 where blank.
    fn value(&self, i: usize) -> f64 {
        self.values.get(i).copied().filter(|value| !value.is_nan()).unwrap_or(0.0)
    }

    /// Value `i` as a whole number of 16 bits, as broadcast words are.
    fn word(&self, i: usize) -> u16 {
        self.value(i) as u16
    }

    /// Tables A6, A8, A12 and A14 of RINEX 3.05; A4 of RINEX 2.11.
    fn kepler(&self) -> Result<Ephemeris, Reason> {
        if self.values[..20].iter().any(|value| value.is_nan()) {
            return Err(Reason::MessageUnreadable);
        }
        let [
            af0,
            af1,
            af2,
            iode,
            crs,
            delta_n,
            m0,
            cuc,
            e,
            cus,
            sqrt_a,
            toe,
            cic,
            omega0,
            cis,
            i0,
            crc,
            omega,
            omega_dot,
            idot,
        ] = std::array::from_fn(|i| self.values[i]);
        let (message, group_delay, fit_interval) = match self.satellite.constellation() {
            Constellation::Galileo => (galileo_message(self.word(20)), [self.value(25), self.value(26)], 0.0),
            Constellation::BeiDou => (NavigationMessage::D1D2, [self.value(25), self.value(26)], 0.0),
            _ => (NavigationMessage::Lnav, [self.value(25), 0.0], self.value(28)),
        };
        let plausible = SQRT_A.contains(&sqrt_a) && ECCENTRICITY.contains(&e) && SECOND_OF_WEEK.contains(&toe);
        if !plausible {
            return Err(Reason::MessageAbsurd);
        }
        Ok(Ephemeris::Kepler(KeplerEphemeris {
            satellite: self.satellite,
            message,
            iode: iode as u16,
            toe: near(self.time, toe, self.satellite.constellation()),
            toc: self.time,
            sqrt_a,
            e,
            m0,
            delta_n,
            i0,
            idot,
            omega0,
            omega,
            omega_dot,
            cuc,
            cus,
            crc,
            crs,
            cic,
            cis,
            af0,
            af1,
            af2,
            group_delay,
            health: self.word(24),
            accuracy: self.value(23),
            fit_interval,
        }))
    }

    /// Table A10 of RINEX 3.05; A10 of RINEX 2.11.
    fn glonass(&self) -> Result<Ephemeris, Reason> {
        if [0, 1, 3, 4, 5, 7, 8, 9, 11, 12, 13].into_iter().any(|i: usize| self.values[i].is_nan()) {
            return Err(Reason::MessageUnreadable);
        }
        let toe = self.time;
        let metres = |first: usize| [0, 4, 8].map(|i| self.values[first + i] * 1e3);
        let (position, velocity, acceleration) = (metres(3), metres(4), metres(5));
        let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Some writers give the channel as an unsigned byte.
        let channel = self.value(10);
        let channel = if channel > 128.0 { channel - 256.0 } else { channel };
        let plausible = GLONASS_RADIUS.contains(&norm(position))
            && GLONASS_SPEED.contains(&norm(velocity))
            && (-7.0..=6.0).contains(&channel);
        if !plausible {
            return Err(Reason::MessageAbsurd);
        }
        // tb counts quarters of an hour of the Moscow day.
        let iode = (toe.glonass().seconds / 900.0).round() as u16;
        Ok(Ephemeris::Glonass(GlonassEphemeris {
            satellite: self.satellite,
            iode,
            channel: channel as i8,
            toe,
            position,
            velocity,
            acceleration,
            clock_bias: self.values[0],
            frequency_bias: self.values[1],
            health: self.word(6),
            age: self.value(14),
        }))
    }
}

/// Square roots of semi-major axes `[√m]` of navigation satellites: MEO 5053…5441, GEO and IGSO 6493.
const SQRT_A: RangeInclusive<f64> = 4500.0..=7000.0;
/// Eccentricities of navigation satellites; the largest is 0.17 (E14, E18).
const ECCENTRICITY: RangeInclusive<f64> = 0.0..=0.5;
/// Second of week `[s]`.
const SECOND_OF_WEEK: RangeInclusive<f64> = 0.0..=SECONDS_PER_WEEK as f64;
/// Distance of GLONASS satellites from the geocentre `[m]`: 2.55·10⁷.
const GLONASS_RADIUS: RangeInclusive<f64> = 2.3e7..=2.8e7;
/// Speed of GLONASS satellites in the Earth-fixed frame `[m/s]`: 2.7·10³ to 3.7·10³.
const GLONASS_SPEED: RangeInclusive<f64> = 1e3..=1e4;

/// The message that a Galileo record comes from, by its data source word: bit 9 clock for E5b/E1 (I/NAV), bit 8 clock
/// for E5a/E1 (F/NAV); where a writer sets neither, bit 1 F/NAV on E5a.
fn galileo_message(data_source: u16) -> NavigationMessage {
    match data_source {
        word if word & 1 << 9 != 0 => NavigationMessage::Inav,
        word if word & 1 << 8 != 0 || word & 0b111 == 0b010 => NavigationMessage::Fnav,
        _ => NavigationMessage::Inav,
    }
}

/// The time nearest to `time` with second of week `tow` on the scale of a constellation.
fn near(time: GpsTime, tow: f64, constellation: Constellation) -> GpsTime {
    let of_week = |week: i32| match constellation {
        Constellation::BeiDou => GpsTime::from_bdt(week, tow),
        _ => GpsTime::from_week_tow(week, tow),
    };
    let week = if constellation == Constellation::BeiDou { time.bdt().0 } else { time.week() };
    let distance = |candidate: &GpsTime| (candidate.nanoseconds() - time.nanoseconds()).abs();
    [of_week(week - 1), of_week(week), of_week(week + 1)].into_iter().min_by_key(distance).unwrap_or(time)
}

#[cfg(test)]
#[path = "navigation_tests.rs"]
mod tests;
