//! Writing: one function a kind of record, each into the caller's buffer, each returning the length of the frame.
//!
//! A buffer of [`MAX_FRAME`](super::MAX_FRAME) bytes holds any frame. Panic contract: none.

use super::frame::{WriteError, seal};
use super::record::{Event, Header, Ionosphere, Station, kind};
use super::wire::{
    WireBounds, WireEpochHead, WireEvent, WireGlonass, WireHeader, WireIonosphere, WireKepler, WireObservation,
    WireSolution, station_code,
};
use crate::gnss::ephemeris::Ephemeris;
use crate::gnss::epoch::{EpochView, Observation};
use crate::gnss::solution::Solution;
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// Most observations in a frame: at 37 bytes at most each, always within [`MAX_FRAME`](super::MAX_FRAME).
pub const EPOCH_PART: usize = 40;

/// Writes a [`Header`].
pub fn write_header(header: &Header, out: &mut [u8]) -> Result<usize, WriteError> {
    seal(kind::HEADER, &WireHeader::new(header), out)
}

/// Writes parameters of the ionosphere.
pub fn write_ionosphere(ionosphere: &Ionosphere, out: &mut [u8]) -> Result<usize, WriteError> {
    seal(kind::IONOSPHERE, &WireIonosphere::new(ionosphere), out)
}

/// Writes a broadcast ephemeris.
pub fn write_ephemeris(ephemeris: &Ephemeris, out: &mut [u8]) -> Result<usize, WriteError> {
    match ephemeris {
        Ephemeris::Kepler(kepler) => seal(kind::KEPLER, &WireKepler::new(kepler), out),
        Ephemeris::Glonass(glonass) => seal(kind::GLONASS, &WireGlonass::new(glonass), out),
    }
}

/// Writes a solution.
pub fn write_solution(solution: &Solution, out: &mut [u8]) -> Result<usize, WriteError> {
    let wire = WireSolution::new(solution);
    match WireBounds::new(solution) {
        Some(bounds) => seal(kind::BOUNDED_SOLUTION, &(wire, bounds), out),
        None => seal(kind::SOLUTION, &wire, out),
    }
}

/// Writes an event.
pub fn write_event(event: &Event, out: &mut [u8]) -> Result<usize, WriteError> {
    seal(kind::EVENT, &WireEvent::new(event), out)
}

/// Writes settings of an engine, with a number by which their owner knows them again.
pub fn write_config<T: Serialize + ?Sized>(schema: u16, settings: &T, out: &mut [u8]) -> Result<usize, WriteError> {
    seal(kind::CONFIG, &(schema, settings), out)
}

/// In how many frames an epoch is written, at least one.
pub fn epoch_parts(epoch: EpochView<'_>) -> usize {
    epoch.observations.len().div_ceil(EPOCH_PART).max(1)
}

/// Writes part number `part` of an epoch, 0 ≤ `part` < [`epoch_parts`].
pub fn write_epoch_part(
    station: Station,
    epoch: EpochView<'_>,
    part: usize,
    out: &mut [u8],
) -> Result<usize, WriteError> {
    let total = epoch.observations.len();
    let first = part.saturating_mul(EPOCH_PART).min(total);
    if part >= epoch_parts(epoch) {
        return Err(WriteError::NotExpressible);
    }
    let wide = |n: usize| u16::try_from(n).map_err(|_| WriteError::NotExpressible);
    let head = WireEpochHead {
        station: station_code(station),
        time: epoch.time.nanoseconds(),
        first: wide(first)?,
        total: wide(total)?,
    };
    let observations = epoch.observations.get(first..total.min(first + EPOCH_PART)).unwrap_or_default();
    seal(kind::EPOCH, &Part { head, observations }, out)
}

/// Head and observations, one after another.
struct Part<'a> {
    head: WireEpochHead,
    observations: &'a [Observation],
}

impl Serialize for Part<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(1 + self.observations.len())?;
        tuple.serialize_element(&self.head)?;
        for observation in self.observations {
            tuple.serialize_element(&WireObservation::new(observation))?;
        }
        tuple.end()
    }
}
