//! The other time scales: UTC with its leap seconds, BeiDou's BDT, Galileo's GST and GLONASS time.
//!
//! | scale | relation to GPST |
//! |---|---|
//! | UTC | GPST − leap seconds since 1980 ([`LEAP_SECONDS`], IERS Bulletin C) |
//! | BDT | GPST − 14 s, weeks counted from 2006-01-01 (BDS-SIS-ICD-B1I 3.0, 3.3) |
//! | GST | GPST, weeks counted from GPS week 1024 (Galileo OS SIS ICD 2.1, 5.1.2) |
//! | GLONASS | UTC + 3 h; four-year interval N₄ from 1996 and day N_T in it, both from 1 (GLONASS ICD 5.1, 4.4) |
//!
//! The small offsets that satellites broadcast between the clocks realising the scales (GGTO and such) are clock
//! parameters of the estimators, not of these conversions.
//!
//! Panic contract: none.

use super::calendar::{Calendar, SECONDS_PER_DAY, date_of, days_since_gps_epoch};
use super::{GpsTime, NS_PER_S};

/// Days (year, month; always the first of the month) from whose midnight on GPST − UTC `[s]` has this value.
pub const LEAP_SECONDS: [(i32, u8, i64); 18] = [
    (1981, 7, 1),
    (1982, 7, 2),
    (1983, 7, 3),
    (1985, 7, 4),
    (1988, 1, 5),
    (1990, 1, 6),
    (1991, 1, 7),
    (1992, 7, 8),
    (1993, 7, 9),
    (1994, 7, 10),
    (1996, 1, 11),
    (1997, 7, 12),
    (1999, 1, 13),
    (2006, 1, 14),
    (2009, 1, 15),
    (2012, 7, 16),
    (2015, 7, 17),
    (2017, 1, 18),
];

/// GPST − BDT `[s]`.
pub const GPST_MINUS_BDT: i64 = 14;
/// GPS week in which week 0 of BDT begins.
const BDT_WEEK_ZERO: i32 = 1356;
/// GPS week that is week 0 of GST.
const GST_WEEK_ZERO: i32 = 1024;
/// Moscow time − UTC in GLONASS time `[s]`.
const MOSCOW: i64 = 3 * 3_600;
/// Days of a GLONASS four-year interval (none from 1996 to 2099 lacks its leap day).
const FOUR_YEARS: i64 = 1_461;

/// The start of a leap second on the GPS time scale: the instant that UTC calls 23:59:60.
fn leap_second_start((year, month, gpst_minus_utc): (i32, u8, i64)) -> GpsTime {
    GpsTime::from_seconds(days_since_gps_epoch(year, month, 1) * SECONDS_PER_DAY + gpst_minus_utc - 1)
}

/// GLONASS time: days within four years, of Moscow's date.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlonassTime {
    /// Four-year interval N₄, 1 from 1996 on.
    pub n4: i32,
    /// Day in the interval N_T, 1…1461.
    pub nt: i32,
    /// Seconds of the Moscow day `[s]`. During a leap second, 02:59:60 Moscow time, it reads as at 03:00:00.
    pub seconds: f64,
}

impl GlonassTime {
    /// Year, month and day in Moscow.
    pub fn date(&self) -> (i32, u8, u8) {
        date_of(days_since_gps_epoch(1996, 1, 1) + i64::from(self.n4 - 1) * FOUR_YEARS + i64::from(self.nt - 1))
    }
}

impl GpsTime {
    /// GPST − UTC `[s]`. Within a leap second it is still the value before.
    pub fn gpst_minus_utc(self) -> i64 {
        let second = Self::from_seconds(1).ns;
        let begun = |leap: &&(i32, u8, i64)| self.ns - second >= leap_second_start(**leap).ns;
        LEAP_SECONDS.iter().rev().find(begun).map_or(0, |leap| leap.2)
    }

    /// Date and time in UTC; within a leap second 23:59:60 and its fraction.
    pub fn utc(self) -> Calendar {
        let offset = self.gpst_minus_utc();
        let in_leap_second = LEAP_SECONDS.iter().any(|&leap| leap.2 == offset + 1 && self >= leap_second_start(leap));
        // A leap second is labelled as the second before it, plus one.
        let extra = i64::from(in_leap_second);
        let label = Self { ns: self.ns.saturating_sub((offset + extra) * NS_PER_S) };
        let calendar = label.calendar();
        Calendar { second: calendar.second + extra as f64, ..calendar }
    }

    /// From a date and time in UTC; `None` where there is none such. 23:59:60 exists where a leap second was inserted.
    pub fn from_utc(utc: &Calendar) -> Option<Self> {
        let (days, seconds) = utc.days_and_minutes()?;
        let midnight = |&(year, month, _): &(i32, u8, i64)| days_since_gps_epoch(year, month, 1);
        let offset = LEAP_SECONDS.iter().rev().find(|leap| midnight(leap) <= days).map_or(0, |leap| leap.2);
        let leap_second_follows =
            seconds == SECONDS_PER_DAY - 60 && LEAP_SECONDS.iter().any(|leap| midnight(leap) == days + 1);
        let seconds_in_minute = if leap_second_follows { 61.0 } else { 60.0 };
        let second_exists = (0.0..seconds_in_minute).contains(&utc.second);
        second_exists.then(|| Self::from_seconds(days * SECONDS_PER_DAY + seconds + offset).plus_seconds(utc.second))
    }

    /// BeiDou week and seconds of week `[s]`; negative weeks before 2006.
    pub fn bdt(self) -> (i32, f64) {
        let bdt = Self { ns: self.ns.saturating_sub(GPST_MINUS_BDT * NS_PER_S) };
        (bdt.week() - BDT_WEEK_ZERO, bdt.tow())
    }

    /// From BeiDou week and seconds of week `[s]`.
    pub fn from_bdt(week: i32, tow: f64) -> Self {
        let bdt = Self::from_week_tow(week.saturating_add(BDT_WEEK_ZERO), tow);
        Self { ns: bdt.ns.saturating_add(GPST_MINUS_BDT * NS_PER_S) }
    }

    /// Galileo week and seconds of week `[s]`.
    pub fn gst(self) -> (i32, f64) {
        (self.week() - GST_WEEK_ZERO, self.tow())
    }

    /// From Galileo week and seconds of week `[s]`.
    pub fn from_gst(week: i32, tow: f64) -> Self {
        Self::from_week_tow(week.saturating_add(GST_WEEK_ZERO), tow)
    }

    /// GLONASS time.
    pub fn glonass(self) -> GlonassTime {
        let day_ns = SECONDS_PER_DAY * NS_PER_S;
        let moscow = self.ns.saturating_add((MOSCOW - self.gpst_minus_utc()) * NS_PER_S);
        let days = moscow.div_euclid(day_ns) - days_since_gps_epoch(1996, 1, 1);
        GlonassTime {
            n4: days.div_euclid(FOUR_YEARS) as i32 + 1,
            nt: days.rem_euclid(FOUR_YEARS) as i32 + 1,
            seconds: moscow.rem_euclid(day_ns) as f64 / NS_PER_S as f64,
        }
    }

    /// From GLONASS time. Leap seconds cannot be told from the second that follows, and read as that.
    pub fn from_glonass(glonass: &GlonassTime) -> Self {
        let days = days_since_gps_epoch(1996, 1, 1)
            + i64::from(glonass.n4).saturating_sub(1) * FOUR_YEARS
            + i64::from(glonass.nt).saturating_sub(1);
        let utc = Self::from_seconds(days.saturating_mul(SECONDS_PER_DAY) - MOSCOW).plus_seconds(glonass.seconds);
        let utc_midnight = |&&(year, month, _): &&(i32, u8, i64)| {
            Self::from_seconds(days_since_gps_epoch(year, month, 1) * SECONDS_PER_DAY) <= utc
        };
        let offset = LEAP_SECONDS.iter().rev().find(utc_midnight).map_or(0, |leap| leap.2);
        Self { ns: utc.ns.saturating_add(offset * NS_PER_S) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(year: i32, month: u8, day: u8, hour: u8, minute: u8, second: f64) -> Calendar {
        Calendar { year, month, day, hour, minute, second }
    }

    #[test]
    fn leap_seconds_are_labelled_60() {
        // IERS Bulletin C 52: the leap second at the end of 2016; GPST − UTC 17 s before, 18 s after.
        for (tow, utc, offset) in [
            (16.5, at(2016, 12, 31, 23, 59, 59.5), 17),
            (17.0, at(2016, 12, 31, 23, 59, 60.0), 17),
            (17.75, at(2016, 12, 31, 23, 59, 60.75), 17),
            (18.0, at(2017, 1, 1, 0, 0, 0.0), 18),
        ] {
            let time = GpsTime::from_week_tow(1930, tow);
            assert_eq!((time.utc(), time.gpst_minus_utc()), (utc, offset), "{tow}");
            assert_eq!(GpsTime::from_utc(&utc), Some(time));
        }
        assert_eq!(GpsTime::from_utc(&at(2019, 12, 31, 23, 59, 60.0)), None);
        assert_eq!(GpsTime::from_utc(&at(2016, 12, 31, 23, 58, 60.0)), None);
    }

    #[test]
    fn beidou_and_galileo_weeks_start_where_their_documents_say() {
        // BDS-SIS-ICD-B1I 3.0, 3.3: 2006-01-01 0 h UTC, when GPST − UTC was 14 s.
        let start = GpsTime::from_utc(&Calendar::date(2006, 1, 1)).unwrap();
        assert_eq!((start.bdt(), GpsTime::from_bdt(0, 0.0)), ((0, 0.0), start));
        // Galileo OS SIS ICD 2.1, 5.1.2: 13 s before 1999-08-22 0 h UTC.
        let start = GpsTime::from_utc(&Calendar::date(1999, 8, 22)).unwrap().plus_seconds(-13.0);
        assert_eq!((start.gst(), GpsTime::from_gst(0, 0.0)), ((0, 0.0), start));
        assert_eq!(GpsTime::from_week_tow(1356, 0.0).bdt(), (-1, 604_786.0));
    }

    #[test]
    fn glonass_days_are_those_of_moscow() {
        let time = GpsTime::from_utc(&at(2021, 12, 31, 21, 0, 0.0)).unwrap();
        let glonass = time.glonass();
        assert_eq!((glonass.n4, glonass.nt, glonass.seconds), (7, 732, 0.0)); // 2020 is the first year of N4 = 7
        assert_eq!(glonass.date(), (2022, 1, 1));
    }

    proptest! {
        #[test]
        fn every_time_comes_back(ns in -1_000_000_000_000_000_000_i64..4_000_000_000_000_000_000) {
            let time = GpsTime::from_nanoseconds(ns);
            prop_assert_eq!(GpsTime::from_utc(&time.utc()), Some(time));
            let (week, tow) = time.bdt();
            prop_assert_eq!(GpsTime::from_bdt(week, tow), time);
            let (week, tow) = time.gst();
            prop_assert_eq!(GpsTime::from_gst(week, tow), time);
            if time.utc().second < 60.0 {
                prop_assert_eq!(GpsTime::from_glonass(&time.glonass()), time);
            }
        }

        #[test]
        fn nothing_overflows(ns: i64, week: i32, tow: f64, n4: i32, nt: i32, seconds: f64) {
            let time = GpsTime::from_nanoseconds(ns);
            let _ = (time.utc(), time.bdt(), time.gst(), time.glonass(), time.day_of_year());
            let _ = (GpsTime::from_bdt(week, tow), GpsTime::from_gst(week, tow));
            let _ = GpsTime::from_glonass(&GlonassTime { n4, nt, seconds });
        }
    }
}
