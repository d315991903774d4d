//! A base that moves.
//!
//! The base is where its own single point says, epoch by epoch, without smoothing: what a smoothed position lags behind
//! is metres, while the vector between the antennas needs the base only to b δ/ρ (5 m on a vector of 5 km: 1.3 mm). The
//! position states are about the base's position plus the vector, so that whenever the base is found elsewhere they move
//! with it, and what is filtered is the vector and its velocity.
//!
//! ```text
//! range rates   (ρ̇_r − ρ̇_b) = c − e_r·v − (e_r − e_b)·v_b          v = v_r − v_b, v_b of the single point
//! same instant  r_r(t_b) − r_b(t_b) = r_r(t_r) − r_b(t_b) − v_r (t_r − t_b),  t = time tag − receiver clock
//! ```
//! The answer is the vector at the instant at which the base measured. Panic contract: none.

use super::RtkFilter;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::epoch::EpochView;
use crate::gnss::solution::{Quality, Solution};
use crate::gnss::time::GpsTime;
use crate::spp::{SinglePoint, Velocity};
use nalgebra::{Matrix3, Vector3};

/// Without a velocity a station is taken to stand still, to this standard deviation `[m/s]`.
const UNKNOWN_VELOCITY: f64 = 30.0;

/// What is known of a base's motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct BaseMotion {
    /// Its velocity `[m/s]`, zero if unknown.
    pub velocity: Vector3<f64>,
    /// Its receiver clock minus system time `[s]`.
    clock: f64,
    /// Epoch of it.
    time: GpsTime,
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Finds the base of an epoch that was just taken; without a single point there is none until the next.
    pub(super) fn locate_base(&mut self, epoch: EpochView<'_>) {
        let Some(single) = self.single_point_of(epoch, self.base_position) else {
            self.base_motion = None;
            return;
        };
        if let Some(before) = self.base_position {
            let shift = single.position - before;
            self.position += shift;
            self.constrained.shift(shift);
        }
        self.base_position = Some(single.position);
        let velocity = single.velocity.map_or(Vector3::zeros(), |velocity| velocity.velocity);
        self.base_motion = Some(BaseMotion { velocity, clock: clock(&single), time: epoch.time });
    }

    /// Forgets how a base moved, and which of its epochs was used.
    pub(super) fn forget_base_motion(&mut self) {
        self.base_motion = None;
        self.base_used = None;
    }

    /// Where the base's epochs have other intervals than the rover's, the vector moves by more than its velocity says.
    pub(super) fn follow_base(&mut self, step: f64) {
        let Some(motion) = self.base_motion else { return };
        let base_step = self.base_used.map_or(step, |used| motion.time.since(used));
        let shift = motion.velocity * (step - base_step);
        self.position += shift;
        self.constrained.shift(shift);
    }

    /// Reports where the base is, and brings the vector to the instant at which the base measured.
    pub(super) fn report_vector(&self, solution: &mut Solution, single: Option<&SinglePoint>) {
        let Some(motion) = self.base_motion.filter(|_| solution.quality < Quality::None) else { return };
        solution.base = self.base_position;
        let (carried, spread) = self.carried_since(&motion, solution.time, single);
        solution.position -= carried;
        solution.position_covariance += spread;
    }

    /// How far the rover moved since a moving base measured, and the covariance of that; `None` for a base at rest.
    pub(super) fn carried(&self, time: GpsTime, single: Option<&SinglePoint>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        self.base_motion.map(|motion| self.carried_since(&motion, time, single))
    }

    fn carried_since(
        &self,
        motion: &BaseMotion,
        time: GpsTime,
        single: Option<&SinglePoint>,
    ) -> (Vector3<f64>, Matrix3<f64>) {
        let still = (Vector3::zeros(), Matrix3::identity() * UNKNOWN_VELOCITY * UNKNOWN_VELOCITY);
        let known = |velocity: &Velocity| (velocity.velocity, velocity.covariance);
        let (velocity, covariance) = single.and_then(|single| single.velocity.as_ref()).map_or(still, known);
        let apart = time.since(motion.time) - (single.map_or(0.0, clock) - motion.clock);
        (velocity * apart, covariance * (apart * apart))
    }
}

/// Receiver clock minus system time `[s]`, of the first constellation that tells.
fn clock(single: &SinglePoint) -> f64 {
    single.clocks.iter().flatten().next().map_or(0.0, |metres| metres / SPEED_OF_LIGHT)
}

#[cfg(test)]
mod tests {
    use super::super::RtkConfig;
    use super::super::config::{BaselineLength, LengthUse};
    use super::super::preset::Rtk32;
    use super::super::sky::{BASE, ROVER, Sky, start};
    use crate::gnss::epoch::EpochView;
    use crate::gnss::geodesy::Geodetic;
    use crate::gnss::solution::{Quality, Reason, Solution};
    use crate::model::noise::Noise;
    use nalgebra::Vector3;

    /// Two antennas on a vehicle that drives a circle of 100 m at 10 m/s: the base at its rear, the rover 1.6 m before it
    /// and 0.3 m above.
    struct Vehicle {
        sky: Sky,
        filter: Box<Rtk32>,
        place: Vector3<f64>,
    }

    impl Vehicle {
        fn new() -> Self {
            let sky = Sky::new(&["1C", "2W"]);
            let place = Geodetic { latitude: 0.85, longitude: 0.2, height: 200.0 }.to_ecef();
            let config = RtkConfig { moving_base: true, ..RtkConfig::DEFAULT };
            let mut filter = Box::new(Rtk32::new(config, None));
            sky.ephemerides.iter().for_each(|&ephemeris| filter.push_ephemeris(ephemeris));
            Self { sky, filter, place }
        }

        /// Positions and velocities of base and rover.
        fn truth(&self, seconds: f64) -> [[Vector3<f64>; 2]; 2] {
            let local = Geodetic::from_ecef(&self.place);
            let (sin, cos) = (0.1 * seconds).sin_cos();
            let (ahead, aside) = (Vector3::new(cos, -sin, 0.0), Vector3::new(sin, cos, 0.0));
            let rear = [aside * 100.0, ahead * 10.0];
            let front = [rear[0] + ahead * 1.6 + Vector3::new(0.0, 0.0, 0.3), rear[1] - aside * 0.16];
            [rear, front].map(|[at, moving]| [self.place + local.enu_to_ecef(&at), local.enu_to_ecef(&moving)])
        }
    }

    /// The length of the vector between the antennas, √(1.6² + 0.3²) m, as a known one.
    const KNOWN: BaselineLength = BaselineLength { length: 1.627_882_1, sigma: 0.002, usage: LengthUse::Validate };

    /// A vehicle whose filter is told more.
    fn vehicle_with(baseline_length: BaselineLength) -> Vehicle {
        let mut vehicle = Vehicle::new();
        vehicle.filter.configure(RtkConfig { baseline_length: Some(baseline_length), ..*vehicle.filter.config() });
        vehicle
    }

    impl Vehicle {
        /// An epoch in which the base measures so many seconds after the rover, and the error of the vector `[m]`.
        fn epoch(&mut self, seconds: f64, later: f64) -> (Solution, f64) {
            let [[base, base_velocity], _] = self.truth(seconds + later);
            let [_, [rover, velocity]] = self.truth(seconds);
            let time = start().plus_seconds(seconds + later);
            let observations = self.sky.observe(BASE, time, base, base_velocity);
            self.filter.push_base(EpochView { time, observations: &observations });
            let time = start().plus_seconds(seconds);
            let observations = self.sky.observe(ROVER, time, rover, velocity);
            let solution = self.filter.push_rover(EpochView { time, observations: &observations });
            let [_, [at_base, _]] = self.truth(seconds + later);
            let error = solution.base.map_or(f64::NAN, |found| (solution.position - found - (at_base - base)).norm());
            (solution, error)
        }
    }

    fn is_fixed(solution: &Solution) -> bool {
        matches!(solution.quality, Quality::Fixed | Quality::Partial)
    }

    /// Whatever the base's own position is off by (metres, with codes of 0.3 m), the vector is good to the phase's noise:
    /// 2 mm a signal.
    #[test]
    fn the_vector_is_right_while_both_ends_move() {
        let mut vehicle = Vehicle::new();
        for second in 0..60 {
            let (solution, error) = vehicle.epoch(f64::from(second), 0.0);
            if second >= 5 {
                assert!(is_fixed(&solution) && error < 0.02, "{second}: {:?} {error} m", solution.quality);
                let length = (solution.position - solution.base.unwrap()).norm();
                // √(1.6² + 0.3²) m.
                assert!((length - 1.627_882_1).abs() < 0.015, "{second}: {length} m");
                let base = vehicle.truth(f64::from(second))[0][0];
                assert!((solution.base.unwrap() - base).norm() < 5.0);
            }
        }
        // The velocity is that of the vector: 0.16 m/s, not 10.
        let (solution, _) = vehicle.epoch(60.0, 0.0);
        assert!(solution.velocity.norm() < 0.4, "{}", solution.velocity);
    }

    /// Receivers that measure 6 ms apart: 6 cm of way, and another 6 ms: nothing of it is in the vector.
    #[test]
    fn the_vector_is_that_at_the_instant_of_the_base() {
        for later in [0.006, -0.006, 0.2] {
            let mut vehicle = Vehicle::new();
            for second in 0..30 {
                let (solution, error) = vehicle.epoch(f64::from(second), later);
                // The rover's velocity, by Doppler of 2 cm/s, over 0.2 s.
                let limit = if later < 0.1 { 0.02 } else { 0.04 };
                assert!(second < 10 || is_fixed(&solution) && error < limit, "{later} {second}: {error} m");
            }
        }
    }

    /// A right length refuses nothing, and a wrong one every fix, with its reason.
    #[test]
    fn a_known_length_is_validated() {
        let mut vehicle = vehicle_with(KNOWN);
        for second in 0..30 {
            let (solution, error) = vehicle.epoch(f64::from(second), 0.006);
            assert!(second < 10 || is_fixed(&solution) && error < 0.02, "{second}: {:?} {error}", solution.reason);
        }
        let mut vehicle = vehicle_with(BaselineLength { length: 1.527_882_1, ..KNOWN });
        for second in 0..30 {
            let (solution, _) = vehicle.epoch(f64::from(second), 0.006);
            assert!(!is_fixed(&solution), "{second}");
            assert!(second < 10 || solution.reason == Reason::BaselineLength, "{second}: {:?}", solution.reason);
            assert_eq!(solution.ambiguities_fixed, 0);
        }
    }

    /// With codes of 5 cm the float vector is good enough to take the length as a measurement: its own length is then better
    /// by half at least, and no fix is spoilt.
    #[test]
    fn a_known_length_is_measured() {
        let run = |usage| {
            let mut vehicle = vehicle_with(BaselineLength { usage, ..KNOWN });
            vehicle.sky.noise[0] = 0.05;
            let code = Noise { constant: 0.05, elevation: 0.05 };
            vehicle.filter.configure(RtkConfig { code, ..*vehicle.filter.config() });
            let (mut squares, mut fixed) = (0.0, 0);
            for second in 0..30 {
                let (solution, error) = vehicle.epoch(f64::from(second), 0.0);
                fixed += u32::from(is_fixed(&solution) && error < 0.02);
                let base = solution.base.unwrap();
                let float = vehicle.filter.position - base;
                if second >= 5 {
                    squares += (float.norm() - KNOWN.length).powi(2);
                }
            }
            ((squares / 25.0).sqrt(), fixed)
        };
        let ((validated, fixed), (measured, as_well)) = (run(LengthUse::Validate), run(LengthUse::Measure));
        println!("float length rms {validated:.4} m, measured {measured:.4} m; fixed {fixed} and {as_well} of 30");
        assert!(measured < 0.5 * validated && as_well >= fixed, "{measured} {validated} {as_well} {fixed}");
    }

    #[test]
    fn an_epoch_without_the_base_is_no_vector_and_the_next_one_is_again() {
        let mut vehicle = Vehicle::new();
        (0..20).for_each(|second| {
            vehicle.epoch(f64::from(second), 0.0);
        });
        let time = start().plus_seconds(20.0);
        vehicle.filter.push_base(EpochView { time, observations: &[] });
        let [_, [rover, velocity]] = vehicle.truth(20.0);
        let observations = vehicle.sky.observe(ROVER, time, rover, velocity);
        let solution = vehicle.filter.push_rover(EpochView { time, observations: &observations });
        assert_eq!((solution.quality, solution.reason, solution.base), (Quality::Code, Reason::NoBase, None));
        let (solution, error) = vehicle.epoch(21.0, 0.0);
        assert!(is_fixed(&solution) && error < 0.02, "{error} m");
    }

    /// A base that moved is not where it was last: without a coordinate there is none.
    #[test]
    fn a_base_at_rest_has_no_vector() {
        let mut vehicle = Vehicle::new();
        vehicle.epoch(-1.0, 0.0);
        vehicle.filter.configure(RtkConfig::DEFAULT);
        let (solution, _) = vehicle.epoch(0.0, 0.0);
        assert_eq!((solution.quality, solution.reason, solution.base), (Quality::Code, Reason::NoBase, None));
    }
}
