//! What a reader kept and what it dropped, and why.

use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// Why something was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Epoch earlier than the one before it.
    EpochOutOfOrder,
    /// Epoch at the same time as the one before it.
    EpochDuplicate,
    /// Lines that belong to no epoch: the epoch line before them is damaged, or there are more than it announces.
    LineUnreadable,
    /// Satellites that an epoch line announces and that do not follow.
    SatelliteMissing,
    /// Second record of a satellite within an epoch.
    SatelliteDuplicate,
    /// Satellite of a constellation that is not supported (SBAS, NavIC).
    SatelliteUnsupported,
    /// Satellite whose name cannot be read, or whose constellation has no observation types in the header.
    SatelliteUnreadable,
    /// Value that is no number, or whose columns are cut off.
    ValueUnreadable,
    /// Value that no receiver can have measured.
    ValueAbsurd,
    /// Second value of the same kind for a signal of a satellite.
    ValueDuplicate,
    /// Records of events between epochs (flags 2–5), whose header lines are applied.
    Event,
    /// Records of cycle slips that the receiver has already repaired (flag 6).
    CycleSlipRecord,
    /// Satellites, values or records missing because the file ends in the middle of an epoch or message.
    Truncated,
    /// The compressed stream ends early or is damaged; what came before is kept.
    CompressionDamaged,
    /// Line of compact RINEX that cannot be expanded, or that builds on such a line.
    CompactUnreadable,
    /// Line longer than any RINEX line; its end was ignored.
    LineTooLong,
    /// Record of a product that cannot be read.
    RecordUnreadable,
    /// Record of a product of a kind that is not used.
    RecordUnsupported,
    /// Navigation message of a constellation that is not supported (SBAS, NavIC).
    MessageUnsupported,
    /// Navigation message with a field that is no number, or a damaged first line.
    MessageUnreadable,
    /// Navigation message whose orbit is impossible.
    MessageAbsurd,
    /// Navigation message that is there already.
    MessageDuplicate,
    /// Position of a satellite that a precise product gives as absent.
    PositionAbsent,
    /// Clock of a satellite that a precise product gives as absent.
    ClockAbsent,
    /// Position of a satellite that was manoeuvred since the one before it.
    Manoeuvre,
    /// Clock of a satellite that jumped since the one before it.
    ClockEvent,
    /// Record of a satellite at a time at which it has one already.
    NodeDuplicate,
    /// The file does not say where it ends, as its format demands: its end may be missing.
    EndMissing,
    /// Antenna whose record cannot be read or is not ended.
    AntennaUnreadable,
}

impl Reason {
    /// In words, for a count of them.
    const fn words(self) -> &'static str {
        match self {
            Self::EpochOutOfOrder => "epochs out of order",
            Self::EpochDuplicate => "duplicated epochs",
            Self::LineUnreadable => "lines that belong to no epoch",
            Self::SatelliteMissing => "satellites announced but missing",
            Self::SatelliteDuplicate => "satellites twice in an epoch",
            Self::SatelliteUnsupported => "records of SBAS or NavIC satellites",
            Self::SatelliteUnreadable => "unreadable or undeclared satellites",
            Self::ValueUnreadable => "unreadable values",
            Self::ValueAbsurd => "absurd values",
            Self::ValueDuplicate => "values twice for a signal",
            Self::Event => "event records",
            Self::CycleSlipRecord => "cycle slip records",
            Self::Truncated => "records cut off by the end of the file",
            Self::CompressionDamaged => "damaged compressed stream",
            Self::CompactUnreadable => "lines of compact RINEX that cannot be expanded",
            Self::LineTooLong => "overlong lines",
            Self::RecordUnreadable => "unreadable records",
            Self::RecordUnsupported => "records of a kind that is not used",
            Self::MessageUnsupported => "messages of SBAS or NavIC satellites",
            Self::MessageUnreadable => "unreadable messages",
            Self::MessageAbsurd => "absurd messages",
            Self::MessageDuplicate => "duplicated messages",
            Self::PositionAbsent => "positions given as absent",
            Self::ClockAbsent => "clocks given as absent",
            Self::Manoeuvre => "positions after a manoeuvre",
            Self::ClockEvent => "clocks after a clock event",
            Self::NodeDuplicate => "records of a satellite at a time that has one",
            Self::EndMissing => "end-of-file line (missing: the file may be cut off)",
            Self::AntennaUnreadable => "unreadable antennas",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.words())
    }
}

/// How many, and where first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// How many were dropped.
    pub count: u64,
    /// Line of the first.
    pub first_line: u64,
}

/// What was read of one file, what was dropped and why.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReadReport {
    /// The file.
    pub file: String,
    /// Epochs or navigation messages kept.
    pub records: u64,
    /// Observations (signals of satellites) kept.
    pub observations: u64,
    /// What was dropped, by reason.
    pub dropped: BTreeMap<Reason, Tally>,
}

impl ReadReport {
    pub(super) fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    pub(super) fn drop_one(&mut self, reason: Reason, line: u64) {
        self.drop_many(reason, 1, line);
    }

    pub(super) fn drop_many(&mut self, reason: Reason, count: u64, line: u64) {
        if count > 0 {
            self.dropped.entry(reason).or_insert(Tally { count: 0, first_line: line }).count += count;
        }
    }

    /// How many were dropped for `reason`.
    pub fn count(&self, reason: Reason) -> u64 {
        self.dropped.get(&reason).map_or(0, |tally| tally.count)
    }
}

impl fmt::Display for ReadReport {
    /// One line for what was kept, one for each reason to drop something.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} records", self.file, self.records)?;
        if self.observations > 0 {
            write!(f, ", {} observations", self.observations)?;
        }
        for (reason, tally) in &self.dropped {
            write!(f, "\n  dropped {} {reason} (first at line {})", tally.count, tally.first_line)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_first_lines_are_printed_and_serialised() {
        let mut report = ReadReport::new("a.obs");
        report.drop_one(Reason::ValueAbsurd, 7);
        report.drop_many(Reason::ValueAbsurd, 2, 9);
        report.drop_many(Reason::Truncated, 0, 9);
        assert_eq!(report.to_string(), "a.obs: 0 records\n  dropped 3 absurd values (first at line 7)");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["dropped"]["value_absurd"]["count"], 3);
    }
}
