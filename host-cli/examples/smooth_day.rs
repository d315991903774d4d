//! How long a smoother takes for a day of epochs, and how much memory: `cargo run --release -p surefix --example
//! smooth_day [EPOCHS]`.
//!
//! The satellites and the single differences of Greiff et al. (2023), three bands, 91 states with ambiguities and 64
//! without, at 1 Hz; relaxed and fixed pass, integers at every epoch.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
use surefix::smooth::integers::{IntegerOptions, Search, Source};
use surefix::smooth::pass::{PassOptions, Passes};
use surefix::smooth::rtsap::{Posterior, RtsapOptions, rtsap};
use surefix::study::smoothing::scenario::{Differences, Record, Scenario};
use surefix::study::smoothing::trial::{Configuration, Estimation, Scheme};

fn main() -> anyhow::Result<()> {
    let epochs: usize = std::env::args().nth(1).map_or(Ok(86_400), |count| count.parse())?;
    let mut scenario = Scenario { differences: Differences::Single, last: epochs - 1, ..Scenario::default() };
    scenario.motion.interval = 1.0;
    let record = Record::simulate(&scenario, &mut ChaCha8Rng::seed_from_u64(1));
    let configuration = Configuration { scenario, estimation: Estimation::recommended() };
    let mut model = configuration.model(&record, Scheme::Erts)?;
    let truth: Vec<_> = record.truth.iter().map(|truth| truth.position).collect();
    drop(record);
    println!("{epochs} epochs simulated; peak memory so far {} MB", peak_megabytes());

    let start = Instant::now();
    let mut passes = Passes::new(PassOptions::default());
    let integers = IntegerOptions::paper(Source::Smoother, Search::LeastSquares);
    let options = RtsapOptions { integers, ..RtsapOptions::default() };
    let mut squares = 0.0;
    rtsap(&mut model, &mut passes, &options, |posterior, epoch| {
        if posterior == Posterior::Fixed {
            squares += (0..3).map(|i| (epoch.smoothed.mean[i] - truth[epoch.k][i]).powi(2)).sum::<f64>();
        }
    })?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "smoothed in {seconds:.1} s, {:.3} ms an epoch; densities kept in {:?}; error {:.4} m; peak memory {} MB",
        1e3 * seconds / epochs as f64,
        passes.storage(),
        (squares / epochs as f64).sqrt(),
        peak_megabytes()
    );
    Ok(())
}

/// The most memory this process ever held, from Linux; 0 elsewhere.
fn peak_megabytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) / 1024
}
