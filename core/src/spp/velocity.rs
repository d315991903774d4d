//! What Doppler says about velocity and the drift of the receiver clock.
//!
//! The range is ρ = |R(ω ρ/c) s(t − ρ/c) − r(t)|. Differentiated by reception time, with e the line of sight and both
//! velocities in the rotating frame: ρ̇ = e · (R ṡ − ṙ) / (1 + e · v/c), where v = R ṡ + ω × R s is the satellite's
//! velocity as seen without the Earth's rotation. The divisor matters by up to 3 mm/s. Doppler measures
//! −λ D = ρ̇ + c ḋt_r − c ḋt_s (RINEX sign; ionosphere and troposphere change by less than 1 mm/s, except near the
//! horizon). The clock drift is the same for all constellations. Panic contract: never panics.

use super::adjust::{Equation, Model, Unknowns};
use super::rows::Row;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::geodesy::{EARTH_ROTATION_RATE, line_of_sight};
use crate::gnss::satellite::SatelliteId;
use nalgebra::Vector3;

/// Doppler as a measurement of velocity and clock drift of a receiver at a known position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityModel {
    /// Receiver, ECEF `[m]`.
    pub position: Vector3<f64>,
}

/// Rate of the light-time range `[m/s]` between a receiver at `position` `[m]` with `velocity` `[m/s]` and a satellite
/// (states ECEF at reception and transmission), and its derivative by the receiver's velocity.
pub fn range_rate(
    position: &Vector3<f64>,
    velocity: &Vector3<f64>,
    satellite_position: &Vector3<f64>,
    satellite_velocity: &Vector3<f64>,
) -> (f64, Vector3<f64>) {
    let sight = line_of_sight(position, satellite_position);
    let moving = sight.rotate(satellite_velocity);
    let carried = Vector3::new(-sight.satellite.y, sight.satellite.x, 0.0) * EARTH_ROTATION_RATE;
    let scale = 1.0 / (1.0 + sight.direction.dot(&(moving + carried)) / SPEED_OF_LIGHT);
    (sight.direction.dot(&(moving - velocity)) * scale, -sight.direction * scale)
}

impl Model for VelocityModel {
    type Row = Row;
    type Point = Unknowns;

    fn point(&self, unknowns: &Unknowns) -> Unknowns {
        *unknowns
    }

    fn equation(&self, row: &Row, at: &Unknowns) -> Option<Equation> {
        let measured = -row.doppler? * SPEED_OF_LIGHT / row.frequency;
        let (rate, gradient) = range_rate(&self.position, &at.vector, &row.state.position, &row.state.velocity);
        let predicted = rate + at.biases[0] - SPEED_OF_LIGHT * row.state.clock_drift;
        Some(Equation { residual: measured - predicted, variance: row.doppler_variance, gradient, group: 0 })
    }

    fn satellite(row: &Row) -> SatelliteId {
        row.satellite
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::geodesy::rotate_ecef;

    #[test]
    fn the_rate_is_the_derivative_of_the_light_time_range() {
        // A satellite on a straight line in space at 3.9 km/s, a receiver moving at 200 m/s over the rotating Earth.
        let (receiver, velocity) = (Vector3::new(4.07e6, 0.93e6, 4.80e6), Vector3::new(120.0, -90.0, 130.0));
        let (start, speed) = (Vector3::new(2.0e7, -1.2e7, 1.2e7), Vector3::new(1500.0, 3200.0, 1600.0));
        let satellite = |t: f64| rotate_ecef(&(start + speed * t), t);
        // Range at reception time t: the satellite's position at t − τ solved by iteration.
        let range = |t: f64| {
            let mut range = 2.2e7;
            for _ in 0..20 {
                range = line_of_sight(&(receiver + velocity * t), &satellite(t - range / SPEED_OF_LIGHT)).range;
            }
            range
        };
        let numerical = (range(0.5) - range(-0.5)) / 1.0;
        let sent = -range(0.0) / SPEED_OF_LIGHT;
        let inertial_to_ecef = rotate_ecef(&speed, sent);
        let at = satellite(sent);
        let moving = inertial_to_ecef - Vector3::new(-at.y, at.x, 0.0) * EARTH_ROTATION_RATE;
        let (rate, _) = range_rate(&receiver, &velocity, &at, &moving);
        // The third derivative of the range leaves 1e-5 m/s in the central difference.
        assert!((rate - numerical).abs() < 1e-4, "{rate} {numerical}");
    }
}
