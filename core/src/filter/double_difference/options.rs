//! What a [`DoubleDifferenceFilter`](super::DoubleDifferenceFilter) can be told.

use super::super::adaptive::forgetting::Forgetting;
use crate::gnss::SPEED_OF_LIGHT;
use crate::integer::subset;
use crate::integrity::protection::Config;
use crate::model::noise::Noise;

/// In which form R* follows the data, see [`super::super::adaptive`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Adaptation {
    /// Not at all: R₀.
    #[default]
    Off,
    /// A ratio for each of P1, P2, L1, L2, of residuals.
    Type,
    /// A ratio for each double difference, of residuals.
    Channel,
    /// The whole matrix, of residuals.
    Residual,
    /// The whole matrix, of innovations: eq. (25) as printed.
    Literal,
}

/// Options. [`Options::PAPER`] is the plain filter of the paper, [`Options::RECOMMENDED`] what its simulation recommends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Wavelengths of both bands `[m]`.
    pub wavelengths: [f64; 2],
    /// Power spectral density of the acceleration `[m²/s³]`.
    pub motion_noise: f64,
    /// Noise of one code observation.
    pub code: Noise,
    /// By what the variance of codes is multiplied because their noise is correlated in time: twice the correlation time in
    /// epochs makes the filter's memory as long as it is. What is learned of codes is learned of them without it. 1 for none.
    pub overbound: f64,
    /// Noise of one phase observation.
    pub phase: Noise,
    /// Variance of a new ambiguity `[cycles²]`.
    pub new_ambiguity: f64,
    /// Random walk of each satellite's ambiguities `[cycles/√s]`: what errors of phases that are correlated in time do to a
    /// float ambiguity, σ √(2/τ) for a Gauss–Markov process. Without it float positions become surer than they are; fixed
    /// ones are as sure as the phases of their epoch. 0 for none.
    pub ambiguity_walk: f64,
    /// How R* follows the data.
    pub adaptation: Adaptation,
    /// How fast.
    pub forgetting: Forgetting,
    /// β₀ of the first epoch that is learned from.
    pub first_beta: f64,
    /// Whether an epoch is updated again with the R* that it led to, as the paper has it; else R* is for the next one.
    pub two_passes: bool,
    /// Epochs before R* is learned.
    pub warm_up: u32,
    /// Bounds of ratios, or of generalised eigenvalues of R* by R₀; without them the literal form fails.
    pub bounds: Option<[f64; 2]>,
    /// Normalised innovation of a double difference beyond which its standard deviation grows with it; infinite for none.
    pub gate: f64,
    /// Which integers are fixed.
    pub subset: subset::Options,
    /// Least ratio of the squared norms of second-best and best integers, without which a fix counts only where
    /// 1 − P_s ≤ P_IF; 0 for no such test: then every fix counts as
    /// accepted by the data, as the paper has it, although only its success rate P₀ speaks for it.
    pub ratio: f64,
    /// Least ratio without which no fix counts, however sure the success rate is; 1 or less for none.
    pub veto: f64,
    /// Risk, rule and alert limits.
    pub integrity: Config,
    /// Whether protection levels grow with what innovations exceed their covariance by.
    pub inflate: bool,
}

impl Options {
    /// The paper's Kalman filter: 30 cm and 1 cm, P₀ = 0.95, no test of the data.
    pub const PAPER: Self = Self {
        // GPS L1, L2.
        wavelengths: [SPEED_OF_LIGHT / 1575.42e6, SPEED_OF_LIGHT / 1227.6e6],
        motion_noise: 1.0,
        code: Noise { constant: 0.3, elevation: 0.0 },
        overbound: 1.0,
        phase: Noise { constant: 0.01, elevation: 0.0 },
        new_ambiguity: 900.0,
        ambiguity_walk: 0.0,
        adaptation: Adaptation::Off,
        forgetting: Forgetting::SageHusa { b: 0.97 },
        first_beta: 1.0,
        two_passes: true,
        warm_up: 10,
        bounds: Some([0.25, 1e4]),
        gate: f64::INFINITY,
        subset: subset::Options::DEFAULT,
        ratio: 0.0,
        veto: 0.0,
        integrity: Config::DEFAULT,
        inflate: false,
    };

    /// Code noise that overbounds what is correlated in time, weights by elevation, a ratio for each channel that is never
    /// below 1, a ratio test, a gate, and levels that grow with the innovations.
    ///
    /// Walk and veto were chosen by simulation (six runs of heavy noise, `surefix study integrity`): without both 2.3 % of the
    /// epochs exceed their HPL, with the walk alone 0.3 to 0.4 %, with both none; 82, 77 to 82 and 77 % are fixed.
    pub const RECOMMENDED: Self = Self {
        code: Noise { constant: 0.0, elevation: 0.3 },
        // 2 m instead of 0.3 m.
        overbound: 4.0 / 0.09,
        ambiguity_walk: 0.004,
        phase: Noise { constant: 0.0, elevation: 0.01 },
        adaptation: Adaptation::Channel,
        first_beta: 0.03,
        two_passes: false,
        warm_up: 30,
        bounds: Some([1.0, 400.0]),
        gate: 4.0,
        ratio: 3.0,
        veto: 1.5,
        inflate: true,
        ..Self::PAPER
    };

    /// Whether the numbers make sense.
    pub(super) fn is_sound(&self) -> bool {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let bounded = self.bounds.is_none_or(|[low, high]| positive(low) && low <= high && high.is_finite());
        self.wavelengths.iter().all(|&wavelength| positive(wavelength))
            && self.motion_noise >= 0.0
            && self.motion_noise.is_finite()
            && [self.code, self.phase].iter().all(|noise| positive(noise.variance(1.0, None)))
            && self.overbound >= 1.0
            && self.overbound.is_finite()
            && positive(self.new_ambiguity)
            && self.ambiguity_walk >= 0.0
            && self.ambiguity_walk.is_finite()
            && self.forgetting.is_sound()
            && self.first_beta > 0.0
            && self.first_beta <= 1.0
            && bounded
            && self.gate > 0.0
            && self.ratio >= 0.0
            && self.veto >= 0.0
            && self.veto <= self.ratio.max(1.0)
    }
}
