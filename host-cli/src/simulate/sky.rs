//! The satellites: Walker constellations that broadcast Kepler ephemerides.
//!
//! The truth is the broadcast orbit and clock plus a constant error of each satellite. Every two hours a satellite sends
//! a new ephemeris of the same orbit; its parameters are rounded to twelve digits, as navigation files have them, so
//! that whoever reads the files computes the orbit that was simulated to a tenth of a millimetre.
//!
//! Constellations: GPS 30 satellites in 6 planes at 55°, Galileo 24 in 3 planes at 56°, with the eccentricities, clocks
//! and harmonic terms that the real ones have in size (IS-GPS-200N, Galileo OS SIS ICD 2.1; values drawn at random).

use super::scenario::{Scenario, ScenarioError};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{PI, TAU};
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::atmosphere::Klobuchar;
use surefix_core::gnss::ephemeris::{Ephemeris, KeplerEphemeris, NavigationMessage};
use surefix_core::gnss::orbit::SatelliteState;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;

/// Between ephemerides `[s]`.
const UPDATE_S: f64 = 7_200.0;
/// GPS L1, to which group delays and the ionosphere refer `[Hz]`.
pub const F_L1: f64 = 1_575.42e6;

/// Klobuchar coefficients as broadcast in the headers of navigation files (2020-06-25).
pub const KLOBUCHAR: Klobuchar = Klobuchar {
    alpha: [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7],
    beta: [81_920.0, 98_304.0, -65_536.0, -524_290.0],
};

/// A satellite with its truth.
#[derive(Clone, Debug)]
pub struct Satellite {
    /// Which.
    pub id: SatelliteId,
    /// The signals that it sends.
    pub signals: Vec<Signal>,
    /// What it broadcasts, ascending in time.
    pub ephemerides: Vec<Ephemeris>,
    /// True minus broadcast position, ECEF `[m]`.
    orbit_error: Vector3<f64>,
    /// True minus broadcast clock `[s]`.
    clock_error: f64,
}

/// A Walker constellation i: t/p/f.
struct Walker {
    constellation: Constellation,
    planes: u8,
    per_plane: u8,
    phasing: f64,
    inclination_deg: f64,
    semi_major_axis: f64,
    /// Rate of right ascension `[rad/s]`.
    omega_dot: f64,
    eccentricity: f64,
}

const GPS: Walker = Walker {
    constellation: Constellation::Gps,
    planes: 6,
    per_plane: 5,
    phasing: 2.0,
    inclination_deg: 55.0,
    semi_major_axis: 26_559_710.0,
    omega_dot: -8.0e-9,
    eccentricity: 0.01,
};

const GALILEO: Walker = Walker {
    constellation: Constellation::Galileo,
    planes: 3,
    per_plane: 8,
    phasing: 1.0,
    inclination_deg: 56.0,
    semi_major_axis: 29_600_318.0,
    omega_dot: -5.5e-9,
    eccentricity: 3e-4,
};

impl Satellite {
    /// True state at `time`: broadcast plus error. `None` if the ephemeris cannot be evaluated.
    pub fn state(&self, time: GpsTime) -> Option<SatelliteState> {
        let mut state = self.broadcast(time)?.state(time).ok()?;
        state.position += self.orbit_error;
        state.clock += self.clock_error;
        Some(state)
    }

    /// Delay of a signal's code against the broadcast clock `[s]`; where the message does not tell (GPS L5), that which
    /// a dispersive delay would have.
    pub fn group_delay(&self, signal: Signal, time: GpsTime) -> Option<f64> {
        let broadcast = self.broadcast(time)?;
        broadcast.group_delay(signal).or_else(|| {
            let l1 = broadcast.group_delay(Signal::new(b'1', b'C')?)?;
            let frequency = signal.frequency(self.id.constellation(), None)?;
            Some(l1 * (F_L1 / frequency).powi(2))
        })
    }

    /// The ephemeris nearest in time.
    fn broadcast(&self, time: GpsTime) -> Option<&Ephemeris> {
        let distance = |ephemeris: &&Ephemeris| ephemeris.toe().since(time).abs();
        self.ephemerides.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// All satellites of a scenario.
pub fn satellites(scenario: &Scenario) -> Result<Vec<Satellite>, ScenarioError> {
    let mut satellites = Vec::new();
    for walker in [GPS, GALILEO] {
        let signals = scenario.signals(walker.constellation)?;
        if signals.is_empty() {
            continue;
        }
        for plane in 0..walker.planes {
            for slot in 0..walker.per_plane {
                satellites.extend(walker.satellite(plane, slot, &signals, scenario));
            }
        }
    }
    Ok(satellites)
}

impl Walker {
    fn satellite(&self, plane: u8, slot: u8, signals: &[Signal], scenario: &Scenario) -> Option<Satellite> {
        let id = SatelliteId::new(self.constellation, plane * self.per_plane + slot + 1)?;
        let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
        rng.set_stream(u64::from(id.number()) << 8 | self.constellation.index() as u64);
        let first = self.ephemeris(id, plane, slot, scenario.start(), &mut rng);
        let sigma = &scenario.satellites;
        let orbit_error = Vector3::from_fn(|_, _| sigma.orbit_sigma_m * rng.sample::<f64, _>(StandardNormal));
        let clock_error = sigma.clock_sigma_m / SPEED_OF_LIGHT * rng.sample::<f64, _>(StandardNormal);

        let updates = (scenario.duration_s / UPDATE_S).ceil() as i32 + 1;
        let ephemerides = (0..=updates).map(|k| Ephemeris::Kepler(later(&first, k))).collect();
        Some(Satellite { id, signals: signals.to_vec(), ephemerides, orbit_error, clock_error })
    }

    /// An ephemeris of the even hour before `time`.
    fn ephemeris(
        &self,
        satellite: SatelliteId,
        plane: u8,
        slot: u8,
        time: GpsTime,
        rng: &mut ChaCha8Rng,
    ) -> KeplerEphemeris {
        let toe = GpsTime::from_week_tow(time.week(), (time.tow() / UPDATE_S).floor() * UPDATE_S);
        let mut symmetric = |size: f64| size * rng.random_range(-1.0..1.0);
        let (plane, slot) = (f64::from(plane), f64::from(slot));
        let (planes, per_plane) = (f64::from(self.planes), f64::from(self.per_plane));
        let argument_of_latitude = TAU * (slot / per_plane + self.phasing * plane / (planes * per_plane));
        let omega = symmetric(PI);
        let galileo = self.constellation == Constellation::Galileo;
        KeplerEphemeris {
            satellite,
            message: if galileo { NavigationMessage::Inav } else { NavigationMessage::Lnav },
            iode: 0,
            toe,
            toc: toe,
            sqrt_a: (self.semi_major_axis + symmetric(2_000.0)).sqrt(),
            e: self.eccentricity * (1.0 + symmetric(0.5)),
            m0: argument_of_latitude - omega + symmetric(0.05),
            delta_n: 4.5e-9 + symmetric(5e-10),
            i0: self.inclination_deg.to_radians() + symmetric(0.01),
            idot: symmetric(3e-10),
            omega0: TAU * plane / planes + symmetric(0.02),
            omega,
            omega_dot: self.omega_dot + symmetric(3e-10),
            cuc: symmetric(5e-6),
            cus: symmetric(8e-6),
            crc: 200.0 + symmetric(100.0),
            crs: symmetric(100.0),
            cic: symmetric(1.5e-7),
            cis: symmetric(1.5e-7),
            af0: symmetric(3e-4),
            af1: symmetric(5e-12),
            af2: 0.0,
            group_delay: [symmetric(1e-8), if galileo { symmetric(1e-8) } else { 0.0 }],
            health: 0,
            accuracy: 2.0,
            fit_interval: if galileo { 0.0 } else { 4.0 },
        }
    }
}

/// The same orbit and clock, `k` updates later, rounded as navigation files round.
fn later(first: &KeplerEphemeris, k: i32) -> KeplerEphemeris {
    /// Gravitational constants of the two interface documents `[m³/s²]`.
    const MU: [f64; 2] = [3.986_005e14, 3.986_004_418e14];
    let galileo = first.satellite.constellation() == Constellation::Galileo;
    let elapsed = UPDATE_S * f64::from(k);
    let toe = first.toe.plus_seconds(elapsed);
    // The node is counted from the beginning of the week of toe, in a frame that turns with the Earth.
    let weeks = f64::from(toe.week() - first.toe.week());
    let turned = weeks * 604_800.0 * surefix_core::gnss::geodesy::EARTH_ROTATION_RATE;
    let sqrt_a = rounded(first.sqrt_a);
    let mean_motion = MU[usize::from(galileo)].sqrt() / sqrt_a.powi(3) + rounded(first.delta_n);
    KeplerEphemeris {
        iode: (k + 1) as u16,
        toe,
        toc: toe,
        sqrt_a,
        e: rounded(first.e),
        m0: rounded(wrapped(first.m0 + mean_motion * elapsed)),
        delta_n: rounded(first.delta_n),
        i0: rounded(first.i0 + rounded(first.idot) * elapsed),
        idot: rounded(first.idot),
        omega0: rounded(wrapped(first.omega0 + rounded(first.omega_dot) * elapsed - turned)),
        omega: rounded(first.omega),
        omega_dot: rounded(first.omega_dot),
        cuc: rounded(first.cuc),
        cus: rounded(first.cus),
        crc: rounded(first.crc),
        crs: rounded(first.crs),
        cic: rounded(first.cic),
        cis: rounded(first.cis),
        af0: rounded(first.af0 + rounded(first.af1) * elapsed),
        af1: rounded(first.af1),
        group_delay: first.group_delay.map(rounded),
        ..*first
    }
}

/// −π…π.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Twelve significant digits, the least that a navigation file has.
fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::geodesy::look_angle;

    fn sky(tow_s: f64, duration_s: f64) -> Vec<Satellite> {
        let mut scenario = Scenario { tow_s, duration_s, ..Scenario::default() };
        scenario.satellites.orbit_sigma_m = 0.0;
        scenario.satellites.clock_sigma_m = 0.0;
        satellites(&scenario).unwrap()
    }

    #[test]
    fn successive_ephemerides_are_of_the_same_orbit_and_clock() {
        // The second case crosses the end of the week.
        for tow in [302_400.0, 604_000.0] {
            for satellite in sky(tow, 10_000.0) {
                for pair in satellite.ephemerides.windows(2) {
                    let time = pair[0].toe().plus_seconds(3_600.0);
                    let [a, b] = [&pair[0], &pair[1]].map(|ephemeris| ephemeris.state(time).unwrap());
                    assert!((a.position - b.position).norm() < 1e-3, "{}: {}", satellite.id, a.position - b.position);
                    assert!((a.clock - b.clock).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn enough_satellites_are_visible_all_day() {
        let base = Scenario::default().base_position();
        let sky = sky(302_400.0, 86_400.0);
        for hour in 0..24 {
            let time = GpsTime::from_week_tow(2400, 302_400.0 + 3_600.0 * f64::from(hour));
            let visible = |constellation| {
                sky.iter()
                    .filter(|satellite| satellite.id.constellation() == constellation)
                    .filter(|s| look_angle(&base, &s.state(time).unwrap().position).elevation > 10_f64.to_radians())
                    .count()
            };
            let (gps, galileo) = (visible(Constellation::Gps), visible(Constellation::Galileo));
            assert!((6..=13).contains(&gps) && (5..=11).contains(&galileo), "hour {hour}: {gps}, {galileo}");
        }
    }

    #[test]
    fn the_seed_decides() {
        let of = |seed| satellites(&Scenario { seed, ..Scenario::default() }).unwrap()[0].ephemerides.clone();
        assert_eq!(of(3), of(3));
        assert_ne!(of(3), of(4));
    }
}
