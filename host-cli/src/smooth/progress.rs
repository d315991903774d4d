//! How far a long computation is, and whether it is to go on.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Watches passes over epochs, from any number of threads. The work is counted in epochs of a pass.
#[derive(Debug)]
pub struct Progress {
    start: Instant,
    expected: AtomicU64,
    done: AtomicU64,
    cancelled: AtomicBool,
    reached: Mutex<Option<Reached>>,
}

/// Where EM is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// Iteration; 0 is the start.
    pub iteration: usize,
    /// ℓ = −2 ln p(y | θ), without its constant.
    pub likelihood: f64,
}

impl Default for Progress {
    fn default() -> Self {
        let (expected, done) = (AtomicU64::new(0), AtomicU64::new(0));
        let (cancelled, reached) = (AtomicBool::new(false), Mutex::new(None));
        Self { start: Instant::now(), expected, done, cancelled, reached }
    }
}

impl Progress {
    /// That so many epochs of passes more are expected.
    pub fn expect(&self, epochs: usize) {
        self.expected.fetch_add(epochs as u64, Ordering::Relaxed);
    }

    /// That so many of those expected are not needed after all.
    pub fn spare(&self, epochs: usize) {
        let less = |expected: u64| Some(expected.saturating_sub(epochs as u64));
        let _ = self.expected.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }

    /// One epoch of a pass is done; whether to go on.
    pub(super) fn step(&self) -> bool {
        self.done.fetch_add(1, Ordering::Relaxed);
        !self.is_cancelled()
    }

    /// That EM has the likelihood of an iteration.
    pub(super) fn reach(&self, iteration: usize, likelihood: f64) {
        *self.reached.lock().unwrap_or_else(PoisonError::into_inner) = Some(Reached { iteration, likelihood });
    }

    /// The last iteration of EM of which the likelihood is known.
    pub fn reached(&self) -> Option<Reached> {
        *self.reached.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Epochs done and expected; never more done than expected.
    pub fn count(&self) -> (u64, u64) {
        let done = self.done.load(Ordering::Relaxed);
        (done, self.expected.load(Ordering::Relaxed).max(done))
    }

    /// Time left at the speed so far; `None` before the first epoch.
    pub fn time_left(&self) -> Option<Duration> {
        let (done, expected) = self.count();
        (done > 0).then(|| self.start.elapsed().mul_f64((expected - done) as f64 / done as f64))
    }

    /// Asks all that run to stop at their next epoch.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether they were asked to.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_never_pass_what_is_expected_and_cancellation_shows() {
        let progress = Progress::default();
        assert_eq!((progress.count(), progress.time_left(), progress.reached()), ((0, 0), None, None));
        progress.expect(4);
        progress.spare(2);
        assert!((0..3).all(|_| progress.step()));
        assert_eq!((progress.count(), progress.time_left()), ((3, 3), Some(Duration::ZERO)));
        progress.reach(3, -8.5);
        assert_eq!(progress.reached(), Some(Reached { iteration: 3, likelihood: -8.5 }));
        progress.cancel();
        assert!(!progress.step() && progress.is_cancelled());
    }
}
