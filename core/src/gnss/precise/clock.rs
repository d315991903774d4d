//! Satellite clocks between the records of a table.
//!
//! Atomic clocks wander: between two records the straight line is the best guess, and how far the nearer record is says
//! how much to trust it (at 5-minute spacing 1e-10 s rms for GPS clocks, at 30 s a tenth of that).
//!
//! Cost: a binary search and a division.

use super::PreciseError;
use crate::gnss::time::GpsTime;

/// A tabulated clock of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockNode {
    /// When.
    pub time: GpsTime,
    /// Satellite clock minus the product's time scale, without the periodic relativistic term `[s]`.
    pub bias: f64,
}

/// A clock between two records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockValue {
    /// Satellite clock minus the product's time scale, without the periodic relativistic term `[s]`.
    pub bias: f64,
    /// Time to the nearer record `[s]`; 0 at a record.
    pub distance: f64,
    /// Time between the two records `[s]`; 0 at a record.
    pub spacing: f64,
}

/// The clock at `time` from `nodes` of one satellite, sorted by time, between records at most `max_gap` `[s]` apart.
///
/// Errors: [`PreciseError::NoData`], [`PreciseError::Outside`] (before the first or after the last record),
/// [`PreciseError::Gap`], [`PreciseError::NotFinite`].
pub fn clock(nodes: &[ClockNode], time: GpsTime, max_gap: f64) -> Result<ClockValue, PreciseError> {
    if nodes.is_empty() {
        return Err(PreciseError::NoData);
    }
    let (before, from) = nodes.split_at_checked(nodes.partition_point(|node| node.time < time)).unwrap_or_default();
    let after = from.first().ok_or(PreciseError::Outside)?;
    let value = if after.time == time {
        ClockValue { bias: after.bias, distance: 0.0, spacing: 0.0 }
    } else {
        let before = before.last().ok_or(PreciseError::Outside)?;
        let (elapsed, remaining) = (time.since(before.time), after.time.since(time));
        let spacing = after.time.since(before.time);
        // (NaN as a limit refuses.)
        if !(elapsed > 0.0 && remaining > 0.0 && spacing <= max_gap) {
            return Err(PreciseError::Gap);
        }
        // (Not over the spacing: differences of times saturate at the ends of their range.)
        let bias = (before.bias * remaining + after.bias * elapsed) / (elapsed + remaining);
        ClockValue { bias, distance: elapsed.min(remaining), spacing }
    };
    if value.bias.is_finite() { Ok(value) } else { Err(PreciseError::NotFinite) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(seconds: f64) -> GpsTime {
        GpsTime::from_week_tow(2100, seconds)
    }

    const NODES: [(f64, f64); 4] = [(0.0, 1e-4), (30.0, 2e-4), (60.0, 1e-4), (120.0, 0.0)];

    fn nodes() -> [ClockNode; 4] {
        NODES.map(|(seconds, bias)| ClockNode { time: at(seconds), bias })
    }

    #[test]
    fn a_straight_line_joins_neighbours() {
        let between = clock(&nodes(), at(40.0), 30.0).unwrap();
        assert!((between.bias - 5e-4 / 3.0).abs() < 1e-19);
        assert_eq!((between.distance, between.spacing), (10.0, 30.0));
        for (seconds, bias) in NODES {
            let exact = ClockValue { bias, distance: 0.0, spacing: 0.0 };
            assert_eq!(clock(&nodes(), at(seconds), 30.0), Ok(exact));
        }
    }

    #[test]
    fn gaps_and_what_lies_outside_are_refused() {
        assert_eq!(clock(&nodes(), at(61.0), 30.0), Err(PreciseError::Gap));
        assert!(clock(&nodes(), at(61.0), 60.0).is_ok());
        assert_eq!(clock(&nodes(), at(61.0), f64::NAN), Err(PreciseError::Gap));
        assert_eq!(clock(&nodes(), at(-0.001), 30.0), Err(PreciseError::Outside));
        assert_eq!(clock(&nodes(), at(120.001), 30.0), Err(PreciseError::Outside));
        assert_eq!(clock(&[], at(0.0), 30.0), Err(PreciseError::NoData));
        let broken = [ClockNode { time: at(0.0), bias: f64::INFINITY }];
        assert_eq!(clock(&broken, at(0.0), 30.0), Err(PreciseError::NotFinite));
    }

    proptest! {
        #[test]
        fn any_nodes_are_interpolated_or_refused(
            nodes in prop::collection::vec((any::<i64>(), -1.0..1.0_f64), 0..20), time: i64, max_gap: f64
        ) {
            let nodes: Vec<_> =
                nodes.iter().map(|&(ns, bias)| ClockNode { time: GpsTime::from_nanoseconds(ns), bias }).collect();
            if let Ok(found) = clock(&nodes, GpsTime::from_nanoseconds(time), max_gap) {
                prop_assert!(found.bias.abs() <= 1.0 + 1e-12);
            }
        }
    }
}
