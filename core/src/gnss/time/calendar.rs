//! Calendar dates: proleptic Gregorian, on the GPS time scale (UTC is in [`super::scales`]).
//!
//! Days are counted with the Gregorian rule in full (leap years by 4, 100 and 400), not with the 4-year rule that ends in
//! 2100: the civil-from-days algorithm, in which a year begins with March so that the leap day is its last.
//!
//! Panic contract: none; dates that do not exist give `None`.

use super::{GpsTime, NS_PER_S};

/// Seconds in a day.
pub(super) const SECONDS_PER_DAY: i64 = 86_400;

/// A calendar date and time of day. Which time scale it is on is for the context to say.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Calendar {
    /// Year, with century.
    pub year: i32,
    /// Month, 1…12.
    pub month: u8,
    /// Day of the month, 1…31.
    pub day: u8,
    /// Hour, 0…23.
    pub hour: u8,
    /// Minute, 0…59.
    pub minute: u8,
    /// Seconds `[s]`, 0 ≤ second < 60; on UTC below 61 within a leap second.
    pub second: f64,
}

impl Calendar {
    /// Midnight at the start of a day.
    pub const fn date(year: i32, month: u8, day: u8) -> Self {
        Self { year, month, day, hour: 0, minute: 0, second: 0.0 }
    }

    /// Days since 1980-01-06 and whole seconds of the day, without `second`; `None` if there is no such minute.
    pub(super) fn days_and_minutes(&self) -> Option<(i64, i64)> {
        let exists = (1..=9_999).contains(&self.year)
            && (1..=12).contains(&self.month)
            && (1..=days_in_month(self.year, self.month)).contains(&self.day)
            && self.hour < 24
            && self.minute < 60;
        let minutes = i64::from(self.hour) * 60 + i64::from(self.minute);
        exists.then(|| (days_since_gps_epoch(self.year, self.month, self.day), minutes * 60))
    }

    /// From days since 1980-01-06 and nanoseconds of the day.
    pub(super) fn from_days(days: i64, ns_of_day: i64) -> Self {
        let (year, month, day) = date_of(days);
        let (minutes, ns) = (ns_of_day / (60 * NS_PER_S), ns_of_day % (60 * NS_PER_S));
        Self {
            year,
            month,
            day,
            hour: (minutes / 60) as u8,
            minute: (minutes % 60) as u8,
            second: ns as f64 / NS_PER_S as f64,
        }
    }
}

impl GpsTime {
    /// From a date and time on the GPS time scale, seconds rounded to the nanosecond; `None` where there is none such
    /// (month 13, 30 February, 23:59:60).
    pub fn from_calendar(calendar: &Calendar) -> Option<Self> {
        let (days, seconds) = calendar.days_and_minutes()?;
        let second_exists = (0.0..60.0).contains(&calendar.second);
        second_exists.then(|| Self::from_seconds(days * SECONDS_PER_DAY + seconds).plus_seconds(calendar.second))
    }

    /// Date and time on the GPS time scale.
    pub fn calendar(self) -> Calendar {
        let day = SECONDS_PER_DAY * NS_PER_S;
        Calendar::from_days(self.ns.div_euclid(day), self.ns.rem_euclid(day))
    }

    /// Day of the year with fraction, on the GPS time scale: 1.0 is 1 January 0 h.
    pub fn day_of_year(self) -> f64 {
        let new_year = days_since_gps_epoch(self.calendar().year, 1, 1);
        let ns = self.ns.saturating_sub(new_year.saturating_mul(SECONDS_PER_DAY * NS_PER_S));
        1.0 + ns as f64 / (SECONDS_PER_DAY * NS_PER_S) as f64
    }

    /// From whole seconds since 1980-01-06 00:00:00 GPST.
    pub(super) const fn from_seconds(seconds: i64) -> Self {
        Self { ns: seconds.saturating_mul(NS_PER_S) }
    }
}

/// The year that RINEX 2 and NMEA mean by two digits: 80…99 → 19xx, 00…79 → 20xx.
pub const fn year_from_two_digits(digits: u8) -> i32 {
    if digits >= 80 { 1_900 + digits as i32 } else { 2_000 + digits as i32 }
}

/// Whether a year has a 29 February.
const fn is_leap(year: i32) -> bool {
    year % 4 == 0 && year % 100 != 0 || year % 400 == 0
}

const fn days_in_month(year: i32, month: u8) -> u8 {
    match month {
        2 if is_leap(year) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 0000-03-01 to 1980-01-06.
const GPS_EPOCH: i64 = 723_125;
/// Days in 400 years.
const ERA: i64 = 146_097;

/// Days from 1980-01-06 to a date that exists.
pub(super) const fn days_since_gps_epoch(year: i32, month: u8, day: u8) -> i64 {
    let year = year as i64 - (month <= 2) as i64;
    let (era, year_of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let month_from_march = (month as i64 + 9) % 12;
    let day_of_year = (153 * month_from_march + 2) / 5 + day as i64 - 1;
    era * ERA + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - GPS_EPOCH
}

/// Year, month and day that lie `days` after 1980-01-06.
pub(super) const fn date_of(days: i64) -> (i32, u8, u8) {
    let days = days + GPS_EPOCH;
    let (era, day_of_era) = (days.div_euclid(ERA), days.rem_euclid(ERA));
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let month = (month_from_march + 2) % 12 + 1;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    ((era * 400 + year_of_era + (month <= 2) as i64) as i32, month as u8, day as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(year: i32, month: u8, day: u8, hour: u8, minute: u8, second: f64) -> Calendar {
        Calendar { year, month, day, hour, minute, second }
    }

    #[test]
    fn dates_agree_with_astropy() {
        // Week and seconds of week by astropy 8.0.2 and RTKLIB demo5 2.5.1; 2100 is not a leap year.
        for (calendar, week, tow, day_of_year) in [
            (at(1980, 1, 6, 0, 0, 0.0), 0, 0.0, 6.0),
            (at(1999, 8, 21, 23, 59, 59.5), 1023, 604_799.5, 233.999_994_212_963),
            (at(2000, 2, 29, 12, 0, 0.0), 1051, 216_000.0, 60.5),
            (at(2004, 2, 29, 23, 59, 59.999_999_9), 1260, 86_399.999_999_9, 60.999_999_999_998_84),
            (at(2020, 6, 25, 0, 0, 0.0), 2111, 345_600.0, 177.0),
            (at(2100, 3, 1, 0, 0, 0.0), 6269, 86_400.0, 60.0),
        ] {
            let time = GpsTime::from_calendar(&calendar).unwrap();
            assert_eq!((time.week(), time.tow()), (week, tow), "{calendar:?}");
            assert!((time.day_of_year() - day_of_year).abs() < 1e-11, "{calendar:?}");
            assert_eq!(time.calendar(), calendar);
        }
    }

    #[test]
    fn dates_that_do_not_exist_are_refused() {
        for calendar in [
            at(2020, 13, 1, 0, 0, 0.0),
            at(2020, 0, 1, 0, 0, 0.0),
            at(2021, 2, 29, 0, 0, 0.0),
            at(2020, 4, 31, 0, 0, 0.0),
            at(2020, 1, 0, 0, 0, 0.0),
            at(2020, 1, 1, 24, 0, 0.0),
            at(2020, 1, 1, 0, 60, 0.0),
            at(2016, 12, 31, 23, 59, 60.0),
            at(2020, 1, 1, 0, 0, -1.0),
            at(2020, 1, 1, 0, 0, f64::NAN),
            at(i32::MAX, 1, 1, 0, 0, 0.0),
        ] {
            assert_eq!(GpsTime::from_calendar(&calendar), None, "{calendar:?}");
        }
        assert_eq!([79, 80, 99, 0].map(year_from_two_digits), [2079, 1980, 1999, 2000]);
    }

    proptest! {
        #[test]
        fn every_time_comes_back_from_its_calendar(ns: i64) {
            let time = GpsTime::from_nanoseconds(ns);
            prop_assert_eq!(GpsTime::from_calendar(&time.calendar()), Some(time));
        }

        #[test]
        fn days_follow_one_another(days in -700_000_i64..2_000_000) {
            let (year, month, day) = date_of(days);
            prop_assert_eq!(days_since_gps_epoch(year, month, day), days);
            let next = date_of(days + 1);
            let expected = match (month, day) {
                (12, 31) => (year + 1, 1, 1),
                _ if day == days_in_month(year, month) => (year, month + 1, 1),
                _ => (year, month, day + 1),
            };
            prop_assert_eq!(next, expected);
        }
    }
}
