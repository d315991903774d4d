//! Reading: bytes in, records out, with a count of all that was not a record.
//!
//! Panic contract: none.

use super::frame::{FrameError, MAX_FRAME, open};
use super::record::Record;

/// What a reader has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Records.
    pub good: u32,
    /// Frames longer than the reader's buffer ([`FrameError::Overlong`]).
    pub overlong: u32,
    /// Not frames ([`FrameError::Malformed`], [`FrameError::Foreign`]).
    pub malformed: u32,
    /// Frames with a wrong checksum.
    pub checksum: u32,
    /// Frames of another version.
    pub version: u32,
    /// Frames of an unknown kind.
    pub kind: u32,
    /// Frames whose payload is not that of their kind.
    pub payload: u32,
    /// Records other than epochs with a number that is not finite.
    pub not_finite: u32,
    /// Observables that are not finite, in good epochs.
    pub observables_not_finite: u32,
}

impl Counts {
    /// Frames that are not good.
    pub const fn bad(&self) -> u32 {
        self.overlong
            .saturating_add(self.malformed)
            .saturating_add(self.checksum)
            .saturating_add(self.version)
            .saturating_add(self.kind)
            .saturating_add(self.payload)
            .saturating_add(self.not_finite)
    }

    fn add(&mut self, frame: &Result<Record<'_>, FrameError>) {
        let count = match frame {
            Ok(record) => {
                if let Record::Epoch(part) = record {
                    self.observables_not_finite = self.observables_not_finite.saturating_add(part.not_finite);
                }
                &mut self.good
            }
            Err(FrameError::Overlong) => &mut self.overlong,
            Err(FrameError::Malformed | FrameError::Foreign(_)) => &mut self.malformed,
            Err(FrameError::Checksum) => &mut self.checksum,
            Err(FrameError::Version(_)) => &mut self.version,
            Err(FrameError::Kind(_)) => &mut self.kind,
            Err(FrameError::Payload) => &mut self.payload,
            Err(FrameError::NotFinite) => &mut self.not_finite,
        };
        *count = count.saturating_add(1);
    }
}

/// Finds records in a stream of bytes, with a buffer for frames of up to `N` bytes.
#[derive(Clone, Debug)]
pub struct RecordReader<const N: usize = MAX_FRAME> {
    buffer: [u8; N],
    /// Bytes since the latest delimiter, also those that the buffer did not hold.
    length: usize,
    counts: Counts,
}

impl<const N: usize> RecordReader<N> {
    /// A reader at the start of a log, or anywhere in one.
    pub const fn new() -> Self {
        Self {
            buffer: [0; N],
            length: 0,
            counts: Counts {
                good: 0,
                overlong: 0,
                malformed: 0,
                checksum: 0,
                version: 0,
                kind: 0,
                payload: 0,
                not_finite: 0,
                observables_not_finite: 0,
            },
        }
    }

    /// Takes the next byte. Each delimiter that ends a frame gives its record, or the reason why it is none; the other
    /// bytes give `None`.
    pub fn push(&mut self, byte: u8) -> Option<Result<Record<'_>, FrameError>> {
        if byte != 0 {
            if let Some(slot) = self.buffer.get_mut(self.length) {
                *slot = byte;
            }
            self.length = self.length.saturating_add(1);
            return None;
        }
        self.end_frame()
    }

    /// Ends the stream: what comes after the last delimiter is a frame that was cut off, or no frame at all. The reader
    /// is ready for another stream.
    pub fn finish(&mut self) -> Option<Result<Record<'_>, FrameError>> {
        self.end_frame()
    }

    /// What was read so far.
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    fn end_frame(&mut self) -> Option<Result<Record<'_>, FrameError>> {
        let length = core::mem::take(&mut self.length);
        if length == 0 {
            return None;
        }
        let frame = match self.buffer.get_mut(..length) {
            Some(encoded) => open(encoded).and_then(|(kind, payload)| Record::read(kind, payload)),
            None => Err(FrameError::Overlong),
        };
        self.counts.add(&frame);
        Some(frame)
    }
}

impl<const N: usize> Default for RecordReader<N> {
    fn default() -> Self {
        Self::new()
    }
}
