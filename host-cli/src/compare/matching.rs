//! The truth at a time.

use crate::read::solution::Track;
use nalgebra::Vector3;
use surefix_core::gnss::time::GpsTime;

/// What a solution is compared with.
#[derive(Clone, Debug)]
pub enum Truth {
    /// A coordinate that does not move, ECEF `[m]`.
    Fixed(Vector3<f64>),
    /// Positions over time.
    Track(Track),
}

impl Truth {
    /// ECEF position `[m]` at `time`: the nearest one within `tolerance` `[s]`, or between two that are at most
    /// `interpolate` `[s]` apart, linearly.
    pub fn at(&self, time: GpsTime, tolerance: f64, interpolate: f64) -> Option<Vector3<f64>> {
        let points = match self {
            Self::Fixed(position) => return Some(*position),
            Self::Track(track) => &track.points,
        };
        let next = points.partition_point(|point| point.time < time);
        let before = next.checked_sub(1).and_then(|i| points.get(i));
        let after = points.get(next);
        let distance = |time_of_truth: GpsTime| time_of_truth.since(time).abs();
        let nearest = before.into_iter().chain(after).min_by(|a, b| distance(a.time).total_cmp(&distance(b.time)))?;
        if distance(nearest.time) <= tolerance {
            return Some(nearest.position);
        }
        let (before, after) = (before?, after?);
        let span = after.time.since(before.time);
        let fraction = time.since(before.time) / span;
        (span <= interpolate).then(|| before.position.lerp(&after.position, fraction))
    }

    /// Rows of its file that could not be read.
    pub(super) fn unreadable(&self) -> usize {
        match self {
            Self::Fixed(_) => 0,
            Self::Track(track) => track.unreadable,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::solution::TrackPoint;
    use surefix_core::gnss::solution::Quality;

    #[test]
    fn nearest_within_the_tolerance_else_between() {
        let at = |seconds: f64| GpsTime::from_week_tow(2000, seconds);
        let point = |seconds: f64, x: f64| TrackPoint {
            time: at(seconds),
            position: Vector3::new(x, 0.0, 0.0),
            covariance: None,
            velocity: None,
            quality: Quality::Fixed,
            protection: None,
        };
        let truth = Truth::Track(Track {
            points: vec![point(1.0, 10.0), point(2.0, 20.0), point(9.0, 90.0)],
            ..Track::default()
        });
        let x = |seconds: f64, interpolate: f64| truth.at(at(seconds), 0.05, interpolate).map(|p| p.x);
        assert_eq!(
            [x(1.0, 0.0), x(1.04, 0.0), x(1.96, 0.0), x(0.96, 0.0)],
            [Some(10.0), Some(10.0), Some(20.0), Some(10.0)]
        );
        assert_eq!([x(1.5, 0.0), x(0.9, 1.0), x(9.1, 1.0), x(5.0, 1.0)], [None; 4]);
        assert_eq!([x(1.5, 1.0), x(5.5, 7.0)], [Some(15.0), Some(55.0)]);
        assert_eq!(Truth::Track(Track::default()).at(at(1.0), 1.0, 1.0), None);
    }
}
