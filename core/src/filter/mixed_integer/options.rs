//! What a mixed-integer filter can be told.

use super::super::linearize::Rule;
use super::super::update::Form;

/// How cycle slips are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Detector {
    /// The paper's projection of the innovation on the ambiguities, (31).
    #[default]
    Projection,
    /// The same weighted by S⁻¹: half the standard deviation under Table I.
    Weighted,
    /// None: V = σ_stay² always.
    None,
}

/// How ambiguities become integers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Fixing {
    /// Integer least squares; bootstrapping where its node budget is spent.
    #[default]
    LeastSquares,
    /// Bootstrapping in the decorrelated order.
    Bootstrapping,
}

/// What the constrained density is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Output {
    /// A density of its own, conditioned on all past integers: the paper's.
    #[default]
    DualDensity,
    /// The relaxed density given the integers of this epoch: the conventional fix. Nothing is carried over.
    ConditionalFix,
}

/// Options of a mixed-integer filter. The default is the paper's Algorithm 1 with σ_stay = 0.1, d = 1 and cubature.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Options {
    /// Linearisation rule.
    pub rule: Rule,
    /// Form of the measurement update. The plain form gives way to the array form in an epoch whose nonlinear states are
    /// too uncertain for it, such as the first.
    pub form: Form,
    /// Slip detector.
    pub detector: Detector,
    /// d, the slip estimate beyond which an ambiguity is taken to have jumped (strictly) `[cycles]`.
    pub threshold: f64,
    /// σ_jump, standard deviation of the step of an ambiguity that jumped `[cycles]`.
    pub sigma_jump: f64,
    /// σ_stay, standard deviation of the step of one that did not `[cycles]`.
    pub sigma_stay: f64,
    /// Whether a jump common to all ambiguities, that of their reference satellite, gets a variance of its own,
    /// V += σ_jump² 1 1ᵀ.
    pub common_jump: bool,
    /// How integers are found.
    pub fixing: Fixing,
    /// Nodes that an integer search may visit.
    pub search_budget: u32,
    /// What the constrained density is.
    pub output: Output,
    /// Success rate of bootstrapping below which the rows with ambiguities are left out of the constrained update; 0 lets
    /// all pass.
    pub gate: f64,
}

impl Options {
    /// The default, for a `static`.
    pub const DEFAULT: Self = Self {
        rule: Rule::Cubature,
        form: Form::Sequential,
        detector: Detector::Projection,
        threshold: 1.0,
        sigma_jump: 10.0,
        sigma_stay: 0.1,
        common_jump: false,
        fixing: Fixing::LeastSquares,
        search_budget: 100_000,
        output: Output::DualDensity,
        gate: 0.0,
    };
}

impl Default for Options {
    fn default() -> Self {
        Self::DEFAULT
    }
}
