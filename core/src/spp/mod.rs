//! Single-point positioning: position and clocks from code, velocity and clock drift from Doppler, for one epoch of one
//! receiver, from nothing but broadcast ephemerides.
//!
//! * [`rows`]: from an epoch to one [`rows::Row`] a satellite: signal, satellite state, group delay, noise.
//! * [`position`], [`velocity`]: what the rows say about the unknowns.
//! * [`adjust`]: weighted least squares. [`exclusion`]: fault detection and exclusion. [`dop`]: dilution of precision.
//!
//! Model (IS-GPS-200N 20.3.3.3, 30.3.3.3): P = ρ + c dt_r,k − c (dt_s − T_GD) + I + T, with ρ the light-time range in
//! the rotating Earth's frame, and a receiver clock offset dt_r,k of its own for each constellation k, which holds the
//! difference of the system times and of the receiver's delays. QZSS has its own offset too, though it keeps GPS time:
//! sharing that of GPS moves a solution in Japan by 0.7 m, because receivers delay the two differently. A constellation
//! with one satellite then has no say in the position, which is as it should be.
//!
//! Accuracy, one frequency under an open sky: 1 m horizontally, 2–3 m vertically, mostly from the ionosphere. The
//! covariance contains these model errors as if they were independent between satellites; see [`noise::Noise`] for how
//! far it can be trusted.
//!
//! Workspace: the rows, 160 bytes a satellite, provided by the caller. Stack: some ten matrices of 8 × 8. Bounded: at
//! most 15 steps a fit, 30 for a robust start, one fit an exclusion and one a readmission. Panic contract: never panics,
//! whatever the observations.

use crate::gnss::atmosphere::{Klobuchar, Mapping};
use crate::gnss::epoch::EpochView;
use crate::gnss::geodesy::{Geodetic, look_angle};
use crate::gnss::orbit::store::{EphemerisStore, SelectionRule};
use crate::gnss::satellite::SatelliteSet;
use crate::gnss::time::GpsTime;
use adjust::{GROUPS, Unknowns};
use core::fmt;
use dop::Dop;
use exclusion::{FaultTests, adjust_consistent};
use nalgebra::{Matrix3, Vector3};
use noise::Noise;
use position::{Atmosphere, PositionModel};
use rows::Rows;
use velocity::VelocityModel;

pub mod adjust;
pub mod dop;
pub mod exclusion;
pub mod noise;
pub mod position;
pub mod rows;
pub mod velocity;

#[cfg(test)]
mod sky;

/// A position further from the Earth's centre is not believed and not started from: there are points far out that fit
/// four ranges too `[m]`.
const MAX_RADIUS: f64 = 1e7;

/// Variance of code residuals under an open sky, in units of the configured one: they scatter by a third of their σ
/// ([`noise::Noise`]), most of which is what all satellites share and no residual shows.
pub const USUAL_RESIDUALS: f64 = 1.0 / 9.0;

/// How single points are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config {
    /// Satellites below this elevation are not used `[rad]`.
    pub elevation_mask: f64,
    /// RINEX band of the signal to use, by [`Constellation::index`](crate::gnss::satellite::Constellation::index).
    pub bands: [u8; GROUPS],
    /// Which ephemerides may be used when.
    pub ephemerides: SelectionRule,
    /// Troposphere mapping.
    pub mapping: Mapping,
    /// Standard deviations.
    pub noise: Noise,
    /// Thresholds of fault detection.
    pub tests: FaultTests,
    /// A geometry with a larger PDOP gives no position.
    pub max_pdop: f64,
}

impl Config {
    /// Mask 10°, L1/E1/B1I/L1/G1, Niell's mapping, PDOP up to 30.
    pub const DEFAULT: Self = Self {
        elevation_mask: 10.0 * core::f64::consts::PI / 180.0,
        bands: [b'1', b'1', b'2', b'1', b'1'],
        ephemerides: SelectionRule::SAFE,
        mapping: Mapping::Niell,
        noise: Noise::DEFAULT,
        tests: FaultTests::DEFAULT,
        max_pdop: 30.0,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Why there is no single point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SinglePointError {
    /// Fewer satellites with code and ephemeris than unknowns.
    TooFewSatellites,
    /// The satellites do not determine a position, or hardly: PDOP above the limit.
    PoorGeometry,
    /// The iteration did not come to rest on the Earth.
    NotConverged,
    /// The measurements contradict each other, and no exclusion explains it.
    Inconsistent,
}

impl fmt::Display for SinglePointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooFewSatellites => "too few satellites with code and ephemeris",
            Self::PoorGeometry => "the satellites' geometry does not determine a position",
            Self::NotConverged => "the position did not converge",
            Self::Inconsistent => "the measurements contradict each other",
        })
    }
}

impl core::error::Error for SinglePointError {}

/// A single point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SinglePoint {
    /// Receiver time of the epoch (not corrected by the clock offset).
    pub time: GpsTime,
    /// Position at the instant of measurement, ECEF `[m]`.
    pub position: Vector3<f64>,
    /// Its covariance `[m²]`.
    pub covariance: Matrix3<f64>,
    /// Receiver clock minus system time, c dt_r, by
    /// [`Constellation::index`](crate::gnss::satellite::Constellation::index) `[m]`; `None` without satellites.
    pub clocks: [Option<f64>; GROUPS],
    /// Velocity, where Doppler of enough satellites is consistent.
    pub velocity: Option<Velocity>,
    /// Geometry of the satellites used.
    pub dop: Dop,
    /// Satellites whose code was used.
    pub used: SatelliteSet,
    /// Satellites whose code was excluded as faulty.
    pub rejected: SatelliteSet,
    /// Root mean square of the code residuals of the satellites used `[m]`.
    pub residual_rms: f64,
    /// Σ r²/σ² of the code residuals.
    pub chi_square: f64,
    /// Satellites used minus unknowns; at 0 nothing could be checked.
    pub degrees_of_freedom: u32,
}

impl SinglePoint {
    /// By what standard deviations are to be multiplied for a bound: √(χ²/f over [`USUAL_RESIDUALS`]), at least 1, where the
    /// residuals are larger than they usually are. With no degree of freedom nothing can be told, and it is 1.
    pub fn inflation(&self) -> f64 {
        if self.degrees_of_freedom == 0 {
            return 1.0;
        }
        libm::sqrt((self.chi_square / (f64::from(self.degrees_of_freedom) * USUAL_RESIDUALS)).max(1.0))
    }
}

/// Velocity from Doppler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity {
    /// Velocity, ECEF `[m/s]`.
    pub velocity: Vector3<f64>,
    /// Its covariance `[m²/s²]`.
    pub covariance: Matrix3<f64>,
    /// Drift of the receiver clock, c ḋt_r `[m/s]`.
    pub clock_drift: f64,
    /// Satellites whose Doppler was used.
    pub used: SatelliteSet,
    /// Satellites whose Doppler was excluded as faulty.
    pub rejected: SatelliteSet,
}

/// Position and velocity of the receiver that measured `epoch`.
///
/// `klobuchar` are the broadcast ionosphere coefficients, without which the delay stays in the measurements and in their
/// variances. `start` is a position to start from, if any is known; it saves a few steps and has no other influence.
/// `rows` is the workspace and holds the rows used afterwards; satellites beyond its capacity are ignored.
pub fn single_point<const E: usize, const N: usize>(
    epoch: EpochView<'_>,
    ephemerides: &EphemerisStore<E>,
    klobuchar: Option<Klobuchar>,
    config: &Config,
    start: Option<Vector3<f64>>,
    rows: &mut Rows<N>,
) -> Result<SinglePoint, SinglePointError> {
    rows::prepare(epoch, ephemerides, config, rows);
    let atmosphere = Atmosphere { time: epoch.time, klobuchar, mapping: config.mapping };

    // Elevations need a position: a first fit with all satellites and variances without elevation gives it.
    let start = start.filter(|position| position.norm() < MAX_RADIUS).unwrap_or_default();
    let model = PositionModel { atmosphere };
    let unknowns = Unknowns { vector: start, ..Unknowns::default() };
    let first = adjust_consistent(&model, rows, unknowns, &config.tests)?.fit.unknowns;

    let local = atmosphere.above(&Geodetic::from_ecef(&first.vector));
    rows.retain_mut(|row| {
        let look = look_angle(&first.vector, &row.state.position);
        let delays = local.delays(look, row.frequency);
        row.code_variance = config.noise.code_variance(row, look.elevation, delays);
        row.doppler_variance = config.noise.doppler_variance(row, look.elevation);
        look.elevation >= config.elevation_mask
    });
    estimate(rows, &atmosphere, first, config)
}

/// Position and velocity from prepared rows, with their variances, from `start`. All rows are used, whatever their
/// elevation.
pub fn estimate(
    rows: &[rows::Row],
    atmosphere: &Atmosphere,
    start: Unknowns,
    config: &Config,
) -> Result<SinglePoint, SinglePointError> {
    let model = PositionModel { atmosphere: *atmosphere };
    let exclusion::Consistent { fit, excluded } = adjust_consistent(&model, rows, start, &config.tests)?;
    let position = fit.unknowns.vector;
    if position.norm() > MAX_RADIUS {
        return Err(SinglePointError::NotConverged);
    }
    let covariance: Matrix3<f64> = fit.covariance.fixed_view::<3, 3>(0, 0).into();
    let used = || rows.iter().filter(|row| fit.used.contains(row.satellite));
    let dop = Dop::of(&position, used().map(|row| &row.state.position)).ok_or(SinglePointError::PoorGeometry)?;
    // DOP knows one clock only; the covariance knows all, and is to PDOP as the variances of the measurements.
    let worst = used().map(|row| row.code_variance).fold(0.0, f64::max);
    let weak = covariance.trace() > config.max_pdop * config.max_pdop * worst;
    if weak || dop.position > config.max_pdop {
        return Err(SinglePointError::PoorGeometry);
    }

    let drift = adjust_consistent(&VelocityModel { position }, rows, Unknowns::default(), &config.tests).ok();
    let velocity = drift.map(|exclusion::Consistent { fit, excluded }| Velocity {
        velocity: fit.unknowns.vector,
        covariance: fit.covariance.fixed_view::<3, 3>(0, 0).into(),
        clock_drift: fit.unknowns.biases[0],
        used: fit.used,
        rejected: excluded,
    });

    Ok(SinglePoint {
        time: atmosphere.time,
        position,
        covariance,
        clocks: core::array::from_fn(|group| fit.groups[group].then_some(fit.unknowns.biases[group])),
        velocity,
        dop,
        used: fit.used,
        rejected: excluded,
        residual_rms: libm::sqrt(fit.sum_of_squares / fit.used.len().max(1) as f64),
        chi_square: fit.chi_square,
        degrees_of_freedom: fit.degrees_of_freedom,
    })
}

#[cfg(test)]
mod tests {
    use super::sky::{ATMOSPHERE, CLOCKS, DRIFT, RECEIVER, VELOCITY, sky};
    use super::*;
    use crate::gnss::SPEED_OF_LIGHT;
    use crate::gnss::ephemeris::{Ephemeris, KeplerEphemeris, NavigationMessage};
    use crate::gnss::epoch::{Epoch, Observation};
    use crate::gnss::geodesy::line_of_sight;
    use crate::gnss::satellite::{Constellation, SatelliteId};
    use proptest::prelude::*;

    #[test]
    fn the_workspace_is_as_small_as_stated() {
        assert!(size_of::<rows::Row>() <= 160);
    }

    fn solve(rows: &[rows::Row]) -> Result<SinglePoint, SinglePointError> {
        estimate(rows, &ATMOSPHERE, Unknowns::default(), &Config::DEFAULT)
    }

    #[test]
    fn position_clocks_and_velocity_come_back_from_the_centre_of_the_earth() {
        let rows = sky(&[8, 7, 6, 2, 5]);
        let point = solve(&rows).unwrap();
        assert!((point.position - RECEIVER).norm() < 1e-5);
        for (clock, expected) in point.clocks.into_iter().zip(CLOCKS) {
            assert!((clock.unwrap() - expected).abs() < 1e-5);
        }
        let velocity = point.velocity.unwrap();
        assert!((velocity.velocity - VELOCITY).norm() < 1e-6 && (velocity.clock_drift - DRIFT).abs() < 1e-6);
        assert_eq!((point.used.len(), point.degrees_of_freedom), (28, 20));
        assert!(point.rejected.is_empty() && point.residual_rms < 1e-5);
    }

    #[test]
    fn a_constellation_with_one_satellite_changes_nothing() {
        let mut rows = sky(&[7, 0, 1, 0, 0]);
        let with = solve(&rows).unwrap();
        rows.retain(|row| row.satellite.constellation() == Constellation::Gps);
        let without = solve(&rows).unwrap();
        assert!((with.position - without.position).norm() < 1e-5);
        assert!((with.covariance - without.covariance).norm() < 1e-6 * without.covariance.norm());
        assert_eq!((with.degrees_of_freedom, without.degrees_of_freedom), (3, 3));
    }

    #[test]
    fn too_few_satellites_are_refused() {
        assert_eq!(solve(&[]), Err(SinglePointError::TooFewSatellites));
        assert_eq!(solve(&sky(&[3, 0, 0, 0, 0])), Err(SinglePointError::TooFewSatellites));
        assert_eq!(solve(&sky(&[3, 1, 1, 0, 0])), Err(SinglePointError::TooFewSatellites));
        assert!(solve(&sky(&[4, 0, 0, 0, 0])).is_ok_and(|point| point.degrees_of_freedom == 0));
    }

    #[test]
    fn satellites_in_one_direction_are_no_geometry() {
        let mut rows = sky(&[6, 0, 0, 0, 0]);
        let first = rows[0].state;
        rows.iter_mut().for_each(|row| row.state = first);
        assert_eq!(solve(&rows), Err(SinglePointError::PoorGeometry));
    }

    /// A circular orbit whose satellite is on the meridian that sidereal angle gives it.
    fn ephemeris(number: u8) -> Ephemeris {
        let angle = f64::from(number);
        Ephemeris::Kepler(KeplerEphemeris {
            satellite: SatelliteId::new(Constellation::Gps, number).unwrap(),
            message: NavigationMessage::Lnav,
            iode: 1,
            toe: ATMOSPHERE.time,
            toc: ATMOSPHERE.time,
            sqrt_a: 5153.6,
            e: 0.01,
            m0: angle * 2.4,
            delta_n: 0.0,
            i0: 0.96,
            idot: 0.0,
            omega0: angle * 1.1,
            omega: 0.5,
            omega_dot: 0.0,
            cuc: 0.0,
            cus: 0.0,
            crc: 0.0,
            crs: 0.0,
            cic: 0.0,
            cis: 0.0,
            af0: 1e-5 * angle,
            af1: 1e-12,
            af2: 0.0,
            group_delay: [5e-9, 0.0],
            health: 0,
            accuracy: 2.0,
            fit_interval: 4.0,
        })
    }

    /// What the receiver measures, from the model that [`PositionModel`] inverts.
    fn epoch(store: &EphemerisStore<32>) -> Epoch<64> {
        let mut epoch = Epoch::new(ATMOSPHERE.time);
        let local = ATMOSPHERE.above(&Geodetic::from_ecef(&RECEIVER));
        for ephemeris in store.iter() {
            let signal = "1C".parse().unwrap();
            let mut observation = Observation::new(ephemeris.satellite(), signal);
            let mut code = 2.2e7;
            for _ in 0..10 {
                let state = ephemeris.state_at_transmission(ATMOSPHERE.time, code).unwrap();
                let look = look_angle(&RECEIVER, &state.position);
                let delays = local.delays(look, signal.frequency(Constellation::Gps, None).unwrap());
                let clock = state.clock - ephemeris.group_delay(signal).unwrap();
                code = line_of_sight(&RECEIVER, &state.position).range + CLOCKS[0] - SPEED_OF_LIGHT * clock
                    + delays.ionosphere.unwrap()
                    + delays.troposphere;
                observation.code = (look.elevation > 0.0).then_some(code);
            }
            epoch.observations.push(observation).unwrap();
        }
        epoch
    }

    fn store() -> EphemerisStore<32> {
        let mut store = EphemerisStore::new();
        (1..=32).for_each(|number| {
            store.insert(ephemeris(number));
        });
        store
    }

    #[test]
    fn an_epoch_gives_the_position_with_the_mask_applied() {
        let (store, mut rows) = (store(), Rows::<32>::new());
        let epoch = epoch(&store);
        let point =
            single_point(epoch.view(), &store, ATMOSPHERE.klobuchar, &Config::DEFAULT, None, &mut rows).unwrap();
        assert!((point.position - RECEIVER).norm() < 1e-4, "{}", point.position - RECEIVER);
        assert!(point.velocity.is_none() && point.rejected.is_empty());
        for satellite in point.used.iter() {
            let state = store.select(satellite, epoch.time, &SelectionRule::SAFE).unwrap().state(epoch.time).unwrap();
            assert!(look_angle(&RECEIVER, &state.position).elevation >= Config::DEFAULT.elevation_mask);
        }
    }

    fn solve_from(start: Vector3<f64>) -> Vector3<f64> {
        let (store, mut rows) = (store(), Rows::<32>::new());
        let epoch = epoch(&store);
        let point = single_point(epoch.view(), &store, ATMOSPHERE.klobuchar, &Config::DEFAULT, Some(start), &mut rows);
        point.unwrap().position
    }

    #[test]
    fn a_start_anywhere_gives_the_same_position() {
        for start in [-RECEIVER, 7.0 * RECEIVER, Vector3::new(f64::NAN, 0.0, 0.0)] {
            assert!((solve_from(start) - RECEIVER).norm() < 1e-4);
        }
    }

    fn anything() -> impl Strategy<Value = f64> {
        prop_oneof![any::<f64>(), 1e7..5e7f64, Just(f64::NAN), Just(0.0)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_start_on_earth_gives_the_same_position(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64) {
            prop_assert!((solve_from(Vector3::new(x, y, z) * 6.4e6) - RECEIVER).norm() < 1e-4);
        }

        #[test]
        fn absurd_rows_do_no_harm(values in proptest::collection::vec(anything(), 28 * 5)) {
            let mut rows = sky(&[8, 7, 6, 2, 5]);
            for (row, values) in rows.iter_mut().zip(values.chunks(5)) {
                row.code = values[0];
                row.doppler = Some(values[1]);
                row.state.position.x = values[2];
                row.code_variance = values[3];
                row.frequency = values[4];
            }
            if let Ok(point) = solve(&rows) {
                prop_assert!(point.position.norm() <= MAX_RADIUS);
            }
        }

        #[test]
        fn absurd_epochs_do_no_harm(values in proptest::collection::vec(anything(), 64)) {
            let (store, mut rows) = (store(), Rows::<16>::new());
            let mut epoch = epoch(&store);
            for (observation, values) in epoch.observations.iter_mut().zip(values.chunks(2)) {
                observation.code = Some(values[0]);
                observation.doppler = Some(values[1]);
                observation.cn0 = Some(values[1] as f32);
            }
            if let Ok(point) = single_point(epoch.view(), &store, None, &Config::DEFAULT, None, &mut rows) {
                prop_assert!(point.position.norm() <= MAX_RADIUS && point.covariance.iter().all(|x| x.is_finite()));
            }
        }
    }
}
