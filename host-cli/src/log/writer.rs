//! Writes device logs.

use crate::process::stream::Input;
use nalgebra::Vector3;
use std::io::{self, Write};
use surefix_core::gnss::epoch::EpochView;
use surefix_core::gnss::solution::Solution;
use surefix_core::gnss::time::GpsTime;
use surefix_core::log::{
    AmbiguityEstimate, Estimate, Event, MAX_FRAME, Station, WriteError, epoch_parts, write_config, write_ephemeris,
    write_epoch_part, write_estimate, write_event, write_header, write_ionosphere, write_measurements, write_solution,
};

/// Writes records to `W`, which should be buffered. Ends with [`LogWriter::finish`].
#[derive(Debug)]
pub struct LogWriter<W> {
    output: W,
    frame: Box<[u8; MAX_FRAME]>,
}

impl<W: Write> LogWriter<W> {
    /// Starts a log.
    pub fn new(output: W) -> Self {
        Self { output, frame: Box::new([0; MAX_FRAME]) }
    }

    /// Writes what an engine is told.
    pub fn input(&mut self, input: &Input) -> io::Result<()> {
        match input {
            Input::Header(header) => self.frame(|frame| write_header(header, frame)),
            Input::Config(schema, data) => self.frame(|frame| write_config(*schema, &Raw(data), frame)),
            Input::Ionosphere(ionosphere) => self.frame(|frame| write_ionosphere(ionosphere, frame)),
            Input::Ephemeris(ephemeris) => self.frame(|frame| write_ephemeris(ephemeris, frame)),
            Input::Base(epoch) => self.epoch(Station::Base, epoch.view()),
            Input::Rover(epoch) => self.epoch(Station::Rover, epoch.view()),
            Input::Reset => self.event(Event::Reset),
        }
    }

    /// Writes an epoch, in as many frames as it takes.
    pub fn epoch(&mut self, station: Station, epoch: EpochView<'_>) -> io::Result<()> {
        (0..epoch_parts(epoch)).try_for_each(|part| self.frame(|frame| write_epoch_part(station, epoch, part, frame)))
    }

    /// Writes settings of an engine.
    pub fn config<T: serde::Serialize>(&mut self, schema: u16, settings: &T) -> io::Result<()> {
        self.frame(|frame| write_config(schema, settings, frame))
    }

    /// Writes an answer of the filter.
    pub fn solution(&mut self, solution: &Solution) -> io::Result<()> {
        self.frame(|frame| write_solution(solution, frame))
    }

    /// Writes measurements for a mixed-integer filter: satellites relative to the base `[m]`, and y.
    pub fn measurements(&mut self, time: GpsTime, satellites: &[Vector3<f64>], values: &[f64]) -> io::Result<()> {
        self.frame(|frame| write_measurements(time, satellites, values, frame))
    }

    /// Writes an answer of a mixed-integer filter.
    pub fn estimate(
        &mut self,
        estimate: &Estimate,
        ambiguities: impl Iterator<Item = AmbiguityEstimate> + Clone,
    ) -> io::Result<()> {
        self.frame(|frame| write_estimate(estimate, ambiguities, frame))
    }

    /// Writes an event.
    pub fn event(&mut self, event: Event) -> io::Result<()> {
        self.frame(|frame| write_event(&event, frame))
    }

    /// Ends the log on purpose ([`Event::End`]) and gives back the output, flushed.
    pub fn finish(mut self) -> io::Result<W> {
        self.event(Event::End)?;
        self.output.flush()?;
        Ok(self.output)
    }

    fn frame(&mut self, write: impl FnOnce(&mut [u8]) -> Result<usize, WriteError>) -> io::Result<()> {
        let length = write(&mut self.frame[..]).map_err(io::Error::other)?;
        self.output.write_all(&self.frame[..length])
    }
}

/// Bytes that are a postcard value already.
struct Raw<'a>(&'a [u8]);

impl serde::Serialize for Raw<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeTuple;
        let mut bytes = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| bytes.serialize_element(byte))?;
        bytes.end()
    }
}
