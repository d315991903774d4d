//! How far measurements and models are trusted.
//!
//! The defaults were set on nine data sets under an open sky (geodetic and u-blox receivers, 2005–2024, quiet and active
//! ionosphere). Mean normalised error eᵀ Σ⁻¹ e / 3 of positions, 1 being right: 0.9–1.04 in Wettzell and Nagoya, 0.4–0.7
//! in Saitama and Fujisawa, where the broadcast ionosphere was applied; below 0.35 without it, as its bound is made for an
//! active Sun. Velocities of receivers at rest: 0.04–0.4 (9–40 mm/s rms), left cautious for receivers that move. Code
//! residuals alone scatter by a third of their σ: most of it is the ionosphere, which all satellites share; a fault
//! smaller than about 20 m on one satellite therefore passes. Between high buildings (Hong Kong) errors are up to five
//! times the formal ones. Panic contract: never panics.

use super::position::Delays;
use super::rows::Row;

/// Standard deviations of code and Doppler, and of the models that code is corrected with.
///
/// σ² = floor² + (elevation / sin ε)² + (cn0 · 10^((45 − C/N0)/20))² + signal-in-space² + ionosphere² + troposphere².
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Noise {
    /// Code, whatever elevation and C/N0 `[m]`.
    pub code: f64,
    /// Code multipath at the zenith, growing with 1/sin ε `[m]`.
    pub code_elevation: f64,
    /// Code at 45 dB-Hz, tenfold 20 dB below `[m]`.
    pub code_cn0: f64,
    /// Broadcast orbit and clock, as a part of the accuracy that the satellite claims.
    pub claimed_accuracy: f64,
    /// Residual of the modelled ionosphere, as a part of the correction.
    pub ionosphere: f64,
    /// Ionosphere at the zenith where it is not modelled `[m]`.
    pub ionosphere_unmodelled: f64,
    /// Residual of the troposphere at the zenith, growing with 1/sin ε `[m]`.
    pub troposphere: f64,
    /// Doppler, whatever elevation and C/N0 `[m/s]`.
    pub doppler: f64,
    /// Doppler at 45 dB-Hz, tenfold 20 dB below `[m/s]`.
    pub doppler_cn0: f64,
}

impl Noise {
    /// The default.
    pub const DEFAULT: Self = Self {
        code: 0.3,
        code_elevation: 0.3,
        code_cn0: 0.5,
        claimed_accuracy: 0.5,
        ionosphere: 0.5,
        ionosphere_unmodelled: 4.0,
        troposphere: 0.2,
        doppler: 0.02,
        doppler_cn0: 0.02,
    };

    /// Variance of a row's code at `elevation` `[rad]`, with the delays that were modelled `[m²]`.
    pub fn code_variance(&self, row: &Row, elevation: f64, delays: Delays) -> f64 {
        let slant = 1.0 / libm::sin(elevation.max(0.05));
        // Through a shell at 350 km, the ionosphere's obliquity stays below 3.
        let ionosphere = match delays.ionosphere {
            Some(delay) => self.ionosphere * delay,
            None => self.ionosphere_unmodelled * slant.min(3.0),
        };
        let terms = [
            self.code,
            self.code_elevation * slant,
            self.code_cn0 * cn0_factor(row.cn0),
            self.claimed_accuracy * row.accuracy,
            ionosphere,
            self.troposphere * slant,
        ];
        terms.iter().map(|sigma| sigma * sigma).sum()
    }

    /// Variance of a row's code while elevation and delays are unknown `[m²]`: as if at 15°.
    pub fn coarse_code_variance(&self, row: &Row) -> f64 {
        self.code_variance(row, 15f64.to_radians(), Delays::default())
    }

    /// Variance of a row's Doppler, as a rate `[m²/s²]`.
    pub fn doppler_variance(&self, row: &Row, elevation: f64) -> f64 {
        let slant = 1.0 / libm::sin(elevation.max(0.05));
        let terms = [self.doppler * slant, self.doppler_cn0 * cn0_factor(row.cn0)];
        terms.iter().map(|sigma| sigma * sigma).sum()
    }
}

impl Default for Noise {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// 10^((45 − C/N0)/20), C/N0 held within 10…60 dB-Hz; 1 where it is not known.
fn cn0_factor(cn0: Option<f32>) -> f64 {
    cn0.filter(|cn0| !cn0.is_nan()).map_or(1.0, |cn0| libm::pow(10.0, (45.0 - f64::from(cn0.clamp(10.0, 60.0))) / 20.0))
}
