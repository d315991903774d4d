//! The engine over all epochs, and smoothing of what it recorded.

use super::files::{FileList, FilesError, Opened};
use super::products::HostProducts;
use super::record::Recorder;
use super::settings::Settings;
use crate::read::ReadError;
use crate::smooth::ppp::noise::Measurements;
use crate::smooth::ppp::{self as smoother, Smoothed};
use crate::smooth::progress::Progress;
use nalgebra::Vector3;
use surefix_core::gnss::epoch::EpochView;
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::solution::Quality;
use surefix_core::gnss::time::GpsTime;
use surefix_core::ppp::config::Motion;
use surefix_core::ppp::link::Kind;
use surefix_core::ppp::track::ArcEnd;
use surefix_core::ppp::{Estimate, PppFilter, PppSolution};
use thiserror::Error;

/// The engine of the host: 64 satellites, both bands of each if need be.
pub type Engine = PppFilter<64, 207>;

/// One measurement as the engine used it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Index of its epoch in [`Run::solutions`].
    pub epoch: u32,
    /// Whose.
    pub satellite: SatelliteId,
    /// Code or phase.
    pub kind: Kind,
    /// 0 for the combination or the first band, 1 for the second.
    pub slot: u8,
    /// Number of the arc.
    pub arc: u32,
    /// Azimuth `[rad]`.
    pub azimuth: f32,
    /// Elevation `[rad]`.
    pub elevation: f32,
    /// Observed minus computed with the updated states `[m]`.
    pub postfit: f32,
    /// Standard deviation of its noise `[m]`.
    pub sigma: f32,
    /// Whether it was left out.
    pub rejected: bool,
    /// Ambiguity, about the offset of its arc, and its standard deviation `[m]`; 0 for codes.
    pub ambiguity: [f32; 2],
}

/// What the engine made of a file.
#[derive(Debug, Default)]
pub struct Run {
    /// One for each epoch.
    pub solutions: Vec<PppSolution>,
    /// The measurements.
    pub residuals: Vec<Residual>,
    /// Why arcs ended, and how often.
    pub arc_ends: std::collections::BTreeMap<&'static str, u64>,
    /// The record for the smoother, if it was wanted.
    pub recorder: Option<Recorder>,
}

/// What to do with the files of a run.
#[derive(Clone, Debug, Default)]
pub struct Job {
    /// Settings of engine and smoother.
    pub settings: Settings,
    /// Whether to smooth; EM does anyway.
    pub smooth: bool,
    /// How EM learns the variances of measurements; without EM none.
    pub em: Option<Measurements>,
    /// Where to start, ECEF `[m]`, instead of at a single point.
    pub start: Option<Vector3<f64>>,
    /// Epochs that are used, first and last; all if none.
    pub span: Option<[GpsTime; 2]>,
}

/// Why there is no answer.
#[derive(Debug, Error)]
pub enum JobError {
    /// The files.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// Reading on.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Smoothing.
    #[error(transparent)]
    Smooth(#[from] smoother::PppError),
    /// No epoch.
    #[error("{0}: there is no epoch with observations in the span; was the file written to the end?")]
    NoEpochs(String),
}

/// An answer, and what it was made of.
pub struct Done {
    /// By epoch and measurement; smoothed, if that was wanted.
    pub run: Run,
    /// What smoothing found out.
    pub smoothed: Option<Smoothed>,
    /// The files: what was missing and what was dropped.
    pub opened: Opened,
}

impl Job {
    /// Does it: the engine over all epochs, of which `each` is told the number, then the smoother.
    pub fn run(
        &self,
        list: &FileList,
        mut each: impl FnMut(usize),
        progress: Option<&Progress>,
    ) -> Result<Done, JobError> {
        let mut opened = Opened::new(list)?;
        opened.check_bands(&self.settings.engine.bands);
        let mut engine = Box::new(Engine::new(self.settings.engine));
        engine.set_antenna(opened.antenna);
        engine.set_approximate(self.start);
        for (&slot, &channel) in &opened.channels {
            if let Some(satellite) = SatelliteId::new(Constellation::Glonass, slot) {
                engine.set_channel(satellite, channel);
            }
        }
        let smooth = self.smooth || self.em.is_some();
        let mut run = Run { recorder: smooth.then(Recorder::default), ..Run::default() };
        let Opened { observations, products, .. } = &mut opened;
        for observations in observations {
            while let Some(epoch) = observations.next_epoch()? {
                if self.span.is_none_or(|[from, until]| (from..=until).contains(&epoch.time)) {
                    run.push(&mut engine, epoch.view(), products);
                    each(run.solutions.len());
                }
            }
        }
        let times = || run.solutions.iter().map(|solution| solution.solution.time);
        let Some((first, last)) = times().min().zip(times().max()) else {
            let file = opened.observations.first().map_or(String::new(), |reader| reader.report().file.clone());
            return Err(JobError::NoEpochs(file));
        };
        opened.check_time([first, last])?;
        let smoothed = run.smooth(&self.settings, self.em, progress)?;
        Ok(Done { run, smoothed, opened })
    }
}

impl Run {
    /// Takes an epoch.
    fn push(&mut self, engine: &mut Engine, epoch: EpochView<'_>, products: &HostProducts) {
        let solution = engine.push(epoch, products);
        for ended in engine.ended() {
            *self.arc_ends.entry(name(ended.end)).or_default() += 1;
        }
        if solution.solution.quality != Quality::None {
            residuals(engine, self.solutions.len(), &mut self.residuals);
            if let Some(recorder) = &mut self.recorder {
                recorder.push(engine, &solution);
            }
        }
        self.solutions.push(solution);
    }
}

fn name(end: ArcEnd) -> &'static str {
    match end {
        ArcEnd::Gap => "gap",
        ArcEnd::LossOfLock => "loss of lock",
        ArcEnd::Signal => "other signal",
        ArcEnd::GeometryFree => "geometry-free jump",
        ArcEnd::MelbourneWubbena => "wide-lane jump",
        ArcEnd::Innovations => "innovations",
    }
}

fn residuals(engine: &Engine, epoch: usize, residuals: &mut Vec<Residual>) {
    use surefix_core::ppp::link::Link;
    use surefix_core::ppp::states::Label;
    for link in engine.links() {
        for kind in Kind::ALL {
            for slot in 0..Link::slots(engine.config().ionosphere) {
                let reading = link.readings(kind)[slot];
                let state = engine.states().marginal(Label::Ambiguity(link.satellite, slot as u8));
                let ambiguity = state.filter(|_| kind == Kind::Phase).unwrap_or_default();
                residuals.push(Residual {
                    epoch: epoch as u32,
                    satellite: link.satellite,
                    kind,
                    slot: slot as u8,
                    arc: link.arc,
                    azimuth: link.sight.look.azimuth as f32,
                    elevation: link.sight.look.elevation as f32,
                    postfit: reading.postfit as f32,
                    sigma: reading.variance.sqrt() as f32,
                    rejected: reading.rejected,
                    ambiguity: [ambiguity.0 as f32, ambiguity.1.sqrt() as f32],
                });
            }
        }
    }
}

impl Run {
    /// Smooths what was recorded, and puts the answers in the place of the engine's.
    fn smooth(
        &mut self,
        settings: &Settings,
        em: Option<Measurements>,
        progress: Option<&Progress>,
    ) -> Result<Option<Smoothed>, smoother::PppError> {
        let Some(recorder) = self.recorder.take() else { return Ok(None) };
        let tape = recorder.finish();
        if tape.epochs.is_empty() {
            return Ok(None);
        }
        let biases: Vec<(usize, usize)> =
            tape.groups.iter().filter_map(|group| Some((group.constellation.index(), group.isb?))).collect();
        let smoothed = smoother::smooth(&tape, &settings.options(em), progress)?;
        // As in the engine: a position at rest is the mean of errors that last, and longer than the residuals show.
        let scale = match settings.engine.motion {
            Motion::Static => (settings.engine.noise.lasting(tape.interval().unwrap_or(f64::INFINITY))
                / smoothed.report.correlation[1])
                .max(1.0),
            Motion::Kinematic => 1.0,
        };
        let mut states = smoothed.states.iter().peekable();
        for solution in &mut self.solutions {
            let Some(state) = states.next_if(|state| state.time == solution.solution.time) else { continue };
            let estimate = |estimate: smoother::answer::Estimate| Estimate {
                value: estimate.value,
                sigma: (scale * estimate.variance.max(0.0)).sqrt(),
            };
            solution.solution.position = state.position;
            solution.solution.position_covariance = scale * state.covariance;
            if let Some((velocity, covariance)) = state.velocity {
                (solution.solution.velocity, solution.solution.velocity_covariance) = (velocity, covariance);
            }
            solution.clock = Some(estimate(state.clock));
            for &(constellation, bias) in &biases {
                solution.inter_system[constellation] = state.biases.get(bias).copied().map(estimate);
            }
            let modelled = solution.zenith_wet.map_or(0.0, |wet| wet.value) - solution.zenith_estimated;
            let zenith = estimate(state.zenith);
            solution.zenith_wet = Some(Estimate { value: modelled + zenith.value, sigma: zenith.sigma });
            solution.zenith_estimated = zenith.value;
            if let Some(gradients) = state.gradients {
                solution.gradients = gradients.map(|gradient| Some(estimate(gradient)));
            }
        }
        Ok(Some(smoothed))
    }
}

/// What a user should know of a run: satellites left out, antennas not known, attitudes guessed, clocks that jumped.
pub fn remarks(run: &Run) -> Vec<String> {
    let mut remarks = Vec::new();
    let union = |of: &dyn Fn(&PppSolution) -> surefix_core::gnss::satellite::SatelliteSet| {
        let mut counts = std::collections::BTreeMap::<SatelliteId, usize>::new();
        for solution in &run.solutions {
            of(solution).iter().for_each(|satellite| *counts.entry(satellite).or_default() += 1);
        }
        let names: Vec<String> = counts.iter().map(|(satellite, count)| format!("{satellite} ({count})")).collect();
        (!names.is_empty()).then(|| names.join(" "))
    };
    if let Some(names) = union(&|solution| solution.without_products) {
        remarks.push(format!("left out for want of an orbit or clock (epochs): {names}"));
    }
    if let Some(names) = union(&|solution| solution.without_antenna) {
        remarks.push(format!("satellite antenna not known, its offset left out (epochs): {names}"));
    }
    if let Some(names) = union(&|solution| solution.attitude_guessed) {
        remarks.push(format!("in eclipse or a noon turn, attitude a guess (epochs): {names}"));
    }
    if !run.arc_ends.is_empty() {
        let ends: Vec<String> = run.arc_ends.iter().map(|(end, count)| format!("{end} ({count})")).collect();
        remarks.push(format!("ambiguities began anew after: {}", ends.join(", ")));
    }
    let jumps = run.solutions.iter().filter(|solution| solution.clock_jump != 0.0).count();
    if jumps > 0 {
        remarks.push(format!(
            "receiver clock jumped by whole milliseconds in codes alone in {jumps} epochs; phases were moved after it"
        ));
    }
    let overflow: usize = run.solutions.iter().map(|solution| usize::from(solution.overflow)).sum();
    if overflow > 0 {
        remarks.push(format!("{overflow} times a satellite found no room in the engine"));
    }
    remarks
}
