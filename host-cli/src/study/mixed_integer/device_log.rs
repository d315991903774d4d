//! A run as a device log: its measurements for `surefix replay` and for firmware.
//!
//! The log starts with model, prior and options of the filter, [`section_v::Setup`]; its times count from the start of
//! GPS time.

use super::constellation::Constellation;
use super::scenario::{REAL, Simulation, Truth};
use super::trial::Configuration;
use crate::log::LogWriter;
use rand_chacha::ChaCha8Rng;
use std::io;
use surefix_core::filter::section_v::{self, Setup};
use surefix_core::gnss::time::GpsTime;

/// Simulates a run. Returns its log and the truth at each epoch.
pub fn record(
    configuration: &Configuration,
    constellation: &Constellation,
    random: ChaCha8Rng,
) -> io::Result<(Vec<u8>, Vec<Truth>)> {
    let Configuration { scenario, options } = *configuration;
    let mut simulation = Simulation::new(scenario, constellation, random);
    let (mean, variances) = (&simulation.prior().mean, &simulation.prior().variances);
    let prior = section_v::Prior {
        position: [mean[0], mean[1], mean[2]],
        sigma_position: variances[0].sqrt(),
        sigma_velocity: variances[3].sqrt(),
        sigma_bias: variances[6].sqrt(),
        sigma_ambiguity: variances[REAL].sqrt(),
    };
    let mut log = LogWriter::new(Vec::new());
    log.config(section_v::CONFIG_SCHEMA, &Setup { parameters: scenario.parameters, prior, options })?;
    let mut truths = Vec::with_capacity(scenario.epochs);
    while let Some((epoch, truth)) = simulation.next_epoch() {
        let time = GpsTime::from_nanoseconds(0).plus_seconds(epoch.time);
        log.measurements(time, &epoch.satellites, &epoch.measurements)?;
        truths.push(truth.clone());
    }
    Ok((log.finish()?, truths))
}

#[cfg(test)]
mod tests {
    use super::super::section::nominal;
    use super::super::trial::trial;
    use super::*;
    use crate::log::LogReader;
    use crate::log::section_v::replay;
    use crate::study::monte_carlo::stream;

    /// The engine that reads the log is the filter of the study.
    #[test]
    fn a_replay_gives_the_densities_of_the_trial() {
        let constellation = Constellation::new();
        let mut configuration = nominal();
        configuration.scenario.epochs = 25;
        let mut errors = Vec::new();
        trial(&configuration, &constellation, stream(1, 3), |snapshot| {
            errors.push((snapshot.relaxed.error, snapshot.constrained.error, snapshot.flags));
        })
        .unwrap();
        let (log, truths) = record(&configuration, &constellation, stream(1, 3)).unwrap();
        let mut replayed = Vec::new();
        replay::<f64, _>(&mut LogReader::new("log", &log[..]).unwrap(), |answer| {
            let truth = truths[replayed.len()].position;
            let estimate = answer.estimate();
            let flags: Vec<bool> = answer.ambiguities().map(|ambiguity| ambiguity.slipped).collect();
            let error = |mean: [f64; 3]| nalgebra::Vector3::from(mean) - truth;
            replayed.push((error(estimate.relaxed.mean), error(estimate.constrained.mean), flags.try_into().unwrap()));
            Ok(())
        })
        .unwrap();
        assert_eq!(replayed, errors);
    }
}
