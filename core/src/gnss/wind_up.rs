//! Carrier phase wind-up: what the phase gains because the antennas turn about the line of sight.
//!
//! Source: J.-T. Wu, S. C. Wu, G. A. Hajj, W. I. Bertiger, S. M. Lichten, *Effects of antenna orientation on GPS carrier
//! phase*, Manuscripta Geodaetica 18 (1993), equations (20)–(30). With k the unit vector from satellite to receiver and
//! the effective dipoles D' = x' − k (k·x') − k × y' (satellite) and D = x − k (k·x) + k × y (receiver), the wind-up is
//! the signed angle from D' to D about k, in cycles. x is north and y is west at a fixed receiver.
//!
//! The angle is known up to whole cycles only: the previous value of the arc says which. Cost: one arctangent. Panic
//! contract: none.

use super::attitude::Axes;
use super::geodesy::Geodetic;
use core::f64::consts::TAU;
use nalgebra::Vector3;

/// The two arms of a receiver's dipole: unit vectors, ECEF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceiverDipole {
    /// x arm: north for an antenna that is set up as it should be.
    pub x: Vector3<f64>,
    /// y arm: west.
    pub y: Vector3<f64>,
}

impl ReceiverDipole {
    /// An antenna that points to the zenith and is aligned with north. One that is turned about the vertical, as on a
    /// vehicle, adds the same number of cycles to all satellites, which is the receiver clock's.
    pub fn level(place: &Geodetic) -> Self {
        Self { x: place.enu_to_ecef(&Vector3::y()), y: place.enu_to_ecef(&-Vector3::x()) }
    }
}

/// Wind-up `[cycles]`, to be *added* to the modelled carrier phase range as λ · wind-up.
///
/// `satellite`: its body axes. `direction`: unit vector from receiver to satellite, ECEF (that the two are of the frames
/// of transmission and reception, 70 ms apart, is 1e-6 cycles). `previous`: the wind-up of the last epoch of this arc,
/// from which the new one differs by at most half a cycle; without it the result is in −½…½.
///
/// `None` where the direction is along a dipole's blind axis, or an input is not finite.
pub fn wind_up(
    satellite: &Axes,
    receiver: &ReceiverDipole,
    direction: &Vector3<f64>,
    previous: Option<f64>,
) -> Option<f64> {
    let k = -direction;
    let sent = satellite.x - k * k.dot(&satellite.x) - k.cross(&satellite.y);
    let received = receiver.x - k * k.dot(&receiver.x) + k.cross(&receiver.y);
    let (sin, cos) = (k.dot(&sent.cross(&received)), sent.dot(&received));
    let size = libm::hypot(sin, cos);
    // (Dipole vectors are of length 0…2; NaN is no size at all.)
    if !(size > 1e-9 && size.is_finite()) {
        return None;
    }
    let fraction = libm::atan2(sin, cos) / TAU;
    let whole = previous.map_or(0.0, |previous| libm::floor(previous - fraction + 0.5));
    Some(fraction + whole).filter(|cycles| cycles.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn place() -> Geodetic {
        Geodetic { latitude: 0.6, longitude: 0.2, height: 100.0 }
    }

    /// A satellite at the zenith of [`place`] whose x axis is turned from north towards east by `angle` `[rad]`.
    fn zenith(angle: f64) -> (Axes, Vector3<f64>) {
        let place = place();
        let up = place.enu_to_ecef(&Vector3::z());
        let x = place.enu_to_ecef(&Vector3::new(angle.sin(), angle.cos(), 0.0));
        let z = -up;
        (Axes { x, y: z.cross(&x), z }, up)
    }

    #[test]
    fn at_the_zenith_the_wind_up_is_the_turn_of_the_satellite() {
        let receiver = ReceiverDipole::level(&place());
        for angle in [-3.0, -1.0, 0.0, 0.5, 3.0] {
            let (axes, up) = zenith(angle);
            // About k, which points down, from D' (north turned to east by angle) to D (north): −angle in the sense of
            // a right hand about the nadir, in which east follows north.
            let expected = -angle / TAU;
            let found = wind_up(&axes, &receiver, &up, None).unwrap();
            assert!((found - expected).abs() < 1e-12, "{angle}: {found} {expected}");
        }
    }

    #[test]
    fn a_turning_satellite_adds_up_cycles() {
        let receiver = ReceiverDipole::level(&place());
        let mut value = None;
        for step in 0..=400 {
            let (axes, up) = zenith(step as f64 * TAU / 100.0);
            value = wind_up(&axes, &receiver, &up, value);
        }
        assert!((value.unwrap() + 4.0).abs() < 1e-9, "{value:?}");
    }

    #[test]
    fn blind_directions_and_nan_have_none() {
        let receiver = ReceiverDipole::level(&place());
        let (axes, up) = zenith(0.3);
        assert_eq!(wind_up(&axes, &receiver, &-up, None), None);
        assert_eq!(wind_up(&axes, &receiver, &Vector3::repeat(f64::NAN), None), None);
        assert_eq!(wind_up(&axes, &receiver, &up, Some(f64::NAN)), None);
    }

    proptest! {
        #[test]
        fn the_new_value_is_near_the_previous(angle in -3.2..3.2_f64, east in -1.0..1.0_f64, previous in -50.0..50.0_f64) {
            let (axes, up) = zenith(angle);
            let direction = (up + place().enu_to_ecef(&Vector3::x()) * east).normalize();
            let found = wind_up(&axes, &ReceiverDipole::level(&place()), &direction, Some(previous)).unwrap();
            prop_assert!((found - previous).abs() <= 0.5 + 1e-9);
        }
    }
}
