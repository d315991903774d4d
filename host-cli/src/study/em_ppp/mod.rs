//! `study em-ppp`: X. Zhang et al., *Automatic Calibration of Process Noise Matrix and Measurement Noise Covariance for
//! Multi-GNSS Precise Point Positioning* (Remote Sensing 12, 2020), on simulated, linearised PPP: schemes of learning the
//! noise, from the paper's one variance for each measurement to pools with Student-t weights.
//!
//! | module | holds |
//! |---|---|
//! | [`scenario`] | satellites, motion, noise with outliers |
//! | [`variant`] | the schemes |
//! | [`trial`] | one scheme on one run, looked at after 0, 5, 10 and 50 iterations |
//! | [`outcome`] | means over runs; the recommended scheme as it is used, with its scan |
//! | [`start`] | six starts of three schemes: how far their ends lie apart |
//! | [`speed`] | plain and accelerated EM: evaluations until ℓ is near its best |
//! | [`acceptance`] | the numbers that must be met |
//! | [`report`], [`files`] | tables, CSV and drawings |
//!
//! Run i of every scheme sees the same measurements. Axes are north, east, up.

pub mod acceptance;
pub mod files;
pub mod outcome;
pub mod report;
pub mod scenario;
pub mod speed;
pub mod start;
pub mod trial;
pub mod variant;

use super::monte_carlo;
use indicatif::ProgressBar;
use outcome::Recommended;
use scenario::{Motion, Scene};
use speed::Speed;
use start::Starts;
use trial::Trial;
use variant::{Variant, variants};

/// Parts of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// All schemes on a receiver at rest
    Static,
    /// All schemes on a receiver that stops and goes
    Kinematic,
    /// Six starts of three schemes
    Starts,
    /// Plain and accelerated EM
    Speed,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Runs of each scheme.
    pub seeds: usize,
    /// Most iterations of EM.
    pub iterations: usize,
    /// Epochs of a run; by the kind of motion if not given.
    pub epochs: Option<usize>,
    /// Seed of everything random.
    pub seed: u64,
    /// Parts.
    pub parts: Vec<Part>,
}

impl Settings {
    /// A run, and the same with other noise.
    pub fn scenes(&self, motion: Motion, run: usize) -> [Scene; 2] {
        let (epochs, run) = (self.epochs.unwrap_or(motion.epochs()), 3 * run as u64);
        [1, 2].map(|noise| {
            let (mut world, mut noise) =
                (monte_carlo::stream(self.seed, run), monte_carlo::stream(self.seed, run + noise));
            scenario::draw(motion, epochs, &mut world, &mut noise)
        })
    }
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Study {
    /// What was done.
    pub settings: Settings,
    /// All schemes, by kind of motion.
    pub tables: Vec<Table>,
    /// Ends of several starts.
    pub starts: Vec<Starts>,
    /// Evaluations.
    pub speed: Vec<Speed>,
}

/// All schemes on one kind of motion.
#[derive(Clone, Debug)]
pub struct Table {
    /// Which.
    pub motion: Motion,
    /// Schemes and their runs.
    pub rows: Vec<(Variant, Vec<Trial>)>,
    /// The recommended scheme as it is used, by run.
    pub recommended: Vec<Recommended>,
    /// ℓ for each measurement under the variances it was drawn with, by run.
    pub truth: Vec<f64>,
    /// Accelerations of the first run `[m/s²]`.
    pub accelerations: Vec<f64>,
}

impl Table {
    fn run(motion: Motion, settings: &Settings, progress: &ProgressBar) -> Self {
        let variants = variants(motion);
        let (seeds, own) = (settings.seeds, variants.len());
        let done = monte_carlo::run((own + 1) * seeds, progress, |job| {
            let (variant, seed) = (job / seeds, job % seeds);
            let [scene, other] = settings.scenes(motion, seed);
            match variants.get(variant) {
                Some(variant) => Err(trial::run(&scene, &other.tape, motion, &variant.options, settings.iterations)),
                None => Ok(Recommended::run(&scene, &other.tape, motion)),
            }
        });
        let (mut trials, mut recommended) = (Vec::new(), Vec::new());
        for result in done {
            match result {
                Err(trial) => trials.push(trial),
                Ok(of) => recommended.extend(of),
            }
        }
        let mut rest = trials.into_iter();
        let rows = variants.into_iter().map(|variant| (variant, rest.by_ref().take(seeds).collect())).collect();
        let [first, _] = settings.scenes(motion, 0);
        let truth = (0..seeds).map(|seed| {
            let [_, other] = settings.scenes(motion, seed);
            trial::truth(&other, &variant::start(motion))
        });
        let truth = truth.collect();
        let accelerations = first.accelerations.iter().map(|a| a.norm()).collect();
        Self { motion, rows, recommended, truth, accelerations }
    }

    /// The runs of a scheme.
    pub fn trials(&self, name: &str) -> &[Trial] {
        self.rows.iter().find(|(variant, _)| variant.name == name).map_or(&[], |(_, trials)| trials)
    }
}

impl Study {
    /// Runs the parts on the threads of the pool it is called from.
    pub fn run(settings: Settings, progress: &ProgressBar) -> Self {
        let wanted = |part: Part| settings.parts.contains(&part);
        let motions = [(Part::Static, Motion::Rest), (Part::Kinematic, Motion::Drive)];
        let motions = motions.into_iter().filter(|(part, _)| wanted(*part));
        let tables = motions.map(|(_, motion)| Table::run(motion, &settings, progress)).collect();
        let starts = if wanted(Part::Starts) { Starts::run(&settings, progress) } else { Vec::new() };
        let speed = if wanted(Part::Speed) { Speed::run(&settings, progress) } else { Vec::new() };
        Self { settings, tables, starts, speed }
    }

    /// The table of a kind of motion.
    pub fn table(&self, motion: Motion) -> Option<&Table> {
        self.tables.iter().find(|table| table.motion == motion)
    }
}
