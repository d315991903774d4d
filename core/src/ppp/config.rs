//! What can be told to the PPP engine. [`PppConfig::default`] is meant for every case.
//!
//! Variances of process noise are per second: a random walk of variance q `[m²/s]` has grown by √(q h) after h seconds.

use super::select::BandPairs;
use crate::gnss::atmosphere::mapping::MappingFunction;
use crate::gnss::atmosphere::troposphere::{TroposphereModel, ZenithModel};
use core::f64::consts::PI;

/// What is done about the ionosphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Ionosphere {
    /// Two bands are combined so that it drops out (Zhang 2020, eqs. 4 and 5).
    #[default]
    Free,
    /// Bands stay as they are, and the slant delay of each satellite is a state.
    Estimated,
}

/// How the receiver moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Motion {
    /// Position only, constant but for [`Process::position`] (Zhang 2020, eq. 2).
    #[default]
    Static,
    /// Position and velocity, driven by [`Process::acceleration`] (Zhang 2020, eq. 3).
    Kinematic,
}

/// Standard deviations of single observations, at the zenith; those of combinations follow.
///
/// Codes: σ² = (σ₀ · factor)² (1 + 1/sin² ε)/2, phases: σ² = (σ₀ · factor)²/sin² ε, ε the elevation. Both laws are what
/// EM finds on geodetic receivers under an open sky ([`Noise::DEFAULT`]).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Noise {
    /// Code of one band `[m]`.
    pub code: f64,
    /// Phase of one band `[m]`; satellite orbits and clocks are in it.
    pub phase: f64,
    /// Factor on both standard deviations, by
    /// [`Constellation::index`](crate::gnss::satellite::Constellation::index): GPS, Galileo, BeiDou, QZSS, GLONASS.
    pub code_factor: [f64; 5],
    /// The same for phases.
    pub phase_factor: [f64; 5],
    /// For how long errors last `[s]`, see [`Noise::lasting`]: it makes the standard deviations of a receiver at rest.
    pub time_constant: f64,
    /// The same for the weights of measurements against all that is known otherwise: shorter, as the slowest errors go with the
    /// troposphere and the ambiguities.
    pub weighting_time: f64,
}

impl Noise {
    /// The default. GLONASS codes carry biases that depend on the channel; BeiDou's orbits are less exact.
    pub const DEFAULT: Self = Self {
        code: 0.4,
        phase: 0.003,
        code_factor: [1.0, 1.0, 2.0, 1.5, 3.0],
        phase_factor: [1.0, 1.0, 1.5, 1.5, 1.2],
        time_constant: 480.0,
        weighting_time: 120.0,
    };

    /// By how much the variance of a measurement is larger as one of many of a receiver at rest, epochs `h` `[s]` apart.
    pub fn inflation(&self, h: f64) -> f64 {
        correlation(self.weighting_time, h)
    }

    /// By how much the variance of a mean of many of them, of a receiver at rest, is larger than if their errors were independent.
    pub fn lasting(&self, h: f64) -> f64 {
        correlation(self.time_constant, h)
    }

    /// What the density of a receiver at rest, of so many epochs `h` `[s]` apart, is to be multiplied by to have the variances of
    /// errors that last: the n measurements of a first-order autoregression have the information 1 + (n − 1)/f of one,
    /// those of the density n/f' with [`Noise::inflation`] f'.
    pub fn scale(&self, epochs: u32, h: f64) -> f64 {
        let (f, n) = (self.lasting(h), f64::from(epochs.max(1)));
        f / (f + n - 1.0) * n / self.inflation(h)
    }
}

/// f = (1 + ρ)/(1 − ρ) where errors of epochs h apart have the correlation ρ = exp(−h/τ), 1 where errors do not last: the mean of
/// n ≫ f epochs has the variance f σ²/n.
fn correlation(time_constant: f64, h: f64) -> f64 {
    let rho = libm::exp(-libm::fabs(h) / time_constant);
    // (NaN and ρ = 1 have no factor.)
    if rho < 1.0 { (1.0 + rho) / (1.0 - rho) } else { 1.0 }
}

impl Default for Noise {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Process noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Process {
    /// Random walk of each coordinate of a receiver at rest `[m²/s]`.
    pub position: f64,
    /// Spectral density of the acceleration of each coordinate of a moving one `[m²/s³]`.
    pub acceleration: f64,
    /// Random walk of the zenith wet delay `[m²/s]`.
    pub zenith: f64,
    /// Random walk of the gradients `[m²/s]`.
    pub gradients: f64,
    /// Random walk of inter-system biases `[m²/s]`.
    pub inter_system: f64,
    /// Random walk of ambiguities `[m²/s]`: what orbits and clocks do to them over hours.
    pub ambiguity: f64,
    /// Random walk of slant ionospheric delays `[m²/s]`.
    pub ionosphere: f64,
}

impl Process {
    /// The default: 1 m²/s³ for those who move; 5 mm/√h for the zenith wet delay, 0.7 mm/√h for gradients.
    pub const DEFAULT: Self = Self {
        position: 0.0,
        acceleration: 1.0,
        zenith: 0.005 * 0.005 / 3600.0,
        gradients: 0.0007 * 0.0007 / 3600.0,
        inter_system: 9e-12,
        ambiguity: 0.0,
        ionosphere: 0.02 * 0.02,
    };
}

impl Default for Process {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Standard deviations of states before they were observed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Prior {
    /// Each coordinate, about a single point `[m]`.
    pub position: f64,
    /// Each velocity `[m/s]`.
    pub velocity: f64,
    /// Receiver clock of each epoch, about the codes `[m]`.
    pub clock: f64,
    /// Inter-system bias, about the codes `[m]`.
    pub inter_system: f64,
    /// Zenith wet delay, about that of the weather model `[m]`.
    pub zenith: f64,
    /// Gradients `[m]`.
    pub gradients: f64,
    /// Ambiguity, about phase minus code `[m]`.
    pub ambiguity: f64,
    /// Slant ionospheric delay, about that by codes `[m]`.
    pub ionosphere: f64,
}

impl Prior {
    /// The default.
    pub const DEFAULT: Self = Self {
        position: 100.0,
        velocity: 10.0,
        clock: 100.0,
        inter_system: 100.0,
        zenith: 0.15,
        gradients: 0.001,
        ambiguity: 30.0,
        ionosphere: 30.0,
    };
}

impl Default for Prior {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// When lock of a phase counts as lost, and measurements as wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Screening {
    /// Geometry-free phases jump by more than this `[m]`.
    pub geometry_free: f64,
    /// Melbourne–Wübbena jumps by more than this many standard deviations of its noise, and
    pub melbourne_wubbena: f64,
    /// by more than this `[wide-lane cycles]`.
    pub wide_lane: f64,
    /// Longest gap of a satellite that an ambiguity survives `[s]`.
    pub gap: f64,
    /// Largest normalised innovation of a code.
    pub code: f64,
    /// Largest normalised innovation of a phase.
    pub phase: f64,
    /// A phase rejected in this many successive epochs has a new ambiguity.
    pub persistence: u8,
}

impl Screening {
    /// The default.
    pub const DEFAULT: Self = Self {
        geometry_free: 0.05,
        melbourne_wubbena: 5.0,
        wide_lane: 1.5,
        gap: 120.0,
        code: 4.0,
        phase: 5.0,
        persistence: 2,
    };
}

impl Default for Screening {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Everything that can be told.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct PppConfig {
    /// How the receiver moves.
    pub motion: Motion,
    /// Satellites below this elevation are not used `[rad]`.
    pub elevation_mask: f64,
    /// The two bands of each constellation.
    pub bands: BandPairs,
    /// What is done about the ionosphere.
    pub ionosphere: Ionosphere,
    /// Models of the troposphere.
    pub troposphere: TroposphereModel,
    /// Whether troposphere gradients are estimated.
    pub gradients: bool,
    /// Noise of observations.
    pub noise: Noise,
    /// Process noise.
    pub process: Process,
    /// States before they were observed.
    pub prior: Prior,
    /// Slips and outliers.
    pub screening: Screening,
    /// Whether the tides of the solid Earth, the pole and, where known, the ocean move the station. Off only for studies.
    pub tides: bool,
}

impl PppConfig {
    /// The default, for a `static`.
    pub const DEFAULT: Self = Self {
        motion: Motion::Static,
        elevation_mask: 5.0 * PI / 180.0,
        bands: BandPairs::DEFAULT,
        ionosphere: Ionosphere::Free,
        troposphere: TroposphereModel { zenith: ZenithModel::Gpt, mapping: MappingFunction::Gmf, humidity: 0.5 },
        gradients: true,
        noise: Noise::DEFAULT,
        process: Process::DEFAULT,
        prior: Prior::DEFAULT,
        screening: Screening::DEFAULT,
        tides: true,
    };
}

impl Default for PppConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_that_last_count_by_their_time_constant() {
        let noise = Noise::DEFAULT;
        // ρ = exp(−30/480) = 0.939 413: 1.939 413/0.060 587 = 32.0104; exp(−30/120) = 0.778 801: 1.778 801/0.221 199 = 8.04163.
        assert!((noise.lasting(30.0) - 32.0104).abs() < 1e-3);
        assert!((noise.inflation(30.0) - 8.04163).abs() < 1e-4);
        assert!((noise.inflation(1e6) - 1.0).abs() < 1e-12);
        assert_eq!(correlation(0.0, 30.0), 1.0);
        assert_eq!(noise.inflation(0.0), 1.0);
        // Of one epoch all is known, of many f σ²/n.
        assert!((noise.inflation(30.0) * noise.scale(1, 30.0) - 1.0).abs() < 1e-12);
        assert_eq!(noise.scale(0, 30.0), noise.scale(1, 30.0));
        assert!((noise.scale(u32::MAX, 30.0) - 32.0104 / 8.04163).abs() < 1e-4);
        assert_eq!(noise.scale(7, 0.0), 1.0);
    }

    /// The generalised least-squares variance of the mean of n AR(1) errors is (1 + ρ)/(n (1 − ρ) + 2 ρ): (1ᵀ C⁻¹ 1)⁻¹ by the
    /// tridiagonal inverse of C.
    #[test]
    fn the_mean_of_lasting_errors_has_the_variance_of_generalised_least_squares() {
        let noise = Noise::DEFAULT;
        let rho = f64::exp(-30.0 / 480.0);
        for n in [1u32, 2, 5, 40, 1000] {
            let expected = (1.0 + rho) / (f64::from(n) * (1.0 - rho) + 2.0 * rho);
            let computed = noise.inflation(30.0) / f64::from(n) * noise.scale(n, 30.0);
            assert!((computed / expected - 1.0).abs() < 1e-12, "{n}");
        }
    }

    #[test]
    fn the_default_walks_as_its_documentation_says() {
        let per_hour = |q: f64| (q * 3600.0).sqrt();
        assert!((per_hour(Process::DEFAULT.zenith) - 0.005).abs() < 1e-12);
        assert!((per_hour(Process::DEFAULT.gradients) - 0.0007).abs() < 1e-12);
    }
}
