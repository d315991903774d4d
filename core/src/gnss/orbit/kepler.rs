//! Keplerian broadcast orbits and clocks of GPS, Galileo, BeiDou and QZSS.
//!
//! Equations: IS-GPS-200N table 20-IV (position and velocity) and 20.3.3.3.3.1 (clock); Galileo OS SIS ICD 2.1 section
//! 5.1.1; BDS-SIS-ICD-B1I 3.0 section 5.2.4.12 including the rotation of geostationary satellites,
//! R_z(ω t_k) R_x(−5°). Symbols follow table 20-IV. Velocities are the analytic derivative in the rotating frame.
//!
//! Relativity: Δt_r = F e √A sin E, F = −2 √μ / c².
//!
//! Cost: about 15 transcendental functions. Panic contract: none.

use super::{OrbitError, SatelliteState};
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::ephemeris::KeplerEphemeris;
use crate::gnss::geodesy::EARTH_ROTATION_RATE;
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// Furthest time from `toe` for which a state is computed `[s]`; good positions need a much younger ephemeris.
pub const MAX_EXTRAPOLATION: f64 = 86_400.0;
/// Greatest eccentricity that a message can express (IS-GPS-200N table 20-III: 32 bits of 2⁻³³).
const MAX_ECCENTRICITY: f64 = 0.5;
/// √A of navigation satellites `[√m]`: 20 000 to 50 000 km.
const SQRT_A_RANGE: core::ops::RangeInclusive<f64> = 4_400.0..=7_100.0;
/// Newton's method converges quadratically: for e ≤ 0.5 five steps reach the last bit.
const MAX_NEWTON_STEPS: usize = 12;
/// Inclination of the reference plane of BeiDou's geostationary satellites: −5°.
const GEO_TILT: f64 = -5.0 * core::f64::consts::PI / 180.0;

/// The constants that a constellation's ICD prescribes.
struct Constants {
    /// Gravitational constant of the Earth μ `[m³/s²]`.
    mu: f64,
    /// Earth rotation rate Ω̇_e `[rad/s]`.
    omega_earth: f64,
}

impl Constants {
    const fn of(constellation: Constellation) -> Self {
        match constellation {
            // IS-GPS-200N table 20-IV; IS-QZSS-PNT-005 table 5.1.1-1.
            Constellation::Gps | Constellation::Qzss | Constellation::Glonass => {
                Self { mu: 3.986_005e14, omega_earth: EARTH_ROTATION_RATE }
            }
            // Galileo OS SIS ICD 2.1 table 58.
            Constellation::Galileo => Self { mu: 3.986_004_418e14, omega_earth: EARTH_ROTATION_RATE },
            // BDS-SIS-ICD-B1I 3.0 section 3.2 (CGCS2000).
            Constellation::BeiDou => Self { mu: 3.986_004_418e14, omega_earth: 7.292_115e-5 },
        }
    }
}

/// Whether a satellite is a geostationary BeiDou satellite: C01…C05, C59…C63.
const fn is_beidou_geo(satellite: SatelliteId) -> bool {
    matches!(satellite.constellation(), Constellation::BeiDou) && matches!(satellite.number(), 1..=5 | 59..=63)
}

/// E − e sin E = M solved for the eccentric anomaly E `[rad]` by Newton's method.
fn eccentric_anomaly(mean_anomaly: f64, e: f64) -> f64 {
    let mut anomaly = mean_anomaly;
    for _ in 0..MAX_NEWTON_STEPS {
        let (sin, cos) = libm::sincos(anomaly);
        let step = (anomaly - e * sin - mean_anomaly) / (1.0 - e * cos);
        anomaly -= step;
        if libm::fabs(step) < 1e-14 {
            break;
        }
    }
    anomaly
}

/// Clock offset `[s]` and drift `[s/s]` by the broadcast polynomial, without relativity.
pub(super) fn clock_polynomial(ephemeris: &KeplerEphemeris, time: GpsTime) -> (f64, f64) {
    let dt = time.since(ephemeris.toc);
    let KeplerEphemeris { af0, af1, af2, .. } = *ephemeris;
    (af0 + dt * (af1 + dt * af2), af1 + 2.0 * dt * af2)
}

/// State at `time`.
pub(super) fn state(ephemeris: &KeplerEphemeris, time: GpsTime) -> Result<SatelliteState, OrbitError> {
    let KeplerEphemeris { sqrt_a, e, .. } = *ephemeris;
    if !(0.0..=MAX_ECCENTRICITY).contains(&e) || !SQRT_A_RANGE.contains(&sqrt_a) {
        return Err(OrbitError::Absurd);
    }
    let t_k = time.since(ephemeris.toe);
    if libm::fabs(t_k) > MAX_EXTRAPOLATION {
        return Err(OrbitError::TooFar);
    }
    let Constants { mu, omega_earth } = Constants::of(ephemeris.satellite.constellation());

    // In the orbital plane.
    let a = sqrt_a * sqrt_a;
    let n = libm::sqrt(mu / (a * a * a)) + ephemeris.delta_n;
    let anomaly = eccentric_anomaly(ephemeris.m0 + n * t_k, e);
    let (sin_e, cos_e) = libm::sincos(anomaly);
    let anomaly_rate = n / (1.0 - e * cos_e);
    let axis_ratio = libm::sqrt(1.0 - e * e);
    let phi = libm::atan2(axis_ratio * sin_e, cos_e - e) + ephemeris.omega;
    let phi_rate = axis_ratio * anomaly_rate / (1.0 - e * cos_e);

    // Second harmonic corrections.
    let (sin_2phi, cos_2phi) = libm::sincos(2.0 * phi);
    let harmonic = |sine: f64, cosine: f64| sine * sin_2phi + cosine * cos_2phi;
    let harmonic_rate = |sine: f64, cosine: f64| 2.0 * phi_rate * (sine * cos_2phi - cosine * sin_2phi);
    let u = phi + harmonic(ephemeris.cus, ephemeris.cuc);
    let u_rate = phi_rate + harmonic_rate(ephemeris.cus, ephemeris.cuc);
    let r = a * (1.0 - e * cos_e) + harmonic(ephemeris.crs, ephemeris.crc);
    let r_rate = a * e * sin_e * anomaly_rate + harmonic_rate(ephemeris.crs, ephemeris.crc);
    let i = ephemeris.i0 + ephemeris.idot * t_k + harmonic(ephemeris.cis, ephemeris.cic);
    let i_rate = ephemeris.idot + harmonic_rate(ephemeris.cis, ephemeris.cic);

    let (sin_u, cos_u) = libm::sincos(u);
    let (x, y) = (r * cos_u, r * sin_u);
    let (x_rate, y_rate) = (r_rate * cos_u - y * u_rate, r_rate * sin_u + x * u_rate);

    // Into a frame that turns with the Earth, or, for a geostationary satellite, stays where it was at toe.
    let geostationary = is_beidou_geo(ephemeris.satellite);
    let node_rate = ephemeris.omega_dot - if geostationary { 0.0 } else { omega_earth };
    let node = ephemeris.omega0 + node_rate * t_k - omega_earth * ephemeris.toe_seconds_of_week();
    let (sin_node, cos_node) = libm::sincos(node);
    let (sin_i, cos_i) = libm::sincos(i);
    let position = Vector3::new(x * cos_node - y * cos_i * sin_node, x * sin_node + y * cos_i * cos_node, y * sin_i);
    let across_rate = y_rate * cos_i - y * sin_i * i_rate;
    let velocity = Vector3::new(
        x_rate * cos_node - across_rate * sin_node - position.y * node_rate,
        x_rate * sin_node + across_rate * cos_node + position.x * node_rate,
        y_rate * sin_i + y * cos_i * i_rate,
    );
    let (position, velocity) =
        if geostationary { tilt_and_turn(position, velocity, omega_earth, t_k) } else { (position, velocity) };

    let (clock, drift) = clock_polynomial(ephemeris, time);
    let relativity_scale = -2.0 * libm::sqrt(mu) / (SPEED_OF_LIGHT * SPEED_OF_LIGHT) * e * sqrt_a;
    let relativity = relativity_scale * sin_e;
    Ok(SatelliteState {
        time,
        position,
        velocity,
        clock: clock + relativity,
        clock_drift: drift + relativity_scale * cos_e * anomaly_rate,
        relativity,
    })
}

/// R_z(ω t_k) R_x(−5°) of BeiDou's geostationary satellites, and its time derivative.
fn tilt_and_turn(
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    omega_earth: f64,
    t_k: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let (sin_tilt, cos_tilt) = libm::sincos(GEO_TILT);
    let (sin_turn, cos_turn) = libm::sincos(omega_earth * t_k);
    let rotate = |v: Vector3<f64>| {
        let (y, z) = (cos_tilt * v.y + sin_tilt * v.z, cos_tilt * v.z - sin_tilt * v.y);
        Vector3::new(cos_turn * v.x + sin_turn * y, cos_turn * y - sin_turn * v.x, z)
    };
    let (position, turned) = (rotate(position), rotate(velocity));
    (position, turned + Vector3::new(position.y, -position.x, 0.0) * omega_earth)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::gnss::ephemeris::{Ephemeris, NavigationMessage};
    use proptest::prelude::*;

    /// G05, IODE 2, as recorded at IGS station ESBC on 2020-06-25.
    pub fn gps_g05() -> KeplerEphemeris {
        let toe = GpsTime::from_week_tow(2111, 381_584.0);
        KeplerEphemeris {
            satellite: "G05".parse().unwrap(),
            message: NavigationMessage::Lnav,
            iode: 2,
            toe,
            toc: toe,
            sqrt_a: libm::sqrt(26_560_547.555_495_817),
            e: 0.005_969_492_951_408,
            m0: 0.430_170_135_181_4,
            delta_n: 4.394_111_603_814e-9,
            i0: 0.953_161_982_153_9,
            idot: -2.821_546_100_149e-11,
            omega0: -2.702_882_156_268,
            omega: 0.807_727_865_542,
            omega_dot: -8.101_051_727_036e-9,
            cuc: -5.729_496_479_034e-6,
            cus: 9.091_570_973_396e-6,
            crc: 199.75,
            crs: -112.656_25,
            cic: -7.078_051_567_078e-8,
            cis: 1.341_104_507_446e-7,
            af0: -1.534_633_338_451e-5,
            af1: -7.958_078_640_513e-13,
            af2: 0.0,
            group_delay: [-1.117_587_089_539e-8, 0.0],
            health: 0,
            accuracy: 2.0,
            fit_interval: 4.0,
        }
    }

    /// C05 (geostationary), AODE 1, as recorded at IGS station ESBC on 2020-06-25.
    fn beidou_c05() -> KeplerEphemeris {
        let toe = GpsTime::from_week_tow(2111, 385_214.0);
        KeplerEphemeris {
            satellite: "C05".parse().unwrap(),
            message: NavigationMessage::D1D2,
            iode: 1,
            toe,
            toc: toe,
            sqrt_a: libm::sqrt(42_163_595.887_057_304),
            e: 0.000_378_172_728_233,
            m0: 2.287_342_461_452,
            delta_n: 1.013_863_660_062e-8,
            i0: 0.061_745_902_707_55,
            idot: -5.114_498_753_688e-10,
            omega0: -0.092_579_382_337_16,
            omega: 1.786_942_473_007,
            omega_dot: -9.080_021_076_467e-9,
            cuc: -2.300_320_193_172e-5,
            cus: -1.129_787_415_266e-5,
            crc: 353.453_125,
            crs: -711.578_125,
            cic: -2.188_608_050_346e-8,
            cis: 1.178_123_056_889e-7,
            af0: -0.000_518_599_990_755_3,
            af1: -6.700_151_544_692e-11,
            af2: 0.0,
            group_delay: [1e-10, -9.3e-9],
            ..gps_g05()
        }
    }

    fn check(ephemeris: KeplerEphemeris, tow: f64, position: [f64; 3], velocity: [f64; 3], clock: f64) {
        let state = Ephemeris::Kepler(ephemeris).state(GpsTime::from_week_tow(2111, tow)).unwrap();
        assert!((state.position - Vector3::from(position)).amax() < 1e-6, "{}", state.position);
        assert!((state.velocity - Vector3::from(velocity)).amax() < 1e-7, "{}", state.velocity);
        assert!((state.clock - clock).abs() < 1e-17, "{}", state.clock);
    }

    /// Positions and clocks by RTKLIB demo5 2.5.1, cssrlib 1.2.1 and sidereon 3.0.4, agreeing to 1e-8 m; velocities from
    /// a re-implementation of the ICD in numpy, confirmed by differences of RTKLIB's positions to 6e-4 m/s.
    #[test]
    fn gps_agrees_with_independent_programs() {
        check(
            gps_g05(),
            388_784.0,
            [-20602646.207326017, 4449533.32402337, 16139681.095393978],
            [-1865.9058259118806, -916.5933011252021, -2091.1502850880074],
            -1.5365682689061897e-05,
        );
    }

    /// Provenance as above.
    #[test]
    fn geostationary_beidou_agrees_with_independent_programs() {
        check(
            beidou_c05(),
            392_414.0,
            [21875744.872177687, 36045220.04620425, 1092221.1844972994],
            [1.3115654166422246, 0.22864845118510857, -15.850486221849923],
            -0.0005190827541707936,
        );
    }

    #[test]
    fn the_transmission_time_solves_its_equation() {
        let ephemeris = Ephemeris::Kepler(gps_g05());
        let reception = GpsTime::from_week_tow(2111, 382_000.123);
        let pseudorange = 21_345_678.9;
        let state = ephemeris.state_at_transmission(reception, pseudorange).unwrap();
        let expected = reception.plus_seconds(-pseudorange / SPEED_OF_LIGHT - state.clock);
        assert!(state.time.since(expected).abs() < 2e-8);
        assert_eq!(ephemeris.state_at_transmission(reception, f64::NAN), Err(OrbitError::NotFinite));
    }

    #[test]
    fn what_is_not_an_orbit_is_refused() {
        let with = |change: fn(&mut KeplerEphemeris)| {
            let mut ephemeris = gps_g05();
            change(&mut ephemeris);
            Ephemeris::Kepler(ephemeris).state(gps_g05().toe.plus_seconds(60.0))
        };
        assert_eq!(with(|e| e.e = 0.6), Err(OrbitError::Absurd));
        assert_eq!(with(|e| e.e = f64::NAN), Err(OrbitError::Absurd));
        assert_eq!(with(|e| e.e = -0.1), Err(OrbitError::Absurd));
        assert_eq!(with(|e| e.sqrt_a = 0.0), Err(OrbitError::Absurd));
        assert_eq!(with(|e| e.cuc = f64::NAN), Err(OrbitError::NotFinite));
        assert_eq!(with(|e| e.af0 = f64::INFINITY), Err(OrbitError::NotFinite));
        assert_eq!(with(|e| e.toe = e.toe.plus_seconds(1e6)), Err(OrbitError::TooFar));
    }

    proptest! {
        #[test]
        fn keplers_equation_is_solved(mean in -10.0..10.0_f64, e in 0.0..MAX_ECCENTRICITY) {
            let anomaly = eccentric_anomaly(mean, e);
            prop_assert!((anomaly - e * anomaly.sin() - mean).abs() < 4e-15 * mean.abs().max(1.0));
        }

        #[test]
        fn velocity_and_drift_are_derivatives(seconds in -7_200.0..7_200.0_f64, geo: bool, e in 0.0..0.3_f64) {
            let ephemeris = KeplerEphemeris { e, ..if geo { beidou_c05() } else { gps_g05() } };
            let at = |offset: f64| state(&ephemeris, ephemeris.toe.plus_seconds(seconds + offset)).unwrap();
            let (before, now, after) = (at(-0.5), at(0.0), at(0.5));
            // Central difference over 1 s: error |d³x/dt³| / 24 < 1e-4 m/s, rounding 1e-8 m/s.
            prop_assert!((after.position - before.position - now.velocity).amax() < 1e-4);
            prop_assert!((after.clock - before.clock - now.clock_drift).abs() < 1e-17);
        }

        #[test]
        fn no_parameters_make_it_panic(numbers in prop::array::uniform16(any::<f64>()), seconds in any::<f64>()) {
            let [m0, delta_n, i0, idot, omega0, omega, omega_dot, cuc, cus, crc, crs, cic, cis, af0, e, sqrt_a] = numbers;
            for (e, sqrt_a) in [(e, sqrt_a), (0.01, 5_153.6)] {
                let ephemeris = KeplerEphemeris {
                    m0, delta_n, i0, idot, omega0, omega, omega_dot, cuc, cus, crc, crs, cic, cis, af0, e, sqrt_a,
                    ..gps_g05()
                };
                let result = Ephemeris::Kepler(ephemeris).state(ephemeris.toe.plus_seconds(seconds % 90_000.0));
                prop_assert!(result.is_err() || result.is_ok_and(|s| s.position.norm() < 1e8));
            }
        }
    }
}
