//! Which rows share a variance.
//!
//! A part of a signal with less than a minimal number of rows has too few samples of a variance of its own: elevation bins
//! then share the one of the bin above (the last that of the bin below), satellites with few rows one of their own. Every
//! row belongs to one pool and every pool learns from its own rows, so that the mean of a pool maximises the likelihood.

use super::tape::{Kind, Row, Tape};
use std::collections::{BTreeMap, HashMap};
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

/// Kind and signal.
type Signal = (Kind, u16);

/// What a rule tells apart in a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Part {
    All,
    Satellite(char, u8),
    Bin(usize),
}

impl Part {
    fn of(row: &Row, rule: Rule) -> Self {
        match rule {
            Rule::Type => Self::All,
            Rule::Satellite => satellite(row.satellite),
            Rule::Elevation => Self::Bin(bin(row.elevation)),
        }
    }
}

/// For people: " G05 G07", " 25–40°", or nothing for all.
fn name(parts: &[Part]) -> String {
    match parts {
        [Part::Bin(first), ..] => {
            let last = parts.iter().fold(*first, |last, part| if let Part::Bin(bin) = part { *bin } else { last });
            let from = if *first == 0 { 0.0 } else { EDGES[first - 1] };
            format!(" {from:.0}–{:.0}°", EDGES.get(last).copied().unwrap_or(90.0))
        }
        _ => parts.iter().fold(String::new(), |name, part| match part {
            Part::Satellite(letter, number) => format!("{name} {letter}{number:02}"),
            _ => name,
        }),
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
}

impl Pools {
    /// The pools of the rows that are `active`; the others belong to pools, but do not count.
    pub fn new(tape: &Tape, active: &[bool], rule: Rule, minimum: usize) -> Self {
        let mut signals: BTreeMap<Signal, BTreeMap<Part, usize>> = BTreeMap::new();
        for (row, &active) in tape.rows.iter().zip(active) {
            let parts = signals.entry((row.kind, row.group)).or_default();
            *parts.entry(Part::of(row, rule)).or_default() += usize::from(active);
        }
        let mut pools = Vec::new();
        let mut places = HashMap::new();
        for (&(kind, group), parts) in &signals {
            let signal = tape.groups.get(usize::from(group)).map_or("", |group| &group.name);
            for (parts, count) in shared(parts, rule, minimum) {
                places.extend(parts.iter().map(|&part| ((kind, group, part), pools.len() as u32)));
                pools.push(Pool { name: format!("{} {signal}{}", kind.name(), name(&parts)), kind, count });
            }
        }
        let place = |row: &Row| places.get(&(row.kind, row.group, Part::of(row, rule))).copied().unwrap_or(0);
        Self { pools, of: tape.rows.iter().map(place).collect() }
    }

    /// All, by index.
    pub fn list(&self) -> &[Pool] {
        &self.pools
    }

    /// The pool to which a row belongs.
    pub fn of(&self, row: usize) -> usize {
        self.of.get(row).map_or(0, |&pool| pool as usize)
    }

    /// The mean of `value` over the rows of each pool; `fallback` where there are none. Rows whose value is NaN do not
    /// count.
    pub fn means(&self, value: impl Fn(usize) -> f64, fallback: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![(0.0, 0usize); self.pools.len()];
        for row in 0..self.of.len() {
            let value = value(row);
            if let (false, Some((sum, count))) = (value.is_nan(), sums.get_mut(self.of(row))) {
                *sum += value;
                *count += 1;
            }
        }
        let mean =
            |(pool, (sum, count)): (usize, (f64, usize))| if count > 0 { sum / count as f64 } else { fallback(pool) };
        sums.into_iter().enumerate().map(mean).collect()
    }
}

/// Parts that share a variance, with the number of their rows: as many, one after another, as have at least `minimum` rows
/// together; what is left at the end goes with the last. Bins come in their order, satellites by their number of rows.
fn shared(parts: &BTreeMap<Part, usize>, rule: Rule, minimum: usize) -> Vec<(Vec<Part>, usize)> {
    let mut parts: Vec<(Part, usize)> = parts.iter().map(|(&part, &count)| (part, count)).collect();
    if rule == Rule::Satellite {
        parts.sort_by_key(|&(part, count)| (count, part));
    }
    let mut pools: Vec<(Vec<Part>, usize)> = Vec::new();
    let mut open = false;
    for (part, count) in parts {
        match pools.last_mut() {
            Some((parts, sum)) if open => {
                parts.push(part);
                *sum += count;
            }
            _ => pools.push((vec![part], count)),
        }
        open = pools.last().is_some_and(|(_, sum)| *sum < minimum);
    }
    if open && let Some((parts, count)) = pools.pop() {
        match pools.last_mut() {
            Some(last) => {
                last.0.extend(parts);
                last.1 += count;
            }
            None => pools.push((parts, count)),
        }
    }
    pools.iter_mut().for_each(|(parts, _)| parts.sort_unstable());
    pools
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

    /// Whatever the rule and the least number, the pools share all rows out, and have as many as they should.
    #[test]
    fn pools_partition_the_rows_and_none_is_small() {
        let tape = drawn(2).tape;
        let active = vec![true; tape.rows.len()];
        let types = Pools::new(&tape, &active, Rule::Type, 0);
        for rule in [Rule::Type, Rule::Satellite, Rule::Elevation] {
            for minimum in [0, 1, 30, 100, usize::MAX] {
                let pools = Pools::new(&tape, &active, rule, minimum);
                let counted = |pool: usize| (0..tape.rows.len()).filter(|&row| pools.of(row) == pool).count();
                for (nth, pool) in pools.list().iter().enumerate() {
                    assert_eq!(pool.count, counted(nth), "{}", pool.name);
                }
                assert_eq!(pools.list().iter().map(|pool| pool.count).sum::<usize>(), tape.rows.len());
                if minimum == usize::MAX {
                    let counts = |pools: &Pools| pools.list().iter().map(|pool| pool.count).collect::<Vec<_>>();
                    assert_eq!(counts(&pools), counts(&types));
                } else {
                    let of_type =
                        |kind| types.list().iter().filter(|pool| pool.kind == kind).map(|pool| pool.count).min();
                    assert!(pools.list().iter().all(|pool| Some(pool.count) >= of_type(pool.kind).min(Some(minimum))));
                }
            }
        }
    }

    #[test]
    fn small_bins_go_with_the_one_above_and_the_last_with_the_one_below() {
        let counts =
            |counts: [usize; 5]| counts.into_iter().enumerate().map(|(i, count)| (Part::Bin(i), count)).collect();
        let names = |parts: &BTreeMap<Part, usize>, minimum| -> Vec<String> {
            shared(parts, Rule::Elevation, minimum)
                .iter()
                .map(|(parts, count)| format!("{count}{}", name(parts)))
                .collect()
        };
        assert_eq!(names(&counts([2, 9, 40, 50, 8]), 10), ["11 0–15°", "40 15–25°", "58 25–90°"]);
        assert_eq!(names(&counts([2, 9, 0, 0, 0]), 30), ["11 0–90°"]);
    }

    #[test]
    fn satellites_with_few_rows_share_a_variance() {
        let parts = [(5, 12), (7, 200), (9, 19), (11, 90)].map(|(number, count)| (Part::Satellite('G', number), count));
        let shared = shared(&BTreeMap::from(parts), Rule::Satellite, 30);
        let names: Vec<String> = shared.iter().map(|(parts, count)| format!("{count}{}", name(parts))).collect();
        assert_eq!(names, ["31 G05 G09", "90 G11", "200 G07"]);
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
