//! A city made of a real drive under open sky.
//!
//! In stretches of time the rover is between buildings ([`canyon`]). These hide satellites, which are taken away or, some of
//! them, seen by reflection only: their codes are then too long, their phases gone or those of the reflection. All others
//! get reflections beside the direct signal ([`signal`]) and, now and then, a cycle slip without a flag. Signals that
//! come back have new ambiguities. All that was done is listed ([`events`]); the errors by reflections are the output
//! minus the input. What happens under open sky stays as it is, but for whole cycles since the last jump.
//!
//! Every stretch, satellite and signal draws from its own stream of random numbers, all from one seed: the same seed gives
//! the same output, and an additional satellite changes no other, as long as the places stay the same, which single
//! points give ([`sky`]). A satellite without ephemeris stays as it is.

pub mod body;
pub mod canyon;
pub mod events;
pub mod files;
pub mod scenario;
pub mod signal;
pub mod sky;

use crate::read::rinex::{NavigationData, ObservationEpoch};
use crate::simulate::scenario::ScenarioError;
use crate::study::monte_carlo::stream;
use body::Body;
use canyon::{STRETCHES, stretches};
use events::{Event, What};
use scenario::Scenario;
use signal::Channel;
use sky::{Place, Sky};
use std::collections::{BTreeMap, BTreeSet};
use surefix_core::gnss::epoch::Observation;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::signal::Signal;

/// Why observations cannot be degraded. Messages contain their causes.
#[derive(Debug, thiserror::Error)]
pub enum DegradeError {
    /// The scenario makes no sense.
    #[error("{0}")]
    Scenario(ScenarioError),
    /// No epoch.
    #[error("the rover has no epoch with observations; is this the right file, and was it written to the end?")]
    NoEpoch,
    /// No single point.
    #[error("no epoch of the rover gives a single point; give the navigation file of its day and its constellations")]
    NoPosition,
}

/// What became of a rover's observations.
#[derive(Clone, Debug)]
pub struct Degraded {
    /// As many epochs as before.
    pub epochs: Vec<ObservationEpoch>,
    /// What was done, in order of time.
    pub events: Vec<Event>,
    /// Satellites that were left as they are, for want of an ephemeris or of a carrier frequency.
    pub unknown: BTreeSet<SatelliteId>,
}

/// Number of the stream of a satellite or of one of its signals, above those of the stretches.
fn number(satellite: SatelliteId, signal: Option<Signal>) -> u64 {
    let of_signal = signal.map_or(0, |signal| u64::from(signal.band()) << 8 | u64::from(signal.attribute()));
    let of_satellite = (satellite.constellation().index() as u64) << 8 | u64::from(satellite.number());
    STRETCHES * (1 + (of_satellite << 16 | of_signal))
}

/// Degrades a rover's observations, with places and satellites from `navigation`.
pub fn degrade(
    epochs: &[ObservationEpoch],
    navigation: &NavigationData,
    scenario: &Scenario,
) -> Result<Degraded, DegradeError> {
    scenario.validate().map_err(DegradeError::Scenario)?;
    let (Some(first), Some(last)) = (epochs.first(), epochs.last()) else { return Err(DegradeError::NoEpoch) };
    let sky = Sky::new(navigation, [first.time, last.time]);
    let places = sky.places(epochs).ok_or(DegradeError::NoPosition)?;
    Ok(degrade_at(epochs, &places, &sky, scenario))
}

/// Degrades observations made at known places.
fn degrade_at(epochs: &[ObservationEpoch], places: &[Place], sky: &Sky, scenario: &Scenario) -> Degraded {
    let mut degraded = Degraded { epochs: Vec::new(), events: Vec::new(), unknown: BTreeSet::new() };
    let start = epochs.first().map(|epoch| epoch.time).unwrap_or_default();
    let length = epochs.last().map_or(0.0, |epoch| epoch.time.since(start));
    let stretches = stretches(scenario, length);
    let mut bodies: BTreeMap<SatelliteId, Body> = BTreeMap::new();
    let mut channels: BTreeMap<(SatelliteId, Signal), Channel> = BTreeMap::new();
    let mut within = None;
    for (epoch, place) in epochs.iter().zip(places) {
        let seconds = epoch.time.since(start);
        let stretch = stretches.iter().find(|stretch| (stretch.begin..stretch.end).contains(&seconds));
        if stretch.map(|stretch| stretch.begin) != within {
            let (what, size) = stretch.map_or((What::OpenSky, 0.0), |stretch| (What::Canyon, stretch.severity));
            degraded.events.push(Event { time: epoch.time, satellite: None, signal: None, what, size, flagged: None });
            within = stretch.map(|stretch| stretch.begin);
        }
        let mut output = ObservationEpoch { observations: Vec::new(), ..*epoch };
        for observations in by_satellite(&epoch.observations).values() {
            let Some(satellite) = observations.first().map(|observation| observation.satellite) else { continue };
            let Some(look) = sky.look(satellite, epoch.time, &place.position) else {
                degraded.unknown.insert(satellite);
                output.observations.extend(observations.iter().copied().copied());
                continue;
            };
            let body = bodies
                .entry(satellite)
                .or_insert_with(|| Body::new(satellite, stream(scenario.seed, number(satellite, None))));
            let canyons = &scenario.canyons;
            let street = if canyons.follow_heading { place.heading } else { canyons.street_deg.to_radians() };
            let roof = stretch.map(|stretch| (stretch, stretch.mask(seconds, look.azimuth, street)));
            // Signals without a wavelength stay as they are, and so does a satellite with no other.
            let wavelength = |observation: &Observation| {
                observation.signal.wavelength(satellite.constellation(), sky.glonass_channel(satellite))
            };
            if !observations.iter().any(|observation| wavelength(observation).is_some()) {
                degraded.unknown.insert(satellite);
                output.observations.extend(observations.iter().copied().copied());
                continue;
            }
            let view = body.view(epoch.time, look.elevation, roof, scenario, &mut degraded.events);
            for observation in observations {
                let signal = observation.signal;
                let Some(wavelength) = wavelength(observation) else {
                    degraded.unknown.insert(satellite);
                    output.observations.push(**observation);
                    continue;
                };
                let channel = channels.entry((satellite, signal)).or_insert_with(|| {
                    Channel::new(stream(scenario.seed, number(satellite, Some(signal))), wavelength)
                });
                let left = channel.degrade(epoch.time, observation, &view, scenario, &mut degraded.events);
                output.observations.extend(left);
            }
        }
        degraded.epochs.push(output);
    }
    degraded
}

/// Observations of an epoch, by satellite.
fn by_satellite(observations: &[Observation]) -> BTreeMap<SatelliteId, Vec<&Observation>> {
    let mut sorted: BTreeMap<SatelliteId, Vec<&Observation>> = BTreeMap::new();
    for observation in observations {
        sorted.entry(observation.satellite).or_default().push(observation);
    }
    sorted
}

#[cfg(test)]
mod tests;
