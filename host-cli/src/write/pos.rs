//! RTKLIB-compatible solution file (`.pos`): latitude, longitude, ellipsoidal height.
//!
//! The layout is that of `rnx2rtkp` (RTKLIB 2.4.3 manual, B.1; function `outpos` of `solution.c`): calendar GPST with
//! milliseconds; latitude and longitude `[deg]`; height `[m]`; `Q`; number of satellites; sdn, sde, sdu `[m]` and the
//! co-variances sdne, sdeu, sdun as signed square roots `[m]`; age `[s]`; ratio; velocity north, east, up `[m/s]` with its
//! deviations in the same order.
//!
//! Behind RTKLIB's columns come ours: success rate; HPL and VPL `[m]`; status (1 available, 2 alert, 0 not monitored);
//! heading and its standard deviation `[deg]`; `nan` where there is none. RTKLIB's readers (`decode_solllh` of `solution.c`)
//! take any three numbers behind the ratio for a velocity and up to six behind those for its deviations, and ignore what
//! follows: that is why the velocity is always written.
//!
//! RTKLIB knows no partial fix: [`Quality::Partial`] is written as `Q=1`, as is [`Quality::Fixed`], and the header
//! says so; the CSV keeps them apart. Epochs without a position are not written.

use super::local_vector;
use nalgebra::{Matrix3, Vector3};
use std::io::{self, Write};
use surefix_core::gnss::baseline::Attitude;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::solution::{Quality, Solution};
use surefix_core::gnss::time::{Calendar, GpsTime};
use surefix_core::integrity::protection::{Levels, Status};

/// What the comment lines at the top of the file say.
#[derive(Clone, Debug, Default)]
pub struct Header {
    /// Names of the input files.
    pub inputs: Vec<String>,
    /// First and last rover epoch, if known.
    pub span: Option<(GpsTime, GpsTime)>,
    /// Reference position of the base, ECEF `[m]`.
    pub base: Option<Vector3<f64>>,
    /// Options worth repeating, as name and value.
    pub options: Vec<(String, String)>,
}

/// Writes solutions as they come.
#[derive(Debug)]
pub struct PosWriter<W: Write> {
    out: W,
}

impl<W: Write> PosWriter<W> {
    /// Writes the header.
    pub fn new(mut out: W, header: &Header) -> io::Result<Self> {
        writeln!(out, "% program   : surefix ver.{}", env!("CARGO_PKG_VERSION"))?;
        for input in &header.inputs {
            writeln!(out, "% inp file  : {input}")?;
        }
        if let Some((start, end)) = header.span {
            for (what, t) in [("start", start), ("end  ", end)] {
                let day = calendar_text(t, 1);
                writeln!(out, "% obs {what} : {day} GPST (week{:04} {:8.1}s)", t.week(), t.tow())?;
            }
        }
        for (name, value) in &header.options {
            writeln!(out, "% {name:<10}: {value}")?;
        }
        if let Some(base) = header.base {
            let base = Geodetic::from_ecef(&base);
            let (latitude, longitude) = (base.latitude.to_degrees(), base.longitude.to_degrees());
            writeln!(out, "% ref pos   :{latitude:14.9} {longitude:14.9} {:10.4}", base.height)?;
        }
        writeln!(out, "% note      : Q=1 holds for all ambiguities fixed and for a part of them; the CSV tells which")?;
        writeln!(out, "%")?;
        writeln!(
            out,
            "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)"
        )?;
        writeln!(
            out,
            "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  \
             sdne(m)  sdeu(m)  sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)      sdvn     sdve     sdvu    sdvne    \
             sdveu    sdvun       ps   hpl(m)   vpl(m) status heading(deg) sdheading(deg)"
        )?;
        Ok(Self { out })
    }

    /// Writes one epoch, unless it has no position.
    pub fn push(&mut self, solution: &Solution) -> io::Result<()> {
        let Some(q) = rtklib_quality(solution.quality) else { return Ok(()) };
        let here = Geodetic::from_ecef(&solution.position);
        let [sdn, sde, sdu, sdne, sdeu, sdun] = deviations(&here, &solution.position_covariance);
        write!(
            self.out,
            "{} {:14.9} {:14.9} {:10.4} {q:3} {:3} {sdn:8.4} {sde:8.4} {sdu:8.4} {sdne:8.4} {sdeu:8.4} \
             {sdun:8.4} {:6.2} {:6.1}",
            calendar_text(solution.time, 3),
            here.latitude.to_degrees(),
            here.longitude.to_degrees(),
            here.height,
            solution.satellites_used.len(),
            solution.age,
            solution.ratio.min(999.9),
        )?;
        let v = here.ecef_to_enu(&solution.velocity);
        let [sdn, sde, sdu, sdne, sdeu, sdun] = deviations(&here, &solution.velocity_covariance);
        write!(
            self.out,
            " {:10.5} {:10.5} {:10.5} {sdn:9.5} {sde:8.5} {sdu:8.5} {sdne:8.5} {sdeu:8.5} {sdun:8.5}",
            v.y, v.x, v.z
        )?;
        let [hpl, vpl] =
            solution.protection.map_or([f64::NAN; 2], |levels: Levels| [levels.horizontal, levels.vertical]);
        let status = match solution.integrity {
            Status::Available => 1,
            Status::Alert => 2,
            Status::Unmonitored => 0,
        };
        let attitude = local_vector(solution).and_then(|(vector, covariance)| Attitude::of(&vector, &covariance));
        let [heading, sigma] = attitude.map_or([f64::NAN; 2], |a| [a.heading.to_degrees(), a.sigmas[1].to_degrees()]);
        writeln!(self.out, " {:8.6} {hpl:8.4} {vpl:8.4} {status:6} {heading:12.5} {sigma:14.5}", solution.success_rate)
    }

    /// Flushes and hands back the sink.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// `Q` as RTKLIB writes it; `None` where there is no position.
fn rtklib_quality(quality: Quality) -> Option<u8> {
    match quality {
        Quality::Fixed | Quality::Partial => Some(1),
        Quality::Float => Some(2),
        Quality::Code => Some(5),
        Quality::None => None,
    }
}

/// n, e, u standard deviations, then ne, eu, un co-variances as signed square roots, of an ECEF covariance.
fn deviations(here: &Geodetic, covariance: &Matrix3<f64>) -> [f64; 6] {
    let enu = here.covariance_to_enu(covariance);
    let signed_root = |x: f64| x.signum() * x.abs().sqrt();
    [enu[(1, 1)], enu[(0, 0)], enu[(2, 2)], enu[(1, 0)], enu[(0, 2)], enu[(2, 1)]].map(signed_root)
}

/// `2018/10/09 12:22:11.000` with `decimals` digits of the second (at most 9), rounded as a whole so that no second
/// reads 60.
fn calendar_text(t: GpsTime, decimals: u32) -> String {
    let unit = 10_i64.pow(9 - decimals.min(9));
    let rounded = (t.nanoseconds().saturating_add(unit / 2)).div_euclid(unit).saturating_mul(unit);
    let rounded = GpsTime::from_nanoseconds(rounded);
    let Calendar { year, month, day, hour, minute, second } = rounded.calendar();
    let decimals = decimals.min(9) as usize;
    let width = decimals + 3;
    format!("{year:04}/{month:02}/{day:02} {hour:02}:{minute:02}:{second:0width$.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::satellite::{Constellation, SatelliteId};
    use surefix_core::gnss::solution::Reason;

    /// The solution behind the first line of the `rover_rtk.pos` that RTKLIB 2.4.3 b34 wrote for the Nagoya data.
    fn nagoya() -> Solution {
        let latitude = 35.134_699_011_f64.to_radians();
        let longitude = 136.977_575_483_f64.to_radians();
        let here = Geodetic { latitude, longitude, height: 104.8619 };
        let square = |x: f64| x.signum() * x * x;
        let [ne, eu, un] = [0.0008, -0.0013, -0.0024].map(square);
        let enu = Matrix3::new(square(0.0024), ne, eu, ne, square(0.0024), un, eu, un, square(0.0069));
        let mut solution = Solution::none(GpsTime::from_week_tow(2320, 116_400.0), Reason::Complete);
        solution.quality = Quality::Fixed;
        solution.position = here.to_ecef();
        solution.position_covariance = here.covariance_to_ecef(&enu);
        solution.velocity = here.enu_to_ecef(&Vector3::new(-0.00126, 0.00141, -0.01073));
        solution.velocity_covariance = 0.05834_f64.powi(2) * Matrix3::identity();
        solution.ratio = 12.0;
        solution.satellites_used = (1..=42).filter_map(|n| SatelliteId::new(Constellation::Gps, n)).collect();
        solution
    }

    fn written(header: &Header, solutions: &[Solution]) -> String {
        let mut writer = PosWriter::new(Vec::new(), header).unwrap();
        for solution in solutions {
            writer.push(solution).unwrap();
        }
        String::from_utf8(writer.finish().unwrap()).unwrap()
    }

    #[test]
    fn a_line_is_rtklibs_to_the_byte() {
        let text = written(&Header::default(), &[nagoya()]);
        // From rover_rtk.pos, its velocity columns cut off.
        let expected = "2024/06/24 08:20:00.000   35.134699011  136.977575483   104.8619   1  42   0.0024   0.0024   \
                        0.0069   0.0008  -0.0013  -0.0024   0.00   12.0";
        assert!(text.lines().last().unwrap().starts_with(&format!("{expected} ")), "{text}");
        let columns = "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   \
                       sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio";
        assert!(text.lines().any(|line| line.starts_with(&format!("{columns} "))));
    }

    #[test]
    fn velocity_is_north_east_up() {
        let text = written(&Header::default(), &[nagoya()]);
        let line = text.lines().last().unwrap();
        assert!(line.contains("   12.0    0.00141   -0.00126   -0.01073   0.05834  0.05834  0.05834"), "{line}");
    }

    /// Behind RTKLIB's thirteen columns and nine of the velocity there are ours, and our reader finds them.
    #[test]
    fn integrity_and_heading_are_behind_what_rtklib_reads() {
        let mut solution = nagoya();
        solution.success_rate = 0.9995;
        solution.protection = Some(Levels { horizontal: 0.0123, vertical: 0.0456 });
        solution.integrity = Status::Available;
        let here = Geodetic::from_ecef(&solution.position);
        // 3 m east and 4 m north of its base: atan2(3, 4).
        solution.base = Some(solution.position - here.enu_to_ecef(&Vector3::new(3.0, 4.0, 0.0)));
        let text =
            written(&Header::default(), &[solution, Solution { time: solution.time.plus_seconds(1.0), ..nagoya() }]);
        let rows: Vec<Vec<&str>> =
            text.lines().filter(|line| !line.starts_with('%')).map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(rows[0].len(), 2 + 13 + 9 + 6, "{text}");
        let [ours, none] = [&rows[0], &rows[1]].map(|row| &row[row.len() - 6..]);
        assert_eq!(&ours[..4], ["0.999500", "0.0123", "0.0456", "1"]);
        let heading: f64 = ours[4].parse().unwrap();
        assert!((heading - 36.869_90).abs() < 1e-3, "{heading}");
        assert_eq!(none, ["0.000000", "NaN", "NaN", "0", "NaN", "NaN"]);
        let track = crate::read::solution::parse("a.pos", &text, &Default::default()).unwrap();
        assert_eq!(
            track.points.iter().map(|point| point.protection).collect::<Vec<_>>(),
            [Some([0.0123, 0.0456]), None]
        );
        assert!(track.points.iter().all(|point| point.velocity.is_some()));
    }

    #[test]
    fn qualities_map_and_none_is_left_out() {
        let with = |quality| Solution { quality, ..nagoya() };
        let all = [Quality::Fixed, Quality::Partial, Quality::Float, Quality::Code, Quality::None].map(with);
        let text = written(&Header::default(), &all);
        let q: Vec<&str> = text
            .lines()
            .filter(|line| !line.starts_with('%'))
            .filter_map(|line| line.split_whitespace().nth(5))
            .collect();
        assert_eq!(q, ["1", "1", "2", "5"]);
    }

    #[test]
    fn a_second_never_reads_sixty() {
        let t = GpsTime::from_week_tow(2320, 116_399.999_6);
        assert_eq!(calendar_text(t, 3), "2024/06/24 08:20:00.000");
        assert_eq!(calendar_text(t, 1), "2024/06/24 08:20:00.0");
    }
}
