//! Measurements of a partially linear model: what a mixed-integer filter is told at an epoch.
//!
//! Payload, kind 9: a head, then 3 N numbers (satellites relative to the base, x y z each `[m]`) and p numbers (the
//! measurements, in the order of the model's rows), `f64` little endian each. N = 13 with p = 63 are 0.8 KB; at most 188
//! numbers fit in a frame.
//!
//! The numbers stay in the reader's buffer and are decoded one by one. Panic contract: none.

use super::frame::{FrameError, WriteError, seal};
use super::record::kind;
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;
use serde::ser::{Serialize, SerializeTuple, Serializer};
use serde::{Deserialize, Serialize as DeriveSerialize};

/// Bytes of a vector of three `f64`.
const VECTOR: usize = 24;

/// The measurements of one epoch.
#[derive(Clone, Copy, Debug)]
pub struct Measurements<'a> {
    /// Time of the epoch (GPST).
    pub time: GpsTime,
    satellites: &'a [[u8; VECTOR]],
    values: &'a [[u8; 8]],
}

impl<'a> Measurements<'a> {
    /// Satellites relative to the base `[m]`, the reference satellite first.
    pub fn satellites(&self) -> impl ExactSizeIterator<Item = Vector3<f64>> + use<'a> {
        self.satellites.iter().map(vector)
    }

    /// y, in the order of the model's rows.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f64> + use<'a> {
        self.values.iter().map(|bytes| f64::from_le_bytes(*bytes))
    }

    /// Reads a payload of kind 9.
    pub(super) fn read(payload: &'a [u8]) -> Result<Self, FrameError> {
        let (head, numbers): (WireHead, _) = postcard::take_from_bytes(payload).map_err(|_| FrameError::Payload)?;
        let (positions, values) =
            numbers.split_at_checked(VECTOR * usize::from(head.satellites)).ok_or(FrameError::Payload)?;
        let ((satellites, []), (values, [])) = (positions.as_chunks(), values.as_chunks()) else {
            return Err(FrameError::Payload);
        };
        if values.len() != usize::from(head.values) {
            return Err(FrameError::Payload);
        }
        let read = Self { time: GpsTime::from_nanoseconds(head.time), satellites, values };
        let is_finite = read.values().chain(read.satellites().flat_map(|s| [s.x, s.y, s.z])).all(f64::is_finite);
        if is_finite { Ok(read) } else { Err(FrameError::NotFinite) }
    }
}

fn vector(bytes: &[u8; VECTOR]) -> Vector3<f64> {
    let (numbers, _) = bytes.as_chunks();
    let mut numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes));
    Vector3::from_fn(|_, _| numbers.next().unwrap_or_default())
}

/// Writes the measurements of an epoch. More than fit in a frame, 23 satellites with their 113 rows, is
/// [`WriteError::NoRoom`].
pub fn write_measurements(
    time: GpsTime,
    satellites: &[Vector3<f64>],
    values: &[f64],
    out: &mut [u8],
) -> Result<usize, WriteError> {
    let count = |n: usize| u16::try_from(n).map_err(|_| WriteError::NoRoom);
    let head =
        WireHead { time: time.nanoseconds(), satellites: count(satellites.len())?, values: count(values.len())? };
    seal(kind::MEASUREMENTS, &Payload { head, satellites, values }, out)
}

/// At most 16 bytes.
#[derive(DeriveSerialize, Deserialize, Clone, Copy, Debug)]
struct WireHead {
    /// Nanoseconds since 1980-01-06 00:00:00 GPST.
    time: i64,
    /// N.
    satellites: u16,
    /// p.
    values: u16,
}

/// Head and numbers, one after another.
struct Payload<'a> {
    head: WireHead,
    satellites: &'a [Vector3<f64>],
    values: &'a [f64],
}

impl Serialize for Payload<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(1 + 3 * self.satellites.len() + self.values.len())?;
        tuple.serialize_element(&self.head)?;
        self.satellites.iter().flatten().chain(self.values).try_for_each(|number| tuple.serialize_element(number))?;
        tuple.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{MAX_FRAME, Record, RecordReader};
    use proptest::prelude::*;

    /// Time, satellites and values that come back from a frame; the error if it is refused.
    type Back = Result<(GpsTime, Vec<Vector3<f64>>, Vec<f64>), FrameError>;

    fn back(time: GpsTime, satellites: &[Vector3<f64>], values: &[f64]) -> Back {
        let mut frame = [0; MAX_FRAME];
        let length = write_measurements(time, satellites, values, &mut frame).unwrap();
        let mut reader: RecordReader = RecordReader::new();
        let mut back = None;
        for &byte in &frame[..length] {
            match reader.push(byte) {
                None => (),
                Some(Ok(Record::Measurements(m))) => {
                    back = Some(Ok((m.time, m.satellites().collect(), m.values().collect())));
                }
                Some(Err(error)) => back = Some(Err(error)),
                Some(Ok(other)) => panic!("{other:?}"),
            }
        }
        back.unwrap()
    }

    proptest! {
        #[test]
        fn measurements_come_back_bit_for_bit(
            time in any::<i64>(),
            satellites in prop::collection::vec(prop::array::uniform3(-1e9..1e9), 0..24),
            values in prop::collection::vec(prop_oneof![-1e9..1e9, Just(-0.0), Just(f64::MIN_POSITIVE)], 0..117),
        ) {
            let satellites: Vec<_> = satellites.into_iter().map(Vector3::from).collect();
            let time = GpsTime::from_nanoseconds(time);
            let (at, positions, numbers) = back(time, &satellites, &values).unwrap();
            prop_assert_eq!((at, positions), (time, satellites));
            prop_assert!(numbers.iter().map(|x| x.to_bits()).eq(values.iter().map(|x| x.to_bits())));
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        let time = GpsTime::from_nanoseconds(0);
        let far = Vector3::new(0.0, f64::INFINITY, 0.0);
        assert_eq!(back(time, &[Vector3::zeros()], &[1.0, f64::NAN]), Err(FrameError::NotFinite));
        assert_eq!(back(time, &[Vector3::zeros(), far], &[1.0]), Err(FrameError::NotFinite));
    }

    #[test]
    fn a_payload_of_another_length_is_refused() {
        let head = WireHead { time: -1, satellites: 2, values: 3 };
        let payload = |numbers: usize, cut: usize| {
            let mut bytes = [0; 256];
            let length = postcard::to_slice(&head, &mut bytes).unwrap().len() + 8 * numbers - cut;
            Measurements::read(&bytes[..length]).map(|m| (m.satellites().len(), m.values().len()))
        };
        assert_eq!(payload(9, 0), Ok((2, 3)));
        for (numbers, cut) in [(8, 0), (10, 0), (9, 1), (6, 1), (0, 0)] {
            assert_eq!(payload(numbers, cut), Err(FrameError::Payload), "{numbers} numbers less {cut} bytes");
        }
    }

    #[test]
    fn what_does_not_fit_is_said() {
        let mut frame = [0; 2 * MAX_FRAME];
        let mut write = |n: usize| {
            let satellites = vec![Vector3::new(1e7, -2e7, 3e6); n];
            write_measurements(GpsTime::from_nanoseconds(i64::MAX), &satellites, &vec![0.5; 5 * n - 2], &mut frame)
        };
        assert!(write(23).unwrap() <= MAX_FRAME);
        assert_eq!(write(24), Err(WriteError::NoRoom));
    }
}
