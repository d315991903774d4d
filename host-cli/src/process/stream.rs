//! The stream of events that an engine is fed with, the same from files and from a device log.
//!
//! [`Merge`] puts rover, base and navigation messages in the order in which a receiver in the field would have them:
//! 1. header and ionosphere;
//! 2. an ephemeris as soon as its time of ephemeris is the nearest for its satellite and message, but at most two hours
//!    before it; of those that are due before the first epoch only the last of each satellite;
//! 3. a base epoch before the rover epoch of the same time. Receivers steer their clocks to a millisecond or so of the
//!    full second, so times within [`SYNCHRONOUS`] are the same. Of the base epochs before the first rover epoch only
//!    the last is given, those after the last rover epoch are not read.
//!
//! Memory: the ephemerides and one epoch of each station.

use std::collections::{BTreeMap, VecDeque};
use std::iter::Peekable;
use surefix_core::gnss::ephemeris::{Ephemeris, NavigationMessage};
use surefix_core::gnss::epoch::{EpochView, Observation};
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::time::{Calendar, GpsTime};
use surefix_core::log::{self, Event, Header, Ionosphere, Station};

/// Epochs of rover and base that are at most this far apart are of the same time `[s]`: half the interval of 20 Hz.
pub const SYNCHRONOUS: f64 = 0.025;
/// An ephemeris is not given earlier than this before its reference time `[s]`: half the fit interval of GPS.
const EPHEMERIS_LEAD: f64 = 7_200.0;
/// An ephemeris this far from its reference time is of no use for any constellation `[s]`.
const EPHEMERIS_REACH: f64 = 14_400.0;
/// A base epoch that is older than this is no help to the rover, whatever the settings of the engine `[s]`.
const BASE_REACH: f64 = 120.0;

/// One epoch of a station.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedEpoch {
    /// Receiver time (GPST).
    pub time: GpsTime,
    /// The observations.
    pub observations: Vec<Observation>,
}

impl OwnedEpoch {
    /// The epoch as engines take it.
    pub fn view(&self) -> EpochView<'_> {
        EpochView { time: self.time, observations: &self.observations }
    }
}

impl From<EpochView<'_>> for OwnedEpoch {
    fn from(epoch: EpochView<'_>) -> Self {
        Self { time: epoch.time, observations: epoch.observations.to_vec() }
    }
}

/// What an engine is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// What is known of the stations.
    Header(Header),
    /// Settings, in a device log: the number of their schema and a postcard value.
    Config(u16, Vec<u8>),
    /// Parameters of the ionosphere.
    Ionosphere(Ionosphere),
    /// A broadcast ephemeris.
    Ephemeris(Ephemeris),
    /// Observations of the base.
    Base(OwnedEpoch),
    /// Observations of the rover: time for a solution.
    Rover(OwnedEpoch),
    /// The recording device started afresh: what came before does not continue.
    Reset,
}

impl Input {
    /// From a record of a device log; `None` for those that tell an engine nothing.
    pub fn from_log(input: log::Input<'_>) -> Option<Self> {
        match input {
            log::Input::Header(header) => Some(Self::Header(header)),
            log::Input::Config(config) => Some(Self::Config(config.schema, config.data.to_vec())),
            log::Input::Ionosphere(ionosphere) => Some(Self::Ionosphere(ionosphere)),
            log::Input::Ephemeris(ephemeris) => Some(Self::Ephemeris(ephemeris)),
            log::Input::Epoch(Station::Base, epoch) => Some(Self::Base(epoch.into())),
            log::Input::Epoch(Station::Rover, epoch) => Some(Self::Rover(epoch.into())),
            log::Input::Event(Event::Reset) => Some(Self::Reset),
            log::Input::Event(Event::End | Event::Dropped(_) | Event::Marker(_)) | log::Input::Solution(_) => None,
        }
    }
}

/// Why a stream gives no useful solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CoverageError {
    /// No rover epoch.
    #[error("the rover has no epoch with observations; is this the right file, and was it written to the end?")]
    NoRover,
    /// No base epoch.
    #[error("the base has no epoch with observations; is this the right file, and was it written to the end?")]
    NoBase,
    /// No base epoch is near a rover epoch.
    #[error("rover ({rover}) and base ({base}) do not overlap; give files of the same time")]
    NoOverlap {
        /// Epochs of the rover.
        rover: Span,
        /// Epochs of the base.
        base: Span,
    },
    /// No ephemerides at all.
    #[error("there is no broadcast ephemeris; give a navigation file of the constellations in the rover file")]
    NoEphemeris,
    /// No ephemeris is near a rover epoch.
    #[error(
        "no ephemeris is of the time of the rover ({rover}), they are of {ephemerides}; give the navigation file \
             of that day"
    )]
    NoEphemerisInTime {
        /// Epochs of the rover.
        rover: Span,
        /// Reference times of the ephemerides.
        ephemerides: Span,
    },
}

/// First and last of some times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The earliest.
    pub first: GpsTime,
    /// The latest.
    pub last: GpsTime,
}

impl Span {
    fn include(span: &mut Option<Self>, time: GpsTime) {
        let Self { first, last } = span.get_or_insert(Self { first: time, last: time });
        *first = time.min(*first);
        *last = time.max(*last);
    }
}

impl std::fmt::Display for Span {
    /// Dates and times to the second, GPST.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [first, last] = [self.first, self.last].map(GpsTime::calendar);
        for (date, after) in [(first, "–"), (last, "")] {
            let Calendar { year, month, day, hour, minute, second } = date;
            let second = second.floor();
            write!(f, "{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}{after}")?;
        }
        Ok(())
    }
}

/// Merges rover epochs `R`, base epochs `B` and navigation messages in time; both epochs in ascending order.
///
/// Iterates over the inputs of an engine up to the last rover epoch; errors of `R` and `B` are given as they come.
pub struct Merge<R: Iterator, B: Iterator> {
    rover: Peekable<R>,
    base: Peekable<B>,
    /// Ephemerides and when they are due, in that order.
    ephemerides: Peekable<std::vec::IntoIter<(GpsTime, Ephemeris)>>,
    /// What comes before anything else.
    opening: VecDeque<Input>,
    started: bool,
    rover_span: Option<Span>,
    base_span: Option<Span>,
    ephemeris_span: Option<Span>,
    latest_base: Option<GpsTime>,
    with_base: u64,
    ephemerides_in_time: u64,
}

impl<R, B, E> Merge<R, B>
where
    R: Iterator<Item = Result<OwnedEpoch, E>>,
    B: Iterator<Item = Result<OwnedEpoch, E>>,
{
    /// Merges `rover`, `base` and `ephemerides` (in any order) behind `header` and `ionospheres`.
    pub fn new(
        header: Header,
        ionospheres: impl IntoIterator<Item = Ionosphere>,
        ephemerides: impl IntoIterator<Item = Ephemeris>,
        rover: R,
        base: B,
    ) -> Self {
        let ephemerides = when_due(ephemerides);
        let mut ephemeris_span = None;
        ephemerides.iter().for_each(|(_, ephemeris)| Span::include(&mut ephemeris_span, ephemeris.toe()));
        let ionospheres = ionospheres.into_iter().map(Input::Ionosphere);
        Self {
            rover: rover.peekable(),
            base: base.peekable(),
            ephemerides: ephemerides.into_iter().peekable(),
            opening: std::iter::once(Input::Header(header)).chain(ionospheres).collect(),
            started: false,
            rover_span: None,
            base_span: None,
            ephemeris_span,
            latest_base: None,
            with_base: 0,
            ephemerides_in_time: 0,
        }
    }

    /// After the end: whether there was what a relative solution needs.
    pub fn coverage(&mut self) -> Result<(), CoverageError> {
        let rover = self.rover_span.ok_or(CoverageError::NoRover)?;
        if let Some(Ok(epoch)) = self.base.peek() {
            Span::include(&mut self.base_span, epoch.time);
        }
        let base = self.base_span.ok_or(CoverageError::NoBase)?;
        if self.with_base == 0 {
            return Err(CoverageError::NoOverlap { rover, base });
        }
        let ephemerides = self.ephemeris_span.ok_or(CoverageError::NoEphemeris)?;
        if self.ephemerides_in_time == 0 {
            return Err(CoverageError::NoEphemerisInTime { rover, ephemerides });
        }
        Ok(())
    }

    /// Puts into the opening what is due at the first rover epoch.
    fn start(&mut self, time: GpsTime) -> Result<(), E> {
        let mut latest = BTreeMap::new();
        while let Some((_, ephemeris)) = self.ephemerides.next_if(|(due, _)| *due <= time) {
            latest.insert(key(&ephemeris), ephemeris);
        }
        for ephemeris in latest.into_values() {
            let input = self.ephemeris(ephemeris, time);
            self.opening.push_back(input);
        }
        let mut latest = None;
        while let Some(epoch) = self.next_base(time)? {
            latest = Some(epoch);
        }
        self.opening.extend(latest.map(Input::Base));
        Ok(())
    }

    /// The next base epoch, if it is due at a rover epoch.
    fn next_base(&mut self, rover: GpsTime) -> Result<Option<OwnedEpoch>, E> {
        let is_due = |epoch: &Result<OwnedEpoch, E>| match epoch {
            Ok(epoch) => epoch.time.since(rover) <= SYNCHRONOUS,
            Err(_) => true,
        };
        let Some(epoch) = self.base.next_if(is_due).transpose()? else { return Ok(None) };
        Span::include(&mut self.base_span, epoch.time);
        self.latest_base = Some(epoch.time);
        Ok(Some(epoch))
    }

    /// The ephemeris as an input, counted.
    fn ephemeris(&mut self, ephemeris: Ephemeris, now: GpsTime) -> Input {
        self.ephemerides_in_time += u64::from(now.since(ephemeris.toe()).abs() <= EPHEMERIS_REACH);
        Input::Ephemeris(ephemeris)
    }

    fn try_next(&mut self) -> Result<Option<Input>, E> {
        let rover = match self.rover.peek() {
            Some(Ok(epoch)) => epoch.time,
            Some(Err(_)) => return self.rover.next().transpose().map(|_| None),
            None => return Ok(self.opening.pop_front()),
        };
        if !self.started {
            self.started = true;
            self.start(rover)?;
        }
        if let Some(input) = self.opening.pop_front() {
            return Ok(Some(input));
        }
        let now = match self.base.peek() {
            Some(Ok(base)) => base.time.min(rover),
            _ => rover,
        };
        if let Some((_, ephemeris)) = self.ephemerides.next_if(|(due, _)| *due <= now) {
            return Ok(Some(self.ephemeris(ephemeris, now)));
        }
        if let Some(base) = self.next_base(rover)? {
            return Ok(Some(Input::Base(base)));
        }
        let Some(epoch) = self.rover.next().transpose()? else { return Ok(None) };
        Span::include(&mut self.rover_span, rover);
        self.with_base += u64::from(self.latest_base.is_some_and(|base| rover.since(base) <= BASE_REACH));
        Ok(Some(Input::Rover(epoch)))
    }
}

impl<R, B, E> Iterator for Merge<R, B>
where
    R: Iterator<Item = Result<OwnedEpoch, E>>,
    B: Iterator<Item = Result<OwnedEpoch, E>>,
{
    type Item = Result<Input, E>;

    fn next(&mut self) -> Option<Self::Item> {
        self.try_next().transpose()
    }
}

/// Ephemerides of the same key replace one another.
fn key(ephemeris: &Ephemeris) -> (SatelliteId, u8) {
    let message = match ephemeris {
        Ephemeris::Kepler(kepler) => kepler.message,
        Ephemeris::Glonass(_) => NavigationMessage::Lnav,
    };
    (ephemeris.satellite(), message as u8)
}

/// Ephemerides with the time from which each is the nearest of its satellite and message, in order of that time.
fn when_due(ephemerides: impl IntoIterator<Item = Ephemeris>) -> Vec<(GpsTime, Ephemeris)> {
    let mut ephemerides: Vec<_> = ephemerides.into_iter().collect();
    ephemerides.sort_by_key(|ephemeris| (key(ephemeris), ephemeris.toe()));
    let mut due: Vec<(GpsTime, Ephemeris)> = Vec::with_capacity(ephemerides.len());
    for ephemeris in ephemerides {
        let mut time = ephemeris.toe().plus_seconds(-EPHEMERIS_LEAD);
        if let Some((_, before)) = due.last().filter(|(_, before)| key(before) == key(&ephemeris)) {
            time = time.max(before.toe().plus_seconds(0.5 * ephemeris.toe().since(before.toe())));
        }
        due.push((time, ephemeris));
    }
    due.sort_by_key(|(time, _)| *time);
    due
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::ephemeris::GlonassEphemeris;

    type Epochs = std::vec::IntoIter<Result<OwnedEpoch, &'static str>>;

    fn time(seconds: f64) -> GpsTime {
        GpsTime::from_week_tow(2200, seconds)
    }

    fn epochs(seconds: &[f64]) -> Epochs {
        let epochs: Vec<_> =
            seconds.iter().map(|&s| Ok(OwnedEpoch { time: time(s), observations: Vec::new() })).collect();
        epochs.into_iter()
    }

    fn ephemeris(satellite: &str, toe: f64) -> Ephemeris {
        Ephemeris::Glonass(GlonassEphemeris {
            satellite: satellite.parse().unwrap(),
            iode: 0,
            channel: 0,
            toe: time(toe),
            position: [0.0; 3],
            velocity: [0.0; 3],
            acceleration: [0.0; 3],
            clock_bias: 0.0,
            frequency_bias: 0.0,
            health: 0,
            age: 0.0,
        })
    }

    fn merge(ephemerides: Vec<Ephemeris>, rover: &[f64], base: &[f64]) -> Merge<Epochs, Epochs> {
        Merge::new(Header::default(), [], ephemerides, epochs(rover), epochs(base))
    }

    /// The stream in short: letter and seconds, ephemerides with their reference time.
    fn told(stream: &mut Merge<Epochs, Epochs>) -> Vec<String> {
        let short = |input: Result<Input, &str>| match input.unwrap() {
            Input::Base(epoch) => format!("b{}", epoch.time.tow()),
            Input::Rover(epoch) => format!("r{}", epoch.time.tow()),
            Input::Ephemeris(ephemeris) => format!("{}:{}", ephemeris.satellite(), ephemeris.toe().tow()),
            Input::Header(_) => "header".to_owned(),
            other => panic!("{other:?}"),
        };
        stream.map(short).collect()
    }

    #[test]
    fn the_base_comes_before_the_rover_of_the_same_time() {
        // The clocks of these receivers differ by a millisecond, as in the drive of the real-data tests.
        let mut stream = merge(vec![ephemeris("R01", 100.0)], &[99.999, 100.999, 102.0], &[100.0, 101.0, 101.5, 103.0]);
        let expected = ["header", "R01:100", "b100", "r99.999", "b101", "r100.999", "b101.5", "r102"];
        assert_eq!(told(&mut stream), expected);
        assert_eq!(stream.coverage(), Ok(()));
    }

    #[test]
    fn a_base_at_a_lower_rate_is_given_once() {
        let mut stream = merge(vec![ephemeris("R01", 100.0)], &[100.0, 101.0, 102.0, 103.0], &[98.0, 99.0, 102.0]);
        assert_eq!(told(&mut stream), ["header", "R01:100", "b99", "r100", "r101", "b102", "r102", "r103"]);
    }

    #[test]
    fn an_ephemeris_comes_when_it_is_the_nearest() {
        let ephemerides = [7_200.0, 0.0, 14_400.0, 50_000.0].map(|toe| ephemeris("R02", toe));
        let ephemerides = [&ephemerides[..], &[ephemeris("R01", 9_000.0)]].concat();
        let rover: Vec<f64> = (1..=24).map(|i| f64::from(i) * 1_800.0).collect();
        let mut stream = merge(ephemerides, &rover, &[1_800.0]);
        let told = told(&mut stream);
        let before = |input: &str| told[told.iter().position(|other| other == input).unwrap() + 1].clone();
        assert_eq!(told[..4], ["header", "R01:9000", "R02:0", "b1800"]); // R01 alone, from two hours before its toe
        assert_eq!(before("R02:7200"), "r3600"); // half way from 0 to 7200
        assert_eq!(before("R02:14400"), "r10800");
        assert_eq!(before("R02:50000"), "r43200"); // two hours before its toe
    }

    #[test]
    fn of_what_was_due_before_the_start_only_the_last_is_given() {
        let ephemerides = [0.0, 7_200.0, 14_400.0].map(|toe| ephemeris("R02", toe)).to_vec();
        let base: Vec<f64> = (0..20_000).step_by(100).map(f64::from).collect();
        let mut stream = merge(ephemerides, &[20_000.0], &base);
        assert_eq!(told(&mut stream), ["header", "R02:14400", "b19900", "r20000"]);
    }

    #[test]
    fn files_that_do_not_go_together_are_named() {
        let coverage = |toe: &[f64], rover: &[f64], base: &[f64]| {
            let mut stream = merge(toe.iter().map(|&toe| ephemeris("R01", toe)).collect(), rover, base);
            stream.by_ref().for_each(drop);
            stream.coverage()
        };
        let span = |first, last| Span { first: time(first), last: time(last) };
        assert_eq!(coverage(&[0.0], &[], &[5.0]), Err(CoverageError::NoRover));
        assert_eq!(coverage(&[0.0], &[5.0, 6.0], &[]), Err(CoverageError::NoBase));
        let none = coverage(&[0.0], &[5.0, 6.0], &[400.0, 401.0]);
        assert_eq!(none, Err(CoverageError::NoOverlap { rover: span(5.0, 6.0), base: span(400.0, 400.0) }));
        let before = coverage(&[0.0], &[405.0], &[1.0, 2.0]);
        assert_eq!(before, Err(CoverageError::NoOverlap { rover: span(405.0, 405.0), base: span(1.0, 2.0) }));
        assert_eq!(coverage(&[], &[5.0], &[5.0]), Err(CoverageError::NoEphemeris));
        let other_day = coverage(&[90_000.0], &[5.0], &[5.0]);
        let expected = CoverageError::NoEphemerisInTime { rover: span(5.0, 5.0), ephemerides: span(9e4, 9e4) };
        assert_eq!(other_day, Err(expected));
        assert_eq!(span(5.0, 86_405.5).to_string(), "2022-03-06 00:00:05–2022-03-07 00:00:05");
    }

    #[test]
    fn errors_of_readers_are_given() {
        let rover = vec![Ok(OwnedEpoch { time: time(1.0), observations: Vec::new() }), Err("rover")];
        let stream = Merge::new(Header::default(), [], [], rover.into_iter(), epochs(&[1.0]));
        let told: Vec<_> = stream.collect();
        assert_eq!((told.len(), &told[3]), (4, &Err("rover")));
        let base = vec![Err("base")];
        let mut stream = Merge::new(Header::default(), [], [], epochs(&[1.0]), base.into_iter());
        assert_eq!(stream.next(), Some(Err("base")));
    }
}
