//! Exact GPS time.
//!
//! [`GpsTime`] is a whole number of nanoseconds since 1980-01-06 00:00:00 GPST, so that comparing, sorting and
//! differencing epochs is exact: an `f64` of seconds since 1980 would resolve only 0.24 µs, which is 70 m of range.
//!
//! Dates are in [`calendar`], UTC and the other systems' scales in [`scales`].
//!
//! Panic contract: none; arithmetic saturates at the ends of the representable range (±292 years).

use core::fmt;

pub mod calendar;
pub mod scales;

pub use calendar::Calendar;

/// Nanoseconds in a second.
const NS_PER_S: i64 = 1_000_000_000;
/// Seconds in a GPS week.
pub const SECONDS_PER_WEEK: i64 = 604_800;

/// A point on the GPS time scale (GPST: no leap seconds), exact to the nanosecond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GpsTime {
    ns: i64,
}

impl GpsTime {
    /// From nanoseconds since 1980-01-06 00:00:00 GPST.
    pub const fn from_nanoseconds(ns: i64) -> Self {
        Self { ns }
    }

    /// Nanoseconds since 1980-01-06 00:00:00 GPST.
    pub const fn nanoseconds(self) -> i64 {
        self.ns
    }

    /// From a continuous (not rolled over) GPS week and seconds of week `tow` `[s]`, which may lie outside 0…604800.
    /// A `tow` that is not finite counts as 0; results beyond the range saturate.
    pub fn from_week_tow(week: i32, tow: f64) -> Self {
        Self { ns: (week as i64).saturating_mul(SECONDS_PER_WEEK * NS_PER_S) }.plus_seconds(tow)
    }

    /// Continuous GPS week number (negative before 1980-01-06).
    pub const fn week(self) -> i32 {
        self.ns.div_euclid(SECONDS_PER_WEEK * NS_PER_S) as i32
    }

    /// Seconds of GPS week `[s]`, 0 ≤ tow < 604800, correctly rounded to `f64`.
    pub fn tow(self) -> f64 {
        self.ns.rem_euclid(SECONDS_PER_WEEK * NS_PER_S) as f64 / NS_PER_S as f64
    }

    /// `self − earlier` in seconds `[s]`: exact difference, rounded once to `f64`.
    pub fn since(self, earlier: Self) -> f64 {
        self.ns.saturating_sub(earlier.ns) as f64 / NS_PER_S as f64
    }

    /// This time `seconds` `[s]` later, rounded to the nanosecond. Non-finite input adds nothing.
    pub fn plus_seconds(self, seconds: f64) -> Self {
        // Whole and fractional seconds apart: the product stays exact to a nanosecond for any number of weeks.
        if !seconds.is_finite() {
            return self;
        }
        let whole = libm::floor(seconds);
        let fraction_ns = libm::round((seconds - whole) * NS_PER_S as f64) as i64;
        Self { ns: self.ns.saturating_add((whole as i64).saturating_mul(NS_PER_S)).saturating_add(fraction_ns) }
    }
}

impl fmt::Display for GpsTime {
    /// Week and seconds of week: `2114 5783.994000000`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let in_week = self.ns.rem_euclid(SECONDS_PER_WEEK * NS_PER_S);
        write!(f, "{} {}.{:09}", self.week(), in_week / NS_PER_S, in_week % NS_PER_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn week_and_tow_come_back() {
        let t = GpsTime::from_week_tow(2114, 5783.994);
        assert_eq!((t.week(), t.tow()), (2114, 5783.994));
        assert_eq!(GpsTime::from_week_tow(2114, -0.5), GpsTime::from_week_tow(2113, 604_799.5));
    }

    #[test]
    fn not_finite_is_ignored_and_the_ends_saturate() {
        let t = GpsTime::from_week_tow(1, 2.0);
        assert_eq!(t.plus_seconds(f64::NAN), t);
        assert_eq!(GpsTime::from_week_tow(i32::MAX, 1e300).nanoseconds(), i64::MAX);
    }
}
