//! Calendar.

use surefix_core::gnss::time::GpsTime;

/// Days from 1970-01-01 to a date of the proleptic Gregorian calendar.
pub fn days_from_civil(year: i64, month: i64, day: i64) -> i64 {
    let y = if month <= 2 { year - 1 } else { year };
    let era = y.div_euclid(400);
    let yoe = y - era * 400;
    let doy = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + yoe * 365 + yoe / 4 - yoe / 100 + doy - 719_468
}

const GPS_EPOCH_DAYS: i64 = 3657;

/// Time of a calendar date and seconds of day on the GPS time scale.
pub fn from_calendar(year: i64, month: i64, day: i64, seconds_of_day: f64) -> GpsTime {
    let days = days_from_civil(year, month, day) - GPS_EPOCH_DAYS;
    GpsTime::from_nanoseconds(days.saturating_mul(86_400_000_000_000)).plus_seconds(seconds_of_day)
}

/// Year, month, day and nanoseconds of day on the GPS time scale.
pub fn calendar(t: GpsTime) -> (i64, i64, i64, i64) {
    let ns = t.nanoseconds();
    let z = ns.div_euclid(86_400_000_000_000) + GPS_EPOCH_DAYS + 719_468;
    let era = z.div_euclid(146_097);
    let doe = z - era * 146_097;
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let day = doy - (153 * mp + 2) / 5 + 1;
    let month = if mp < 10 { mp + 3 } else { mp - 9 };
    (yoe + era * 400 + i64::from(month <= 2), month, day, ns.rem_euclid(86_400_000_000_000))
}

/// GPST of a UTC time that was counted like GPST.
pub fn from_utc(t: GpsTime) -> GpsTime {
    t.plus_seconds(18.0)
}
