//! Independent trials on all cores.
//!
//! Trial i draws from stream i of one seed, and results are collected in order: the same seed gives the same numbers
//! whatever the number of threads. Whoever sums the results does so in that order, after they are collected.

use indicatif::{ProgressBar, ProgressStyle};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// The stream of random numbers of one trial.
pub fn stream(seed: u64, trial: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(trial);
    random
}

/// The results of `trial(0)`, …, `trial(count − 1)`, in this order, by the threads of the pool it is called from.
pub fn run<R: Send>(count: usize, progress: &ProgressBar, trial: impl Fn(usize) -> R + Sync) -> Vec<R> {
    progress.set_length(count as u64);
    progress.reset();
    let counted = |i| {
        let result = trial(i);
        progress.inc(1);
        result
    };
    (0..count).into_par_iter().map(counted).collect()
}

/// A progress bar on a terminal, nothing in a pipe.
pub fn progress_bar(what: &'static str) -> ProgressBar {
    let progress = ProgressBar::new(0).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} [{elapsed}, {eta} left]") {
        progress.set_style(style);
    }
    progress
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let draw = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(50, &ProgressBar::hidden(), |i| stream(7, i as u64).random::<u64>()))
        };
        let one = draw(1);
        assert_eq!(one, draw(2));
        assert_eq!(one, draw(5));
    }

    #[test]
    fn trials_draw_different_numbers() {
        let mut drawn: Vec<u64> = (0..100).map(|i| stream(7, i).random()).collect();
        drawn.push(stream(8, 0).random());
        drawn.sort_unstable();
        drawn.dedup();
        assert_eq!(drawn.len(), 101);
    }
}
