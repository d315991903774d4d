//! Ocean loading: BLQ files, as the ocean loading provider of Onsala (H.-G. Scherneck, M. S. Bos) writes them.
//!
//! A station is a line with its name, then six lines of eleven numbers: amplitudes `[m]` of M2, S2, N2, K2, K1, O1, P1,
//! Q1, Mf, Mm, Ssa up, west and south, and their phases `[°]`, lags relative to Greenwich. Lines with `$$` are
//! comments, of which the one with `lon/lat:` says where the station is. A block between `+cmc` and `-cmc` is passed
//! over.
//!
//! Names vary: four characters in any case, with a DOMES number or a country behind them or not; so the first four
//! are compared. Of two stations of a name the first is taken. A station without such a line (they occur) has the name
//! of its comment.

use super::error::ReadError;
use super::field;
use super::lines::Lines;
use super::report::{ReadReport, Reason};
use nalgebra::Vector3;
use std::path::Path;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::tide::OceanLoading;
use surefix_core::gnss::tide::ocean::CONSTITUENTS;

/// Rows of a station.
const ROWS: usize = 6;
/// Characters of a name that count.
const NAME: usize = 4;

/// Ocean loading at a station.
#[derive(Clone, Debug, PartialEq)]
pub struct BlqStation {
    /// Name as the file has it.
    pub name: String,
    /// Where it is, ECEF `[m]`, if a comment says so.
    pub position: Option<Vector3<f64>>,
    /// Its response.
    pub loading: OceanLoading,
}

/// The stations of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Blq {
    file: String,
    /// In the order of the file.
    pub stations: Vec<BlqStation>,
}

impl Blq {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<(Self, ReadReport), ReadError> {
        Self::read(Lines::open(path)?)
    }

    fn read(mut lines: Lines) -> Result<(Self, ReadReport), ReadError> {
        let mut report = ReadReport::new(lines.file());
        let mut blq = Self { file: lines.file().to_owned(), stations: Vec::new() };
        let (mut pending, mut in_block): (Option<Pending>, bool) = (None, false);
        while lines.advance(&mut report)? {
            let line = lines.line().trim_ascii();
            if line.starts_with(b"$$") {
                if let Some(position) = place(line) {
                    pending.get_or_insert_with(|| Pending::new(name_in_comment(line))).position = Some(position);
                }
            } else if in_block || line.starts_with(b"+cmc") {
                in_block = !line.starts_with(b"-cmc");
            } else if !line.is_empty() {
                let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
                let is_name = words.count() < CONSTITUENTS / 2;
                if is_name {
                    if pending.is_some() {
                        report.drop_one(Reason::Truncated, lines.number());
                    }
                    pending = Some(Pending::new(field::text(line, 0, line.len())));
                } else if let Some(mut station) = pending.take() {
                    match row(line) {
                        Some(values) => station.rows.push(values),
                        None => {
                            report.drop_one(Reason::ValueUnreadable, lines.number());
                            continue;
                        }
                    }
                    if station.rows.len() == ROWS {
                        blq.stations.extend(station.finish());
                        report.records += 1;
                    } else {
                        pending = Some(station);
                    }
                } else {
                    report.drop_one(Reason::LineUnreadable, lines.number());
                }
            }
        }
        if pending.is_some() {
            report.drop_one(Reason::Truncated, lines.number());
        }
        if lines.number() == 0 {
            return Err(ReadError::Empty { file: blq.file });
        }
        Ok((blq, report))
    }

    /// The station of a name, of which the first four characters count, in any case.
    pub fn find(&self, name: &str) -> Result<&BlqStation, ReadError> {
        let wanted = short(name);
        self.stations.iter().find(|station| short(&station.name).eq_ignore_ascii_case(&wanted)).ok_or_else(|| {
            let remedy = "ask the ocean loading provider (holt.oso.chalmers.se/loading) for it and add it to the file";
            ReadError::NoStation { file: self.file.clone(), station: format!("\"{}\"", name.trim()), remedy }
        })
    }

    /// The station nearest to `position`, ECEF `[m]`, at most `within` `[m]` away, and how far it is `[m]`.
    pub fn nearest(&self, position: &Vector3<f64>, within: f64) -> Result<(&BlqStation, f64), ReadError> {
        let distances =
            self.stations.iter().filter_map(|station| Some((station, (station.position? - position).norm())));
        distances.filter(|&(_, distance)| distance <= within).min_by(|a, b| a.1.total_cmp(&b.1)).ok_or_else(|| {
            let place = Geodetic::from_ecef(position);
            let station = format!(
                "within {:.1} km of latitude {:.4}°, longitude {:.4}°",
                within / 1e3,
                place.latitude.to_degrees(),
                place.longitude.to_degrees()
            );
            ReadError::NoStation { file: self.file.clone(), station, remedy: "name a station that is near enough" }
        })
    }
}

/// The characters of a name that count.
fn short(name: &str) -> String {
    name.trim().chars().take(NAME).collect()
}

/// A station of which not all rows were read.
struct Pending {
    name: String,
    position: Option<Vector3<f64>>,
    rows: Vec<[f64; CONSTITUENTS]>,
}

impl Pending {
    fn new(name: String) -> Self {
        Self { name, position: None, rows: Vec::with_capacity(ROWS) }
    }

    fn finish(self) -> Option<BlqStation> {
        let [radial, west, south, radial_phase, west_phase, south_phase]: [_; ROWS] = self.rows.try_into().ok()?;
        let phases = [radial_phase, west_phase, south_phase].map(|row: [f64; CONSTITUENTS]| row.map(f64::to_radians));
        let loading = OceanLoading::new(&[radial, west, south], &phases);
        Some(BlqStation { name: self.name, position: self.position, loading })
    }
}

/// Numbers of a line, separated by blanks, until one is none.
fn numbers(line: &[u8]) -> impl Iterator<Item = Option<f64>> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).map(field::real)
}

/// The name that a comment with `lon/lat:` begins with, for stations that have no line with their name.
fn name_in_comment(comment: &[u8]) -> String {
    let text = comment.strip_prefix(b"$$").unwrap_or(comment);
    let end = text.iter().position(|&byte| byte == b',').unwrap_or(0);
    field::text(text, 0, end)
}

/// Eleven numbers and nothing else; no amplitude of metres and no phase beyond two turns.
fn row(line: &[u8]) -> Option<[f64; CONSTITUENTS]> {
    let values: Vec<f64> = numbers(line).collect::<Option<_>>()?;
    values.try_into().ok().filter(|row: &[f64; CONSTITUENTS]| row.iter().all(|value| value.abs() <= 720.0))
}

/// ECEF position `[m]` of a comment with `lon/lat:` longitude, latitude `[°]` and height `[m]`.
fn place(comment: &[u8]) -> Option<Vector3<f64>> {
    const KEY: &[u8] = b"lon/lat:";
    let start = comment.windows(KEY.len()).position(|window| window.eq_ignore_ascii_case(KEY))? + KEY.len();
    let mut values = numbers(comment.get(start..)?).map_while(|value| value);
    let (longitude, latitude) = (values.next()?, values.next()?);
    let height = values.next().unwrap_or(0.0);
    let exists = latitude.abs() <= 90.0 && longitude.abs() <= 360.0;
    let place = Geodetic { latitude: latitude.to_radians(), longitude: longitude.to_radians(), height };
    exists.then(|| place.to_ecef())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The first two stations of raPPPid's OceanLoading.blq (434e6be), the name of the second in another form.
    const SAMPLE: &str = "\
$$ Ocean loading displacement
$$ END HEADER
+cmc
   M2    -1.2661E-03 -1.4298E-03   -1.3724E-03  8.2077E-04    1.1479E-03  2.3005E-04   NCDF_FES2004
-cmc
  ABPO
$$ Complete GOT4.7
$$ ABPO,                      RADI TANG  lon/lat:   47.2292  -19.0183 1552.973
  .01503 .00631 .00297 .00172 .00193 .00193 .00066 .00053 .00065 .00030 .00030
  .00694 .00392 .00123 .00108 .00035 .00031 .00012 .00008 .00008 .00003 .00005
  .00259 .00124 .00052 .00032 .00170 .00066 .00054 .00014 .00008 .00005 .00003
  -156.2 -124.0 -177.9 -123.8  168.3  153.0  166.8  143.1 -170.6 -175.0 -178.0
    52.7   88.0   43.8   85.2 -124.7 -136.7 -125.8 -152.4 -162.2 -160.3 -176.2
   177.9 -134.6  155.0 -137.4  151.2  163.0  151.7  179.0  175.8  177.2  179.0
$$
  adis 31502M001
$$ ADIS,                      RADI TANG  lon/lat:   38.7663    9.0351 2439.122
  .00652 .00279 .00116 .00076 .00375 .00174 .00121 .00038 .00041 .00019 .00022
  .00065 .00013 .00015 .00005 .00139 .00083 .00045 .00020 .00008 .00004 .00005
  .00196 .00088 .00041 .00023 .00096 .00063 .00032 .00011 .00001 .00001 .00001
  -127.4 -100.2 -141.3 -101.7  163.1  169.1  163.4  171.1 -156.6 -168.4 -176.5
     6.4   16.6   -2.4    8.2  171.6  174.7  171.8  170.9 -166.7 -168.8 -177.6
    11.8   50.1  -11.0   52.0   69.8   63.5   69.4   52.4  -92.3 -165.7 -176.0
";

    fn read(bytes: &[u8]) -> Result<(Blq, ReadReport), ReadError> {
        Blq::read(Lines::new("a.blq", std::io::Cursor::new(bytes.to_vec())))
    }

    #[test]
    fn stations_are_found_by_name_in_any_form_and_by_place() {
        let (blq, report) = read(SAMPLE.as_bytes()).unwrap();
        assert_eq!((blq.stations.len(), report.records, report.dropped.len()), (2, 2, 0), "{report}");
        assert_eq!(blq.find("abpo").unwrap().name, "ABPO");
        assert_eq!(blq.find("ADIS00ETH").unwrap().name, "adis 31502M001");
        let here = Geodetic { latitude: 9.04f64.to_radians(), longitude: 38.77f64.to_radians(), height: 2400.0 };
        let (station, distance) = blq.nearest(&here.to_ecef(), 10e3).unwrap();
        assert!(station.name.starts_with("adis") && (100.0..1000.0).contains(&distance), "{distance}");
    }

    #[test]
    fn a_station_without_a_line_of_its_name_has_that_of_its_comment() {
        // As ZIM3 in the file of GINav (093129a).
        let (blq, report) = read(SAMPLE.replacen("  adis 31502M001\n", "", 1).as_bytes()).unwrap();
        assert_eq!((blq.find("adis").unwrap().name.as_str(), report.dropped.len()), ("ADIS", 0), "{report}");
    }

    #[test]
    fn an_absent_station_is_named_with_its_file() {
        let (blq, _) = read(SAMPLE.as_bytes()).unwrap();
        let error = blq.find("ESBC").unwrap_err().to_string();
        assert!(error.contains("a.blq") && error.contains("ESBC") && error.contains("provider"), "{error}");
        let error = blq.nearest(&Vector3::new(6.4e6, 0.0, 0.0), 10e3).unwrap_err().to_string();
        assert!(error.contains("a.blq") && error.contains("within 10.0 km of latitude 0.0000°"), "{error}");
        assert!(matches!(read(b""), Err(ReadError::Empty { .. })));
    }

    #[test]
    fn damaged_stations_are_dropped_and_counted() {
        let damaged = SAMPLE.replacen(".00694", ".0o694", 1);
        let (blq, report) = read(damaged.as_bytes()).unwrap();
        assert_eq!((blq.stations.len(), report.count(Reason::ValueUnreadable)), (1, 1), "{report}");
        // (What is left of the station belongs to none.)
        assert_eq!(report.count(Reason::LineUnreadable), 4, "{report}");
        let cut = &SAMPLE[..SAMPLE.len() - 200];
        let (blq, report) = read(cut.as_bytes()).unwrap();
        assert_eq!(
            (blq.stations.len(), report.dropped.values().map(|tally| tally.count).sum::<u64>()),
            (1, 1),
            "{report}"
        );
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..1000)) {
            let _ = read(&bytes);
            let _ = read(&[SAMPLE.as_bytes(), &bytes].concat());
        }

        #[test]
        fn mutated_files_never_panic_and_never_grow(
            edits in proptest::collection::vec((0..SAMPLE.len(), any::<u8>()), 1..20)
        ) {
            let mut bytes = SAMPLE.as_bytes().to_vec();
            for (at, byte) in edits {
                bytes[at] = byte;
            }
            if let Ok((blq, report)) = read(&bytes) {
                prop_assert_eq!(report.records, blq.stations.len() as u64);
                prop_assert!(blq.stations.len() <= 2);
            }
        }
    }
}
