//! Records: what a frame says, as the rest of the program sees it.
//!
//! Observations of an epoch stay in the reader's buffer and are decoded one by one, so that an epoch needs no second
//! store and no large value is moved. Panic contract: none.

use super::estimate::EstimateRecord;
use super::frame::FrameError;
use super::measurements::Measurements;
use super::wire::{
    self, WireBounds, WireEpochHead, WireEvent, WireGlonass, WireHeader, WireIonosphere, WireKepler, WireObservation,
    WireSolution,
};
use crate::gnss::atmosphere::Klobuchar;
use crate::gnss::ephemeris::Ephemeris;
use crate::gnss::epoch::Observation;
use crate::gnss::satellite::Constellation;
use crate::gnss::solution::Solution;
use crate::gnss::time::GpsTime;
use serde::Deserialize;

/// Kinds of record as frames state them.
pub(super) mod kind {
    pub const HEADER: u8 = 1;
    pub const IONOSPHERE: u8 = 2;
    pub const KEPLER: u8 = 3;
    pub const GLONASS: u8 = 4;
    pub const EPOCH: u8 = 5;
    pub const SOLUTION: u8 = 6;
    pub const EVENT: u8 = 7;
    pub const CONFIG: u8 = 8;
    pub const MEASUREMENTS: u8 = 9;
    pub const ESTIMATE: u8 = 10;
    pub const BOUNDED_SOLUTION: u8 = 11;
}

/// Whose observations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Station {
    /// The receiver whose position is wanted.
    Rover,
    /// The receiver whose position is known.
    Base,
}

/// What is known of the stations, at the start of a log. All parameters of a log are those of its latest header.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Header {
    /// Marker of the base, ECEF `[m]`.
    pub base_position: Option<[f64; 3]>,
    /// Antenna reference point of the base above its marker: up, east, north `[m]` (RINEX ANTENNA: DELTA H/E/N).
    pub base_antenna: [f64; 3],
    /// The same of the rover.
    pub rover_antenna: [f64; 3],
}

/// Parameters of the ionosphere and who broadcast them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ionosphere {
    /// GPS, BeiDou or QZSS.
    pub constellation: Constellation,
    /// The parameters.
    pub klobuchar: Klobuchar,
}

/// Something that happened to the recording device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The log ends here on purpose; nothing was cut off.
    End,
    /// The device or its filter started afresh.
    Reset,
    /// So many records were lost before this one because the device could not keep up or its input was damaged.
    Dropped(u32),
    /// A mark set by the user.
    Marker(u32),
}

/// Settings of an engine. The log does not know their meaning: `schema` says what `data` is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config<'a> {
    /// What the data is, a number that its owner gave out.
    pub schema: u16,
    /// A postcard value.
    pub data: &'a [u8],
}

impl<'a> Config<'a> {
    /// The settings as a value; `None` if the data is not exactly one `T`.
    pub fn value<T: Deserialize<'a>>(&self) -> Option<T> {
        whole(self.data).ok()
    }
}

/// A part of an epoch of one station: up to [`super::EPOCH_PART`] of its observations.
#[derive(Clone, Copy, Debug)]
pub struct EpochPart<'a> {
    /// Whose observations.
    pub station: Station,
    /// Receiver time of the epoch (GPST).
    pub time: GpsTime,
    /// Index in the epoch of the first observation of this part.
    pub first: u16,
    /// Observations in the whole epoch.
    pub total: u16,
    /// Observations in this part.
    pub count: u16,
    /// Observables in this part that are NaN or infinite. They are read as absent.
    pub not_finite: u32,
    observations: &'a [u8],
}

impl<'a> EpochPart<'a> {
    /// The observations of this part, in the order in which they were written.
    pub fn observations(&self) -> impl Iterator<Item = Observation> + use<'a> {
        WireObservations(self.observations).map_while(Result::ok).map(|mut observation| {
            drop_not_finite(&mut observation);
            observation
        })
    }

    /// Whether these are all observations of the epoch.
    pub fn is_whole(&self) -> bool {
        self.count == self.total
    }

    /// Whether no part of the epoch comes after this one.
    pub fn is_last(&self) -> bool {
        self.first.saturating_add(self.count) >= self.total
    }

    fn read(payload: &'a [u8]) -> Result<Self, FrameError> {
        let (head, observations): (WireEpochHead, _) =
            postcard::take_from_bytes(payload).map_err(|_| FrameError::Payload)?;
        let mut part = Self {
            station: wire::station(head.station).ok_or(FrameError::Payload)?,
            time: GpsTime::from_nanoseconds(head.time),
            first: head.first,
            total: head.total,
            count: 0,
            not_finite: 0,
            observations,
        };
        for observation in WireObservations(observations) {
            part.not_finite += drop_not_finite(&mut observation?);
            part.count = part.count.saturating_add(1);
        }
        if part.first.checked_add(part.count).is_some_and(|end| end <= part.total) {
            Ok(part)
        } else {
            Err(FrameError::Payload)
        }
    }
}

/// Observations as they were written, until the bytes end or make no sense.
struct WireObservations<'a>(&'a [u8]);

impl Iterator for WireObservations<'_> {
    type Item = Result<Observation, FrameError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let taken: Option<(WireObservation, _)> = postcard::take_from_bytes(self.0).ok();
        let (wire, rest) = taken.map_or((None, &[][..]), |(wire, rest)| (wire.observation(), rest));
        self.0 = rest;
        Some(wire.ok_or(FrameError::Payload))
    }
}

/// Makes observables that are NaN or infinite absent; how many.
fn drop_not_finite(observation: &mut Observation) -> u32 {
    let mut dropped = 0;
    for value in [&mut observation.code, &mut observation.phase, &mut observation.doppler] {
        dropped += u32::from(value.take_if(|x| !x.is_finite()).is_some());
    }
    dropped + u32::from(observation.cn0.take_if(|x| !x.is_finite()).is_some())
}

/// What a frame says.
#[derive(Clone, Copy, Debug)]
pub enum Record<'a> {
    /// Start of a log, stations.
    Header(Header),
    /// Parameters of the ionosphere.
    Ionosphere(Ionosphere),
    /// A broadcast ephemeris.
    Ephemeris(Ephemeris),
    /// Observations.
    Epoch(EpochPart<'a>),
    /// An answer of the filter.
    Solution(Solution),
    /// Something that happened.
    Event(Event),
    /// Settings of an engine.
    Config(Config<'a>),
    /// Measurements for a mixed-integer filter.
    Measurements(Measurements<'a>),
    /// An answer of a mixed-integer filter.
    Estimate(EstimateRecord<'a>),
}

impl<'a> Record<'a> {
    /// Reads the payload of a frame.
    pub(super) fn read(kind: u8, payload: &'a [u8]) -> Result<Self, FrameError> {
        match kind {
            kind::HEADER => {
                let wire: WireHeader = whole(payload)?;
                finite(wire.is_finite())?;
                Ok(Self::Header(wire.header()))
            }
            kind::IONOSPHERE => {
                let wire: WireIonosphere = whole(payload)?;
                finite(wire.is_finite())?;
                wire.ionosphere().map(Self::Ionosphere).ok_or(FrameError::Payload)
            }
            kind::KEPLER => {
                let wire: WireKepler = whole(payload)?;
                finite(wire.is_finite())?;
                wire.kepler().map(|kepler| Self::Ephemeris(Ephemeris::Kepler(kepler))).ok_or(FrameError::Payload)
            }
            kind::GLONASS => {
                let wire: WireGlonass = whole(payload)?;
                finite(wire.is_finite())?;
                wire.glonass().map(|glonass| Self::Ephemeris(Ephemeris::Glonass(glonass))).ok_or(FrameError::Payload)
            }
            kind::EPOCH => EpochPart::read(payload).map(Self::Epoch),
            kind::SOLUTION => {
                let wire: WireSolution = whole(payload)?;
                wire.solution().map(Self::Solution).ok_or(FrameError::Payload)
            }
            kind::BOUNDED_SOLUTION => {
                let (wire, bounds): (WireSolution, WireBounds) = whole(payload)?;
                wire.solution().and_then(|s| bounds.complete(s)).map(Self::Solution).ok_or(FrameError::Payload)
            }
            kind::EVENT => {
                let wire: WireEvent = whole(payload)?;
                wire.event().map(Self::Event).ok_or(FrameError::Payload)
            }
            kind::CONFIG => {
                let (schema, data) = postcard::take_from_bytes(payload).map_err(|_| FrameError::Payload)?;
                Ok(Self::Config(Config { schema, data }))
            }
            kind::MEASUREMENTS => Measurements::read(payload).map(Self::Measurements),
            kind::ESTIMATE => EstimateRecord::read(payload).map(Self::Estimate),
            unknown => Err(FrameError::Kind(unknown)),
        }
    }
}

/// A value that uses up all bytes.
fn whole<'a, T: Deserialize<'a>>(payload: &'a [u8]) -> Result<T, FrameError> {
    match postcard::take_from_bytes(payload) {
        Ok((value, [])) => Ok(value),
        _ => Err(FrameError::Payload),
    }
}

fn finite(is_finite: bool) -> Result<(), FrameError> {
    if is_finite { Ok(()) } else { Err(FrameError::NotFinite) }
}
