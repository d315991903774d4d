//! Frames: start byte, version and kind in front of a payload, CRC-32 behind it, COBS around all.
//!
//! [`seal`] writes a frame in one pass into the caller's buffer, [`open`] reads one in place. Panic contract: none.

use super::cobs;
use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// First byte of each frame, ASCII `S`.
pub const MAGIC: u8 = 0x53;
/// Version of the format, second byte of each frame.
pub const VERSION: u8 = 1;
/// The longest frame in bytes, delimiters included. Nothing longer is written, so that a reader with a buffer of this
/// size can read any log.
pub const MAX_FRAME: usize = 1536;

/// Bytes of a frame before encoding that are not payload: start byte, version, kind, CRC.
const OVERHEAD: usize = 7;

pub(crate) static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why a frame was not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteError {
    /// It does not fit in the buffer, or is longer than [`MAX_FRAME`].
    NoRoom,
    /// The record cannot be expressed: a part that the epoch does not have, an epoch of more than 65 535 observations,
    /// or a configuration that postcard cannot express.
    NotExpressible,
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoRoom => "the frame does not fit",
            Self::NotExpressible => "the record cannot be expressed as a frame",
        })
    }
}

impl core::error::Error for WriteError {}

/// Why the bytes between two delimiters are not a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// More bytes than the reader's buffer holds.
    Overlong,
    /// Not COBS, or too short for a frame.
    Malformed,
    /// The checksum is wrong.
    Checksum,
    /// Intact, but not a frame of a device log: the first byte is this.
    Foreign(u8),
    /// Intact, but of this version, which is not [`VERSION`].
    Version(u8),
    /// Intact, but of this kind, which is not known.
    Kind(u8),
    /// Intact, but the payload is not that of its kind.
    Payload,
    /// Intact, but an ephemeris, header or ionosphere with a number that is NaN or infinite.
    NotFinite,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Overlong => f.write_str("longer than a frame may be"),
            Self::Malformed => f.write_str("not a frame"),
            Self::Checksum => f.write_str("checksum is wrong"),
            Self::Foreign(byte) => write!(f, "a frame of something else, start byte {byte:#04x}"),
            Self::Version(version) => write!(f, "format version {version}, known is {VERSION}"),
            Self::Kind(kind) => write!(f, "unknown kind of record {kind}"),
            Self::Payload => f.write_str("payload does not fit its kind of record"),
            Self::NotFinite => f.write_str("a number in the record is NaN or infinite"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Writes a frame with delimiters on both sides into `out`; its length.
pub(super) fn seal<T: Serialize + ?Sized>(kind: u8, payload: &T, out: &mut [u8]) -> Result<usize, WriteError> {
    let room = out.len().min(MAX_FRAME);
    let out = out.get_mut(..room).unwrap_or_default();
    let encoder = cobs::Encoder::new(out).map_err(|_| WriteError::NoRoom)?;
    let sealer = Sealer { encoder, digest: CRC.digest() };
    postcard::serialize_with_flavor(&(MAGIC, VERSION, kind, payload), sealer).map_err(|error| match error {
        postcard::Error::SerializeBufferFull => WriteError::NoRoom,
        _ => WriteError::NotExpressible,
    })
}

/// Where postcard's bytes go: through the checksum into the encoder.
struct Sealer<'a> {
    encoder: cobs::Encoder<'a>,
    digest: Digest<'static, u32>,
}

impl Flavor for Sealer<'_> {
    type Output = usize;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.digest.update(&[byte]);
        self.encoder.push(byte).map_err(full)
    }

    fn finalize(mut self) -> postcard::Result<usize> {
        for byte in self.digest.finalize().to_le_bytes() {
            self.encoder.push(byte).map_err(full)?;
        }
        self.encoder.finish().map_err(full)
    }
}

fn full(_: cobs::Full) -> postcard::Error {
    postcard::Error::SerializeBufferFull
}

/// Kind and payload of the frame that was found between two delimiters; `encoded` is overwritten.
pub(super) fn open(encoded: &mut [u8]) -> Result<(u8, &[u8]), FrameError> {
    let plain = cobs::decode(encoded).ok_or(FrameError::Malformed)?;
    let (checked, crc) = plain.split_last_chunk::<4>().ok_or(FrameError::Malformed)?;
    if checked.len() + 4 < OVERHEAD {
        return Err(FrameError::Malformed);
    }
    if CRC.checksum(checked) != u32::from_le_bytes(*crc) {
        return Err(FrameError::Checksum);
    }
    match *checked {
        [MAGIC, VERSION, kind, ref payload @ ..] => Ok((kind, payload)),
        [MAGIC, version, ..] => Err(FrameError::Version(version)),
        [other, ..] => Err(FrameError::Foreign(other)),
        [] => Err(FrameError::Malformed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `53 01 07` and payload `02 05`; CRC-32 by Python's `zlib.crc32(bytes.fromhex("5301070205"))`.
    #[test]
    fn bytes_are_those_of_the_documented_layout() {
        let mut out = [0; 32];
        let length = seal(7, &(2u8, 5u8), &mut out).unwrap();
        assert_eq!(out[..length], [0x00, 0x0a, 0x53, 0x01, 0x07, 0x02, 0x05, 0xeb, 0xa5, 0x3e, 0x46, 0x00]);
        assert_eq!(open(&mut out[1..length - 1]), Ok((7, &[2u8, 5][..])));
    }

    #[test]
    fn what_is_not_a_frame_is_named() {
        let sealed = |plain: &[u8]| {
            let mut out = [0; 64];
            let mut encoder = cobs::Encoder::new(&mut out).unwrap();
            for &byte in plain.iter().chain(&CRC.checksum(plain).to_le_bytes()) {
                encoder.push(byte).unwrap();
            }
            let length = encoder.finish().unwrap();
            out[1..length - 1].to_vec()
        };
        let error = |bytes: &[u8]| open(&mut bytes.to_vec()).unwrap_err();
        assert_eq!(error(&sealed(&[0x54, 1, 1])), FrameError::Foreign(0x54));
        assert_eq!(error(&sealed(&[MAGIC, 2, 1])), FrameError::Version(2));
        assert_eq!(error(&sealed(&[MAGIC, 1])), FrameError::Malformed);
        assert_eq!(error(&[5, 1]), FrameError::Malformed);
        let mut flipped = sealed(&[MAGIC, VERSION, 7, 2, 5]);
        flipped[4] ^= 1;
        assert_eq!(error(&flipped), FrameError::Checksum);
    }

    #[test]
    fn nothing_longer_than_the_limit_is_written() {
        let mut out = [0; 2 * MAX_FRAME];
        let longest = MAX_FRAME - 2 - OVERHEAD - 7; // two delimiters, seven COBS code bytes for 1520 bytes
        assert!(seal(8, &[0xffu8; 32], &mut out).is_ok());
        let text = core::str::from_utf8(&[b'x'; MAX_FRAME]).unwrap();
        let fits = |n: usize| seal(8, &text[..n], &mut [0; 2 * MAX_FRAME]);
        assert_eq!(fits(longest - 2), Ok(MAX_FRAME)); // two bytes for the length of the text
        assert_eq!(fits(longest - 1), Err(WriteError::NoRoom));
        assert_eq!(seal(7, &1u8, &mut out[..9]), Err(WriteError::NoRoom));
    }
}
