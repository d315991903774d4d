//! How a satellite is seen: directly, by a reflection, or not at all.

use super::canyon::Stretch;
use super::events::{Event, What};
use super::scenario::{Nlos, Scenario};
use crate::simulate::errors::GaussMarkov;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::time::GpsTime;

/// How a satellite is seen.
#[derive(Clone, Debug, PartialEq)]
pub enum View {
    /// Under open sky.
    Open,
    /// Between buildings, directly.
    Between {
        /// Rms of the reflected field that comes with the direct one, relative to it.
        amplitude: f64,
        /// Its excess path `[m]`.
        delay: f64,
    },
    /// By reflection only.
    Reflected(Reflector),
    /// Not at all.
    Hidden,
}

/// The one reflection that is seen of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflector {
    /// Excess path at this epoch `[m]`.
    pub excess: f64,
    /// Its mean rate since the epoch before `[m/s]`.
    pub rate: f64,
    /// Loss of C/N0 `[dB]`.
    pub cn0_drop: f64,
    /// Whether its phase is tracked.
    pub phase: bool,
}

/// A satellite: its own random numbers, and whether it is behind a building.
pub struct Body {
    satellite: SatelliteId,
    rng: ChaCha8Rng,
    /// Variation of the excess path.
    variation: GaussMarkov,
    behind: Option<Behind>,
}

/// A satellite behind a building.
#[derive(Clone, Copy)]
struct Behind {
    /// The reflection that is seen of it, if one is, with its mean excess path `[m]`.
    reflector: Option<(Reflector, f64)>,
    /// Latest epoch.
    last: GpsTime,
}

impl Body {
    /// A satellite not seen yet.
    pub fn new(satellite: SatelliteId, rng: ChaCha8Rng) -> Self {
        Self { satellite, rng, variation: GaussMarkov::default(), behind: None }
    }

    /// How the satellite at an elevation `[rad]` is seen; a stretch comes with the elevation of the roof in that direction
    /// `[rad]`. Changes are added to `events`.
    pub fn view(
        &mut self,
        time: GpsTime,
        elevation: f64,
        roof: Option<(&Stretch, f64)>,
        scenario: &Scenario,
        events: &mut Vec<Event>,
    ) -> View {
        let satellite = Some(self.satellite);
        let mut tell = |what, size| events.push(Event { time, satellite, signal: None, what, size, flagged: None });
        let [variation, _] = self.variation.next(time, scenario.nlos.excess_time_s, &mut self.rng);
        let variation = scenario.nlos.excess_sigma_m * variation;
        let height = roof.map_or(0.0, |(_, height)| height);
        if elevation >= height || roof.is_none() {
            if self.behind.take().is_some() {
                tell(What::Direct, height.to_degrees());
            }
            return match roof {
                None => View::Open,
                Some((stretch, _)) => View::Between {
                    amplitude: scenario.reflections.amplitude * stretch.severity * elevation.cos(),
                    delay: stretch.delay,
                },
            };
        }
        let before = self.behind;
        let rng = &mut self.rng;
        let mut behind = before.unwrap_or_else(|| Behind { reflector: reflector(&scenario.nlos, rng), last: time });
        if let Some((reflector, mean)) = &mut behind.reflector {
            let excess = (*mean + variation).max(0.0);
            let step = time.since(behind.last);
            reflector.rate = if step > 0.0 { (excess - reflector.excess) / step } else { 0.0 };
            reflector.excess = excess;
        }
        behind.last = time;
        self.behind = Some(behind);
        let view = behind.reflector.map_or(View::Hidden, |(reflector, _)| View::Reflected(reflector));
        if before.is_none() {
            match &view {
                View::Reflected(reflector) => tell(What::Reflected, reflector.excess),
                _ => tell(What::Hidden, height.to_degrees()),
            }
        }
        view
    }
}

/// Draws whether there is a reflection, and which.
fn reflector(nlos: &Nlos, rng: &mut ChaCha8Rng) -> Option<(Reflector, f64)> {
    let mut draw = |[least, greatest]: [f64; 2]| rng.random_range(least..=greatest);
    let seen = draw([0.0, 1.0]) < nlos.probability;
    let (mean, cn0_drop) = (draw(nlos.excess_m), draw(nlos.cn0_drop_db));
    let phase = draw([0.0, 1.0]) < nlos.phase;
    seen.then_some((Reflector { excess: mean, rate: 0.0, cn0_drop, phase }, mean))
}
