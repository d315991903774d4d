//! RINEX 3.04 navigation files.
//!
//! IGS/RTCM-SC104, *RINEX 3.04* (2018), tables A5–A14. Numbers have 13 significant digits. Fields that an
//! [`Ephemeris`] does not hold are written as the format asks for unknown ones: IODC repeats IODE, the time of
//! transmission is 0.9999·10⁹ s, GLONASS's frame time is its reference time, spares are blank.

use super::rinex_header::{first_lines, header_line};
use std::io::{self, Write};
use surefix_core::gnss::atmosphere::Klobuchar;
use surefix_core::gnss::ephemeris::{Ephemeris, GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::time::Calendar;

/// Transmission time where it is not known `[s]`.
const UNKNOWN_TIME: f64 = 0.9999e9;

/// Writes a navigation file with `ephemerides` in their order and, by [`Constellation::index`], the broadcast ionosphere.
pub fn write_navigation(
    mut out: impl Write,
    ephemerides: &[Ephemeris],
    klobuchar: &[Option<Klobuchar>; 5],
) -> io::Result<()> {
    first_lines(&mut out, "N: GNSS NAV DATA")?;
    let names = [(Constellation::Gps, "GPS"), (Constellation::BeiDou, "BDS"), (Constellation::Qzss, "QZS")];
    for (constellation, name) in names {
        if let Some(klobuchar) = klobuchar[constellation.index()] {
            for (part, values) in [('A', klobuchar.alpha), ('B', klobuchar.beta)] {
                let values = values.map(|value| exponential(value, 12, 4)).concat();
                header_line(&mut out, "IONOSPHERIC CORR", &format!("{name}{part} {values}"))?;
            }
        }
    }
    if let Some(last) = ephemerides.iter().map(Ephemeris::toe).max() {
        header_line(&mut out, "LEAP SECONDS", &format!("{:6}", last.gpst_minus_utc()))?;
    }
    header_line(&mut out, "END OF HEADER", "")?;
    for ephemeris in ephemerides {
        match ephemeris {
            Ephemeris::Kepler(kepler) => write_kepler(&mut out, kepler)?,
            Ephemeris::Glonass(glonass) => write_glonass(&mut out, glonass)?,
        }
    }
    out.flush()
}

fn write_kepler(out: &mut impl Write, e: &KeplerEphemeris) -> io::Result<()> {
    let constellation = e.satellite.constellation();
    let beidou = constellation == Constellation::BeiDou;
    let (week, toe) = if beidou { e.toe.bdt() } else { (e.toe.week(), e.toe.tow()) };
    // Bits 0, 2, 9: I/NAV of E1 and E5b; 1, 8: F/NAV of E5a.
    let data_source = match e.message {
        NavigationMessage::Inav => Some(517.0),
        NavigationMessage::Fnav => Some(258.0),
        NavigationMessage::Lnav => Some(0.0),
        NavigationMessage::D1D2 => None,
    };
    let l2_p_flag = (e.message == NavigationMessage::Lnav).then_some(0.0);
    let iode = f64::from(e.iode);
    let second_delay = if e.message == NavigationMessage::Lnav { iode } else { e.group_delay[1] };
    let fit_interval = (e.message == NavigationMessage::Lnav).then_some(e.fit_interval);
    let epoch = if beidou { e.toc.plus_seconds(-14.0).calendar() } else { e.toc.calendar() };
    write_record(
        out,
        &e.satellite.to_string(),
        epoch,
        [e.af0, e.af1, e.af2],
        &[
            [Some(iode), Some(e.crs), Some(e.delta_n), Some(e.m0)],
            [Some(e.cuc), Some(e.e), Some(e.cus), Some(e.sqrt_a)],
            [Some(toe), Some(e.cic), Some(e.omega0), Some(e.cis)],
            [Some(e.i0), Some(e.crc), Some(e.omega), Some(e.omega_dot)],
            [Some(e.idot), data_source, Some(f64::from(week)), l2_p_flag],
            [Some(e.accuracy), Some(f64::from(e.health)), Some(e.group_delay[0]), Some(second_delay)],
            [Some(UNKNOWN_TIME), fit_interval, None, None],
        ],
    )
}

fn write_glonass(out: &mut impl Write, e: &GlonassEphemeris) -> io::Result<()> {
    let [x, y, z] = e.position.map(|metres| metres / 1e3);
    let [vx, vy, vz] = e.velocity.map(|metres| metres / 1e3);
    let [ax, ay, az] = e.acceleration.map(|metres| metres / 1e3);
    let frame_time = e.toe.plus_seconds(-(e.toe.gpst_minus_utc() as f64)).tow();
    let first = [e.clock_bias, e.frequency_bias, frame_time];
    write_record(
        out,
        &e.satellite.to_string(),
        e.toe.utc(),
        first,
        &[
            [Some(x), Some(vx), Some(ax), Some(f64::from(e.health))],
            [Some(y), Some(vy), Some(ay), Some(f64::from(e.channel))],
            [Some(z), Some(vz), Some(az), Some(e.age)],
        ],
    )
}

fn write_record(
    out: &mut impl Write,
    satellite: &str,
    epoch: Calendar,
    first: [f64; 3],
    orbit: &[[Option<f64>; 4]],
) -> io::Result<()> {
    let Calendar { year, month, day, hour, minute, second } = epoch;
    let first = first.map(|value| exponential(value, 19, 12)).concat();
    writeln!(out, "{satellite} {year:04} {month:02} {day:02} {hour:02} {minute:02} {second:02.0}{first}")?;
    for values in orbit {
        let values =
            values.map(|value| value.map_or_else(|| " ".repeat(19), |value| exponential(value, 19, 12))).concat();
        writeln!(out, "    {}", values.trim_end())?;
    }
    Ok(())
}

/// A number as FORTRAN's `1P,E{width}.{decimals}`: an exponent of a sign and two digits. What is too small for it, or
/// no number, is 0.
fn exponential(value: f64, width: usize, decimals: usize) -> String {
    let value = if value.is_finite() && value.abs() >= 1e-99 { value.clamp(-9e99, 9e99) } else { 0.0 };
    let text = format!("{value:.decimals$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{:>width$}", format!("{mantissa}E{sign}{:02}", exponent.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::rinex::NavigationData;
    use std::io::Cursor;
    use surefix_core::gnss::time::GpsTime;

    fn kepler(name: &str, message: NavigationMessage, toe: GpsTime) -> Ephemeris {
        let lnav = message == NavigationMessage::Lnav;
        Ephemeris::Kepler(KeplerEphemeris {
            satellite: name.parse().unwrap(),
            message,
            iode: 72,
            toe,
            toc: toe,
            sqrt_a: 5_153.636_609_09,
            e: 0.005_927_642_923_78,
            m0: 1.714_815_412_488,
            delta_n: 4.293_035_965_037e-9,
            i0: 0.971_926_652_417_7,
            idot: -2.610_823_036_973e-10,
            omega0: 2.520_897_825_81,
            omega: 1.273_307_347_665,
            omega_dot: -8.275_344_701_323e-9,
            cuc: -5.291_774_868_965e-6,
            cus: 1.830_980_181_694e-6,
            crc: 353.625,
            crs: -98.218_75,
            cic: 3.352_761_268_616e-8,
            cis: -5.774_199_962_616e-8,
            af0: -0.000_177_423_004_061,
            af1: -1.364_242_052_659e-12,
            af2: 0.0,
            group_delay: [-1.117_587_089_539e-8, if lnav { 0.0 } else { -2.3e-9 }],
            health: 0,
            accuracy: 2.0,
            fit_interval: if lnav { 4.0 } else { 0.0 },
        })
    }

    #[test]
    fn what_is_written_is_read_again() {
        // Near a change of week, where BDT, GPST and UTC are in different weeks.
        let toe = GpsTime::from_week_tow(2320, 0.0);
        let glonass = Ephemeris::Glonass(GlonassEphemeris {
            satellite: "R02".parse().unwrap(),
            iode: 11, // 02:45 in Moscow
            channel: -4,
            toe: toe.plus_seconds(18.0 - 900.0),
            position: [-7_312_858.886_719_000_5, 8_166_229.492_188, 23_080_923.828_13],
            velocity: [-1_848.680_496_216, -2_549.054_145_812_999_6, 310.991_287_231_4],
            acceleration: [1.862_645_149_231e-6, 3.725_290_298_462e-6, 0.0],
            clock_bias: -2.340_786_159_039e-5,
            frequency_bias: 9.094_947_017_729e-13,
            health: 1,
            age: 0.0,
        });
        let mut expected = vec![
            glonass,
            kepler("G05", NavigationMessage::Lnav, toe),
            kepler("E07", NavigationMessage::Inav, toe),
            kepler("E08", NavigationMessage::Fnav, toe),
            kepler("J02", NavigationMessage::Lnav, toe),
            kepler("C09", NavigationMessage::D1D2, toe.plus_seconds(14.0)),
        ];
        expected.sort_by_key(|e| (e.toe(), e.satellite()));
        let klobuchar =
            Klobuchar { alpha: [1.2e-8, -1.49e-8, 0.0, 1.1921e-7], beta: [90_110.0, -65_540.0, 0.0, 4.588e5] };
        let mut out = Vec::new();
        write_navigation(&mut out, &expected, &[Some(klobuchar), None, Some(klobuchar), None, None]).unwrap();
        let data = NavigationData::new("written", Cursor::new(out)).unwrap();
        assert!(data.reports[0].dropped.is_empty(), "{}", data.reports[0]);
        assert_eq!(data.klobuchar, [Some(klobuchar), None, Some(klobuchar), None, None]);
        assert_eq!(data.leap_seconds, Some(18));
        for (expected, read) in expected.iter().zip(&data.ephemerides) {
            if let (Ephemeris::Glonass(expected), Ephemeris::Glonass(read)) = (expected, read) {
                // Kilometres and back round in the last bit.
                let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-15 * a.abs());
                assert!(near(expected.position, read.position) && near(expected.velocity, read.velocity));
                let same = GlonassEphemeris { position: expected.position, velocity: expected.velocity, ..*read };
                assert_eq!(*expected, GlonassEphemeris { acceleration: expected.acceleration, ..same });
            } else {
                assert_eq!(expected, read);
            }
        }
        assert_eq!(expected.len(), data.ephemerides.len());
    }

    #[test]
    fn numbers_have_their_columns() {
        assert_eq!(exponential(-1.5e-11, 19, 12), "-1.500000000000E-11");
        assert_eq!(exponential(0.0, 12, 4), "  0.0000E+00");
        assert_eq!(exponential(1e-300, 12, 4), "  0.0000E+00");
        assert_eq!(exponential(f64::NAN, 12, 4), "  0.0000E+00");
        assert_eq!(exponential(123.0, 12, 4), "  1.2300E+02");
    }
}
