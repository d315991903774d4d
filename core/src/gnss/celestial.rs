//! Where Sun and Moon are, in ECEF.
//!
//! * Sun: the mean elements of the orbit of the Earth–Moon barycentre with the equation of the centre (Meeus,
//!   Astronomical Algorithms, 2nd ed., eq. 25.2–25.5), from which the Earth's own swing about the barycentre, 6″, is
//!   taken with the Moon. The planets' pull is left out.
//! * Moon: the terms of the ELP-2000/82 theory from 0.002° in longitude and 0.001° in latitude on (Meeus, tables 47.A
//!   and 47.B, which are after Chapront).
//!
//! Both come out in the ecliptic and mean equinox *of date*: precession is in them already and must not be applied
//! again. [`earth_rotation`](super::earth_rotation) adds nutation, sidereal time and polar motion. Positions are
//! geometric, without light time and aberration (20″ for the Sun).
//!
//! Against JPL's DE421 at eight epochs from 2005 to 2024: Sun 20″ and 4200 km, Moon 19″ and 20 km at most, by which a
//! solid tide is off by 35 µm at most (30 cases). Enough for tides, attitude and wind-up. Cost: 90 pairs of sine and
//! cosine, 1 KB of tables. Panic contract: none; an orientation that is not finite gives positions that are not finite.

use super::earth_rotation::{
    DEGREE, Delaunay, EarthOrientation, Nutation, ecliptic_to_true_of_date, terrestrial_centuries, true_of_date_to_itrs,
};
use super::time::GpsTime;
use nalgebra::Vector3;

/// The astronomical unit `[m]` (IAU 2012 resolution B2).
const ASTRONOMICAL_UNIT: f64 = 149_597_870_700.0;
/// Mass of the Moon over that of Earth and Moon (IERS Conventions 2010, table 1.1: μ = 0.0123000371).
const MOON_OF_BOTH: f64 = 0.012_300_037_1 / 1.012_300_037_1;

/// Sun and Moon at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunMoon {
    /// The Sun, ECEF `[m]`.
    pub sun: Vector3<f64>,
    /// The Moon, ECEF `[m]`.
    pub moon: Vector3<f64>,
}

impl SunMoon {
    /// At a time. `orientation` matters little: without it, 15″ at most.
    pub fn at(time: GpsTime, orientation: &EarthOrientation) -> Self {
        let t = terrestrial_centuries(time);
        let arguments = Delaunay::at(t);
        let nutation = Nutation::of(&arguments);
        let rotation = true_of_date_to_itrs(time, orientation, &nutation);
        let to_ecef = |ecliptic: &Vector3<f64>| rotation * ecliptic_to_true_of_date(ecliptic, t, &nutation);
        let moon = moon_ecliptic(t, &arguments);
        let sun = sun_from_barycentre(t, &arguments) + moon * MOON_OF_BOTH;
        Self { sun: to_ecef(&sun), moon: to_ecef(&moon) }
    }
}

/// The Sun, ECEF `[m]`. [`SunMoon::at`] gives both bodies for the price of this.
pub fn sun(time: GpsTime, orientation: &EarthOrientation) -> Vector3<f64> {
    SunMoon::at(time, orientation).sun
}

/// The Moon, ECEF `[m]`.
pub fn moon(time: GpsTime, orientation: &EarthOrientation) -> Vector3<f64> {
    SunMoon::at(time, orientation).moon
}

fn spherical(longitude: f64, latitude: f64, radius: f64) -> Vector3<f64> {
    let (sin_lambda, cos_lambda) = libm::sincos(longitude);
    let (sin_beta, cos_beta) = libm::sincos(latitude);
    Vector3::new(cos_beta * cos_lambda, cos_beta * sin_lambda, sin_beta) * radius
}

/// The Sun seen from the barycentre of Earth and Moon, ecliptic of date `[m]`.
fn sun_from_barycentre(t: f64, arguments: &Delaunay) -> Vector3<f64> {
    let mean_longitude = 280.466_46 + (36_000.769_83 + 0.000_303_2 * t) * t;
    let eccentricity = 0.016_708_634 - (0.000_042_037 + 0.000_000_126_7 * t) * t;
    let anomaly = arguments.sun_anomaly;
    let centre = ((1.914_602 - (0.004_817 + 0.000_014 * t) * t) * libm::sin(anomaly)
        + (0.019_993 - 0.000_101 * t) * libm::sin(2.0 * anomaly)
        + 0.000_289 * libm::sin(3.0 * anomaly))
        * DEGREE;
    let radius =
        1.000_001_018 * (1.0 - eccentricity * eccentricity) / (1.0 + eccentricity * libm::cos(anomaly + centre));
    spherical(mean_longitude * DEGREE + centre, 0.0, radius * ASTRONOMICAL_UNIT)
}

/// Multiples of D, l′, l, F; longitude (sine) `[10⁻⁶ °]`, distance (cosine) `[m]` (Meeus, table 47.A).
const MOON_LONGITUDE_DISTANCE: [([i8; 4], i32, i32); 34] = [
    ([0, 0, 1, 0], 6_288_774, -20_905_355),
    ([2, 0, -1, 0], 1_274_027, -3_699_111),
    ([2, 0, 0, 0], 658_314, -2_955_968),
    ([0, 0, 2, 0], 213_618, -569_925),
    ([0, 1, 0, 0], -185_116, 48_888),
    ([0, 0, 0, 2], -114_332, -3_149),
    ([2, 0, -2, 0], 58_793, 246_158),
    ([2, -1, -1, 0], 57_066, -152_138),
    ([2, 0, 1, 0], 53_322, -170_733),
    ([2, -1, 0, 0], 45_758, -204_586),
    ([0, 1, -1, 0], -40_923, -129_620),
    ([1, 0, 0, 0], -34_720, 108_743),
    ([0, 1, 1, 0], -30_383, 104_755),
    ([2, 0, 0, -2], 15_327, 10_321),
    ([0, 0, 1, 2], -12_528, 0),
    ([0, 0, 1, -2], 10_980, 79_661),
    ([4, 0, -1, 0], 10_675, -34_782),
    ([0, 0, 3, 0], 10_034, -23_210),
    ([4, 0, -2, 0], 8_548, -21_636),
    ([2, 1, -1, 0], -7_888, 24_208),
    ([2, 1, 0, 0], -6_766, 30_824),
    ([1, 0, -1, 0], -5_163, -8_379),
    ([1, 1, 0, 0], 4_987, -16_675),
    ([2, -1, 1, 0], 4_036, -12_831),
    ([2, 0, 2, 0], 3_994, -10_445),
    ([4, 0, 0, 0], 3_861, -11_650),
    ([2, 0, -3, 0], 3_665, 14_403),
    ([0, 1, -2, 0], -2_689, -7_003),
    ([2, 0, -1, 2], -2_602, 0),
    ([2, -1, -2, 0], 2_390, 10_056),
    ([1, 0, 1, 0], -2_348, 6_322),
    ([2, -2, 0, 0], 2_236, -9_884),
    ([0, 1, 2, 0], -2_120, 5_751),
    ([0, 2, 0, 0], -2_069, 0),
];

/// Multiples of D, l′, l, F; latitude (sine) `[10⁻⁶ °]` (Meeus, table 47.B).
const MOON_LATITUDE: [([i8; 4], i32); 29] = [
    ([0, 0, 0, 1], 5_128_122),
    ([0, 0, 1, 1], 280_602),
    ([0, 0, 1, -1], 277_693),
    ([2, 0, 0, -1], 173_237),
    ([2, 0, -1, 1], 55_413),
    ([2, 0, -1, -1], 46_271),
    ([2, 0, 0, 1], 32_573),
    ([0, 0, 2, 1], 17_198),
    ([2, 0, 1, -1], 9_266),
    ([0, 0, 2, -1], 8_822),
    ([2, -1, 0, -1], 8_216),
    ([2, 0, -2, -1], 4_324),
    ([2, 0, 1, 1], 4_200),
    ([2, 1, 0, -1], -3_359),
    ([2, -1, -1, 1], 2_463),
    ([2, -1, 0, 1], 2_211),
    ([2, -1, -1, -1], 2_065),
    ([0, 1, -1, -1], -1_870),
    ([4, 0, -1, -1], 1_828),
    ([0, 1, 0, 1], -1_794),
    ([0, 0, 0, 3], -1_749),
    ([0, 1, -1, 1], -1_565),
    ([1, 0, 0, 1], -1_491),
    ([0, 1, 1, 1], -1_475),
    ([0, 1, 1, -1], -1_410),
    ([0, 1, 0, -1], -1_344),
    ([1, 0, 0, -1], -1_335),
    ([0, 0, 3, 1], 1_107),
    ([4, 0, 0, -1], 1_021),
];

/// The Moon seen from the Earth, ecliptic of date `[m]`.
fn moon_ecliptic(t: f64, arguments: &Delaunay) -> Vector3<f64> {
    let Delaunay { moon_anomaly, sun_anomaly, latitude_argument, elongation, .. } = *arguments;
    // Terms with the Sun's anomaly shrink with the eccentricity of the Earth's orbit (Meeus, eq. 47.6).
    let eccentricity = 1.0 - (0.002_516 + 0.000_007_4 * t) * t;
    let term = |[d, l_sun, l, f]: [i8; 4]| {
        let [d, l_sun_multiple, l, f] = [d, l_sun, l, f].map(f64::from);
        let argument = d * elongation + l_sun_multiple * sun_anomaly + l * moon_anomaly + f * latitude_argument;
        let factor = match l_sun {
            0 => 1.0,
            1 | -1 => eccentricity,
            _ => eccentricity * eccentricity,
        };
        (argument, factor)
    };
    let mean_longitude = 218.316_447_7 + (481_267.881_234_21 + (-0.001_578_6 + t / 538_841.0) * t) * t;
    // Action of Venus on the longitude, of the Earth's flattening on both.
    let (mut longitude, mut latitude, mut distance) = (
        3_958.0 * libm::sin((119.75 + 131.849 * t) * DEGREE)
            + 1_962.0 * libm::sin(mean_longitude * DEGREE - latitude_argument),
        -2_235.0 * libm::sin(mean_longitude * DEGREE),
        385_000_560.0,
    );
    for (multiples, in_longitude, in_distance) in MOON_LONGITUDE_DISTANCE {
        let (argument, factor) = term(multiples);
        let (sin, cos) = libm::sincos(argument);
        longitude += f64::from(in_longitude) * factor * sin;
        distance += f64::from(in_distance) * factor * cos;
    }
    for (multiples, in_latitude) in MOON_LATITUDE {
        let (argument, factor) = term(multiples);
        latitude += f64::from(in_latitude) * factor * libm::sin(argument);
    }
    spherical((mean_longitude + longitude * 1e-6) * DEGREE, latitude * 1e-6 * DEGREE, distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Julian centuries of a Julian date.
    fn centuries(julian_date: f64) -> f64 {
        (julian_date - 2_451_545.0) / 36_525.0
    }

    fn degrees_of(vector: &Vector3<f64>) -> (f64, f64, f64) {
        let longitude = vector.y.atan2(vector.x).to_degrees().rem_euclid(360.0);
        (longitude, (vector.z / vector.norm()).asin().to_degrees(), vector.norm())
    }

    #[test]
    fn the_moon_agrees_with_the_published_example() {
        // Meeus, Astronomical Algorithms (2nd ed.), example 47.a, 1992-04-12 0 h TD: λ = 133.162655° (without
        // nutation), β = −3.229126°, Δ = 368409.7 km; we leave out the small terms.
        let t = centuries(2_448_724.5);
        let (longitude, latitude, distance) = degrees_of(&moon_ecliptic(t, &Delaunay::at(t)));
        assert!((longitude - 133.162_655).abs() < 0.008, "{longitude}");
        assert!((latitude + 3.229_126).abs() < 0.005, "{latitude}");
        assert!((distance - 368_409.7e3).abs() < 2e4, "{distance}");
    }

    #[test]
    fn the_sun_agrees_with_the_published_example() {
        // Meeus, example 25.a, 1992-10-13 0 h TD: true longitude 199.90988°, R = 0.99766 au, without perturbations;
        // example 25.b: 199.907372° and 0.99760775 au by VSOP87.
        let t = centuries(2_448_908.5);
        let arguments = Delaunay::at(t);
        let from_barycentre = sun_from_barycentre(t, &arguments);
        let (longitude, _, distance) = degrees_of(&from_barycentre);
        assert!((longitude - 199.909_88).abs() < 2e-5, "{longitude}");
        assert!((distance / ASTRONOMICAL_UNIT - 0.997_66).abs() < 5e-6, "{distance}");
        let (longitude, _, distance) = degrees_of(&(from_barycentre + moon_ecliptic(t, &arguments) * MOON_OF_BOTH));
        assert!((longitude - 199.907_372).abs() < 30.0 / 3_600.0, "{longitude}");
        assert!((distance / ASTRONOMICAL_UNIT - 0.997_607_75).abs() < 1e-4, "{distance}");
    }

    #[test]
    fn at_local_noon_the_sun_is_on_the_meridian() {
        // 2020-04-15 12:00 UTC: the equation of time is −0.1 min (Astronomical Almanac 2020), 1.5′ of hour angle.
        let noon = GpsTime::from_utc(&crate::gnss::time::Calendar {
            hour: 12,
            ..crate::gnss::time::Calendar::date(2020, 4, 15)
        })
        .unwrap();
        let sun = sun(noon, &EarthOrientation::default());
        assert!(sun.x > 0.0 && (sun.y / sun.x).abs() < 2e-3, "{sun}");
    }

    proptest! {
        #[test]
        fn distances_are_those_of_the_orbits(week in 0..3_000i32, tow in 0.0..604_800.0f64) {
            let SunMoon { sun, moon } = SunMoon::at(GpsTime::from_week_tow(week, tow), &EarthOrientation::default());
            // Extremes: Meeus, Astronomical Algorithms, chapters 25 and 50.
            prop_assert!((0.9832..1.0168).contains(&(sun.norm() / ASTRONOMICAL_UNIT)), "{}", sun.norm());
            prop_assert!((356_300e3..406_800e3).contains(&moon.norm()), "{}", moon.norm());
            // Declinations: the obliquity, and the Moon's inclination of 5.3° on top.
            prop_assert!((sun.z / sun.norm()).asin().to_degrees().abs() < 23.46);
            prop_assert!((moon.z / moon.norm()).asin().to_degrees().abs() < 28.9);
        }

        #[test]
        fn takes_anything(ns: i64, xp: f64, yp: f64, ut1_minus_utc: f64) {
            let _ = SunMoon::at(GpsTime::from_nanoseconds(ns), &EarthOrientation { xp, yp, ut1_minus_utc });
        }
    }
}
