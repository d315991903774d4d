//! Calendar dates on the time scales of files: GPST, BDT and UTC with its leap seconds.
//!
//! Dates are proleptic Gregorian, counted as in Howard Hinnant, "chrono-compatible low-level date algorithms" (2013).
//! Panic contract: none; dates outside 1980…2199 are refused.

use surefix_core::gnss::time::GpsTime;

/// Nanoseconds in a second.
const NS_PER_S: i64 = 1_000_000_000;
/// Seconds in a day.
const SECONDS_PER_DAY: i64 = 86_400;
/// Days from 1970-01-01 to 1980-01-06.
const GPS_ORIGIN_DAY: i64 = 3_657;
/// GPST − BDT `[s]`, constant (BDS-SIS-ICD B1I 3.0 section 3.3).
pub const GPST_MINUS_BDT_S: i64 = 14;

/// Year and month from whose first day on GPST − UTC has the value `.2` `[s]` (IERS Bulletin C; none since 2017).
const LEAP_SECONDS: [(i64, i64, i64); 18] = [
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

/// The time scale that a date is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum TimeScale {
    /// GPS time; also Galileo, QZSS and NavIC time as RINEX has them.
    Gps,
    /// BeiDou time.
    BeiDou,
    /// UTC, which RINEX has for GLONASS.
    Utc,
}

/// A date and time of day on a time scale that the context says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DateTime {
    /// Year, 1980…2199.
    pub year: i32,
    /// Month, 1…12.
    pub month: i32,
    /// Day of the month, 1…31.
    pub day: i32,
    /// Hour, 0…23.
    pub hour: i32,
    /// Minute, 0…59.
    pub minute: i32,
    /// Nanosecond of the minute; below 60·10⁹ (61·10⁹ in a leap second).
    pub nanosecond: i64,
}

impl DateTime {
    /// This date of `scale` on the GPS time scale; `None` if it is no date of the years 1980…2199.
    pub fn to_gps(self, scale: TimeScale) -> Option<GpsTime> {
        let valid = (1980..2200).contains(&self.year)
            && (1..=12).contains(&self.month)
            && (1..=days_in_month(self.year, self.month)).contains(&self.day)
            && (0..24).contains(&self.hour)
            && (0..60).contains(&self.minute)
            && (0..61 * NS_PER_S).contains(&self.nanosecond);
        if !valid {
            return None;
        }
        let days = day_number(self.year.into(), self.month.into(), self.day.into()) - GPS_ORIGIN_DAY;
        let seconds = days * SECONDS_PER_DAY + i64::from(self.hour * 3600 + self.minute * 60);
        let offset = match scale {
            TimeScale::Gps => 0,
            TimeScale::BeiDou => GPST_MINUS_BDT_S,
            TimeScale::Utc => gpst_minus_utc(days + GPS_ORIGIN_DAY),
        };
        Some(GpsTime::from_nanoseconds((seconds + offset) * NS_PER_S + self.nanosecond))
    }

    /// The date on the GPS time scale.
    pub fn from_gps(time: GpsTime) -> Self {
        let day_ns = SECONDS_PER_DAY * NS_PER_S;
        let (days, of_day) = (time.nanoseconds().div_euclid(day_ns), time.nanoseconds().rem_euclid(day_ns));
        let (year, month, day) = date_of(days + GPS_ORIGIN_DAY);
        let minute_of_day = (of_day / (60 * NS_PER_S)) as i32;
        Self {
            year: year as i32,
            month: month as i32,
            day: day as i32,
            hour: minute_of_day / 60,
            minute: minute_of_day % 60,
            nanosecond: of_day % (60 * NS_PER_S),
        }
    }
}

/// GPST − UTC `[s]` during the UTC day with that number.
fn gpst_minus_utc(day: i64) -> i64 {
    LEAP_SECONDS
        .iter()
        .rev()
        .find(|&&(year, month, _)| day >= day_number(year, month, 1))
        .map_or(0, |&(_, _, seconds)| seconds)
}

/// GPST − UTC `[s]` at a time of the GPS time scale.
pub fn leap_seconds(time: GpsTime) -> i64 {
    let seconds = time.nanoseconds().div_euclid(NS_PER_S);
    let days = |offset: i64| (seconds - offset).div_euclid(SECONDS_PER_DAY) + GPS_ORIGIN_DAY;
    gpst_minus_utc(days(gpst_minus_utc(days(0))))
}

fn days_in_month(year: i32, month: i32) -> i32 {
    match month {
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days since 1970-01-01 (Hinnant's `days_from_civil`).
const fn day_number(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    era * 146_097 + day_of_era - 719_468
}

/// Year, month and day of a day number (Hinnant's `civil_from_days`).
const fn date_of(day_number: i64) -> (i64, i64, i64) {
    let shifted = day_number + 719_468;
    let era = shifted.div_euclid(146_097);
    let day_of_era = shifted.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400;
    (if month <= 2 { year + 1 } else { year }, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(year: i32, month: i32, day: i32, hour: i32, minute: i32, second: i64) -> DateTime {
        DateTime { year, month, day, hour, minute, nanosecond: second * NS_PER_S }
    }

    #[test]
    fn dates_are_those_of_the_gps_calendar() {
        // Week 1024 began on 1999-08-22, week 2048 on 2019-04-07 (IS-GPS-200N 6.2.4 and the published roll-overs).
        assert_eq!(at(1999, 8, 22, 0, 0, 0).to_gps(TimeScale::Gps), Some(GpsTime::from_week_tow(1024, 0.0)));
        assert_eq!(at(2019, 4, 7, 0, 0, 0).to_gps(TimeScale::Gps), Some(GpsTime::from_week_tow(2048, 0.0)));
        // BDT week 0 began on 2006-01-01, GPS week 1356 second 14.
        assert_eq!(at(2006, 1, 1, 0, 0, 0).to_gps(TimeScale::BeiDou), Some(GpsTime::from_week_tow(1356, 14.0)));
    }

    #[test]
    fn leap_seconds_begin_with_their_utc_day() {
        let before = at(2016, 12, 31, 23, 59, 60).to_gps(TimeScale::Utc).unwrap();
        let after = at(2017, 1, 1, 0, 0, 0).to_gps(TimeScale::Utc).unwrap();
        assert_eq!(after.since(before), 1.0);
        assert_eq!((leap_seconds(before), leap_seconds(after)), (17, 18));
    }

    #[test]
    fn every_day_comes_back() {
        for day in 0..80_000 {
            let time = GpsTime::from_nanoseconds((day * SECONDS_PER_DAY + 12_345) * NS_PER_S + 678);
            assert_eq!(DateTime::from_gps(time).to_gps(TimeScale::Gps), Some(time));
        }
    }

    #[test]
    fn what_is_no_date_is_refused() {
        for bad in
            [at(2021, 2, 29, 0, 0, 0), at(2021, 13, 1, 0, 0, 0), at(2021, 1, 1, 24, 0, 0), at(1979, 1, 1, 0, 0, 0)]
        {
            assert_eq!(bad.to_gps(TimeScale::Gps), None);
        }
    }
}
