//! What the engine made of the latest epoch: the measurements as it used them, for those who want to use them again.
//!
//! A smoother that repeats the estimation over a whole record wants the linearised measurements, with slips found and
//! outliers marked, and not the engine's densities. Residuals are those of [`super::link`], about the position at
//! which the epoch was linearised, so that with an error δp of that position
//!
//! ```text
//! code = c_g − e·δp + noise     phase = c_g − e·δp − unit · n + noise     Doppler = c − e·v + noise
//! ```
//! with a free common term for each group (constellation and band) and type, and the ambiguity n of the phase's arc.
//! Variances are those of single observations: neither what codes have in common with those before nor what the engine
//! learned from residuals is in them.
//!
//! Panic contract: none. Cost: O(1) a link.

use super::RtkFilter;
use super::channel::Channel;
use super::link::Link;
use crate::gnss::satellite::SatelliteId;
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// One measurement of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Observed minus computed `[m]` or `[m/s]`.
    pub residual: f64,
    /// Variance of a single observation, without correlation and without what was learned `[m²]` or `[m²/s²]`.
    pub variance: f64,
    /// Whether the engine used it; otherwise it contradicted the others.
    pub used: bool,
}

/// The carrier phase of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseReading {
    /// Observed minus computed, less the offset of its channel `[m]`.
    pub reading: Reading,
    /// The same as long as the ambiguity is the same: a new number at birth, slip, half cycle and restart.
    pub arc: u32,
    /// Metres of one unit of the ambiguity.
    pub unit: f64,
    /// Whether the ambiguity is an integer.
    pub integer: bool,
}

/// A single difference, rover minus base, of one signal of the latest epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkEvidence {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Position of the band in its constellation's band plan.
    pub slot: usize,
    /// RINEX digit of the band, as an ASCII character.
    pub band: u8,
    /// Carrier wavelength `[m]`.
    pub wavelength: f64,
    /// e, unit vector from rover to satellite, ECEF.
    pub direction: Vector3<f64>,
    /// Sine of the elevation.
    pub sin_elevation: f64,
    /// The code.
    pub code: Option<Reading>,
    /// The phase, where an ambiguity belongs to it.
    pub phase: Option<PhaseReading>,
    /// The rover's range rate; the bands of a satellite may each have one, of which the engine uses the first.
    pub doppler: Option<Reading>,
}

impl LinkEvidence {
    fn new(link: &Link, channels: &[Channel]) -> Self {
        let channel = link.channel.and_then(|i| channels.get(i));
        let phase = link.phase.zip(channel).map(|(phase, channel)| PhaseReading {
            reading: Reading {
                residual: phase - channel.wavelength * channel.offset,
                variance: link.phase_variance,
                used: !link.phase_rejected,
            },
            arc: channel.arc,
            unit: channel.unit(),
            integer: channel.is_integer(),
        });
        Self {
            satellite: link.satellite,
            slot: link.slot,
            band: link.signals[0].band(),
            wavelength: link.wavelength,
            direction: link.direction,
            sin_elevation: link.sin_elevation,
            code: link.code.map(|residual| Reading {
                residual,
                variance: link.single_code_variance,
                used: !link.code_rejected,
            }),
            phase,
            doppler: link.doppler.map(|residual| Reading { residual, variance: link.doppler_variance, used: true }),
        }
    }
}

/// The measurements of an epoch.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// Receiver time of the rover epoch.
    pub time: GpsTime,
    /// Where the epoch was linearised: the predicted position of the antenna reference point, ECEF `[m]`.
    pub position: Vector3<f64>,
    /// The same of the rover's marker, of which a log has solutions.
    pub marker: Vector3<f64>,
    links: &'a [Link],
    channels: &'a [Channel],
}

impl<'a> Evidence<'a> {
    /// The links, the highest satellite first.
    pub fn links(&self) -> impl Iterator<Item = LinkEvidence> + use<'a> {
        let channels = self.channels;
        self.links.iter().map(|link| LinkEvidence::new(link, channels))
    }
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// The measurements of the latest rover epoch; none where it was not used with a base, or ended in a restart.
    pub fn evidence(&self) -> Option<Evidence<'_>> {
        let time = self.time.filter(|_| self.time == self.latest)?;
        let (links, channels) = (self.links.as_slice(), self.channels.as_slice());
        Some(Evidence { time, position: self.linearized, marker: self.marker(self.linearized), links, channels })
    }
}

#[cfg(test)]
mod tests {
    use super::super::preset::Rtk32;
    use super::super::sky::{BASE, ROVER, Sky, start};
    use super::super::{RtkConfig, RtkFilter};
    use super::*;
    use crate::gnss::epoch::EpochView;
    use crate::gnss::geodesy::Geodetic;
    use std::boxed::Box;
    use std::collections::BTreeMap;
    use std::vec::Vec;

    /// Positions of base and rover, 1 km apart.
    fn stations() -> [Vector3<f64>; 2] {
        let base = Geodetic { latitude: 0.8, longitude: 0.2, height: 300.0 };
        let rover = base.to_ecef() + base.enu_to_ecef(&Vector3::new(800.0, 600.0, 20.0));
        [base.to_ecef(), rover]
    }

    /// Runs `epochs` epochs at 1 Hz with what happens before each.
    fn run(epochs: usize, mut happens: impl FnMut(usize, &mut Sky), mut see: impl FnMut(&Rtk32)) {
        let (mut sky, [base, rover]) = (Sky::new(&["1C"]), stations());
        let mut filter: Box<Rtk32> = Box::new(RtkFilter::new(RtkConfig::DEFAULT, Some(base)));
        sky.ephemerides.clone().into_iter().for_each(|ephemeris| filter.push_ephemeris(ephemeris));
        for k in 0..epochs {
            happens(k, &mut sky);
            let time = start().plus_seconds(k as f64);
            let observations = sky.observe(BASE, time, base, Vector3::zeros());
            filter.push_base(EpochView { time, observations: &observations });
            let observations = sky.observe(ROVER, time, rover, Vector3::zeros());
            filter.push_rover(EpochView { time, observations: &observations });
            see(&filter);
        }
    }

    /// With the true position, what is left of codes and of phases is their common term, ambiguity and noise.
    #[test]
    fn residuals_at_the_true_position_are_noise_and_ambiguity() {
        let mut ambiguities: BTreeMap<u32, f64> = BTreeMap::new();
        run(
            5,
            |_, _| {},
            |filter| {
                let evidence = filter.evidence().unwrap();
                let error = stations()[1] - evidence.position;
                let links: Vec<LinkEvidence> = evidence.links().collect();
                assert!(links.len() > 6);
                let residual = |link: &LinkEvidence, reading: Reading| reading.residual + link.direction.dot(&error);
                let first = residual(&links[0], links[0].phase.unwrap().reading);
                for link in &links {
                    let code = residual(link, link.code.unwrap()) - residual(&links[0], links[0].code.unwrap());
                    // Four noises of 0.3 m.
                    assert!(code.abs() < 3.0, "{link:?} {code}");
                    let phase = link.phase.unwrap();
                    assert!(phase.integer && phase.reading.used);
                    let n = -(residual(link, phase.reading) - first) / phase.unit;
                    assert!((n - n.round()).abs() < 0.1, "{link:?} {n}");
                    assert_eq!(*ambiguities.entry(phase.arc).or_insert(n.round()), n.round());
                }
            },
        );
    }

    #[test]
    fn a_slip_begins_an_arc_and_nothing_else_does() {
        let mut arcs: BTreeMap<SatelliteId, Vec<u32>> = BTreeMap::new();
        let mut seen = None;
        run(
            12,
            |k, sky| {
                let highest = seen
                    .get_or_insert_with(|| sky.observe(ROVER, start(), stations()[1], Vector3::zeros())[2].satellite);
                if k == 6 {
                    sky.slips.insert((ROVER, *highest), 7.0);
                }
            },
            |filter| {
                for link in filter.evidence().unwrap().links() {
                    arcs.entry(link.satellite).or_default().push(link.phase.unwrap().arc);
                }
            },
        );
        for (satellite, arcs) in arcs {
            let mut distinct = arcs.clone();
            distinct.dedup();
            assert_eq!(distinct.len(), if Some(satellite) == seen { 2 } else { 1 }, "{satellite} {arcs:?}");
        }
    }

    #[test]
    fn without_a_base_there_is_no_evidence() {
        let (mut sky, [base, rover]) = (Sky::new(&["1C"]), stations());
        let mut filter: Box<Rtk32> = Box::new(RtkFilter::new(RtkConfig::DEFAULT, Some(base)));
        sky.ephemerides.clone().into_iter().for_each(|ephemeris| filter.push_ephemeris(ephemeris));
        let observations = sky.observe(ROVER, start(), rover, Vector3::zeros());
        filter.push_rover(EpochView { time: start(), observations: &observations });
        assert!(filter.evidence().is_none());
    }
}
