//! Integer least squares, reduction and the two best, beside RTKLIB's `lambda()`: `cargo bench -p surefix --bench lambda`.
//!
//! Both get the same 60 problems of each model, and the median over the problems is compared. RTKLIB is measured in the
//! same run where Debian's `librtklib-dev` and a C compiler are installed, by [`lambda_peer.c`](lambda_peer.c); elsewhere
//! medians measured before, on another machine and on problems of the same kind, stand in for it.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use surefix::ambiguity::model::{FREQUENCIES, FloatAmbiguities, Model};
use surefix_core::integer::{Config, Method, Workspace, resolve};
use surefix_core::linalg::Mat;

/// Problems of a model.
const PROBLEMS: u64 = 60;
/// Runs of a problem of which the fastest counts, as in the C program.
const REPEAT: usize = 5;
/// Medians of RTKLIB by number of ambiguities, gcc -O3 `[µs]`.
const QUOTED: [(usize, f64); 4] = [(12, 14.0), (24, 72.0), (40, 235.0), (60, 657.0)];

/// A model with its problems.
struct Set {
    name: &'static str,
    n: usize,
    problems: Vec<FloatAmbiguities>,
}

/// What a program took for the problems of a set.
struct Outcome {
    /// Each problem `[µs]`.
    times: Vec<f64>,
    /// Problems without a proven nearest vector.
    unproven: usize,
}

fn set(name: &'static str, model: &Model) -> Set {
    let problems = (0..PROBLEMS).map(|seed| model.draw(seed).expect("the model is regular")).collect();
    Set { name, n: model.dimension(), problems }
}

/// Two bands, strong and weak.
fn sets() -> Vec<Set> {
    let mut sets = Vec::new();
    for n in [12, 24, 40, 60] {
        let strong = Model { satellites: n / 2 + 1, frequencies: FREQUENCIES[..2].to_vec(), ..Model::default() };
        sets.push(set("short baseline, 1 epoch", &strong));
        let medium = Model { ionosphere: 0.05, epochs: 10, ..strong.clone() };
        sets.push(set("5 cm ionosphere, 10 epochs", &medium));
        if n == 40 {
            sets.push(set("30 cm ionosphere, 1 epoch", &Model { ionosphere: 0.3, ..strong }));
        }
    }
    sets
}

fn median(times: &[f64]) -> f64 {
    let mut times = times.to_vec();
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

fn ours(set: &Set) -> Outcome {
    let mut workspace = Box::new(Workspace::<f64, 64>::new());
    let mut outcome = Outcome { times: Vec::new(), unproven: 0 };
    for problem in &set.problems {
        let q = Mat::square(&problem.covariance, set.n).expect("square");
        let mut best = f64::INFINITY;
        for _ in 0..REPEAT {
            let start = Instant::now();
            black_box(resolve(&problem.float, q, &Config::default(), &mut workspace))
                .expect("there is always an answer");
            best = best.min(1e6 * start.elapsed().as_secs_f64());
        }
        let found = resolve(&problem.float, q, &Config::default(), &mut workspace).expect("there is always an answer");
        outcome.unproven += usize::from(found.method == Method::Bootstrapped);
        outcome.times.push(best);
    }
    outcome
}

/// RTKLIB on the same problems, `None` where it cannot be had.
fn rtklib(sets: &[Set], directory: &Path) -> Option<Vec<Outcome>> {
    let (program, problems) = (directory.join("lambda_peer"), directory.join("problems"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/lambda_peer.c");
    let built = Command::new("cc").arg("-O2").arg(source).arg("-o").arg(&program).arg("-lRTKLib").output();
    if !built.is_ok_and(|output| output.status.success()) {
        return None;
    }
    let mut bytes = Vec::new();
    for (set, problem) in sets.iter().flat_map(|set| set.problems.iter().map(move |problem| (set, problem))) {
        bytes.extend((set.n as i64).to_ne_bytes());
        bytes.extend(problem.float.iter().chain(&problem.covariance).flat_map(|x| x.to_ne_bytes()));
    }
    fs::write(&problems, bytes).ok()?;
    let output = Command::new(&program).arg(&problems).output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut lines = text.lines().map(|line| {
        let (time, failed) = line.split_once(' ')?;
        Some((time.parse::<f64>().ok()?, failed != "0"))
    });
    sets.iter()
        .map(|set| {
            let results: Vec<(f64, bool)> = lines.by_ref().take(set.problems.len()).collect::<Option<_>>()?;
            let unproven = results.iter().filter(|(_, failed)| *failed).count();
            Some(Outcome { times: results.into_iter().map(|(time, _)| time).collect(), unproven })
        })
        .collect()
}

fn compare(sets: &[Set]) {
    let directory = tempfile::tempdir().expect("a directory for the C program");
    let peer = rtklib(sets, directory.path());
    if peer.is_none() {
        println!("RTKLIB is not at hand (apt-get install librtklib-dev gcc); its medians are quoted");
    }
    println!(
        "{:>3}  {:27}{:>10}{:>11}{:>7}  without proof (of {PROBLEMS}): RTKLIB, surefix",
        "n", "model", "RTKLIB µs", "surefix µs", "ratio"
    );
    for (i, set) in sets.iter().enumerate() {
        let here = ours(set);
        let (time, gave_up) = match &peer {
            Some(outcomes) => (median(&outcomes[i].times), outcomes[i].unproven.to_string()),
            None => {
                let quoted = QUOTED.iter().find(|(n, _)| *n == set.n);
                (quoted.map_or(f64::NAN, |(_, time)| *time), "?".to_owned())
            }
        };
        let own = median(&here.times);
        println!(
            "{:3}  {:27}{time:10.1}{own:11.1}{:7.2}  {gave_up} no answer, {} bootstrapped",
            set.n,
            set.name,
            own / time,
            here.unproven
        );
    }
}

fn lambda(criterion: &mut Criterion) {
    let sets = sets();
    compare(&sets);
    let mut group = criterion.benchmark_group("lambda");
    for set in sets.iter() {
        let mut workspace = Box::new(Workspace::<f64, 64>::new());
        let mut problems = set.problems.iter().cycle();
        group.bench_function(BenchmarkId::new(set.name, set.n), |bencher| {
            bencher.iter(|| {
                let problem = problems.next().expect("there are problems");
                let q = Mat::square(&problem.covariance, set.n).expect("square");
                resolve(black_box(&problem.float), q, &Config::default(), &mut workspace).map(|found| found.nodes)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, lambda);
criterion_main!(benches);
