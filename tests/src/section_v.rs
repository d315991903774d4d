//! Simulated runs of Section V of Greiff et al. (CCTA 2021) as device logs.

use surefix::study::mixed_integer::constellation::Constellation;
use surefix::study::mixed_integer::device_log::record;
use surefix::study::mixed_integer::scenario::Truth;
use surefix::study::mixed_integer::section::nominal;
use surefix::study::monte_carlo::stream;

/// A run with the paper's parameters and so many epochs: its log, and the truth at each epoch.
pub fn run(number: u64, epochs: usize) -> (Vec<u8>, Vec<Truth>) {
    let mut configuration = nominal();
    configuration.scenario.epochs = epochs;
    record(&configuration, &Constellation::new(), stream(1, number)).expect("a vector takes everything")
}
