//! Golden vectors: files of inputs and expected outputs, run against the models of this program.
//!
//! Each file is of a `Format`, recognised by its shape; each format is one module. The format of files with `cases`
//! of `in` and `out` ([`case`]) has a further table from the case's model to the function that recomputes it.
//!
//! A file passes if every expected output is recomputed within the tolerance that the file states. An output that is not
//! computed, a model that is not known and a case that cannot be read all count against it.

use serde_json::Value;
use std::path::{Path, PathBuf};
use thiserror::Error;

pub mod adaptive;
pub mod antenna;
pub mod atmosphere;
pub mod broadcast_precise;
pub mod case;
pub mod combinations;
pub mod coordinates;
pub mod data;
pub mod double_difference;
pub mod em_linear;
pub mod em_ppp;
pub mod expectation;
pub mod inputs;
pub mod integer;
pub mod integrity;
pub mod kalman;
pub mod linear_smoother;
pub mod mixed_integer;
pub mod moments;
pub mod multi_band;
pub mod orbits;
pub mod precise;
pub mod recursive;
pub mod report;
pub mod rule;
pub mod selection;
pub mod single_point;
pub mod slips;
pub mod tides;
pub mod time;

pub use data::DataFiles;
pub use report::Report;

/// A kind of vector file.
struct Format {
    /// Whether a file is of this kind.
    recognises: fn(&Value) -> bool,
    /// Runs all checks of a file.
    run: fn(&Source, &mut Report),
}

/// Every kind of vector file that can be run, tried in this order.
const FORMATS: &[Format] = &[
    Format { recognises: case::recognises, run: case::run },
    Format { recognises: integer::decorrelation::recognises, run: integer::decorrelation::run },
    Format { recognises: integer::least_squares::recognises, run: integer::least_squares::run },
    Format { recognises: integer::smoothed::recognises, run: integer::smoothed::run },
    Format { recognises: integer::bootstrapping::recognises, run: integer::bootstrapping::run },
    Format { recognises: integer::success_bounds::recognises, run: integer::success_bounds::run },
    Format { recognises: integer::success_rates::recognises, run: integer::success_rates::run },
    Format { recognises: integer::subsets::recognises, run: integer::subsets::run },
    Format { recognises: integrity::factors::recognises, run: integrity::factors::run },
    Format { recognises: integrity::stanford::recognises, run: integrity::stanford::run },
    Format { recognises: adaptive::forgetting::recognises, run: adaptive::forgetting::run },
    Format { recognises: adaptive::chain::recognises, run: adaptive::chain::run },
    Format { recognises: double_difference::inputs_alone::recognises, run: double_difference::inputs_alone::run },
    Format { recognises: double_difference::recognises, run: double_difference::run },
    Format { recognises: linear_smoother::recognises, run: linear_smoother::run },
    Format { recognises: expectation::recognises, run: expectation::run },
    Format { recognises: kalman::recognises, run: kalman::run },
    Format { recognises: moments::recognises, run: moments::run },
    Format { recognises: mixed_integer::recognises, run: mixed_integer::run },
    Format { recognises: recursive::recognises, run: recursive::run },
    Format { recognises: slips::recognises, run: slips::run },
    Format { recognises: em_linear::recognises, run: em_linear::run },
    Format { recognises: em_ppp::recognises, run: em_ppp::run },
    Format { recognises: multi_band::geometry::recognises, run: multi_band::geometry::run },
    Format { recognises: multi_band::measurement::recognises, run: multi_band::measurement::run },
    Format { recognises: multi_band::moments::recognises, run: multi_band::moments::run },
    Format { recognises: multi_band::adaptation::recognises, run: multi_band::adaptation::run },
    Format { recognises: multi_band::smoothing::recognises, run: multi_band::smoothing::run },
];

/// A vector file, read.
pub struct Source {
    /// Its whole content.
    pub root: Value,
    /// Observation and navigation files that some cases refer to by name.
    pub data: DataFiles,
    /// Where it is, for files that share their inputs with one beside them.
    pub directory: Option<PathBuf>,
}

/// Why a vector file cannot be run at all.
#[derive(Debug, Error)]
pub enum VectorError {
    /// It cannot be read.
    #[error("cannot read {}; give the path of a vector file", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not JSON.
    #[error("{} is not a vector file, which is JSON", path.display())]
    NotJson {
        /// The file.
        path: PathBuf,
        /// Why, with line and column.
        source: serde_json::Error,
    },
}

/// Runs a vector file. `data` is the directory with observation and navigation files, if it is known.
pub fn run_file(path: &Path, data: Option<&Path>) -> Result<Report, VectorError> {
    let unreadable = |source| VectorError::Unreadable { path: path.to_owned(), source };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let root =
        serde_json::from_slice(&bytes).map_err(|source| VectorError::NotJson { path: path.to_owned(), source })?;
    Ok(run(&Source { root, data: DataFiles::new(data), directory: path.parent().map(Path::to_owned) }))
}

/// Runs a vector file that was read.
pub fn run(source: &Source) -> Report {
    let mut report = Report::default();
    match FORMATS.iter().find(|format| (format.recognises)(&source.root)) {
        Some(format) => (format.run)(source, &mut report),
        None => report.unknown("file of this shape"),
    }
    report
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn run_json(root: Value) -> Report {
        run(&Source { root, data: DataFiles::default(), directory: None })
    }

    /// GPS week 1 begins a week after 1980-01-06 (IS-GPS-200N 3.3.4).
    fn week_case(expected: i32) -> Value {
        let inputs = json!({"calendar_gpst": [1980, 1, 13, 0, 0, 0.0]});
        json!({"id": "a", "model": "cal2gps", "in": inputs, "out": {"week": {"expected": expected, "tol": 0}}})
    }

    #[test]
    fn a_case_is_dispatched_by_its_model_and_judged() {
        assert!(run_json(json!({"cases": [week_case(1)]})).passed());
        assert!(!run_json(json!({"cases": [week_case(2)]})).passed());
    }

    #[test]
    fn what_is_missing_is_named() {
        let without_input = json!({"id": "b", "model": "cal2gps", "in": {}, "out": {}});
        let other_output =
            json!({"id": "c", "model": "cal2gps", "in": week_case(1)["in"], "out": {"moon": {"tol": 1}}});
        let without_data = json!({"id": "d", "in": {"sat": "G01", "file": "x.nav"}, "out": {"selected_toe_week_toe_tow_iode_health": {}}});
        let without_model = json!({"id": "e", "in": {}, "out": {"tide": {}}});
        let report =
            run_json(json!({"cases": [week_case(1), without_input, other_output, without_data, without_model]}));
        let text = report.to_string();
        for part in [
            "b: input \"calendar_gpst\" is not",
            "unknown model: cal2gps.moon",
            "not checked: selection of 1 cases: not at hand: x.nav",
            "unknown model: without name, of tide",
        ] {
            assert!(text.contains(part), "{part} not in\n{text}");
        }
        assert!(!report.passed());
    }

    #[test]
    fn files_that_are_no_vectors_are_refused_by_name() {
        let error = run_file(Path::new("absent.json"), None).unwrap_err();
        assert!(matches!(error, VectorError::Unreadable { .. }) && error.to_string().contains("absent.json"));
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let error = run_file(&manifest, None).unwrap_err();
        assert!(matches!(error, VectorError::NotJson { .. }) && error.to_string().contains("Cargo.toml"));
        assert!(run_json(json!({"doc": "nothing known"})).to_string().contains("file of this shape"));
    }
}
