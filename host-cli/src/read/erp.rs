//! Orientation of the Earth over time: `finals2000A` of the IERS rapid service (USNO), and IGS ERP files of version 2.
//!
//! The content tells which: IGS files begin with `version 2`, the others with a date.
//!
//! | format | fields |
//! |---|---|
//! | finals2000A | columns 8–15 MJD (UTC), 19–27 x_p `["]`, 38–46 y_p `["]`, 59–68 UT1 − UTC `[s]`, Bulletin A values (USNO readme.finals2000A) |
//! | IGS ERP 2 | MJD, x_p, y_p `[10⁻⁶ "]`, UT1 − UTC `[10⁻⁷ s]`, then what is not used (IGSMAIL-1943) |
//!
//! Between two rows the values are interpolated linearly, UT1 without its leap seconds. Tidal variations within
//! a day (0.5 mas, 50 µs) are not added.

use super::error::ReadError;
use super::field;
use super::lines::Lines;
use super::report::{ReadReport, Reason};
use std::path::Path;
use surefix_core::gnss::earth_rotation::{ARCSECOND, EarthOrientation};
use surefix_core::gnss::time::GpsTime;

/// MJD of 1980-01-06.
const MJD_OF_GPS_EPOCH: f64 = 44_244.0;
/// Rows farther apart leave a gap in which nothing is said: older files have a row every five days.
const LONGEST_GAP_S: f64 = 5.5 * 86_400.0;

/// A row of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    time: GpsTime,
    xp: f64,
    yp: f64,
    /// UT1 − GPST `[s]`, which no leap second interrupts.
    ut1_minus_gpst: f64,
}

/// Orientation of the Earth over the span of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EarthOrientationSeries {
    /// In ascending order of time.
    rows: Vec<Row>,
}

impl EarthOrientationSeries {
    /// Reads a file of either format, plain or gzipped.
    pub fn open(path: &Path) -> Result<(Self, ReadReport), ReadError> {
        Self::read(Lines::open(path)?)
    }

    fn read(mut lines: Lines) -> Result<(Self, ReadReport), ReadError> {
        let mut report = ReadReport::new(lines.file());
        let header = |line, problem: &str, lines: &Lines| ReadError::Header {
            file: lines.file().to_owned(),
            line,
            problem: problem.to_owned(),
            remedy: "give finals2000A of the IERS or an IGS ERP file of version 2",
        };
        if !lines.advance(&mut report)? {
            return Err(ReadError::Empty { file: lines.file().to_owned() });
        }
        let first = lines.line().trim_ascii().to_ascii_lowercase();
        let igs = first.strip_prefix(b"version").map(|version| version.trim_ascii().to_vec());
        match &igs {
            Some(version) if !version.starts_with(b"2") => {
                return Err(header(1, "is an ERP file of another version than 2", &lines));
            }
            None if field::real(field::columns(lines.line(), 7, 15)).is_none() => {
                return Err(header(1, "is no file of Earth orientation", &lines));
            }
            Some(_) => {}
            None => lines.unread(),
        }
        let mut series = Self::default();
        while lines.advance(&mut report)? {
            let found = if igs.is_some() { igs_row(lines.line()) } else { finals_row(lines.line()) };
            match found {
                Found::Row(row) => series.push(row, &mut report, lines.number()),
                Found::Unreadable => report.drop_one(Reason::ValueUnreadable, lines.number()),
                Found::Absurd => report.drop_one(Reason::ValueAbsurd, lines.number()),
                Found::Nothing => {}
            }
        }
        if series.rows.is_empty() {
            return Err(header(lines.number(), "there is no row with pole and UT1 in the file", &lines));
        }
        Ok((series, report))
    }

    fn push(&mut self, row: Row, report: &mut ReadReport, line: u64) {
        match self.rows.last() {
            Some(last) if row.time == last.time => report.drop_one(Reason::EpochDuplicate, line),
            Some(last) if row.time < last.time => report.drop_one(Reason::EpochOutOfOrder, line),
            _ => {
                self.rows.push(row);
                report.records += 1;
            }
        }
    }

    /// First and last time that the file has.
    pub fn span(&self) -> Option<(GpsTime, GpsTime)> {
        Some((self.rows.first()?.time, self.rows.last()?.time))
    }

    /// The orientation at a time; `None` outside the span and in gaps.
    pub fn at(&self, time: GpsTime) -> Option<EarthOrientation> {
        let after = self.rows.partition_point(|row| row.time <= time);
        let before = self.rows.get(after.checked_sub(1)?)?;
        let after = if before.time == time { before } else { self.rows.get(after)? };
        let length = after.time.since(before.time);
        if length > LONGEST_GAP_S {
            return None;
        }
        let weight = if length > 0.0 { time.since(before.time) / length } else { 0.0 };
        let between = |of: fn(&Row) -> f64| of(before) + weight * (of(after) - of(before));
        Some(EarthOrientation {
            xp: between(|row| row.xp),
            yp: between(|row| row.yp),
            ut1_minus_utc: between(|row| row.ut1_minus_gpst) + time.gpst_minus_utc() as f64,
        })
    }
}

/// What a line is.
enum Found {
    Row(Row),
    /// Not a row, or one that has no values yet.
    Nothing,
    Unreadable,
    Absurd,
}

/// A row from its values: MJD, arcseconds, seconds.
fn row(mjd: f64, xp: f64, yp: f64, ut1_minus_utc: f64) -> Found {
    let days = mjd - MJD_OF_GPS_EPOCH;
    // The pole stays within 0.6″ (C04 since 1962: 0.59″), UT1 within 0.9 s of UTC (ITU-R TF.460).
    if !(0.0..73_000.0).contains(&days) || xp.abs() > 2.0 || yp.abs() > 2.0 || ut1_minus_utc.abs() > 1.0 {
        return Found::Absurd;
    }
    let label = GpsTime::from_week_tow(0, days * 86_400.0).calendar();
    let Some(time) = GpsTime::from_utc(&label) else { return Found::Absurd };
    let ut1_minus_gpst = ut1_minus_utc - time.gpst_minus_utc() as f64;
    Found::Row(Row { time, xp: xp * ARCSECOND, yp: yp * ARCSECOND, ut1_minus_gpst })
}

fn finals_row(line: &[u8]) -> Found {
    let column = |start, end| field::columns(line, start, end).trim_ascii();
    let fields = [column(18, 27), column(37, 46), column(58, 68)];
    if fields.iter().any(|field| field.is_empty()) {
        let empty = field::real(column(7, 15)).is_some() || line.trim_ascii().is_empty();
        return if empty { Found::Nothing } else { Found::Unreadable };
    }
    match (field::real(column(7, 15)), fields.map(field::real)) {
        (Some(mjd), [Some(xp), Some(yp), Some(ut1)]) => row(mjd, xp, yp, ut1),
        _ => Found::Unreadable,
    }
}

fn igs_row(line: &[u8]) -> Found {
    let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let words: Vec<&[u8]> = words.take(4).collect();
    // Header and comments do not begin with a number.
    if !words.first().is_some_and(|word| word.first().is_some_and(u8::is_ascii_digit)) {
        return Found::Nothing;
    }
    match words.iter().map(|word| field::real(word)).collect::<Option<Vec<f64>>>().as_deref() {
        Some(&[mjd, xp, yp, ut1]) => row(mjd, xp * 1e-6, yp * 1e-6, ut1 * 1e-7),
        _ => Found::Unreadable,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use surefix_core::gnss::time::Calendar;

    /// Rows of finals2000A of the IERS around the leap second at the end of 2016, and one without values.
    const FINALS: &str = "\
161231 57753.00 I  0.081400 0.000052  0.263094 0.000039  I-0.4077601 0.0000078  0.8842 0.0055  I     0.025
17 1 1 57754.00 I  0.080504 0.000028  0.263145 0.000028  I 0.5912821 0.0000077  1.0342 0.0050  I     0.012
251026 60973.00
";
    /// The same in the form of IGS ERP files of version 2 (IGSMAIL-1943).
    const IGS: &str = "\
version 2
SOURCE: rows of finals2000A
  MJD      Xpole   Ypole  UT1-UTC    LOD  Xsig  Ysig   UTsig  LODsig  Nr Nf Nt    Xrt    Yrt  Xrtsig  Yrtsig
           (10**-6\")       (0.1 usec)    (10**-6\")      (0.1 usec)
57753.00   81400  263094 -4077601   8842    52    39      78      55   0  0  0      0      0       0       0
57754.00   80504  263145  5912821  10342    28    28      77      50   0  0  0      0      0       0       0
";

    fn read(bytes: &[u8]) -> Result<(EarthOrientationSeries, ReadReport), ReadError> {
        EarthOrientationSeries::read(Lines::new("a.erp", std::io::Cursor::new(bytes.to_vec())))
    }

    fn utc(year: i32, month: u8, day: u8, hour: u8) -> GpsTime {
        GpsTime::from_utc(&Calendar { hour, ..Calendar::date(year, month, day) }).unwrap()
    }

    #[test]
    fn both_formats_give_the_same_and_ut1_runs_through_a_leap_second() {
        for sample in [FINALS, IGS] {
            let (series, report) = read(sample.as_bytes()).unwrap();
            assert_eq!((report.records, report.dropped.len()), (2, 0), "{report}");
            let at = |time| series.at(time).unwrap();
            let start = at(utc(2016, 12, 31, 0));
            assert!((start.xp / ARCSECOND - 0.081_4).abs() < 1e-12 && (start.yp / ARCSECOND - 0.263_094).abs() < 1e-12);
            assert!((start.ut1_minus_utc + 0.407_760_1).abs() < 1e-12);
            // Half a day of 86401 s: UT1 − UTC falls from −0.4077601 s to 0.5912821 s − 1 s.
            let noon = at(utc(2016, 12, 31, 12));
            let expected = -0.407_760_1 + (-0.408_717_9 + 0.407_760_1) * 43_200.0 / 86_401.0;
            assert!((noon.ut1_minus_utc - expected).abs() < 1e-9, "{}", noon.ut1_minus_utc);
            assert!((at(utc(2017, 1, 1, 0)).ut1_minus_utc - 0.591_282_1).abs() < 1e-12);
            assert_eq!(series.span(), Some((utc(2016, 12, 31, 0), utc(2017, 1, 1, 0))));
            assert_eq!(series.at(utc(2017, 1, 1, 1)), None);
            assert_eq!(series.at(utc(2016, 12, 30, 23)), None);
        }
    }

    #[test]
    fn what_is_no_such_file_is_refused_with_a_remedy() {
        for (bytes, part) in [
            ("", "empty"),
            ("version 1\n", "another version"),
            ("hello\n", "no file of Earth orientation"),
            ("251026 60973.00\n", "no row"),
        ] {
            let error = read(bytes.as_bytes()).unwrap_err().to_string();
            assert!(error.contains("a.erp") && error.contains(part), "{error}");
        }
    }

    #[test]
    fn bad_rows_are_dropped_and_gaps_are_not_bridged() {
        let rows = "57755.00 80000 x 1 1\n57754.00 1 1 1 1\n57756.00 9999999 1 1 1\n57770.00 80000 260000 5900000 1\n";
        let (series, report) = read(format!("{IGS}{rows}").as_bytes()).unwrap();
        assert_eq!(report.records, 3);
        for reason in [Reason::ValueUnreadable, Reason::EpochDuplicate, Reason::ValueAbsurd] {
            assert_eq!(report.count(reason), 1, "{report}");
        }
        assert_eq!(series.at(utc(2017, 1, 5, 0)), None);
        assert!(series.at(utc(2017, 1, 17, 0)).is_some());
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..1000)) {
            let _ = read(&bytes);
            let _ = read(&[b"version 2\n", &bytes[..]].concat());
        }

        #[test]
        fn mutated_files_never_panic_and_stay_in_order(
            igs: bool, edits in proptest::collection::vec((0..FINALS.len(), any::<u8>()), 1..20)
        ) {
            let mut bytes = if igs { IGS } else { FINALS }.as_bytes().to_vec();
            for (at, byte) in edits {
                if let Some(value) = bytes.get_mut(at) {
                    *value = byte;
                }
            }
            if let Ok((series, report)) = read(&bytes) {
                prop_assert_eq!(report.records, series.rows.len() as u64);
                prop_assert!(series.rows.is_sorted_by(|a, b| a.time < b.time));
                let middle = series.rows[0].time.plus_seconds(1e4);
                prop_assert!(series.at(middle).is_none_or(|orientation| orientation.ut1_minus_utc.abs() < 2.1));
            }
        }
    }
}
