//! What each column of an observation record holds, per constellation: RINEX 3 codes as they are, RINEX 2 types by the
//! table below.
//!
//! | RINEX 2 | GPS | GLONASS | Galileo | BeiDou | QZSS |
//! |---|---|---|---|---|---|
//! | C1 | 1C | 1C | 1X | 2I | 1C |
//! | P1 | 1W | 1P | | | |
//! | L1 D1 S1 | 1C, or 1W where only P1 is recorded | 1C, or 1P | 1X | 2I | 1C |
//! | C2 | 2X | 2C | | 2I | 2X |
//! | P2 | 2W | 2P | | | |
//! | L2 D2 S2 | 2W, or 2X where only C2 is recorded | 2P, or 2C | | 2I | 2X |
//! | C5 L5 D5 S5 | 5X | | 5X | | 5X |
//! | C6 … S6 | | | 6X | 6I | 6X |
//! | C7 … S7, C8 … S8 | | | 7X, 8X | 7I, | |
//!
//! RINEX 2.11 does not say which tracking mode a type is; the table follows RTKLIB. BeiDou in RINEX 2 is unofficial.
//!
//! RINEX 3.02 calls BeiDou B1 "1"; all other versions call it "2", and so do we: 3.02's `1X` is `2X`, and `1I` and
//! `1Q`, which are nothing else, are `2I` and `2Q` whatever the version.

use super::header::Version;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::signal::Signal;

/// The quantity in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    Code,
    Phase,
    Doppler,
    Strength,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    pub quantity: Quantity,
    /// Index into [`Layout::signals`].
    pub signal: usize,
    /// Recorded value = true value · `scale` (SYS / SCALE FACTOR).
    pub scale: f64,
}

/// The columns of the records of one constellation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// `None` for what is no measurement of a signal (receiver channels `X`, ionosphere `I`, unknown types).
    pub columns: Vec<Option<Column>>,
    /// The code of each column as the header has it.
    pub codes: Vec<Vec<u8>>,
    /// The signals, in order of their first appearance.
    pub signals: Vec<Signal>,
}

impl Layout {
    /// Adds the column of a RINEX 3 observation code such as `L1C`.
    pub fn push_code(&mut self, code: &[u8], constellation: Constellation, version: Version) {
        let signal = match *code {
            [_, b'1', attribute @ (b'I' | b'Q')] if constellation == Constellation::BeiDou => {
                Signal::new(b'2', attribute)
            }
            [_, b'1', b'X'] if constellation == Constellation::BeiDou && version == Version::V3_02 => {
                Signal::new(b'2', b'X')
            }
            [_, band, attribute] => Signal::new(band, attribute),
            [_, band] => Signal::new(band, b' '),
            _ => None,
        };
        self.push(code, signal);
    }

    /// Adds the column of a RINEX 2 observation type such as `L1`; `all` are the types of the file.
    pub fn push_type(&mut self, observation_type: &[u8], constellation: Constellation, all: &[[u8; 2]]) {
        let signal = match *observation_type {
            [letter, band] => rinex2_signal(letter, band, constellation, all),
            _ => None,
        };
        self.push(observation_type, signal);
    }

    /// Sets the scale factor of a column by its code, or of all columns.
    pub fn set_scale(&mut self, code: Option<&[u8]>, scale: f64) {
        for (column, its_code) in self.columns.iter_mut().zip(&self.codes) {
            if let Some(column) = column.as_mut().filter(|_| code.is_none_or(|code| code == its_code)) {
                column.scale = scale;
            }
        }
    }

    fn push(&mut self, code: &[u8], signal: Option<Signal>) {
        let quantity = match code {
            [b'C' | b'P', ..] => Some(Quantity::Code),
            [b'L', ..] => Some(Quantity::Phase),
            [b'D', ..] => Some(Quantity::Doppler),
            [b'S', ..] => Some(Quantity::Strength),
            _ => None,
        };
        let column = quantity.zip(signal).map(|(quantity, signal)| {
            let index = self.signals.iter().position(|&known| known == signal).unwrap_or_else(|| {
                self.signals.push(signal);
                self.signals.len() - 1
            });
            Column { quantity, signal: index, scale: 1.0 }
        });
        self.columns.push(column);
        self.codes.push(code.to_vec());
    }
}

/// The signal of a RINEX 2 observation type, by the table in the module's head.
fn rinex2_signal(letter: u8, band: u8, constellation: Constellation, all: &[[u8; 2]]) -> Option<Signal> {
    use Constellation::{BeiDou, Galileo, Glonass, Gps, Qzss};
    let only = |this: &[u8; 2], other: &[u8; 2]| all.contains(this) && !all.contains(other);
    let (band, attribute) = match (constellation, letter, band) {
        (Gps, b'P', b'1') => (b'1', b'W'),
        (Gps, b'C', b'1') => (b'1', b'C'),
        (Gps, b'L' | b'D' | b'S', b'1') => (b'1', if only(b"P1", b"C1") { b'W' } else { b'C' }),
        (Gps, b'P', b'2') => (b'2', b'W'),
        (Gps, b'C', b'2') => (b'2', b'X'),
        (Gps, b'L' | b'D' | b'S', b'2') => (b'2', if only(b"C2", b"P2") { b'X' } else { b'W' }),
        (Glonass, b'P', band @ (b'1' | b'2')) => (band, b'P'),
        (Glonass, b'C', band @ (b'1' | b'2')) => (band, b'C'),
        (Glonass, b'L' | b'D' | b'S', b'1') => (b'1', if only(b"P1", b"C1") { b'P' } else { b'C' }),
        (Glonass, b'L' | b'D' | b'S', b'2') => (b'2', if only(b"C2", b"P2") { b'C' } else { b'P' }),
        (_, b'P', _) => return None,
        (Qzss, _, b'1') => (b'1', b'C'),
        (Galileo, _, b'1') => (b'1', b'X'),
        (Qzss, _, b'2') => (b'2', b'X'),
        (Gps | Galileo | Qzss, _, b'5') => (b'5', b'X'),
        (Galileo | Qzss, _, b'6') => (b'6', b'X'),
        (Galileo, _, band @ (b'7' | b'8')) => (band, b'X'),
        (BeiDou, _, b'1' | b'2') => (b'2', b'I'),
        (BeiDou, _, band @ (b'6' | b'7')) => (band, b'I'),
        _ => return None,
    };
    Signal::new(band, attribute)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rinex2(types: &[&[u8; 2]], constellation: Constellation) -> Vec<String> {
        let all: Vec<[u8; 2]> = types.iter().map(|&&t| t).collect();
        let mut layout = Layout::default();
        all.iter().for_each(|t| layout.push_type(t, constellation, &all));
        let name = |column: &Option<Column>| column.map_or("-".into(), |c| layout.signals[c.signal].to_string());
        layout.columns.iter().map(name).collect()
    }

    #[test]
    fn rinex_2_types_are_mapped_by_what_else_the_file_records() {
        assert_eq!(rinex2(&[b"L1", b"C1", b"L2", b"P2"], Constellation::Gps), ["1C", "1C", "2W", "2W"]);
        assert_eq!(rinex2(&[b"P1", b"L1", b"C2", b"L2"], Constellation::Gps), ["1W", "1W", "2X", "2X"]);
        assert_eq!(
            rinex2(&[b"C1", b"P1", b"L1", b"C2", b"P2", b"S2"], Constellation::Gps),
            ["1C", "1W", "1C", "2X", "2W", "2W"]
        );
        assert_eq!(rinex2(&[b"C1", b"P2", b"L2", b"T1"], Constellation::Glonass), ["1C", "2P", "2P", "-"]);
        assert_eq!(rinex2(&[b"C1", b"C5", b"C7", b"P1"], Constellation::Galileo), ["1X", "5X", "7X", "-"]);
    }

    #[test]
    fn beidou_b1_is_2_in_every_version() {
        for (code, version, expected) in [
            (b"L1I", Version::V3_02, "2I"),
            (b"L1X", Version::V3_02, "2X"),
            (b"L1X", Version { major: 3, minor: 5 }, "1X"),
            (b"L1P", Version { major: 3, minor: 4 }, "1P"),
            (b"C2I", Version { major: 3, minor: 3 }, "2I"),
        ] {
            let mut layout = Layout::default();
            layout.push_code(code, Constellation::BeiDou, version);
            assert_eq!(layout.signals[0].to_string(), expected);
        }
    }

    #[test]
    fn what_is_no_measurement_keeps_its_column() {
        let mut layout = Layout::default();
        for code in [&b"X1"[..], b"C1C", b"???", b"S1C"] {
            layout.push_code(code, Constellation::Gps, Version { major: 3, minor: 4 });
        }
        assert_eq!(
            layout.columns.iter().map(|c| c.map(|c| c.quantity)).collect::<Vec<_>>(),
            [None, Some(Quantity::Code), None, Some(Quantity::Strength)]
        );
    }
}
