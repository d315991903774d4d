//! Six starts of three schemes on the first run at rest: standard deviations of measurements a tenth and ten times the
//! paper's, walks of 1e-5, 1e-3 and 1e-1 m from epoch to epoch.

use super::super::monte_carlo;
use super::Settings;
use super::scenario::Motion;
use super::trial::{self, LOOKS};
use super::variant::{names, variants};
use crate::smooth::ppp::Class;
use indicatif::ProgressBar;

/// Factors on the standard deviations, and walks `[m]`.
const STARTS: [(f64, f64); 6] = [(0.1, 1e-5), (0.1, 1e-3), (0.1, 1e-1), (10.0, 1e-5), (10.0, 1e-3), (10.0, 1e-1)];

/// How far the ends of a scheme lie apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Starts {
    /// The scheme.
    pub name: &'static str,
    /// How many of the starts came to an end.
    pub ended: usize,
    /// Greatest less smallest ℓ.
    pub likelihood: f64,
    /// Greatest difference of the last position in an axis `[m]`.
    pub position: f64,
    /// Least and greatest mean of the smoother's normalised squared errors.
    pub nees: [f64; 2],
}

impl Starts {
    /// Runs all of them.
    pub fn run(settings: &Settings, progress: &ProgressBar) -> Vec<Self> {
        let motion = Motion::Rest;
        let wanted = [names::FLOORS, names::ELEVATION, names::STUDENT];
        let schemes: Vec<_> = variants(motion).into_iter().filter(|variant| wanted.contains(&variant.name)).collect();
        let [scene, other] = settings.scenes(motion, 0);
        let last = LOOKS.iter().copied().filter(|look| *look <= settings.iterations).max().unwrap_or(0);
        let trials = monte_carlo::run(schemes.len() * STARTS.len(), progress, |job| {
            let (factor, walk) = STARTS[job % STARTS.len()];
            let mut options = schemes[job / STARTS.len()].options.clone();
            options.start = options.start.map(|sigmas| sigmas.map(|sigma| factor * sigma));
            options.walks[Class::Motion as usize].sigma = walk / motion.interval().sqrt();
            trial::run(&scene, &other.tape, motion, &options, last)
        });
        let starts = schemes.iter().zip(trials.chunks(STARTS.len()));
        starts
            .map(|(scheme, trials)| {
                let looks: Vec<_> = trials.iter().filter_map(|trial| trial.looks.last()?.as_ref()).collect();
                let ended = trials.iter().filter(|trial| trial.failed.is_none());
                let likelihoods = ended.filter_map(|trial| trial.likelihoods.last().copied());
                let range = |numbers: &mut dyn Iterator<Item = f64>| {
                    numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
                };
                let width = |[low, high]: [f64; 2]| high - low;
                let axis = |axis: usize| width(range(&mut looks.iter().map(|look| look.last[axis])));
                Self {
                    name: scheme.name,
                    ended: looks.len(),
                    likelihood: width(range(&mut likelihoods.into_iter())),
                    position: (0..3).map(axis).fold(0.0, f64::max),
                    nees: range(&mut looks.iter().map(|look| look.nees)),
                }
            })
            .collect()
    }
}
