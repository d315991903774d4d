//! Niell's mapping functions (NMF): slant over zenith delay, from latitude, height and season alone.
//!
//! Source: A. E. Niell, *Global mapping functions for the atmosphere delay at radio wavelengths*, J. Geophys. Res. 101
//! (1996), equations (4)–(6), tables 3 (hydrostatic) and 4 (wet). The coefficients of the continued fraction
//! ([`super::mapping`]) are linear in |latitude| between 15° and 75° and held outside; the hydrostatic ones vary with
//! the year around day 28 (the south is half a year later), and get a height correction.
//!
//! The day is taken with its fraction; programs that truncate it differ by 1e-7. Panic contract: never panics.

use super::mapping::{Coefficients, SiteMapping};
use crate::gnss::geodesy::Geodetic;
use core::f64::consts::PI;

/// Hydrostatic, average over the year; rows are latitudes 15°, 30°, 45°, 60°, 75°.
const AVERAGE: [Coefficients; 5] = [
    [1.2769934e-3, 2.9153695e-3, 62.610505e-3],
    [1.2683230e-3, 2.9152299e-3, 62.837393e-3],
    [1.2465397e-3, 2.9288445e-3, 63.721774e-3],
    [1.2196049e-3, 2.9022565e-3, 63.824265e-3],
    [1.2045996e-3, 2.9024912e-3, 64.258455e-3],
];
/// Hydrostatic, seasonal amplitude.
const AMPLITUDE: [Coefficients; 5] = [
    [0.0, 0.0, 0.0],
    [1.2709626e-5, 2.1414979e-5, 9.0128400e-5],
    [2.6523662e-5, 3.0160779e-5, 4.3497037e-5],
    [3.4000452e-5, 7.2562722e-5, 84.795348e-5],
    [4.1202191e-5, 11.723375e-5, 170.37206e-5],
];
/// Wet.
const WET: [Coefficients; 5] = [
    [5.8021897e-4, 1.4275268e-3, 4.3472961e-2],
    [5.6794847e-4, 1.5138625e-3, 4.6729510e-2],
    [5.8118019e-4, 1.4572752e-3, 4.3908931e-2],
    [5.9727542e-4, 1.5007428e-3, 4.4626982e-2],
    [6.1641693e-4, 1.7599082e-3, 5.4736038e-2],
];
/// The mapping functions on day `day_of_year` (1 = 1 January, with fraction) of a receiver at `receiver`.
pub fn site(day_of_year: f64, receiver: &Geodetic) -> SiteMapping {
    let Geodetic { latitude, height, .. } = *receiver;
    let half_year = if latitude < 0.0 { 0.5 } else { 0.0 };
    let season = libm::cos(2.0 * PI * ((day_of_year - 28.0) / 365.25 + half_year));
    let average = at_latitude(&AVERAGE, latitude);
    let amplitude = at_latitude(&AMPLITUDE, latitude);
    SiteMapping {
        hydrostatic: core::array::from_fn(|i| average[i] - amplitude[i] * season),
        wet: at_latitude(&WET, latitude),
        height,
    }
}

/// The table at |latitude|, linear between rows, held outside.
fn at_latitude(table: &[Coefficients; 5], latitude: f64) -> Coefficients {
    let row = (libm::fabs(latitude) * (180.0 / PI) / 15.0 - 1.0).clamp(0.0, 4.0);
    let below = (row as usize).min(3); // NaN becomes 0 here and stays NaN in the weight
    let weight = row - below as f64;
    core::array::from_fn(|i| table[below][i] * (1.0 - weight) + table[below + 1][i] * weight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hydrostatic(day_of_year: f64, latitude: f64, height: f64, elevation: f64) -> f64 {
        site(day_of_year, &Geodetic { latitude, longitude: 0.0, height }).hydrostatic(libm::sin(elevation))
    }

    fn wet(latitude: f64, elevation: f64) -> f64 {
        site(1.0, &Geodetic { latitude, longitude: 0.0, height: 0.0 }).wet(libm::sin(elevation))
    }

    #[test]
    fn agrees_with_five_programs_at_wettzell() {
        // RTKLIB demo5 2.5.1, cssrlib 1.2.1 and numpy: 5.551757108323462 and 5.656392147129067 on day 177 at 10°;
        // PRIDE (Fortran) and sidereon within 4e-8.
        let (latitude, elevation) = (0.8577246076000933, 10f64.to_radians());
        assert!((hydrostatic(177.0, latitude, 666.0, elevation) - 5.551757108323462).abs() < 1e-9);
        assert!((wet(latitude, elevation) - 5.656392147129067).abs() < 1e-9);
    }

    #[test]
    fn the_south_is_half_a_year_later() {
        let north = hydrostatic(28.0, 0.9, 0.0, 0.2);
        let south = hydrostatic(28.0 + 365.25 / 2.0, -0.9, 0.0, 0.2);
        assert!((north - south).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn is_one_at_the_zenith_and_grows_towards_the_horizon(
            day in 1.0..366.0f64, latitude in -1.57..1.57f64, height in 0.0..9e3f64, elevation in 0.05..1.5f64,
        ) {
            let dry = |elevation| hydrostatic(day, latitude, height, elevation);
            prop_assert!((dry(PI / 2.0) - 1.0).abs() < 1e-12);
            prop_assert!((wet(latitude, PI / 2.0) - 1.0).abs() < 1e-12);
            prop_assert!(dry(elevation - 0.01) > dry(elevation));
            prop_assert!(wet(latitude, elevation - 0.01) > wet(latitude, elevation));
        }

        #[test]
        fn takes_anything(day: f64, latitude: f64, height: f64, elevation: f64) {
            let _ = (hydrostatic(day, latitude, height, elevation), wet(latitude, elevation));
        }
    }
}
