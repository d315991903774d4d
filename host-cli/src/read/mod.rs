//! Readers: files of others into the core's vocabulary.
//!
//! [`rinex`] reads observations and navigation messages, [`solution`] positions over time. Every reader keeps three promises:
//! * an input that cannot be used at all is a [`ReadError`] that names file, line and remedy;
//! * a record that cannot be used is dropped and counted in a [`ReadReport`], with the line of the first one;
//! * whatever else was recorded of a supported constellation arrives, to the last digit.
//!
//! No reader panics, whatever the bytes (property tests feed garbage and mutated files).

mod error;
mod field;
mod lines;
mod report;
pub mod rinex;
pub mod solution;

pub use error::{FileKind, ReadError};
pub use report::{ReadReport, Reason, Tally};
