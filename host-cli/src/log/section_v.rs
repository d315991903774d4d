//! Runs a device log through the mixed-integer filter of Section V, as firmware does.
//!
//! The same [`SectionVEngine`] as in firmware is fed with the same records, so its answers are the same byte for byte.

use super::error::LogError;
use super::reader::LogReader;
use std::io::{self, BufRead};
use std::path::Path;
use surefix_core::filter::section_v::{Answer, CONFIG_SCHEMA, SectionVEngine};
use surefix_core::log::Record;
use surefix_core::real::Real;

/// Why a replay ended early.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// An answer cannot be taken.
    #[error("the answer cannot be written ({0}); check the disk")]
    Answer(#[from] io::Error),
}

/// Whether a log is for this filter: its settings, or the first measurements in it, say so.
pub fn is_for_section_v(path: &Path) -> Result<bool, LogError> {
    let mut log = LogReader::open(path)?;
    while let Some(frame) = log.next_frame()? {
        match frame.record {
            Ok(Record::Config(config)) => return Ok(config.schema == CONFIG_SCHEMA),
            Ok(Record::Measurements(_)) => return Ok(true),
            Ok(Record::Epoch(_)) => return Ok(false),
            _ => (),
        }
    }
    Ok(false)
}

/// Feeds all records of a log to an engine, and `sink` with its answers. T is the scalar of the covariances.
pub fn replay<T: Real, R: BufRead>(
    log: &mut LogReader<R>,
    mut sink: impl FnMut(&Answer<'_, T>) -> io::Result<()>,
) -> Result<(), ReplayError> {
    let mut engine = Box::new(SectionVEngine::new());
    while let Some(frame) = log.next_frame()? {
        if let Some(answer) = frame.record.ok().and_then(|record| engine.feed(&record)) {
            sink(&answer)?;
        }
    }
    Ok(())
}
