//! `surefix post` on the car drive of the real data, files and all: `cargo bench -p surefix --bench post`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::path::Path;
use surefix::cli::files::Files;
use surefix::cli::post::process;
use surefix::process::settings::Settings;

/// The drive, below the directory that lies beside the checkout.
const DRIVE: &str = "../../shared/data/kinematic_ucr_car_2020194";
/// Epochs of its rover.
const EPOCHS: u64 = 1417;

fn post(criterion: &mut Criterion) {
    let drive = Path::new(env!("CARGO_MANIFEST_DIR")).join(DRIVE);
    if !drive.exists() {
        println!("skipped: {} is absent", drive.display());
        return;
    }
    let files = Files {
        rover: drive.join("rover.obs.gz"),
        base: drive.join("base.obs.gz"),
        navigation: vec![drive.join("rover.nav.gz")],
        base_xyz: Some(vec![-2_430_697.699, -4_704_189.201, 3_544_329.103]),
        base_antenna: None,
        moving_base: false,
    };
    let settings = Settings { bands: "G1 E1 C2".into(), ..Settings::default() };
    let output = tempfile::tempdir().unwrap();
    let mut group = criterion.benchmark_group("post");
    group.sample_size(10).throughput(Throughput::Elements(EPOCHS));
    group.bench_function("car drive", |bencher| {
        bencher.iter(|| {
            let (summary, _) = process(&files, &settings, false, output.path()).unwrap();
            assert_eq!(summary.epochs, EPOCHS);
        });
    });
    group.finish();
}

criterion_group!(benches, post);
criterion_main!(benches);
