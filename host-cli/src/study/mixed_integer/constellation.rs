//! The 13 satellites of the study: those above 5° of a circular constellation of 32 slots like that of GPS.
//!
//! Six planes of five or six evenly spaced satellites, 60° of longitude apart, inclined by 55°, of GPS's nominal radius.
//! A mask of 5° shows 13 of 32 only rarely; where and when it does was found by trying: the phase from plane to plane
//! and the time are chosen for it, and so that the position is known about as well as in the study that set the
//! acceptance bands (PDOP 1.07 there and here).
//!
//! Frame: east, north, up of the base, and relative to it `[m]`. Time `[s]` from the first epoch; satellites move.

use nalgebra::Vector3;
use surefix_core::gnss::geodesy::{EARTH_ROTATION_RATE, Geodetic};

/// N, the number of satellites in view.
pub const SATELLITES: usize = 13;

/// Satellites in each plane.
const PLANES: [usize; 6] = [5, 6, 5, 5, 6, 5];
/// By how much a plane's satellites are ahead of those of the plane before `[°]`.
const PHASE: f64 = 40.0;
/// Radius of the orbits `[m]`: half a sidereal day.
const RADIUS: f64 = 26_559_710.0;
/// Inclination of the orbits `[°]`.
const INCLINATION: f64 = 55.0;
/// GM of WGS 84 `[m³/s²]`.
const GRAVITATION: f64 = 3.986_004_418e14;
/// When the study begins `[s]`: the ascending node of the first plane was in the Greenwich meridian at 0.
const START: f64 = 59_400.0;
/// Latitude and longitude of the base `[°]`.
const BASE: [f64; 2] = [42.366, -71.091];
/// Satellites are used above this elevation at the start `[°]`.
const MASK: f64 = 5.0;

/// The satellites in view, highest first.
#[derive(Clone, Debug)]
pub struct Constellation {
    base: Geodetic,
    slots: Vec<Slot>,
}

/// Where a satellite was at time 0 `[rad]`.
#[derive(Clone, Copy, Debug)]
struct Slot {
    node: f64,
    argument: f64,
}

impl Default for Constellation {
    fn default() -> Self {
        Self::new()
    }
}

impl Constellation {
    /// The satellites that are in view at the start and stay in use.
    pub fn new() -> Self {
        let [latitude, longitude] = BASE.map(f64::to_radians);
        let base = Geodetic { latitude, longitude, height: 0.0 };
        let all = PLANES.iter().enumerate().flat_map(|(plane, &count)| {
            (0..count).map(move |slot| Slot {
                node: (60.0 * plane as f64).to_radians(),
                argument: (360.0 * slot as f64 / count as f64 + PHASE * plane as f64).to_radians(),
            })
        });
        let elevation = |slot: &Slot| {
            let s = slot.enu(&base, 0.0);
            (s.z / s.norm()).asin()
        };
        let mut slots: Vec<Slot> = all.filter(|slot| elevation(slot) > MASK.to_radians()).collect();
        slots.sort_by(|a, b| elevation(b).total_cmp(&elevation(a)));
        Self { base, slots }
    }

    /// Positions at `time`; the first, highest at the start, is the reference.
    pub fn at(&self, time: f64) -> Vec<Vector3<f64>> {
        self.slots.iter().map(|slot| slot.enu(&self.base, time)).collect()
    }

    /// A point on the ellipsoid, `distance` `[m]` from the base in direction `azimuth` `[rad]` (along the ellipsoid to 1
    /// part in 300).
    pub fn on_the_ground(&self, distance: f64, azimuth: f64) -> Vector3<f64> {
        let origin = self.base.to_ecef();
        let level = Vector3::new(distance * azimuth.sin(), distance * azimuth.cos(), 0.0);
        let point = Geodetic::from_ecef(&(origin + self.base.enu_to_ecef(&level)));
        self.base.ecef_to_enu(&(Geodetic { height: 0.0, ..point }.to_ecef() - origin))
    }
}

impl Slot {
    /// Position relative to the base, `time` after the start.
    fn enu(&self, base: &Geodetic, time: f64) -> Vector3<f64> {
        let time = START + time;
        let argument = self.argument + (GRAVITATION / RADIUS.powi(3)).sqrt() * time;
        let (sin_node, cos_node) = (self.node - EARTH_ROTATION_RATE * time).sin_cos();
        let (sin_i, cos_i) = INCLINATION.to_radians().sin_cos();
        let (across, along) = argument.sin_cos();
        let ecef = RADIUS
            * Vector3::new(
                along * cos_node - across * cos_i * sin_node,
                along * sin_node + across * cos_i * cos_node,
                across * sin_i,
            );
        base.ecef_to_enu(&(ecef - base.to_ecef()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn thirteen_are_in_view_the_highest_first() {
        let sky = Constellation::new().at(0.0);
        assert_eq!(sky.len(), SATELLITES);
        let elevations: Vec<f64> = sky.iter().map(|s| (s.z / s.norm()).asin().to_degrees()).collect();
        assert!(elevations.windows(2).all(|pair| pair[0] >= pair[1]));
        assert!(elevations[12] > 5.0 && elevations[0] > 70.0);
    }

    /// Range rates of GPS satellites stay below 800 m/s, their speed over ground below 4 km/s.
    #[test]
    fn they_move_like_gps() {
        let sky = Constellation::new();
        for (now, then) in sky.at(0.0).iter().zip(sky.at(1.0)) {
            assert!((now.norm() - then.norm()).abs() < 800.0);
            assert!((500.0..4000.0).contains(&(now - then).norm()));
        }
    }

    /// 1.0642 is that of the golden vector `alg1_A`, 1.0679 that of this constellation by an independent program.
    #[test]
    fn the_geometry_is_as_good_as_that_of_the_reference_study() {
        let normal: Matrix4<f64> = Constellation::new()
            .at(0.0)
            .iter()
            .map(|s| s.normalize())
            .map(|u| Vector4::new(u.x, u.y, u.z, 1.0))
            .map(|row| row * row.transpose())
            .sum();
        let cofactor = normal.try_inverse().unwrap();
        let pdop = (cofactor.trace() - cofactor[(3, 3)]).sqrt();
        assert!((pdop - 1.0679).abs() < 1e-4, "{pdop}");
    }

    /// A chord of 10 km sinks by s²/2R = 7.8 m below the horizontal plane.
    #[test]
    fn the_ground_curves() {
        let point = Constellation::new().on_the_ground(1e4, 0.5);
        assert!((point.z + 7.84).abs() < 0.05 && (point.norm() - 1e4).abs() < 0.1, "{point}");
    }
}
