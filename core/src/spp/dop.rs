//! Dilution of precision: how the geometry alone turns a range error of 1 m into errors of position.
//!
//! (Hᵀ H)⁻¹ with rows H = (−e, 1) in east, north, up and *one* clock, the textbook definition (Kaplan & Hegarty,
//! *Understanding GPS/GNSS*, 3rd ed., 11.3.1); with a clock for each constellation the precision is somewhat worse, which
//! the covariance shows. Panic contract: never panics.

use crate::gnss::geodesy::Geodetic;
use nalgebra::{Matrix4, Vector3, Vector4};

/// A dilution beyond this is rounding error of a singular geometry.
const SINGULAR: f64 = 1e5;

/// Dilution of precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Dop {
    /// Of position and time, GDOP.
    pub geometric: f64,
    /// Of position, PDOP.
    pub position: f64,
    /// Horizontal, HDOP.
    pub horizontal: f64,
    /// Vertical, VDOP.
    pub vertical: f64,
}

impl Dop {
    /// For a receiver and satellites, ECEF `[m]` (the Earth's rotation in between does not matter); `None` where fewer than four directions
    /// are independent.
    pub fn of<'a>(receiver: &Vector3<f64>, satellites: impl Iterator<Item = &'a Vector3<f64>>) -> Option<Self> {
        let here = Geodetic::from_ecef(receiver);
        let mut normal = Matrix4::zeros();
        for satellite in satellites {
            let enu = here.ecef_to_enu(&(satellite - receiver).normalize());
            let row = Vector4::new(-enu.x, -enu.y, -enu.z, 1.0);
            for i in 0..4 {
                for j in 0..4 {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
        let q = normal.cholesky()?.inverse();
        let [east, north, up, time] = [q[(0, 0)], q[(1, 1)], q[(2, 2)], q[(3, 3)]];
        let dop = Self {
            geometric: libm::sqrt(east + north + up + time),
            position: libm::sqrt(east + north + up),
            horizontal: libm::sqrt(east + north),
            vertical: libm::sqrt(up),
        };
        (dop.geometric < SINGULAR).then_some(dop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tetrahedron_has_the_known_dilution() {
        // One satellite at the zenith and three at the horizon, 120° apart. Hᵀ H is diagonal in east and north (3/2);
        // up and time: [[1, −1], [−1, 4]] has the inverse [[4/3, 1/3], [1/3, 1/3]]. HDOP² = 4/3, VDOP² = 4/3,
        // PDOP² = 8/3, GDOP² = 3 (Parkinson & Spilker, GPS Theory and Applications I, p. 414: 1.73).
        let here = Geodetic { latitude: 0.8, longitude: 0.3, height: 0.0 };
        let receiver = here.to_ecef();
        let far = |enu: Vector3<f64>| receiver + here.enu_to_ecef(&(enu * 1e3));
        let around = |k: f64| Vector3::new(libm::sin(k * 2.0944), libm::cos(k * 2.0944), 0.0);
        let satellites = [far(Vector3::z()), far(around(0.0)), far(around(1.0)), far(around(2.0))];
        let dop = Dop::of(&receiver, satellites.iter()).unwrap();
        for (value, square) in
            [(dop.horizontal, 4.0 / 3.0), (dop.vertical, 4.0 / 3.0), (dop.position, 8.0 / 3.0), (dop.geometric, 3.0)]
        {
            assert!((value * value - square).abs() < 1e-3, "{dop:?}");
        }
        assert_eq!(Dop::of(&receiver, satellites.iter().take(3)), None);
    }
}
