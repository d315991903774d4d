//! How the Earth stands in space: rotation angle, sidereal time, precession, nutation, polar motion.
//!
//! What the models of tides, attitude and wind-up need: the direction of Sun and Moon in ECEF to arcseconds. For that,
//! GCRS → ITRS here is
//!
//! W(x_p, y_p) · R₃(GAST) · R₁(−ε_A − Δε) R₃(−ψ̄ − Δψ) R₁(φ̄) R₃(γ̄)
//!
//! with the Fukushima–Williams angles of the IAU 2006 precession, frame bias included (Capitaine and Wallace 2006,
//! A&A 450, eq. 39–40; IERS Conventions 2010, 5.6.4), the terms of the IAU 2000B nutation from 0.01″ on (McCarthy and
//! Luzum 2003, table 1), and GAST = GMST₂₀₀₆ + Δψ cos ε_A ([`EarthOrientation`] has polar motion and UT1). What is left
//! out sums to less than 0.1″ (5·10⁻⁷); against pyerfa's c2t06a at eight epochs, 4.4·10⁻⁸.
//!
//! Times: TT = GPST + 51.184 s exactly; UT1 = UTC + [`EarthOrientation::ut1_minus_utc`]. Centuries are Julian, from
//! J2000.0. Cost: ten pairs of sine and cosine for the arguments, one for each angle; no memory. Panic contract: none;
//! an orientation that is not finite gives results that are not finite.

use super::time::GpsTime;
use core::f64::consts::TAU;
use nalgebra::{Matrix3, Vector3};

/// One arcsecond `[rad]`.
pub const ARCSECOND: f64 = TAU / 1_296_000.0;
/// One degree `[rad]`.
pub(super) const DEGREE: f64 = TAU / 360.0;
const NS_PER_DAY: i64 = 86_400_000_000_000;
/// From GPST midnight 1980-01-06 to J2000.0 (2000-01-01 12:00) `[d]`.
const GPS_EPOCH_TO_J2000: f64 = 7_300.5;
/// TT − GPST `[ns]`: TAI − GPST = 19 s, TT − TAI = 32.184 s.
const TT_MINUS_GPST_NS: i64 = 51_184_000_000;

/// Orientation of the Earth at an epoch as services publish it (IERS Bulletin A and C04, IGS ERP files). The default
/// is zero: 0.5″ and 0.9 s (14″) off at most, which is enough for directions to the Sun, not for the pole tide.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EarthOrientation {
    /// Polar motion x_p `[rad]`, towards the Greenwich meridian.
    pub xp: f64,
    /// Polar motion y_p `[rad]`, towards 90° west.
    pub yp: f64,
    /// UT1 − UTC `[s]`.
    pub ut1_minus_utc: f64,
}

/// Days since 1980-01-06 and fraction of the day `[d]`, both UTC. A leap second reads as the one that follows.
pub(super) fn utc_day(time: GpsTime) -> (f64, f64) {
    let utc = time.nanoseconds().saturating_sub(time.gpst_minus_utc().saturating_mul(1_000_000_000));
    (utc.div_euclid(NS_PER_DAY) as f64, utc.rem_euclid(NS_PER_DAY) as f64 / NS_PER_DAY as f64)
}

/// Days since 1980-01-06 and fraction of the day `[d]`, both UT1; the fraction may lie outside 0…1 by UT1 − UTC.
fn ut1_day(time: GpsTime, orientation: &EarthOrientation) -> (f64, f64) {
    let (day, fraction) = utc_day(time);
    (day, fraction + orientation.ut1_minus_utc / 86_400.0)
}

/// Days since J2000.0 on the GPS time scale `[d]`.
pub(super) fn days_since_j2000(time: GpsTime) -> f64 {
    time.nanoseconds() as f64 / NS_PER_DAY as f64 - GPS_EPOCH_TO_J2000
}

/// Julian centuries of TT since J2000.0.
pub fn terrestrial_centuries(time: GpsTime) -> f64 {
    days_since_j2000(GpsTime::from_nanoseconds(time.nanoseconds().saturating_add(TT_MINUS_GPST_NS))) / 36_525.0
}

/// The fraction of a turn as an angle `[rad]`, 0…2π.
fn turns(turns: f64) -> f64 {
    TAU * (turns - libm::floor(turns))
}

/// Earth rotation angle `[rad]`, 0…2π (IERS Conventions 2010, eq. 5.15).
pub fn earth_rotation_angle(time: GpsTime, orientation: &EarthOrientation) -> f64 {
    let (day, fraction) = ut1_day(time, orientation);
    let since_j2000 = day - GPS_EPOCH_TO_J2000 + fraction;
    turns(0.779_057_273_264_0 + 0.002_737_811_911_354_48 * since_j2000 + 0.5 + fraction)
}

/// Greenwich mean sidereal time of 1982 `[rad]`, 0…2π, as broadcast and older products use it (Aoki et al. 1982, A&A
/// 105, eq. 14). It goes with the IAU 1976 precession and differs from [`mean_sidereal_time`] by 0.07″ in 2024.
pub fn mean_sidereal_time_1982(time: GpsTime, orientation: &EarthOrientation) -> f64 {
    let (day, fraction) = ut1_day(time, orientation);
    let t = (day - GPS_EPOCH_TO_J2000 + fraction) / 36_525.0;
    // (The published constant is for 0 h; the polynomial runs from noon, half a day of 86400 s later.)
    let seconds = 24_110.548_41 - 43_200.0 + (8_640_184.812_866 + (0.093_104 - 6.2e-6 * t) * t) * t;
    turns(seconds / 86_400.0 + 0.5 + fraction)
}

/// Greenwich mean sidereal time of the IAU 2006 precession `[rad]`, 0…2π (IERS Conventions 2010, eq. 5.32).
pub fn mean_sidereal_time(time: GpsTime, orientation: &EarthOrientation) -> f64 {
    let t = terrestrial_centuries(time);
    let accumulated = 0.014_506 + (4_612.156_534 + (1.391_581_7 - 0.000_000_44 * t) * t) * t;
    turns((earth_rotation_angle(time, orientation) + accumulated * ARCSECOND) / TAU)
}

/// Fundamental arguments of the Moon's and Sun's motion `[rad]`, not reduced to one turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delaunay {
    /// Mean anomaly of the Moon, l.
    pub moon_anomaly: f64,
    /// Mean anomaly of the Sun, l′.
    pub sun_anomaly: f64,
    /// Mean longitude of the Moon minus that of its node, F.
    pub latitude_argument: f64,
    /// Mean elongation of the Moon from the Sun, D.
    pub elongation: f64,
    /// Mean longitude of the Moon's ascending node, Ω.
    pub node: f64,
}

impl Delaunay {
    /// At `t` Julian centuries of TT since J2000.0 (IERS Conventions 2010, eq. 5.43).
    pub fn at(t: f64) -> Self {
        let polynomial =
            |degrees: f64, [a, b, c, d]: [f64; 4]| degrees * DEGREE + (a + (b + (c + d * t) * t) * t) * t * ARCSECOND;
        Self {
            moon_anomaly: polynomial(134.963_402_51, [1_717_915_923.217_8, 31.879_2, 0.051_635, -0.000_244_70]),
            sun_anomaly: polynomial(357.529_109_18, [129_596_581.048_1, -0.553_2, 0.000_136, -0.000_011_49]),
            latitude_argument: polynomial(93.272_090_62, [1_739_527_262.847_8, -12.751_2, -0.001_037, 0.000_004_17]),
            elongation: polynomial(297.850_195_47, [1_602_961_601.209_0, -6.370_6, 0.006_593, -0.000_031_69]),
            node: polynomial(125.044_555_01, [-6_962_890.543_1, 7.472_2, 0.007_702, -0.000_059_39]),
        }
    }
}

/// Nutation in longitude and obliquity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nutation {
    /// Δψ `[rad]`.
    pub longitude: f64,
    /// Δε `[rad]`.
    pub obliquity: f64,
}

/// Multiples of l, l′, F, D, Ω; then the amplitudes in longitude (sine) and obliquity (cosine) `[0.1 mas]`: the terms
/// of IAU 2000B (McCarthy and Luzum 2003, Celest. Mech. 85, table 1) from 0.01″ in longitude on.
const NUTATION: [([f64; 5], f64, f64); 13] = [
    ([0., 0., 0., 0., 1.], -172_064.161, 92_052.331),
    ([0., 0., 2., -2., 2.], -13_170.906, 5_730.336),
    ([0., 0., 2., 0., 2.], -2_276.413, 978.459),
    ([0., 0., 0., 0., 2.], 2_074.554, -897.492),
    ([0., 1., 0., 0., 0.], 1_475.877, 73.871),
    ([1., 0., 0., 0., 0.], 711.159, -6.750),
    ([0., 1., 2., -2., 2.], -516.821, 224.386),
    ([0., 0., 2., 0., 1.], -387.298, 200.728),
    ([1., 0., 2., 0., 2.], -301.461, 129.025),
    ([0., -1., 2., -2., 2.], 215.829, -95.929),
    ([-1., 0., 0., 2., 0.], 156.994, -1.235),
    ([0., 0., 2., -2., 1.], 128.227, -68.982),
    ([-1., 0., 2., 0., 2.], 123.457, -53.311),
];

impl Nutation {
    /// For the arguments at an epoch; good to 0.05″.
    pub fn of(arguments: &Delaunay) -> Self {
        let Delaunay { moon_anomaly, sun_anomaly, latitude_argument, elongation, node } = *arguments;
        let (mut longitude, mut obliquity) = (0.0, 0.0);
        for ([l, l_sun, f, d, omega], in_longitude, in_obliquity) in NUTATION {
            let argument =
                l * moon_anomaly + l_sun * sun_anomaly + f * latitude_argument + d * elongation + omega * node;
            let (sin, cos) = libm::sincos(argument);
            longitude += in_longitude * sin;
            obliquity += in_obliquity * cos;
        }
        let unit = 1e-4 * ARCSECOND;
        Self { longitude: longitude * unit, obliquity: obliquity * unit }
    }
}

/// Mean obliquity of the ecliptic ε_A `[rad]` at `t` Julian centuries of TT (IAU 2006; IERS Conventions 2010, eq.
/// 5.40).
pub fn mean_obliquity(t: f64) -> f64 {
    (84_381.406 + (-46.836_769 + (-0.000_183_1 + 0.002_003_40 * t) * t) * t) * ARCSECOND
}

/// The frame turned by `angle` `[rad]` about its first axis.
pub(super) fn turn_1(angle: f64) -> Matrix3<f64> {
    let (sin, cos) = libm::sincos(angle);
    Matrix3::new(1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, -sin, cos)
}

/// The frame turned by `angle` `[rad]` about its third axis.
pub(super) fn turn_3(angle: f64) -> Matrix3<f64> {
    let (sin, cos) = libm::sincos(angle);
    Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0)
}

/// Rotation from the equator and equinox of date (with nutation) to ECEF: W · R₃(GAST). Squares of the polar motion,
/// 10⁻¹², are left out.
pub fn true_of_date_to_itrs(time: GpsTime, orientation: &EarthOrientation, nutation: &Nutation) -> Matrix3<f64> {
    let EarthOrientation { xp, yp, .. } = *orientation;
    let equinoxes = nutation.longitude * libm::cos(mean_obliquity(terrestrial_centuries(time)));
    let pole = Matrix3::new(1.0, 0.0, xp, 0.0, 1.0, -yp, -xp, yp, 1.0);
    pole * turn_3(mean_sidereal_time(time, orientation) + equinoxes)
}

/// Rotation from the celestial frame (GCRS) to ECEF (ITRS); good to 5·10⁻⁷.
pub fn gcrs_to_itrs(time: GpsTime, orientation: &EarthOrientation) -> Matrix3<f64> {
    let t = terrestrial_centuries(time);
    let nutation = Nutation::of(&Delaunay::at(t));
    let polynomial = |[a, b, c, d]: [f64; 4]| (a + (b + (c + d * t) * t) * t) * ARCSECOND;
    let gamma = polynomial([-0.052_928, 10.556_378, 0.493_204_4, -0.000_312_38]);
    let phi = polynomial([84_381.412_819, -46.811_016, 0.051_126_8, 0.000_532_89]);
    let psi = polynomial([-0.041_775, 5_038.481_484, 1.558_417_5, -0.000_185_22]);
    let obliquity = mean_obliquity(t) + nutation.obliquity;
    let to_date = turn_1(-obliquity) * turn_3(-psi - nutation.longitude) * turn_1(phi) * turn_3(gamma);
    true_of_date_to_itrs(time, orientation, &nutation) * to_date
}

/// A vector of the ecliptic and mean equinox of date, expressed in the equator and equinox of date with nutation.
pub(super) fn ecliptic_to_true_of_date(vector: &Vector3<f64>, t: f64, nutation: &Nutation) -> Vector3<f64> {
    turn_1(-mean_obliquity(t) - nutation.obliquity) * turn_3(-nutation.longitude) * vector
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn degrees(hours: f64, minutes: f64, seconds: f64) -> f64 {
        (hours + minutes / 60.0 + seconds / 3_600.0) * 15.0
    }

    #[test]
    fn sidereal_time_and_nutation_agree_with_the_published_examples() {
        // Meeus, Astronomical Algorithms (2nd ed.), examples 12.a and 12.b: 1987-04-10, 0 h and 19:21:00 UT.
        let date = crate::gnss::time::Calendar::date(1987, 4, 10);
        let midnight = GpsTime::from_utc(&date).unwrap();
        let zero = EarthOrientation::default();
        let at = |seconds| mean_sidereal_time_1982(midnight.plus_seconds(seconds), &zero).to_degrees();
        assert!((at(0.0) - degrees(13.0, 10.0, 46.366_8)).abs() < 1e-6, "{}", at(0.0));
        assert!((at(69_660.0) - degrees(8.0, 34.0, 57.089_6)).abs() < 1e-6, "{}", at(69_660.0));
        // Example 22.a: 1987-04-10 0 h TD: Δψ = −3.788″, Δε = +9.443″, ε₀ = 23°26′27.407″, each of the IAU 1980 theory,
        // which differs from that of 2000 by less than 0.02″ in these.
        let t = terrestrial_centuries(midnight.plus_seconds(-55.184));
        let nutation = Nutation::of(&Delaunay::at(t));
        assert!((t + 0.127_296_372_348).abs() < 1e-9, "{t}");
        assert!((nutation.longitude / ARCSECOND + 3.788).abs() < 0.05, "{}", nutation.longitude / ARCSECOND);
        assert!((nutation.obliquity / ARCSECOND - 9.443).abs() < 0.05, "{}", nutation.obliquity / ARCSECOND);
        assert!((mean_obliquity(t).to_degrees() - (23.0 + 26.0 / 60.0 + 27.407 / 3_600.0)).abs() < 0.05 / 3_600.0);
    }

    #[test]
    fn both_sidereal_times_agree_to_the_precession_between_their_theories() {
        let zero = EarthOrientation::default();
        for week in [1_100, 1_500, 2_000, 2_400] {
            let time = GpsTime::from_week_tow(week, 1e5);
            let difference = mean_sidereal_time(time, &zero) - mean_sidereal_time_1982(time, &zero);
            // IAU 2006 minus 1976: −0.3″ a century in the precession in right ascension (Capitaine et al. 2003).
            assert!(difference.abs() < 0.1 * ARCSECOND, "{}", difference / ARCSECOND);
        }
    }

    proptest! {
        #[test]
        fn rotations_are_rotations_and_turn_once_a_sidereal_day(week in 0..3_000i32, tow in 0.0..604_800.0f64) {
            let time = GpsTime::from_week_tow(week, tow);
            let orientation = EarthOrientation { xp: 1e-6, yp: -2e-6, ut1_minus_utc: 0.3 };
            let rotation = gcrs_to_itrs(time, &orientation);
            prop_assert!((rotation * rotation.transpose() - Matrix3::identity()).amax() < 1e-11);
            // A sidereal day of 86164.0989 s (IAU 1982; Explanatory Supplement 2013, table 1.1); precession moves
            // 0.14″.
            let later = gcrs_to_itrs(time.plus_seconds(86_164.098_9), &orientation);
            if time.gpst_minus_utc() == time.plus_seconds(86_400.0).gpst_minus_utc() {
                prop_assert!((rotation - later).amax() < 0.4 * ARCSECOND);
            }
        }

        #[test]
        fn takes_anything(ns: i64, xp: f64, yp: f64, ut1_minus_utc: f64) {
            let (time, orientation) = (GpsTime::from_nanoseconds(ns), EarthOrientation { xp, yp, ut1_minus_utc });
            let _ = (gcrs_to_itrs(time, &orientation), mean_sidereal_time_1982(time, &orientation));
        }
    }
}
