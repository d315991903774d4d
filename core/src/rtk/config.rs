//! What an [`RtkFilter`](super::RtkFilter) can be told. The defaults are meant to be right for every case; only the
//! band plan has to follow the receivers.

use crate::filter::adaptive::forgetting::Forgetting;
use crate::filter::linearize::Rule;
use crate::filter::mixed_integer::{Detector, Output};
use crate::filter::update::Form;
use crate::gnss::satellite::Constellation;
use crate::integrity;
use crate::model::motion::Motion;
use crate::model::noise::Noise;

/// Most bands of one constellation that take part.
pub const MAX_BANDS: usize = 3;

/// Which carriers take part: for each constellation up to [`MAX_BANDS`] RINEX band digits in order of preference as
/// first, second and third band; 0 where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BandPlan {
    bands: [[u8; MAX_BANDS]; 5],
}

impl BandPlan {
    /// No carrier at all.
    pub const EMPTY: Self = Self { bands: [[0; MAX_BANDS]; 5] };

    /// L1 alone: GPS L1, Galileo E1, BeiDou B1I, QZSS L1, GLONASS G1 (float).
    pub const L1: Self = Self { bands: [*b"1\0\0", *b"1\0\0", *b"2\0\0", *b"1\0\0", *b"1\0\0"] };

    /// Two bands: GPS L1 L2, Galileo E1 E5b, BeiDou B1I B3I, QZSS L1 L2, GLONASS G1 G2 (float).
    pub const L1L2: Self = Self { bands: [*b"12\0", *b"17\0", *b"26\0", *b"12\0", *b"12\0"] };

    /// Three bands: GPS L1 L2 L5, Galileo E1 E5b E5a, BeiDou B1I B3I B2I/B2b, QZSS L1 L2 L5, GLONASS G1 G2 (float).
    pub const L1L2L5: Self = Self { bands: [*b"125", *b"175", *b"267", *b"125", *b"12\0"] };

    /// This plan with other bands (RINEX digits, at most [`MAX_BANDS`]; others are ignored) for one constellation.
    pub fn with(mut self, constellation: Constellation, digits: &[u8]) -> Self {
        let bands = &mut self.bands[constellation.index()];
        *bands = [0; MAX_BANDS];
        for (band, &digit) in bands.iter_mut().zip(digits.iter().filter(|digit| digit.is_ascii_digit())) {
            *band = digit;
        }
        self
    }

    /// The bands of a constellation.
    pub fn bands(&self, constellation: Constellation) -> impl Iterator<Item = u8> + '_ {
        self.bands[constellation.index()].iter().copied().filter(|&digit| digit != 0)
    }

    /// Position of a band in its constellation's list.
    pub fn slot(&self, constellation: Constellation, band: u8) -> Option<usize> {
        self.bands(constellation).position(|digit| digit == band)
    }
}

/// Which ambiguities stay float where the whole set is not accepted. On real drives, fixed, wrong and rms 3-D of the fixed:
///
/// | | car, 1416 epochs | van at rest among trees | van among trees, one band |
/// |---|---|---|---|
/// | weakest (the default), elevation | 98.94 %, 0, 1.15 cm | 97.34 %, 0.18 %, 1.55 cm | 48.89 %, 0.18 %, 1.87 cm |
/// | weakest or elevation with [`Acceptance::assist`] | 98.94 %, 0, 1.15 cm | 97.34 %, 0.18 %, 1.54 cm | 49.18 %, 0.18 %, 1.85 cm |
/// | search (60), with assist | 99.01 %, 0.07 %, 2.18 cm | 97.34 %, 0.18 %, 1.54 cm | 49.18 %, 0.18 %, 1.85 cm |
/// | decorrelated | 99.15 %, 0.21 %, 2.76 cm | 97.34 %, 0.18 %, 1.55 cm | 48.46 %, 0.18 %, 1.87 cm |
///
/// On three static baselines all are the same. Choosing by what makes the success rate large lets integers through that the
/// tests cannot tell from right ones: search and decorrelated cost a few wrong epochs. Help has no such cost, but as a base
/// that moves the car's vectors have 1.16 cm with it and 1.15 cm without.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Partial {
    /// The least trusted eighth (not accepted before, low), again and again.
    #[default]
    Weakest,
    /// The least trusted satellites with all their bands, until the success rate suffices.
    Elevation,
    /// The satellites whose absence helps the success rate most.
    Search {
        /// Success rates that may be computed in an epoch.
        budget: u16,
    },
    /// Combinations of ambiguities: those fixed are the most certain of the decorrelated ones. No ambiguity is then known
    /// by itself, so that [`Output::DualDensity`] cannot use it, and that an epoch fixed so is unmonitored where faults are
    /// looked for.
    Decorrelated,
}

/// When integers are believed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Acceptance {
    /// Least bootstrapped success rate of the fixed set.
    pub success_rate: f64,
    /// Least ratio of the squared norms of second-best and best integers.
    pub ratio: f64,
    /// Least ratio where the integers agree with those accepted before and no slip intervened.
    pub ratio_confirmed: f64,
    /// Least success rate where the integers agree with those accepted before: they were proven then, and the data has
    /// not changed its mind.
    pub success_rate_confirmed: f64,
    /// Least number of ambiguities in a fixed set.
    pub min_ambiguities: usize,
    /// Satellites below this elevation `[rad]` are not fixed.
    pub elevation_mask: f64,
    /// Epochs of continuous lock before an ambiguity is fixed, unless none has more.
    pub min_lock: u32,
    /// What to leave out where not all are accepted.
    pub partial: Partial,
    /// Whether a part that is accepted helps the rest, as far as the product of all success rates reaches the threshold and
    /// the ratio of each as well. Of no use to [`Partial::Decorrelated`].
    pub assist: bool,
    /// Fewest satellites, besides the references, that [`Partial::Elevation`] and [`Partial::Search`] fix.
    pub min_satellites: usize,
}

impl Acceptance {
    /// The default, for a `static`.
    pub const DEFAULT: Self = Self {
        success_rate: 0.995,
        ratio: 2.5,
        ratio_confirmed: 1.5,
        success_rate_confirmed: 0.99,
        min_ambiguities: 4,
        elevation_mask: 12f64 * core::f64::consts::PI / 180.0,
        min_lock: 3,
        partial: Partial::Weakest,
        assist: false,
        min_satellites: 3,
    };
}

impl Default for Acceptance {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Slip detection and outlier rejection.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Screening {
    /// Normalised innovation beyond which an observation is an outlier.
    pub outlier: f64,
    /// Estimated jump of a phase `[cycles]` beyond which an outlier is a cycle slip.
    pub slip: f64,
    /// Jump of the geometry-free combination between epochs beyond which both bands slipped `[m]`.
    pub geometry_free: f64,
    /// Standard deviation of an ambiguity after a slip, and of a new one `[cycles]`.
    pub sigma_slip: f64,
    /// Random walk of an ambiguity that did not slip `[cycles/√s]`.
    pub sigma_stay: f64,
    /// Gap in a signal's observations beyond which it may have slipped `[s]` (or 1.5 epochs, if that is longer).
    pub max_gap: f64,
    /// Gap after which its ambiguity is forgotten `[s]`.
    pub forget: f64,
}

impl Screening {
    /// The default, for a `static`.
    pub const DEFAULT: Self = Self {
        outlier: 4.0,
        slip: 0.4,
        geometry_free: 0.05,
        sigma_slip: 100.0,
        sigma_stay: 1e-3,
        max_gap: 5.0,
        forget: 120.0,
    };
}

impl Default for Screening {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The choices that Greiff 2021 leaves open, as [`crate::filter::mixed_integer::Options`] has them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Estimation {
    /// How ranges are linearised in the position.
    pub rule: Rule,
    /// How rows update a density.
    pub form: Form,
    /// How slips are found that neither receiver, gap, Doppler nor a second band shows.
    pub detector: Detector,
    /// d, the slip estimate of [`Detector::Projection`] beyond which an ambiguity is taken to have jumped `[cycles]`.
    pub threshold: f64,
    /// What a fixed solution is.
    pub output: Output,
}

impl Estimation {
    /// The default, for a `static`, chosen on real drives:
    ///
    /// | car, 1416 epochs at 1 Hz, one band | fixed | wrong | rms 3-D |
    /// |---|---|---|---|
    /// | weighted, conditional (the default) | 98.94 % | 0 | 1.15 cm |
    /// | weighted, dual density | 98.94 % | 0 | 1.13 cm |
    /// | projection, conditional | 51.80 % | 0 | 1.21 cm |
    /// | projection, dual density | 51.80 % | 0 | 1.22 cm |
    ///
    /// The projection ignores that a car's position is predicted to a metre, and reopens what did not slip. The dual
    /// density is a little better where all integers are right, but remembers those that were not: on a van among trees
    /// (one band) 0.91 % of its fixed epochs are wrong instead of 0.18 %. Gauss–Hermite changes no figure of this
    /// table and costs 27 ranges a satellite.
    pub const DEFAULT: Self = Self {
        rule: Rule::Taylor,
        form: Form::Sequential,
        detector: Detector::Weighted,
        threshold: 1.0,
        output: Output::ConditionalFix,
    };
}

impl Default for Estimation {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// For what a ratio of variances is learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Scope {
    /// For each signal of each satellite.
    #[default]
    Channel,
    /// For all codes, and for all phases.
    Type,
}

/// Measurement noise that follows the data ([`crate::filter::adaptive`]).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Adaptation {
    /// Whether it does.
    pub enabled: bool,
    /// For what ratios are learned.
    pub scope: Scope,
    /// How fast.
    pub forgetting: Forgetting,
    /// Least and largest ratio of a variance to the configured one.
    pub bounds: [f64; 2],
    /// Epochs before what was learned is used.
    pub warm_up: u32,
}

impl Adaptation {
    /// The default, for a `static`: off; by channel, Sage–Husa with b = 0.97, never below what is configured.
    pub const DEFAULT: Self = Self {
        enabled: false,
        scope: Scope::Channel,
        forgetting: Forgetting::SageHusa { b: 0.97 },
        bounds: [1.0, 400.0],
        warm_up: 30,
    };
}

impl Default for Adaptation {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What a known length of the baseline is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum LengthUse {
    /// Integers whose vector has another length are refused.
    #[default]
    Validate,
    /// It is a measurement of the float density.
    Measure,
}

/// A baseline whose length is known, as that of two antennas on one vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct BaselineLength {
    /// Distance of the antennas `[m]`.
    pub length: f64,
    /// Its standard deviation `[m]`.
    pub sigma: f64,
    /// What for.
    #[cfg_attr(feature = "serde", serde(rename = "use"))]
    pub usage: LengthUse,
}

/// Configuration of an [`RtkFilter`](super::RtkFilter).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct RtkConfig {
    /// Which carriers.
    pub bands: BandPlan,
    /// How the rover moves.
    pub motion: Motion,
    /// Power spectral density of the motion's white noise, horizontal: `[m²/s³]` (velocity model) or `[m²/s⁵]`.
    pub motion_noise: f64,
    /// Satellites below this elevation are not used `[rad]`.
    pub elevation_mask: f64,
    /// Satellites with a C/N0 below this are not used `[dB-Hz]`.
    pub cn0_mask: f32,
    /// Noise of one code observation.
    pub code: Noise,
    /// Correlation time of code noise, mostly multipath `[s]`: a code that was used a moment ago brings little news.
    pub code_correlation: f64,
    /// Noise of one carrier-phase observation.
    pub phase: Noise,
    /// Noise of one Doppler observation as range rate, at the zenith `[m/s]`.
    pub doppler: f64,
    /// Decorrelation of the atmosphere, per kilometre of baseline: standard deviation of a phase at the zenith `[m/km]`.
    pub atmosphere: f64,
    /// Greatest age of base data `[s]`.
    pub max_age: f64,
    /// When integers are believed.
    pub acceptance: Acceptance,
    /// Slips and outliers.
    pub screening: Screening,
    /// Linearisation, slip detector, constrained density.
    pub estimation: Estimation,
    /// Whether the base moves: then it is where its own single point says, and the answer is the vector from it.
    pub moving_base: bool,
    /// Distance between the antennas, if that is known.
    pub baseline_length: Option<BaselineLength>,
    /// Measurement noise that follows the data.
    pub adaptation: Adaptation,
    /// Risk, rule and alert limits of protection levels.
    pub integrity: integrity::protection::Config,
}

impl RtkConfig {
    /// The default, for a `static`.
    pub const DEFAULT: Self = Self {
        bands: BandPlan::L1L2,
        motion: Motion::Velocity,
        motion_noise: 4.0,
        elevation_mask: 10f64 * core::f64::consts::PI / 180.0,
        cn0_mask: 0.0,
        code: Noise { constant: 0.3, elevation: 0.3 },
        code_correlation: 20.0,
        phase: Noise { constant: 0.002, elevation: 0.002 },
        doppler: 0.1,
        atmosphere: 5e-4,
        max_age: 30.0,
        acceptance: Acceptance::DEFAULT,
        screening: Screening::DEFAULT,
        estimation: Estimation::DEFAULT,
        moving_base: false,
        baseline_length: None,
        adaptation: Adaptation::DEFAULT,
        integrity: integrity::protection::Config::DEFAULT,
    };
}

impl Default for RtkConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_has_slots_in_order_of_preference() {
        let plan = BandPlan::EMPTY.with(Constellation::Galileo, b"15").with(Constellation::Gps, b"51x27");
        assert_eq!(plan.bands(Constellation::Gps).collect::<Vec<u8>>(), b"512");
        assert_eq!(plan.slot(Constellation::Gps, b'1'), Some(1));
        assert_eq!(plan.slot(Constellation::Gps, b'7'), None);
        assert_eq!(plan.slot(Constellation::Galileo, b'5'), Some(1));
        assert_eq!(BandPlan::EMPTY.slot(Constellation::Gps, 0), None);
        assert_eq!(plan.with(Constellation::Gps, b"").bands(Constellation::Gps).count(), 0);
    }
}
