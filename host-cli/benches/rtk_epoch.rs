//! One epoch of the filter, base and rover together: `cargo bench -p surefix --bench rtk_epoch`.
//!
//! As configured by default, with noise that follows the data, and with all that integrity has besides: subsets by
//! elevation that help the rest, and the monitor of faults.
//!
//! A simulated rover at rest, one band, 12 and 30 satellites. Fewer than 30 are above the horizon, so that some have a
//! twin: another number, the same orbit and the same observations. To the filter these are as much work as any.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::{Duration, Instant};
use surefix::process::run::Engine;
use surefix::process::settings::Settings;
use surefix::process::stream::{Input, OwnedEpoch};
use surefix::simulate::scenario::{MotionKind, Scenario};
use surefix::simulate::{Simulation, simulate};
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::log::Header;
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::config::Partial;

/// Epochs before those that are timed: the ambiguities are fixed by then.
const WARM_UP: usize = 20;
/// What a twin's number is higher by.
const TWIN: u8 = 32;

/// What the filter is told: once, and at each epoch.
struct Inputs {
    opening: Vec<Input>,
    epochs: Vec<[Input; 2]>,
}

impl Inputs {
    fn new(satellites: usize) -> Self {
        let mut scenario = Scenario { duration_s: 120.0, elevation_mask_deg: 12.0, ..Scenario::default() };
        scenario.satellites.gps = vec!["1C".into()];
        scenario.satellites.galileo = vec!["1C".into()];
        scenario.rover.motion.kind = MotionKind::Static;
        for receiver in [&mut scenario.rover.receiver, &mut scenario.base.receiver] {
            receiver.interval_s = 1.0;
            receiver.slips.per_hour = 0.0;
            receiver.outages.clear();
        }
        let Simulation { base_position, ephemerides, base, rover, .. } = simulate(&scenario).unwrap();
        // Those that are in sight throughout, then their twins.
        let visible = |epoch: &OwnedEpoch, id| epoch.observations.iter().any(|observation| observation.satellite == id);
        let throughout = |id: &SatelliteId| rover.iter().chain(&base).all(|epoch| visible(epoch, *id));
        let originals: Vec<_> = rover[0].observations.iter().map(|o| o.satellite).filter(throughout).collect();
        let twins = originals.iter().map(|&id| (id, twin(id)));
        let sky: Vec<_> = originals.iter().map(|&id| (id, id)).chain(twins).take(satellites).collect();
        assert_eq!(sky.len(), satellites, "too few satellites are in sight");

        let epoch = |epoch: &OwnedEpoch| OwnedEpoch {
            time: epoch.time,
            observations: sky
                .iter()
                .flat_map(|&(from, satellite)| {
                    let of = epoch.observations.iter().filter(move |observation| observation.satellite == from);
                    of.map(move |observation| surefix_core::gnss::epoch::Observation { satellite, ..*observation })
                })
                .collect(),
        };
        let header = Input::Header(Header { base_position: Some(base_position.into()), ..Header::default() });
        let renamed = ephemerides.iter().flat_map(|ephemeris| {
            let names = sky.iter().filter(|(from, _)| *from == ephemeris.satellite());
            names.map(|&(_, satellite)| match *ephemeris {
                Ephemeris::Kepler(mut kepler) => {
                    kepler.satellite = satellite;
                    Input::Ephemeris(Ephemeris::Kepler(kepler))
                }
                glonass => Input::Ephemeris(glonass),
            })
        });
        Self {
            opening: std::iter::once(header).chain(renamed).collect(),
            epochs: base.iter().zip(&rover).map(|(b, r)| [Input::Base(epoch(b)), Input::Rover(epoch(r))]).collect(),
        }
    }

    /// Time for `count` epochs in a filter that has converged; a new one whenever the epochs come to their end.
    fn time(&self, config: &RtkConfig, count: u64) -> Duration {
        let mut elapsed = Duration::ZERO;
        let mut left = count;
        while left > 0 {
            let mut engine = Engine::new(*config);
            let (warm_up, timed) = self.epochs.split_at(WARM_UP);
            for input in self.opening.iter().chain(warm_up.iter().flatten()) {
                engine.feed(input);
            }
            for epoch in timed.iter().take(left as usize) {
                let start = Instant::now();
                for input in epoch {
                    black_box(engine.feed(black_box(input)));
                }
                elapsed += start.elapsed();
                left -= 1;
            }
        }
        elapsed
    }
}

fn twin(id: SatelliteId) -> SatelliteId {
    SatelliteId::new(id.constellation(), id.number() + TWIN).unwrap_or(id)
}

/// What is compared.
fn configurations() -> [(&'static str, RtkConfig); 3] {
    let mut plain = Settings { bands: "L1".into(), ..Settings::default() }.config().unwrap();
    plain.adaptation.enabled = false;
    plain.integrity.fault.enabled = false;
    let mut adaptive = plain;
    adaptive.adaptation.enabled = true;
    // From the first epoch on, so that it is timed.
    adaptive.adaptation.warm_up = 0;
    let mut all = adaptive;
    all.acceptance.partial = Partial::Elevation;
    all.acceptance.assist = true;
    all.integrity.fault.enabled = true;
    [("plain", plain), ("adaptive", adaptive), ("adaptive, subsets, faults", all)]
}

fn rtk_epoch(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("rtk_epoch");
    for satellites in [12, 30] {
        let inputs = Inputs::new(satellites);
        for (name, config) in configurations() {
            group.bench_function(format!("{satellites} satellites, {name}"), |bencher| {
                bencher.iter_custom(|count| inputs.time(&config, count));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, rtk_epoch);
criterion_main!(benches);
