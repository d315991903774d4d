//! Bias-SINEX 1.00: `OSB` and `DSB` records of satellites and receivers.
//!
//! Columns (from 0): type 1–4, satellite 11–13, station 15–23, signals 25–28 and 30–33, validity 35–48 and 50–63, unit
//! 65–68, value 70–90, slope 104–124. `ISB` records, and records with a slope, are not used and counted.

use super::super::field::{columns, integer, scientific, text};
use super::{BiasData, METRES_PER_NS, ReceiverBias, SatelliteBias, Validity, Who};
use crate::read::ReadError;
use crate::read::lines::Lines;
use crate::read::report::{ReadReport, Reason};
use surefix_core::gnss::bias::{AbsoluteBias, BiasDifference, BiasKey, Observable};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::calendar::year_from_two_digits;
use surefix_core::gnss::time::{Calendar, GpsTime};

/// Reads the lines after the first.
pub fn read(lines: &mut Lines, data: &mut BiasData, report: &mut ReadReport) -> Result<(), ReadError> {
    let (mut block, mut utc, mut ended) = (String::new(), false, false);
    while lines.advance(report)? {
        let line = lines.line();
        match line.first() {
            None | Some(b'*') => {}
            Some(b'+') => block = text(line, 1, line.len()),
            Some(b'-') if text(line, 1, line.len()) == block => block.clear(),
            Some(b'%') => ended = true,
            _ if block == "BIAS/DESCRIPTION" => describe(line, data, &mut utc),
            _ if block == "BIAS/SOLUTION" => match record(line, utc, data) {
                Ok(()) => report.records += 1,
                Err(reason) => report.drop_one(reason, lines.number()),
            },
            _ => {}
        }
    }
    if !ended {
        report.drop_one(Reason::Truncated, lines.number());
    }
    Ok(())
}

/// A line of the description: keyword in columns 1–39, values after it.
fn describe(line: &[u8], data: &mut BiasData, utc: &mut bool) {
    let value = text(line, 41, line.len());
    match text(line, 1, 40).as_str() {
        "TIME_SYSTEM" => *utc = value == "UTC" || value == "R",
        "SATELLITE_CLOCK_REFERENCE_OBSERVABLES" => {
            let mut words = value.split_whitespace();
            let constellation = words.next().and_then(|word| Constellation::from_letter(word.chars().next()?));
            let mut code = || words.next()?.strip_prefix('C')?.parse::<Signal>().ok();
            if let (Some(constellation), Some(first), Some(second)) = (constellation, code(), code()) {
                data.references.insert(constellation, [first, second]);
            }
        }
        _ => {}
    }
}

fn record(line: &[u8], utc: bool, data: &mut BiasData) -> Result<(), Reason> {
    let absolute = match text(line, 1, 5).as_str() {
        "OSB" => true,
        "DSB" => false,
        "ISB" => return Err(Reason::RecordUnsupported),
        _ => return Err(Reason::RecordUnreadable),
    };
    let who = Who::read(columns(line, 11, 14))?;
    let (observable, signal) = signal_of(columns(line, 25, 29)).ok_or(Reason::RecordUnreadable)?;
    let second = match absolute {
        true => None,
        false => Some(signal_of(columns(line, 30, 34)).ok_or(Reason::RecordUnreadable)?),
    };
    let from = time(columns(line, 35, 49), utc, Validity::ALWAYS.from).ok_or(Reason::RecordUnreadable)?;
    let until = time(columns(line, 50, 64), utc, Validity::ALWAYS.until).ok_or(Reason::RecordUnreadable)?;
    let validity = Validity { from, until };
    if from > until {
        return Err(Reason::RecordUnreadable);
    }
    let metres = match text(line, 65, 69).as_str() {
        "ns" => METRES_PER_NS,
        "cyc" if absolute => signal.wavelength(who.constellation(), None).ok_or(Reason::RecordUnsupported)?,
        _ => return Err(Reason::RecordUnsupported),
    };
    let value = scientific(columns(line, 70, 91)).ok_or(Reason::ValueUnreadable)? * metres;
    if scientific(columns(line, 104, 125)).is_some_and(|slope| slope != 0.0) {
        return Err(Reason::RecordUnsupported);
    }
    if second.is_some_and(|(other, _)| other != observable) {
        return Err(Reason::RecordUnsupported);
    }
    let second = second.map(|(_, second)| second);

    let station = text(line, 15, 24);
    match who {
        Who::Satellite(satellite) if station.is_empty() => match second {
            None => {
                let key = BiasKey { satellite, observable, signal };
                data.push(SatelliteBias::Absolute(AbsoluteBias { key, value }), validity);
            }
            Some(second) if observable == Observable::Code => {
                let difference = BiasDifference { first: signal, second, value };
                data.push(SatelliteBias::Difference(satellite, difference), validity);
            }
            Some(_) => return Err(Reason::RecordUnsupported),
        },
        Who::Constellation(_) if station.is_empty() => return Err(Reason::RecordUnreadable),
        who => {
            let constellation = who.constellation();
            let satellite = if let Who::Satellite(satellite) = who { Some(satellite) } else { None };
            data.receivers.push(ReceiverBias {
                station,
                constellation,
                satellite,
                observable,
                signal,
                second,
                validity,
                value,
            });
        }
    }
    Ok(())
}

/// `C1C`, `L5Q`.
fn signal_of(code: &[u8]) -> Option<(Observable, Signal)> {
    let [kind, band, attribute] = *code.trim_ascii() else { return None };
    let observable = match kind {
        b'C' => Observable::Code,
        b'L' => Observable::Phase,
        _ => return None,
    };
    Some((observable, Signal::new(band, attribute)?))
}

/// `2019:087:00000`, also with a year of two digits; all zeros are `open`.
fn time(field: &[u8], utc: bool, open: GpsTime) -> Option<GpsTime> {
    let mut parts = field.trim_ascii().split(|&byte| byte == b':');
    let (year, day, second) = (parts.next()?, parts.next()?, parts.next()?);
    let two_digits = year.len() <= 2;
    let (year, day, second) = (integer(year)?, integer(day)?, integer(second)?);
    if (year, day, second) == (0, 0, 0) {
        return Some(open);
    }
    let year = if two_digits { year_from_two_digits(u8::try_from(year).ok()?) } else { year };
    let exists = (1980..2200).contains(&year) && (1..=366).contains(&day) && (0..=86_400).contains(&second);
    let new_year = Calendar::date(year, 1, 1);
    let new_year = if utc { GpsTime::from_utc(&new_year) } else { GpsTime::from_calendar(&new_year) };
    new_year.filter(|_| exists).map(|time| time.plus_seconds(f64::from(day - 1) * 86_400.0 + f64::from(second)))
}
