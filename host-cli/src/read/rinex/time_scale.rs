//! Dates in RINEX records, on the time scale that the file or the constellation uses, as GPS time.

use crate::read::field::{columns, decimal, integer};
use serde::Serialize;
use surefix_core::gnss::time::calendar::year_from_two_digits;
use surefix_core::gnss::time::scales::GPST_MINUS_BDT;
use surefix_core::gnss::time::{Calendar, GpsTime};

/// The time scale that a date is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum TimeScale {
    /// GPS time; also Galileo, QZSS and NavIC time as RINEX has them.
    Gps,
    /// BeiDou time.
    BeiDou,
    /// UTC, which RINEX has for GLONASS.
    Utc,
}

impl TimeScale {
    /// The time of a year in two or four digits, a field of month, day, hour and minute (three columns each) and a field
    /// of seconds. A second of 60, as rounding writers give, is the next minute.
    pub(in crate::read) fn time(self, year: &[u8], month_to_minute: &[u8], seconds: &[u8]) -> Option<GpsTime> {
        let two_digits = year.trim_ascii().len() <= 2;
        let year = integer(year)?;
        let year = if two_digits { year_from_two_digits(u8::try_from(year).ok()?) } else { year };
        let part = |i: usize| integer(columns(month_to_minute, 3 * i, 3 * i + 3)).and_then(|n| u8::try_from(n).ok());
        let date = Calendar { year, month: part(0)?, day: part(1)?, hour: part(2)?, minute: part(3)?, second: 0.0 };
        let minute = match self {
            _ if !(1980..2200).contains(&year) => None,
            Self::Gps => GpsTime::from_calendar(&date),
            Self::BeiDou => GpsTime::from_calendar(&date).map(|time| time.plus_seconds(GPST_MINUS_BDT as f64)),
            Self::Utc => GpsTime::from_utc(&date),
        }?;
        let (mantissa, decimals) = decimal(seconds)?;
        let nanoseconds = mantissa.checked_mul(10_i64.checked_pow(9_u32.checked_sub(decimals)?)?)?;
        let within = (0..61_000_000_000).contains(&nanoseconds);
        within.then(|| GpsTime::from_nanoseconds(minute.nanoseconds() + nanoseconds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_read_on_their_scale() {
        let midnight = GpsTime::from_week_tow(2048, 0.0); // 2019-04-07, the second roll-over of the GPS week
        assert_eq!(TimeScale::Gps.time(b"2019", b" 04 07 00 00", b" 00.0000000"), Some(midnight));
        assert_eq!(TimeScale::Gps.time(b" 19", b"  4  7  0  0", b" 0.0"), Some(midnight));
        assert_eq!(TimeScale::BeiDou.time(b"2019", b" 04 07 00 00", b"00"), Some(midnight.plus_seconds(14.0)));
        assert_eq!(TimeScale::Utc.time(b"2019", b" 04 06 23 59", b" 42.0000000"), Some(midnight));
    }

    #[test]
    fn a_second_of_60_is_the_next_minute_or_a_leap_second() {
        let rounded = TimeScale::Gps.time(b"2019", b" 04 06 23 59", b" 60.0000000");
        assert_eq!(rounded, Some(GpsTime::from_week_tow(2048, 0.0)));
        let before = TimeScale::Utc.time(b"2016", b" 12 31 23 59", b" 59.5").unwrap();
        let leap = TimeScale::Utc.time(b"2016", b" 12 31 23 59", b" 60.5").unwrap();
        let after = TimeScale::Utc.time(b"2017", b" 01 01 00 00", b"  0.5").unwrap();
        assert_eq!((leap.since(before), after.since(leap)), (1.0, 1.0));
    }

    #[test]
    fn the_nanosecond_survives() {
        let time = TimeScale::Gps.time(b"2019", b" 04 07 00 00", b" 12.3456789").unwrap();
        assert_eq!(time.nanoseconds() - GpsTime::from_week_tow(2048, 0.0).nanoseconds(), 12_345_678_900);
    }

    #[test]
    fn what_is_no_date_is_refused() {
        for (year, rest, second) in [
            (&b"2021"[..], &b" 02 29 00 00"[..], &b"0"[..]),
            (b"2021", b" 13 01 00 00", b"0"),
            (b"2021", b" 01 01 24 00", b"0"),
            (b"2021", b" 01 01 00 00", b"61.0"),
            (b"2021", b" 01 01 00 00", b"-1.0"),
            (b"2021", b" 01 01 00   ", b"1.0"),
            (b"1979", b" 01 01 00 00", b"0"),
            (b"-1", b" 01 01 00 00", b"0"),
        ] {
            assert_eq!(TimeScale::Gps.time(year, rest, second), None);
        }
    }
}
