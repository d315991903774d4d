//! Solutions as a table: one header row, one row per epoch, every field of [`Solution`].
//!
//! Numbers are written with all their digits, so that reading them back gives the same `f64`. Lists of satellites are
//! separated by spaces. Units are the end of a column's name. Epochs without a position are written too, with their
//! reason. Protection levels are empty where nothing bounds a position; vectors (`dx`… ECEF, `de`… at the base) and
//! attitude are those of a moving base.

use super::local_vector;
use nalgebra::Matrix3;
use serde::Serialize;
use std::io::{self, Write};
use surefix_core::gnss::baseline::Attitude;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::satellite::SatelliteSet;
use surefix_core::gnss::solution::{Quality, Reason, Solution};
use surefix_core::integrity::protection::Status;

/// Writes solutions as they come.
pub struct CsvWriter<W: Write> {
    out: ::csv::Writer<W>,
}

impl<W: Write> CsvWriter<W> {
    /// A table on `out`; the header row comes with the first solution.
    pub fn new(out: W) -> Self {
        Self { out: ::csv::Writer::from_writer(out) }
    }

    /// Writes one epoch.
    pub fn push(&mut self, solution: &Solution) -> io::Result<()> {
        self.out.serialize(Row::from(solution)).map_err(|error| match error.into_kind() {
            // The error of the sink as it is: its kind matters, a closed pipe is no failure.
            ::csv::ErrorKind::Io(error) => error,
            other => io::Error::other(format!("{other:?}")),
        })
    }

    /// Flushes and hands back the sink.
    pub fn finish(self) -> io::Result<W> {
        self.out.into_inner().map_err(|error| error.into_error())
    }
}

/// A row, its fields in the order of the columns.
#[derive(Serialize)]
struct Row {
    gps_week: i32,
    gps_tow_s: f64,
    quality: Quality,
    reason: Reason,
    x_m: f64,
    y_m: f64,
    z_m: f64,
    latitude_deg: Option<f64>,
    longitude_deg: Option<f64>,
    height_m: Option<f64>,
    cov_xx_m2: f64,
    cov_xy_m2: f64,
    cov_xz_m2: f64,
    cov_yy_m2: f64,
    cov_yz_m2: f64,
    cov_zz_m2: f64,
    sd_e_m: f64,
    sd_n_m: f64,
    sd_u_m: f64,
    cov_en_m2: f64,
    cov_eu_m2: f64,
    cov_nu_m2: f64,
    vx_m_s: f64,
    vy_m_s: f64,
    vz_m_s: f64,
    cov_vxx_m2_s2: f64,
    cov_vxy_m2_s2: f64,
    cov_vxz_m2_s2: f64,
    cov_vyy_m2_s2: f64,
    cov_vyz_m2_s2: f64,
    cov_vzz_m2_s2: f64,
    ve_m_s: f64,
    vn_m_s: f64,
    vu_m_s: f64,
    sd_ve_m_s: f64,
    sd_vn_m_s: f64,
    sd_vu_m_s: f64,
    ambiguities_fixed: u8,
    ambiguities: u8,
    ratio: f64,
    success_rate: f64,
    age_s: f64,
    satellites: usize,
    satellites_used: String,
    satellites_rejected: String,
    satellites_slipped: String,
    hpl_m: Option<f64>,
    vpl_m: Option<f64>,
    integrity: Status,
    base_x_m: Option<f64>,
    base_y_m: Option<f64>,
    base_z_m: Option<f64>,
    dx_m: Option<f64>,
    dy_m: Option<f64>,
    dz_m: Option<f64>,
    de_m: Option<f64>,
    dn_m: Option<f64>,
    du_m: Option<f64>,
    length_m: Option<f64>,
    sd_length_m: Option<f64>,
    heading_deg: Option<f64>,
    sd_heading_deg: Option<f64>,
    pitch_deg: Option<f64>,
    sd_pitch_deg: Option<f64>,
}

impl From<&Solution> for Row {
    fn from(s: &Solution) -> Self {
        let geodetic = (s.quality != Quality::None).then(|| Geodetic::from_ecef(&s.position));
        let to_enu = geodetic.map_or_else(Matrix3::zeros, |here| here.enu_rotation());
        let (p, pv) = (&s.position_covariance, &s.velocity_covariance);
        let (enu, venu) = (to_enu * p * to_enu.transpose(), to_enu * pv * to_enu.transpose());
        let v = to_enu * s.velocity;
        let vector = s.base.map(|base| s.position - base);
        let local = local_vector(s);
        let attitude = local.and_then(|(local, covariance)| Attitude::of(&local, &covariance));
        let local = local.map(|(local, _)| local);
        let sigma = |i: usize| attitude.map(|attitude| attitude.sigmas[i]);
        let deviation = |m: &Matrix3<f64>, i: usize| m[(i, i)].max(0.0).sqrt();
        Self {
            gps_week: s.time.week(),
            gps_tow_s: s.time.tow(),
            quality: s.quality,
            reason: s.reason,
            x_m: s.position.x,
            y_m: s.position.y,
            z_m: s.position.z,
            latitude_deg: geodetic.map(|here| here.latitude.to_degrees()),
            longitude_deg: geodetic.map(|here| here.longitude.to_degrees()),
            height_m: geodetic.map(|here| here.height),
            cov_xx_m2: p[(0, 0)],
            cov_xy_m2: p[(0, 1)],
            cov_xz_m2: p[(0, 2)],
            cov_yy_m2: p[(1, 1)],
            cov_yz_m2: p[(1, 2)],
            cov_zz_m2: p[(2, 2)],
            sd_e_m: deviation(&enu, 0),
            sd_n_m: deviation(&enu, 1),
            sd_u_m: deviation(&enu, 2),
            cov_en_m2: enu[(0, 1)],
            cov_eu_m2: enu[(0, 2)],
            cov_nu_m2: enu[(1, 2)],
            vx_m_s: s.velocity.x,
            vy_m_s: s.velocity.y,
            vz_m_s: s.velocity.z,
            cov_vxx_m2_s2: pv[(0, 0)],
            cov_vxy_m2_s2: pv[(0, 1)],
            cov_vxz_m2_s2: pv[(0, 2)],
            cov_vyy_m2_s2: pv[(1, 1)],
            cov_vyz_m2_s2: pv[(1, 2)],
            cov_vzz_m2_s2: pv[(2, 2)],
            ve_m_s: v.x,
            vn_m_s: v.y,
            vu_m_s: v.z,
            sd_ve_m_s: deviation(&venu, 0),
            sd_vn_m_s: deviation(&venu, 1),
            sd_vu_m_s: deviation(&venu, 2),
            ambiguities_fixed: s.ambiguities_fixed,
            ambiguities: s.ambiguities,
            ratio: s.ratio,
            success_rate: s.success_rate,
            age_s: s.age,
            satellites: s.satellites_used.len(),
            satellites_used: list(&s.satellites_used),
            satellites_rejected: list(&s.satellites_rejected),
            satellites_slipped: list(&s.satellites_slipped),
            hpl_m: s.protection.map(|levels| levels.horizontal),
            vpl_m: s.protection.map(|levels| levels.vertical),
            integrity: s.integrity,
            base_x_m: s.base.map(|base| base.x),
            base_y_m: s.base.map(|base| base.y),
            base_z_m: s.base.map(|base| base.z),
            dx_m: vector.map(|vector| vector.x),
            dy_m: vector.map(|vector| vector.y),
            dz_m: vector.map(|vector| vector.z),
            de_m: local.map(|local| local.x),
            dn_m: local.map(|local| local.y),
            du_m: local.map(|local| local.z),
            length_m: attitude.map(|attitude| attitude.length),
            sd_length_m: sigma(0),
            heading_deg: attitude.map(|attitude| attitude.heading.to_degrees()),
            sd_heading_deg: sigma(1).map(f64::to_degrees),
            pitch_deg: attitude.map(|attitude| attitude.pitch.to_degrees()),
            sd_pitch_deg: sigma(2).map(f64::to_degrees),
        }
    }
}

/// `G05 G07 E11`.
fn list(satellites: &SatelliteSet) -> String {
    satellites.iter().map(|satellite| satellite.to_string()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use surefix_core::gnss::time::GpsTime;
    use surefix_core::integrity::protection::Levels;

    #[test]
    fn an_error_of_the_sink_keeps_its_kind() {
        struct Closed;
        impl Write for Closed {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut table = CsvWriter::new(Closed);
        let solution = Solution::none(surefix_core::gnss::time::GpsTime::from_nanoseconds(0), Reason::NoBase);
        // The table is buffered: the error comes as soon as the buffer is full.
        let error = (0..1000).find_map(|_| table.push(&solution).err()).unwrap();
        assert_eq!(error.kind(), io::ErrorKind::BrokenPipe);
    }

    #[test]
    fn every_field_has_its_column() {
        let mut solution = Solution::none(GpsTime::from_week_tow(2114, 5783.994), Reason::SubsetOnly);
        solution.quality = Quality::Partial;
        solution.position = Vector3::new(6_378_137.0, 0.0, 0.0); // on the equator at 0°: x is up, y east, z north
        solution.position_covariance = Matrix3::from_diagonal(&Vector3::new(9.0, 1.0, 4.0));
        solution.velocity = Vector3::new(3.0, 1.0, 2.0);
        solution.velocity_covariance = Matrix3::identity() * 0.25;
        solution.satellites_used = ["G05", "E11"].map(|name| name.parse().unwrap()).into_iter().collect();
        solution.satellites_slipped = ["E11"].map(|name| name.parse().unwrap()).into_iter().collect();
        solution.age = 0.994;
        solution.protection = Some(Levels { horizontal: 0.25, vertical: 0.5 });
        solution.integrity = Status::Available;
        solution.base = Some(solution.position - Vector3::new(0.0, 3.0, 4.0));

        let mut writer = CsvWriter::new(Vec::new());
        writer.push(&solution).unwrap();
        writer.push(&Solution::none(solution.time, Reason::NoBase)).unwrap();
        let text = String::from_utf8(writer.finish().unwrap()).unwrap();
        let mut reader = ::csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().unwrap().clone();
        let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
        let cell = |row: usize, name: &str| rows[row].get(header.iter().position(|h| h == name).unwrap()).unwrap();

        assert_eq!((cell(0, "gps_week"), cell(0, "gps_tow_s")), ("2114", "5783.994"));
        assert_eq!((cell(0, "quality"), cell(0, "reason")), ("Partial", "SubsetOnly"));
        assert_eq!([cell(0, "sd_e_m"), cell(0, "sd_n_m"), cell(0, "sd_u_m")], ["1.0", "2.0", "3.0"]);
        assert_eq!([cell(0, "ve_m_s"), cell(0, "vn_m_s"), cell(0, "vu_m_s")], ["1.0", "2.0", "3.0"]);
        assert_eq!([cell(0, "cov_xx_m2"), cell(0, "cov_vzz_m2_s2")], ["9.0", "0.25"]);
        assert_eq!([cell(0, "satellites"), cell(0, "satellites_used")], ["2", "G05 E11"]);
        assert_eq!([cell(0, "satellites_slipped"), cell(0, "satellites_rejected")], ["E11", ""]);
        assert_eq!([cell(0, "latitude_deg"), cell(0, "age_s")], ["0.0", "0.994"]);
        assert_eq!([cell(0, "hpl_m"), cell(0, "vpl_m"), cell(0, "integrity")], ["0.25", "0.5", "Available"]);
        assert_eq!([cell(0, "dx_m"), cell(0, "dy_m"), cell(0, "dz_m")], ["0.0", "3.0", "4.0"]);
        // 3 m east and 4 m north: 5 m, atan2(3, 4), up to the turn of the frame over these 5 m.
        let value = |name: &str| cell(0, name).parse::<f64>().unwrap();
        assert!((value("length_m") - 5.0).abs() < 1e-9 && (value("heading_deg") - 36.869_897_6).abs() < 1e-3);
        assert!((value("de_m") - 3.0).abs() < 1e-5 && (value("dn_m") - 4.0).abs() < 1e-5);
        assert_eq!([cell(1, "hpl_m"), cell(1, "integrity"), cell(1, "length_m")], ["", "Unmonitored", ""]);
        assert_eq!([cell(1, "quality"), cell(1, "reason"), cell(1, "height_m")], ["None", "NoBase", ""]);
    }
}
