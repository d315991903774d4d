//! Whole runs of the smoother with adaptive ambiguity priors, of the paper's size and of smaller ones, one core:
//! `cargo bench -p surefix --bench rtsap`. The time of an epoch should not depend on their number.
//!
//! Double differences of ten satellites in three bands: 71 states with ambiguities, 44 without. Relaxed forward and backward
//! pass, bootstrapped integers at each epoch, fixed forward and backward pass.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use surefix::smooth::integers::{IntegerOptions, Search, Source};
use surefix::smooth::pass::{PassOptions, Passes};
use surefix::smooth::rtsap::{RtsapOptions, rtsap};
use surefix::study::smoothing::scenario::{Record, Scenario};
use surefix::study::smoothing::trial::{Configuration, Estimation, Scheme};

fn runs(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("rtsap");
    group.sample_size(10);
    for last in [250, 500, 1000] {
        let scenario = Scenario { last, ..Scenario::default() };
        let record = Record::simulate(&scenario, &mut ChaCha8Rng::seed_from_u64(1));
        let configuration = Configuration { scenario, estimation: Estimation::recommended() };
        let mut model = configuration.model(&record, Scheme::Erts).expect("the scenario makes a model");
        let integers = IntegerOptions::paper(Source::Smoother, Search::Bootstrapping);
        let options = RtsapOptions { integers, ..RtsapOptions::default() };
        group.throughput(Throughput::Elements(last as u64 + 1));
        group.bench_function(BenchmarkId::from_parameter(last), |bencher| {
            let mut passes = Passes::new(PassOptions::default());
            bencher.iter(|| rtsap(&mut model, &mut passes, &options, |_, _| ()).expect("the model can be smoothed"));
        });
    }
    group.finish();
}

criterion_group!(benches, runs);
criterion_main!(benches);
