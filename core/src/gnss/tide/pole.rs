//! Pole tide: the Earth yields to the centrifugal force that polar motion changes.
//!
//! With m₁ = x_p − x̄, m₂ = −(y_p − ȳ) `["]` from the secular pole, colatitude θ and longitude λ (IERS Conventions
//! 2010, eq. 7.26):
//!
//! S_r = −33 sin 2θ (m₁ cos λ + m₂ sin λ), S_θ = −9 cos 2θ (m₁ cos λ + m₂ sin λ), S_λ = 9 cos θ (m₁ sin λ − m₂ cos λ)
//! `[mm]`
//!
//! (S_r up, S_θ south, S_λ east, here of the geodetic latitude; the geocentric one differs by 0.02 mm at most.) The
//! secular pole is that of 2018 (eq. 21 of the updated chapter 7): the cubic mean pole of 2010 differs by up to 40 mas,
//! 1 mm. Cost: two pairs of sine and cosine beside the geodetic latitude. Panic contract: none.

use crate::gnss::earth_rotation::{ARCSECOND, EarthOrientation, days_since_j2000};
use crate::gnss::geodesy::Geodetic;
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// The secular pole x̄, ȳ `[rad]` of 2018: 55.0 + 1.677 t and 320.5 + 3.460 t `[mas]`, t in years of 365.25 days since
/// J2000.0.
pub fn secular_pole(time: GpsTime) -> [f64; 2] {
    let years = days_since_j2000(time) / 365.25;
    [(55.0 + 1.677 * years) * 1e-3 * ARCSECOND, (320.5 + 3.460 * years) * 1e-3 * ARCSECOND]
}

/// Displacement of a station at `station`, ECEF `[m]`, by the pole tide: ECEF `[m]`, to be added.
pub fn displacement(station: &Vector3<f64>, time: GpsTime, orientation: &EarthOrientation) -> Vector3<f64> {
    let [x, y] = secular_pole(time);
    let (m1, m2) = ((orientation.xp - x) / ARCSECOND, -(orientation.yp - y) / ARCSECOND);
    let place = Geodetic::from_ecef(station);
    let (sin_phi, cos_phi) = libm::sincos(place.latitude);
    let (sin_lambda, cos_lambda) = libm::sincos(place.longitude);
    let along = m1 * cos_lambda + m2 * sin_lambda;
    let across = m1 * sin_lambda - m2 * cos_lambda;
    // Colatitude: sin 2θ = sin 2φ, cos 2θ = −cos 2φ.
    let up = -33e-3 * 2.0 * sin_phi * cos_phi * along;
    let south = 9e-3 * (cos_phi * cos_phi - sin_phi * sin_phi) * along;
    let east = 9e-3 * sin_phi * across;
    place.enu_to_ecef(&Vector3::new(east, -south, up))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn orientation([xp, yp]: [f64; 2]) -> EarthOrientation {
        EarthOrientation { xp, yp, ut1_minus_utc: 0.0 }
    }

    #[test]
    fn the_secular_pole_is_that_of_2018() {
        // numpy from the published line: 0.08934578644763849″, 0.39136250513347″ on 2020-06-25 0 h GPST.
        let [x, y] = secular_pole(GpsTime::from_week_tow(2111, 345_600.0));
        assert!((x / ARCSECOND - 0.089_345_786_447_638_49).abs() < 1e-12);
        assert!((y / ARCSECOND - 0.391_362_505_133_47).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn is_zero_at_the_secular_pole_and_linear_in_the_distance_from_it(
            latitude in -1.57..1.57f64, longitude in -3.1..3.1f64, dx in -2e-6..2e-6f64, dy in -2e-6..2e-6f64,
        ) {
            let time = GpsTime::from_week_tow(2111, 345_600.0);
            let station = Geodetic { latitude, longitude, height: 0.0 }.to_ecef();
            let [x, y] = secular_pole(time);
            let at = |factor| displacement(&station, time, &orientation([x + factor * dx, y + factor * dy]));
            prop_assert!(at(0.0).norm() < 1e-15);
            prop_assert!((at(2.0) - 2.0 * at(1.0)).norm() < 1e-12);
            prop_assert!(at(1.0).norm() < 0.025);
            // Odd in the meridian: opposite meridians move oppositely along the radius.
            let across = Geodetic { latitude, longitude: longitude + core::f64::consts::PI, height: 0.0 }.to_ecef();
            let there = displacement(&across, time, &orientation([x + dx, y + dy]));
            prop_assert!((there.dot(&across.normalize()) + at(1.0).dot(&station.normalize())).abs() < 1e-12);
        }
    }
}
