//! Which phase arcs have known integers relative to each other, and which ambiguity states are left in each epoch.
//!
//! Each arc i has a number nᵢ, of which the data of an epoch tell differences within a group (constellation and band).
//! Arcs whose differences are known form a *cluster*: nᵢ = a + dᵢ with one unknown a. In each group one cluster that is
//! live is the reference and has no state; every other one has one: its a minus that of the reference. If the reference
//! ends, another one takes its place: the states become differences to that of the new one, an exact unimodular map.
//!
//! A cluster is live from the first to the last epoch of its arcs, so that it is never reborn.

use super::tape::{Arc, Tape};
use std::collections::HashMap;

/// Clusters of arcs, a union-find with differences.
#[derive(Clone, Debug)]
pub struct Clusters {
    parent: Vec<usize>,
    /// n of an arc minus n of its parent.
    difference: Vec<f64>,
    size: Vec<usize>,
}

/// What [`Clusters::merge`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merge {
    /// The difference was not known before.
    New,
    /// It was known to be this.
    Known,
    /// It was known to be another one, and still is.
    Contradiction,
}

impl Clusters {
    /// Every arc by itself.
    pub fn new(arcs: usize) -> Self {
        Self { parent: (0..arcs).collect(), difference: vec![0.0; arcs], size: vec![1; arcs] }
    }

    /// The cluster of an arc, named by one of its arcs, and d: n of the arc minus that of the cluster.
    pub fn find(&self, arc: usize) -> (usize, f64) {
        let (mut at, mut d) = (arc, 0.0);
        while self.parent[at] != at {
            d += self.difference[at];
            at = self.parent[at];
        }
        (at, d)
    }

    /// Number of arcs in the cluster of an arc.
    pub fn size(&self, arc: usize) -> usize {
        self.size[self.find(arc).0]
    }

    /// Takes note of n_a − n_b.
    pub fn merge(&mut self, a: usize, b: usize, difference: f64) -> Merge {
        let ((root_a, d_a), (root_b, d_b)) = (self.find(a), self.find(b));
        // n_root_a − n_root_b
        let apart = difference + d_b - d_a;
        if root_a == root_b {
            return if apart == 0.0 { Merge::Known } else { Merge::Contradiction };
        }
        let (child, root, apart) =
            if self.size[root_a] <= self.size[root_b] { (root_a, root_b, apart) } else { (root_b, root_a, -apart) };
        self.parent[child] = root;
        self.difference[child] = apart;
        self.size[root] += self.size[child];
        Merge::New
    }
}

/// One ambiguity state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ambiguity {
    /// The cluster, by the arc that names it.
    pub cluster: usize,
    /// Its group.
    pub group: usize,
    /// Number of the pair of cluster and reference, if the state is an integer.
    pub pair: Option<usize>,
}

/// Which states there are in an epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Ambiguities, in the order of their states.
    pub ambiguities: Vec<Ambiguity>,
    /// The reference of each group.
    pub references: Vec<Option<usize>>,
    /// Visits of signals that have states of coloured noise, in their order.
    pub visits: Vec<usize>,
}

/// A span over which a signal was observed without long gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visit {
    /// The signal.
    pub signal: usize,
    /// First and last epoch.
    pub span: [usize; 2],
}

/// A signal that was gone for longer than this comes back with new multipath `[s]`.
const FORGOTTEN: f64 = 300.0;

/// The visits of all signals, by their first epoch.
pub fn visits(tape: &Tape) -> Vec<Visit> {
    let mut visits: Vec<Visit> = Vec::new();
    let mut latest: Vec<Option<usize>> = vec![None; tape.signals().len()];
    for (k, epoch) in tape.epochs().iter().enumerate() {
        for link in tape.links(k) {
            let signal = usize::from(link.signal);
            let current = latest[signal].filter(|&visit| {
                let last: &Visit = &visits[visit];
                epoch.time.since(tape.epochs()[last.span[1]].time) <= FORGOTTEN
            });
            match current {
                Some(visit) => visits[visit].span[1] = k,
                None => {
                    latest[signal] = Some(visits.len());
                    visits.push(Visit { signal, span: [k; 2] });
                }
            }
        }
    }
    visits
}

/// The layouts of all epochs, each kept once for all epochs that share it.
#[derive(Clone, Debug, Default)]
pub struct Layouts {
    distinct: Vec<Layout>,
    of_epoch: Vec<u32>,
    /// Cluster and reference of each pair.
    pub pairs: Vec<[usize; 2]>,
}

impl Layouts {
    /// The layouts for these clusters.
    pub fn new(tape: &Tape, clusters: &Clusters, visits: &[Visit]) -> Self {
        let arcs = tape.arcs();
        let mut spans: HashMap<usize, [usize; 2]> = HashMap::new();
        for (i, arc) in arcs.iter().enumerate() {
            let span = spans.entry(clusters.find(i).0).or_insert(arc.span);
            *span = [span[0].min(arc.span[0]), span[1].max(arc.span[1])];
        }
        let mut coming: Vec<(usize, [usize; 2])> = spans.into_iter().collect();
        coming.sort_unstable_by_key(|&(cluster, span)| (std::cmp::Reverse(span[0]), std::cmp::Reverse(cluster)));
        let mut next_visit = 0;
        let mut live: Vec<(usize, [usize; 2])> = Vec::new();
        let mut layouts = Self::default();
        let mut numbers: HashMap<[usize; 2], usize> = HashMap::new();
        let mut layout = Layout { references: vec![None; tape.groups().len()], ..Layout::default() };
        for k in 0..tape.epochs().len() {
            let ended = live.len();
            live.retain(|(_, span)| span[1] >= k);
            let mut changed = live.len() != ended || k == 0;
            while let Some(born) = coming.pop_if(|(_, span)| span[0] <= k) {
                live.push(born);
                changed = true;
            }
            let before = layout.visits.len();
            layout.visits.retain(|&visit| visits[visit].span[1] >= k);
            changed |= layout.visits.len() != before;
            while visits.get(next_visit).is_some_and(|visit| visit.span[0] <= k) {
                layout.visits.push(next_visit);
                next_visit += 1;
                changed = true;
            }
            if changed {
                choose_references(&mut layout, &live, arcs, k);
                layout.ambiguities.clear();
                for &(cluster, _) in &live {
                    let group = arcs[cluster].group;
                    let Some(reference) = layout.references[group].filter(|&reference| reference != cluster) else {
                        continue;
                    };
                    let integer = arcs[cluster].integer && arcs[reference].integer;
                    let pair = integer.then(|| {
                        *numbers.entry([cluster, reference]).or_insert_with(|| {
                            layouts.pairs.push([cluster, reference]);
                            layouts.pairs.len() - 1
                        })
                    });
                    layout.ambiguities.push(Ambiguity { cluster, group, pair });
                }
                layouts.distinct.push(layout.clone());
            }
            layouts.of_epoch.push(layouts.distinct.len() as u32 - 1);
        }
        layouts
    }

    /// That of an epoch.
    pub fn of(&self, epoch: usize) -> &Layout {
        &self.distinct[self.of_epoch[epoch] as usize]
    }

    /// Whether two epochs share theirs.
    pub fn same(&self, a: usize, b: usize) -> bool {
        self.of_epoch[a] == self.of_epoch[b]
    }

    /// The first and last epoch of each span that shares one.
    pub fn spans(&self) -> Vec<[usize; 2]> {
        let mut spans: Vec<[usize; 2]> = Vec::with_capacity(self.distinct.len());
        for (k, &layout) in self.of_epoch.iter().enumerate() {
            match spans.get_mut(layout as usize) {
                Some(span) => span[1] = k,
                None => spans.push([k; 2]),
            }
        }
        spans
    }
}

/// Chooses the reference of each group: the one it had, unless that has ended or is no integer while others are; else, of
/// those that were live before if there are any, an integer, and of these the one that lasts longest.
fn choose_references(layout: &mut Layout, live: &[(usize, [usize; 2])], arcs: &[Arc], k: usize) {
    for (group, reference) in layout.references.iter_mut().enumerate() {
        let merit = |&(cluster, span): &(usize, [usize; 2])| {
            let kept = *reference == Some(cluster);
            (span[0] < k, arcs[cluster].integer, kept, span[1], std::cmp::Reverse(cluster))
        };
        *reference = live
            .iter()
            .filter(|(cluster, _)| arcs[*cluster].group == group)
            .max_by_key(|candidate| merit(candidate))
            .map(|&(cluster, _)| cluster);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn differences_follow_from_each_other() {
        let mut clusters = Clusters::new(5);
        assert_eq!(clusters.merge(0, 1, 3.0), Merge::New);
        assert_eq!(clusters.merge(2, 3, -1.0), Merge::New);
        assert_eq!(clusters.merge(1, 3, 10.0), Merge::New);
        // n0 − n2 = 3 + 10 + 1.
        assert_eq!(clusters.merge(0, 2, 14.0), Merge::Known);
        assert_eq!(clusters.merge(2, 0, -13.0), Merge::Contradiction);
        assert_eq!(clusters.merge(0, 2, 14.0), Merge::Known, "a contradiction changes nothing");
        assert_eq!((clusters.size(3), clusters.size(4)), (4, 1));
    }

    proptest! {
        /// Whatever the order, the differences within a cluster are those of the numbers.
        #[test]
        fn clusters_keep_the_numbers(
            numbers in prop::collection::vec(-1000i32..1000, 12), pairs in prop::collection::vec((0usize..12, 0usize..12), 0..40)
        ) {
            let mut clusters = Clusters::new(numbers.len());
            for (a, b) in pairs {
                prop_assert!(clusters.merge(a, b, f64::from(numbers[a] - numbers[b])) != Merge::Contradiction);
            }
            for (a, &number) in numbers.iter().enumerate() {
                let (root, d) = clusters.find(a);
                prop_assert_eq!(d, f64::from(number - numbers[root]));
            }
        }
    }
}
