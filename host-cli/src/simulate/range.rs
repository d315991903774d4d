//! Exact observables without noise: what a receiver with a given clock measures of a satellite.
//!
//! An observable is tagged with the receiver's clock. At tag t_k the clock is ahead of GPST by dt_r, so that the
//! measurement is made at t_r = t_k − dt_r. The signal left the satellite at t_s = t_r − ρ/c, where ρ is the distance
//! between the satellite at t_s and the receiver at t_r, both in the inertial frame that coincides with ECEF at t_r
//! (earth rotation included), found by iteration. With the satellite clock dt_s (relativity included) at t_s, the group
//! delay g of the signal, troposphere T, ionosphere I on L1 and γ = (f_L1/f)²,
//!
//! * code P = ρ + c (dt_r − dt_s + g) + T + γ I + b,
//! * phase λΦ = ρ + c (dt_r − dt_s) + T − γ I + b + λN,
//!
//! with the receiver's delay b of the constellation (IS-GPS-200N 20.3.3.3.3 and 20.3.3.4.3). Doppler is −dΦ/dt_k of
//! that phase without N, by a central difference, so that it is consistent with phase to 0.1 mm/s.

use super::motion::{Path, State};
use super::scenario::{Clock, Receiver, Scenario};
use super::sky::{KLOBUCHAR, Satellite};
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::atmosphere::{Mapping, StandardAtmosphere, ZenithDelay, niell};
use surefix_core::gnss::geodesy::{Geodetic, LookAngle, line_of_sight};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::time::GpsTime;

/// Half of the interval over which phase is differenced for Doppler `[s]`.
const DOPPLER_HALF_S: f64 = 0.05;
/// Light-time iterations; each gains five digits.
const LIGHT_TIME_STEPS: usize = 5;

impl Clock {
    /// Offset from GPST `seconds` after the start, without jumps `[s]`.
    pub fn continuous(&self, seconds: f64) -> f64 {
        self.offset_s + self.drift * seconds + self.wander_s * (TAU * seconds / self.wander_period_s).sin()
    }

    /// What the jumps have taken off `seconds` after the start: a whole number of milliseconds `[s]`.
    pub fn jumped(&self, seconds: f64) -> f64 {
        if self.millisecond_jumps { (self.continuous(seconds) * 1e3).round() / 1e3 } else { 0.0 }
    }
}

/// An antenna on its way, with the receiver behind it.
#[derive(Clone, Debug)]
pub struct Antenna<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Its path in the local frame at the base.
    pub path: &'a Path,
    /// Its receiver.
    pub receiver: &'a Receiver,
    /// Zenith wet delay beyond the model's `[m]`.
    pub wet_bias: f64,
}

/// The noise-free observables of a satellite, of which those of each signal are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Elevation of the satellite `[rad]`.
    pub elevation: f64,
    /// ρ + c (dt_r − dt_s) + T + b `[m]`.
    pub nondispersive: f64,
    /// I, on L1 `[m]`.
    pub ionosphere: f64,
    /// Rate of `nondispersive` by receiver time `[m/s]`.
    pub nondispersive_rate: f64,
    /// Rate of `ionosphere` `[m/s]`.
    pub ionosphere_rate: f64,
}

impl Antenna<'_> {
    /// How far the receiver's clock is ahead of GPST when it reads `tag` `[s]`.
    pub fn clock_offset(&self, tag: GpsTime) -> f64 {
        let seconds = tag.since(self.scenario.start());
        self.receiver.clock.continuous(seconds) - self.receiver.clock.jumped(seconds)
    }

    /// Position `[m]` and velocity `[m/s]`, ECEF, at the instant of the measurement that is tagged `tag`.
    pub fn state(&self, tag: GpsTime) -> State {
        self.state_at(tag.since(self.scenario.start()) - self.clock_offset(tag))
    }

    fn state_at(&self, seconds: f64) -> State {
        let base = self.scenario.base_position();
        let frame = Geodetic::from_ecef(&base);
        let local = self.path.at(seconds);
        State { position: base + frame.enu_to_ecef(&local.position), velocity: frame.enu_to_ecef(&local.velocity) }
    }

    /// What is measured of a satellite at `tag`; `None` below the horizon.
    pub fn link(&self, satellite: &Satellite, tag: GpsTime) -> Option<Link> {
        let jumped = self.receiver.clock.jumped(tag.since(self.scenario.start()));
        let (elevation, nondispersive, ionosphere) = self.delays(satellite, tag, jumped)?;
        let (_, before, ionosphere_before) = self.delays(satellite, tag.plus_seconds(-DOPPLER_HALF_S), jumped)?;
        let (_, after, ionosphere_after) = self.delays(satellite, tag.plus_seconds(DOPPLER_HALF_S), jumped)?;
        Some(Link {
            elevation,
            nondispersive,
            ionosphere,
            nondispersive_rate: (after - before) / (2.0 * DOPPLER_HALF_S),
            ionosphere_rate: (ionosphere_after - ionosphere_before) / (2.0 * DOPPLER_HALF_S),
        })
    }

    /// Elevation `[rad]`, non-dispersive delay and ionosphere `[m]` with `jumped` taken off the clock.
    fn delays(&self, satellite: &Satellite, tag: GpsTime, jumped: f64) -> Option<(f64, f64, f64)> {
        let seconds = tag.since(self.scenario.start());
        let clock_offset = self.receiver.clock.continuous(seconds) - jumped;
        let receiver = self.state_at(seconds - clock_offset).position;
        let received = tag.plus_seconds(-clock_offset);

        let mut travel_time = 0.075;
        let mut sent = satellite.state(received.plus_seconds(-travel_time))?;
        for _ in 0..LIGHT_TIME_STEPS {
            travel_time = line_of_sight(&receiver, &sent.position).range / SPEED_OF_LIGHT;
            sent = satellite.state(received.plus_seconds(-travel_time))?;
        }
        let line = line_of_sight(&receiver, &sent.position);

        let here = Geodetic::from_ecef(&receiver);
        let look = here.look(&line.direction);
        let bias = if satellite.id.constellation() == Constellation::Galileo {
            self.receiver.inter_system_bias_m
        } else {
            0.0
        };
        let nondispersive = line.range
            + SPEED_OF_LIGHT * (clock_offset - sent.clock)
            + self.troposphere(&here, look.elevation, received)?
            + bias;
        let ionosphere = self.ionosphere(&receiver, &here, look, received);
        Some((look.elevation, nondispersive, ionosphere))
    }

    /// Slant delay `[m]`; `None` below the horizon.
    fn troposphere(&self, here: &Geodetic, elevation: f64, time: GpsTime) -> Option<f64> {
        let model = &self.scenario.troposphere;
        let zenith: ZenithDelay = StandardAtmosphere::at_height(here.height, model.humidity).zenith_delay(here);
        let slant = Mapping::Niell.slant(zenith, time.day_of_year(), here, elevation)?;
        Some(model.scale * slant + self.wet_bias * niell::site(time.day_of_year(), here).wet(libm::sin(elevation)))
    }

    /// Slant delay on L1 `[m]`.
    fn ionosphere(&self, receiver: &Vector3<f64>, here: &Geodetic, look: LookAngle, time: GpsTime) -> f64 {
        let model = &self.scenario.ionosphere;
        let broadcast = KLOBUCHAR.delay_l1(here, look, time.tow());
        let base = self.scenario.base_position();
        let from_base = Geodetic::from_ecef(&base).ecef_to_enu(&(receiver - base));
        let [east, north] = model.gradient_mm_km;
        let vertical = 1e-6 * (east * from_base.x + north * from_base.y); // mm/km · m = 1e-6 m
        // Obliquity of IS-GPS-200N 20.3.3.5.2.5, elevation in semicircles.
        let obliquity = 1.0 + 16.0 * (0.53 - look.elevation / PI).powi(3);
        model.scale * broadcast + vertical * obliquity
    }
}
