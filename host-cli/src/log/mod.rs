//! Device logs as files. Format and records are those of [`surefix_core::log`].

mod error;
mod inputs;
mod reader;
pub mod section_v;
mod writer;

pub use error::LogError;
pub use inputs::{Damage, LogInputs};
pub use reader::{Frame, LogReader};
pub use writer::LogWriter;

#[cfg(test)]
mod tests;
