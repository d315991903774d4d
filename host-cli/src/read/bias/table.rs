//! CODE's monthly tables of differential code biases: `P1C1`, `P1P2`, `P2C2`.
//!
//! A line `DIFFERENTIAL (P1-C1) CODE BIASES …` says what is listed, a line of asterisks begins the list: satellite or
//! constellation in columns 0–2, station 6–21, value `[ns]` 26–34. P is the P(Y) code of GPS (`1W`, `2W`) and the P code
//! of GLONASS (`1P`, `2P`), C2 the civil one (`2C`). The tables change slowly and are taken to hold always.

use super::super::field::{columns, real, text};
use super::{BiasData, METRES_PER_NS, ReceiverBias, SatelliteBias, Validity, Who};
use crate::read::ReadError;
use crate::read::lines::Lines;
use crate::read::report::{ReadReport, Reason};
use surefix_core::gnss::bias::{BiasDifference, Observable};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::signal::Signal;

/// Lines in which the heading must come.
const LONGEST_HEADING: u64 = 30;

/// Reads all lines.
pub fn read(lines: &mut Lines, data: &mut BiasData, report: &mut ReadReport) -> Result<(), ReadError> {
    let (mut kind, mut listing) = (None, false);
    while lines.advance(report)? {
        let line = lines.line();
        if let Some(found) = kind_of(line) {
            (kind, listing) = (Some(found), false);
        } else if line.starts_with(b"***") {
            listing = true;
        } else if let Some(kind) = kind.filter(|_| listing && !line.trim_ascii().is_empty()) {
            match record(line, kind, data) {
                Ok(()) => report.records += 1,
                Err(reason) => report.drop_one(reason, lines.number()),
            }
        } else if kind.is_none() && lines.number() > LONGEST_HEADING {
            break;
        }
    }
    if kind.is_none() {
        return Err(ReadError::Header {
            file: lines.file().to_owned(),
            line: 1,
            problem: "this is neither Bias-SINEX nor one of CODE's tables of P1-C1, P1-P2 or P2-C2 biases".to_owned(),
            remedy: "give a .BIA, .BSX or .DCB file",
        });
    }
    Ok(())
}

/// The two codes of a heading.
fn kind_of(line: &[u8]) -> Option<[[u8; 2]; 2]> {
    let rest = line.trim_ascii().strip_prefix(b"DIFFERENTIAL (")?;
    match rest.get(..6)? {
        b"P1-C1)" => Some([*b"P1", *b"C1"]),
        b"P1-P2)" => Some([*b"P1", *b"P2"]),
        b"P2-C2)" => Some([*b"P2", *b"C2"]),
        _ => None,
    }
}

/// What a constellation has under a name of RINEX 2.
fn signal([letter, band]: [u8; 2], constellation: Constellation) -> Option<Signal> {
    let attribute = match (letter, constellation) {
        (b'C', Constellation::Gps | Constellation::Glonass) => b'C',
        (b'P', Constellation::Gps) => b'W',
        (b'P', Constellation::Glonass) => b'P',
        _ => return None,
    };
    Signal::new(band, attribute)
}

fn record(line: &[u8], kind: [[u8; 2]; 2], data: &mut BiasData) -> Result<(), Reason> {
    let who = Who::read(columns(line, 0, 3))?;
    let constellation = who.constellation();
    let [first, second] = kind.map(|code| signal(code, constellation).ok_or(Reason::RecordUnsupported));
    let (first, second) = (first?, second?);
    let value = real(columns(line, 26, 35)).ok_or(Reason::ValueUnreadable)? * METRES_PER_NS;
    let station = text(line, 6, 22);
    match who {
        Who::Satellite(satellite) if station.is_empty() => {
            let difference = BiasDifference { first, second, value };
            data.push(SatelliteBias::Difference(satellite, difference), Validity::ALWAYS);
        }
        Who::Constellation(_) if station.is_empty() => return Err(Reason::RecordUnreadable),
        who => data.receivers.push(ReceiverBias {
            station,
            constellation,
            satellite: if let Who::Satellite(satellite) = who { Some(satellite) } else { None },
            observable: Observable::Code,
            signal: first,
            second: Some(second),
            validity: Validity::ALWAYS,
            value,
        }),
    }
    Ok(())
}
