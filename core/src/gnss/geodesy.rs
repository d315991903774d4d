//! The Earth's shape and rotation: geodetic and local coordinates, directions to satellites, light-time range.
//!
//! * Geodetic ↔ ECEF on the WGS 84 ellipsoid (NGA.STND.0036 table 3.1). From ECEF by Bowring's iteration on the reduced
//!   latitude β (Bowring 1976, Survey Review 23, eq. 2–3):
//!   tan φ = (z + e'² b sin³β) / (p − e² a cos³β), tan β = (1 − f) tan φ, and h = p cos φ + z sin φ − a √(1 − e² sin²φ),
//!   which has no singularity at the poles and holds from −6300 km to beyond the geostationary height.
//! * Local frame: rows east, north, up of [`Geodetic::enu_rotation`]. Azimuth is clockwise from north.
//! * Earth rotation (Sagnac effect): satellite positions come in the ECEF frame of *transmission*, ranges are measured
//!   in that of *reception*. [`line_of_sight`] rotates the satellite by ω τ, τ the time of flight, instead of adding the
//!   first-order term ω (x_s y_r − y_s x_r) / c ([`sagnac_first_order`]), which is off by up to 0.11 mm.
//!
//! Lengths `[m]`, angles `[rad]`. Loops have fixed bounds. Panic contract: none; input that is not finite gives output
//! that is not finite.

use super::SPEED_OF_LIGHT;
use core::f64::consts::TAU;
use nalgebra::{Matrix3, Vector3};

/// Semi-major axis of the WGS 84 ellipsoid `[m]`.
pub const WGS84_A: f64 = 6_378_137.0;
/// Flattening of the WGS 84 ellipsoid.
pub const WGS84_F: f64 = 1.0 / 298.257_223_563;
/// Square of the first eccentricity, e² = f (2 − f).
const E2: f64 = WGS84_F * (2.0 - WGS84_F);
/// Earth rotation rate ω of WGS 84 as GPS, Galileo and QZSS use it `[rad/s]` (IS-GPS-200N table 20-IV).
pub const EARTH_ROTATION_RATE: f64 = 7.292_115_146_7e-5;

/// Bowring's iteration gains five digits or more a step near the surface, two at satellite height.
const MAX_LATITUDE_STEPS: usize = 12;
/// Steps of the light-time iteration; each gains six digits.
const LIGHT_TIME_STEPS: usize = 3;

/// Geodetic coordinates on the WGS 84 ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Geodetic {
    /// Latitude `[rad]`, −π/2…π/2, north positive.
    pub latitude: f64,
    /// Longitude `[rad]`, −π…π, east positive.
    pub longitude: f64,
    /// Height above the ellipsoid `[m]`.
    pub height: f64,
}

impl Geodetic {
    /// From an ECEF position `[m]`. On the axis, where longitude is undefined, it is 0. Within 43 km of the Earth's
    /// centre, where several latitudes solve the equations, one of them is returned.
    pub fn from_ecef(position: &Vector3<f64>) -> Self {
        let (x, y, z) = (position.x, position.y, position.z);
        let p = libm::hypot(x, y);
        let b = WGS84_A * (1.0 - WGS84_F);
        let second_e2 = E2 / (1.0 - E2);

        let mut latitude = libm::atan2(z, p * (1.0 - E2));
        for _ in 0..MAX_LATITUDE_STEPS {
            let (sin_phi, cos_phi) = libm::sincos(latitude);
            let (sin_beta, cos_beta) = libm::sincos(libm::atan2((1.0 - WGS84_F) * sin_phi, cos_phi));
            let along_axis = z + second_e2 * b * sin_beta * sin_beta * sin_beta;
            let off_axis = p - E2 * WGS84_A * cos_beta * cos_beta * cos_beta;
            let next = libm::atan2(along_axis, off_axis.max(0.0));
            let step = libm::fabs(next - latitude);
            latitude = next;
            if step < 1e-16 {
                break;
            }
        }

        let (sin_phi, cos_phi) = libm::sincos(latitude);
        let height = p * cos_phi + z * sin_phi - WGS84_A * libm::sqrt(1.0 - E2 * sin_phi * sin_phi);
        Self { latitude, longitude: libm::atan2(y, x), height }
    }

    /// ECEF position `[m]`.
    pub fn to_ecef(&self) -> Vector3<f64> {
        let (sin_phi, cos_phi) = libm::sincos(self.latitude);
        let (sin_lambda, cos_lambda) = libm::sincos(self.longitude);
        let normal = WGS84_A / libm::sqrt(1.0 - E2 * sin_phi * sin_phi);
        let p = (normal + self.height) * cos_phi;
        Vector3::new(p * cos_lambda, p * sin_lambda, (normal * (1.0 - E2) + self.height) * sin_phi)
    }

    /// Rotation from ECEF to the local frame here: rows east, north, up.
    pub fn enu_rotation(&self) -> Matrix3<f64> {
        let (sin_phi, cos_phi) = libm::sincos(self.latitude);
        let (sin_lambda, cos_lambda) = libm::sincos(self.longitude);
        Matrix3::new(
            -sin_lambda,
            cos_lambda,
            0.0,
            -sin_phi * cos_lambda,
            -sin_phi * sin_lambda,
            cos_phi,
            cos_phi * cos_lambda,
            cos_phi * sin_lambda,
            sin_phi,
        )
    }

    /// An ECEF *difference* (baseline, velocity, error) in the local frame here: east, north, up, unit unchanged.
    pub fn ecef_to_enu(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.enu_rotation() * vector
    }

    /// A local difference (east, north, up) in ECEF; inverse of [`Geodetic::ecef_to_enu`].
    pub fn enu_to_ecef(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.enu_rotation().transpose() * vector
    }

    /// Covariance of an ECEF vector in the local frame here: R Σ Rᵀ.
    pub fn covariance_to_enu(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        let rotation = self.enu_rotation();
        rotation * covariance * rotation.transpose()
    }

    /// Covariance of a local vector (east, north, up) in ECEF: Rᵀ Σ R.
    pub fn covariance_to_ecef(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        let rotation = self.enu_rotation();
        rotation.transpose() * covariance * rotation
    }

    /// The direction of an ECEF vector that starts here, of any length.
    pub fn look(&self, vector: &Vector3<f64>) -> LookAngle {
        let enu = self.ecef_to_enu(vector);
        let azimuth = libm::atan2(enu.x, enu.y);
        LookAngle {
            azimuth: if azimuth < 0.0 { azimuth + TAU } else { azimuth },
            elevation: libm::atan2(enu.z, libm::hypot(enu.x, enu.y)),
        }
    }
}

/// A direction seen from a place on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LookAngle {
    /// Azimuth `[rad]`, 0…2π, clockwise from north. 0 at the zenith.
    pub azimuth: f64,
    /// Elevation above the horizon `[rad]`, −π/2…π/2.
    pub elevation: f64,
}

/// Azimuth and elevation of a satellite seen from a receiver, both ECEF `[m]` of the same frame.
pub fn look_angle(receiver: &Vector3<f64>, satellite: &Vector3<f64>) -> LookAngle {
    Geodetic::from_ecef(receiver).look(&(satellite - receiver))
}

/// A vector given in the ECEF frame of one instant, expressed in the ECEF frame `seconds` later:
/// R_z(ω · seconds) · vector.
pub fn rotate_ecef(vector: &Vector3<f64>, seconds: f64) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(EARTH_ROTATION_RATE * seconds);
    Vector3::new(cos * vector.x + sin * vector.y, cos * vector.y - sin * vector.x, vector.z)
}

/// The straight line from a receiver to where the satellite was when it sent the signal, in the receiver's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSight {
    /// Distance that the signal travelled, Earth rotation included `[m]`.
    pub range: f64,
    /// Unit vector from receiver to satellite, ECEF of reception. Zero where both coincide.
    pub direction: Vector3<f64>,
    /// Satellite position, ECEF of reception `[m]`.
    pub satellite: Vector3<f64>,
}

impl LineOfSight {
    /// A vector (such as the satellite's velocity) of the ECEF frame of transmission, in that of reception.
    pub fn rotate(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        rotate_ecef(vector, self.range / SPEED_OF_LIGHT)
    }
}

/// Range and direction from `receiver`, ECEF of reception `[m]`, to `satellite`, ECEF of transmission `[m]`.
///
/// The range ρ solves ρ = |R_z(ω ρ/c) satellite − receiver|. Do not pass a satellite that was rotated before.
pub fn line_of_sight(receiver: &Vector3<f64>, satellite: &Vector3<f64>) -> LineOfSight {
    let mut range = (satellite - receiver).norm();
    let mut rotated = *satellite;
    for _ in 0..LIGHT_TIME_STEPS {
        rotated = rotate_ecef(satellite, range / SPEED_OF_LIGHT);
        range = (rotated - receiver).norm();
    }
    let difference = rotated - receiver;
    let direction = if range > 0.0 { difference / range } else { Vector3::zeros() };
    LineOfSight { range, direction, satellite: rotated }
}

/// First-order Sagnac term `[m]`, to be added to the plain distance: ω (x_s y_r − y_s x_r) / c.
pub fn sagnac_first_order(receiver: &Vector3<f64>, satellite: &Vector3<f64>) -> f64 {
    EARTH_ROTATION_RATE * (satellite.x * receiver.y - satellite.y * receiver.x) / SPEED_OF_LIGHT
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dms(degrees: f64, minutes: f64, seconds: f64) -> f64 {
        (degrees + minutes / 60.0 + seconds / 3600.0).to_radians()
    }

    /// IOGP publication 373-7-2, coordinate operation method 9602.
    const EPSG_9602_ECEF: [f64; 3] = [3_771_793.968, 140_253.342, 5_124_304.349];

    fn epsg_9602_geodetic() -> Geodetic {
        Geodetic { latitude: dms(53.0, 48.0, 33.820), longitude: dms(2.0, 7.0, 46.380), height: 73.0 }
    }

    #[test]
    fn geodetic_agrees_with_the_published_example() {
        let ecef = epsg_9602_geodetic().to_ecef();
        assert!((ecef - Vector3::from(EPSG_9602_ECEF)).amax() < 1e-3, "{ecef}");
        let back = Geodetic::from_ecef(&Vector3::from(EPSG_9602_ECEF));
        assert!((back.latitude - epsg_9602_geodetic().latitude).abs() < 1e-10);
        assert!((back.longitude - epsg_9602_geodetic().longitude).abs() < 1e-10);
        assert!((back.height - 73.0).abs() < 1e-3);
    }

    #[test]
    fn local_frame_agrees_with_the_published_example() {
        // IOGP publication 373-7-2, method 9837: topocentric coordinates with origin 55° N, 5° E, 200 m.
        let origin = Geodetic { latitude: dms(55.0, 0.0, 0.0), longitude: dms(5.0, 0.0, 0.0), height: 200.0 };
        let enu = origin.ecef_to_enu(&(epsg_9602_geodetic().to_ecef() - origin.to_ecef()));
        assert!((enu - Vector3::new(-189_013.869, -128_642.040, -4_220.171)).amax() < 1e-3, "{enu}");
        assert!((origin.enu_to_ecef(&enu) + origin.to_ecef() - Vector3::from(EPSG_9602_ECEF)).amax() < 1e-3);
    }

    #[test]
    fn poles_axis_and_centre_are_finite() {
        let b = WGS84_A * (1.0 - WGS84_F);
        let pole = Geodetic::from_ecef(&Vector3::new(0.0, 0.0, -(b + 100.0)));
        assert_eq!(pole.longitude, 0.0);
        assert!((pole.latitude + core::f64::consts::FRAC_PI_2).abs() < 1e-15 && (pole.height - 100.0).abs() < 1e-8);
        for place in [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [3e4, -1e4, 2e4], [1e300, 0.0, 1e300]] {
            let g = Geodetic::from_ecef(&Vector3::from(place));
            assert!(g.latitude.is_finite() && g.longitude.is_finite() && g.height.is_finite(), "{place:?} {g:?}");
        }
    }

    #[test]
    fn satellites_overhead_and_due_east_are_seen_there() {
        let here = epsg_9602_geodetic();
        let up = here.look(&here.enu_to_ecef(&Vector3::new(0.0, 0.0, 2e7)));
        assert!((up.elevation - core::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let west = here.look(&here.enu_to_ecef(&Vector3::new(-1.0, 0.0, 1.0)));
        assert!((west.azimuth - 1.5 * core::f64::consts::PI).abs() < 1e-12);
        assert!((west.elevation - core::f64::consts::FRAC_PI_4).abs() < 1e-12);
    }

    #[test]
    fn the_first_order_sagnac_term_is_right_to_the_millimetre() {
        let receiver = Vector3::from(EPSG_9602_ECEF);
        let satellite = Vector3::new(6.0e6, -20.0e6, 16.0e6);
        let plain = (satellite - receiver).norm();
        let sight = line_of_sight(&receiver, &satellite);
        // ω (x_s y_r − y_s x_r) / c = 18.6 m here, far above the tolerance.
        assert!((sight.range - plain).abs() > 10.0);
        assert!((sight.range - plain - sagnac_first_order(&receiver, &satellite)).abs() < 2e-4);
        assert!((sight.direction.norm() - 1.0).abs() < 1e-15);
        assert!((receiver + sight.direction * sight.range - sight.satellite).amax() < 1e-7);
    }

    proptest! {
        #[test]
        fn geodetic_comes_back(lat in -1.57..1.57_f64, lon in -3.1..3.1_f64, height in -1e5..4e7_f64) {
            let place = Geodetic { latitude: lat, longitude: lon, height };
            let back = Geodetic::from_ecef(&place.to_ecef());
            prop_assert!((back.latitude - lat).abs() < 2e-15, "{}", back.latitude - lat);
            prop_assert!((back.height - height).abs() < 3e-8, "{}", back.height - height);
            prop_assert!((back.longitude - lon).abs() * lat.cos() < 2e-15);
        }

        #[test]
        fn rotating_a_covariance_keeps_its_trace(lat in -1.57..1.57_f64, lon in -3.1..3.1_f64) {
            let place = Geodetic { latitude: lat, longitude: lon, height: 0.0 };
            let covariance = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.5, 0.5, -0.5, 9.0);
            let local = place.covariance_to_enu(&covariance);
            prop_assert!((local.trace() - 16.0).abs() < 1e-13);
            prop_assert!((place.covariance_to_ecef(&local) - covariance).amax() < 1e-13);
        }
    }
}
