//! Where the rover is when: smooth paths with their velocity.
//!
//! A path is given in the local frame (east, north, up) at the base, in seconds after the start; before the start and
//! after its end a drive stands still. A drive is integrated once on a grid of 50 ms and interpolated by cubic Hermite
//! polynomials, so that position and velocity are continuous and consistent at any time.

use super::scenario::{Motion, MotionKind};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Grid of a drive `[s]`.
const STEP_S: f64 = 0.05;

/// Position and velocity in the local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// East, north, up `[m]`.
    pub position: Vector3<f64>,
    /// East, north, up `[m/s]`.
    pub velocity: Vector3<f64>,
}

/// A path through time.
#[derive(Clone, Debug)]
pub enum Path {
    /// At rest.
    Rest(Vector3<f64>),
    /// Clockwise on a level circle that starts at its western end.
    Circle {
        /// Start, the western end `[m]`.
        start: Vector3<f64>,
        /// Radius `[m]`.
        radius: f64,
        /// Speed `[m/s]`.
        speed: f64,
    },
    /// States on a grid.
    Grid(Vec<State>),
}

impl Path {
    /// The path of a motion that begins at `start` (east, north, up `[m]`) and lasts `duration` `[s]`.
    pub fn new(motion: &Motion, start: Vector3<f64>, duration: f64) -> Self {
        match motion.kind {
            MotionKind::Static => Self::Rest(start),
            MotionKind::Circle => Self::Circle { start, radius: motion.radius_m, speed: motion.speed_m_s },
            MotionKind::Drive => Self::Grid(drive(motion, start, duration)),
        }
    }

    /// State `seconds` after the start.
    pub fn at(&self, seconds: f64) -> State {
        match self {
            Self::Rest(position) => State { position: *position, velocity: Vector3::zeros() },
            Self::Circle { start, radius, speed } => {
                let (sin, cos) = (speed / radius * seconds).sin_cos();
                State {
                    position: start + *radius * Vector3::new(1.0 - cos, sin, 0.0),
                    velocity: *speed * Vector3::new(sin, cos, 0.0),
                }
            }
            Self::Grid(grid) => hermite(grid, seconds / STEP_S),
        }
    }
}

/// Integrates the manoeuvres, again and again, for `duration` `[s]` and a little more.
fn drive(motion: &Motion, start: Vector3<f64>, duration: f64) -> Vec<State> {
    let steps = (duration / STEP_S).ceil() as usize + 20;
    let cycle: f64 = motion.manoeuvres.iter().map(|manoeuvre| manoeuvre.seconds).sum();
    let height = |travelled: f64| 0.5 * motion.hill_height_m * (1.0 - (TAU * travelled / motion.hill_length_m).cos());
    let slope = |travelled: f64| {
        let wave_number = TAU / motion.hill_length_m;
        0.5 * motion.hill_height_m * wave_number * (wave_number * travelled).sin()
    };
    let (mut heading, mut speed, mut travelled) = (0.0_f64, 0.0_f64, 0.0);
    let (mut east, mut north) = (0.0, 0.0);
    let mut grid = Vec::with_capacity(steps + 1);
    for step in 0..=steps {
        grid.push(State {
            position: start + Vector3::new(east, north, height(travelled)),
            velocity: speed * Vector3::new(heading.sin(), heading.cos(), slope(travelled)),
        });
        let mut time = (step as f64 + 0.5) * STEP_S % cycle.max(STEP_S);
        let manoeuvre = motion.manoeuvres.iter().find(|manoeuvre| {
            time -= manoeuvre.seconds;
            time < 0.0
        });
        let (acceleration, turn) = manoeuvre.map_or((0.0, 0.0), |m| (m.acceleration, m.turn.to_radians()));
        let next_speed = (speed + acceleration * STEP_S).clamp(0.0, motion.speed_m_s);
        // Nobody turns on the spot.
        let next_heading = if next_speed > 0.0 { heading + turn * STEP_S } else { heading };
        let (mean_speed, mean_heading) = (0.5 * (speed + next_speed), 0.5 * (heading + next_heading));
        east += mean_speed * STEP_S * mean_heading.sin();
        north += mean_speed * STEP_S * mean_heading.cos();
        travelled += mean_speed * STEP_S;
        (speed, heading) = (next_speed, next_heading);
    }
    grid
}

/// Cubic Hermite interpolation at `at` grid steps; at rest beyond the ends.
fn hermite(grid: &[State], at: f64) -> State {
    let rest = |state: &State| State { position: state.position, velocity: Vector3::zeros() };
    let index = at.floor();
    let pair = (index >= 0.0).then_some(index as usize).and_then(|i| Some((grid.get(i)?, grid.get(i + 1)?)));
    let Some((a, b)) = pair else {
        return if at < 0.0 { rest(&grid[0]) } else { rest(&grid[grid.len() - 1]) };
    };
    let s = at - index;
    let (s2, s3) = (s * s, s * s * s);
    let chord = b.position - a.position;
    State {
        position: a.position
            + (3.0 * s2 - 2.0 * s3) * chord
            + STEP_S * ((s - 2.0 * s2 + s3) * a.velocity + (s3 - s2) * b.velocity),
        velocity: (6.0 * s - 6.0 * s2) / STEP_S * chord
            + (1.0 - 4.0 * s + 3.0 * s2) * a.velocity
            + (3.0 * s2 - 2.0 * s) * b.velocity,
    }
}

#[cfg(test)]
mod tests {
    use super::super::scenario::Scenario;
    use super::*;

    fn city() -> Path {
        Path::new(&Scenario::default().rover.motion, Vector3::new(1.0, 2.0, 3.0), 600.0)
    }

    #[test]
    fn velocity_is_the_derivative_of_position() {
        let motion = Scenario::default().rover.motion;
        let circle = Motion { kind: MotionKind::Circle, ..motion };
        for path in [city(), Path::new(&circle, Vector3::zeros(), 600.0)] {
            for i in 0..6000 {
                let t = 0.1 * f64::from(i) + 0.013;
                let difference = (path.at(t + 1e-3).position - path.at(t - 1e-3).position) / 2e-3;
                assert!((difference - path.at(t).velocity).norm() < 5e-3, "at {t}");
            }
        }
    }

    #[test]
    fn a_city_has_stops_turns_and_speed() {
        let path = city();
        let speeds: Vec<f64> = (0..600).map(|t| path.at(f64::from(t)).velocity.norm()).collect();
        assert!(speeds.iter().any(|&speed| speed > 19.0) && speeds.iter().all(|&speed| speed < 20.5));
        assert!(speeds.iter().filter(|&&speed| speed == 0.0).count() > 60);
        let far = (0..600).map(|t| path.at(f64::from(t)).position.norm()).fold(0.0, f64::max);
        assert!((300.0..8000.0).contains(&far), "{far}");
    }

    #[test]
    fn a_circle_keeps_its_radius_and_a_path_starts_where_it_is_told() {
        let start = Vector3::new(10.0, 20.0, 30.0);
        let motion = Motion { kind: MotionKind::Circle, radius_m: 5.0, ..Scenario::default().rover.motion };
        let path = Path::new(&motion, start, 60.0);
        assert_eq!(path.at(0.0).position, start);
        assert!(((path.at(17.0).position - start - Vector3::new(5.0, 0.0, 0.0)).norm() - 5.0).abs() < 1e-12);
        assert_eq!(city().at(-1.0), State { position: Vector3::new(1.0, 2.0, 3.0), velocity: Vector3::zeros() });
    }
}
