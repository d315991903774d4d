//! What the PPP engine used, epoch by epoch, as a record for the smoother.
//!
//! Rows that the engine rejected are left out and counted; arcs are those of the engine, so that slips are known.

use crate::smooth::ppp::tape::{Arc, Epoch, Geometry, Group, Kind as TapeKind, Row, Tape};
use std::collections::BTreeMap;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::ppp::config::Ionosphere;
use surefix_core::ppp::link::{Kind, Link};
use surefix_core::ppp::{PppFilter, PppSolution};

/// A record under construction.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    tape: Tape,
    /// Number of the engine's arc and slot → index in the tape.
    arcs: BTreeMap<(u32, usize), usize>,
    /// Constellation and bands → index in the tape.
    groups: BTreeMap<(Constellation, [u8; 2]), u16>,
    reference: Option<Constellation>,
    rejected: usize,
}

impl Recorder {
    /// Takes the latest epoch of an engine; one without a position has nothing to record.
    pub fn push<const S: usize, const N: usize>(&mut self, engine: &PppFilter<S, N>, solution: &PppSolution) {
        let (Some(station), Some(reference)) = (engine.station(), solution.reference) else { return };
        if engine.links().is_empty() {
            return;
        }
        let reference = *self.reference.get_or_insert(reference);
        if self.tape.epochs.is_empty() {
            self.tape.origin = station.marker;
        }
        let (first, k) = (self.tape.rows.len(), self.tape.epochs.len());
        let ionosphere = engine.config().ionosphere;
        for link in engine.links() {
            for kind in Kind::ALL {
                for slot in 0..Link::slots(ionosphere) {
                    let reading = link.readings(kind)[slot];
                    if reading.rejected
                        || !reading.residual.is_finite()
                        || reading.variance.is_nan()
                        || reading.variance <= 0.0
                    {
                        self.rejected += 1;
                        continue;
                    }
                    let group = self.group(link, slot, ionosphere, reference);
                    let arc = if kind == Kind::Phase { self.arc(link, slot, group, k) } else { 0 };
                    let direction = -link.sight.direction;
                    self.tape.rows.push(Row {
                        kind: match kind {
                            Kind::Code => TapeKind::Code,
                            Kind::Phase => TapeKind::Phase,
                        },
                        satellite: link.satellite,
                        group,
                        arc: arc as u32,
                        elevation: link.sight.look.elevation,
                        direction: direction.into(),
                        wet: link.sight.wet,
                        gradients: link.sight.gradients,
                        ionosphere: match ionosphere {
                            Ionosphere::Free => 0.0,
                            Ionosphere::Estimated => link.ionosphere(kind, slot),
                        },
                        value: reading.residual + direction.dot(&(station.marker - self.tape.origin)),
                        variance: reading.variance,
                        shape: reading.variance / (reading.variance - link.sight.variance).max(1e-3 * reading.variance),
                    });
                    let measured = reading.residual + link.sight.range;
                    self.tape.geometry.push(Geometry { satellite: link.sight.satellite, measured });
                }
            }
        }
        let clock = solution.clock.map_or(0.0, |clock| clock.value);
        self.tape.epochs.push(Epoch {
            time: station.time,
            rows: first..self.tape.rows.len(),
            clock,
            position: station.marker,
        });
    }

    /// The group of a link's slot, made if it is new.
    fn group(&mut self, link: &Link, slot: usize, ionosphere: Ionosphere, reference: Constellation) -> u16 {
        let constellation = link.satellite.constellation();
        let digits = link.pair.bands.map(|band| band.phase_signal.band());
        let bands = match ionosphere {
            Ionosphere::Free => digits,
            Ionosphere::Estimated => [digits[slot]; 2],
        };
        let tape = &mut self.tape;
        *self.groups.entry((constellation, bands)).or_insert_with(|| {
            let known = tape.groups.iter().find(|group| group.constellation == constellation);
            let isb = match known {
                Some(group) => group.isb,
                None => (constellation != reference).then(|| tape.biases()),
            };
            let [a, b] = bands.map(char::from);
            let letter = constellation.letter();
            let name = if a == b { format!("{letter} L{a}") } else { format!("{letter} L{a}/L{b}") };
            tape.groups.push(Group { name, constellation, isb });
            (tape.groups.len() - 1) as u16
        })
    }

    /// The arc of a link's slot, begun if it is new.
    fn arc(&mut self, link: &Link, slot: usize, group: u16, k: usize) -> usize {
        let tape = &mut self.tape;
        let index = *self.arcs.entry((link.arc, slot)).or_insert_with(|| {
            // The engine has taken off what the codes say of it.
            tape.arcs.push(Arc { satellite: link.satellite, group, first: k, last: k, prior: 0.0 });
            tape.arcs.len() - 1
        });
        tape.arcs[index].last = k;
        index
    }

    /// Number of measurements that were left out.
    pub fn rejected(&self) -> usize {
        self.rejected
    }

    /// The record.
    pub fn finish(self) -> Tape {
        self.tape
    }
}
