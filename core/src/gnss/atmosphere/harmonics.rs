//! Spherical harmonics to degree and order 9, as GMF and GPT are given in.
//!
//! With the direction x = cos φ cos λ, y = cos φ sin λ, z = sin φ, the unnormalised functions V_nm = P_nm(z) cos mλ and
//! W_nm = P_nm(z) sin mλ follow from V_00 = 1, W_00 = 0 by (Montenbruck & Gill, *Satellite Orbits*, section 3.2.4)
//! * V_mm = (2m − 1) (x V_{m−1,m−1} − y W_{m−1,m−1}), W_mm = (2m − 1) (x W_{m−1,m−1} + y V_{m−1,m−1}),
//! * V_{n+1,m} = ((2n + 1) z V_nm − (n + m) V_{n−1,m}) / (n − m + 1), and likewise W.
//!
//! Order: m = 0…9, and within it n = m…9. Cost: a basis takes 880 bytes and some 600 operations, a field 220
//! operations. Panic contract: never panics.

use crate::gnss::geodesy::Geodetic;

/// Highest degree and order.
const DEGREE: u8 = 9;
/// Number of terms: (9 + 1) (9 + 2) / 2.
const TERMS: usize = 55;

/// Coefficients of V and W of a quantity over the Earth.
pub(super) type Field = [[f64; 2]; TERMS];

/// V and W at a place.
pub(super) struct Harmonics([[f64; 2]; TERMS]);

impl Harmonics {
    /// At the geodetic latitude and longitude of a place, taken for spherical as the models do.
    pub(super) fn at(place: &Geodetic) -> Self {
        let (z, cos_latitude) = libm::sincos(place.latitude);
        let (sin_longitude, cos_longitude) = libm::sincos(place.longitude);
        let (x, y) = (cos_latitude * cos_longitude, cos_latitude * sin_longitude);

        let mut terms = [[0.0; 2]; TERMS];
        let mut slots = terms.iter_mut();
        let mut sectoral = [1.0, 0.0];
        for order in 0..=DEGREE {
            let m = f64::from(order);
            let (mut before, mut this) = ([0.0; 2], sectoral);
            for degree in order..=DEGREE {
                let n = f64::from(degree);
                if let Some(slot) = slots.next() {
                    *slot = this;
                }
                let next = |this: f64, before: f64| ((2.0 * n + 1.0) * z * this - (n + m) * before) / (n - m + 1.0);
                (before, this) = (this, [next(this[0], before[0]), next(this[1], before[1])]);
            }
            let [v, w] = sectoral;
            sectoral = [(2.0 * m + 1.0) * (x * v - y * w), (2.0 * m + 1.0) * (x * w + y * v)];
        }
        Self(terms)
    }

    /// Value of a field here, in its unit.
    pub(super) fn of(&self, field: &Field) -> f64 {
        field.iter().zip(&self.0).map(|([a, b], [v, w])| a * v + b * w).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_terms_are_legendre_functions() {
        let (latitude, longitude): (f64, f64) = (0.4, -1.1);
        let Harmonics(terms) = Harmonics::at(&Geodetic { latitude, longitude, height: 0.0 });
        let (z, c) = latitude.sin_cos();
        // P_20 = (3z² − 1)/2, P_11 = cos φ, P_21 = 3 z cos φ,
        // P_99 = 17!! cos⁹ φ (Abramowitz & Stegun 8.6, without the Condon–Shortley sign).
        assert!((terms[2][0] - (3.0 * z * z - 1.0) / 2.0).abs() < 1e-15);
        assert!((terms[10][0] - c * longitude.cos()).abs() < 1e-15);
        assert!((terms[11][1] - 3.0 * z * c * longitude.sin()).abs() < 1e-15);
        let sectoral = 34_459_425.0 * c.powi(9);
        assert!((terms[54][0] - sectoral * (9.0 * longitude).cos()).abs() < 1e-14 * sectoral);
        assert!((terms[54][1] - sectoral * (9.0 * longitude).sin()).abs() < 1e-14 * sectoral);
    }
}
