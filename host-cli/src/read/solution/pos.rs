//! RTKLIB's `.pos` in its variants (RTKLIB 2.4.3 manual, B.1): calendar or week and seconds; GPST, UTC or JST;
//! latitude and longitude in degrees or in degrees, minutes, seconds; ECEF; east-north-up baseline; any separator.
//!
//! The comment line that names the columns says which. Without one, three numbers beyond ±100 km are ECEF, others
//! latitude, longitude and height, and the time is GPST. Standard deviations that read 0.0000 are taken as 0.00005 m,
//! half of the last digit: the file cannot mean zero. Protection levels are read where our writer put them
//! ([`crate::write::pos`]).

use super::{HeaderProblem, Options, Track, TrackPoint, from_degrees, number, symmetric};
use nalgebra::{Matrix3, Vector3};
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::solution::Quality;
use surefix_core::gnss::time::{Calendar, GpsTime};

/// Half of the last printed digit of a standard deviation `[m]`.
const HALF_DIGIT_M: f64 = 0.000_05;

/// What the position columns hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Coordinates {
    Degrees,
    DegreesMinutesSeconds,
    Ecef,
    Baseline,
}

/// The time scale of the time columns.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    Gpst,
    Utc,
    /// Japan Standard Time, UTC + 9 h.
    Jst,
}

impl Scale {
    /// GPST of a date on this scale.
    fn gpst(self, date: &Calendar) -> Option<GpsTime> {
        match self {
            Self::Gpst => GpsTime::from_calendar(date),
            Self::Utc => GpsTime::from_utc(date),
            Self::Jst => GpsTime::from_utc(date).map(|time| time.plus_seconds(-32_400.0)),
        }
    }
}

/// Reads all rows.
pub(super) fn parse(text: &str, options: &Options) -> Result<Track, HeaderProblem> {
    let (mut coordinates, mut scale, mut bounded) = (None, Scale::Gpst, false);
    let mut track = Track::default();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.starts_with(['%', '#']) {
            if line.contains("WGS84/geodetic") {
                let remedy = "write the solution with ellipsoidal heights (out-height = ellipsoidal)";
                return Err((index + 1, "heights are above a geoid".into(), remedy));
            }
            let header = columns_of_header(line);
            if header == Some(Coordinates::Baseline) && options.base.is_none() {
                let remedy = "give the base coordinate (--base-xyz)";
                return Err((index + 1, "positions are baselines".into(), remedy));
            }
            if header.is_some() {
                coordinates = header;
                scale = time_scale(line);
                bounded = line.contains("hpl(m)");
            }
            continue;
        }
        if line.is_empty() {
            continue;
        }
        match row(line, coordinates, scale, options) {
            Some((mut point, quality)) => {
                if bounded {
                    point.protection = protection(line);
                }
                track.count(point.time);
                if options.only_quality.as_deref().is_none_or(|only| only == quality) {
                    track.points.push(point);
                }
            }
            None => track.reject(index + 1),
        }
    }
    Ok(track)
}

/// The coordinates that a comment line announces, if it is the one that names the columns.
fn columns_of_header(line: &str) -> Option<Coordinates> {
    if line.contains("x-ecef(m)") {
        Some(Coordinates::Ecef)
    } else if line.contains("e-baseline(m)") {
        Some(Coordinates::Baseline)
    } else if line.contains("latitude(deg)") {
        Some(Coordinates::Degrees)
    } else if line.contains("latitude(d'\")") {
        Some(Coordinates::DegreesMinutesSeconds)
    } else {
        None
    }
}

fn time_scale(line: &str) -> Scale {
    match line.trim_start_matches(['%', '#']).split_whitespace().next() {
        Some("UTC") => Scale::Utc,
        Some("JST") => Scale::Jst,
        _ => Scale::Gpst,
    }
}

/// A row as a point, and its quality as the file has it.
fn row<'a>(
    line: &'a str,
    coordinates: Option<Coordinates>,
    scale: Scale,
    options: &Options,
) -> Option<(TrackPoint, &'a str)> {
    let mut fields = line.split([' ', '\t', ',', ';']).filter(|field| !field.is_empty());
    let time = time(fields.next()?, fields.next()?, scale)?;
    let rest: Vec<&str> = fields.collect();
    let values = |at: usize| -> Option<[f64; 3]> {
        Some([number(rest.get(at)?)?, number(rest.get(at + 1)?)?, number(rest.get(at + 2)?)?])
    };
    let first = values(0)?;
    let coordinates = coordinates.unwrap_or_else(|| {
        let far = first.iter().any(|value| value.abs() > 1e5);
        if far { Coordinates::Ecef } else { Coordinates::Degrees }
    });
    let (position, after) = match coordinates {
        Coordinates::Ecef => (Vector3::from(first), 3),
        Coordinates::Degrees => (from_degrees(first)?, 3),
        Coordinates::DegreesMinutesSeconds => {
            let longitude = values(3)?;
            (from_degrees([sexagesimal(rest[0], first)?, sexagesimal(rest[3], longitude)?, number(rest.get(6)?)?])?, 7)
        }
        Coordinates::Baseline => {
            let base = options.base?;
            (base + Geodetic::from_ecef(&base).enu_to_ecef(&Vector3::from(first)), 3)
        }
    };
    let quality_text = rest.get(after).copied().unwrap_or("");
    let frame = local_frame(coordinates, &position, options);
    let covariance = values(after + 2).zip(values(after + 5)).map(|(sd, mixed)| {
        let variances = sd.map(|value| value.abs().max(HALF_DIGIT_M).powi(2));
        let local = symmetric(variances, mixed.map(|root| root.signum() * root * root));
        frame.transpose() * local * frame
    });
    let velocity = values(after + 10).map(|velocity| frame.transpose() * Vector3::from(velocity));
    let quality = quality(quality_text)?;
    Some((TrackPoint { time, position, covariance, velocity, quality, protection: None }, quality_text))
}

/// HPL and VPL: the fifth and fourth column from the end.
fn protection(line: &str) -> Option<[f64; 2]> {
    let mut fields = line.split_whitespace().rev().skip(3);
    let vpl = number(fields.next()?)?;
    Some([number(fields.next()?)?, vpl])
}

/// Rotation from ECEF to the axes that deviations and velocities of the file are along: x, y, z; north, east, up; or
/// east, north, up of the base.
fn local_frame(coordinates: Coordinates, position: &Vector3<f64>, options: &Options) -> Matrix3<f64> {
    match coordinates {
        Coordinates::Ecef => Matrix3::identity(),
        Coordinates::Degrees | Coordinates::DegreesMinutesSeconds => {
            let mut rotation = Geodetic::from_ecef(position).enu_rotation();
            rotation.swap_rows(0, 1);
            rotation
        }
        Coordinates::Baseline => Geodetic::from_ecef(&options.base.unwrap_or(*position)).enu_rotation(),
    }
}

/// Degrees from degrees, minutes and seconds; the sign is that of the degrees' text (`-0 30 0` is −0.5°).
fn sexagesimal(text: &str, [degrees, minutes, seconds]: [f64; 3]) -> Option<f64> {
    let valid = (0.0..60.0).contains(&minutes) && (0.0..=60.0).contains(&seconds);
    let size = degrees.abs() + minutes / 60.0 + seconds / 3600.0;
    valid.then_some(if text.starts_with('-') { -size } else { size })
}

/// Time from `2018/10/09 12:22:11.000` or `2022 217331.000`.
fn time(first: &str, second: &str, scale: Scale) -> Option<GpsTime> {
    let date = if first.contains('/') {
        let (mut date, mut clock) = (first.split('/'), second.split(':'));
        Calendar {
            year: date.next()?.parse().ok()?,
            month: date.next()?.parse().ok()?,
            day: date.next()?.parse().ok()?,
            hour: clock.next()?.parse().ok()?,
            minute: clock.next()?.parse().ok()?,
            second: number(clock.next()?)?,
        }
    } else {
        // Weeks and seconds count on their scale as dates do.
        let week = first.parse().ok().filter(|week| (0..10_000).contains(week))?;
        GpsTime::from_week_tow(week, number(second)?).calendar()
    };
    scale.gpst(&date)
}

/// Grade from RTKLIB's `Q`: 1 fix, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP; none given counts as fixed.
fn quality(text: &str) -> Option<Quality> {
    match text {
        "" | "1" => Some(Quality::Fixed),
        "2" | "6" => Some(Quality::Float),
        "3" | "4" | "5" => Some(Quality::Code),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse as read;
    use super::*;

    const LLH: &str = "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   \
                       sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n";
    // The stated rover coordinate of the Nagoya data, in both forms.
    const NAGOYA_ECEF: [f64; 3] = [-3_817_681.380_7, 3_562_839.978_5, 3_650_158.376];

    fn only_point(text: &str, options: &Options) -> TrackPoint {
        read("test", text, options).unwrap().points[0]
    }

    fn near(point: &TrackPoint) -> bool {
        (point.position - Vector3::from(NAGOYA_ECEF)).norm() < 2e-3 // lat/lon have 1 nm·1e-9° = 0.1 mm digits
    }

    #[test]
    fn coordinates_in_four_forms() {
        let tail = "104.8626   1  42   0.0024   0.0020   0.0069   0.0008  -0.0013  -0.0024   0.00   12.0\n";
        let degrees = format!("{LLH}2024/06/24 08:20:00.000   35.134699010  136.977575490   {tail}");
        let point = only_point(&degrees, &Options::default());
        assert!(near(&point), "{point:?}");
        assert_eq!((point.time, point.quality), (GpsTime::from_week_tow(2320, 116_400.0), Quality::Fixed));
        let enu = Geodetic::from_ecef(&point.position).covariance_to_enu(&point.covariance.unwrap());
        for (at, expected) in [
            ((0, 0), 0.0020_f64),
            ((1, 1), 0.0024),
            ((2, 2), 0.0069),
            ((0, 1), 0.0008),
            ((0, 2), -0.0013),
            ((1, 2), -0.0024),
        ] {
            assert!((enu[at] - expected * expected.abs()).abs() < 1e-12, "{at:?}");
        }

        // 35.134699010° = 35° 08′ 04.916436″, 136.977575490° = 136° 58′ 39.271764″
        let dms = "%  GPST   latitude(d'\") longitude(d'\") height(m)\n2320 116400.000 35 08 04.916436 136 58 39.271764 104.8626 2 9";
        let point = only_point(dms, &Options::default());
        assert!(near(&point) && point.quality == Quality::Float && point.covariance.is_none());

        let [x, y, z] = NAGOYA_ECEF;
        assert!(near(&only_point(&format!("2320 116400 {x} {y} {z} 5"), &Options::default())));

        let base = Vector3::new(-3_817_681.121_3, 3_562_839.431_1, 3_650_159.159_3);
        let enu = Geodetic::from_ecef(&base).ecef_to_enu(&(Vector3::from(NAGOYA_ECEF) - base));
        let text =
            format!("% GPST e-baseline(m) n-baseline(m) u-baseline(m)\n2320,116400,{},{},{},1,9", enu.x, enu.y, enu.z);
        assert!(near(&only_point(&text, &Options { base: Some(base), ..Options::default() })));
        assert!(read("test", &text, &Options::default()).unwrap_err().to_string().contains("--base-xyz"));
    }

    #[test]
    fn utc_and_jst_are_turned_into_gpst() {
        // GPST − UTC was 18 s in June 2024 (IERS Bulletin C 52…69).
        let at = |name: &str, clock: &str| {
            let text = format!("% {name} latitude(deg) longitude(deg) height(m)\n2024/06/24 {clock} 35 136 104 1 9");
            only_point(&text, &Options::default()).time
        };
        assert_eq!(at("UTC", "08:19:42.000"), GpsTime::from_week_tow(2320, 116_400.0));
        assert_eq!(at("JST", "17:19:42.000"), GpsTime::from_week_tow(2320, 116_400.0));
    }

    #[test]
    fn a_printed_zero_deviation_is_half_a_digit() {
        let text = format!("{LLH}2320 116400 35.0 136.0 104.0 1 9 0 0 0 0 0 0 0 12");
        let covariance = only_point(&text, &Options::default()).covariance.unwrap();
        assert!((covariance.trace() - 3.0 * 2.5e-9).abs() < 1e-20);
    }

    #[test]
    fn bad_rows_are_counted_with_the_first_line() {
        let text =
            format!("{LLH}2320 1 35 136 104 1\nrubbish\n2320 2 95 136 104 1\n2320 3 35 136\n2320 4 35 136 nan 1\n");
        let track = read("test", &text, &Options::default()).unwrap();
        assert_eq!((track.points.len(), track.unreadable, track.first_unreadable), (1, 4, Some(3)));
        let message = read("a.pos", "rubbish\n", &Options::default()).unwrap_err().to_string();
        assert!(message.contains("a.pos") && message.contains("first at line 1"), "{message}");
        assert!(read("a.pos", "% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n", &Options::default()).is_err());
    }
}
