//! What a mixed-integer filter answers at an epoch.
//!
//! Payload, kind 10: [`WireEstimate`], then a [`WireAmbiguity`] for each ambiguity up to the end. Twelve ambiguities are
//! 0.5 KB; at most 32 fit in a frame.
//!
//! Numbers of a filter in `f32` are widened, which is exact: equal bytes are equal filters. The states that are not
//! written enter by their checksum. Panic contract: none.

use super::frame::{FrameError, WriteError, seal};
use super::record::kind;
use crate::gnss::time::GpsTime;
use serde::ser::{Serialize, SerializeTuple, Serializer};
use serde::{Deserialize, Serialize as DeriveSerialize};

/// Why a mixed-integer filter refused an epoch. It is then as it was before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// It was told no model and prior.
    NotStarted,
    /// Measurements and model do not fit together.
    Shape,
    /// It has no room for as many satellites or rows.
    Capacity,
    /// A number is NaN, infinite or beyond all sense.
    NotFinite,
    /// A covariance is not positive definite.
    NotPositiveDefinite,
    /// The measurements do not determine the ambiguities.
    Undetermined,
    /// Integer estimation failed.
    Integers,
}

/// Mean and covariance of a position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PositionDensity {
    /// The rover relative to the base `[m]`.
    pub mean: [f64; 3],
    /// Lower triangle of the covariance: xx, yx, yy, zx, zy, zz `[m²]`.
    pub covariance: [f64; 6],
}

/// One ambiguity in an [`Estimate`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbiguityEstimate {
    /// Mean of the relaxed density `[cycles]`.
    pub mean: f64,
    /// Its variance `[cycles²]`.
    pub variance: f64,
    /// The integer taken `[cycles]`.
    pub integer: i64,
    /// Slip estimate δn `[cycles]`.
    pub slip_estimate: f64,
    /// Whether it is taken to have jumped.
    pub slipped: bool,
}

/// The answer of a mixed-integer filter to an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Time of the epoch (GPST).
    pub time: GpsTime,
    /// Why the epoch was refused; the numbers are then those before it.
    pub refusal: Option<Refusal>,
    /// Ambiguities taken as real numbers.
    pub relaxed: PositionDensity,
    /// Ambiguities taken as the integers found.
    pub constrained: PositionDensity,
    /// Normalised innovation squared of the relaxed update `[1]`.
    pub relaxed_nis: f64,
    /// The same of the constrained update; 0 where there is none.
    pub constrained_nis: f64,
    /// Squared norm of the integers taken `[1]`.
    pub best_norm: f64,
    /// Squared norm of the second nearest integers `[1]`.
    pub second_norm: f64,
    /// Success rate of bootstrapping, 0…1.
    pub success_rate: f64,
    /// Nodes that the integer search visited.
    pub nodes: u32,
    /// The search spent its budget and the integers are those of bootstrapping, or bootstrapping was asked for.
    pub bootstrapped: bool,
    /// The constrained update left out the rows with ambiguities.
    pub gated: bool,
    /// Jump common to all ambiguities, a slip on their reference satellite `[cycles]`.
    pub common_jump: Option<i64>,
    /// CRC-32 (ISO-HDLC) of both densities: means and lower triangles of the covariances row by row, `f64` little endian.
    pub checksum: u32,
}

/// An [`Estimate`] as it was read, with its ambiguities.
#[derive(Clone, Copy, Debug)]
pub struct EstimateRecord<'a> {
    /// All but the ambiguities.
    pub estimate: Estimate,
    ambiguities: &'a [u8],
}

impl<'a> EstimateRecord<'a> {
    /// The ambiguities, in the order of the satellites after the reference.
    pub fn ambiguities(&self) -> impl Iterator<Item = AmbiguityEstimate> + use<'a> {
        WireAmbiguities(self.ambiguities).map_while(Result::ok)
    }

    /// Reads a payload of kind 10.
    pub(super) fn read(payload: &'a [u8]) -> Result<Self, FrameError> {
        let (wire, ambiguities): (WireEstimate, _) =
            postcard::take_from_bytes(payload).map_err(|_| FrameError::Payload)?;
        WireAmbiguities(ambiguities).try_for_each(|ambiguity| ambiguity.map(drop))?;
        Ok(Self { estimate: wire.estimate().ok_or(FrameError::Payload)?, ambiguities })
    }
}

/// Writes an estimate and its ambiguities. More than 32 ambiguities may be [`WriteError::NoRoom`].
pub fn write_estimate<I>(estimate: &Estimate, ambiguities: I, out: &mut [u8]) -> Result<usize, WriteError>
where
    I: Iterator<Item = AmbiguityEstimate> + Clone,
{
    seal(kind::ESTIMATE, &Payload { head: WireEstimate::new(estimate), ambiguities }, out)
}

/// Head and ambiguities, one after another.
struct Payload<I> {
    head: WireEstimate,
    ambiguities: I,
}

impl<I: Iterator<Item = AmbiguityEstimate> + Clone> Serialize for Payload<I> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(1 + self.ambiguities.clone().count())?;
        tuple.serialize_element(&self.head)?;
        self.ambiguities.clone().try_for_each(|each| tuple.serialize_element(&WireAmbiguity::new(&each)))?;
        tuple.end()
    }
}

/// Ambiguities as they were written, until the bytes end or make no sense.
struct WireAmbiguities<'a>(&'a [u8]);

impl Iterator for WireAmbiguities<'_> {
    type Item = Result<AmbiguityEstimate, FrameError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let taken: Option<(WireAmbiguity, _)> = postcard::take_from_bytes(self.0).ok();
        let (wire, rest) = taken.map_or((None, &[][..]), |(wire, rest)| (wire.ambiguity(), rest));
        self.0 = rest;
        Some(wire.ok_or(FrameError::Payload))
    }
}

/// At most 35 bytes.
#[derive(DeriveSerialize, Deserialize, Clone, Copy, Debug)]
struct WireAmbiguity {
    mean: f64,
    variance: f64,
    integer: i64,
    slip_estimate: f64,
    /// 0 or 1.
    slipped: u8,
}

impl WireAmbiguity {
    fn new(ambiguity: &AmbiguityEstimate) -> Self {
        let AmbiguityEstimate { mean, variance, integer, slip_estimate, slipped } = *ambiguity;
        Self { mean, variance, integer, slip_estimate, slipped: u8::from(slipped) }
    }

    fn ambiguity(&self) -> Option<AmbiguityEstimate> {
        let Self { mean, variance, integer, slip_estimate, slipped } = *self;
        (slipped <= 1).then_some(AmbiguityEstimate { mean, variance, integer, slip_estimate, slipped: slipped == 1 })
    }
}

#[derive(DeriveSerialize, Deserialize, Clone, Copy, Debug)]
struct WireEstimate {
    /// Nanoseconds since 1980-01-06 00:00:00 GPST.
    time: i64,
    /// 0 for none, else see [`refusal_code`].
    refusal: u8,
    /// Bit 0 bootstrapped, bit 1 gated.
    flags: u8,
    nodes: u32,
    common_jump: Option<i64>,
    checksum: u32,
    /// Mean and covariance of the relaxed and of the constrained position.
    relaxed: ([f64; 3], [f64; 6]),
    constrained: ([f64; 3], [f64; 6]),
    /// Relaxed and constrained NIS, best and second norm, success rate.
    quality: [f64; 5],
}

impl WireEstimate {
    fn new(e: &Estimate) -> Self {
        Self {
            time: e.time.nanoseconds(),
            refusal: e.refusal.map_or(0, refusal_code),
            flags: u8::from(e.bootstrapped) | u8::from(e.gated) << 1,
            nodes: e.nodes,
            common_jump: e.common_jump,
            checksum: e.checksum,
            relaxed: (e.relaxed.mean, e.relaxed.covariance),
            constrained: (e.constrained.mean, e.constrained.covariance),
            quality: [e.relaxed_nis, e.constrained_nis, e.best_norm, e.second_norm, e.success_rate],
        }
    }

    /// The estimate as it was written; `None` if a code has no meaning.
    fn estimate(&self) -> Option<Estimate> {
        if self.flags > 3 {
            return None;
        }
        let density = |(mean, covariance)| PositionDensity { mean, covariance };
        let [relaxed_nis, constrained_nis, best_norm, second_norm, success_rate] = self.quality;
        Some(Estimate {
            time: GpsTime::from_nanoseconds(self.time),
            refusal: if self.refusal == 0 { None } else { Some(refusal(self.refusal)?) },
            relaxed: density(self.relaxed),
            constrained: density(self.constrained),
            relaxed_nis,
            constrained_nis,
            best_norm,
            second_norm,
            success_rate,
            nodes: self.nodes,
            bootstrapped: self.flags & 1 != 0,
            gated: self.flags & 2 != 0,
            common_jump: self.common_jump,
            checksum: self.checksum,
        })
    }
}

const fn refusal_code(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::NotStarted => 1,
        Refusal::Shape => 2,
        Refusal::Capacity => 3,
        Refusal::NotFinite => 4,
        Refusal::NotPositiveDefinite => 5,
        Refusal::Undetermined => 6,
        Refusal::Integers => 7,
    }
}

const fn refusal(code: u8) -> Option<Refusal> {
    match code {
        1 => Some(Refusal::NotStarted),
        2 => Some(Refusal::Shape),
        3 => Some(Refusal::Capacity),
        4 => Some(Refusal::NotFinite),
        5 => Some(Refusal::NotPositiveDefinite),
        6 => Some(Refusal::Undetermined),
        7 => Some(Refusal::Integers),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{MAX_FRAME, Record, RecordReader};

    /// Every number different, so that an exchange of two shows.
    fn estimate() -> Estimate {
        let x = |n: i32| f64::from(n) + 1.0 / 3.0;
        let density = |n: i32| PositionDensity {
            mean: [x(n), x(n + 1), x(n + 2)],
            covariance: std::array::from_fn(|i| x(n + 3 + i as i32)),
        };
        Estimate {
            time: GpsTime::from_week_tow(2114, 29_700.1),
            refusal: None,
            relaxed: density(1),
            constrained: density(20),
            relaxed_nis: x(40),
            constrained_nis: x(41),
            best_norm: x(42),
            second_norm: f64::INFINITY,
            success_rate: x(44),
            nodes: 70_000,
            bootstrapped: true,
            gated: false,
            common_jump: Some(-3),
            checksum: u32::MAX,
        }
    }

    fn ambiguities(n: i32) -> impl Iterator<Item = AmbiguityEstimate> + Clone {
        (0..n).map(|i| AmbiguityEstimate {
            mean: f64::from(i) - 0.1,
            variance: 0.01,
            integer: i64::MIN + i64::from(i),
            slip_estimate: -0.5,
            slipped: i % 2 == 1,
        })
    }

    fn back(estimate: &Estimate, ambiguity_count: i32) -> (Estimate, Vec<AmbiguityEstimate>) {
        let mut frame = [0; MAX_FRAME];
        let length = write_estimate(estimate, ambiguities(ambiguity_count), &mut frame).unwrap();
        let mut reader: RecordReader = RecordReader::new();
        let mut records = Vec::new();
        for &byte in &frame[..length] {
            match reader.push(byte) {
                None => (),
                Some(Ok(Record::Estimate(record))) => {
                    records.push((record.estimate, record.ambiguities().collect()));
                }
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(records.len(), 1);
        records.remove(0)
    }

    #[test]
    fn estimates_come_back() {
        let refused = Estimate { refusal: Some(Refusal::Undetermined), gated: true, common_jump: None, ..estimate() };
        for (written, count) in [(estimate(), 12), (refused, 0), (estimate(), 32)] {
            let (read, read_ambiguities) = back(&written, count);
            assert_eq!((read, read_ambiguities), (written, ambiguities(count).collect()));
        }
    }

    #[test]
    fn every_code_comes_back() {
        let codes = (0..=u8::MAX).filter_map(|code| Some((code, refusal(code)?)));
        assert_eq!(codes.clone().count(), 7);
        assert!(codes.into_iter().all(|(code, value)| refusal_code(value) == code));
    }

    #[test]
    fn codes_without_a_meaning_and_torn_ambiguities_are_refused() {
        let mut bytes = [0; 512];
        let mut read = |wire: &WireEstimate, tail: &[u8]| {
            let length = postcard::to_slice(wire, &mut bytes).unwrap().len();
            bytes[length..][..tail.len()].copy_from_slice(tail);
            EstimateRecord::read(&bytes[..length + tail.len()]).map(|record| record.ambiguities().count())
        };
        let good = WireEstimate::new(&estimate());
        let mut ambiguity = [0; 26]; // two numbers, an integer of one byte, a number, a flag
        assert_eq!((read(&good, &[]), read(&good, &ambiguity)), (Ok(0), Ok(1)));
        assert_eq!(read(&good, &ambiguity[1..]), Err(FrameError::Payload));
        ambiguity[25] = 2;
        assert_eq!(read(&good, &ambiguity), Err(FrameError::Payload));
        assert_eq!(read(&WireEstimate { refusal: 8, ..good }, &[]), Err(FrameError::Payload));
        assert_eq!(read(&WireEstimate { flags: 4, ..good }, &[]), Err(FrameError::Payload));
    }
}
