//! Observation records of RINEX 2 and 3, epoch by epoch.
//!
//! * Phase keeps its loss-of-lock indicator: bit 0 as `loss_of_lock`, bit 1 as `half_cycle` (in RINEX 2 bit 1 means the
//!   opposite of the header's wavelength factor). After a power failure (epoch flag 1) every phase has lost lock.
//! * C/N0 comes from the S observable; where that is absent, from the signal strength digit n of the first value that
//!   has one: 6 n + 2.5 dB-Hz, the middle of its class (RINEX 3.05 table 7).
//! * Blank and zero values are `None`. Values that no receiver can have measured are dropped and counted: a code
//!   outside 10⁶…10⁸ m (satellites are 1.9·10⁷ to 4.2·10⁷ m away, the receiver clock may be off by tens of ms), a
//!   Doppler beyond 10⁶ Hz, a strength outside 0…100 dB-Hz.
//! * Values are taken as recorded: SYS / SCALE FACTOR is divided out; phase shifts (SYS / PHASE SHIFT) and receiver
//!   clock offsets (RCV CLOCK OFFS APPL) are in them or not as the writer decided.

use super::compact::ExpandedLines;
use super::header::ObservationHeader;
use super::observation_types::{Column, Quantity};
use crate::read::field::{columns, integer, real};
use crate::read::lines::Lines;
use crate::read::{ReadError, ReadReport, Reason};
use std::io::BufRead;
use std::ops::RangeInclusive;
use std::path::Path;
use surefix_core::gnss::epoch::{EpochView, Observation};
use surefix_core::gnss::satellite::{Constellation, SatelliteId, SatelliteSet};
use surefix_core::gnss::time::GpsTime;

/// Codes that a receiver can have measured `[m]`.
const CODES: RangeInclusive<f64> = 1.0e6..=1.0e8;
/// Largest Doppler that a receiver can have measured `[Hz]`.
const LARGEST_DOPPLER: f64 = 1.0e6;
/// Largest C/N0 that a receiver can have measured `[dB-Hz]`.
const LARGEST_CN0: f64 = 100.0;
/// A step in time that is longer is believed only if the epoch after it does not step back `[s]`.
const LONGEST_STEP: f64 = 300.0;
/// Columns of a value with its two flags.
const FIELD: usize = 16;
/// Columns of a value.
const VALUE: usize = 14;

/// One epoch of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationEpoch {
    /// Receiver time, GPST.
    pub time: GpsTime,
    /// The receiver lost power since the epoch before (epoch flag 1).
    pub power_failure: bool,
    /// Receiver clock offset `[s]`, where recorded.
    pub clock_offset: Option<f64>,
    /// The observations, satellites in order of the file.
    pub observations: Vec<Observation>,
}

impl ObservationEpoch {
    /// The epoch as engines take it.
    pub fn view(&self) -> EpochView<'_> {
        EpochView { time: self.time, observations: &self.observations }
    }
}

/// Reads an observation file epoch by epoch, in order of time.
///
/// ```no_run
/// # fn main() -> Result<(), surefix::read::ReadError> {
/// let mut rover = surefix::read::rinex::ObservationReader::open("rover.obs.gz".as_ref())?;
/// while let Some(epoch) = rover.next_epoch()? {
///     println!("{} {}", epoch.time, epoch.observations.len());
/// }
/// println!("{}", rover.report());
/// # Ok(())
/// # }
/// ```
pub struct ObservationReader {
    lines: ExpandedLines,
    header: ObservationHeader,
    report: ReadReport,
    /// Time of the last epoch given.
    latest: Option<GpsTime>,
    /// An epoch read ahead, and its line.
    held: Option<(u64, ObservationEpoch)>,
    /// Satellites of the current epoch (RINEX 2).
    names: Vec<[u8; 3]>,
    /// Satellite of the current record.
    name: [u8; 3],
    /// Fields of the current record, 16 columns each.
    record: Vec<u8>,
    /// Observations of the current record.
    signals: Vec<Observation>,
}

/// What an epoch line announces.
struct EpochLine {
    time: Option<GpsTime>,
    flag: u8,
    /// Satellites, or for events: lines.
    count: usize,
    clock_offset: Option<f64>,
}

impl ObservationReader {
    /// Opens a file, plain or gzipped, and reads its header.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::start(Lines::open(path)?)
    }

    /// Reads the header of `input`, called `file` in messages.
    pub fn new(file: &str, input: impl BufRead + Send + 'static) -> Result<Self, ReadError> {
        Self::start(Lines::new(file, input))
    }

    fn start(mut lines: Lines) -> Result<Self, ReadError> {
        let mut report = ReadReport::new(lines.file());
        if !lines.advance(&mut report)? {
            return Err(ReadError::Empty { file: lines.file().to_owned() });
        }
        let mut lines = ExpandedLines::new(lines, &mut report)?;
        let header = ObservationHeader::read(&mut lines, &mut report)?;
        Ok(Self {
            lines,
            header,
            report,
            latest: None,
            held: None,
            names: Vec::new(),
            name: [b' '; 3],
            record: Vec::new(),
            signals: Vec::new(),
        })
    }

    /// What the header says, with the changes that events in the file have made so far.
    pub fn header(&self) -> &ObservationHeader {
        &self.header
    }

    /// What was read and dropped so far.
    pub fn report(&self) -> &ReadReport {
        &self.report
    }

    /// The next epoch; `None` at the end of the file.
    pub fn next_epoch(&mut self) -> Result<Option<ObservationEpoch>, ReadError> {
        loop {
            let next = match self.held.take() {
                Some(held) => Some(held),
                None => self.read_epoch()?,
            };
            let Some((line, epoch)) = next else { return Ok(None) };
            if let Some(latest) = self.latest.filter(|&latest| epoch.time <= latest) {
                let same = epoch.time == latest;
                self.report.drop_one(if same { Reason::EpochDuplicate } else { Reason::EpochOutOfOrder }, line);
                continue;
            }
            if self.latest.is_none_or(|latest| epoch.time.since(latest) > LONGEST_STEP) {
                // A damaged date must not hide all that follows: it is one if the next epoch is back where time was.
                self.held = self.read_epoch()?;
                let back = |next: GpsTime| {
                    epoch.time.since(next) > LONGEST_STEP / 2.0 && self.latest.is_none_or(|latest| next > latest)
                };
                if self.held.as_ref().is_some_and(|(_, held)| back(held.time)) {
                    self.report.drop_one(Reason::EpochOutOfOrder, line);
                    continue;
                }
            }
            self.latest = Some(epoch.time);
            self.report.records += 1;
            self.report.observations += epoch.observations.len() as u64;
            return Ok(Some(epoch));
        }
    }

    /// The next epoch that can be read, whatever its time, and its line.
    fn read_epoch(&mut self) -> Result<Option<(u64, ObservationEpoch)>, ReadError> {
        while self.advance()? {
            if self.lines.line().trim_ascii().is_empty() {
                continue;
            }
            let line = self.lines.number();
            let Some(epoch) = self.epoch_line() else {
                self.report.drop_one(Reason::LineUnreadable, line);
                continue;
            };
            match (epoch.flag, epoch.time) {
                (0 | 1, Some(time)) => {
                    let Some(mut observations) = self.observations(epoch.count)? else { continue };
                    let power_failure = epoch.flag == 1;
                    if power_failure {
                        observations.iter_mut().for_each(|observation| observation.loss_of_lock = true);
                    }
                    let clock_offset = epoch.clock_offset;
                    return Ok(Some((line, ObservationEpoch { time, power_failure, clock_offset, observations })));
                }
                (6, _) => {
                    self.report.drop_one(Reason::CycleSlipRecord, line);
                    self.skip_satellites(epoch.count)?;
                }
                (2..=5, _) => {
                    self.report.drop_one(Reason::Event, line);
                    self.event(epoch.count)?;
                }
                _ => self.report.drop_one(Reason::LineUnreadable, line),
            }
        }
        Ok(None)
    }

    fn advance(&mut self) -> Result<bool, ReadError> {
        self.lines.advance(&mut self.report)
    }

    fn is_rinex_2(&self) -> bool {
        self.header.version.major == 2
    }

    /// Reads the current line as an epoch line; for RINEX 2 reads on to the end of its list of satellites.
    fn epoch_line(&mut self) -> Option<EpochLine> {
        let line = self.lines.line();
        if !self.is_epoch_line() {
            return None;
        }
        let at = |start: usize, end: usize| columns(line, start, end);
        let scale = self.header.time_scale;
        let (time, flag, count, clock) = if self.is_rinex_2() {
            (scale.time(at(1, 3), at(3, 15), at(15, 26)), at(28, 29), at(29, 32), at(68, 80))
        } else {
            (scale.time(at(2, 6), at(6, 18), at(18, 29)), at(31, 32), at(32, 35), at(41, 56))
        };
        let flag = integer(flag).map_or(0, |flag| flag as u8);
        let count = usize::try_from(integer(count)?).ok()?;
        if time.is_none() && !(2..=5).contains(&flag) {
            return None;
        }
        Some(EpochLine { time, flag, count, clock_offset: real(clock) })
    }

    /// Whether the current line has the form of an epoch line.
    fn is_epoch_line(&self) -> bool {
        let line = self.lines.line();
        if !self.is_rinex_2() {
            return line.first() == Some(&b'>');
        }
        let blank = |i: usize| line.get(i).is_none_or(|&byte| byte == b' ');
        let flag = line.get(28).copied().unwrap_or(b' ');
        let dated = line.get(18) == Some(&b'.') && matches!(flag, b'0'..=b'6' | b' ');
        let undated_event = matches!(flag, b'2'..=b'5') && columns(line, 0, 26).trim_ascii().is_empty();
        (dated || undated_event) && [0, 3, 6, 9, 12, 26, 27].into_iter().all(blank)
    }

    /// Reads the records of `count` satellites. `None` if the file ends before the first is complete.
    fn observations(&mut self, count: usize) -> Result<Option<Vec<Observation>>, ReadError> {
        let mut observations = Vec::with_capacity(4 * count.min(64));
        let mut seen = SatelliteSet::EMPTY;
        self.satellite_list(count)?;
        for read in 0..count {
            if let Err(reason) = self.satellite_record(read)? {
                self.report.drop_many(reason, (count - read) as u64, self.lines.number());
                if read == 0 && reason == Reason::Truncated {
                    return Ok(None);
                }
                break;
            }
            match self.satellite() {
                Ok(satellite) if seen.insert(satellite) => self.measure(satellite, &mut observations),
                Ok(_) => self.report.drop_one(Reason::SatelliteDuplicate, self.lines.number()),
                Err(reason) => self.report.drop_one(reason, self.lines.number()),
            }
        }
        Ok(Some(observations))
    }

    /// Reads the rest of the list of satellites of a RINEX 2 epoch line: 12 a line.
    fn satellite_list(&mut self, count: usize) -> Result<(), ReadError> {
        self.names.clear();
        while self.is_rinex_2() && self.names.len() < count {
            if !self.names.is_empty() {
                if !self.advance()? {
                    break;
                }
                if !columns(self.lines.line(), 0, 32).trim_ascii().is_empty() {
                    self.lines.unread();
                    break;
                }
            }
            let listed = columns(self.lines.line(), 32, 68).chunks_exact(3).map(|name| [name[0], name[1], name[2]]);
            let before = self.names.len();
            self.names.extend(listed.take(count - before));
            if self.names.len() == before {
                break;
            }
        }
        Ok(())
    }

    /// Reads the fields of the satellite that comes next, `number` of its epoch, or says why there is none.
    fn satellite_record(&mut self, number: usize) -> Result<Result<(), Reason>, ReadError> {
        self.record.clear();
        if !self.is_rinex_2() {
            if !self.advance()? {
                return Ok(Err(Reason::Truncated));
            }
            if self.is_epoch_line() {
                self.lines.unread();
                return Ok(Err(Reason::SatelliteMissing));
            }
            let line = self.lines.line();
            self.name = [0, 1, 2].map(|i| line.get(i).copied().unwrap_or(b' '));
            self.record.extend_from_slice(columns(line, 3, line.len()));
            return Ok(Ok(()));
        }
        let Some(&name) = self.names.get(number) else { return Ok(Err(Reason::SatelliteMissing)) };
        self.name = name;
        for start in (0..self.header.types.len()).step_by(5) {
            if !self.advance()? {
                return Ok(Err(Reason::Truncated));
            }
            if self.is_epoch_line() {
                self.lines.unread();
                return Ok(Err(Reason::SatelliteMissing));
            }
            self.record.resize(start * FIELD, b' ');
            self.record.extend_from_slice(columns(self.lines.line(), 0, 5 * FIELD));
        }
        Ok(Ok(()))
    }

    /// The satellite of the current record, or why it is not used.
    fn satellite(&self) -> Result<SatelliteId, Reason> {
        let [letter, number @ ..] = self.name;
        let letter = if letter == b' ' { self.header.default_system } else { letter };
        if matches!(letter, b'S' | b'I') {
            return Err(Reason::SatelliteUnsupported);
        }
        let constellation = Constellation::from_letter(letter as char).ok_or(Reason::SatelliteUnreadable)?;
        let number =
            integer(&number).and_then(|number| u8::try_from(number).ok()).ok_or(Reason::SatelliteUnreadable)?;
        if self.header.layouts[constellation.index()].columns.is_empty() {
            return Err(Reason::SatelliteUnreadable);
        }
        SatelliteId::new(constellation, number).ok_or(Reason::SatelliteUnreadable)
    }

    /// Adds what the current record holds of `satellite`.
    fn measure(&mut self, satellite: SatelliteId, observations: &mut Vec<Observation>) {
        let half_cycles = if self.is_rinex_2() { self.header.half_cycles(satellite) } else { [false; 2] };
        let layout = &self.header.layouts[satellite.constellation().index()];
        self.signals.clear();
        self.signals.extend(layout.signals.iter().map(|&signal| Observation::new(satellite, signal)));
        for (column, field) in layout.columns.iter().zip(self.record.chunks(FIELD)) {
            let Some(column) = column else { continue };
            let Some(observation) = self.signals.get_mut(column.signal) else { continue };
            if let Err(reason) = put(observation, column, field, half_cycles) {
                self.report.drop_one(reason, self.lines.number());
            }
        }
        observations.extend(
            self.signals
                .iter()
                .filter(|o| o.code.is_some() || o.phase.is_some() || o.doppler.is_some() || o.cn0.is_some()),
        );
    }

    /// Skips the records of `count` satellites.
    fn skip_satellites(&mut self, count: usize) -> Result<(), ReadError> {
        self.satellite_list(count)?;
        for number in 0..count {
            if self.satellite_record(number)?.is_err() {
                break;
            }
        }
        Ok(())
    }

    /// Applies the header lines of an event.
    fn event(&mut self, count: usize) -> Result<(), ReadError> {
        for _ in 0..count {
            if !self.advance()? {
                break;
            }
            if self.is_epoch_line() {
                self.lines.unread();
                break;
            }
            self.header.apply(self.lines.line());
        }
        Ok(())
    }
}

impl Iterator for ObservationReader {
    type Item = Result<ObservationEpoch, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_epoch().transpose()
    }
}

/// Puts one field, a value of 14 columns with its two flags, into the observation that it belongs to.
fn put(observation: &mut Observation, column: &Column, field: &[u8], half_cycles: [bool; 2]) -> Result<(), Reason> {
    let flag = |i: usize| field.get(i).filter(|digit| digit.is_ascii_digit()).map_or(0, |digit| digit - b'0');
    if column.quantity == Quantity::Phase {
        let by_header = match observation.signal.band() {
            b'1' => half_cycles[0],
            b'2' => half_cycles[1],
            _ => false,
        };
        let lli = flag(VALUE);
        observation.loss_of_lock |= lli & 1 != 0;
        observation.half_cycle |= (lli & 2 != 0) != by_header;
    }
    let value = columns(field, 0, VALUE);
    if value.trim_ascii().is_empty() {
        return Ok(());
    }
    // Values are right-aligned; one that does not reach the last column has been cut off.
    let whole = value.get(VALUE - 1).is_some_and(u8::is_ascii_digit);
    let value = real(value).filter(|_| whole).ok_or(Reason::ValueUnreadable)? / column.scale;
    if value == 0.0 {
        return Ok(());
    }
    let (slot, plausible) = match column.quantity {
        Quantity::Code => (&mut observation.code, CODES.contains(&value)),
        Quantity::Phase => (&mut observation.phase, true),
        Quantity::Doppler => (&mut observation.doppler, value.abs() <= LARGEST_DOPPLER),
        Quantity::Strength if (0.0..=LARGEST_CN0).contains(&value) => {
            observation.cn0 = Some(value as f32);
            return Ok(());
        }
        Quantity::Strength => return Err(Reason::ValueAbsurd),
    };
    if !plausible {
        return Err(Reason::ValueAbsurd);
    }
    if slot.is_some() {
        return Err(Reason::ValueDuplicate);
    }
    *slot = Some(value);
    if let (Quantity::Code | Quantity::Phase, strength @ 1..) = (column.quantity, flag(VALUE + 1)) {
        observation.cn0.get_or_insert(6.0 * f32::from(strength) + 2.5);
    }
    Ok(())
}

#[cfg(test)]
#[path = "observation_tests.rs"]
mod tests;
