//! Steps of the smoother on matrices of the size of Greiff et al. (2023), and what of the processor they use:
//! `cargo bench -p surefix --bench smooth`.
//!
//! The peak is that of a loop that multiplies and adds in registers alone, without fused operations, as the steps do.

use criterion::{Criterion, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::hint::black_box;
use std::time::Instant;
use surefix::smooth::integers::{Fixer, IntegerOptions, Search, Source};
use surefix::smooth::model::Model;
use surefix::smooth::multi_band::{MultiBand, Record, Settings};
use surefix::smooth::pass::{PassOptions, Passes};
use surefix::smooth::vector::vectorised;
use surefix::study::smoothing::geometry::Geometry;
use surefix_core::filter::update::Rows;
use surefix_core::filter::update::information::{self, Information};
use surefix_core::linalg::MatMut;
use surefix_core::model::multi_band::{BANDS, Bands, Signal};
use surefix_core::model::partially_linear::Nonlinear;
use surefix_core::smooth::step::{Block, SparseMap, Step};
use surefix_core::smooth::{Moments, MomentsMut, tiled};

/// States of the double-difference model of ten satellites, relaxed and fixed.
const SIZES: [usize; 2] = [71, 44];
/// Groups of rows, and differences to the first of ten satellites in each.
const GROUPS: usize = 7;
const DIFFERENCES: usize = 9;

/// Rows by their coefficients.
struct SparseRows(Vec<Vec<(usize, f64)>>);

impl Rows<f64> for SparseRows {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        self.0[row].iter().for_each(|&(state, coefficient)| entry(state, coefficient));
    }
}

/// A model of the size and the sparsity of the real one: half of the states are pairs of value and rate.
struct Problem {
    n: usize,
    ends: Vec<usize>,
    entries: Vec<(usize, f64)>,
    offset: Vec<f64>,
    noise: Vec<Block<f64>>,
    /// Groups of differences, then single states.
    rows: SparseRows,
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

impl Problem {
    fn new(n: usize) -> Self {
        let rates = 20;
        let (mut ends, mut entries, mut noise) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..n {
            entries.push((i, 1.0));
            if i < rates {
                entries.push((n - rates + i, 5.0));
            }
            ends.push(entries.len());
            let shape = [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
            noise.push(Block { states: [i, 0, 0], dim: 1, shape, scale: 0.1, component: None });
        }
        let coefficient = |i: usize, j: usize| ((i * 7 + j * 13) % 17) as f64 / 17.0 - 0.4;
        let mut rows = Vec::new();
        for row in 0..GROUPS * DIFFERENCES {
            let (group, satellite) = (row / DIFFERENCES, row % DIFFERENCES);
            let z = (0..4).map(|j| (n - 1 - j, coefficient(satellite, j)));
            let others = [satellite, 9, 10 + satellite, 19, (20 + group * 3 + satellite) % (n - 4)];
            rows.push(z.chain(others.map(|state| (state, 1.0))).collect());
        }
        rows.extend((0..20).map(|state| vec![(state, 1.0)]));
        let covariance =
            (0..n * n).map(|k| if k % (n + 1) == 0 { 2.0 } else { 0.5 / (1.0 + (k / n).abs_diff(k % n) as f64) });
        Self {
            n,
            ends,
            entries,
            offset: vec![0.0; n],
            noise,
            rows: SparseRows(rows),
            mean: vec![1.0; n],
            covariance: covariance.collect(),
        }
    }

    fn step(&self) -> Step<'_, f64> {
        let map = SparseMap { ends: &self.ends, entries: &self.entries, columns: self.n };
        Step { map, offset: &self.offset, noise: &self.noise }
    }

    fn moments(&self) -> Moments<'_, f64> {
        Moments::packed(&self.mean, &self.covariance).expect("square")
    }
}

/// Multiply-adds of a backward step and of an update, n³ times these; what is linear or quadratic in n is not counted.
const BACKWARD: f64 = 2.0;
const UPDATE: f64 = 4.0 / 3.0;

/// Multiplications and additions a second of a loop in registers, the fastest of some runs. Eight rows fill vectors of
/// eight numbers, which are as many as hide the time that an operation takes; with four numbers these are too many.
fn peak() -> f64 {
    peak_of_rows::<4>().max(peak_of_rows::<8>())
}

fn peak_of_rows<const ROWS: usize>() -> f64 {
    let (runs, factor) = (20_000u32, black_box(0.999_999f64));
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        let mut out = [[0.0; 8]; ROWS];
        vectorised(
            #[inline(always)]
            || {
                let mut sums = [[1e-3f64; 8]; ROWS];
                for _ in 0..runs {
                    for row in &mut sums {
                        for x in row {
                            *x = *x * factor + factor;
                        }
                    }
                }
                out = sums;
                black_box(&mut out);
            },
        );
        best = best.min(start.elapsed().as_secs_f64());
    }
    16.0 * ROWS as f64 * f64::from(runs) / best
}

fn smooth(criterion: &mut Criterion) {
    let peak = peak();
    println!("peak without fused operations: {:.1} Gflop/s", peak / 1e9);
    for n in SIZES {
        let problem = Problem::new(n);
        let step = problem.step();
        let (mut mean, mut p) = (vec![0.0; n], vec![0.0; n * n]);
        let mut buffer = vec![0.0; tiled::buffer_len(n, n).max(information::buffer_len(n))];
        let (mut smoothed_mean, mut smoothed_p) = (vec![0.0; n], vec![0.0; n * n]);
        let predict = || {
            let mut predicted = MomentsMut::packed(&mut mean, &mut p).expect("square");
            vectorised(
                #[inline(always)]
                || tiled::predict(&step, problem.moments(), &mut predicted, &mut buffer),
            )
            .expect("shapes fit");
        };
        let time = measure(criterion, &format!("predict {n}"), predict);
        println!("predict {n}: {time:.1} µs");

        let prior = problem.covariance.clone();
        let update = || {
            p.copy_from_slice(&prior);
            let (buffer, mean, p) = (&mut buffer, &mut mean, &mut p);
            vectorised(
                #[inline(always)]
                || {
                    let mut information = Information::new(buffer, n)?;
                    for group in 0..GROUPS {
                        let rows = group * DIFFERENCES..(group + 1) * DIFFERENCES;
                        information.differences(&problem.rows, rows, |_| 0.1, 0.01)?;
                    }
                    let first = GROUPS * DIFFERENCES;
                    information.independent(&problem.rows, first..first + 20, |_| 0.0, |_| 1.0)?;
                    information.update(mean, &mut MatMut::square(p, n)?)
                },
            )
            .expect("well conditioned");
        };
        let time = measure(criterion, &format!("update {n}"), update);
        report("update", n, time, UPDATE, peak);

        let next = problem.covariance.iter().map(|x| 0.5 * x).collect::<Vec<_>>();
        let (mut predicted_mean, mut predicted_p) = (vec![0.0; n], vec![0.0; n * n]);
        let backward = || {
            let mut predicted = MomentsMut::packed(&mut predicted_mean, &mut predicted_p).expect("square");
            let mut smoothed = MomentsMut::packed(&mut smoothed_mean, &mut smoothed_p).expect("square");
            let next = Moments::packed(&problem.mean, &next).expect("square");
            let mut work = tiled::Work::new(&mut buffer, n, n).expect("long enough");
            vectorised(
                #[inline(always)]
                || tiled::smooth(&step, problem.moments(), &mut predicted, next, &mut smoothed, &mut work),
            )
            .expect("positive definite");
        };
        let time = measure(criterion, &format!("backward {n}"), backward);
        report("backward", n, time, BACKWARD, peak);
    }
}

fn report(what: &str, n: usize, time: f64, multiply_adds: f64, peak: f64) {
    let flops = 2.0 * multiply_adds * (n as f64).powi(3);
    let rate = flops / time * 1e6;
    println!(
        "{what} {n}: {time:.1} µs, {:.2} Mflop, {:.1} Gflop/s, {:.0} % of the peak",
        flops / 1e6,
        rate / 1e9,
        100.0 * rate / peak
    );
}

/// Lets criterion measure, and returns the fastest of some runs `[µs]`.
fn measure(criterion: &mut Criterion, name: &str, mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        run();
        best = best.min(1e6 * start.elapsed().as_secs_f64());
    }
    criterion.bench_function(name, |bencher| bencher.iter(&mut run));
    best
}

/// Epochs of a run.
const EPOCHS: usize = 1000;

/// Recorded epochs of the DD-IF model and geometry G2, receiver at rest, all integers zero.
fn recorded() -> MultiBand {
    let geometry = Geometry::g2();
    let bands = Bands::new([1575.42e6, 1227.6e6, 1176e6]).expect("frequencies of the paper");
    let settings = Settings::recommended(bands, Some(geometry.base));
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut noise = |variance: f64| variance.sqrt() * random.sample::<f64, _>(StandardNormal);
    let record = |k: usize| {
        let satellites = geometry.satellites(settings.motion.interval * (k as f64 - EPOCHS as f64 / 2.0));
        let model = settings.model(&satellites);
        let mut values = vec![0.0; model.outputs()];
        model.evaluate(&[0.0; 4], &mut values);
        let m = satellites.len() - 1;
        let mut record = Record { satellites: satellites.clone(), ..Record::default() };
        for (signal, list) in Signal::ALL.into_iter().zip(&mut record.signals) {
            for _ in 0..BANDS {
                let noises: Vec<f64> = satellites.iter().map(|_| noise(model.signal_variance(signal))).collect();
                let exact = |i: usize| model.nonlinear_value(signal, i, &values);
                list.extend((0..m).map(|i| exact(i) + noises[0] - noises[i + 1]));
            }
        }
        let biases = (0..model.virtual_rows()).filter_map(|row| model.virtual_row(row));
        record.virtual_rows = biases.map(|(_, variance)| noise(variance)).collect();
        record
    };
    let records = (0..EPOCHS).map(record).collect();
    MultiBand::new(settings, records).expect("records fit")
}

/// Algorithm 1 of the paper: relaxed pass, integers on the smoothing posterior, fixed pass.
fn rtsap(_: &mut Criterion) {
    let mut model = recorded();
    let mut best = [f64::INFINITY; 6];
    for _ in 0..5 {
        model.release();
        let mut passes = Passes::new(PassOptions::default());
        let start = Instant::now();
        let mut marks = [0.0; 5];
        let mut mark = |i: usize| marks[i] = start.elapsed().as_secs_f64();
        passes.forward_detecting(&mut model).expect("well conditioned");
        mark(0);
        let mut fixer = Fixer::new(IntegerOptions::paper(Source::Smoother, Search::LeastSquares));
        passes.backward(&model, |_| {}).expect("well conditioned");
        mark(1);
        passes.backward(&model, |epoch| fixer.visit(&model, epoch)).expect("well conditioned");
        fixer.apply(&mut model);
        mark(2);
        passes.forward(&model).expect("well conditioned");
        mark(3);
        passes.backward(&model, |_| {}).expect("well conditioned");
        mark(4);
        let [forward, backward, again, fixed_forward, fixed_backward] = marks;
        let fixing = (again - backward) - (backward - forward);
        let parts = [forward, backward - forward, fixing, fixed_forward - again, fixed_backward - fixed_forward];
        let whole = parts.iter().sum();
        for (best, part) in best.iter_mut().zip(parts.into_iter().chain([whole])) {
            *best = best.min(part);
        }
    }
    let names = ["relaxed filter", "relaxed smoother", "integers", "fixed filter", "fixed smoother", "all"];
    for (name, seconds) in names.iter().zip(best) {
        println!("{name}: {:.1} µs an epoch", 1e6 * seconds / EPOCHS as f64);
    }
}

criterion_group!(benches, smooth, rtsap);
criterion_main!(benches);
