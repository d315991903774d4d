//! Solutions and truths: positions over time, from a `.pos` of RTKLIB or ours, our CSV, or a table with a header.
//!
//! The format is told by the content, not by the name; gzip is undone. What is understood is said
//! in `pos` and `table`. Rows that cannot be read are dropped and counted, with the line of the first.

mod pos;
mod table;

use flate2::read::MultiGzDecoder;
use nalgebra::{Matrix3, Vector3};
use std::io::Read;
use std::path::Path;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::solution::{Quality, Solution};
use surefix_core::gnss::time::{GpsTime, SECONDS_PER_WEEK};

/// A position at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackPoint {
    /// When (GPST).
    pub time: GpsTime,
    /// ECEF position `[m]`.
    pub position: Vector3<f64>,
    /// Its covariance, ECEF `[m²]`, where the file has it.
    pub covariance: Option<Matrix3<f64>>,
    /// ECEF velocity `[m/s]`, where the file has it.
    pub velocity: Option<Vector3<f64>>,
    /// Grade; [`Quality::Fixed`] where the file has none.
    pub quality: Quality,
    /// HPL and VPL `[m]`, where the file has them.
    pub protection: Option<[f64; 2]>,
}

/// Positions in ascending order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// The positions.
    pub points: Vec<TrackPoint>,
    /// Epochs in the file, with a position or without.
    pub epochs: usize,
    /// First epoch in the file, with a position or without.
    pub start: Option<GpsTime>,
    /// Rows that could not be read.
    pub unreadable: usize,
    /// Line of the first of them, from 1.
    pub first_unreadable: Option<usize>,
    /// Rows at a time that an earlier row has already; they are left out.
    pub duplicates: usize,
}

impl Track {
    /// What reading the file of these solutions gives.
    pub fn of(solutions: &[Solution]) -> Self {
        let with_position = solutions.iter().filter(|solution| solution.quality != Quality::None);
        let points = with_position.map(|solution| TrackPoint {
            time: solution.time,
            position: solution.position,
            covariance: Some(solution.position_covariance),
            velocity: Some(solution.velocity),
            quality: solution.quality,
            protection: solution.protection.map(|levels| [levels.horizontal, levels.vertical]),
        });
        Self {
            points: points.collect(),
            epochs: solutions.len(),
            start: solutions.first().map(|solution| solution.time),
            ..Self::default()
        }
    }
}

/// What the reader cannot know from the file alone.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// ECEF position of the base `[m]`, needed where positions are east-north-up baselines.
    pub base: Option<Vector3<f64>>,
    /// GPS week of tables that have seconds of week only.
    pub week: Option<i32>,
    /// A time near the table's, from which the week is guessed if it is not given.
    pub near: Option<GpsTime>,
    /// Takes vectors from a moving base for positions, placed at this point, ECEF `[m]`.
    pub vectors_from: Option<Vector3<f64>>,
    /// Keeps only rows whose quality column reads like this (`4`, `Fixed`).
    pub only_quality: Option<String>,
}

/// Why a file of positions cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Missing or not readable.
    #[error("{file}: cannot be read ({source}); check the path and the permissions")]
    Open {
        /// The file.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// No row with a position.
    #[error("{file}: has no position ({unreadable} rows unreadable{}); give a .pos, a CSV with a header row of \
             time and coordinates, or a fixed coordinate", first.map_or(String::new(), |line| format!(", first at line {line}")))]
    NoPosition {
        /// The file.
        file: String,
        /// Rows that could not be read.
        unreadable: usize,
        /// Line of the first of them.
        first: Option<usize>,
    },
    /// A header that does not say enough.
    #[error("{file}, line {line}: {problem}; {remedy}")]
    Header {
        /// The file.
        file: String,
        /// The line.
        line: usize,
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// What is wrong with a header: line, problem, remedy.
type HeaderProblem = (usize, String, &'static str);

/// Reads positions from a file, plain or gzipped.
pub fn read(path: &Path, options: &Options) -> Result<Track, Error> {
    let file = path.display().to_string();
    let bytes = read_bytes(path).map_err(|source| Error::Open { file: file.clone(), source })?;
    parse(&file, &String::from_utf8_lossy(&bytes), options)
}

/// Where a moving base was in the first row of a table that has it: columns `base_x`, `base_y`, `base_z`, ECEF `[m]`.
pub fn first_base(path: &Path) -> Result<Vector3<f64>, Error> {
    let file = path.display().to_string();
    let bytes = read_bytes(path).map_err(|source| Error::Open { file: file.clone(), source })?;
    table::first_base(&String::from_utf8_lossy(&bytes)).ok_or(Error::Header {
        file,
        line: 1,
        problem: "the table has no position of a moving base".into(),
        remedy: "give the .csv of surefix post --moving-base",
    })
}

/// Reads positions from a text that messages call `file`.
pub fn parse(file: &str, text: &str, options: &Options) -> Result<Track, Error> {
    let parse = if table::is_table(text) { table::parse } else { pos::parse };
    let mut track = parse(text, options).map_err(|(line, problem, remedy)| Error::Header {
        file: file.to_owned(),
        line,
        problem,
        remedy,
    })?;
    if track.points.is_empty() {
        return Err(Error::NoPosition {
            file: file.to_owned(),
            unreadable: track.unreadable,
            first: track.first_unreadable,
        });
    }
    track.points.sort_by_key(|point| point.time);
    let before = track.points.len();
    track.points.dedup_by_key(|point| point.time);
    track.duplicates = before - track.points.len();
    track.epochs -= track.duplicates;
    Ok(track)
}

impl Track {
    /// Takes note of a row that cannot be read.
    fn reject(&mut self, line: usize) {
        self.unreadable += 1;
        self.first_unreadable.get_or_insert(line);
    }

    /// Takes note of an epoch, with or without a position.
    fn count(&mut self, time: GpsTime) {
        self.epochs += 1;
        self.start = Some(self.start.map_or(time, |start| start.min(time)));
    }
}

fn read_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = std::fs::read(path)?;
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut plain = Vec::new();
        MultiGzDecoder::new(bytes.as_slice()).read_to_end(&mut plain)?;
        bytes = plain;
    }
    Ok(bytes)
}

/// A finite number.
fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|value: &f64| value.is_finite())
}

/// ECEF from latitude and longitude `[deg]` and height `[m]`; `None` outside of their range.
fn from_degrees([latitude, longitude, height]: [f64; 3]) -> Option<Vector3<f64>> {
    let on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 360.0 && height.abs() < 1e8;
    let (latitude, longitude) = (latitude.to_radians(), longitude.to_radians());
    on_earth.then(|| Geodetic { latitude, longitude, height }.to_ecef())
}

/// Time of a week and seconds of week; without a week, the one nearest to `options.near`.
fn from_tow(week: Option<i32>, tow: f64, options: &Options) -> Option<GpsTime> {
    if let Some(week) = week.or(options.week) {
        return Some(GpsTime::from_week_tow(week, tow));
    }
    let near = options.near?;
    let first_guess = GpsTime::from_week_tow(near.week(), tow);
    let weeks = (near.since(first_guess) / SECONDS_PER_WEEK as f64).round() as i32;
    Some(GpsTime::from_week_tow(near.week() + weeks, tow))
}

/// Covariance from its diagonal and its xy, yz, zx elements.
fn symmetric(diagonal: [f64; 3], [xy, yz, zx]: [f64; 3]) -> Matrix3<f64> {
    let [xx, yy, zz] = diagonal;
    Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const POS: &str = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns\n\
                       2024/06/24 08:20:00.000 35.134699011 136.977575483 104.8619 1 42 0.0024 0.0024 0.0069 0 0 0 0 12\n";
    const TABLE: &str = "gps_week,gps_tow_s,x_m,y_m,z_m,quality\n2320,116400,-3817681.38,3562839.97,3650158.37,Fixed\n";

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "\\PC*") {
            let _ = parse("t", &text, &Options::default());
        }

        #[test]
        fn damaged_files_are_read_or_refused(
            table: bool, damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)
        ) {
            let mut bytes = if table { TABLE } else { POS }.as_bytes().to_vec();
            for (index, byte) in damage {
                let at = index.index(bytes.len());
                bytes[at] = byte;
            }
            if let Ok(track) = parse("t", &String::from_utf8_lossy(&bytes), &Options::default()) {
                let finite = |point: &TrackPoint| point.position.iter().all(|coordinate| coordinate.is_finite());
                prop_assert!(track.points.iter().all(finite));
            }
        }
    }
}
