//! Samples for tests; see `samples/README.md`.

use super::{ObservationEpoch, ObservationReader};
use crate::read::{ReadError, ReadReport};
use std::io::Cursor;

pub const RINEX_2: &str = include_str!("samples/observation_2.rnx");
pub const RINEX_3: &str = include_str!("samples/observation_3.rnx");
pub const COMPACT_1: &str = include_str!("samples/observation_2.crx");
pub const COMPACT_3: &str = include_str!("samples/observation_3.crx");

/// Reads all of `bytes`.
pub fn read(bytes: &[u8]) -> Result<(Vec<ObservationEpoch>, ReadReport), ReadError> {
    let mut reader = ObservationReader::new("sample", Cursor::new(bytes.to_vec()))?;
    let epochs = reader.by_ref().collect::<Result<Vec<_>, _>>()?;
    Ok((epochs, reader.report().clone()))
}
