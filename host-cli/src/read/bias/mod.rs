//! Biases of signals: Bias-SINEX (`.BIA`, `.BSX`) and CODE's monthly tables (`P1C1`, `P1P2`, `P2C2`), told by content.
//!
//! Whatever the files have, absolute biases or differences, comes out as absolute biases to be subtracted from
//! observations ([`surefix_core::gnss::bias`] has the signs and the datum). Differences are turned into absolute ones for
//! satellites as [`absolute`] says, against the pair of signals that the file names for its clocks, or else the usual one.
//! An absolute bias of a file wins over one made of differences; of two with overlapping validity the later read.

mod sinex;
mod table;

use super::lines::Lines;
use super::report::{ReadReport, Reason};
use super::{ReadError, field};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::bias::{
    AbsoluteBias, BiasDifference, BiasKey, Observable, absolute, clock_references, stand_in,
};
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;

/// A nanosecond of light `[m]`.
const METRES_PER_NS: f64 = SPEED_OF_LIGHT * 1e-9;

/// From when (inclusive) until when (exclusive) something holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Validity {
    /// The start.
    pub from: GpsTime,
    /// The end.
    pub until: GpsTime,
}

impl Validity {
    /// For ever.
    pub const ALWAYS: Self =
        Self { from: GpsTime::from_nanoseconds(i64::MIN), until: GpsTime::from_nanoseconds(i64::MAX) };

    /// Whether it holds at a time. At the very end it does too, for the last epoch of a day.
    pub fn holds(&self, time: GpsTime) -> bool {
        self.from <= time && time <= self.until
    }
}

/// The bias of a receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceiverBias {
    /// The station's name as in the file.
    pub station: String,
    /// The constellation.
    pub constellation: Constellation,
    /// The satellite, where each has its own (GLONASS).
    pub satellite: Option<SatelliteId>,
    /// Code or phase.
    pub observable: Observable,
    /// The signal, or the first one of a difference.
    pub signal: Signal,
    /// The second signal of a difference.
    pub second: Option<Signal>,
    /// When it holds.
    pub validity: Validity,
    /// Observed minus true, or first minus second `[m]`.
    pub value: f64,
}

/// What a record says of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SatelliteBias {
    Absolute(AbsoluteBias),
    Difference(SatelliteId, BiasDifference),
}

/// Values that hold at times.
type OverTime = Vec<(Validity, f64)>;

/// Biases of one or several files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BiasData {
    absolute: BTreeMap<BiasKey, OverTime>,
    differences: BTreeMap<SatelliteId, Vec<(Validity, BiasDifference)>>,
    /// Made of `differences`.
    derived: BTreeMap<BiasKey, OverTime>,
    /// Pairs of signals that clocks refer to, as the files say.
    references: BTreeMap<Constellation, [Signal; 2]>,
    receivers: Vec<ReceiverBias>,
}

impl BiasData {
    /// Reads a file, plain or gzipped.
    pub fn open(path: &Path) -> Result<(Self, ReadReport), ReadError> {
        let mut data = Self::default();
        let report = data.add(path)?;
        Ok((data, report))
    }

    /// Takes in a further file, plain or gzipped.
    pub fn add(&mut self, path: &Path) -> Result<ReadReport, ReadError> {
        self.add_lines(Lines::open(path)?)
    }

    /// Takes in the lines of a file.
    fn add_lines(&mut self, mut lines: Lines) -> Result<ReadReport, ReadError> {
        let mut report = ReadReport::new(lines.file());
        if !lines.advance(&mut report)? {
            return Err(ReadError::Empty { file: lines.file().to_owned() });
        }
        if is_bias_sinex(lines.line()) {
            sinex::read(&mut lines, self, &mut report)?;
        } else {
            lines.unread();
            table::read(&mut lines, self, &mut report)?;
        }
        self.derive();
        Ok(report)
    }

    /// Bias of a code `[m]` at a time, to be subtracted from it. `None` where nothing is known.
    pub fn code_bias(&self, satellite: SatelliteId, signal: Signal, time: GpsTime) -> Option<f64> {
        self.bias(BiasKey { satellite, observable: Observable::Code, signal }, time)
    }

    /// Bias of a carrier phase `[m]` at a time, to be subtracted from it. `None` where nothing is known.
    pub fn phase_bias(&self, satellite: SatelliteId, signal: Signal, time: GpsTime) -> Option<f64> {
        self.bias(BiasKey { satellite, observable: Observable::Phase, signal }, time)
    }

    fn bias(&self, key: BiasKey, time: GpsTime) -> Option<f64> {
        let exactly = |key: BiasKey| at(&self.absolute, key, time).or_else(|| at(&self.derived, key, time));
        let other = || stand_in(key.satellite.constellation(), key.signal).map(|signal| BiasKey { signal, ..key });
        exactly(key).or_else(|| exactly(other()?))
    }

    /// Those of the satellites and signals that no code bias is known of at a time.
    pub fn missing(
        &self,
        wanted: impl IntoIterator<Item = (SatelliteId, Signal)>,
        time: GpsTime,
    ) -> Vec<(SatelliteId, Signal)> {
        wanted.into_iter().filter(|&(satellite, signal)| self.code_bias(satellite, signal, time).is_none()).collect()
    }

    /// All biases that hold at a time, sorted as [`surefix_core::gnss::bias::find`] needs them.
    pub fn at(&self, time: GpsTime) -> Vec<AbsoluteBias> {
        let keys: BTreeSet<BiasKey> = self.absolute.keys().chain(self.derived.keys()).copied().collect();
        let holds = |key| at(&self.absolute, key, time).or_else(|| at(&self.derived, key, time));
        keys.into_iter().filter_map(|key| holds(key).map(|value| AbsoluteBias { key, value })).collect()
    }

    /// When the first of the biases begins to hold, and when the last ends; `None` if there are none.
    pub fn span(&self) -> Option<Validity> {
        let validities = || self.absolute.values().chain(self.derived.values()).flatten().map(|(validity, _)| validity);
        let from = validities().map(|validity| validity.from).min()?;
        Some(Validity { from, until: validities().map(|validity| validity.until).max()? })
    }

    /// The pairs of signals that the clocks of a constellation refer to: the file's, then the usual ones.
    pub fn clock_references(&self, constellation: Constellation) -> Vec<[Signal; 2]> {
        let mut pairs: Vec<[Signal; 2]> = self.references.get(&constellation).copied().into_iter().collect();
        pairs.extend(clock_references(constellation));
        pairs
    }

    /// Biases of receivers, in the order of the file.
    pub fn receivers(&self) -> &[ReceiverBias] {
        &self.receivers
    }

    /// Takes a satellite's bias in.
    fn push(&mut self, bias: SatelliteBias, validity: Validity) {
        match bias {
            SatelliteBias::Absolute(AbsoluteBias { key, value }) => {
                self.absolute.entry(key).or_default().push((validity, value));
            }
            SatelliteBias::Difference(satellite, difference) => {
                self.differences.entry(satellite).or_default().push((validity, difference));
            }
        }
    }

    /// Makes absolute biases of differences, for each span of time in which the same ones hold.
    fn derive(&mut self) {
        self.derived.clear();
        for (&satellite, differences) in &self.differences {
            let constellation = satellite.constellation();
            let references = self.clock_references(constellation);
            let bounds: BTreeSet<GpsTime> =
                differences.iter().flat_map(|(validity, _)| [validity.from, validity.until]).collect();
            let bounds: Vec<GpsTime> = bounds.into_iter().collect();
            for (&from, &until) in bounds.iter().zip(bounds.iter().skip(1)) {
                // The later read comes first, and wins.
                let hold =
                    differences.iter().rev().filter(|(validity, _)| validity.from <= from && until <= validity.until);
                let hold: Vec<BiasDifference> = hold.map(|&(_, difference)| difference).collect();
                for (signal, value) in absolute(constellation, &references, &hold) {
                    let key = BiasKey { satellite, observable: Observable::Code, signal };
                    self.derived.entry(key).or_default().push((Validity { from, until }, value));
                }
            }
        }
    }
}

/// The value that was read last of those that hold at a time.
fn at(biases: &BTreeMap<BiasKey, OverTime>, key: BiasKey, time: GpsTime) -> Option<f64> {
    biases.get(&key)?.iter().rev().find(|(validity, _)| validity.holds(time)).map(|&(_, value)| value)
}

/// Whether a file with this first line is Bias-SINEX.
pub fn is_bias_sinex(first_line: &[u8]) -> bool {
    first_line.starts_with(b"%=BIA")
}

/// A satellite or, for records of receivers, a constellation: `G05`, `G`.
enum Who {
    Satellite(SatelliteId),
    Constellation(Constellation),
}

impl Who {
    fn read(name: &[u8]) -> Result<Self, Reason> {
        let name = field::text(name, 0, name.len());
        let letter = name.chars().next().ok_or(Reason::SatelliteUnreadable)?;
        match Constellation::from_letter(letter) {
            None if letter.is_ascii_uppercase() => Err(Reason::SatelliteUnsupported),
            None => Err(Reason::SatelliteUnreadable),
            Some(constellation) if name.len() == 1 => Ok(Self::Constellation(constellation)),
            Some(_) => name.parse().map(Self::Satellite).map_err(|_| Reason::SatelliteUnreadable),
        }
    }

    fn constellation(&self) -> Constellation {
        match self {
            Self::Satellite(satellite) => satellite.constellation(),
            Self::Constellation(constellation) => *constellation,
        }
    }
}

#[cfg(test)]
mod tests;
