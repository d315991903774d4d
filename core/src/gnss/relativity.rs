//! Relativity: the clock of an eccentric orbit, and the delay of a signal in the Earth's gravity.
//!
//! Source: G. Petit, B. Luzum (eds.), *IERS Conventions (2010)*, Technical Note 36: equation (10.10) for the clock and
//! (11.17), reduced to the Earth, for the delay. Cost: a few operations and one logarithm. Panic contract: none.

use super::SPEED_OF_LIGHT;
use nalgebra::Vector3;

/// Gravitational constant times mass of the Earth `[m³/s²]` (IERS Conventions 2010 table 1.1, to the digits of GRS 80's
/// successors that GNSS interface documents have).
pub const EARTH_GM: f64 = 3.986_004_418e14;

/// The periodic relativistic term −2 r·v / c² `[s]`, to be *added* to the clock bias of a precise product.
///
/// `position` `[m]` and `velocity` `[m/s]` may be of the rotating or of an inertial frame: r·v is the same.
pub fn clock_correction(position: &Vector3<f64>, velocity: &Vector3<f64>) -> f64 {
    -2.0 * position.dot(velocity) / (SPEED_OF_LIGHT * SPEED_OF_LIGHT)
}

/// The Shapiro delay in the Earth's field `[m]`, to be *added* to the modelled range:
/// 2 GM/c² · ln((a + b + r)/(a + b − r)), a and b the distances of receiver and satellite from the Earth's centre, r
/// theirs from each other. Positions ECEF of one time `[m]`. 0 where both coincide.
pub fn shapiro_delay(receiver: &Vector3<f64>, satellite: &Vector3<f64>) -> f64 {
    let sum = receiver.norm() + satellite.norm();
    let range = (satellite - receiver).norm();
    let difference = sum - range;
    // (Not so where the line goes through the Earth's centre, or where a position is not finite.)
    if difference > 0.0 {
        2.0 * EARTH_GM / (SPEED_OF_LIGHT * SPEED_OF_LIGHT) * libm::log((sum + range) / difference)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_term_of_an_eccentric_orbit_is_that_of_the_broadcast_formula() {
        // −2 √(GM a)/c² · e sin E (IS-GPS-200N 20.3.3.3.3.1) for a = 26560 km, e = 0.01, E = 90°: r = a(−e, √(1−e²)),
        // v = √(GM/a) (−1, 0): r·v = e √(GM a).
        let (a, e) = (26_560e3, 0.01_f64);
        let position = Vector3::new(-e, (1.0 - e * e).sqrt(), 0.0) * a;
        let velocity = Vector3::new(-(EARTH_GM / a).sqrt(), 0.0, 0.0);
        let expected = -2.0 * (EARTH_GM * a).sqrt() / SPEED_OF_LIGHT.powi(2) * e;
        assert!((clock_correction(&position, &velocity) - expected).abs() < 1e-22, "{expected}");
    }

    #[test]
    fn the_shapiro_delay_is_known_at_the_zenith_and_defined_everywhere() {
        // At the zenith r = b − a: 2GM/c² ln(b/a) = 8.870 mm · ln(26560/6378) = 12.65 mm.
        let receiver = Vector3::new(6_378e3, 0.0, 0.0);
        let zenith = shapiro_delay(&receiver, &Vector3::new(26_560e3, 0.0, 0.0));
        assert!((zenith - 0.012_655).abs() < 1e-5, "{zenith}");
        assert!(shapiro_delay(&receiver, &Vector3::new(0.0, 26_560e3, 0.0)) > zenith);
        for odd in [receiver, -receiver, Vector3::zeros(), Vector3::repeat(f64::NAN), Vector3::repeat(1e300)] {
            assert!(shapiro_delay(&receiver, &odd).is_finite(), "{odd}");
        }
    }
}
