//! Askne and Nordius' zenith wet delay, from the vapour pressure at the ground and how it falls off with height.
//!
//! Source: J. Askne, H. Nordius, *Estimation of tropospheric delay for microwaves from surface weather data*, Radio Sci. 22
//! (1987), equation (20): ΔL = 1e-6 (k₂' + k₃/T_m) R_d/((λ + 1) g_m) e, with the constants that TU Wien's GPT2 and GPT3
//! go with: k₁ = 77.604, k₂ = 64.79 K/hPa, k₃ = 377600 K²/hPa, k₂' = k₂ − k₁ M_w/M_d. Panic contract: none.

/// k₂' `[K/hPa]`, with molar masses of water 18.0152 and of dry air 28.9644.
const K2_PRIME: f64 = 64.79 - 77.604 * 18.0152 / 28.9644;
/// k₃ `[K²/hPa]`.
const K3: f64 = 377_600.0;
/// Mean gravity g_m `[m/s²]`.
pub(super) const GRAVITY: f64 = 9.80665;
/// Molar mass of dry air `[kg/mol]`.
pub(super) const MOLAR_MASS: f64 = 28.965e-3;
/// Gas constant `[J/(mol K)]`.
pub(super) const GAS: f64 = 8.3143;

/// Zenith wet delay `[m]` of `vapour_pressure` e `[hPa]`, water vapour `decrease` factor λ and weighted
/// `mean_temperature` T_m `[K]`.
pub fn wet(vapour_pressure: f64, decrease: f64, mean_temperature: f64) -> f64 {
    1e-6 * (K2_PRIME + K3 / mean_temperature) * (GAS / MOLAR_MASS) / (decrease + 1.0) / GRAVITY * vapour_pressure
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_tu_wien() {
        // Test case in the header of TU Wien's asknewet.m: 10.9621 hPa, 273.8720 K, 2.8071 give 0.1176 m.
        assert!((wet(10.9621, 2.8071, 273.872) - 0.1176).abs() < 5e-5);
    }
}
