//! From the links of an epoch to the updated density: what contradicts the rest is left out, the rest taken in.
//!
//! Codes are screened about the predicted position. Phases are screened as they would be if ambiguities were known: those that are not
//! new explain the epoch before to the millimetre, and what the geometry makes of the errors of all other states in the
//! time between is small, so that a phase which is off by more than the noise of two epochs, and what a slant delay walks
//! between them where there is one, has slipped or is wrong ([`crate::filter::screen`], with a free clock for each
//! constellation). Panic contract: none.

use super::config::{Ionosphere, Motion, PppConfig};
use super::link::{Kind, Labels, Link, Row, RowList};
use super::track::ArcEnd;
use super::{EndedArc, PppFilter, States};
use crate::filter::screen;
use crate::filter::update::Form;
use crate::gnss::solution::{Reason, Solution};
use heapless::Vec;
use nalgebra::Matrix3;

impl<const S: usize, const N: usize> PppFilter<S, N> {
    /// Marks the measurements that contradict the others, and ends arcs that do so for too long.
    pub(super) fn screen(&mut self, solution: &mut Solution) {
        let covariance = Matrix3::from_fn(|i, j| self.states.density.covariance(i, j));
        let information = covariance.try_inverse().unwrap_or_default();
        let Self { links, states, tracks, screen: rows, config, reference, ended, step, .. } = self;
        let labels = Labels::of(states, *reference);
        let screening = config.screening;
        for kind in Kind::ALL {
            for slot in 0..Link::slots(config.ionosphere) {
                rows.clear();
                for link in links.iter() {
                    let reading = link.readings(kind)[slot % 2];
                    let row = Row::of(link, kind, slot, &labels, states, config);
                    let innovation = row.as_ref().map_or(f64::NAN, |row| row.innovation(states.density.mean()));
                    let (new, variance) = match kind {
                        Kind::Code => (false, reading.variance),
                        Kind::Phase => (link.age == 0, 2.0 * reading.variance + walked(link, slot, config, *step)),
                    };
                    let _ = rows.push(screen::Row {
                        gradient: -link.sight.direction,
                        group: link.satellite.constellation().index(),
                        innovation,
                        variance,
                        excluded: new || reading.rejected || row.is_none(),
                        error: 0.0,
                    });
                }
                let threshold = if kind == Kind::Code { screening.code } else { screening.phase };
                screen::screen(rows, &information, threshold);
                for (link, row) in links.iter_mut().zip(rows.iter()) {
                    let absent = !row.innovation.is_finite();
                    let reading = &mut link.readings_mut(kind)[slot % 2];
                    reading.rejected |= absent || row.error != 0.0;
                    if row.error != 0.0 {
                        solution.satellites_rejected.insert(link.satellite);
                    }
                }
            }
        }
        for link in links.iter_mut() {
            let Some(track) = tracks.iter_mut().find(|track| track.satellite == link.satellite) else { continue };
            if !link.phase.iter().any(|reading| reading.rejected) {
                track.rejected = 0;
                continue;
            }
            track.rejected = track.rejected.saturating_add(1);
            if track.rejected >= screening.persistence {
                // The next epoch begins a new arc.
                let _ = ended.push(EndedArc { satellite: link.satellite, arc: track.arc, end: ArcEnd::Innovations });
                solution.satellites_slipped.insert(link.satellite);
                track.forget();
            }
        }
    }

    /// Updates the density with what is left, codes first, and computes residuals.
    pub(super) fn take(&mut self) -> Result<(), Reason> {
        let Self { links, states, update, config, reference, step, .. } = self;
        let labels = Labels::of(states, *reference);
        // Epochs of a receiver at rest make up one position together, and their errors are not independent.
        let lasting = match config.motion {
            Motion::Static => config.noise.inflation(*step),
            Motion::Kinematic => 1.0,
        };
        for kind in Kind::ALL {
            let mut rows: Vec<Row, S> = Vec::new();
            for slot in 0..Link::slots(config.ionosphere) {
                rows.clear();
                for link in links.iter().filter(|link| !link.readings(kind)[slot % 2].rejected) {
                    if let Some(mut row) = Row::of(link, kind, slot, &labels, states, config) {
                        row.variance *= lasting;
                        let _ = rows.push(row);
                    }
                }
                if rows.is_empty() {
                    continue;
                }
                let list = RowList(&rows);
                let outcome = states.density.update(Form::Sequential, update, |stage, mean| {
                    let innovation = |i: usize| list.0.get(i).map_or(f64::NAN, |row: &Row| row.innovation(mean));
                    let variance = |i: usize| list.0.get(i).map_or(f64::NAN, |row: &Row| row.variance);
                    stage.independent(&list, 0..list.0.len(), innovation, variance)
                });
                outcome.map_err(|_| Reason::Restarted)?;
            }
        }
        if !states.density.is_sound() {
            return Err(Reason::Restarted);
        }
        residuals(links, states, &labels, config);
        Ok(())
    }
}

/// What the walk of a slant delay in a step of `h` `[s]` adds to the variance of a phase `[m²]`.
fn walked(link: &Link, slot: usize, config: &PppConfig, h: f64) -> f64 {
    match config.ionosphere {
        Ionosphere::Free => 0.0,
        Ionosphere::Estimated => {
            let coefficient = link.ionosphere(Kind::Phase, slot);
            coefficient * coefficient * config.process.ionosphere * libm::fabs(h)
        }
    }
}

/// Computes postfit residuals of all readings, rejected ones too.
fn residuals<const S: usize, const N: usize>(
    links: &mut Vec<Link, S>,
    states: &States<N>,
    labels: &Labels,
    config: &PppConfig,
) {
    for link in links.iter_mut() {
        for kind in Kind::ALL {
            for slot in 0..Link::slots(config.ionosphere) {
                let row = Row::of(link, kind, slot, labels, states, config);
                let postfit = row.map_or(f64::NAN, |row| row.innovation(states.density.mean()));
                link.readings_mut(kind)[slot % 2].postfit = postfit;
            }
        }
    }
}
