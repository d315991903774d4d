//! Which configurations are compared, the numbers of the paper's Table 2, and what an independent program found.
//!
//! The paper states neither geometry nor σ_L, σ_H and ε, and its Table 2 has a transient that only a prior of the
//! ambiguities in contradiction to the data explains. Configurations:
//!
//! | part | geometry | initial n | prior of n | y₀ | σ_L, σ_H |
//! |---|---|---|---|---|---|
//! | paper | G2 | U(−50, 50) | 1 | not used | 0.01, 1 |
//! | uniform | G2 | U(−10, 10) | 1 | not used | 0.01, 10 |
//! | recommended | G2 | U(−50, 50) | 100 | used | 0.05, 10 |
//! | nominal | nominal | N(0, 1), rounded | 1 | used | 0.01, 10 |
//!
//! All in cycles, ε = 0.5. "Paper" was tuned by an independent program to the sizes of the paper's transient; it is no
//! prediction. "Uniform" is the paper's Appendix A and Algorithm 1 to the letter.

use super::scenario::{Differences, Initial, Scenario, Sky};
use super::trial::{Configuration, Estimation, Posterior, Scheme};

/// A part of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Table 2 and Fig. 2 with the configuration that reproduces the paper.
    Paper,
    /// Table 2 with the decided configuration, on the same data.
    Recommended,
    /// Algorithm 1 and Appendix A to the letter.
    Uniform,
    /// A nominal geometry and a consistent prior.
    Nominal,
    /// Fig. 3 and Fig. 4: noise learned from a wrong start.
    Adaptation,
}

impl Part {
    /// Those of Table 2.
    pub const TABLES: [Self; 4] = [Self::Paper, Self::Recommended, Self::Uniform, Self::Nominal];

    /// Its heading.
    pub fn title(self) -> &'static str {
        match self {
            Self::Paper => "paper: G2, n0 ~ U(-50, 50), prior 1 cycle, y0 not used, sigma_L 0.01, sigma_H 1",
            Self::Recommended => "recommended: the same data, prior 100 cycles, y0 used, sigma_L 0.05, sigma_H 10",
            Self::Uniform => "uniform: G2, n0 ~ U(-10, 10), prior 1 cycle, y0 not used, sigma_L 0.01, sigma_H 10",
            Self::Nominal => {
                "nominal: a sky for each run, n0 ~ round N(0, 1), prior 1 cycle, y0 used, sigma_L 0.01, sigma_H 10"
            }
            Self::Adaptation => "adaptation: SD-IF, ERTS, fixed smoother with integers from the smoother",
        }
    }

    /// What is run for a model, if it is one of [`Part::TABLES`].
    pub fn configuration(self, differences: Differences, last: usize) -> Option<Configuration> {
        let (sky, initial, estimation) = match self {
            Self::Paper => (Sky::G2, Initial::Uniform(50), Estimation { slip: 1.0, ..literal() }),
            Self::Recommended => (Sky::G2, Initial::Uniform(50), Estimation::recommended()),
            Self::Uniform => (Sky::G2, Initial::Uniform(10), literal()),
            Self::Nominal => (Sky::Nominal, Initial::Rounded, Estimation { first_epoch: true, ..literal() }),
            Self::Adaptation => return None,
        };
        let scenario = Scenario { sky, differences, last, initial, ..Scenario::default() };
        Some(Configuration { scenario, estimation })
    }

    /// Moment rules that are compared.
    pub fn schemes(self) -> &'static [Scheme] {
        match self {
            Self::Paper | Self::Recommended => &Scheme::ALL,
            _ => &[Scheme::Erts],
        }
    }
}

/// Algorithm 1 to the letter.
fn literal() -> Estimation {
    Estimation { prior: 1.0, first_epoch: false, stay: 0.01, slip: 10.0, threshold: 0.5 }
}

/// Numbers of one row, where known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// TA-RMSE `[m]`.
    pub mean_rmse: f64,
    /// S-RMSE `[m]`.
    pub rmse: f64,
    /// S-RAPC `[m]`.
    pub rapc: f64,
    /// TA-IFA `[%]`.
    pub right: f64,
    /// Computing time of the paper `[s]`.
    pub seconds: f64,
}

const fn reference(mean_rmse: f64, rmse: f64, rapc: f64, right: f64, seconds: f64) -> Reference {
    Reference { mean_rmse, rmse, rapc, right, seconds }
}

/// Table 2 of the paper, 1000 runs. Its "filtering" rows are fixed filter, its "smoothing" rows fixed smoother: the
/// covariance of a fixed estimate depends on neither data nor integers.
pub fn paper(differences: Differences, source: Posterior, scheme: Scheme) -> Reference {
    let seconds = match (differences, source) {
        (Differences::Double, Posterior::Filter) => [4.725, 6.272, 6.350],
        (Differences::Double, Posterior::Smoother) => [4.877, 6.230, 6.245],
        (Differences::Single, Posterior::Filter) => [6.248, 7.672, 7.574],
        (Differences::Single, Posterior::Smoother) => [6.057, 7.433, 7.364],
    }[scheme as usize];
    match (differences, source) {
        (Differences::Double, Posterior::Filter) => reference(0.3056, 0.05422, 0.05499, 97.675, seconds),
        (Differences::Double, Posterior::Smoother) => reference(0.04732, 0.03838, 0.04063, 99.843, seconds),
        (Differences::Single, Posterior::Filter) => reference(0.2789, 0.04655, 0.05379, 98.507, seconds),
        (Differences::Single, Posterior::Smoother) => reference(0.04021, 0.03848, 0.03970, 99.899, seconds),
    }
}

/// What an independent program found with ERTS (40 to 80 runs, those of "recommended" 30), its RMSE over the window.
#[rustfmt::skip]
pub fn independent(part: Part, differences: Differences, source: Posterior, estimate: Posterior) -> Option<Reference> {
    use Differences::{Double, Single};
    use Posterior::{Filter, Smoother};
    let (mean_rmse, rmse, rapc, right) = match (part, differences, source, estimate) {
        (Part::Paper, Double, Filter, Filter) => (0.2162, 0.05426, 0.05497, 98.439),
        (Part::Paper, Double, Filter, Smoother) => (0.1703, 0.04015, 0.04034, 98.439),
        (Part::Paper, Double, Smoother, Filter) => (0.0702, 0.05386, 0.05497, 99.897),
        (Part::Paper, Double, Smoother, Smoother) => (0.0453, 0.03978, 0.04034, 99.897),
        (Part::Paper, Single, Filter, Filter) => (0.1394, 0.05212, 0.05213, 99.022),
        (Part::Paper, Single, Filter, Smoother) => (0.0987, 0.03818, 0.03830, 99.022),
        (Part::Paper, Single, Smoother, Filter) => (0.0681, 0.05195, 0.05213, 99.902),
        (Part::Paper, Single, Smoother, Smoother) => (0.0443, 0.03794, 0.03830, 99.902),
        (Part::Recommended, Double, _, Filter) => (0.0504, 0.0538, 0.0550, 99.9996),
        (Part::Recommended, Double, _, Smoother) => (0.0372, 0.0404, 0.0403, 99.9999),
        (Part::Recommended, Single, _, Filter) => (0.0478, 0.0506, 0.0521, 100.0),
        (Part::Recommended, Single, _, Smoother) => (0.0351, 0.0374, 0.0383, 100.0),
        (Part::Uniform, Double, Filter, Filter) => (0.0591, 0.05369, 0.05497, 99.875),
        (Part::Uniform, Double, Filter, Smoother) => (0.0412, 0.04016, 0.04034, 99.875),
        (Part::Uniform, Double, Smoother, Filter) => (0.0575, 0.05369, 0.05497, 99.908),
        (Part::Uniform, Double, Smoother, Smoother) => (0.0400, 0.04016, 0.04034, 99.908),
        (Part::Uniform, Single, Filter, Filter) => (0.0561, 0.05124, 0.05213, 99.897),
        (Part::Uniform, Single, Filter, Smoother) => (0.0389, 0.03804, 0.03830, 99.897),
        (Part::Uniform, Single, Smoother, Filter) => (0.0562, 0.05090, 0.05213, 99.909),
        (Part::Uniform, Single, Smoother, Smoother) => (0.0388, 0.03756, 0.03830, 99.909),
        (Part::Nominal, Double, Filter, Filter) => (0.0266, 0.02768, 0.02762, 99.996),
        (Part::Nominal, Double, Filter, Smoother) => (0.0176, 0.01818, 0.01804, 99.996),
        (Part::Nominal, Double, Smoother, Filter) => (0.0265, 0.02760, 0.02762, 99.999),
        (Part::Nominal, Double, Smoother, Smoother) => (0.0176, 0.01810, 0.01804, 99.999),
        (Part::Nominal, Single, Filter, Filter) => (0.0247, 0.02564, 0.02555, 99.998),
        (Part::Nominal, Single, Filter, Smoother) => (0.0162, 0.01650, 0.01659, 99.998),
        (Part::Nominal, Single, Smoother, Filter) => (0.0247, 0.02564, 0.02555, 100.0),
        (Part::Nominal, Single, Smoother, Smoother) => (0.0161, 0.01650, 0.01659, 100.0),
        (Part::Adaptation, ..) => return None,
    };
    Some(reference(mean_rmse, rmse, rapc, right, f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Appendix A, whatever the defaults of the model become.
    #[test]
    fn the_scenario_is_that_of_the_paper() {
        let Scenario { last, jumps, motion, noise, .. } =
            Part::Paper.configuration(Differences::Single, 1000).unwrap().scenario;
        assert_eq!((last, motion.interval, jumps.largest, jumps.probability), (1000, 5.0, 10, 0.005));
        let sigma = |variances: &[f64]| variances.iter().map(|v| (1e4 * v.sqrt()).round()).collect::<Vec<_>>();
        assert_eq!(sigma(&motion.variances), [100.0, 100.0, 10.0, 10.0, 10.0, 10.0]);
        let noise = [noise.code, noise.phase, noise.doppler, noise.ionosphere, noise.troposphere, noise.clock];
        assert_eq!(sigma(&noise), [5000.0, 100.0, 500.0, 100.0, 100.0, 10.0]);
    }

    #[test]
    fn every_table_has_its_configuration() {
        for part in Part::TABLES {
            let configuration = part.configuration(Differences::Double, 10).unwrap();
            assert_eq!(configuration.estimation.threshold, 0.5);
            assert!(independent(part, Differences::Double, Posterior::Filter, Posterior::Filter).is_some());
        }
        assert_eq!(Part::Adaptation.configuration(Differences::Double, 10), None);
    }
}
