//! The tables of the study: which configurations are compared, and what an independent program found for them.
//!
//! The reference numbers come from an implementation of its own (24 to 60 runs a row; another constellation of 13
//! satellites), so that fractions near 0.996 may differ by some 0.002 from them by chance alone.

use super::scenario::Scenario;
use super::trial::Configuration;
use surefix_core::filter::jump::JumpProcess;
use surefix_core::filter::linearize::Rule;
use surefix_core::filter::mixed_integer::{Detector, Fixing, Options, Output};
use surefix_core::filter::update::Form;
use surefix_core::model::virtual_bias::VirtualBiasParameters;

/// A part of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Four linearisations with Table I, against the acceptance bands.
    Acceptance,
    /// Threshold d of the paper's slip detector, for three frequencies of slips.
    Threshold,
    /// σ_stay, with the detector and without.
    SigmaStay,
    /// The paper's slip detector against the weighted one.
    Detectors,
    /// Bootstrapping against integer least squares.
    Integers,
    /// Dual density against the conditional fix.
    Output,
    /// Linearisations after one epoch with a prior of 10 km.
    WidePrior,
    /// False alarms and detections of both detectors over d.
    Curve,
    /// Errors of one run over time, Fig. 1 of the paper.
    Figure,
}

/// Numbers of the independent program, where it has them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// Fraction of epochs with all integers right.
    pub right: Option<f64>,
    /// RMSE of the constrained position `[m]`.
    pub rmse: Option<f64>,
    /// NEES of the constrained position.
    pub nees: Option<f64>,
    /// NEES of the relaxed position.
    pub relaxed_nees: Option<f64>,
}

/// A configuration to be run.
#[derive(Clone, Debug)]
pub struct Row {
    /// What it is called in its section.
    pub label: String,
    /// What is run.
    pub configuration: Configuration,
    /// What another program found.
    pub reference: Reference,
}

/// A table.
#[derive(Clone, Debug)]
pub struct Section {
    /// Which part of the study it is.
    pub part: Part,
    /// Its heading.
    pub title: &'static str,
    /// Its lines.
    pub rows: Vec<Row>,
}

/// Probabilities of a jump per epoch: the paper's text, Table I per second, Table I read per epoch.
const JUMPS: [f64; 3] = [0.001, 0.005, 0.05];

/// The fraction right, the RMSE `[cm]` and the NEES of the constrained density.
type Numbers = (f64, f64, f64);

/// d, and the numbers for each of [`JUMPS`].
#[rustfmt::skip]
const THRESHOLD: [(f64, [Numbers; 3]); 9] = [
    (0.3,  [(0.9761, 3.3, 10.8), (0.9762, 3.3, 11.0), (0.9735, 3.4, 11.7)]),
    (0.5,  [(0.9969, 1.8, 3.8),  (0.9962, 1.8, 4.0),  (0.9913, 2.1, 5.1)]),
    (0.75, [(0.9994, 1.55, 3.1), (0.9983, 1.56, 3.2), (0.9862, 1.90, 4.5)]),
    (1.0,  [(0.9993, 1.52, 3.1), (0.9962, 1.55, 3.2), (0.9690, 2.1, 5.5)]),
    (1.25, [(0.9990, 1.53, 3.1), (0.9942, 1.61, 3.4), (0.9524, 2.5, 7.5)]),
    (1.5,  [(0.9989, 1.53, 3.1), (0.9929, 1.64, 3.4), (0.9336, 2.9, 10.6)]),
    (2.0,  [(0.9973, 1.54, 3.1), (0.9871, 1.70, 3.7), (0.8526, 5.6, 38.0)]),
    (3.0,  [(0.9934, 1.67, 3.6), (0.9673, 2.2, 6.1),  (0.6601, 13.0, 216.0)]),
    (5.0,  [(0.9828, 2.2, 6.0),  (0.9057, 5.3, 39.0), (0.2008, 43.0, 2801.0)]),
];

/// σ_stay and the fraction right, with the detector and without.
const SIGMA_STAY_ADAPTIVE: [(f64, f64); 8] = [
    (0.01, 0.976),
    (0.02, 0.987),
    (0.03, 0.992),
    (0.05, 0.9962),
    (0.07, 0.9962),
    (0.1, 0.9971),
    (0.2, 0.982),
    (0.4, 0.939),
];
const SIGMA_STAY_ALWAYS: [(f64, f64); 6] =
    [(0.01, 0.15), (0.05, 0.465), (0.2, 0.83), (0.4, 0.894), (0.44, 0.888), (10.0, 0.84)];

/// The study's configuration: Table I, d = 1, cubature.
pub fn nominal() -> Configuration {
    Configuration {
        scenario: Scenario::default(),
        options: Options {
            rule: Rule::Cubature,
            form: Form::Sequential,
            detector: Detector::Projection,
            threshold: 1.0,
            sigma_jump: 10.0,
            sigma_stay: 0.05,
            common_jump: false,
            fixing: Fixing::LeastSquares,
            output: Output::DualDensity,
            gate: 0.0,
            ..Options::default()
        },
    }
}

/// The configuration of [`Part::Curve`]: frequent slips, flags as good as always right.
pub fn open_loop() -> Configuration {
    jumping(0.02, Options { detector: Detector::Weighted, threshold: 0.5, ..nominal().options })
}

/// The tables among `parts`, in the order of [`Part`].
pub fn sections(parts: &[Part]) -> Vec<Section> {
    [acceptance, threshold, sigma_stay, detectors, integers, output, wide_prior]
        .map(|section| section())
        .into_iter()
        .filter(|section| parts.contains(&section.part))
        .collect()
}

fn jumping(probability: f64, options: Options) -> Configuration {
    let scenario = Scenario { jumps: JumpProcess { probability, ..Scenario::default().jumps }, ..Scenario::default() };
    Configuration { scenario, options }
}

fn row(label: impl Into<String>, configuration: Configuration, reference: Reference) -> Row {
    Row { label: label.into(), configuration, reference }
}

fn right(right: f64) -> Reference {
    Reference { right: Some(right), ..Reference::default() }
}

fn all(fraction: f64, rmse_cm: f64, nees: f64) -> Reference {
    Reference { rmse: Some(rmse_cm / 100.0), nees: Some(nees), ..right(fraction) }
}

fn acceptance() -> Section {
    let rules = [
        ("EKF", Rule::Taylor),
        ("UT(1, 2, 0)", Rule::unscented(3)),
        ("CKF", Rule::Cubature),
        ("GH3", Rule::GaussHermite { order: 3 }),
    ];
    let rows = rules.map(|(label, rule)| {
        let options = Options { rule, ..nominal().options };
        row(label, Configuration { options, ..nominal() }, all(0.9962, 1.55, 3.16))
    });
    Section { part: Part::Acceptance, title: "linearisation, Table I, d = 1", rows: rows.into() }
}

fn threshold() -> Section {
    let rows = JUMPS.into_iter().enumerate().flat_map(|(k, probability)| {
        THRESHOLD.into_iter().map(move |(threshold, references)| {
            let (right, rmse, nees) = references[k];
            let options = Options { threshold, ..nominal().options };
            row(format!("b {probability}, d {threshold}"), jumping(probability, options), all(right, rmse, nees))
        })
    });
    Section {
        part: Part::Threshold,
        title: "threshold d of the paper's detector, jumps b per epoch",
        rows: rows.collect(),
    }
}

fn sigma_stay() -> Section {
    let sweep = |detector, name: &'static str, table: &'static [(f64, f64)]| {
        table.iter().map(move |&(sigma_stay, reference)| {
            let options = Options { detector, sigma_stay, ..nominal().options };
            row(format!("{name}, σ_stay {sigma_stay}"), Configuration { options, ..nominal() }, right(reference))
        })
    };
    let adaptive = sweep(Detector::Projection, "adaptive", &SIGMA_STAY_ADAPTIVE);
    let always = sweep(Detector::None, "always", &SIGMA_STAY_ALWAYS);
    Section {
        part: Part::SigmaStay,
        title: "σ_stay, adaptive by the paper's detector and without detector, d = 1, b = 0.005",
        rows: adaptive.chain(always).collect(),
    }
}

fn detectors() -> Section {
    let paper = nominal().options;
    let weighted = open_loop().options;
    let noisy = |options| {
        let parameters = VirtualBiasParameters { bias_walk: 0.1, ..VirtualBiasParameters::default() };
        Configuration { options, scenario: Scenario { parameters, ..Scenario::default() } }
    };
    Section {
        part: Part::Detectors,
        title: "slip detector: the paper's (d = 1) and weighted by S⁻¹ (d = 0.5)",
        rows: vec![
            row("b 0.005, paper", jumping(0.005, paper), all(0.9962, 1.55, 3.16)),
            row("b 0.005, weighted", jumping(0.005, weighted), right(1.0)),
            row("b 0.05, paper", jumping(0.05, paper), all(0.9690, 2.1, 5.5)),
            row("b 0.05, weighted", jumping(0.05, weighted), right(0.9998)),
            row("b 0.005, β 0.1, paper", noisy(paper), right(0.983)),
            row("b 0.005, β 0.1, weighted", noisy(weighted), right(1.0)),
        ],
    }
}

fn integers() -> Section {
    let least_squares = nominal().options;
    let bootstrapping = Options { fixing: Fixing::Bootstrapping, ..least_squares };
    let [rmse_rare, rmse_often] = [2.1, 2.4].map(|cm| Some(cm / 100.0));
    Section {
        part: Part::Integers,
        title: "integers: least squares and decorrelated bootstrapping",
        rows: vec![
            row("b 0.005, least squares", jumping(0.005, least_squares), all(0.9962, 1.55, 3.16)),
            row("b 0.005, bootstrapping", jumping(0.005, bootstrapping), all(0.9960, 1.56, 3.22)),
            row("b 0.05, least squares", jumping(0.05, least_squares), Reference { rmse: rmse_rare, ..right(0.9690) }),
            row("b 0.05, bootstrapping", jumping(0.05, bootstrapping), Reference { rmse: rmse_often, ..right(0.9668) }),
        ],
    }
}

fn output() -> Section {
    let dual = nominal().options;
    let conditional = Options { output: Output::ConditionalFix, ..dual };
    let reference = |rmse_cm: f64, nees| Reference { rmse: Some(rmse_cm / 100.0), nees, ..Reference::default() };
    Section {
        part: Part::Output,
        title: "constrained position: a density of its own and the conditional fix",
        rows: vec![
            row("b 0.005, dual density", jumping(0.005, dual), reference(1.55, Some(3.16))),
            row("b 0.005, conditional", jumping(0.005, conditional), reference(1.60, Some(2.98))),
            row("b 0.05, dual density", jumping(0.05, dual), reference(2.1, None)),
            row("b 0.05, conditional", jumping(0.05, conditional), reference(2.4, None)),
        ],
    }
}

/// The reference has 200 trials; the mean of so skewed a quantity is uncertain by a good part of itself. The update is the
/// square-root array: the others are not safe with this prior.
fn wide_prior() -> Section {
    let rules = [
        ("EKF", Rule::Taylor, 113.0),
        ("CKF", Rule::Cubature, 30.0),
        ("UT(1, 2, 1)", Rule::Unscented { alpha: 1.0, beta: 2.0, kappa: 1.0 }, 29.0),
        ("UT(0.001, 2, 0)", Rule::Unscented { alpha: 1e-3, beta: 2.0, kappa: 0.0 }, 38.0),
        ("GH3", Rule::GaussHermite { order: 3 }, 2.9),
    ];
    let scenario = Scenario { epochs: 1, transient: 0, position_sigma: 1e4, ..Scenario::default() };
    let rows = rules.map(|(label, rule, nees)| {
        let options = Options { rule, form: Form::Array, ..nominal().options };
        let reference = Reference { relaxed_nees: Some(nees), ..Reference::default() };
        row(label, Configuration { scenario, options }, reference)
    });
    Section { part: Part::WidePrior, title: "linearisation with a prior of 10 km, after one epoch", rows: rows.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn parts_are_taken_one_by_one() {
        let lengths: Vec<usize> = sections(Part::value_variants()).iter().map(|section| section.rows.len()).collect();
        assert_eq!(lengths, [4, 27, 14, 6, 4, 4, 5]);
        let only = sections(&[Part::Figure, Part::Detectors]);
        assert!(only.len() == 1 && only[0].part == Part::Detectors);
    }

    /// Table I and section 2 of the paper, whatever the defaults of the filter become.
    #[test]
    fn the_nominal_configuration_is_the_papers() {
        let Configuration { scenario, options } = nominal();
        assert_eq!((options.sigma_jump, options.sigma_stay, options.threshold), (10.0, 0.05, 1.0));
        assert_eq!((scenario.jumps.largest, scenario.jumps.probability, scenario.epochs), (10, 0.005, 300));
        let p = scenario.parameters;
        assert_eq!((p.interval, p.acceleration, p.bias_walk, p.wavelength), (0.1, 0.01, 0.01, 0.2));
        assert_eq!((p.sigma_code, p.sigma_phase, p.sigma_bias), (0.5, 0.01, 0.01));
    }
}
