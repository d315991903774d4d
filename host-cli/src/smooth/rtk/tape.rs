//! A record of what the engine used, epoch by epoch, from which a smoother estimates again.
//!
//! Epochs hold the position where they were linearised, in a local frame (east, north, up about the first of them), and
//! their links: residuals in metres with the variances of single observations, see [`surefix_core::rtk::evidence`].
//! A link takes 64 bytes: a day at 1 Hz with 24 signals 130 MB, and the engine's solutions 40 MB.

use crate::process::run::Engine;
use nalgebra::{Matrix3, Vector3};
use std::collections::HashMap;
use std::ops::Range;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::solution::Solution;
use surefix_core::gnss::time::GpsTime;
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::config::MAX_BANDS;
use surefix_core::rtk::evidence::Evidence;

/// The local frame: east, north, up about a point.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// The point, ECEF `[m]`.
    pub origin: Vector3<f64>,
    /// From ECEF to east, north, up.
    pub rotation: Matrix3<f64>,
}

impl Frame {
    fn new(origin: Vector3<f64>) -> Self {
        Self { origin, rotation: Geodetic::from_ecef(&origin).enu_rotation() }
    }
}

/// One signal of an epoch.
#[derive(Clone, Copy, Debug)]
pub struct TapeLink {
    /// Code residual `[m]`; NaN where there is none that was used.
    pub code: f64,
    /// Phase residual `[m]`; NaN likewise.
    pub phase: f64,
    /// Range-rate residual for a rover at rest `[m/s]`; NaN likewise, and for all but one signal of a satellite.
    pub doppler: f32,
    /// Variances of single observations: code, phase, Doppler.
    pub variances: [f32; 3],
    /// Unit vector from rover to satellite: east, north, up.
    pub direction: [f32; 3],
    /// Sine of the elevation.
    pub sin_elevation: f32,
    /// Index of the phase's arc in [`Tape::arcs`].
    pub arc: u32,
    /// Index of its satellite and band in [`Tape::signals`].
    pub signal: u16,
}

/// A satellite and band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Position of the band in its constellation's band plan.
    pub slot: usize,
    /// Index of constellation and band in [`Tape::groups`].
    pub group: usize,
}

/// Signals that share a receiver clock: a constellation and band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Group {
    /// The constellation.
    pub constellation: Constellation,
    /// RINEX digit of the band.
    pub band: char,
}

/// A span over which the ambiguity of a signal stays the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Index of its group.
    pub group: usize,
    /// Index of its signal.
    pub signal: usize,
    /// Metres of one unit of its ambiguity.
    pub unit: f64,
    /// Carrier wavelength `[m]`.
    pub wavelength: f64,
    /// Whether its ambiguity is an integer.
    pub integer: bool,
    /// Epochs of its first and last phase that was used.
    pub span: [usize; 2],
}

/// One rover epoch.
#[derive(Clone, Debug)]
pub struct TapeEpoch {
    /// Receiver time.
    pub time: GpsTime,
    /// The rover's marker where the epoch was linearised: east, north, up `[m]`. Without links it means nothing.
    pub position: Vector3<f64>,
    links: Range<usize>,
}

/// The record of a run.
#[derive(Debug)]
pub struct Tape {
    config: RtkConfig,
    frame: Option<Frame>,
    epochs: Vec<TapeEpoch>,
    links: Vec<TapeLink>,
    signals: Vec<Signal>,
    groups: Vec<Group>,
    arcs: Vec<Arc>,
    solutions: Vec<Solution>,
    group_of: [Option<usize>; 5 * MAX_BANDS],
    signal_of: HashMap<(SatelliteId, usize), usize>,
    arc_of: HashMap<u32, usize>,
}

impl Tape {
    /// An empty tape for an engine of this configuration.
    pub fn new(config: RtkConfig) -> Self {
        Self {
            config,
            frame: None,
            epochs: Vec::new(),
            links: Vec::new(),
            signals: Vec::new(),
            groups: Vec::new(),
            arcs: Vec::new(),
            solutions: Vec::new(),
            group_of: [None; 5 * MAX_BANDS],
            signal_of: HashMap::new(),
            arc_of: HashMap::new(),
        }
    }

    /// Records the epoch that the engine has just answered. One that is not later than the last is left out: then it
    /// returns false.
    pub fn record(&mut self, engine: &Engine, solution: &Solution) -> bool {
        self.config = *engine.config();
        self.push(engine.evidence(), solution)
    }

    /// As [`Tape::record`].
    pub fn push(&mut self, evidence: Option<Evidence<'_>>, solution: &Solution) -> bool {
        if self.epochs.last().is_some_and(|last| solution.time <= last.time) {
            return false;
        }
        let evidence = evidence.filter(|evidence| evidence.time == solution.time);
        let first = self.links.len();
        let mut position = Vector3::zeros();
        if let Some(evidence) = evidence {
            let frame = *self.frame.get_or_insert_with(|| Frame::new(evidence.marker));
            position = frame.rotation * (evidence.marker - frame.origin);
            self.push_links(&evidence, &frame);
        }
        self.epochs.push(TapeEpoch { time: solution.time, position, links: first..self.links.len() });
        self.solutions.push(*solution);
        true
    }

    fn push_links(&mut self, evidence: &Evidence<'_>, frame: &Frame) {
        let epoch = self.epochs.len();
        let first = self.links.len();
        for link in evidence.links() {
            let group = self.group(link.satellite.constellation(), link.slot, link.band);
            let signal = *self.signal_of.entry((link.satellite, link.slot)).or_insert_with(|| {
                self.signals.push(Signal { satellite: link.satellite, slot: link.slot, group });
                self.signals.len() - 1
            });
            let mut arc = u32::MAX;
            let phase = link.phase.filter(|phase| phase.reading.used);
            if let Some(phase) = phase {
                let index = *self.arc_of.entry(phase.arc).or_insert_with(|| {
                    self.arcs.push(Arc {
                        group,
                        signal,
                        unit: phase.unit,
                        wavelength: link.wavelength,
                        integer: phase.integer,
                        span: [epoch; 2],
                    });
                    self.arcs.len() - 1
                });
                self.arcs[index].span[1] = epoch;
                arc = index as u32;
            }
            let code = link.code.filter(|code| code.used);
            let is_first = |other: &TapeLink| {
                other.doppler.is_nan() || self.signals[usize::from(other.signal)].satellite != link.satellite
            };
            let doppler = link.doppler.filter(|_| self.links[first..].iter().all(is_first));
            let direction = frame.rotation * link.direction;
            let variances = [code, phase.map(|phase| phase.reading), doppler];
            self.links.push(TapeLink {
                code: code.map_or(f64::NAN, |code| code.residual),
                phase: phase.map_or(f64::NAN, |phase| phase.reading.residual),
                doppler: doppler.map_or(f32::NAN, |doppler| doppler.residual as f32),
                variances: variances.map(|reading| reading.map_or(f32::NAN, |reading| reading.variance as f32)),
                direction: [direction.x as f32, direction.y as f32, direction.z as f32],
                sin_elevation: link.sin_elevation as f32,
                arc,
                signal: signal as u16,
            });
        }
    }

    fn group(&mut self, constellation: Constellation, slot: usize, band: u8) -> usize {
        *self.group_of[constellation.index() * MAX_BANDS + slot].get_or_insert_with(|| {
            self.groups.push(Group { constellation, band: char::from(band) });
            self.groups.len() - 1
        })
    }

    /// The configuration of the engine.
    pub fn config(&self) -> &RtkConfig {
        &self.config
    }

    /// The local frame; none before an epoch with links.
    pub fn frame(&self) -> Option<&Frame> {
        self.frame.as_ref()
    }

    /// All epochs.
    pub fn epochs(&self) -> &[TapeEpoch] {
        &self.epochs
    }

    /// The links of an epoch, the highest satellite first.
    pub fn links(&self, epoch: usize) -> &[TapeLink] {
        self.epochs.get(epoch).and_then(|epoch| self.links.get(epoch.links.clone())).unwrap_or(&[])
    }

    /// The number of links before those of an epoch.
    pub fn first_link(&self, epoch: usize) -> usize {
        self.epochs.get(epoch).map_or(self.links.len(), |epoch| epoch.links.start)
    }

    /// Number of links of all epochs.
    pub fn link_count(&self) -> usize {
        self.links.len()
    }

    /// All signals.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// All groups.
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// All arcs, in order of their births.
    pub fn arcs(&self) -> &[Arc] {
        &self.arcs
    }

    /// The engine's answers, one for each epoch.
    pub fn solutions(&self) -> &[Solution] {
        &self.solutions
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::drive;
    use super::*;
    use surefix_core::gnss::solution::Reason;

    /// An epoch without evidence keeps its place, so that answers and epochs stay together.
    #[test]
    fn an_epoch_without_evidence_is_kept_without_links() {
        let mut tape = Tape::new(RtkConfig::default());
        let at = |seconds| Solution::none(GpsTime::from_week_tow(2114, seconds), Reason::Complete);
        assert!(tape.push(None, &at(1.0)) && tape.push(None, &at(2.0)));
        assert!(!tape.push(None, &at(2.0)) && !tape.push(None, &at(1.5)), "not later than the last");
        assert_eq!([tape.epochs().len(), tape.solutions().len()], [2; 2]);
        assert!(tape.frame().is_none() && tape.links(1).is_empty() && tape.arcs().is_empty());
    }

    /// What the readings of a link refer to is there, and a slip begins a new arc of the same signal after the old one.
    #[test]
    fn links_refer_to_signals_groups_and_arcs_that_follow_each_other() {
        let (tape, _) = drive(90.0);
        for k in 0..tape.epochs().len() {
            for link in tape.links(k) {
                let signal = tape.signals()[usize::from(link.signal)];
                let group = tape.groups()[signal.group];
                assert_eq!(group.constellation, signal.satellite.constellation());
                let norm: f32 = link.direction.iter().map(|e| e * e).sum();
                assert!((norm - 1.0).abs() < 1e-5 && (f64::from(link.direction[2] - link.sin_elevation)).abs() < 1e-3);
                assert_eq!(link.phase.is_nan(), link.arc == u32::MAX);
                assert_eq!([link.code.is_nan(), link.phase.is_nan()], [0, 1].map(|i| link.variances[i].is_nan()));
            }
            assert!(tape.links(k).is_sorted_by(|a, b| a.sin_elevation >= b.sin_elevation), "the highest comes first");
        }
        let arcs = tape.arcs();
        assert!(arcs.is_sorted_by_key(|arc| arc.span[0]), "in order of their births");
        let mut slipped = 0;
        for (i, arc) in arcs.iter().enumerate() {
            assert!(arc.integer && arc.unit == arc.wavelength && arc.group == tape.signals()[arc.signal].group);
            for later in arcs[i + 1..].iter().filter(|later| later.signal == arc.signal) {
                assert!(later.span[0] > arc.span[1], "{arc:?} {later:?}");
                slipped += 1;
            }
        }
        assert!(slipped > 0, "the scenario has slips");
    }
}
