//! Signals: band and attribute as in RINEX 3 observation codes (`1C`, `2W`, `5Q`), and their carrier frequencies.
//!
//! Frequencies: IS-GPS-200N, Galileo OS SIS ICD 2.1, BDS-SIS-ICD B1I 3.0/B1C/B2a/B2b/B3I, IS-QZSS-PNT-005,
//! GLONASS ICD L1, L2 5.1; tabulated in RINEX 3.05 section 5.2.17.

use super::SPEED_OF_LIGHT;
use super::satellite::Constellation;
use core::fmt;
use core::str::FromStr;

/// A signal within its constellation: RINEX 3 band digit and attribute letter, for instance `1C` or `5Q`.
///
/// BeiDou B1I is `2I` (RINEX 3.02's `1I` is read as `2I` by readers).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Signal {
    band: u8,
    attribute: u8,
}

impl Signal {
    /// From RINEX band digit (`b'1'`…`b'9'`) and attribute (`b'A'`…`b'Z'`, or `b' '` where not known).
    pub const fn new(band: u8, attribute: u8) -> Option<Self> {
        let band_ok = band >= b'1' && band <= b'9';
        let attribute_ok = attribute >= b'A' && attribute <= b'Z' || attribute == b' ';
        if band_ok && attribute_ok { Some(Self { band, attribute }) } else { None }
    }

    /// RINEX band digit as ASCII, `b'1'`…`b'9'`.
    pub const fn band(self) -> u8 {
        self.band
    }

    /// RINEX attribute as ASCII, `b'A'`…`b'Z'` or `b' '`.
    pub const fn attribute(self) -> u8 {
        self.attribute
    }

    /// Carrier frequency `[Hz]` of this signal for a satellite of `constellation`; `glonass_channel` (−7…+6) is needed
    /// for GLONASS G1 and G2 (FDMA). `None` where the constellation has no such band or the channel is missing.
    pub fn frequency(self, constellation: Constellation, glonass_channel: Option<i8>) -> Option<f64> {
        use Constellation::{BeiDou, Galileo, Glonass, Gps, Qzss};
        let hz = match (constellation, self.band) {
            (Gps | Galileo | Qzss | BeiDou, b'1') => 1_575.42e6,
            (Gps | Qzss, b'2') => 1_227.60e6,
            (Gps | Galileo | Qzss | BeiDou, b'5') => 1_176.45e6,
            (Galileo | BeiDou, b'7') => 1_207.14e6,
            (Galileo, b'8') | (BeiDou, b'8') => 1_191.795e6,
            (Galileo, b'6') | (Qzss, b'6') => 1_278.75e6,
            (BeiDou, b'2') => 1_561.098e6,
            (BeiDou, b'6') => 1_268.52e6,
            (Glonass, b'1') => 1_602.0e6 + 562.5e3 * glonass_channel_checked(glonass_channel)?,
            (Glonass, b'2') => 1_246.0e6 + 437.5e3 * glonass_channel_checked(glonass_channel)?,
            (Glonass, b'3') => 1_202.025e6,
            (Glonass, b'4') => 1_600.995e6,
            (Glonass, b'6') => 1_248.06e6,
            _ => return None,
        };
        Some(hz)
    }

    /// Carrier wavelength λ = c/f `[m]`; as [`Signal::frequency`].
    pub fn wavelength(self, constellation: Constellation, glonass_channel: Option<i8>) -> Option<f64> {
        self.frequency(constellation, glonass_channel).map(|hz| SPEED_OF_LIGHT / hz)
    }
}

fn glonass_channel_checked(channel: Option<i8>) -> Option<f64> {
    channel.filter(|k| (-7..=6).contains(k)).map(f64::from)
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.band as char, self.attribute as char)
    }
}

impl fmt::Debug for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Not a signal code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParseSignalError;

impl fmt::Display for ParseSignalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected a band digit 1…9 and an attribute letter, as in \"1C\"")
    }
}

impl core::error::Error for ParseSignalError {}

impl FromStr for Signal {
    type Err = ParseSignalError;

    fn from_str(s: &str) -> Result<Self, ParseSignalError> {
        match *s.as_bytes() {
            [band, attribute] => Self::new(band, attribute).ok_or(ParseSignalError),
            _ => Err(ParseSignalError),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_those_of_the_interface_documents() {
        let hz = |c, s: &str, k| s.parse::<Signal>().unwrap().frequency(c, k);
        assert_eq!(hz(Constellation::Gps, "1C", None), Some(1_575.42e6)); // IS-GPS-200N 3.3.1.1
        assert_eq!(hz(Constellation::BeiDou, "2I", None), Some(1_561.098e6)); // BDS B1I ICD 4.2.1
        assert_eq!(hz(Constellation::Glonass, "1C", Some(-4)), Some(1_599.75e6)); // GLONASS ICD 5.1 table 3.1
        assert_eq!(hz(Constellation::Glonass, "1C", None), None);
        assert_eq!(hz(Constellation::Glonass, "1C", Some(7)), None);
        assert_eq!(hz(Constellation::Gps, "7Q", None), None);
    }

    #[test]
    fn codes_are_checked() {
        assert_eq!("5Q".parse::<Signal>().unwrap().to_string(), "5Q");
        assert!("0C".parse::<Signal>().is_err() && "1c".parse::<Signal>().is_err() && "é".parse::<Signal>().is_err());
    }
}
