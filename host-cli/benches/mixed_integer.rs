//! One epoch of the mixed-integer filter with 13 satellites, both densities, against the same in dense matrices:
//! `cargo bench -p surefix --bench mixed_integer`.

#[allow(dead_code)] // its test reads the truth as well
mod section_v;

use criterion::{Criterion, criterion_group, criterion_main};
use section_v::Run;
use section_v::dense::{DenseFilter, Matrices};
use std::hint::black_box;
use surefix_core::filter::mixed_integer::{Options, SectionV};
use surefix_core::filter::update::Form;
use surefix_core::model::partially_linear::PartiallyLinear;
use surefix_core::real::Real;

/// Epochs that are gone through again and again.
const EPOCHS: usize = 50;

fn structured<T: Real>(run: &Run, form: Form) -> Box<SectionV<T>> {
    let mut filter = Box::new(SectionV::new(Options { form, ..Options::default() }));
    filter.reset_independent(run.model().shape().real, &run.mean, &run.variances).unwrap();
    filter
}

fn mixed_integer(criterion: &mut Criterion) {
    let run = Run::new(13, EPOCHS, 0.005, 1);
    let model = run.model();
    let mut group = criterion.benchmark_group("mixed_integer");
    group.bench_function("dense Joseph", |bencher| {
        let matrices = Matrices::new(&model);
        let mut filter = DenseFilter::new(Options::default(), &run.mean, &run.variances, model.shape().real);
        let mut epochs = run.epochs.iter().cycle();
        bencher.iter(|| filter.step(&model, &matrices, black_box(&epochs.next().unwrap().y)));
    });
    for (name, form) in [("sequential", Form::Sequential), ("joseph", Form::Joseph), ("array", Form::Array)] {
        group.bench_function(name, |bencher| {
            let mut filter = structured::<f64>(&run, form);
            let mut epochs = run.epochs.iter().cycle();
            bencher.iter(|| filter.step(&model, black_box(&epochs.next().unwrap().y)).unwrap());
        });
    }
    group.bench_function("sequential in f32", |bencher| {
        let mut filter = structured::<f32>(&run, Form::Sequential);
        let mut epochs = run.epochs.iter().cycle();
        bencher.iter(|| filter.step(&model, black_box(&epochs.next().unwrap().y)).unwrap());
    });
    group.finish();
}

criterion_group!(benches, mixed_integer);
criterion_main!(benches);
