//! Broadcast ephemerides: the orbit and clock parameters that satellites send, as data.
//!
//! Orbits and clocks are computed from them in their own modules. Parameter names follow IS-GPS-200N table 20-III,
//! Galileo OS SIS ICD 2.1 table 67, BDS-SIS-ICD 3.0 table 5-8 and GLONASS ICD 5.1 table 4.5.

use super::satellite::SatelliteId;
use super::time::GpsTime;

/// The navigation message that a Kepler ephemeris came in. Matters for Galileo, whose I/NAV and F/NAV clocks refer to
/// different signal pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum NavigationMessage {
    /// GPS or QZSS LNAV.
    Lnav,
    /// Galileo I/NAV: clock for E1/E5b.
    Inav,
    /// Galileo F/NAV: clock for E1/E5a.
    Fnav,
    /// BeiDou D1 (MEO, IGSO) or D2 (GEO): clock for B3I.
    D1D2,
}

/// Keplerian broadcast ephemeris of GPS, Galileo, BeiDou or QZSS.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KeplerEphemeris {
    /// Whose orbit.
    pub satellite: SatelliteId,
    /// The message it came in.
    pub message: NavigationMessage,
    /// Issue of data, ephemeris (IODE, IODnav, AODE).
    pub iode: u16,
    /// Time of ephemeris on the GPS time scale (BeiDou's BDT converted).
    pub toe: GpsTime,
    /// Time of clock on the GPS time scale (BeiDou's BDT converted).
    pub toc: GpsTime,
    /// Square root of the semi-major axis `[√m]`.
    pub sqrt_a: f64,
    /// Eccentricity.
    pub e: f64,
    /// Mean anomaly at `toe` `[rad]`.
    pub m0: f64,
    /// Mean motion difference `[rad/s]`.
    pub delta_n: f64,
    /// Inclination at `toe` `[rad]`.
    pub i0: f64,
    /// Rate of inclination `[rad/s]`.
    pub idot: f64,
    /// Longitude of the ascending node at weekly epoch `[rad]`.
    pub omega0: f64,
    /// Argument of perigee `[rad]`.
    pub omega: f64,
    /// Rate of right ascension `[rad/s]`.
    pub omega_dot: f64,
    /// Cosine harmonic correction to the argument of latitude `[rad]`.
    pub cuc: f64,
    /// Sine harmonic correction to the argument of latitude `[rad]`.
    pub cus: f64,
    /// Cosine harmonic correction to the orbit radius `[m]`.
    pub crc: f64,
    /// Sine harmonic correction to the orbit radius `[m]`.
    pub crs: f64,
    /// Cosine harmonic correction to the inclination `[rad]`.
    pub cic: f64,
    /// Sine harmonic correction to the inclination `[rad]`.
    pub cis: f64,
    /// Clock bias at `toc` `[s]`.
    pub af0: f64,
    /// Clock drift `[s/s]`.
    pub af1: f64,
    /// Clock drift rate `[s/s²]`.
    pub af2: f64,
    /// Group delays `[s]`: GPS/QZSS `[TGD, 0]`; Galileo `[BGD E5a/E1, BGD E5b/E1]`; BeiDou `[TGD1 B1/B3, TGD2 B2/B3]`.
    pub group_delay: [f64; 2],
    /// Health word as broadcast; 0 is healthy.
    pub health: u16,
    /// User range accuracy (URA, SISA) `[m]`.
    pub accuracy: f64,
    /// Fit interval `[h]` where broadcast (GPS, QZSS), else 0.
    pub fit_interval: f64,
}

/// GLONASS broadcast ephemeris: state vector in PZ-90 to be integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GlonassEphemeris {
    /// Whose orbit.
    pub satellite: SatelliteId,
    /// Issue of data (tb interval index).
    pub iode: u16,
    /// Frequency channel, −7…+6.
    pub channel: i8,
    /// Reference time tb on the GPS time scale.
    pub toe: GpsTime,
    /// Position at `toe`, ECEF PZ-90 `[m]`.
    pub position: [f64; 3],
    /// Velocity at `toe`, ECEF PZ-90 `[m/s]`.
    pub velocity: [f64; 3],
    /// Lunisolar acceleration, ECEF `[m/s²]`.
    pub acceleration: [f64; 3],
    /// Clock bias −τn `[s]` (added to satellite time as RINEX gives it).
    pub clock_bias: f64,
    /// Relative frequency bias +γn `[s/s]`.
    pub frequency_bias: f64,
    /// Health word Bn; 0 is healthy.
    pub health: u16,
    /// Age of data `[days]`.
    pub age: f64,
}

/// A broadcast ephemeris of any supported constellation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Ephemeris {
    /// GPS, Galileo, BeiDou, QZSS.
    Kepler(KeplerEphemeris),
    /// GLONASS.
    Glonass(GlonassEphemeris),
}

impl Ephemeris {
    /// Whose ephemeris.
    pub const fn satellite(&self) -> SatelliteId {
        match self {
            Self::Kepler(kepler) => kepler.satellite,
            Self::Glonass(glonass) => glonass.satellite,
        }
    }

    /// Reference time, GPS time scale.
    pub const fn toe(&self) -> GpsTime {
        match self {
            Self::Kepler(kepler) => kepler.toe,
            Self::Glonass(glonass) => glonass.toe,
        }
    }

    /// Health word as broadcast; 0 is healthy.
    pub const fn health(&self) -> u16 {
        match self {
            Self::Kepler(kepler) => kepler.health,
            Self::Glonass(glonass) => glonass.health,
        }
    }
}
