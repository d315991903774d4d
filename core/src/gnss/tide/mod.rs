//! How the solid Earth moves under a station: displacements that are *added* to its conventional coordinate to give
//! where it is.
//!
//! | module | what | size | needs |
//! |---|---|---|---|
//! | [`solid`] | tides of the solid Earth by Sun and Moon | 0.4 m | nothing |
//! | [`pole`] | centrifugal change by polar motion | 2.5 cm | [`EarthOrientation`] |
//! | [`ocean`] | load of the ocean tides | 10 cm at coasts | [`OceanLoading`] of the place |
//!
//! [`displacement`] sums what is known. All of it changes by less than 0.05 mm/s, so a caller short of time may hold
//! it for some seconds. Frames ECEF `[m]` unless said otherwise. Panic contract: none.

use super::celestial::SunMoon;
use super::earth_rotation::EarthOrientation;
use super::geodesy::Geodetic;
use super::time::GpsTime;
use nalgebra::Vector3;

pub mod ocean;
pub mod pole;
pub mod solid;
mod waves;

pub use ocean::OceanLoading;

/// What is known for the displacement of a station.
#[derive(Clone, Copy, Debug, Default)]
pub struct Model<'a> {
    /// Orientation of the Earth; without it, no pole tide.
    pub orientation: Option<&'a EarthOrientation>,
    /// Ocean loading at the station; without it, none.
    pub ocean: Option<&'a OceanLoading>,
}

/// Displacement of a station at `station`, ECEF `[m]`, at a time: solid tide, and pole tide and ocean loading if known.
pub fn displacement(station: &Vector3<f64>, time: GpsTime, model: &Model) -> Vector3<f64> {
    let SunMoon { sun, moon } = SunMoon::at(time, model.orientation.unwrap_or(&EarthOrientation::default()));
    let mut sum = solid::displacement(station, time, &sun, &moon);
    if let Some(orientation) = model.orientation {
        sum += pole::displacement(station, time, orientation);
    }
    if let Some(ocean) = model.ocean {
        sum += Geodetic::from_ecef(station).enu_to_ecef(&ocean.displacement(time));
    }
    sum
}

/// Directions at a station on a sphere: geocentric latitude φ and longitude λ, as harmonics of the potential have them.
#[derive(Clone, Copy)]
struct Sphere {
    sin_phi: f64,
    cos_phi: f64,
    sin_lambda: f64,
    cos_lambda: f64,
}

impl Sphere {
    fn at(station: &Vector3<f64>) -> Self {
        let (sin_phi, cos_phi) = libm::sincos(libm::atan2(station.z, libm::hypot(station.x, station.y)));
        let (sin_lambda, cos_lambda) = libm::sincos(libm::atan2(station.y, station.x));
        Self { sin_phi, cos_phi, sin_lambda, cos_lambda }
    }

    /// A vector of radial, north and east components in ECEF.
    fn to_ecef(self, [radial, north, east]: [f64; 3]) -> Vector3<f64> {
        let Self { sin_phi, cos_phi, sin_lambda, cos_lambda } = self;
        let outward = radial * cos_phi - north * sin_phi;
        Vector3::new(
            outward * cos_lambda - east * sin_lambda,
            outward * sin_lambda + east * cos_lambda,
            radial * sin_phi + north * cos_phi,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ocean() -> OceanLoading {
        let amplitude = core::array::from_fn(|k| [0.01 / (k + 1) as f64; 11]);
        OceanLoading::new(&amplitude, &[[0.7; 11]; 3])
    }

    proptest! {
        #[test]
        fn is_the_sum_of_what_is_known_and_below_half_a_metre(
            latitude in -1.57..1.57f64, longitude in -3.1..3.1f64, week in 1_000..2_500i32, tow in 0.0..604_800.0f64,
        ) {
            let place = Geodetic { latitude, longitude, height: 100.0 };
            let (station, time) = (place.to_ecef(), GpsTime::from_week_tow(week, tow));
            let orientation = EarthOrientation { xp: 1e-6, yp: 2e-6, ut1_minus_utc: 0.1 };
            let ocean = ocean();
            let with = |orientation, ocean| displacement(&station, time, &Model { orientation, ocean });
            let all = with(Some(&orientation), Some(&ocean));
            prop_assert!(with(None, None).norm() < 0.5);
            let without_ocean = with(Some(&orientation), None);
            prop_assert!((all - without_ocean - place.enu_to_ecef(&ocean.displacement(time))).amax() < 1e-12);
            let pole = pole::displacement(&station, time, &orientation);
            // Sun and Moon move by UT1 as well: 0.1 s of it, 1.5″, is 1 µm.
            prop_assert!((without_ocean - pole - with(None, None)).amax() < 1e-5);
        }

        #[test]
        fn takes_anything_and_gives_nan_for_nan(x: f64, y: f64, z: f64, ns: i64) {
            let time = GpsTime::from_nanoseconds(ns);
            let _ = displacement(&Vector3::new(x, y, z), time, &Model::default());
            prop_assert!(displacement(&Vector3::new(f64::NAN, y, z), time, &Model::default()).x.is_nan());
            prop_assert!(displacement(&Vector3::zeros(), time, &Model::default()).x.is_nan());
        }
    }
}
