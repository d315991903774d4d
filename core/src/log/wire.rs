//! The frozen layout: what the payload of each kind of record is, as postcard writes these structs.
//!
//! Postcard's rules: integers wider than a byte are LEB128 varints, signed ones zigzag; `f64` and `f32` are little
//! endian; structs, tuples and arrays are their fields in order; an enum is the varint of its variant's index and its
//! fields; an `Option` is `00`, or `01` and the value.
//!
//! The in-memory types may change freely; these may not, and the golden files would fail. Each code of an enum is written
//! out here once and never given to another meaning. Panic contract: none.

use super::record::{Event, Header, Ionosphere, Station};
use crate::gnss::atmosphere::Klobuchar;
use crate::gnss::ephemeris::{GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use crate::gnss::epoch::Observation;
use crate::gnss::satellite::{Constellation, SatelliteId, SatelliteSet};
use crate::gnss::signal::Signal;
use crate::gnss::solution::{Quality, Reason, Solution};
use crate::gnss::time::GpsTime;
use crate::integrity::protection::{Levels, Status};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A table of codes: a function from value to code, which does not compile while a variant is missing, and one back.
macro_rules! codes {
    ($type:ident, $encode:ident, $decode:ident: $($variant:ident = $code:literal),* $(,)?) => {
        pub(super) const fn $encode(value: $type) -> u8 {
            match value {
                $($type::$variant => $code,)*
            }
        }

        pub(super) const fn $decode(code: u8) -> Option<$type> {
            match code {
                $($code => Some($type::$variant),)*
                _ => None,
            }
        }
    };
}

codes!(Constellation, constellation_code, constellation:
    Gps = 0, Galileo = 1, BeiDou = 2, Qzss = 3, Glonass = 4);
codes!(NavigationMessage, message_code, message:
    Lnav = 0, Inav = 1, Fnav = 2, D1D2 = 3);
codes!(Station, station_code, station:
    Rover = 0, Base = 1);
codes!(Quality, quality_code, quality:
    None = 0, Fixed = 1, Partial = 2, Float = 3, Code = 4);
codes!(Reason, reason_code, reason:
    Complete = 0, SubsetOnly = 1, SuccessRateLow = 2, RatioLow = 3, Inconsistent = 4, TooFewAmbiguities = 5,
    SearchBudget = 6, NoBase = 7, BaseTooOld = 8, TooFewCommonSatellites = 9, TooFewSatellites = 10,
    PositionFailed = 11, OutOfOrder = 12, Restarted = 13, BaselineLength = 14);

/// A satellite: its constellation's code · 64 + number.
fn satellite_code(satellite: SatelliteId) -> u16 {
    u16::from(constellation_code(satellite.constellation())) << 6 | u16::from(satellite.number())
}

fn satellite(code: u16) -> Option<SatelliteId> {
    SatelliteId::new(constellation(u8::try_from(code >> 6).ok()?)?, (code & 63) as u8)
}

/// A signal: (band − 1) · 27 + attribute, where the attribute is 0 for a blank and 1…26 for `A`…`Z`.
fn signal_code(signal: Signal) -> u8 {
    let attribute = if signal.attribute() == b' ' { 0 } else { signal.attribute().wrapping_sub(b'A' - 1) };
    signal.band().wrapping_sub(b'1').wrapping_mul(27).wrapping_add(attribute)
}

fn signal(code: u8) -> Option<Signal> {
    let attribute = code % 27;
    Signal::new(b'1' + code / 27, if attribute == 0 { b' ' } else { b'A' - 1 + attribute })
}

/// An observable: absent, a whole number of thousandths, or any number.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) enum Number {
    Absent,
    /// The number is `n / 1000`, correctly rounded: what any parser makes of three decimals.
    Thousandths(i64),
    Exact(f64),
}

impl Number {
    fn new(value: Option<f64>) -> Self {
        let Some(value) = value else { return Self::Absent };
        let thousandths = libm::round(value * 1000.0);
        // Below 2^53 the conversion to an integer and back is exact.
        let n = thousandths as i64;
        let comes_back = libm::fabs(thousandths) < 9.0e15 && (n as f64 / 1000.0).to_bits() == value.to_bits();
        if comes_back { Self::Thousandths(n) } else { Self::Exact(value) }
    }

    fn value(self) -> Option<f64> {
        match self {
            Self::Absent => None,
            Self::Thousandths(n) => Some(n as f64 / 1000.0),
            Self::Exact(value) => Some(value),
        }
    }
}

/// As [`Number`], in single precision.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) enum ShortNumber {
    Absent,
    Thousandths(i32),
    Exact(f32),
}

impl ShortNumber {
    fn new(value: Option<f32>) -> Self {
        let Some(value) = value else { return Self::Absent };
        let thousandths = libm::roundf(value * 1000.0);
        let n = thousandths as i32;
        let comes_back = libm::fabsf(thousandths) < 1.6e7 && (n as f32 / 1000.0).to_bits() == value.to_bits();
        if comes_back { Self::Thousandths(n) } else { Self::Exact(value) }
    }

    fn value(self) -> Option<f32> {
        match self {
            Self::Absent => None,
            Self::Thousandths(n) => Some(n as f32 / 1000.0),
            Self::Exact(value) => Some(value),
        }
    }
}

/// Observation, at most 37 bytes.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireObservation {
    satellite: u16,
    signal: u8,
    /// Bit 0 loss of lock, bit 1 half cycle.
    flags: u8,
    code: Number,
    phase: Number,
    doppler: Number,
    cn0: ShortNumber,
}

impl WireObservation {
    pub fn new(observation: &Observation) -> Self {
        Self {
            satellite: satellite_code(observation.satellite),
            signal: signal_code(observation.signal),
            flags: u8::from(observation.loss_of_lock) | u8::from(observation.half_cycle) << 1,
            code: Number::new(observation.code),
            phase: Number::new(observation.phase),
            doppler: Number::new(observation.doppler),
            cn0: ShortNumber::new(observation.cn0),
        }
    }

    /// The observation as it was written; `None` if a code has no meaning.
    pub fn observation(&self) -> Option<Observation> {
        if self.flags > 3 {
            return None;
        }
        Some(Observation {
            satellite: satellite(self.satellite)?,
            signal: signal(self.signal)?,
            code: self.code.value(),
            phase: self.phase.value(),
            doppler: self.doppler.value(),
            cn0: self.cn0.value(),
            loss_of_lock: self.flags & 1 != 0,
            half_cycle: self.flags & 2 != 0,
        })
    }
}

/// What comes before the observations of a part of an epoch, at most 17 bytes.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireEpochHead {
    pub station: u8,
    /// Nanoseconds since 1980-01-06 00:00:00 GPST.
    pub time: i64,
    /// Index of the first observation of this part in the epoch.
    pub first: u16,
    /// Observations in the epoch.
    pub total: u16,
}

#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireHeader {
    base_position: Option<[f64; 3]>,
    base_antenna: [f64; 3],
    rover_antenna: [f64; 3],
}

impl WireHeader {
    pub fn new(header: &Header) -> Self {
        let Header { base_position, base_antenna, rover_antenna } = *header;
        Self { base_position, base_antenna, rover_antenna }
    }

    pub fn header(&self) -> Header {
        let Self { base_position, base_antenna, rover_antenna } = *self;
        Header { base_position, base_antenna, rover_antenna }
    }

    pub fn is_finite(&self) -> bool {
        let position = self.base_position.unwrap_or_default();
        [position, self.base_antenna, self.rover_antenna].iter().flatten().all(|x| x.is_finite())
    }
}

#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireIonosphere {
    constellation: u8,
    alpha: [f64; 4],
    beta: [f64; 4],
}

impl WireIonosphere {
    pub fn new(ionosphere: &Ionosphere) -> Self {
        let Ionosphere { constellation, klobuchar: Klobuchar { alpha, beta } } = *ionosphere;
        Self { constellation: constellation_code(constellation), alpha, beta }
    }

    pub fn ionosphere(&self) -> Option<Ionosphere> {
        let Self { constellation: code, alpha, beta } = *self;
        Some(Ionosphere { constellation: constellation(code)?, klobuchar: Klobuchar { alpha, beta } })
    }

    pub fn is_finite(&self) -> bool {
        [self.alpha, self.beta].iter().flatten().all(|x| x.is_finite())
    }
}

#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireKepler {
    satellite: u16,
    message: u8,
    iode: u16,
    toe: i64,
    toc: i64,
    health: u16,
    /// √A, e, M0, Δn, i0, IDOT, Ω0, ω, Ω̇, Cuc, Cus, Crc, Crs, Cic, Cis, af0, af1, af2, group delays, accuracy, fit.
    parameters: [f64; 22],
}

impl WireKepler {
    pub fn new(k: &KeplerEphemeris) -> Self {
        let [delay_0, delay_1] = k.group_delay;
        Self {
            satellite: satellite_code(k.satellite),
            message: message_code(k.message),
            iode: k.iode,
            toe: k.toe.nanoseconds(),
            toc: k.toc.nanoseconds(),
            health: k.health,
            parameters: [
                k.sqrt_a,
                k.e,
                k.m0,
                k.delta_n,
                k.i0,
                k.idot,
                k.omega0,
                k.omega,
                k.omega_dot,
                k.cuc,
                k.cus,
                k.crc,
                k.crs,
                k.cic,
                k.cis,
                k.af0,
                k.af1,
                k.af2,
                delay_0,
                delay_1,
                k.accuracy,
                k.fit_interval,
            ],
        }
    }

    pub fn kepler(&self) -> Option<KeplerEphemeris> {
        let [
            sqrt_a,
            e,
            m0,
            delta_n,
            i0,
            idot,
            omega0,
            omega,
            omega_dot,
            cuc,
            cus,
            crc,
            crs,
            cic,
            cis,
            af0,
            af1,
            af2,
            delay_0,
            delay_1,
            accuracy,
            fit_interval,
        ] = self.parameters;
        Some(KeplerEphemeris {
            satellite: satellite(self.satellite)?,
            message: message(self.message)?,
            iode: self.iode,
            toe: GpsTime::from_nanoseconds(self.toe),
            toc: GpsTime::from_nanoseconds(self.toc),
            sqrt_a,
            e,
            m0,
            delta_n,
            i0,
            idot,
            omega0,
            omega,
            omega_dot,
            cuc,
            cus,
            crc,
            crs,
            cic,
            cis,
            af0,
            af1,
            af2,
            group_delay: [delay_0, delay_1],
            health: self.health,
            accuracy,
            fit_interval,
        })
    }

    pub fn is_finite(&self) -> bool {
        self.parameters.iter().all(|x| x.is_finite())
    }
}

#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireGlonass {
    satellite: u16,
    iode: u16,
    channel: i8,
    toe: i64,
    health: u16,
    position: [f64; 3],
    velocity: [f64; 3],
    acceleration: [f64; 3],
    /// −τn, γn, age of data.
    parameters: [f64; 3],
}

impl WireGlonass {
    pub fn new(g: &GlonassEphemeris) -> Self {
        Self {
            satellite: satellite_code(g.satellite),
            iode: g.iode,
            channel: g.channel,
            toe: g.toe.nanoseconds(),
            health: g.health,
            position: g.position,
            velocity: g.velocity,
            acceleration: g.acceleration,
            parameters: [g.clock_bias, g.frequency_bias, g.age],
        }
    }

    pub fn glonass(&self) -> Option<GlonassEphemeris> {
        let [clock_bias, frequency_bias, age] = self.parameters;
        Some(GlonassEphemeris {
            satellite: satellite(self.satellite)?,
            iode: self.iode,
            channel: self.channel,
            toe: GpsTime::from_nanoseconds(self.toe),
            position: self.position,
            velocity: self.velocity,
            acceleration: self.acceleration,
            clock_bias,
            frequency_bias,
            health: self.health,
            age,
        })
    }

    pub fn is_finite(&self) -> bool {
        [self.position, self.velocity, self.acceleration, self.parameters].iter().flatten().all(|x| x.is_finite())
    }
}

#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireSolution {
    time: i64,
    quality: u8,
    reason: u8,
    position: [f64; 3],
    /// Column by column; all nine, so that what was symmetric only nearly comes back as it was.
    position_covariance: [[f64; 3]; 3],
    velocity: [f64; 3],
    velocity_covariance: [[f64; 3]; 3],
    ambiguities_fixed: u8,
    ambiguities: u8,
    ratio: f64,
    success_rate: f64,
    age: f64,
    /// Bit masks in the order GPS, Galileo, BeiDou, QZSS, GLONASS; bit n is number n.
    used: [u64; 5],
    rejected: [u64; 5],
    slipped: [u64; 5],
}

impl WireSolution {
    pub fn new(s: &Solution) -> Self {
        Self {
            time: s.time.nanoseconds(),
            quality: quality_code(s.quality),
            reason: reason_code(s.reason),
            position: s.position.into(),
            position_covariance: s.position_covariance.into(),
            velocity: s.velocity.into(),
            velocity_covariance: s.velocity_covariance.into(),
            ambiguities_fixed: s.ambiguities_fixed,
            ambiguities: s.ambiguities,
            ratio: s.ratio,
            success_rate: s.success_rate,
            age: s.age,
            used: s.satellites_used.masks(),
            rejected: s.satellites_rejected.masks(),
            slipped: s.satellites_slipped.masks(),
        }
    }

    pub fn solution(&self) -> Option<Solution> {
        Some(Solution {
            time: GpsTime::from_nanoseconds(self.time),
            quality: quality(self.quality)?,
            reason: reason(self.reason)?,
            position: Vector3::from(self.position),
            position_covariance: Matrix3::from(self.position_covariance),
            velocity: Vector3::from(self.velocity),
            velocity_covariance: Matrix3::from(self.velocity_covariance),
            ambiguities_fixed: self.ambiguities_fixed,
            ambiguities: self.ambiguities,
            ratio: self.ratio,
            success_rate: self.success_rate,
            age: self.age,
            satellites_used: SatelliteSet::from_masks(self.used),
            satellites_rejected: SatelliteSet::from_masks(self.rejected),
            satellites_slipped: SatelliteSet::from_masks(self.slipped),
            protection: None,
            integrity: Status::Unmonitored,
            base: None,
        })
    }
}

/// What a bounded solution, or one with a moving base, has beside [`WireSolution`].
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireBounds {
    /// HPL, VPL.
    protection: Option<[f64; 2]>,
    /// 0 available, 1 alert, 2 unmonitored.
    status: u8,
    base: Option<[f64; 3]>,
}

impl WireBounds {
    /// `None` if there is nothing of it.
    pub fn new(s: &Solution) -> Option<Self> {
        let status = match s.integrity {
            Status::Available => 0,
            Status::Alert => 1,
            Status::Unmonitored => 2,
        };
        let protection = s.protection.map(|levels| [levels.horizontal, levels.vertical]);
        let any = protection.is_some() || s.base.is_some() || status != 2;
        any.then_some(Self { protection, status, base: s.base.map(Into::into) })
    }

    /// Completes a solution.
    pub fn complete(&self, solution: Solution) -> Option<Solution> {
        let integrity = match self.status {
            0 => Status::Available,
            1 => Status::Alert,
            2 => Status::Unmonitored,
            _ => return None,
        };
        let protection = self.protection.map(|[horizontal, vertical]| Levels { horizontal, vertical });
        Some(Solution { protection, integrity, base: self.base.map(Vector3::from), ..solution })
    }
}

/// Code and value: 0 end, 1 reset, 2 dropped records, 3 marker.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct WireEvent {
    code: u8,
    value: u32,
}

impl WireEvent {
    pub fn new(event: &Event) -> Self {
        let (code, value) = match *event {
            Event::End => (0, 0),
            Event::Reset => (1, 0),
            Event::Dropped(count) => (2, count),
            Event::Marker(value) => (3, value),
        };
        Self { code, value }
    }

    pub fn event(&self) -> Option<Event> {
        match (self.code, self.value) {
            (0, 0) => Some(Event::End),
            (1, 0) => Some(Event::Reset),
            (2, count) => Some(Event::Dropped(count)),
            (3, value) => Some(Event::Marker(value)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_code_comes_back() {
        for code in 0..=u8::MAX {
            assert!(constellation(code).is_none_or(|value| constellation_code(value) == code));
            assert!(message(code).is_none_or(|value| message_code(value) == code));
            assert!(quality(code).is_none_or(|value| quality_code(value) == code));
            assert!(reason(code).is_none_or(|value| reason_code(value) == code));
            assert!(signal(code).is_none_or(|value| signal_code(value) == code));
        }
        let signals = (b'1'..=b'9')
            .flat_map(|band| (b'A'..=b'Z').chain([b' ']).map(move |attribute| Signal::new(band, attribute).unwrap()));
        assert!(signals.into_iter().all(|value| signal(signal_code(value)) == Some(value)));
        for constellation in Constellation::ALL {
            for number in 1..=63 {
                let value = SatelliteId::new(constellation, number).unwrap();
                assert_eq!(satellite(satellite_code(value)), Some(value));
            }
        }
        assert_eq!((satellite(64), satellite(5 * 64 + 1), satellite(u16::MAX)), (None, None, None));
    }

    #[test]
    fn three_decimals_are_stored_as_thousandths() {
        for text in ["21345678.123", "-0.001", "118765432.107", "0.000", "-3456.789", "8999999999999.999"] {
            assert!(matches!(Number::new(text.parse().ok()), Number::Thousandths(_)), "{text}");
        }
        for text in ["45.250", "0.000", "63.999", "7.001"] {
            assert!(matches!(ShortNumber::new(text.parse().ok()), ShortNumber::Thousandths(_)), "{text}");
        }
        for value in [-0.0, 0.1 + 0.2, 1e300, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE, 1.0 / 3.0] {
            assert!(matches!(Number::new(Some(value)), Number::Exact(_)), "{value}");
        }
    }

    proptest! {
        #[test]
        fn any_number_comes_back_bit_for_bit(bits in any::<u64>(), thousandths in -(1i64 << 54)..1 << 54) {
            for value in [f64::from_bits(bits), thousandths as f64 / 1000.0, thousandths as f64 * 0.001] {
                prop_assert_eq!(Number::new(Some(value)).value().unwrap().to_bits(), value.to_bits());
            }
            for value in [f32::from_bits(bits as u32), thousandths as f32 / 1000.0] {
                prop_assert_eq!(ShortNumber::new(Some(value)).value().unwrap().to_bits(), value.to_bits());
            }
        }

        #[test]
        fn three_decimals_of_any_range_are_thousandths(n in -(1i64 << 45)..1 << 45) {
            let text = format!("{}{}.{:03}", if n < 0 { "-" } else { "" }, n.abs() / 1000, n.abs() % 1000);
            prop_assume!(n != 0);
            prop_assert!(matches!(Number::new(text.parse().ok()), Number::Thousandths(m) if m == n));
        }
    }
}
