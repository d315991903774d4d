//! The device log: what a receiver recorded and what the filter answered, as a stream of bytes that survives damage.
//!
//! A log is a sequence of frames, one record each, on a file or a serial line alike. Writing needs no state beyond a
//! buffer of [`MAX_FRAME`] bytes, reading none beyond one [`RecordReader`]. A log may be cut or joined anywhere: any
//! damage loses only the frames that it touches, and the reader counts them.
//!
//! ## Frame
//! ```text
//! 00 │ COBS( 53 │ version 01 │ kind │ payload … │ CRC-32, little endian ) │ 00
//! ```
//! * **COBS** (Cheshire and Baker, 1999, IEEE/ACM Trans. Networking 7(2)) removes zero bytes, so that `00` occurs only
//!   between frames and a reader finds the next frame after any damage. A frame has a delimiter on both sides: one that
//!   was cut short does not swallow its successor. Empty frames are ignored.
//! * **CRC-32** is that of ISO-HDLC (zip, Ethernet), over all bytes before it, start byte and version included.
//! * **Payload**: [postcard](https://postcard.jamesmunns.com/wire-format) of private structs (in `wire`, `measurements`,
//!   `estimate`), whose layout is frozen by golden files. A change of layout takes a new kind or a new [`VERSION`].
//!
//! | kind | record | written by |
//! |---|---|---|
//! | 1 | [`Header`]: base coordinate, antenna offsets | [`write_header`] |
//! | 2 | [`Ionosphere`]: Klobuchar parameters | [`write_ionosphere`] |
//! | 3, 4 | [`Ephemeris`](crate::gnss::ephemeris::Ephemeris): Kepler, GLONASS | [`write_ephemeris`] |
//! | 5 | [`EpochPart`]: up to [`EPOCH_PART`] observations of an epoch | [`write_epoch_part`] |
//! | 6 | [`Solution`](crate::gnss::solution::Solution) | [`write_solution`] |
//! | 7 | [`Event`] | [`write_event`] |
//! | 8 | [`Config`]: settings of an engine, opaque here | [`write_config`] |
//! | 9 | [`Measurements`] of an epoch, for a mixed-integer filter | [`write_measurements`] |
//! | 10 | [`Estimate`]: the answer of a mixed-integer filter | [`write_estimate`] |
//! | 11 | as 6, with protection levels or a moving base | [`write_solution`] |
//!
//! ## Exactness
//! Every number comes back bit for bit. An observable that is a whole number of thousandths, as all in RINEX are, is
//! stored as that number and takes about half the room; any other takes its eight bytes. Twenty satellites with two
//! signals each are about 1 KB. Reading refuses numbers that are not finite: an observable is dropped and counted
//! ([`Counts::observables_not_finite`]), another record is refused ([`FrameError::NotFinite`]).
//!
//! ## Example
//! ```
//! use surefix_core::log::{write_event, Event, Record, RecordReader, MAX_FRAME};
//!
//! let mut frame = [0; MAX_FRAME];
//! let length = write_event(&Event::End, &mut frame).unwrap();
//!
//! let mut reader: RecordReader = RecordReader::new();
//! for &byte in &frame[..length] {
//!     if let Some(Ok(record)) = reader.push(byte) {
//!         assert!(matches!(record, Record::Event(Event::End)));
//!     }
//! }
//! assert_eq!(reader.counts().good, 1);
//! ```
//!
//! [`RecordReader`] gives records one by one; [`InputReader`] gives what an engine wants, epochs in one piece.
//!
//! ## Cost and panic contract
//! A reader owns [`MAX_FRAME`] bytes, an [`EpochCollector`] one epoch; nothing larger than a solution (0.4 KB) is passed
//! by value. CRC takes a table of 1 KB in flash. Nothing here panics.

mod cobs;
mod collect;
mod estimate;
mod frame;
mod input;
mod measurements;
mod reader;
mod record;
mod wire;
mod write;

pub use collect::EpochCollector;
pub use estimate::{AmbiguityEstimate, Estimate, EstimateRecord, PositionDensity, Refusal, write_estimate};
pub(crate) use frame::CRC;
pub use frame::{FrameError, MAGIC, MAX_FRAME, VERSION, WriteError};
pub use input::{Input, InputReader};
pub use measurements::{Measurements, write_measurements};
pub use reader::{Counts, RecordReader};
pub use record::{Config, EpochPart, Event, Header, Ionosphere, Record, Station};
pub use write::{
    EPOCH_PART, epoch_parts, write_config, write_ephemeris, write_epoch_part, write_event, write_header,
    write_ionosphere, write_solution,
};
