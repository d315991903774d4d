//! Golden vectors: files of inputs and expected outputs, run against the models of this program.
//!
//! Each file is of a [`Format`], recognised by its shape; each format is one module. The format of files with `cases`
//! of `in` and `out` ([`case`]) has a further table from the case's model to the function that recomputes it.
//!
//! A file passes if every expected output is recomputed within the tolerance that the file states. An output that is not
//! computed, a model that is not known and a case that cannot be read all count against it.

use serde_json::Value;
use std::path::{Path, PathBuf};
use thiserror::Error;

pub mod atmosphere;
pub mod case;
pub mod combinations;
pub mod coordinates;
pub mod inputs;
pub mod integer;
pub mod kalman;
pub mod orbits;
pub mod report;
pub mod single_point;
pub mod time;

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
    Format { recognises: integer::bootstrapping::recognises, run: integer::bootstrapping::run },
    Format { recognises: integer::success_rates::recognises, run: integer::success_rates::run },
    Format { recognises: kalman::recognises, run: kalman::run },
];

/// A vector file, read.
pub struct Source {
    /// Its whole content.
    pub root: Value,
    /// Where observation and navigation files are that some cases refer to by name.
    pub data: Option<PathBuf>,
}

/// Why a vector file cannot be run at all.
#[derive(Debug, Error)]
pub enum VectorError {
    /// It cannot be read.
    #[error("cannot read {}: {source}; give the path of a vector file", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not JSON.
    #[error("{} is not a vector file: {source}", path.display())]
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
    let source = Source { root, data: data.map(Path::to_owned) };
    let mut report = Report::default();
    match FORMATS.iter().find(|format| (format.recognises)(&source.root)) {
        Some(format) => (format.run)(&source, &mut report),
        None => report.unknown("file of this shape"),
    }
    Ok(report)
}
