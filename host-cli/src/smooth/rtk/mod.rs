//! Smoothing of what the RTK engine recorded: true Rauch–Tung–Striebel smoothing of motion, ambiguities and coloured
//! noise, integers fixed on the smoothing posterior, noise learned by EM (Greiff et al. 2023).
//!
//! * [`tape`]: what the engine used, epoch by epoch.
//! * [`report`]: what smoothing found out.

pub mod report;
pub mod tape;

use report::Report;
use surefix_core::gnss::solution::Solution;

/// How to smooth.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Whether noise is learned from the data (EM).
    pub em: bool,
    /// Memory for filtered densities, in bytes.
    pub budget: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { em: false, budget: 512 << 20 }
    }
}

/// A smoothed run.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// One for each epoch of the tape.
    pub solutions: Vec<Solution>,
    /// What was found out.
    pub report: Report,
}
