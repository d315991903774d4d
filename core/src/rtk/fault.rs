//! Faults of one satellite behind a fixed solution ([`crate::integrity::fault`]), where they are looked for.
//!
//! Examined are the phases of the epoch whose integers are accepted, with the references they are differences to, by least
//! squares on this epoch alone: what a filter remembers cannot hide a fault from it. A satellite that explains an alarm is
//! left out of the answer, which is then the least-squares one, and its ambiguities are taken to have jumped in the next
//! epoch. An alarm without such a satellite leaves the answer as it is, but never
//! [`Available`](crate::integrity::protection::Status::Available).
//!
//! Cost: O(n · rows) with n satellites. Panic contract: none.

use super::channel::GROUPS;
use super::config::Partial;
use super::{RtkFilter, rows};
use crate::filter::screen::Row;
use crate::gnss::geodesy::Geodetic;
use crate::gnss::solution::{Quality, Reason, Solution};
use crate::integrity::fault::{Verdict, examine};
use nalgebra::Vector3;

/// What the faults of an epoch say of its answer.
#[derive(Clone, Copy)]
pub(super) enum Bound {
    /// How far a fault that was not noticed may go, horizontal and vertical `[m]`.
    Within([f64; 2]),
    /// There is one, of no satellite that can be named.
    Unresolved,
    /// Nothing can be said.
    Unchecked,
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Examines a fixed answer; true if a satellite was left out of it.
    pub(super) fn look_for_faults(&mut self, solution: &mut Solution) -> bool {
        let config = self.config.integrity.fault;
        if !config.enabled || !matches!(solution.quality, Quality::Fixed | Quality::Partial) {
            return false;
        }
        // What is fixed by combinations has no integers to examine.
        if self.config.acceptance.partial == Partial::Decorrelated && solution.quality == Quality::Partial {
            self.monitor.bound_faults(Bound::Unchecked);
            return false;
        }
        let to_enu = Geodetic::from_ecef(&self.linearized).enu_rotation();
        let channels = self.channels.as_slice();
        let of = &mut self.integers.of;
        self.rows.clear();
        of.clear();
        for group in 0..GROUPS {
            for (row, channel) in rows::phase(&self.links, channels, group) {
                let Some(n) = channel.fixed else { continue };
                let [(_, x), (_, y), (_, z)] = row.entries;
                let gradient = to_enu * Vector3::new(x, y, z);
                let innovation = row.value + channel.unit() * n;
                let (variance, excluded, error) = (row.variance, false, 0.0);
                let first = channels.iter().position(|other| other.satellite == channel.satellite);
                // Capacities are those of the channels, of which there are at most 255.
                let _ = self.rows.push(Row { gradient, group, innovation, variance, excluded, error });
                let _ = of.push(first.unwrap_or(0) as u8);
            }
        }
        let Some(found) = examine(&self.rows, of, &config) else {
            self.monitor.bound_faults(Bound::Unchecked);
            return false;
        };
        self.monitor.bound_faults(match found.verdict {
            Verdict::Clear | Verdict::Excluded(_) => Bound::Within(found.levels),
            Verdict::Unresolved => Bound::Unresolved,
            Verdict::Unchecked => Bound::Unchecked,
        });
        let Verdict::Excluded(index) = found.verdict else { return false };
        solution.position = self.linearized + to_enu.transpose() * found.delta;
        solution.position_covariance = to_enu.transpose() * found.covariance * to_enu;
        self.reopen_faulty(index, solution);
        true
    }

    /// Takes the satellite of a channel out of the answer, and its ambiguities to have jumped.
    fn reopen_faulty(&mut self, index: u8, solution: &mut Solution) {
        let Some(satellite) = self.channels.as_slice().get(usize::from(index)).map(|channel| channel.satellite) else {
            return;
        };
        for channel in self.channels.as_mut_slice().iter_mut().filter(|channel| channel.satellite == satellite) {
            if channel.state.is_some() && channel.fixed.is_some() {
                solution.ambiguities_fixed = solution.ambiguities_fixed.saturating_sub(1);
            }
            channel.fixed = None;
            channel.slip_pending = true;
        }
        solution.satellites_used.remove(satellite);
        solution.satellites_rejected.insert(satellite);
        (solution.quality, solution.reason) = (Quality::Partial, Reason::SubsetOnly);
        self.constrained.end();
    }
}
