//! Time scales and calendars.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use serde_json::json;
use surefix_core::gnss::time::calendar::year_from_two_digits;
use surefix_core::gnss::time::{Calendar, GpsTime};

fn from_calendar(calendar: Calendar) -> Result<GpsTime, CaseError> {
    GpsTime::from_calendar(&calendar).ok_or_else(|| CaseError::Absurd(format!("no such date: {calendar:?}")))
}

fn calendar([year, month, day, hour, minute, second]: [f64; 6]) -> Calendar {
    let [month, day, hour, minute] = [month, day, hour, minute].map(|field| field as u8);
    Calendar { year: year as i32, month, day, hour, minute, second }
}

/// Calendar on the GPS time scale → weeks and seconds of week of GPS, BeiDou and Galileo, day of year.
pub fn calendar_to_gps(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let time = from_calendar(calendar(inputs.numbers("calendar_gpst")?))?;
    let (bdt_week, bdt_tow) = time.bdt();
    Ok(vec![
        ("week", json!(time.week())),
        ("tow", json!(time.tow())),
        ("doy", json!(time.day_of_year())),
        ("gst_week", json!(time.gst().0)),
        ("bdt_week", json!(bdt_week)),
        ("bdt_tow", json!(bdt_tow)),
    ])
}

/// GPS time → UTC, leap seconds labelled 23:59:60.
pub fn gps_to_utc(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let time = inputs.time()?;
    let Calendar { year, month, day, hour, minute, second } = time.utc();
    Ok(vec![("utc", json!([year, month, day, hour, minute, second])), ("gpst_minus_utc", json!(time.gpst_minus_utc()))])
}

/// GPS time → GLONASS day and second of day.
pub fn glonass_time(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let glonass = inputs.time()?.glonass();
    let (year, month, day) = glonass.date();
    Ok(vec![
        ("moscow_date", json!([year, month, day])),
        ("seconds_of_moscow_day", json!(glonass.seconds)),
        ("N4", json!(glonass.n4)),
        ("NT", json!(glonass.nt)),
    ])
}

/// The epoch of a RINEX observation record, with a year of two or four digits.
pub fn rinex_epoch(_: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let text = inputs.text("text")?;
    let absurd = || CaseError::Absurd(format!("not an epoch: \"{text}\""));
    let fields: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().map_err(|_| absurd())?;
    let mut calendar = calendar(fields.try_into().map_err(|_| absurd())?);
    if calendar.year < 100 {
        calendar.year = year_from_two_digits(calendar.year as u8);
    }
    let time = from_calendar(calendar)?;
    Ok(vec![("week", json!(time.week())), ("tow", json!(time.tow()))])
}
