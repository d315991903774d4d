//! `--smooth` of the commands that run the engine: records what it used, and smooths it at the end.

use super::results::Results;
use crate::process::run::Engine;
use crate::process::settings::Settings;
use crate::process::smoothing::Smoothing;
use crate::smooth::progress::Progress;
use crate::smooth::rtk::tape::Tape;
use crate::smooth::rtk::{Options, smooth};
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use surefix_core::gnss::solution::Solution;

/// How often the progress bar moves.
const TICK: Duration = Duration::from_millis(200);

/// Whether to smooth, and how.
#[derive(clap::Args, Debug, Default)]
pub struct SmoothArgs {
    /// Smooth: estimate every epoch from all epochs, those after it too, and fix integers on that. What smoothing found
    /// out is printed and stands in the summary. More settings are in the table [smoothing] of the settings file
    #[arg(long)]
    pub smooth: bool,
    /// Learn the noise of motion and measurements from the data (expectation maximisation)
    #[arg(long, requires = "smooth")]
    pub em: bool,
}

impl SmoothArgs {
    /// Adds what these arguments say to the settings.
    pub fn apply(&self, settings: &mut Settings) {
        settings.smoothing.em |= self.em;
    }
}

/// A run of the engine that is to be smoothed.
pub struct Recording {
    tape: Tape,
    options: Options,
    left_out: u64,
}

impl Recording {
    /// For an engine that has answered nothing yet.
    pub fn new(engine: &Engine, settings: &Settings) -> anyhow::Result<Self> {
        anyhow::ensure!(
            !settings.moving_base,
            "--smooth needs a base at rest: vectors from a moving base are not smoothed; leave out --smooth, or moving_base"
        );
        Ok(Self { tape: Tape::new(*engine.config()), options: settings.smoothing.options()?, left_out: 0 })
    }

    /// Takes note of an epoch that the engine has just answered.
    pub fn push(&mut self, engine: &Engine, solution: &Solution) {
        self.left_out += u64::from(!self.tape.record(engine, solution));
    }

    /// Smooths and writes the solutions.
    pub fn smooth_into(self, results: &mut Results) -> anyhow::Result<()> {
        let Self { tape, options, left_out } = self;
        let smoothed = with_progress(|progress| smooth(&tape, &options, Some(progress)))?;
        smoothed.solutions.iter().try_for_each(|solution| results.push(solution))?;
        results.summary.smoothing(Smoothing::new(smoothed.report, tape.solutions(), &smoothed.solutions));
        results.summary.dropped("epochs not later than the one before, not smoothed", left_out);
        Ok(())
    }
}

/// Runs a computation beside a progress bar with the time left.
pub(super) fn with_progress<T>(compute: impl FnOnce(&Progress) -> T) -> T {
    let progress = Progress::default();
    std::thread::scope(|scope| {
        let (running, end) = channel::<()>();
        let show = {
            let progress = &progress;
            move || {
                let bar = progress_bar();
                while end.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                    let (done, expected) = progress.count();
                    bar.set_length(expected);
                    bar.set_position(done);
                    let at = progress.reached().map_or(String::new(), |at| {
                        format!("iteration {}, −2 ln p = {:.1}, ", at.iteration, at.likelihood)
                    });
                    if let Some(left) = progress.time_left() {
                        bar.set_message(format!("{at}{} left", HumanDuration(left)));
                    }
                }
                bar.finish_and_clear();
            }
        };
        // Without a thread there is no bar.
        let _shown = std::thread::Builder::new().name("progress".into()).spawn_scoped(scope, show);
        let answer = compute(&progress);
        drop(running);
        answer
    })
}

/// A bar on a terminal, nothing in a pipe.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("smoothing {wide_bar} {percent:>3} % [{elapsed}, {msg}]") {
        bar.set_style(style);
    }
    bar
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::rtk::RtkConfig;

    #[test]
    fn vectors_from_a_moving_base_are_not_smoothed() {
        let engine = Engine::new(RtkConfig::default());
        assert!(Recording::new(&engine, &Settings::default()).is_ok());
        let settings = Settings { moving_base: true, ..Settings::default() };
        let error = Recording::new(&engine, &settings).err().unwrap().to_string();
        assert!(error.contains("leave out --smooth, or moving_base"), "{error}");
    }
}
