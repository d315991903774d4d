//! Mapping functions ready for a place and a day, and what horizontal gradients add.
//!
//! All functions in use are Marini's continued fraction in three coefficients, normalised to 1 at the zenith,
//! m(ε) = (1 + a/(1 + b/(1 + c))) / (sin ε + a/(sin ε + b/(sin ε + c))); they differ in where a, b and c come from:
//! * Niell 1996 ([`niell`]): tables in latitude;
//! * GMF ([`gmf`]): spherical harmonics of a; b and c of VMF1;
//! * VMF1 (Böhm, Werl & Schuh, J. Geophys. Res. 111, B02406 (2006)): a from a site or grid file of the day, b_h = 0.0029,
//!   b_w = 0.00146, c_w = 0.04391, c_h by latitude and season, equation (6) with table 1 of that paper as in vmf1.f;
//! * any other, VMF3 among them, by all three coefficients.
//!
//! Hydrostatic coefficients that refer to sea level get Niell's height correction,
//! (1/sin ε − m(ε; 2.53e-5, 5.49e-3, 1.14e-3)) h / 1 km.
//!
//! Gradients (Chen & Herring, J. Geophys. Res. 102 (1997), equations (4) and (9)): a delay
//! m_g(ε) (G_n cos α + G_e sin α), m_g(ε) = 1/(sin ε tan ε + 0.0032), G_n and G_e the total gradients `[m]`.
//!
//! Cost: building takes at most some 1300 operations (GMF), mapping one sine and six divisions. Panic contract: none.

use super::{gmf, niell};
use crate::gnss::geodesy::{Geodetic, LookAngle};
use crate::gnss::time::GpsTime;
use core::f64::consts::{PI, TAU};

/// Coefficients a, b, c of a continued fraction.
pub type Coefficients = [f64; 3];

/// Niell's height correction for hydrostatic functions that refer to sea level.
const HEIGHT: Coefficients = [2.53e-5, 5.49e-3, 1.14e-3];
/// Chen & Herring's C for total gradients.
const GRADIENT_C: f64 = 0.0032;
/// 1980-01-28, the reference day of the seasons of Niell and his successors, in days after the start of GPS time.
const REFERENCE_DAY: f64 = 22.0;

/// Which mapping functions to use.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum MappingFunction {
    /// Niell 1996, from latitude, height and day.
    Niell,
    /// Global Mapping Function, from place and day. The default: it is free of the latitude and height dependent errors
    /// of Niell's (15 mm in height in the south) and needs no file.
    #[default]
    Gmf,
    /// VMF1 with a of the day.
    Vmf1 {
        /// Hydrostatic a.
        hydrostatic: f64,
        /// Wet a.
        wet: f64,
        /// Whether the hydrostatic a refers to sea level (grid files), not to the height of the site (site files).
        at_sea_level: bool,
    },
    /// All coefficients as given, for instance those of VMF3.
    Given {
        /// Hydrostatic a, b, c.
        hydrostatic: Coefficients,
        /// Wet a, b, c.
        wet: Coefficients,
        /// Whether the hydrostatic ones refer to sea level.
        at_sea_level: bool,
    },
}

impl MappingFunction {
    /// The functions for a receiver at `receiver` around `time`.
    pub fn at(self, time: GpsTime, receiver: &Geodetic) -> SiteMapping {
        match self {
            Self::Niell => niell::site(time.day_of_year(), receiver),
            Self::Gmf => gmf::site(time, receiver),
            Self::Vmf1 { hydrostatic, wet, at_sea_level } => vmf1([hydrostatic, wet], at_sea_level, time, receiver),
            Self::Given { hydrostatic, wet, at_sea_level } => {
                SiteMapping { hydrostatic, wet, height: if at_sea_level { receiver.height } else { 0.0 } }
            }
        }
    }
}

/// Mapping functions of a place and a day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SiteMapping {
    /// Hydrostatic a, b, c.
    pub hydrostatic: Coefficients,
    /// Wet a, b, c.
    pub wet: Coefficients,
    /// Height above that which the hydrostatic coefficients refer to `[m]`.
    pub height: f64,
}

impl SiteMapping {
    /// Hydrostatic mapping function at an elevation of sine `sin`.
    pub fn hydrostatic(&self, sin: f64) -> f64 {
        fraction(self.hydrostatic, sin) + (1.0 / sin - fraction(HEIGHT, sin)) * self.height / 1e3
    }

    /// Wet mapping function at an elevation of sine `sin`.
    pub fn wet(&self, sin: f64) -> f64 {
        fraction(self.wet, sin)
    }
}

/// VMF1 with given a, hydrostatic and wet.
pub(super) fn vmf1(
    [hydrostatic, wet]: [f64; 2],
    at_sea_level: bool,
    time: GpsTime,
    receiver: &Geodetic,
) -> SiteMapping {
    let (c11, c10, phase) = if receiver.latitude < 0.0 { (0.007, 0.002, PI) } else { (0.005, 0.001, 0.0) };
    let season = (libm::cos(year_angle(time) + phase) + 1.0) * c11 / 2.0 + c10;
    let c = 0.062 + season * (1.0 - libm::cos(receiver.latitude));
    SiteMapping {
        hydrostatic: [hydrostatic, 0.0029, c],
        wet: [wet, 0.00146, 0.04391],
        height: if at_sea_level { receiver.height } else { 0.0 },
    }
}

/// The season as an angle `[rad]`, 0 on 28 January.
pub(super) fn year_angle(time: GpsTime) -> f64 {
    (time.since(GpsTime::default()) / 86_400.0 - REFERENCE_DAY) / 365.25 * TAU
}

/// Marini's continued fraction, normalised to 1 at the zenith.
fn fraction([a, b, c]: Coefficients, sin: f64) -> f64 {
    (1.0 + a / (1.0 + b / (1.0 + c))) / (sin + a / (sin + b / (sin + c)))
}

/// Partial derivatives of a slant delay by the gradients to north and east `[m]`, dimensionless: a gradient of 1 mm adds
/// 16 mm in its direction at 14° of elevation.
pub fn gradients(look: LookAngle) -> [f64; 2] {
    let (sin_azimuth, cos_azimuth) = libm::sincos(look.azimuth);
    let (sin, cos) = libm::sincos(look.elevation);
    let mapping = cos / (sin * sin + GRADIENT_C * cos);
    [mapping * cos_azimuth, mapping * sin_azimuth]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn gradients_are_those_of_chen_and_herring() {
        let at = |degrees: f64, azimuth| gradients(LookAngle { elevation: degrees.to_radians(), azimuth });
        // 1/(sin 10° tan 10° + 0.0032) = 1/(0.0306186 + 0.0032).
        let [north, east] = at(10.0, 0.0);
        assert!((north - 29.5695).abs() < 1e-3 && east == 0.0);
        let [north, east] = at(90.0, 1.0);
        assert!(north.abs() < 1e-15 && east.abs() < 1e-15);
        let [north, east] = at(10.0, PI / 2.0);
        assert!(north.abs() < 1e-14 && (east - 29.5695).abs() < 1e-3);
    }

    #[test]
    fn the_reference_day_is_28_january() {
        let day = crate::gnss::time::Calendar::date(1980, 1, 28);
        assert_eq!(year_angle(GpsTime::from_calendar(&day).unwrap()), 0.0);
    }

    #[test]
    fn vmf1_is_that_of_the_iers_conventions() {
        // Test cases in the headers of VMF1.F and VMF1_HT.F (IERS Conventions 2010, chapter 9): ah = 0.00127683,
        // aw = 0.00060955, MJD 55055, latitude 0.6708665767 rad, 824.17 m, zenith distance 1.278564131 rad.
        let time = GpsTime::default().plus_seconds((55_055.0 - 44_244.0) * 86_400.0);
        let receiver = Geodetic { latitude: 0.670_866_576_7, longitude: 0.0, height: 824.17 };
        let sin = libm::cos(1.278_564_131);
        for (at_sea_level, hydrostatic) in [(false, 3.424_342_122_738_070_6), (true, 3.425_088_087_972_572_5)] {
            let function = MappingFunction::Vmf1 { hydrostatic: 0.001_276_83, wet: 0.000_609_55, at_sea_level };
            let site = function.at(time, &receiver);
            assert!((site.hydrostatic(sin) - hydrostatic).abs() < 1e-12);
            assert!((site.wet(sin) - 3.448_299_714_692_572_2).abs() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn all_functions_are_one_at_the_zenith_and_close_to_each_other_above_10_degrees(
            day in 0.0..2e4f64, latitude in -1.5..1.5f64, longitude in -3.1..3.1f64, height in 0.0..3e3f64,
            elevation in 0.18..1.57f64,
        ) {
            let receiver = Geodetic { latitude, longitude, height };
            let time = GpsTime::default().plus_seconds(day * 86_400.0);
            let (niell, gmf) = (MappingFunction::Niell.at(time, &receiver), MappingFunction::Gmf.at(time, &receiver));
            for site in [niell, gmf] {
                prop_assert!((site.hydrostatic(1.0) - 1.0).abs() < 1e-12 && (site.wet(1.0) - 1.0).abs() < 1e-12);
            }
            let sin = libm::sin(elevation);
            // Böhm et al. 2006, figure 2: a few centimetres of 12 m at 5°; 0.5 % bounds that at 10°.
            prop_assert!((niell.hydrostatic(sin) / gmf.hydrostatic(sin) - 1.0).abs() < 5e-3);
        }

        #[test]
        fn takes_anything(ns: i64, latitude: f64, longitude: f64, height: f64, elevation: f64, azimuth: f64) {
            let receiver = Geodetic { latitude, longitude, height };
            for function in [MappingFunction::Niell, MappingFunction::Gmf] {
                let site = function.at(GpsTime::from_nanoseconds(ns), &receiver);
                let _ = (site.hydrostatic(elevation), site.wet(elevation));
            }
            let _ = gradients(LookAngle { azimuth, elevation });
        }
    }
}
