//! Positions from a comma-separated table with a header row: our solution CSV, our truth, tables of others.
//!
//! Columns are found by name, whatever their order, case, unit suffix (`_m`, `_s`, `_deg`, `(HAE)`…) and the prefixes
//! `gps_` and `ecef_`:
//!
//! | column | names |
//! |---|---|
//! | seconds of GPS week | `tow`, `time`, `sow`, `seconds` |
//! | GPS week (optional) | `week` |
//! | ECEF | `x`, `y`, `z` |
//! | or geodetic `[deg]`, `[m]` | `lat`/`latitude`, `lon`/`longitude`, `alt`/`altitude`/`height` |
//! | velocity (optional) | `vx`, `vy`, `vz` |
//! | covariance, ECEF (optional) | `cov_xx`, `cov_xy`, `cov_xz`, `cov_yy`, `cov_yz`, `cov_zz` |
//! | vector from a moving base, ECEF (if these are wanted) | `dx`, `dy`, `dz` |
//! | protection levels (optional) | `hpl`, `vpl` |
//! | quality (optional) | `quality` by name, `q` as RTKLIB, `gga_quality` as NMEA (4 fixed, 5 float) |
//!
//! A row whose quality is `None` counts as an epoch without a position.

use super::{HeaderProblem, Options, Track, TrackPoint, from_degrees, from_tow, number, symmetric};
use nalgebra::Vector3;
use surefix_core::gnss::solution::Quality;

/// Whether a text is a table with a header row (and not a `.pos`).
pub(super) fn is_table(text: &str) -> bool {
    let first = text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("");
    !first.starts_with(['%', '#']) && first.contains(',') && first.contains(|c: char| c.is_ascii_alphabetic())
}

/// Where a table has its columns.
struct Columns {
    week: Option<usize>,
    tow: usize,
    ecef: Option<[usize; 3]>,
    geodetic: Option<[usize; 3]>,
    velocity: Option<[usize; 3]>,
    diagonal: Option<[usize; 3]>,
    mixed: Option<[usize; 3]>,
    quality: Option<(usize, Grades)>,
    vector: Option<[usize; 3]>,
    protection: Option<[usize; 2]>,
}

/// What a quality column holds.
#[derive(Clone, Copy)]
enum Grades {
    Names,
    Rtklib,
    Gga,
}

/// Reads all rows.
pub(super) fn parse(text: &str, options: &Options) -> Result<Track, HeaderProblem> {
    let mut reader = ::csv::ReaderBuilder::new().flexible(true).trim(::csv::Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| (1, error.to_string(), "give a comma-separated table"))?.clone();
    let columns = Columns::find(&header, options)?;
    if columns.week.is_none() && options.week.is_none() && options.near.is_none() {
        return Err((1, "the table has no GPS week".into(), "give it (--week)"));
    }
    let mut track = Track::default();
    for record in reader.records() {
        let line = |position: Option<&::csv::Position>| position.map_or(0, |position| position.line() as usize);
        match record {
            Ok(record) if columns.row(&record, options, &mut track).is_none() => track.reject(line(record.position())),
            Ok(_) => {}
            Err(error) => track.reject(line(error.position())),
        }
    }
    Ok(track)
}

/// The first base position of a table.
pub(super) fn first_base(text: &str) -> Option<Vector3<f64>> {
    let mut reader = ::csv::ReaderBuilder::new().flexible(true).trim(::csv::Trim::All).from_reader(text.as_bytes());
    let names: Vec<String> = reader.headers().ok()?.iter().map(bare_name).collect();
    let columns = ["base_x", "base_y", "base_z"].map(|wanted| names.iter().position(|name| name == wanted));
    let [Some(x), Some(y), Some(z)] = columns else { return None };
    let row = |record: ::csv::StringRecord| {
        let value = |at: usize| record.get(at).and_then(number);
        Some(Vector3::new(value(x)?, value(y)?, value(z)?))
    };
    reader.records().flatten().find_map(row)
}

impl Columns {
    fn find(header: &::csv::StringRecord, options: &Options) -> Result<Self, HeaderProblem> {
        let names: Vec<String> = header.iter().map(bare_name).collect();
        let one = |accepted: &[&str]| names.iter().position(|name| accepted.contains(&name.as_str()));
        let three = |a: &[&str], b: &[&str], c: &[&str]| Some([one(a)?, one(b)?, one(c)?]);
        let tow = one(&["tow", "time", "sow", "seconds"])
            .ok_or_else(|| (1, "the table has no column of time".to_owned(), "name the seconds of GPS week `tow`"))?;
        let columns = Self {
            week: one(&["week"]),
            tow,
            ecef: three(&["x"], &["y"], &["z"]),
            geodetic: three(&["lat", "latitude"], &["lon", "longitude"], &["alt", "altitude", "height"]),
            velocity: three(&["vx"], &["vy"], &["vz"]),
            diagonal: three(&["cov_xx"], &["cov_yy"], &["cov_zz"]),
            mixed: three(&["cov_xy"], &["cov_yz"], &["cov_xz"]),
            quality: [("quality", Grades::Names), ("q", Grades::Rtklib), ("gga_quality", Grades::Gga)]
                .into_iter()
                .find_map(|(name, grades)| Some((one(&[name])?, grades))),
            vector: three(&["dx"], &["dy"], &["dz"]),
            protection: one(&["hpl"]).zip(one(&["vpl"])).map(|(hpl, vpl)| [hpl, vpl]),
        };
        if options.vectors_from.is_some() {
            let remedy = "give results of --moving-base, or name the columns `dx`, `dy`, `dz`";
            return columns.vector.map(|_| columns).ok_or((1, "the table has no columns of vectors".into(), remedy));
        }
        if columns.ecef.is_none() && columns.geodetic.is_none() {
            let remedy = "name the columns `x`, `y`, `z` or `latitude`, `longitude`, `height`";
            return Err((1, "the table has no columns of position".into(), remedy));
        }
        Ok(columns)
    }

    /// Takes a row into the track; `None` if it cannot be read.
    fn row(&self, record: &::csv::StringRecord, options: &Options, track: &mut Track) -> Option<()> {
        let value = |at: usize| record.get(at).and_then(number);
        let values = |[a, b, c]: [usize; 3]| Some([value(a)?, value(b)?, value(c)?]);
        let week = match self.week {
            Some(at) => Some(record.get(at)?.parse().ok()?),
            None => None,
        };
        let time = from_tow(week, value(self.tow)?, options)?;
        let quality_text = self.quality.and_then(|(at, _)| record.get(at)).unwrap_or("");
        let quality = match self.quality {
            Some((_, grades)) => grade(grades, quality_text)?,
            None => Quality::Fixed,
        };
        if quality == Quality::None {
            track.count(time);
            return Some(());
        }
        let position = match (self.ecef, self.geodetic) {
            _ if options.vectors_from.is_some() => options.vectors_from? + Vector3::from(values(self.vector?)?),
            (Some(ecef), _) => Vector3::from(values(ecef)?),
            (None, Some(geodetic)) => from_degrees(values(geodetic)?)?,
            (None, None) => return None,
        };
        track.count(time);
        if options.only_quality.as_deref().is_some_and(|only| only != quality_text) {
            return Some(());
        }
        let variances = self.diagonal.and_then(values).zip(self.mixed.and_then(values));
        track.points.push(TrackPoint {
            time,
            position,
            covariance: variances.map(|(diagonal, mixed)| symmetric(diagonal, mixed)),
            velocity: self.velocity.and_then(values).map(Vector3::from),
            quality,
            protection: self.protection.and_then(|[hpl, vpl]| Some([value(hpl)?, value(vpl)?])),
        });
        Some(())
    }
}

/// A column's name without case, unit and prefix: `GPS time` → `time`, `ecef_x_m` → `x`, `Alt (HAE)` → `alt`.
fn bare_name(name: &str) -> String {
    let name = name.trim_start_matches('\u{feff}').split(['(', '[']).next().unwrap_or("").trim();
    let mut bare = name.to_ascii_lowercase().replace([' ', '-'], "_");
    for prefix in ["gps_", "gpst_", "ecef_"] {
        if let Some(rest) = bare.strip_prefix(prefix) {
            bare = rest.to_owned();
        }
    }
    for unit in ["_m_s", "_m2", "_m", "_s", "_deg"] {
        if let Some(rest) = bare.strip_suffix(unit) {
            bare = rest.to_owned();
            break;
        }
    }
    bare
}

fn grade(grades: Grades, text: &str) -> Option<Quality> {
    Some(match (grades, text.to_ascii_lowercase().as_str()) {
        (Grades::Names, "fixed" | "fix" | "1") | (Grades::Rtklib, "1") | (Grades::Gga, "4") => Quality::Fixed,
        (Grades::Names, "partial") => Quality::Partial,
        (Grades::Names, "float" | "2") | (Grades::Rtklib, "2" | "6") | (Grades::Gga, "5") => Quality::Float,
        (Grades::Names, "code" | "5") | (Grades::Rtklib, "3" | "4" | "5") | (Grades::Gga, "1" | "2") => Quality::Code,
        (Grades::Names, "none") | (Grades::Gga, "0") => Quality::None,
        (Grades::Gga, _) => Quality::Code,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::super::parse as read;
    use super::*;
    use surefix_core::gnss::time::GpsTime;

    #[test]
    fn tables_of_others_are_understood() {
        // First rows of the tables named, their numbers cut short.
        let car =
            "Index,GPS time,X,Y,Z,Lat,Lon,Alt (HAE)\n0,5784,-2430550.69,-4703759.45,3544971.765,33.98,-117.3,298.9\n";
        let options = Options { near: Some(GpsTime::from_week_tow(2114, 5000.0)), ..Options::default() };
        let track = read("car", car, &options).unwrap();
        assert_eq!(track.points[0].time, GpsTime::from_week_tow(2114, 5784.0));
        assert_eq!(track.points[0].position, Vector3::new(-2430550.69, -4703759.45, 3544971.765));
        assert!(read("car", car, &Options::default()).unwrap_err().to_string().contains("--week"));

        let receiver = "gps_week,gps_tow_s,ecef_x_m,ecef_y_m,ecef_z_m,pacc_m,gga_quality,diff_age_s\n\
                        2022,217331.000,3774697.80,-596649.28,5089484.22,1.75,1,\n\
                        2022,217332.000,3774697.83,-596649.31,5089484.22,0.02,4,1.0\n";
        let track = read("rx", receiver, &Options { only_quality: Some("4".into()), ..Options::default() }).unwrap();
        assert_eq!((track.points.len(), track.epochs, track.points[0].quality), (1, 2, Quality::Fixed));
    }

    #[test]
    fn the_week_is_the_nearest() {
        let at =
            |near: GpsTime, tow: f64| from_tow(None, tow, &Options { near: Some(near), ..Options::default() }).unwrap();
        assert_eq!(at(GpsTime::from_week_tow(2000, 604_790.0), 5.0), GpsTime::from_week_tow(2001, 5.0));
        assert_eq!(at(GpsTime::from_week_tow(2001, 5.0), 604_790.0), GpsTime::from_week_tow(2000, 604_790.0));
    }

    #[test]
    fn bad_rows_and_duplicates_are_counted() {
        let text = "week,tow,latitude,longitude,height\n2000,2,50,8,100\n2000,1,50,8,100\n2000,1,51,8,100\n\
                    2000,x,50,8,100\n2000,3,95,8,100\n2000,4,50\n";
        let track = read("t", text, &Options::default()).unwrap();
        assert_eq!((track.points.len(), track.unreadable, track.duplicates), (2, 3, 1));
        assert_eq!((track.epochs, track.first_unreadable), (2, Some(5)));
        assert!(track.points[0].time < track.points[1].time);
    }

    #[test]
    fn a_header_that_says_too_little_is_an_error() {
        for header in ["week,x,y,z\n", "week,tow,x,y\n"] {
            let error = read("t.csv", header, &Options::default()).unwrap_err().to_string();
            assert!(error.starts_with("t.csv, line 1:"), "{error}");
        }
    }
}
