//! Orbits between the nodes of a table.
//!
//! With 11 nodes t_j, spaced h apart, and s = (t − t_0)/h, the position at t is r(t) = Σ_j L_j(s) R_j r_j, where
//! L_j(s) = Π_{m≠j} (s − m)/(j − m) (Lagrange) and R_j = R_z(ω (t − t_j)) takes node j from the ECEF frame of its own
//! time to that of t. (M. Schenewerk, *A brief review of basic GPS orbit interpolation strategies*, GPS Solutions 6
//! (2003): 11 points per 15 minutes suffice for millimetres; the rotation makes the path one of an inertial frame, which
//! is smoother.) The velocity is the derivative of the whole expression, v = (1/h) Σ_j L_j'(s) R_j r_j − ω × r, that of
//! the rotating frame.
//!
//! Window: five nodes from the last one strictly before t and five after it, shifted at the ends of the table. In the
//! first and the last intervals errors grow a hundredfold: hand over the neighbouring days where these matter.
//!
//! Cost: about 1000 operations and two sines; binary search. No workspace.

use super::PreciseError;
use crate::gnss::geodesy::EARTH_ROTATION_RATE;
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// Nodes that an interpolation takes.
pub const NODES: usize = 11;
/// Nodes of a window before the one just before the time.
const BEFORE: usize = 5;

/// A tabulated position of a satellite's centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitNode {
    /// When.
    pub time: GpsTime,
    /// Centre of mass, ECEF of `time` `[m]`.
    pub position: Vector3<f64>,
}

/// Where a satellite's centre of mass is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreciseOrbit {
    /// Centre of mass, ECEF of the time asked for `[m]`.
    pub position: Vector3<f64>,
    /// Velocity in the rotating ECEF frame `[m/s]`.
    pub velocity: Vector3<f64>,
}

/// The orbit at `time` from `nodes` of one satellite, sorted by time.
///
/// Errors: [`PreciseError::NoData`], [`PreciseError::TooFew`] (fewer than [`NODES`]), [`PreciseError::Outside`] (before
/// the first or after the last node), [`PreciseError::Gap`] (the window's spacing is not even to the nanosecond),
/// [`PreciseError::NotFinite`].
pub fn orbit(nodes: &[OrbitNode], time: GpsTime) -> Result<PreciseOrbit, PreciseError> {
    let window = window(nodes, time)?;
    let [first, second, ..] = window;
    let spacing = second.time.nanoseconds().saturating_sub(first.time.nanoseconds());
    let even = |a: &OrbitNode, b: &OrbitNode| b.time.nanoseconds().saturating_sub(a.time.nanoseconds()) == spacing;
    if spacing <= 0 || !window.iter().zip(window.iter().skip(1)).all(|(a, b)| even(a, b)) {
        return Err(PreciseError::Gap);
    }

    let spacing = second.time.since(first.time);
    let elapsed = time.since(first.time);
    // Node j is turned by ω (t − t_0 − j h): by a complex factor that is multiplied on from node to node.
    let (mut sin, mut cos) = libm::sincos(EARTH_ROTATION_RATE * elapsed);
    let (step_sin, step_cos) = libm::sincos(EARTH_ROTATION_RATE * spacing);
    let (mut position, mut derivative) = (Vector3::zeros(), Vector3::zeros());
    for (j, node) in window.iter().enumerate() {
        let (weight, slope) = lagrange(j, elapsed / spacing);
        let at = &node.position;
        let rotated = Vector3::new(cos * at.x + sin * at.y, cos * at.y - sin * at.x, at.z);
        position += rotated * weight;
        derivative += rotated * slope;
        (sin, cos) = (sin * step_cos - cos * step_sin, cos * step_cos + sin * step_sin);
    }
    let velocity = derivative / spacing + Vector3::new(position.y, -position.x, 0.0) * EARTH_ROTATION_RATE;
    if (position + velocity).iter().all(|value| value.is_finite()) {
        Ok(PreciseOrbit { position, velocity })
    } else {
        Err(PreciseError::NotFinite)
    }
}

/// The nodes to interpolate between at `time`.
fn window(nodes: &[OrbitNode], time: GpsTime) -> Result<&[OrbitNode; NODES], PreciseError> {
    let (Some(first), Some(last)) = (nodes.first(), nodes.last()) else { return Err(PreciseError::NoData) };
    if time < first.time || time > last.time {
        return Err(PreciseError::Outside);
    }
    let latest_start = nodes.len().checked_sub(NODES).ok_or(PreciseError::TooFew)?;
    let strictly_before = nodes.partition_point(|node| node.time < time).saturating_sub(1);
    let start = strictly_before.saturating_sub(BEFORE).min(latest_start);
    nodes.get(start..).and_then(|rest| rest.first_chunk()).ok_or(PreciseError::TooFew)
}

/// L_j(s) and its derivative, for nodes at 0, 1, … 10.
fn lagrange(j: usize, s: f64) -> (f64, f64) {
    let (mut value, mut slope) = (1.0, 0.0);
    for m in (0..NODES).filter(|&m| m != j) {
        let (factor, distance) = (s - m as f64, j as f64 - m as f64);
        // Product rule, factor by factor.
        slope = (slope * factor + value) / distance;
        value = value * factor / distance;
    }
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::geodesy::rotate_ecef;
    use proptest::prelude::*;

    const RADIUS: f64 = 26_560e3;
    /// Mean motion of a circular orbit of this radius: √(GM/a³).
    const MOTION: f64 = 1.458_6e-4;

    /// A circular orbit inclined by 55°, ECEF at `seconds` from an epoch at which ECEF is the inertial frame.
    fn circle(seconds: f64) -> Vector3<f64> {
        let (sin, cos) = libm::sincos(MOTION * seconds + 0.3);
        let (sin_i, cos_i) = libm::sincos(55.0_f64.to_radians());
        rotate_ecef(&(Vector3::new(cos, sin * cos_i, sin * sin_i) * RADIUS), seconds)
    }

    fn at(seconds: f64) -> GpsTime {
        GpsTime::from_week_tow(2100, seconds)
    }

    fn table(count: usize, spacing: f64) -> Vec<OrbitNode> {
        (0..count).map(|k| OrbitNode { time: at(k as f64 * spacing), position: circle(k as f64 * spacing) }).collect()
    }

    #[test]
    fn a_circular_orbit_is_followed_to_the_millimetre() {
        // The remainder of degree 10 is below a (n h)^11 / (11! …) Π|s − m|: 2e-7 m at 5 min, 3e-2 m at the ends at 15 min.
        let nodes = table(25, 900.0);
        for seconds in [4_500.0, 9_123.456, 10_350.0, 16_000.0] {
            let found = orbit(&nodes, at(seconds)).unwrap();
            assert!((found.position - circle(seconds)).norm() < 1e-3, "{seconds}");
            let velocity = (circle(seconds + 0.5) - circle(seconds - 0.5)) / 1.0;
            assert!((found.velocity - velocity).norm() < 1e-4, "{seconds} {}", (found.velocity - velocity).norm());
        }
    }

    #[test]
    fn nodes_come_back_and_the_ends_belong_to_the_table() {
        let nodes = table(15, 300.0);
        for node in &nodes {
            assert!((orbit(&nodes, node.time).unwrap().position - node.position).norm() < 1e-6);
        }
        assert_eq!(orbit(&nodes, at(-1e-9)), Err(PreciseError::Outside));
        assert_eq!(orbit(&nodes, at(14.0 * 300.0 + 1e-9)), Err(PreciseError::Outside));
    }

    #[test]
    fn gaps_and_short_tables_are_refused() {
        let mut nodes = table(40, 300.0);
        nodes.remove(20);
        // The windows of the intervals from five nodes before the gap to five after it have it in them.
        for k in 0..39 {
            let time = at(k as f64 * 300.0 + 1.0);
            let spoilt = (15..=25).contains(&k);
            assert_eq!(orbit(&nodes, time).err(), spoilt.then_some(PreciseError::Gap), "{k}");
        }
        assert_eq!(orbit(&nodes[..10], at(300.0)), Err(PreciseError::TooFew));
        assert_eq!(orbit(&[], at(300.0)), Err(PreciseError::NoData));
        let same = [nodes[3]; NODES];
        assert_eq!(orbit(&same, nodes[3].time), Err(PreciseError::Gap));
        let mut broken = table(11, 300.0);
        broken[4].position.x = f64::NAN;
        assert_eq!(orbit(&broken, at(10.0)), Err(PreciseError::NotFinite));
    }

    proptest! {
        #[test]
        fn any_nodes_are_interpolated_or_refused(
            times in prop::collection::vec(any::<i64>(), 0..30), time: i64, sorted: bool, scale in -1e300..1e300_f64
        ) {
            let mut times = times;
            if sorted { times.sort_unstable(); }
            let node = |&ns: &i64| OrbitNode {
                time: GpsTime::from_nanoseconds(ns), position: Vector3::new(scale, -scale, 1.0)
            };
            let nodes: Vec<_> = times.iter().map(node).collect();
            if let Ok(found) = orbit(&nodes, GpsTime::from_nanoseconds(time)) {
                prop_assert!(found.position.iter().chain(found.velocity.iter()).all(|value| value.is_finite()));
            }
        }

        #[test]
        fn the_velocity_is_the_derivative_of_the_position(seconds in 300.0..4_000.0_f64) {
            let nodes = table(15, 300.0);
            let here = |s: f64| orbit(&nodes, at(s)).unwrap();
            let difference = here(seconds + 0.25).position - here(seconds - 0.25).position;
            // Times are rounded to 1 ns (4 µm), twice, over half a second.
            prop_assert!((difference / 0.5 - here(seconds).velocity).norm() < 1e-4);
        }
    }
}
