//! Length, heading and pitch of a vector between two antennas.
//!
//! ```text
//! L = |b|    heading = atan2(e, n)    pitch = atan2(u, √(e² + n²))        b = (e, n, u)
//! ```
//! with standard deviations by first-order propagation of the covariance of b. Heading is clockwise from north, in
//! [0, 2π). No panics.

use nalgebra::{Matrix3, Vector3};

/// A vector's size and attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// L `[m]`.
    pub length: f64,
    /// Heading `[rad]`, clockwise from north, from 0 to below 2π.
    pub heading: f64,
    /// Pitch `[rad]`, upwards.
    pub pitch: f64,
    /// Standard deviations of length `[m]`, heading and pitch `[rad]`.
    pub sigmas: [f64; 3],
}

impl Attitude {
    /// Of a vector, east, north, up `[m]`, and its covariance `[m²]`. `None` where a vector has no direction in the plane,
    /// or is not finite.
    pub fn of(enu: &Vector3<f64>, covariance: &Matrix3<f64>) -> Option<Self> {
        let (e, n, u) = (enu.x, enu.y, enu.z);
        let plane = libm::hypot(e, n);
        let length = libm::hypot(plane, u);
        if !(length.is_finite() && plane > 0.0) {
            return None;
        }
        let heading = libm::atan2(e, n);
        let gradients = [
            enu / length,
            Vector3::new(n, -e, 0.0) / (plane * plane),
            Vector3::new(-e * u / plane, -n * u / plane, plane) / (length * length),
        ];
        let sigma = |g: Vector3<f64>| libm::sqrt((g.transpose() * covariance * g)[(0, 0)].max(0.0));
        Some(Self {
            length,
            heading: if heading < 0.0 { heading + 2.0 * core::f64::consts::PI } else { heading },
            pitch: libm::atan2(u, plane),
            sigmas: gradients.map(sigma),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 3 m east and 4 m north: 5 m, atan2(3, 4) = 36.87°; 1 cm across it is 2 mrad of heading.
    #[test]
    fn by_hand() {
        let attitude = Attitude::of(&Vector3::new(3.0, 4.0, 0.0), &(Matrix3::identity() * 1e-4)).unwrap();
        assert!((attitude.length - 5.0).abs() < 1e-15 && (attitude.heading - 0.643_501_108_793_284_4).abs() < 1e-15);
        let [length, heading, pitch] = attitude.sigmas;
        assert!((length - 0.01).abs() < 1e-15 && (heading - 0.002).abs() < 1e-15 && (pitch - 0.002).abs() < 1e-15);
        let west = Attitude::of(&Vector3::new(-1.0, 0.0, 1.0), &Matrix3::zeros()).unwrap();
        assert!((west.heading - 1.5 * core::f64::consts::PI).abs() < 1e-15);
        assert!((west.pitch - 0.25 * core::f64::consts::PI).abs() < 1e-15);
        for bad in
            [Vector3::new(0.0, 0.0, 1.0), Vector3::new(f64::NAN, 1.0, 0.0), Vector3::new(f64::INFINITY, 1.0, 0.0)]
        {
            assert_eq!(Attitude::of(&bad, &Matrix3::identity()), None);
        }
    }

    proptest! {
        /// The gradients are those of differences.
        #[test]
        fn sigmas_are_those_of_differences(e in 0.5..9.0f64, n in 0.5..9.0f64, u in -9.0..9.0f64, axis in 0usize..3) {
            let mut covariance = Matrix3::zeros();
            covariance[(axis, axis)] = 1.0;
            let (here, h) = (Vector3::new(e, n, u), 1e-6);
            let mut step = Vector3::zeros();
            step[axis] = h;
            let at = |b: Vector3<f64>| Attitude::of(&b, &covariance).unwrap();
            let (up, down) = (at(here + step), at(here - step));
            let slopes = [up.length - down.length, up.heading - down.heading, up.pitch - down.pitch].map(|d| (d / (2.0 * h)).abs());
            for (slope, sigma) in slopes.into_iter().zip(at(here).sigmas) {
                prop_assert!((slope - sigma).abs() < 1e-7, "{} {}", slope, sigma);
            }
        }
    }
}
