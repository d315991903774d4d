//! Precise point positioning of a day at 30 s, five systems: `cargo bench -p surefix --bench ppp`.
//!
//! | row | what |
//! |---|---|
//! | filter | the engine alone over a quarter, a half and all of the day: the files are read before |
//! | smoothing | one iteration of EM: forward, backward and the noise, of the same parts |
//!
//! Twice the epochs should take twice the time.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::path::{Path, PathBuf};
use surefix::process::ppp::files::{FileList, Opened};
use surefix::process::ppp::record::Recorder;
use surefix::process::ppp::run::Engine;
use surefix::process::ppp::settings::Settings;
use surefix::read::rinex::ObservationEpoch;
use surefix::smooth::ppp::noise::Measurements;
use surefix::smooth::ppp::smooth;
use surefix_core::gnss::solution::Quality;

/// A station's day, below the directory that lies beside the checkout.
const DAY: &str = "../../shared/data/ppp_esbc_2020177";
const FILES: [&str; 3] = [
    "ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
    "COD0MGXFIN_20201770000_01D_05M_ORB.SP3.gz",
    "ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
];

fn run(
    opened: &Opened,
    epochs: &[ObservationEpoch],
    settings: &Settings,
    mut recorder: Option<&mut Recorder>,
) -> usize {
    let mut engine = Box::new(Engine::new(settings.engine));
    engine.set_antenna(opened.antenna);
    let mut solved = 0;
    for epoch in epochs {
        let solution = engine.push(epoch.view(), &opened.products);
        if solution.solution.quality != Quality::None {
            solved += 1;
            if let Some(recorder) = &mut recorder {
                recorder.push(&engine, &solution);
            }
        }
    }
    solved
}

fn ppp(criterion: &mut Criterion) {
    let day = Path::new(env!("CARGO_MANIFEST_DIR")).join(DAY);
    if !day.exists() {
        println!("skipped: {} is absent", day.display());
        return;
    }
    let antennas = day.join("../common/igs14.atx.gz");
    let files: Vec<PathBuf> = FILES.iter().map(|name| day.join(name)).chain([antennas]).collect();
    let mut opened = Opened::new(&FileList::sort(&files).unwrap()).unwrap();
    let mut epochs = Vec::new();
    while let Some(epoch) = opened.observations[0].next_epoch().unwrap() {
        epochs.push(epoch);
    }
    let mut settings = Settings::default();
    settings.smoothing.correlated = false;
    let mut options = settings.options(Some(Measurements::StudentT(5.0)));
    (options.learning.iterations, options.learning.accelerated) = (1, 0);
    let parts = [4, 2, 1].map(|part| &epochs[..epochs.len() / part]);

    let mut group = criterion.benchmark_group("ppp filter");
    group.sample_size(10);
    for part in parts {
        group.throughput(Throughput::Elements(part.len() as u64));
        group.bench_with_input(BenchmarkId::from_parameter(part.len()), part, |bencher, part| {
            bencher.iter(|| assert!(run(&opened, part, &settings, None) > part.len() - 40));
        });
    }
    group.finish();

    let mut group = criterion.benchmark_group("ppp smoothing, one iteration of EM");
    group.sample_size(10);
    for part in parts {
        let mut recorder = Recorder::default();
        run(&opened, part, &settings, Some(&mut recorder));
        let tape = recorder.finish();
        group.throughput(Throughput::Elements(part.len() as u64));
        group.bench_with_input(BenchmarkId::from_parameter(part.len()), &tape, |bencher, tape| {
            bencher.iter(|| assert_eq!(smooth(tape, &options, None).unwrap().states.len(), tape.epochs.len()));
        });
    }
    group.finish();
}

criterion_group!(benches, ppp);
criterion_main!(benches);
