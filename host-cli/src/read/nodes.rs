//! Tables over time by satellite, sorted, each time once.

use std::collections::BTreeMap;
use surefix_core::gnss::precise::{ClockNode, OrbitNode};
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::time::GpsTime;

/// Something at a time.
pub trait Timed {
    /// The time.
    fn time(&self) -> GpsTime;
}

impl Timed for OrbitNode {
    fn time(&self) -> GpsTime {
        self.time
    }
}

impl Timed for ClockNode {
    fn time(&self) -> GpsTime {
        self.time
    }
}

/// Nodes by satellite.
#[derive(Clone, Debug, PartialEq)]
pub struct Nodes<T> {
    table: BTreeMap<SatelliteId, Vec<T>>,
}

impl<T> Default for Nodes<T> {
    fn default() -> Self {
        Self { table: BTreeMap::new() }
    }
}

impl<T: Timed> Nodes<T> {
    /// Adds a node; order comes with [`Nodes::sort`].
    pub fn push(&mut self, satellite: SatelliteId, node: T) {
        self.table.entry(satellite).or_default().push(node);
    }

    /// Sorts, and leaves the first node of each time of a satellite. Returns how many others there were.
    pub fn sort(&mut self) -> u64 {
        let mut duplicates = 0;
        for nodes in self.table.values_mut() {
            let before = nodes.len();
            nodes.sort_by_key(Timed::time);
            nodes.dedup_by_key(|node| node.time());
            duplicates += (before - nodes.len()) as u64;
        }
        duplicates
    }

    /// Adds those of another table, behind the own ones where times are the same. Returns how many were left out so.
    pub fn merge(&mut self, other: Self) -> u64 {
        for (satellite, nodes) in other.table {
            self.table.entry(satellite).or_default().extend(nodes);
        }
        self.sort()
    }

    /// The nodes of a satellite, sorted; none if it has none.
    pub fn of(&self, satellite: SatelliteId) -> &[T] {
        self.table.get(&satellite).map_or(&[], Vec::as_slice)
    }

    /// The satellites that have nodes, in order.
    pub fn satellites(&self) -> impl Iterator<Item = SatelliteId> + '_ {
        self.table.keys().copied()
    }

    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.table.values().map(Vec::len).sum()
    }

    /// First and last time of all.
    pub fn span(&self) -> Option<(GpsTime, GpsTime)> {
        let first = self.table.values().filter_map(|nodes| nodes.first()).map(Timed::time).min()?;
        let last = self.table.values().filter_map(|nodes| nodes.last()).map(Timed::time).max()?;
        Some((first, last))
    }

    /// The time between neighbours that occurs most often, the shorter of equals `[s]`.
    pub fn spacing(&self) -> Option<f64> {
        let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
        for pair in self.table.values().flat_map(|nodes| nodes.windows(2)) {
            *counts.entry(pair[1].time().nanoseconds() - pair[0].time().nanoseconds()).or_default() += 1;
        }
        let (&ns, _) = counts.iter().rev().max_by_key(|(_, count)| **count)?;
        Some(ns as f64 / 1e9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(seconds: f64, bias: f64) -> ClockNode {
        ClockNode { time: GpsTime::from_week_tow(2100, seconds), bias }
    }

    #[test]
    fn tables_are_merged_with_each_time_once() {
        let satellite: SatelliteId = "G01".parse().unwrap();
        let table = |nodes: &[ClockNode]| {
            let mut table = Nodes::default();
            nodes.iter().for_each(|&node| table.push(satellite, node));
            table
        };
        let mut first = table(&[node(30.0, 2.0), node(0.0, 1.0)]);
        assert_eq!(first.sort(), 0);
        assert_eq!(first.merge(table(&[node(30.0, 9.0), node(60.0, 3.0), node(120.0, 4.0)])), 1);
        assert_eq!(first.of(satellite), [node(0.0, 1.0), node(30.0, 2.0), node(60.0, 3.0), node(120.0, 4.0)]);
        assert_eq!((first.len(), first.spacing()), (4, Some(30.0)));
        assert_eq!(first.span(), Some((node(0.0, 0.0).time, node(120.0, 0.0).time)));
        assert!(first.of("G02".parse().unwrap()).is_empty());
        assert_eq!(Nodes::<ClockNode>::default().span(), None);
    }
}
