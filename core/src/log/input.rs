//! A log as an engine sees it: whole epochs, and everything else in the order in which it was written.
//!
//! Firmware and host read logs through this one door, so that an engine sees the same events in the same order on both.
//! Panic contract: none.

use super::collect::EpochCollector;
use super::frame::FrameError;
use super::reader::{Counts, RecordReader};
use super::record::{Config, Event, Header, Ionosphere, Record, Station};
use crate::gnss::ephemeris::Ephemeris;
use crate::gnss::epoch::EpochView;
use crate::gnss::solution::Solution;

/// What an engine is told.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // there is no heap to put the larger ones on
pub enum Input<'a> {
    /// Start of a log, stations.
    Header(Header),
    /// Parameters of the ionosphere.
    Ionosphere(Ionosphere),
    /// A broadcast ephemeris.
    Ephemeris(Ephemeris),
    /// The observations of an epoch, all that there are.
    Epoch(Station, EpochView<'a>),
    /// An answer, in a log of answers.
    Solution(Solution),
    /// Something that happened.
    Event(Event),
    /// Settings of an engine.
    Config(Config<'a>),
}

/// Reads a log byte by byte, with room for frames of any record and one epoch of up to `N` observations.
///
/// ```
/// use surefix_core::log::{write_event, Event, Input, InputReader, MAX_FRAME};
///
/// static LOG: &[u8] = &[]; // bytes from a file or a serial line
/// let mut inputs = InputReader::<192>::new();
/// let mut epochs = 0;
/// for &byte in LOG {
///     let damage = inputs.push(byte, |input| match input {
///         Input::Epoch(station, epoch) => epochs += 1,
///         _ => (),
///     });
///     assert!(damage.is_none());
/// }
/// inputs.finish(|_| ());
/// ```
#[derive(Clone, Debug, Default)]
pub struct InputReader<const N: usize> {
    reader: RecordReader,
    collector: EpochCollector<N>,
}

impl<const N: usize> InputReader<N> {
    /// A reader at the start of a log, or anywhere in one.
    pub const fn new() -> Self {
        Self { reader: RecordReader::new(), collector: EpochCollector::new() }
    }

    /// Takes the next byte and tells `sink` what became complete with it. A frame that is not good ends with the byte
    /// that gives its error; it is counted.
    pub fn push(&mut self, byte: u8, sink: impl FnMut(Input<'_>)) -> Option<FrameError> {
        Self::tell(self.reader.push(byte), &mut self.collector, sink)
    }

    /// Ends the log: the rest of a frame that was cut off is an error, the rest of an epoch is told.
    pub fn finish(&mut self, mut sink: impl FnMut(Input<'_>)) -> Option<FrameError> {
        let error = Self::tell(self.reader.finish(), &mut self.collector, &mut sink);
        self.collector.finish(|station, epoch| sink(Input::Epoch(station, epoch)));
        error
    }

    /// What was read so far.
    pub const fn counts(&self) -> &Counts {
        self.reader.counts()
    }

    /// Epochs so far of which a part was missing.
    pub const fn incomplete(&self) -> u32 {
        self.collector.incomplete()
    }

    /// Observations so far that an epoch had no room for.
    pub const fn excess(&self) -> u32 {
        self.collector.excess()
    }

    fn tell(
        record: Option<Result<Record<'_>, FrameError>>,
        collector: &mut EpochCollector<N>,
        mut sink: impl FnMut(Input<'_>),
    ) -> Option<FrameError> {
        let record = match record? {
            Ok(Record::Epoch(part)) => {
                collector.push(&part, |station, epoch| sink(Input::Epoch(station, epoch)));
                return None;
            }
            Ok(record) => record,
            Err(error) => return Some(error),
        };
        // An epoch whose last part was lost comes before what was written after it.
        collector.finish(|station, epoch| sink(Input::Epoch(station, epoch)));
        match record {
            Record::Header(header) => sink(Input::Header(header)),
            Record::Ionosphere(ionosphere) => sink(Input::Ionosphere(ionosphere)),
            Record::Ephemeris(ephemeris) => sink(Input::Ephemeris(ephemeris)),
            Record::Solution(solution) => sink(Input::Solution(solution)),
            Record::Event(event) => sink(Input::Event(event)),
            Record::Config(config) => sink(Input::Config(config)),
            // The records of a mixed-integer filter are for its own engine, which reads records.
            Record::Epoch(_) | Record::Measurements(_) | Record::Estimate(_) => (),
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::epoch::{Epoch, Observation};
    use crate::gnss::time::GpsTime;
    use crate::log::{MAX_FRAME, epoch_parts, write_epoch_part, write_event};

    #[test]
    fn order_is_kept_even_if_the_end_of_an_epoch_is_lost() {
        let mut epoch = Epoch::<100>::new(GpsTime::from_nanoseconds(5));
        let observation = Observation::new("G01".parse().unwrap(), "1C".parse().unwrap());
        epoch.observations.extend(std::iter::repeat_n(observation, 90));
        let mut bytes = Vec::new();
        let mut frame = [0; MAX_FRAME];
        for lost in [None, Some(2)] {
            for part in (0..epoch_parts(epoch.view())).filter(|&part| Some(part) != lost) {
                let length = write_epoch_part(Station::Base, epoch.view(), part, &mut frame).unwrap();
                bytes.extend_from_slice(&frame[..length]);
            }
            let length = write_event(&Event::Reset, &mut frame).unwrap();
            bytes.extend_from_slice(&frame[..length]);
        }
        bytes.extend([1, 2]);

        let mut reader = InputReader::<100>::new();
        let mut told = Vec::new();
        let mut sink = |input: Input<'_>| match input {
            Input::Epoch(station, epoch) => told.push(format!("{station:?} {}", epoch.observations.len())),
            other => told.push(format!("{other:?}")),
        };
        assert!(bytes.iter().all(|&byte| reader.push(byte, &mut sink).is_none()));
        assert_eq!(reader.finish(&mut sink), Some(FrameError::Malformed));
        assert_eq!(told, ["Base 90", "Event(Reset)", "Base 80", "Event(Reset)"]);
        assert_eq!(
            (reader.counts().good, reader.counts().malformed, reader.incomplete(), reader.excess()),
            (7, 1, 1, 0)
        );
    }
}
