//! Readers: files of others into the core's vocabulary.
//!
//! [`rinex`] reads observations and navigation messages, [`solution`] positions over time; [`sp3`] and [`clock`] precise
//! orbits and clocks, [`antex`] antenna phase centres, [`bias`] biases of signals, [`blq`] ocean loading, [`erp`] the orientation
//! of the Earth, [`ionex`] maps of the ionosphere, [`gpt3`] the troposphere's seasons. Every reader keeps three promises:
//! * an input that cannot be used at all is a [`ReadError`] that names file, line and remedy;
//! * a record that cannot be used is dropped and counted in a [`ReadReport`], with the line of the first one;
//! * whatever else was recorded of a supported constellation arrives, to the last digit.
//!
//! No reader panics, whatever the bytes (property tests feed garbage and mutated files).

pub mod antex;
pub mod bias;
pub mod blq;
pub mod clock;
pub mod erp;
mod error;
mod field;
pub mod gpt3;
pub mod ionex;
mod kind;
mod lines;
mod nodes;
mod report;
pub mod rinex;
pub mod solution;
pub mod sp3;

pub use error::{FileKind, ReadError};
pub use kind::{kind, kind_of_line};
pub use report::{ReadReport, Reason, Tally};
