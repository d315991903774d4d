//! RINEX 3.04 observation files.
//!
//! IGS/RTCM-SC104, *RINEX 3.04* (2018), tables A2 and A3. Values are written to the format's last decimal: code 1 mm,
//! phase 0.001 cycle, Doppler 0.001 Hz, C/N0 0.001 dB-Hz, time 100 ns. Loss of lock is LLI bit 0, half-cycle ambiguity
//! bit 1. Each declared signal has four columns: code, phase, Doppler, strength.

use super::rinex_header::{first_lines, header_line};
use std::collections::BTreeMap;
use std::io::{self, Write};
use surefix_core::gnss::epoch::{EpochView, Observation};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;

/// What the header says of station and signals.
#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    /// Name of the marker.
    pub marker: String,
    /// Receiver type.
    pub receiver: String,
    /// Antenna type with radome.
    pub antenna: String,
    /// Approximate position of the marker, ECEF `[m]`.
    pub approximate_position: [f64; 3],
    /// Antenna reference point above, east and north of the marker `[m]`.
    pub antenna_delta_hen: [f64; 3],
    /// Interval of the epochs `[s]`.
    pub interval: Option<f64>,
    /// Time of the first epoch.
    pub first_epoch: GpsTime,
    /// The signals that epochs may hold, by [`Constellation::index`].
    pub signals: [Vec<Signal>; 5],
    /// GLONASS frequency channels by slot number.
    pub glonass_channels: BTreeMap<u8, i8>,
}

/// Writes an observation file, epoch by epoch.
pub struct ObservationWriter<W: Write> {
    out: W,
    signals: [Vec<Signal>; 5],
    /// The observations of the current epoch, sorted by satellite.
    sorted: Vec<Observation>,
}

impl<W: Write> ObservationWriter<W> {
    /// Writes the header.
    pub fn new(mut out: W, station: &Station) -> io::Result<Self> {
        write_header(&mut out, station)?;
        Ok(Self { out, signals: station.signals.clone(), sorted: Vec::new() })
    }

    /// Writes an epoch; `power_failure` is epoch flag 1. Fails with [`io::ErrorKind::InvalidInput`] if it holds a signal
    /// that the header does not declare or a value that has no place in its columns.
    pub fn write(&mut self, epoch: EpochView<'_>, power_failure: bool) -> io::Result<()> {
        self.sorted.clear();
        self.sorted.extend_from_slice(epoch.observations);
        self.sorted.sort_by_key(|observation| (observation.satellite, observation.signal));
        let satellites = self.sorted.chunk_by(|a, b| a.satellite == b.satellite).count();
        let (minute, second) = minute_and_second(epoch.time);
        writeln!(self.out, "> {minute} {second:>10}  {}{satellites:>3}", u8::from(power_failure))?;
        let mut line = String::new();
        for observations in self.sorted.chunk_by(|a, b| a.satellite == b.satellite) {
            let Some(first) = observations.first() else { continue };
            let signals = &self.signals[first.satellite.constellation().index()];
            if let Some(other) = observations.iter().find(|observation| !signals.contains(&observation.signal)) {
                let message = format!("signal {} of {} is not in the header", other.signal, other.satellite);
                return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
            }
            line.clear();
            line += &first.satellite.to_string();
            for signal in signals {
                let observation = observations.iter().find(|observation| observation.signal == *signal);
                push_signal(&mut line, observation)?;
            }
            writeln!(self.out, "{}", line.trim_end())?;
        }
        Ok(())
    }

    /// Flushes and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

fn write_header(out: &mut impl Write, station: &Station) -> io::Result<()> {
    let three = |values: [f64; 3]| values.map(|value| format!("{value:14.4}")).concat();
    first_lines(out, "OBSERVATION DATA")?;
    header_line(out, "MARKER NAME", &station.marker)?;
    header_line(out, "OBSERVER / AGENCY", "")?;
    header_line(out, "REC # / TYPE / VERS", &format!("{:20}{:<20.20}", "", station.receiver))?;
    header_line(out, "ANT # / TYPE", &format!("{:20}{:<20.20}", "", station.antenna))?;
    header_line(out, "APPROX POSITION XYZ", &three(station.approximate_position))?;
    header_line(out, "ANTENNA: DELTA H/E/N", &three(station.antenna_delta_hen))?;
    let declared = || Constellation::ALL.into_iter().zip(&station.signals).filter(|(_, signals)| !signals.is_empty());
    for (constellation, signals) in declared() {
        let codes: Vec<String> = signals
            .iter()
            .flat_map(|signal| ["C", "L", "D", "S"].map(|quantity| format!(" {quantity}{signal}")))
            .collect();
        for (i, codes) in codes.chunks(13).enumerate() {
            let start =
                if i == 0 { format!("{}  {:3}", constellation.letter(), 4 * signals.len()) } else { " ".repeat(6) };
            header_line(out, "SYS / # / OBS TYPES", &(start + &codes.concat()))?;
        }
    }
    if let Some(interval) = station.interval {
        header_line(out, "INTERVAL", &format!("{interval:10.3}"))?;
    }
    let first = station.first_epoch.calendar();
    let date = format!("{:6}{:6}{:6}{:6}{:6}", first.year, first.month, first.day, first.hour, first.minute);
    header_line(out, "TIME OF FIRST OBS", &format!("{date}{:13.7}     GPS", first.second))?;
    for (constellation, signals) in declared() {
        for signal in signals {
            header_line(out, "SYS / PHASE SHIFT", &format!("{} L{signal}", constellation.letter()))?;
        }
    }
    if !station.glonass_channels.is_empty() {
        let entries: Vec<String> =
            station.glonass_channels.iter().map(|(slot, channel)| format!("R{slot:02} {channel:2} ")).collect();
        for (i, entries) in entries.chunks(8).enumerate() {
            let start = if i == 0 { format!("{:3} ", station.glonass_channels.len()) } else { " ".repeat(4) };
            header_line(out, "GLONASS SLOT / FRQ #", &(start + &entries.concat()))?;
        }
        header_line(out, "GLONASS COD/PHS/BIS", "")?;
    }
    header_line(out, "SIGNAL STRENGTH UNIT", "DBHZ")?;
    header_line(out, "LEAP SECONDS", &format!("{:6}", station.first_epoch.gpst_minus_utc()))?;
    header_line(out, "END OF HEADER", "")
}

/// Date to the minute, and seconds with seven decimals, of a time rounded to 100 ns.
fn minute_and_second(time: GpsTime) -> (String, String) {
    let rounded = time.nanoseconds().saturating_add(50).div_euclid(100).saturating_mul(100);
    let date = GpsTime::from_nanoseconds(rounded).calendar();
    let in_minute = rounded.rem_euclid(60_000_000_000);
    let minute = format!("{:04} {:02} {:02} {:02} {:02}", date.year, date.month, date.day, date.hour, date.minute);
    (minute, format!("{:2}.{:07}", in_minute / 1_000_000_000, in_minute % 1_000_000_000 / 100))
}

/// Adds the four columns of a signal.
fn push_signal(line: &mut String, observation: Option<&Observation>) -> io::Result<()> {
    let Some(observation) = observation else {
        *line += &" ".repeat(4 * 16);
        return Ok(());
    };
    let lli = u8::from(observation.loss_of_lock) + 2 * u8::from(observation.half_cycle);
    push_value(line, observation.code)?;
    *line += "  ";
    push_value(line, observation.phase)?;
    line.push(if lli == 0 { ' ' } else { char::from(b'0' + lli) });
    line.push(' ');
    push_value(line, observation.doppler)?;
    *line += "  ";
    push_value(line, observation.cn0.map(f64::from))?;
    *line += "  ";
    Ok(())
}

/// Adds a value as F14.3, blank where there is none.
fn push_value(line: &mut String, value: Option<f64>) -> io::Result<()> {
    let text = value.map(|value| format!("{value:14.3}")).unwrap_or_else(|| " ".repeat(14));
    if text.len() != 14 || value.is_some_and(|value| !value.is_finite()) {
        let message = format!("{} has no place in 14 columns", text.trim());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    *line += &text;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::rinex::ObservationReader;
    use proptest::prelude::*;
    use std::io::Cursor;
    use surefix_core::gnss::satellite::SatelliteId;

    fn signals(codes: &[&str]) -> Vec<Signal> {
        codes.iter().map(|code| code.parse().unwrap()).collect()
    }

    fn station() -> Station {
        Station {
            marker: "MÜNCHEN".into(),
            receiver: "SUREFIX SIMULATOR".into(),
            antenna: "NONE            NONE".into(),
            approximate_position: [4_075_580.311_1, 931_854.054_3, 4_801_568.280_8],
            antenna_delta_hen: [0.071, 0.0, -0.002],
            interval: Some(0.2),
            first_epoch: GpsTime::from_week_tow(2111, 345_600.0),
            signals: [
                signals(&["1C", "2W", "2L", "5Q"]),
                signals(&["1C", "5Q"]),
                signals(&["2I"]),
                signals(&[]),
                signals(&["1C"]),
            ],
            glonass_channels: (1..=20).map(|slot| (slot, slot as i8 % 8 - 4)).collect(),
        }
    }

    fn written(epochs: &[(GpsTime, Vec<Observation>)]) -> io::Result<Vec<u8>> {
        let mut writer = ObservationWriter::new(Vec::new(), &station())?;
        for (time, observations) in epochs {
            writer.write(EpochView { time: *time, observations }, false)?;
        }
        writer.finish()
    }

    fn thousandths(range: std::ops::Range<i64>) -> impl Strategy<Value = Option<f64>> {
        proptest::option::of(range.prop_map(|n| n as f64 / 1e3).prop_filter("zero is no value", |&value| value != 0.0))
    }

    /// An observation of any signal that [`station`] declares.
    fn any_observation() -> impl Strategy<Value = Observation> {
        let satellite_and_signal = (0..5_usize, 1..=32_u8, 0..4_usize).prop_filter_map("declared", |(c, number, i)| {
            Some((SatelliteId::new(Constellation::ALL[c], number)?, *station().signals[c].get(i)?))
        });
        let values = (
            thousandths(10_000_000_000..50_000_000_000),
            thousandths(-999_999_999_999..999_999_999_999),
            thousandths(-100_000_000..100_000_000),
            thousandths(1..99_999),
        );
        (satellite_and_signal, values, any::<bool>(), any::<bool>()).prop_map(
            |((satellite, signal), (code, phase, doppler, cn0), loss_of_lock, half_cycle)| Observation {
                satellite,
                signal,
                code,
                phase,
                doppler,
                cn0: cn0.map(|cn0| cn0 as f32),
                loss_of_lock,
                half_cycle,
            },
        )
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            epochs in proptest::collection::vec(
                (1..1_000_000_000_i64, proptest::collection::vec(any_observation(), 0..30)), 1..5)
        ) {
            let mut time = station().first_epoch;
            let epochs: Vec<(GpsTime, Vec<Observation>)> = epochs.into_iter().map(|(step, mut observations)| {
                time = GpsTime::from_nanoseconds(time.nanoseconds() + step * 100);
                observations.sort_by_key(|o| (o.satellite, o.signal));
                observations.dedup_by_key(|o| (o.satellite, o.signal));
                observations.retain(|o| {
                    o.code.is_some() || o.phase.is_some() || o.doppler.is_some() || o.cn0.is_some()
                });
                (time, observations)
            }).collect();
            let mut reader = ObservationReader::new("written", Cursor::new(written(&epochs).unwrap())).unwrap();
            for (time, observations) in epochs {
                let mut epoch = reader.next_epoch().unwrap().unwrap();
                epoch.observations.sort_by_key(|o| (o.satellite, o.signal));
                prop_assert_eq!(epoch.time, time);
                prop_assert_eq!(epoch.observations, observations);
            }
            prop_assert_eq!(reader.next_epoch().unwrap(), None);
            prop_assert!(reader.report().dropped.is_empty(), "{}", reader.report());
        }
    }

    #[test]
    fn the_header_is_read_again() {
        let reader = ObservationReader::new("written", Cursor::new(written(&[]).unwrap())).unwrap();
        let (header, station) = (reader.header(), station());
        assert_eq!(header.marker, "M?NCHEN");
        assert_eq!((&header.receiver, &header.antenna), (&station.receiver, &station.antenna));
        assert_eq!(header.approximate_position, Some(station.approximate_position));
        assert_eq!(header.antenna_delta_hen, station.antenna_delta_hen);
        assert_eq!(header.interval, station.interval);
        assert_eq!(header.glonass_channels, station.glonass_channels);
        assert_eq!(header.leap_seconds, Some(18));
        for constellation in Constellation::ALL {
            assert_eq!(header.signals(constellation), station.signals[constellation.index()]);
        }
    }

    #[test]
    fn what_has_no_place_is_refused() {
        let time = station().first_epoch;
        let satellite = "G05".parse().unwrap();
        let undeclared = Observation { code: Some(2e7), ..Observation::new(satellite, "1W".parse().unwrap()) };
        let signal = "1C".parse().unwrap();
        let too_large = Observation { phase: Some(1e10), ..Observation::new(satellite, signal) };
        let not_a_number = Observation { doppler: Some(f64::NAN), ..Observation::new(satellite, signal) };
        for observation in [undeclared, too_large, not_a_number] {
            let error = written(&[(time, vec![observation])]).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        }
    }
}
