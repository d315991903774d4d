//! IONEX 1.0/1.1: maps of vertical electron content over time (`.yyI`, `.INX`).
//!
//! Two-dimensional maps are read, with their RMS maps. Times are UT in the format and are taken for GPST, which is what
//! other programs do and wrong by less than 20 s. Height maps are skipped. A row that is missing or unreadable leaves its
//! nodes without a value, and is counted.

use super::ReadError;
use super::field::{columns, integer, real, text};
use super::lines::Lines;
use super::report::{ReadReport, Reason};
use std::path::Path;
use surefix_core::gnss::atmosphere::tec::{Axis, NO_VALUE, SingleLayer, TecMap, TecMaps};
use surefix_core::gnss::time::{Calendar, GpsTime};

/// Most nodes of a map.
const MOST_NODES: usize = 1 << 20;

/// A map and, where the file has it, the map of its RMS errors.
#[derive(Clone, Debug, PartialEq)]
struct Map {
    time: GpsTime,
    /// Unit of `values` `[TECU]`.
    unit: f64,
    values: Vec<i32>,
    rms: Option<(f64, Vec<i32>)>,
}

/// The maps of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Ionex {
    latitudes: Axis,
    longitudes: Axis,
    /// Earth radius and height of the layer.
    pub layer: SingleLayer,
    /// In ascending order of time.
    maps: Vec<Map>,
}

impl Ionex {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<(Self, ReadReport), ReadError> {
        Self::read(Lines::open(path)?)
    }

    fn read(mut lines: Lines) -> Result<(Self, ReadReport), ReadError> {
        let mut report = ReadReport::new(lines.file());
        let mut exponent = -1;
        let mut ionex = header(&mut lines, &mut exponent, &mut report)?;
        let mut kept = 0;
        while lines.advance(&mut report)? {
            match label(lines.line()).as_str() {
                "START OF TEC MAP" => {
                    if let Some(map) = ionex.map(&mut lines, exponent, &mut report)? {
                        kept += map.values.iter().filter(|&&value| value != NO_VALUE).count() as u64;
                        ionex.maps.push(map);
                    }
                }
                "START OF RMS MAP" => {
                    let number = lines.number();
                    if let Some(Map { time, unit, values, .. }) = ionex.map(&mut lines, exponent, &mut report)? {
                        match ionex.maps.iter_mut().find(|map| map.time == time) {
                            Some(map) => map.rms = Some((unit, values)),
                            None => report.drop_one(Reason::RecordUnreadable, number),
                        }
                    }
                }
                "EXPONENT" => exponent = integer(columns(lines.line(), 0, 6)).unwrap_or(exponent),
                _ => {}
            }
        }
        ionex.maps.sort_by_key(|map| map.time);
        let before = ionex.maps.len();
        ionex.maps.dedup_by_key(|map| map.time);
        report.drop_many(Reason::EpochDuplicate, (before - ionex.maps.len()) as u64, 1);
        report.records = ionex.maps.len() as u64;
        report.observations = kept;
        Ok((ionex, report))
    }

    /// Times of the maps, ascending.
    pub fn times(&self) -> impl Iterator<Item = GpsTime> + '_ {
        self.maps.iter().map(|map| map.time)
    }

    /// The two maps around a time, turned with the Sun; `None` before the first and after the last.
    pub fn maps_at(&self, time: GpsTime) -> Option<TecMaps<'_>> {
        let [before, after] = self.around(time)?;
        Some(TecMaps { before: self.view(before), after: self.view(after), turned: true })
    }

    /// The two maps of RMS errors around a time; `None` where the file has none.
    pub fn rms_at(&self, time: GpsTime) -> Option<TecMaps<'_>> {
        let [before, after] = self.around(time)?;
        let ((unit, values), (unit_after, values_after)) = (before.rms.as_ref()?, after.rms.as_ref()?);
        let (before, after) = (self.of(before.time, *unit, values), self.of(after.time, *unit_after, values_after));
        Some(TecMaps { before, after, turned: true })
    }

    fn around(&self, time: GpsTime) -> Option<[&Map; 2]> {
        let later = self.maps.partition_point(|map| map.time <= time);
        let before = self.maps.get(later.checked_sub(1)?)?;
        let after = self.maps.get(later).or_else(|| (before.time == time).then_some(before))?;
        Some([before, after])
    }

    fn view<'a>(&'a self, map: &'a Map) -> TecMap<'a> {
        self.of(map.time, map.unit, &map.values)
    }

    fn of<'a>(&'a self, time: GpsTime, unit: f64, values: &'a [i32]) -> TecMap<'a> {
        TecMap { time, latitudes: self.latitudes, longitudes: self.longitudes, unit, values }
    }

    /// The lines of a map after its first, to its end.
    fn map(&self, lines: &mut Lines, mut exponent: i32, report: &mut ReadReport) -> Result<Option<Map>, ReadError> {
        let (rows, columns_in_row) = (usize::from(self.latitudes.count), usize::from(self.longitudes.count));
        let start = lines.number();
        let mut values = vec![NO_VALUE; rows * columns_in_row];
        let (mut time, mut seen, mut ended) = (None, vec![false; rows], false);
        while lines.advance(report)? {
            match label(lines.line()).as_str() {
                "EPOCH OF CURRENT MAP" => time = epoch(lines.line()),
                "EXPONENT" => exponent = integer(columns(lines.line(), 0, 6)).unwrap_or(exponent),
                "LAT/LON1/LON2/DLON/H" => match self.row_of(lines.line()) {
                    Some(row) => {
                        let nodes = values.iter_mut().skip(row * columns_in_row).take(columns_in_row);
                        read_row(lines, nodes, report)?;
                        seen.iter_mut().skip(row).take(1).for_each(|seen| *seen = true);
                    }
                    None => report.drop_one(Reason::RecordUnreadable, lines.number()),
                },
                label if label.starts_with("END OF") => {
                    ended = true;
                    break;
                }
                label if label.starts_with("START OF") => {
                    lines.unread();
                    break;
                }
                _ => {}
            }
        }
        let missing = seen.iter().filter(|&&seen| !seen).count() as u64;
        report.drop_many(Reason::Truncated, missing.max(u64::from(!ended)), start);
        if time.is_none() {
            report.drop_one(Reason::RecordUnreadable, start);
        }
        Ok(time.map(|time| Map { time, unit: 10f64.powi(exponent), values, rms: None }))
    }

    /// The row that a line of latitude begins; `None` if it is none of the grid's, or has other longitudes.
    fn row_of(&self, line: &[u8]) -> Option<usize> {
        let number = |i: usize| real(columns(line, 2 + 6 * i, 8 + 6 * i));
        let row = (number(0)? - self.latitudes.first) / self.latitudes.step;
        let same_columns = number(1)? == self.longitudes.first && number(3)? == self.longitudes.step;
        let on_grid = (row - row.round()).abs() < 1e-6 && (0.0..f64::from(self.latitudes.count)).contains(&row.round());
        (on_grid && same_columns).then_some(row.round() as usize)
    }
}

/// Whether a file with this first line is IONEX.
pub fn is_ionex(first_line: &[u8]) -> bool {
    label(first_line) == "IONEX VERSION / TYPE"
}

fn label(line: &[u8]) -> String {
    text(line, 60, 80)
}

/// Reads the values of a row, 16 a line, five columns each.
fn read_row<'a>(
    lines: &mut Lines,
    mut nodes: impl ExactSizeIterator<Item = &'a mut i32>,
    report: &mut ReadReport,
) -> Result<(), ReadError> {
    while nodes.len() > 0 && lines.advance(report)? {
        let line = lines.line();
        if !label(line).is_empty() && label(line).bytes().any(|byte| byte.is_ascii_alphabetic()) {
            lines.unread();
            break;
        }
        for i in 0..16 {
            let Some(node) = nodes.next() else { break };
            match integer(columns(line, 5 * i, 5 * i + 5)) {
                Some(value) => *node = value,
                None => report.drop_one(Reason::ValueUnreadable, lines.number()),
            }
        }
    }
    Ok(())
}

fn header(lines: &mut Lines, exponent: &mut i32, report: &mut ReadReport) -> Result<Ionex, ReadError> {
    if !lines.advance(report)? {
        return Err(ReadError::Empty { file: lines.file().to_owned() });
    }
    let fail = |lines: &Lines, problem: &str, remedy| ReadError::Header {
        file: lines.file().to_owned(),
        line: lines.number(),
        problem: problem.to_owned(),
        remedy,
    };
    if !is_ionex(lines.line()) {
        return Err(fail(lines, "this is not IONEX", "give maps of the ionosphere, .INX or .yyI"));
    }
    let (mut radius, mut heights, mut latitudes, mut longitudes) = (6_371.0, None, None, None);
    let three = |line: &[u8]| {
        let number = |i: usize| real(columns(line, 2 + 6 * i, 8 + 6 * i));
        Some([number(0)?, number(1)?, number(2)?])
    };
    while lines.advance(report)? {
        let line = lines.line();
        match label(line).as_str() {
            "BASE RADIUS" => radius = real(columns(line, 0, 8)).filter(|&radius| radius > 0.0).unwrap_or(radius),
            "EXPONENT" => *exponent = integer(columns(line, 0, 6)).unwrap_or(*exponent),
            "HGT1 / HGT2 / DHGT" => heights = three(line),
            "LAT1 / LAT2 / DLAT" => latitudes = three(line).and_then(axis),
            "LON1 / LON2 / DLON" => longitudes = three(line).and_then(axis),
            "END OF HEADER" => break,
            _ => {}
        }
    }
    let whole = "give a file that is whole";
    let (Some([height, highest, _]), Some(latitudes), Some(longitudes)) = (heights, latitudes, longitudes) else {
        return Err(fail(lines, "the header lacks HGT1, LAT1 or LON1, or they are unreadable", whole));
    };
    if height != highest || height <= 0.0 {
        return Err(fail(lines, "the maps have several layers", "give maps of a single layer"));
    }
    if usize::from(latitudes.count) * usize::from(longitudes.count) > MOST_NODES {
        return Err(fail(lines, "the maps have too many nodes", whole));
    }
    let layer = SingleLayer { base_radius: radius * 1e3, shell_height: height * 1e3, with_receiver_height: false };
    Ok(Ionex { latitudes, longitudes, layer, maps: Vec::new() })
}

/// Nodes from the first, the last and the step between them.
fn axis([first, last, step]: [f64; 3]) -> Option<Axis> {
    let steps = ((last - first) / step).round();
    let whole = (first + steps * step - last).abs() < 1e-6 && (1.0..10_000.0).contains(&steps);
    whole.then_some(Axis { first, step, count: steps as u16 + 1 })
}

/// Year, month, day, hour, minute and second, six columns each. Hour 24 is 0 of the next day.
fn epoch(line: &[u8]) -> Option<GpsTime> {
    let part = |i: usize| integer(columns(line, 6 * i, 6 * i + 6));
    let small = |i: usize| part(i).and_then(|n| u8::try_from(n).ok());
    let midnight = Calendar::date(part(0)?, small(1)?, small(2)?);
    let seconds = u32::from(small(3)?) * 3_600 + u32::from(small(4)?) * 60 + u32::from(small(5)?);
    let midnight = GpsTime::from_calendar(&midnight).filter(|_| seconds <= 86_400 && midnight.year >= 1980)?;
    Some(midnight.plus_seconds(f64::from(seconds)))
}

#[cfg(test)]
#[path = "ionex_tests.rs"]
mod tests;
