//! The filter of Section V of Greiff et al. (CCTA 2021) driven by a device log: measurements in, estimates out.
//!
//! One door for firmware and host, so that both do the same with every record and their answers are equal byte for byte.
//! A log for this engine is a [`Setup`] as a config record of [`CONFIG_SCHEMA`], and a record of measurements for each
//! epoch ([`crate::log::write_measurements`]); it answers each of these by an estimate ([`crate::log::write_estimate`]).
//! The model is [`VirtualBiasModel`]; the first epoch after a setup or a reset sets the number of satellites.
//!
//! ```no_run
//! use surefix_core::filter::section_v::SectionVEngine;
//! use surefix_core::log::{MAX_FRAME, RecordReader};
//!
//! # fn send(_: &[u8]) {}
//! static LOG: &[u8] = &[]; // bytes from a file or a serial line
//! let mut engine = SectionVEngine::<f64>::new(); // 76 KB: in firmware a `static`
//! let mut reader: RecordReader = RecordReader::new();
//! let mut frame = [0; MAX_FRAME];
//! for &byte in LOG {
//!     let Some(Ok(record)) = reader.push(byte) else { continue };
//!     if let Some(answer) = engine.feed(&record) {
//!         let length = answer.write(&mut frame).unwrap_or(0);
//!         send(&frame[..length]);
//!     }
//! }
//! ```
//!
//! Stack: below 1.5 KB beyond that of [`super::mixed_integer`]. Panic contract: none.

use super::linearize::LinearizeError;
use super::mixed_integer::{FilterError, Options, Outcome, SectionV};
use super::update::UpdateError;
use crate::gnss::time::GpsTime;
use crate::integer::Method;
use crate::linalg::Mat;
use crate::log::{
    AmbiguityEstimate, CRC, Estimate, Event, Measurements, PositionDensity, Record, Refusal, WriteError, write_estimate,
};
use crate::model::virtual_bias::{VirtualBiasModel, VirtualBiasParameters};
use crate::real::Real;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Schema number of a [`Setup`] in a device log. Those of the RTK filter count from 1, those of this engine from 0x0101; a
/// change of the layout takes the next.
pub const CONFIG_SCHEMA: u16 = 0x0101;

/// Most satellites.
pub const SATELLITES: usize = 13;
/// Most rows, 5 N − 2.
const ROWS: usize = 5 * SATELLITES - 2;
/// Most states, 4 N + 5.
const STATES: usize = 4 * SATELLITES + 5;

/// Mean and standard deviations of the states before the first epoch, independent of each other. Means are zero but for
/// the position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// The rover relative to the base `[m]`.
    pub position: [f64; 3],
    /// Its standard deviation on each axis `[m]`.
    pub sigma_position: f64,
    /// Standard deviation of the velocity on each axis `[m/s]`.
    pub sigma_velocity: f64,
    /// Standard deviation of each bias `[m]`.
    pub sigma_bias: f64,
    /// Standard deviation of each ambiguity `[cycles]`.
    pub sigma_ambiguity: f64,
}

/// All that the engine has to know before the first epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// The numbers of the model.
    pub parameters: VirtualBiasParameters,
    /// The density before the first epoch.
    pub prior: Prior,
    /// Options of the filter.
    pub options: Options,
}

/// The filter with what it was told. T is the scalar of its covariances.
#[derive(Debug)]
pub struct SectionVEngine<T> {
    filter: SectionV<T>,
    setup: Option<Setup>,
    /// Whether the filter has a density.
    started: bool,
    satellites: heapless::Vec<Vector3<f64>, SATELLITES>,
    values: heapless::Vec<f64, ROWS>,
}

impl<T: Real> SectionVEngine<T> {
    /// An engine that was told nothing.
    pub const fn new() -> Self {
        Self {
            filter: SectionV::new(Options::DEFAULT),
            setup: None,
            started: false,
            satellites: heapless::Vec::new(),
            values: heapless::Vec::new(),
        }
    }

    /// Takes one record of a log. Measurements are answered.
    pub fn feed(&mut self, record: &Record<'_>) -> Option<Answer<'_, T>> {
        match record {
            Record::Config(config) if config.schema == CONFIG_SCHEMA => {
                self.setup = config.value();
                self.started = false;
            }
            Record::Event(Event::Reset) => self.started = false,
            Record::Measurements(measurements) => {
                let outcome = self.step(measurements);
                return Some(Answer { time: measurements.time, outcome, filter: &self.filter });
            }
            _ => (),
        }
        None
    }

    /// The filter as the last epoch left it.
    pub fn filter(&self) -> &SectionV<T> {
        &self.filter
    }

    fn step(&mut self, measurements: &Measurements<'_>) -> Result<Outcome<T>, Refusal> {
        let setup = self.setup.ok_or(Refusal::NotStarted)?;
        if measurements.satellites().len() > SATELLITES || measurements.values().len() > ROWS {
            return Err(Refusal::Capacity);
        }
        self.satellites.clear();
        self.satellites.extend(measurements.satellites());
        self.values.clear();
        self.values.extend(measurements.values());
        if !self.started {
            start(&mut self.filter, &setup, self.satellites.len())?;
            self.started = true;
        }
        let model = VirtualBiasModel { satellites: &self.satellites, parameters: setup.parameters };
        Ok(self.filter.step(&model, &self.values)?)
    }
}

impl<T: Real> Default for SectionVEngine<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Gives the filter its options and the density before the first epoch.
#[inline(never)] // its two vectors of states must not lie on the stack while the filter works
fn start<T: Real>(filter: &mut SectionV<T>, setup: &Setup, satellites: usize) -> Result<(), Refusal> {
    let Setup { prior, options, .. } = setup;
    let real = 6 + 3 * satellites;
    let states = real + satellites.saturating_sub(1);
    let (mut mean, mut variances) = ([0.0; STATES], [0.0; STATES]);
    mean.iter_mut().zip(prior.position).for_each(|(mean, position)| *mean = position);
    for (state, variance) in variances.iter_mut().enumerate() {
        let sigma = match state {
            0..3 => prior.sigma_position,
            3..6 => prior.sigma_velocity,
            bias if bias < real => prior.sigma_bias,
            _ => prior.sigma_ambiguity,
        };
        *variance = sigma * sigma;
    }
    let mean = mean.get(..states).ok_or(Refusal::Capacity)?;
    let variances = variances.get(..states).ok_or(Refusal::Capacity)?;
    *filter.options_mut() = *options;
    Ok(filter.reset_independent(real, mean, variances)?)
}

/// The answer to an epoch.
#[derive(Clone, Copy, Debug)]
pub struct Answer<'a, T> {
    /// Time of the epoch.
    pub time: GpsTime,
    /// What the epoch brought, or why it was refused.
    pub outcome: Result<Outcome<T>, Refusal>,
    /// The filter after it.
    pub filter: &'a SectionV<T>,
}

impl<'a, T: Real> Answer<'a, T> {
    /// The answer as a record.
    pub fn estimate(&self) -> Estimate {
        let outcome = self.outcome.ok();
        let integers = outcome.and_then(|outcome| outcome.integers);
        let number = |value: Option<T>| value.map_or(0.0, T::to_f64);
        Estimate {
            time: self.time,
            refusal: self.outcome.err(),
            relaxed: position(self.filter.mean(), self.filter.covariance()),
            constrained: position(self.filter.constrained_mean(), self.filter.constrained_covariance()),
            relaxed_nis: number(outcome.map(|o| o.relaxed.normalized_innovation_squared)),
            constrained_nis: number(outcome.map(|o| o.constrained.normalized_innovation_squared)),
            best_norm: number(integers.map(|i| i.best_norm)),
            second_norm: number(integers.map(|i| i.second_norm)),
            success_rate: integers.map_or(0.0, |i| i.success_rate),
            nodes: integers.map_or(0, |i| i.nodes),
            bootstrapped: integers.is_some_and(|i| i.method == Method::Bootstrapped),
            gated: outcome.is_some_and(|o| o.gated),
            common_jump: outcome.and_then(|o| o.common_jump),
            checksum: self.checksum(),
        }
    }

    /// The ambiguities, in the order of the satellites after the reference.
    pub fn ambiguities(&self) -> impl Iterator<Item = AmbiguityEstimate> + Clone + use<'a, T> {
        let filter = self.filter;
        let slips = filter.slip_estimates().iter().zip(filter.slips());
        filter.integers().iter().zip(slips).enumerate().map(move |(i, (&integer, (&slip_estimate, &slipped)))| {
            let state = filter.real() + i;
            AmbiguityEstimate {
                mean: filter.mean().get(state).copied().unwrap_or_default(),
                variance: filter.covariance().get(state, state).map_or(0.0, T::to_f64),
                integer,
                slip_estimate,
                slipped,
            }
        })
    }

    /// Writes the answer as a frame of a device log.
    pub fn write(&self, frame: &mut [u8]) -> Result<usize, WriteError> {
        write_estimate(&self.estimate(), self.ambiguities(), frame)
    }

    /// CRC-32 of both densities, see [`Estimate::checksum`].
    fn checksum(&self) -> u32 {
        let mut digest = CRC.digest();
        let densities = [
            (self.filter.mean(), self.filter.covariance()),
            (self.filter.constrained_mean(), self.filter.constrained_covariance()),
        ];
        for (mean, covariance) in densities {
            mean.iter().for_each(|number| digest.update(&number.to_le_bytes()));
            for i in 0..covariance.rows() {
                covariance.row(i).iter().take(i + 1).for_each(|number| digest.update(&number.to_f64().to_le_bytes()));
            }
        }
        digest.finalize()
    }
}

/// The first three states.
fn position<T: Real>(mean: &[f64], covariance: Mat<'_, T>) -> PositionDensity {
    let entry = |i, j| covariance.get(i, j).map_or(0.0, T::to_f64);
    PositionDensity {
        mean: mean.first_chunk().copied().unwrap_or_default(),
        covariance: [entry(0, 0), entry(1, 0), entry(1, 1), entry(2, 0), entry(2, 1), entry(2, 2)],
    }
}

impl From<FilterError> for Refusal {
    fn from(error: FilterError) -> Self {
        match error {
            FilterError::Shape | FilterError::NoRows => Self::Shape,
            FilterError::Capacity => Self::Capacity,
            FilterError::NotFinite | FilterError::Ambiguity { .. } => Self::NotFinite,
            FilterError::Covariance(_) | FilterError::NotPositiveDefinite { .. } => Self::NotPositiveDefinite,
            FilterError::Undetermined { .. } => Self::Undetermined,
            FilterError::Linearize(error) => error.into(),
            FilterError::Update(error) => error.into(),
            FilterError::Integer(_) => Self::Integers,
        }
    }
}

impl From<LinearizeError> for Refusal {
    fn from(error: LinearizeError) -> Self {
        match error {
            LinearizeError::Shape | LinearizeError::Inputs | LinearizeError::Rule => Self::Shape,
            LinearizeError::NotPositiveDefinite => Self::NotPositiveDefinite,
            LinearizeError::NotFinite => Self::NotFinite,
        }
    }
}

impl From<UpdateError> for Refusal {
    fn from(error: UpdateError) -> Self {
        match error {
            UpdateError::Shape | UpdateError::NoRows | UpdateError::EmptyRow { .. } => Self::Shape,
            UpdateError::NotFinite => Self::NotFinite,
            UpdateError::Covariance(_)
            | UpdateError::NotPositiveDefinite { .. }
            | UpdateError::Noise(_)
            | UpdateError::IndefiniteNoise { .. } => Self::NotPositiveDefinite,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{MAX_FRAME, RecordReader, write_config, write_event, write_measurements};

    const PRIOR: Prior = Prior {
        position: [30.0, -20.0, 10.0],
        sigma_position: 10.0,
        sigma_velocity: 1.0,
        sigma_bias: 1.0,
        sigma_ambiguity: 10.0,
    };

    /// N satellites spread over the sky, and measurements of a rover 1 m off the prior with ambiguities i − 3, without
    /// noise and biases.
    fn epoch(n: usize) -> (Vec<Vector3<f64>>, Vec<f64>) {
        use crate::model::partially_linear::Nonlinear;
        let satellites: Vec<_> = (0..n)
            .map(|i| {
                let (azimuth, elevation) = (2.4 * i as f64, 1.3 - 0.09 * i as f64);
                let horizontal = elevation.cos();
                2.2e7 * Vector3::new(azimuth.sin() * horizontal, azimuth.cos() * horizontal, elevation.sin())
            })
            .collect();
        let parameters = VirtualBiasParameters::default();
        let model = VirtualBiasModel { satellites: &satellites, parameters };
        let mut values = vec![0.0; 5 * n - 2];
        let (differences, _) = values.split_at_mut(2 * n - 2);
        model.evaluate(&[30.0, -19.0, 10.0], differences);
        for (i, phase) in differences.iter_mut().skip(n - 1).enumerate() {
            *phase += parameters.wavelength * (i as f64 - 3.0);
        }
        (satellites, values)
    }

    /// Feeds a frame; the answer's estimate and integers, if there is an answer.
    fn feed<T: Real>(
        engine: &mut SectionVEngine<T>,
        write: impl FnOnce(&mut [u8]) -> Result<usize, WriteError>,
    ) -> Option<(Estimate, Vec<i64>)> {
        let mut frame = [0; MAX_FRAME];
        let length = write(&mut frame).unwrap();
        let mut reader: RecordReader = RecordReader::new();
        let mut answered = None;
        for &byte in &frame[..length] {
            let Some(record) = reader.push(byte) else { continue };
            let Some(answer) = engine.feed(&record.unwrap()) else { continue };
            answered = Some((answer.estimate(), answer.ambiguities().map(|a| a.integer).collect()));
            assert!(answer.write(&mut [0; MAX_FRAME]).is_ok());
        }
        answered
    }

    fn setup<T: Real>(engine: &mut SectionVEngine<T>) {
        let setup = Setup { parameters: VirtualBiasParameters::default(), prior: PRIOR, options: Options::default() };
        assert_eq!(feed(engine, |out| write_config(CONFIG_SCHEMA, &setup, out)), None);
    }

    fn measure<T: Real>(engine: &mut SectionVEngine<T>, n: usize) -> (Estimate, Vec<i64>) {
        let (satellites, values) = epoch(n);
        let time = GpsTime::from_nanoseconds(7);
        feed(engine, |out| write_measurements(time, &satellites, &values, out)).unwrap()
    }

    fn finds_the_position<T: Real>() {
        let mut engine = SectionVEngine::<T>::new();
        setup(&mut engine);
        for n in [13, 9] {
            let (estimate, integers) = measure(&mut engine, n);
            assert_eq!((estimate.refusal, estimate.time.nanoseconds()), (None, 7));
            assert_eq!(integers, (0..n as i64 - 1).map(|i| i - 3).collect::<Vec<_>>());
            assert!((Vector3::from(estimate.constrained.mean) - Vector3::new(30.0, -19.0, 10.0)).norm() < 0.01);
            assert!(estimate.constrained.covariance[0] < estimate.relaxed.covariance[0]);
            assert_eq!(feed(&mut engine, |out| write_event(&Event::Reset, out)), None);
        }
    }

    #[test]
    fn a_position_is_found_in_both_precisions_and_after_a_reset() {
        finds_the_position::<f64>();
        finds_the_position::<f32>();
    }

    #[test]
    fn what_cannot_be_answered_is_refused_and_changes_nothing() {
        let mut engine = SectionVEngine::<f64>::new();
        assert_eq!(measure(&mut engine, 13).0.refusal, Some(Refusal::NotStarted));
        // A setup of another schema, or of the right one with other bytes, is none.
        for schema in [CONFIG_SCHEMA - 1, CONFIG_SCHEMA] {
            assert_eq!(feed(&mut engine, |out| write_config(schema, &(1u8, 2u8), out)), None);
            assert_eq!(measure(&mut engine, 13).0.refusal, Some(Refusal::NotStarted));
        }
        setup(&mut engine);
        assert_eq!(measure(&mut engine, 14).0.refusal, Some(Refusal::Capacity));
        let good = measure(&mut engine, 13).0;
        let other = measure(&mut engine, 12).0;
        assert_eq!((good.refusal, other.refusal), (None, Some(Refusal::Shape)));
        assert_eq!((other.checksum, other.constrained), (good.checksum, good.constrained));
        let (satellites, mut values) = epoch(13);
        values[20] = 1e300;
        let time = GpsTime::from_nanoseconds(8);
        let absurd = feed(&mut engine, |out| write_measurements(time, &satellites, &values, out)).unwrap().0;
        assert!(absurd.refusal.is_some());
        assert_eq!(absurd.checksum, good.checksum);
    }

    #[test]
    fn a_change_of_any_state_changes_the_checksum() {
        let (mut one, mut other) = (SectionVEngine::<f64>::new(), SectionVEngine::<f64>::new());
        setup(&mut one);
        setup(&mut other);
        let (satellites, mut values) = epoch(13);
        let time = GpsTime::from_nanoseconds(7);
        let expected = measure(&mut one, 13).0.checksum;
        values[62] += 1e-12; // a bias, which is not written
        let changed = feed(&mut other, |out| write_measurements(time, &satellites, &values, out)).unwrap().0;
        assert_ne!(changed.checksum, expected);
    }

    /// What the module says: 96 KB at most for all state and workspace.
    #[test]
    fn state_and_workspace_fit() {
        let sizes = [size_of::<SectionVEngine<f64>>(), size_of::<SectionVEngine<f32>>()];
        assert!(sizes[0] <= 78_000 && sizes[1] <= 43_000, "{sizes:?}");
        assert!(sizes[0] + 2 * MAX_FRAME <= 96_000);
    }
}
