//! Solid Earth tide, IERS Conventions 2010, 7.1.1: what their routine DEHANTTIDEINEL computes, steps 1 and 2.
//!
//! * Step 1: degrees 2 and 3 with the nominal Love and Shida numbers, h₂ and l₂ depending on latitude (eq. 7.2, 7.5,
//!   7.6); the part l⁽¹⁾ (eq. 7.8, 7.9); the parts out of phase by the mantle's anelasticity (eq. 7.10, 7.11).
//! * Step 2: corrections for how the numbers depend on frequency in the diurnal and long-period bands (eq. 7.12, 7.13,
//!   tables 7.3a and 7.3b).
//! * The permanent tide is *not* removed: coordinates are conventional tide free, as those of ITRF and IGS are.
//!
//! Latitudes are geocentric. Cost: 36 pairs of sine and cosine, 1.5 KB of tables. Panic contract: none; the Earth's
//! centre, and what is not finite, give NaN.

use super::Sphere;
use crate::gnss::earth_rotation::{DEGREE, terrestrial_centuries, utc_day};
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// Equatorial radius of the Earth `[m]` (IERS Conventions 2010, table 1.1).
const EARTH_RADIUS: f64 = 6_378_136.6;
/// Mass of the Sun over that of the Earth.
const SUN_MASS: f64 = 332_946.048_2;
/// Mass of the Moon over that of the Earth.
const MOON_MASS: f64 = 0.012_300_037_1;
/// Love and Shida numbers of degree 3 (7.1.1).
const H3: f64 = 0.292;
const L3: f64 = 0.015;
/// l⁽¹⁾ of the diurnal and the semidiurnal band (7.1.1).
const L1_DIURNAL: f64 = 0.001_2;
const L1_SEMIDIURNAL: f64 = 0.002_4;
/// Imaginary parts of h and l in the diurnal and the semidiurnal band (7.1.1).
const H_IMAGINARY_DIURNAL: f64 = -0.002_5;
const L_IMAGINARY_DIURNAL: f64 = -0.000_7;
const H_IMAGINARY_SEMIDIURNAL: f64 = -0.002_2;
const L_IMAGINARY_SEMIDIURNAL: f64 = -0.000_7;

/// Multiples of s, h, p, N′, p_s beside τ; then radial and transverse corrections, in phase and out of phase `[mm]`:
/// ΔR⁽ⁱᵖ⁾, ΔR⁽ᵒᵖ⁾, ΔT⁽ⁱᵖ⁾, ΔT⁽ᵒᵖ⁾ (table 7.3a).
const DIURNAL: [([i8; 5], [f64; 4]); 29] = [
    ([-3, 0, 2, 0, 0], [-0.01, 0.0, 0.0, 0.0]),
    ([-3, 2, 0, 0, 0], [-0.01, 0.0, 0.0, 0.0]),
    ([-2, 0, 1, -1, 0], [-0.02, 0.0, 0.0, 0.0]),
    ([-2, 0, 1, 0, 0], [-0.08, 0.0, -0.01, 0.01]),
    ([-2, 2, -1, 0, 0], [-0.02, 0.0, 0.0, 0.0]),
    ([-1, 0, 0, -1, 0], [-0.10, 0.0, 0.0, 0.0]),
    ([-1, 0, 0, 0, 0], [-0.51, 0.0, -0.02, 0.03]),
    ([-1, 2, 0, 0, 0], [0.01, 0.0, 0.0, 0.0]),
    ([0, -2, 1, 0, 0], [0.01, 0.0, 0.0, 0.0]),
    ([0, 0, -1, 0, 0], [0.02, 0.0, 0.0, 0.0]),
    ([0, 0, 1, 0, 0], [0.06, 0.0, 0.0, 0.0]),
    ([0, 0, 1, 1, 0], [0.01, 0.0, 0.0, 0.0]),
    ([0, 2, -1, 0, 0], [0.01, 0.0, 0.0, 0.0]),
    ([1, -3, 0, 0, 1], [-0.06, 0.0, 0.0, 0.0]),
    ([1, -2, 0, -1, 0], [0.01, 0.0, 0.0, 0.0]),
    ([1, -2, 0, 0, 0], [-1.23, -0.07, 0.06, 0.01]),
    ([1, -1, 0, 0, -1], [0.02, 0.0, 0.0, 0.0]),
    ([1, -1, 0, 0, 1], [0.04, 0.0, 0.0, 0.0]),
    ([1, 0, 0, -1, 0], [-0.22, 0.01, 0.01, 0.0]),
    ([1, 0, 0, 0, 0], [12.00, -0.80, -0.67, -0.03]),
    ([1, 0, 0, 1, 0], [1.73, -0.12, -0.10, 0.0]),
    ([1, 0, 0, 2, 0], [-0.04, 0.0, 0.0, 0.0]),
    ([1, 1, 0, 0, -1], [-0.50, -0.01, 0.03, 0.0]),
    ([1, 1, 0, 0, 1], [0.01, 0.0, 0.0, 0.0]),
    ([0, 1, 0, 1, -1], [-0.01, 0.0, 0.0, 0.0]),
    ([1, 2, -2, 0, 0], [-0.01, 0.0, 0.0, 0.0]),
    ([1, 2, 0, 0, 0], [-0.11, 0.01, 0.01, 0.0]),
    ([2, -2, 1, 0, 0], [-0.01, 0.0, 0.0, 0.0]),
    ([2, 0, -1, 0, 0], [-0.02, 0.0, 0.0, 0.0]),
];

/// Multiples of s, h, p, N′, p_s; then ΔR⁽ⁱᵖ⁾, ΔT⁽ⁱᵖ⁾, ΔR⁽ᵒᵖ⁾, ΔT⁽ᵒᵖ⁾ `[mm]` (table 7.3b).
const LONG_PERIOD: [([i8; 5], [f64; 4]); 5] = [
    ([0, 0, 0, 1, 0], [0.47, 0.23, 0.16, 0.07]),
    ([0, 2, 0, 0, 0], [-0.20, -0.12, -0.11, -0.05]),
    ([1, 0, -1, 0, 0], [-0.11, -0.08, -0.09, -0.04]),
    ([2, 0, 0, 0, 0], [-0.13, -0.11, -0.15, -0.07]),
    ([2, 0, 0, 1, 0], [-0.05, -0.05, -0.06, -0.03]),
];

/// Displacement of a station at `station`, ECEF `[m]`, with Sun and Moon in ECEF `[m]` at `time`: ECEF `[m]`, to be
/// added.
pub fn displacement(station: &Vector3<f64>, time: GpsTime, sun: &Vector3<f64>, moon: &Vector3<f64>) -> Vector3<f64> {
    let sphere = Sphere::at(station);
    let up = station / station.norm();
    let arguments = Doodson::at(terrestrial_centuries(time), 24.0 * utc_day(time).1);
    let local = sum3(arguments.diurnal(&sphere), arguments.long_period(&sphere));
    body(&up, &sphere, sun, SUN_MASS) + body(&up, &sphere, moon, MOON_MASS) + sphere.to_ecef(local)
}

fn sum3(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Step 1 for one body.
fn body(up: &Vector3<f64>, sphere: &Sphere, position: &Vector3<f64>, mass: f64) -> Vector3<f64> {
    let Sphere { sin_phi, cos_phi, sin_lambda, cos_lambda } = *sphere;
    let distance = position.norm();
    let direction = position / distance;
    let ratio = EARTH_RADIUS / distance;
    let degree2 = mass * EARTH_RADIUS * ratio * ratio * ratio;
    let degree3 = degree2 * ratio;

    let latitude_part = 1.0 - 1.5 * cos_phi * cos_phi;
    let h2 = 0.607_8 - 0.000_6 * latitude_part;
    let l2 = 0.084_7 + 0.000_2 * latitude_part;
    let u = up.dot(&direction);
    let radial = degree2 * h2 * (1.5 * u * u - 0.5) + degree3 * H3 * (2.5 * u * u - 1.5) * u;
    let towards = degree2 * 3.0 * l2 * u + degree3 * L3 * (7.5 * u * u - 1.5);
    let in_phase = up * radial + (direction - up * u) * towards;

    // With declination Φ and Δ = longitude of the station minus that of the body: cos Φ cos Δ, cos Φ sin Δ, and
    // cos² Φ cos 2Δ, cos² Φ sin 2Δ.
    let (c1, s1) =
        (direction.x * cos_lambda + direction.y * sin_lambda, direction.x * sin_lambda - direction.y * cos_lambda);
    let (c2, s2) = (c1 * c1 - s1 * s1, 2.0 * s1 * c1);
    let (diurnal_c, diurnal_s) = (3.0 * direction.z * c1, 3.0 * direction.z * s1);
    let (sin_2phi, cos_2phi) = (2.0 * sin_phi * cos_phi, cos_phi * cos_phi - sin_phi * sin_phi);
    let radial =
        -0.5 * H_IMAGINARY_DIURNAL * sin_2phi * diurnal_s - 0.75 * H_IMAGINARY_SEMIDIURNAL * cos_phi * cos_phi * s2;
    let north = -L_IMAGINARY_DIURNAL * cos_2phi * diurnal_s + 0.75 * L_IMAGINARY_SEMIDIURNAL * sin_2phi * s2
        - L1_DIURNAL * sin_phi * sin_phi * diurnal_c
        - 1.5 * L1_SEMIDIURNAL * sin_phi * cos_phi * c2;
    let east = -L_IMAGINARY_DIURNAL * sin_phi * diurnal_c - 1.5 * L_IMAGINARY_SEMIDIURNAL * cos_phi * c2
        + L1_DIURNAL * sin_phi * cos_2phi * diurnal_s
        - 1.5 * L1_SEMIDIURNAL * sin_phi * sin_phi * cos_phi * s2;
    in_phase + sphere.to_ecef([radial, north, east]) * degree2
}

/// Arguments of step 2 `[°]` as the routine of the Conventions has them: mean longitudes of Moon, Sun, lunar perigee,
/// node (N′, negative) and solar perigee, and the lunar hour angle τ at Greenwich.
struct Doodson {
    tau: f64,
    others: [f64; 5],
}

impl Doodson {
    /// At `t` Julian centuries of TT and `hours` of the UTC day `[h]`.
    fn at(t: f64, hours: f64) -> Self {
        let polynomial = |[a, b, c, d, e]: [f64; 5]| a + (b + (c + (d + e * t) * t) * t) * t;
        let moon = polynomial([218.316_645_63, 481_267.881_94, -0.001_466_388_9, 0.000_001_851_39, 0.0]);
        let sidereal = polynomial([280.460_618_4, 36_000.770_053_6, 0.000_387_93, -0.000_000_025_8, 0.0]);
        let precession = polynomial([0.0, 1.396_971_278, 0.000_308_889, 0.000_000_021, 0.000_000_007]);
        let s = moon + precession;
        let h = polynomial([280.466_45, 36_000.769_748_9, 0.000_303_222_22, 0.000_000_020, -0.000_000_006_54]);
        let p = polynomial([83.353_243_12, 4_069.013_635_25, -0.010_321_722_22, -0.000_012_499_1, 0.000_000_052_63]);
        let n = polynomial([234.955_444_99, 1_934.136_261_97, -0.002_075_611_11, -0.000_002_139_44, 0.000_000_016_50]);
        let p_sun = polynomial([282.937_340_98, 1.719_457_666_67, 0.000_456_888_89, -0.000_000_017_78, -3.34e-9]);
        let reduced = |degrees: f64| degrees - 360.0 * libm::floor(degrees / 360.0);
        Self { tau: reduced(15.0 * hours + sidereal - moon), others: [s, h, p, n, p_sun].map(reduced) }
    }

    /// Sum of multiples of s, h, p, N′, p_s `[rad]`.
    fn sum(&self, multiples: [i8; 5]) -> f64 {
        multiples.iter().zip(self.others).map(|(&multiple, argument)| f64::from(multiple) * argument).sum::<f64>()
            * DEGREE
    }

    /// Step 2, diurnal band: radial, north, east `[m]` (eq. 7.12).
    fn diurnal(&self, sphere: &Sphere) -> [f64; 3] {
        let Sphere { sin_phi, cos_phi, sin_lambda, cos_lambda } = *sphere;
        let hour_angle = self.tau * DEGREE + libm::atan2(sin_lambda, cos_lambda);
        let (mut radial, mut transverse_s, mut transverse_c) = (0.0, 0.0, 0.0);
        for (multiples, [r_in, r_out, t_in, t_out]) in DIURNAL {
            let (sin, cos) = libm::sincos(hour_angle + self.sum(multiples));
            radial += r_in * sin + r_out * cos;
            transverse_s += t_in * sin + t_out * cos;
            transverse_c += t_in * cos - t_out * sin;
        }
        let (sin_2phi, cos_2phi) = (2.0 * sin_phi * cos_phi, cos_phi * cos_phi - sin_phi * sin_phi);
        [radial * sin_2phi * 1e-3, transverse_s * cos_2phi * 1e-3, transverse_c * sin_phi * 1e-3]
    }

    /// Step 2, long-period band: radial, north, east `[m]` (eq. 7.13).
    fn long_period(&self, sphere: &Sphere) -> [f64; 3] {
        let Sphere { sin_phi, cos_phi, .. } = *sphere;
        let (mut radial, mut north) = (0.0, 0.0);
        for (multiples, [r_in, t_in, r_out, t_out]) in LONG_PERIOD {
            let (sin, cos) = libm::sincos(self.sum(multiples));
            radial += r_in * cos + r_out * sin;
            north += t_in * cos + t_out * sin;
        }
        [radial * (1.5 * sin_phi * sin_phi - 0.5) * 1e-3, north * 2.0 * sin_phi * cos_phi * 1e-3, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::geodesy::Geodetic;
    use crate::gnss::time::Calendar;
    use proptest::prelude::*;

    fn utc_midnight(year: i32, month: u8, day: u8) -> GpsTime {
        GpsTime::from_utc(&Calendar::date(year, month, day)).unwrap()
    }

    #[test]
    fn agrees_with_the_published_case() {
        // First test case in the header of DEHANTTIDEINEL.F (IERS Conventions 2010, software of chapter 7).
        let station = Vector3::new(4_075_578.385, 931_852.890, 4_801_570.154);
        let sun = Vector3::new(137_859_926_952.015, 54_228_127_881.435, 23_509_422_341.696);
        let moon = Vector3::new(-179_996_231.920342, -312_468_450.131567, -169_288_918.592160);
        let expected = Vector3::new(0.077_004_203_571_081_26, 0.063_040_563_218_249_68, 0.055_165_681_525_972_47);
        let computed = displacement(&station, utc_midnight(2009, 4, 13), &sun, &moon);
        assert!((computed - expected).amax() < 1e-12, "{computed}");
    }

    #[test]
    fn both_corrections_of_step_2_agree_with_their_published_cases() {
        // Headers of STEP2DIU.F and STEP2LON.F: same station, T = 0.1059411362080767, 0 h.
        let sphere = Sphere::at(&Vector3::new(4_075_578.385, 931_852.890, 4_801_570.154));
        let arguments = Doodson::at(0.105_941_136_208_076_7, 0.0);
        let diurnal = Vector3::new(0.419_308_532_732_128_5e-2, 0.145_668_124_101_460_74e-2, 0.512_336_659_745_031_7e-2);
        let long = Vector3::new(-0.978_096_284_956_210_8e-4, -0.223_634_969_993_273_43e-4, 0.356_194_582_135_156_6e-3);
        assert!((sphere.to_ecef(arguments.diurnal(&sphere)) - diurnal).amax() < 1e-12);
        assert!((sphere.to_ecef(arguments.long_period(&sphere)) - long).amax() < 1e-12);
    }

    proptest! {
        /// Degree 2 alone is even: antipodes move oppositely in ECEF, so that both rise. Degree 3 is 1 mm at most.
        #[test]
        fn antipodes_rise_together(latitude in -1.57..1.57f64, longitude in -3.1..3.1f64, tow in 0.0..604_800.0f64) {
            let station = Geodetic { latitude, longitude, height: 0.0 }.to_ecef();
            let time = GpsTime::from_week_tow(2111, tow);
            let bodies = crate::gnss::celestial::SunMoon::at(time, &Default::default());
            let at = |station: &Vector3<f64>| displacement(station, time, &bodies.sun, &bodies.moon);
            prop_assert!((at(&station) + at(&-station)).norm() < 5e-3);
            prop_assert!(at(&station).norm() < 0.5);
        }

        #[test]
        fn a_body_overhead_lifts_and_one_at_the_horizon_lowers(distance in 3.5e8..4.1e8f64) {
            // Heights of the static tide by the Moon: 2 and −1 times h₂ (m R⁴ / d³) / 2 (eq. 7.5).
            let station = Vector3::new(EARTH_RADIUS, 0.0, 0.0);
            let unit = MOON_MASS * EARTH_RADIUS * (EARTH_RADIUS / distance).powi(3) * 0.6078 / 2.0;
            let (up, sphere) = (Vector3::x(), Sphere::at(&station));
            let overhead = body(&up, &sphere, &Vector3::new(distance, 0.0, 0.0), MOON_MASS);
            let horizon = body(&up, &sphere, &Vector3::new(0.0, distance, 0.0), MOON_MASS);
            prop_assert!((overhead.x / unit - 2.0).abs() < 0.03, "{}", overhead.x / unit);
            prop_assert!((horizon.x / unit + 1.0).abs() < 0.03, "{}", horizon.x / unit);
        }
    }
}
