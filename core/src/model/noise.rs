//! How noisy an undifferenced observation is: by elevation, by C/N0, by age of the base data and by baseline.
//!
//! Variance of one observation of one receiver
//!
//! ```text
//! σ² = (a² + b²/sin²E) · max(1, 10^((C₀ − C)/10))
//! ```
//!
//! with elevation E `[rad]` and C/N0 C `[dB-Hz]`. The first factor is the usual elevation law (RTKLIB manual, E.6.7;
//! Hofmann-Wellenhof et al. 2008, 5.95), the second the thermal-noise law of tracking loops (Langley 1997) above a
//! reference C₀ from which on C/N0 no longer improves matters.
//! Panic contract: none; a C/N0 that is not finite counts as not recorded.

/// Noise of one kind of observation (code, or carrier phase in metres).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Noise {
    /// Constant part a `[m]`.
    pub constant: f64,
    /// Elevation-dependent part b `[m]`.
    pub elevation: f64,
}

/// C/N0 above which it is no longer taken as a sign of quality `[dB-Hz]`.
pub const CN0_REFERENCE: f64 = 45.0;

impl Noise {
    /// Variance `[m²]` at an elevation given by its sine, for a C/N0 `[dB-Hz]` where recorded.
    pub fn variance(&self, sin_elevation: f64, cn0: Option<f32>) -> f64 {
        // Below 3° the law is not meant to be used; the bound keeps it finite.
        let sine = if sin_elevation > 0.05 { sin_elevation } else { 0.05 };
        let by_elevation = self.constant * self.constant + self.elevation * self.elevation / (sine * sine);
        by_elevation * cn0_factor(cn0)
    }
}

fn cn0_factor(cn0: Option<f32>) -> f64 {
    match cn0 {
        Some(cn0) if cn0.is_finite() && f64::from(cn0) < CN0_REFERENCE => {
            let deficit = CN0_REFERENCE - f64::from(cn0).max(15.0);
            libm::pow(10.0, deficit / 10.0)
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PHASE: Noise = Noise { constant: 0.003, elevation: 0.003 };

    #[test]
    fn the_zenith_has_both_parts_and_low_satellites_more() {
        assert!((PHASE.variance(1.0, None) - 18e-6).abs() < 1e-18);
        assert!((PHASE.variance(0.5, None) - (9e-6 + 36e-6)).abs() < 1e-18);
    }

    #[test]
    fn ten_decibels_are_a_factor_of_ten_in_variance() {
        let good = PHASE.variance(1.0, Some(50.0));
        assert_eq!(good, PHASE.variance(1.0, Some(45.0)));
        assert!((PHASE.variance(1.0, Some(35.0)) / good - 10.0).abs() < 1e-12);
        assert_eq!(PHASE.variance(1.0, Some(f32::NAN)), good);
    }
}
