//! Satellites: constellation and number, as RINEX names them (`G05`, `E11`, `C19`, `J02`, `R24`), and sets of them.
//!
//! GLONASS is supported for code and for *float* carrier phase: its channels differ in frequency (FDMA), so that
//! double-difference ambiguities of GLONASS are not integers and are never fixed.

use core::fmt;
use core::str::FromStr;

/// A satellite navigation system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Constellation {
    /// GPS (`G`).
    Gps,
    /// Galileo (`E`).
    Galileo,
    /// BeiDou (`C`).
    BeiDou,
    /// QZSS (`J`).
    Qzss,
    /// GLONASS (`R`), code and float phase only.
    Glonass,
}

impl Constellation {
    /// All constellations, in the order of their index.
    pub const ALL: [Self; 5] = [Self::Gps, Self::Galileo, Self::BeiDou, Self::Qzss, Self::Glonass];

    /// RINEX letter.
    pub const fn letter(self) -> char {
        match self {
            Self::Gps => 'G',
            Self::Galileo => 'E',
            Self::BeiDou => 'C',
            Self::Qzss => 'J',
            Self::Glonass => 'R',
        }
    }

    /// From the RINEX letter; `None` for systems that are not supported (SBAS `S`, NavIC `I`) and for anything else.
    pub const fn from_letter(letter: char) -> Option<Self> {
        match letter {
            'G' => Some(Self::Gps),
            'E' => Some(Self::Galileo),
            'C' => Some(Self::BeiDou),
            'J' => Some(Self::Qzss),
            'R' => Some(Self::Glonass),
            _ => None,
        }
    }

    /// Position in [`Constellation::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A satellite: constellation and number, 1…63 (PRN, SVID, or GLONASS slot).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SatelliteId {
    constellation: Constellation,
    number: u8,
}

impl SatelliteId {
    /// A satellite by constellation and number; `None` unless 1 ≤ `number` ≤ 63.
    pub const fn new(constellation: Constellation, number: u8) -> Option<Self> {
        if number >= 1 && number <= 63 { Some(Self { constellation, number }) } else { None }
    }

    /// Its constellation.
    pub const fn constellation(self) -> Constellation {
        self.constellation
    }

    /// Its number within the constellation, 1…63.
    pub const fn number(self) -> u8 {
        self.number
    }
}

impl fmt::Display for SatelliteId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{:02}", self.constellation.letter(), self.number)
    }
}

impl fmt::Debug for SatelliteId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Not a satellite of a supported constellation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParseSatelliteError;

impl fmt::Display for ParseSatelliteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected a letter of G, E, C, J, R and a number 1…63, as in \"G05\"")
    }
}

impl core::error::Error for ParseSatelliteError {}

impl FromStr for SatelliteId {
    type Err = ParseSatelliteError;

    /// Reads `G05`, `G 5` and `G5`.
    fn from_str(s: &str) -> Result<Self, ParseSatelliteError> {
        let mut chars = s.chars();
        let constellation = chars.next().and_then(Constellation::from_letter).ok_or(ParseSatelliteError)?;
        let number = chars.as_str().trim_start().parse().map_err(|_| ParseSatelliteError)?;
        Self::new(constellation, number).ok_or(ParseSatelliteError)
    }
}

/// A set of satellites, 40 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SatelliteSet {
    bits: [u64; 5],
}

impl SatelliteSet {
    /// The empty set.
    pub const EMPTY: Self = Self { bits: [0; 5] };

    /// Adds a satellite; true if it was not in the set.
    pub fn insert(&mut self, satellite: SatelliteId) -> bool {
        let new = !self.contains(satellite);
        self.bits[satellite.constellation.index()] |= 1 << satellite.number;
        new
    }

    /// Removes a satellite; true if it was in the set.
    pub fn remove(&mut self, satellite: SatelliteId) -> bool {
        let was = self.contains(satellite);
        self.bits[satellite.constellation.index()] &= !(1 << satellite.number);
        was
    }

    /// Whether a satellite is in the set.
    pub const fn contains(&self, satellite: SatelliteId) -> bool {
        self.bits[satellite.constellation.index()] >> satellite.number & 1 == 1
    }

    /// Number of satellites in the set.
    pub fn len(&self) -> usize {
        self.bits.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether the set is empty.
    pub fn is_empty(&self) -> bool {
        self.bits == [0; 5]
    }

    /// The satellites in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = SatelliteId> + '_ {
        Constellation::ALL.into_iter().flat_map(move |constellation| {
            (1..=63)
                .filter_map(move |number| SatelliteId::new(constellation, number))
                .filter(|&satellite| self.contains(satellite))
        })
    }

    /// Bit masks by constellation index; bit n is satellite number n.
    pub const fn masks(&self) -> [u64; 5] {
        self.bits
    }

    /// From bit masks as given by [`SatelliteSet::masks`]; bit 0 is ignored.
    pub const fn from_masks(mut bits: [u64; 5]) -> Self {
        let mut i = 0;
        while i < 5 {
            bits[i] &= !1;
            i += 1;
        }
        Self { bits }
    }
}

impl FromIterator<SatelliteId> for SatelliteSet {
    fn from_iter<I: IntoIterator<Item = SatelliteId>>(satellites: I) -> Self {
        let mut set = Self::EMPTY;
        satellites.into_iter().for_each(|satellite| {
            set.insert(satellite);
        });
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_written_as_rinex_does() {
        for (text, name) in [("G05", "G05"), ("E 7", "E07"), ("C60", "C60")] {
            assert_eq!(text.parse::<SatelliteId>().unwrap().to_string(), name);
        }
        for bad in ["", "G", "G00", "G64", "X01", "G-1", "é1"] {
            assert_eq!(bad.parse::<SatelliteId>(), Err(ParseSatelliteError));
        }
    }

    #[test]
    fn a_set_holds_what_was_put_in() {
        let satellites: Vec<SatelliteId> = ["G01", "E36", "C63", "J10", "R24"].map(|s| s.parse().unwrap()).to_vec();
        let mut set: SatelliteSet = satellites.iter().copied().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), satellites);
        assert_eq!(SatelliteSet::from_masks(set.masks()), set);
        assert!(set.remove(satellites[2]) && !set.contains(satellites[2]) && set.len() == 4);
    }
}
