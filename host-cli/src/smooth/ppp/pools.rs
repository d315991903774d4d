//! Which rows share a variance.
//!
//! A pool with less than a minimal number of rows has too few samples of its variance: its rows borrow that of all rows
//! of their constellation, signal and kind, which is learned from all of these.

use super::tape::{Kind, Row, Tape};
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use surefix_core::gnss::satellite::SatelliteId;

/// What rows of a pool have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Constellation, signal and kind.
    Type,
    /// Satellite, signal and kind.
    Satellite,
    /// Constellation, signal, kind and elevation bin.
    Elevation,
}

/// Edges of the elevation bins `[°]`; what is below the first is a bin too.
pub const EDGES: [f64; 4] = [7.0, 15.0, 25.0, 40.0];

/// What a pool is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
struct Key {
    kind: Kind,
    group: u16,
    /// The satellite or the bin; none for all.
    part: Option<Part>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Part {
    Satellite(char, u8),
    Bin(usize),
}

impl Key {
    fn new(row: &Row, rule: Rule) -> Self {
        let part = match rule {
            Rule::Type => None,
            Rule::Satellite => Some(satellite(row.satellite)),
            Rule::Elevation => Some(Part::Bin(bin(row.elevation))),
        };
        Self { kind: row.kind, group: row.group, part }
    }

    fn name(&self, tape: &Tape) -> String {
        let group = tape.groups.get(usize::from(self.group)).map_or("", |group| &group.name);
        let part = match self.part {
            None => String::new(),
            Some(Part::Satellite(letter, number)) => format!(" {letter}{number:02}"),
            Some(Part::Bin(bin)) => {
                let from = if bin == 0 { 0.0 } else { EDGES[bin - 1] };
                format!(" {from:.0}–{:.0}°", EDGES.get(bin).copied().unwrap_or(90.0))
            }
        };
        format!("{} {group}{part}", self.kind.name())
    }
}

fn satellite(id: SatelliteId) -> Part {
    Part::Satellite(id.constellation().letter(), id.number())
}

/// Number of edges at or below an elevation `[rad]`.
fn bin(elevation: f64) -> usize {
    let degrees = elevation * 90.0 / FRAC_PI_2;
    EDGES.iter().take_while(|edge| degrees >= **edge).count()
}

/// A pool.
#[derive(Clone, Debug, PartialEq)]
pub struct Pool {
    /// For people: "phase G L1/L2 25–40°".
    pub name: String,
    /// What it is of.
    pub kind: Kind,
    /// Number of rows from which its variance is learned.
    pub count: usize,
}

/// All pools, and to which each row belongs.
#[derive(Clone, Debug, Default)]
pub struct Pools {
    pools: Vec<Pool>,
    of: Vec<u32>,
    /// The pool of its kind and signal that a row's own pool does not borrow from, but others do.
    lent: Vec<Option<u32>>,
}

impl Pools {
    /// The pools of the rows that are `active`; the others belong to pools, but do not count.
    pub fn new(tape: &Tape, active: &[bool], rule: Rule, minimum: usize) -> Self {
        let counted = |key: &dyn Fn(&Row) -> Key| {
            let mut counts: HashMap<Key, usize> = HashMap::new();
            for (row, &active) in tape.rows.iter().zip(active) {
                *counts.entry(key(row)).or_default() += usize::from(active);
            }
            counts
        };
        let wide = |row: &Row| Key::new(row, Rule::Type);
        let (counts, all) = (counted(&|row| Key::new(row, rule)), counted(&wide));
        let key = |row: &Row| {
            let own = Key::new(row, rule);
            if counts.get(&own).is_some_and(|&count| count >= minimum) { own } else { wide(row) }
        };
        let mut keys: Vec<Key> = tape.rows.iter().map(key).collect();
        keys.sort_unstable();
        keys.dedup();
        let place = |key: &Key| keys.binary_search(key).ok().map(|i| i as u32);
        let of = tape.rows.iter().map(|row| place(&key(row)).unwrap_or(0)).collect();
        let lent = |row: &Row| place(&wide(row)).filter(|_| key(row) != wide(row));
        let lent = tape.rows.iter().map(lent).collect();
        let pool = |key: &Key| {
            let count = if key.part.is_none() { all.get(key) } else { counts.get(key) };
            Pool { name: key.name(tape), kind: key.kind, count: count.copied().unwrap_or(0) }
        };
        Self { pools: keys.iter().map(pool).collect(), of, lent }
    }

    /// All, by index.
    pub fn list(&self) -> &[Pool] {
        &self.pools
    }

    /// The pool whose variance a row has.
    pub fn of(&self, row: usize) -> usize {
        self.of.get(row).map_or(0, |&pool| pool as usize)
    }

    /// The pools that learn from a row: its own, and the one that lends to small pools of its kind and signal.
    pub fn learning(&self, row: usize) -> impl Iterator<Item = usize> + '_ {
        let lent = self.lent.get(row).copied().flatten().map(|pool| pool as usize);
        std::iter::once(self.of(row)).chain(lent)
    }

    /// The mean of `value` over the rows from which each pool learns; `fallback` where there are none. Rows whose value is
    /// NaN do not count.
    pub fn means(&self, value: impl Fn(usize) -> f64, fallback: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![(0.0, 0usize); self.pools.len()];
        for row in 0..self.of.len() {
            let value = value(row);
            if value.is_nan() {
                continue;
            }
            for pool in self.learning(row) {
                if let Some((sum, count)) = sums.get_mut(pool) {
                    *sum += value;
                    *count += 1;
                }
            }
        }
        let mean =
            |(pool, (sum, count)): (usize, (f64, usize))| if count > 0 { sum / count as f64 } else { fallback(pool) };
        sums.into_iter().enumerate().map(mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::drawn;
    use super::*;

    #[test]
    fn bins_begin_at_their_edges() {
        let degrees = [0.0, 6.9, 7.1, 15.1, 39.9, 40.1, 90.0];
        assert_eq!(degrees.map(|degrees| bin(f64::to_radians(degrees))), [0, 0, 1, 2, 3, 4, 4]);
    }

    /// Pools of large enough numbers partition the rows; small ones borrow, and the lender learns from all of its kind.
    #[test]
    fn small_pools_borrow_from_their_kind_and_signal() {
        let tape = drawn(2).tape;
        let active = vec![true; tape.rows.len()];
        let all = Pools::new(&tape, &active, Rule::Elevation, 0);
        assert_eq!(all.list().iter().map(|pool| pool.count).sum::<usize>(), tape.rows.len());
        assert!((0..tape.rows.len()).all(|row| all.learning(row).count() == 1));
        let none = Pools::new(&tape, &active, Rule::Elevation, usize::MAX);
        let types = Pools::new(&tape, &active, Rule::Type, 0);
        assert_eq!(none.list(), types.list());
        let ones = types.means(|_| 1.0, |_| 0.0);
        assert!(ones.iter().all(|&mean| mean == 1.0));
        let least = all.list().iter().map(|pool| pool.count).min().unwrap();
        let some = Pools::new(&tape, &active, Rule::Elevation, least + 1);
        let lender = some.list().iter().find(|pool| !pool.name.contains('°')).unwrap();
        let of_type = types.list().iter().find(|pool| pool.name == lender.name).unwrap();
        assert_eq!(lender.count, of_type.count);
    }

    #[test]
    fn rows_held_out_do_not_count() {
        let tape = drawn(2).tape;
        let mut active = vec![true; tape.rows.len()];
        active[0] = false;
        let pools = Pools::new(&tape, &active, Rule::Satellite, 0);
        assert_eq!(pools.list().iter().map(|pool| pool.count).sum::<usize>(), tape.rows.len() - 1);
        let means = pools.means(|row| if active[row] { 2.0 } else { f64::NAN }, |_| 0.0);
        assert!(means.iter().all(|&mean| mean == 2.0 || mean == 0.0));
    }
}
