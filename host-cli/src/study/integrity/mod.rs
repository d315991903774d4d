//! `study integrity`: L. Wang et al., *Integrity monitoring of moving base RTK by an adaptive Kalman filter based on integer
//! ambiguity verification* (GPS Solutions 26, 2022), by simulation, as its data are not public.
//!
//! | module | holds |
//! |---|---|
//! | [`scenario`] | two vehicles, trees, satellites |
//! | [`noise`] | four kinds of noise |
//! | [`variant`] | the filters: KF, AKF, IAVAKF in all forms, and the recommended one |
//! | [`trial`] | one filter on one run |
//! | [`outcome`] | what the runs come to |
//! | [`risk`] | protection levels at their stated risk, by three million epochs |
//! | [`bounds`] | Fig. 4: bounds of the success rate |
//! | [`acceptance`] | the numbers that must be met |
//! | [`report`] | tables on screen, with the paper's numbers beside |
//! | [`files`], [`figure`] | tables as CSV, Figs. 4 and 10 to 15 |
//!
//! Run i of every filter sees the same noise. Cost: about 0.2 ms an epoch; filters with R* as a whole matrix some
//! milliseconds, which are therefore run on two seeds at most.

pub mod acceptance;
pub mod bounds;
pub mod figure;
pub mod files;
pub mod noise;
pub mod outcome;
pub mod report;
pub mod risk;
pub mod scenario;
pub mod trial;
pub mod variant;

use super::monte_carlo;
use bounds::Bounds;
use indicatif::ProgressBar;
use noise::Noise;
use outcome::Outcome;
use scenario::Record;
use trial::Run;
use variant::{PAPERS, RECOMMENDED, VARIANTS, Variant};

/// Runs of filters with R* as a whole matrix, at most.
pub const WHOLE: usize = 2;

/// Parts of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// The filters under four kinds of noise: Tables 3 and 4, Figs. 10 to 15
    Filters,
    /// Protection levels at a stated risk
    Risk,
    /// Bounds of the success rate: Fig. 4
    Bounds,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Runs of each filter.
    pub seeds: usize,
    /// Epochs of a run.
    pub epochs: usize,
    /// Epochs of the part risk.
    pub risk_epochs: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Parts.
    pub parts: Vec<Part>,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Study {
    /// What was done.
    pub settings: Settings,
    /// For each kind of noise, all filters.
    pub tables: Vec<Table>,
    /// Levels at their risk.
    pub risk: Option<risk::Outcome>,
    /// Bounds of success rates.
    pub bounds: Option<Bounds>,
}

/// One kind of noise.
#[derive(Clone, Debug)]
pub struct Table {
    /// Which.
    pub noise: Noise,
    /// Filters and what they come to.
    pub rows: Vec<(Variant, Outcome)>,
    /// The first run of those that are drawn: the paper's three and the recommended one.
    pub drawn: Vec<(&'static str, Run)>,
}

impl Table {
    fn run(noise: Noise, settings: &Settings, progress: &ProgressBar) -> Self {
        let runs = |variant: &Variant| if variant.is_whole() { settings.seeds.min(WHOLE) } else { settings.seeds };
        let jobs: Vec<(usize, usize)> = VARIANTS
            .iter()
            .enumerate()
            .flat_map(|(v, variant)| (0..runs(variant)).map(move |seed| (v, seed)))
            .collect();
        let done = monte_carlo::run(jobs.len(), progress, |job| {
            let (variant, seed) = jobs[job];
            let record = Record::draw(noise, settings.epochs, &mut monte_carlo::stream(settings.seed, seed as u64));
            trial::run(&VARIANTS[variant], &record)
        });
        let (mut rows, mut drawn) = (Vec::new(), Vec::new());
        let mut rest = done.into_iter();
        for variant in &VARIANTS {
            let mut runs: Vec<Run> = rest.by_ref().take(runs(variant)).collect();
            rows.push((*variant, Outcome::of(&runs)));
            let wanted = PAPERS.iter().map(|(_, name)| *name).chain([RECOMMENDED]);
            if wanted.into_iter().any(|name| name == variant.name) && !runs.is_empty() {
                drawn.push((variant.name, runs.swap_remove(0)));
            }
        }
        Self { noise, rows, drawn }
    }

    /// What a filter came to.
    pub fn outcome(&self, name: &str) -> Option<&Outcome> {
        self.rows.iter().find(|(variant, _)| variant.name == name).map(|(_, outcome)| outcome)
    }

    /// The first run of a filter that is drawn.
    pub fn first(&self, name: &str) -> Option<&Run> {
        self.drawn.iter().find(|(of, _)| *of == name).map(|(_, run)| run)
    }
}

impl Study {
    /// Runs the parts on the threads of the pool it is called from.
    pub fn run(settings: Settings, progress: &ProgressBar) -> Self {
        let wanted = |part: Part| settings.parts.contains(&part);
        let tables = match wanted(Part::Filters) {
            true => Noise::ALL.map(|noise| Table::run(noise, &settings, progress)).into(),
            false => Vec::new(),
        };
        let risk = wanted(Part::Risk).then(|| risk::Outcome::run(settings.risk_epochs, settings.seed, progress));
        let bounds = wanted(Part::Bounds).then(|| Bounds::run(settings.seed)).flatten();
        Self { settings, tables, risk, bounds }
    }

    /// The table of a kind of noise.
    pub fn table(&self, noise: Noise) -> Option<&Table> {
        self.tables.iter().find(|table| table.noise == noise)
    }
}
