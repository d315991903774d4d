//! Linear combinations of two signals of one satellite.
//!
//! With carrier frequencies f₁, f₂, phases L and codes P in metres (Hofmann-Wellenhof, Lichtenegger, Wasle, *GNSS* 2008,
//! 5.2; Melbourne 1985, Wübbena 1985):
//!
//! | combination | definition |
//! |---|---|
//! | ionosphere-free | α x₁ + β x₂, α = f₁²/(f₁² − f₂²), β = −f₂²/(f₁² − f₂²) |
//! | geometry-free | L₁ − L₂, P₂ − P₁: both show the ionosphere as ((f₁/f₂)² − 1) I₁ |
//! | wide lane, narrow lane | wavelengths c/(f₁ − f₂), c/(f₁ + f₂) |
//! | Melbourne–Wübbena | (f₁ L₁ − f₂ L₂)/(f₁ − f₂) − (f₁ P₁ + f₂ P₂)/(f₁ + f₂): phase minus code |
//!
//! Signs: a slip of +1 cycle on L₁ raises Melbourne–Wübbena by one wide-lane cycle and the geometry-free phase by λ₁.
//!
//! Panic contract: none.

use crate::gnss::SPEED_OF_LIGHT;

/// Two different carrier frequencies, f₁ > 0 and f₂ > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrequencyPair {
    f1: f64,
    f2: f64,
}

impl FrequencyPair {
    /// From two frequencies `[Hz]`; `None` unless both are positive and finite and they differ.
    pub fn new(f1: f64, f2: f64) -> Option<Self> {
        let usable = |f: f64| f.is_finite() && f > 0.0;
        (usable(f1) && usable(f2) && f1 != f2).then_some(Self { f1, f2 })
    }

    /// Both wavelengths λ = c/f `[m]`.
    pub fn wavelengths(&self) -> [f64; 2] {
        [SPEED_OF_LIGHT / self.f1, SPEED_OF_LIGHT / self.f2]
    }

    /// Wide-lane wavelength c/(f₁ − f₂) `[m]`; negative if f₁ < f₂.
    pub fn wide_lane_wavelength(&self) -> f64 {
        SPEED_OF_LIGHT / (self.f1 - self.f2)
    }

    /// Narrow-lane wavelength c/(f₁ + f₂) `[m]`.
    pub fn narrow_lane_wavelength(&self) -> f64 {
        SPEED_OF_LIGHT / (self.f1 + self.f2)
    }

    /// Ratio of the ionospheric delays on f₂ and f₁: (f₁/f₂)².
    pub fn ionosphere_ratio(&self) -> f64 {
        let ratio = self.f1 / self.f2;
        ratio * ratio
    }

    /// Ionosphere-free coefficients `[α, β]`, α + β = 1.
    pub fn ionosphere_free_coefficients(&self) -> [f64; 2] {
        let (f1, f2) = (self.f1 * self.f1, self.f2 * self.f2);
        [f1 / (f1 - f2), -f2 / (f1 - f2)]
    }

    /// Standard deviation of the ionosphere-free combination of two independent measurements of standard deviation 1.
    pub fn ionosphere_free_noise(&self) -> f64 {
        let [alpha, beta] = self.ionosphere_free_coefficients();
        libm::sqrt(alpha * alpha + beta * beta)
    }

    /// Ionosphere-free combination of two codes or two phases `[m]`.
    pub fn ionosphere_free(&self, x: [f64; 2]) -> f64 {
        let [alpha, beta] = self.ionosphere_free_coefficients();
        alpha * x[0] + beta * x[1]
    }

    /// Geometry-free combination of two phases `[cycles]`, in metres: λ₁ φ₁ − λ₂ φ₂.
    pub fn geometry_free(&self, cycles: [f64; 2]) -> f64 {
        let [m1, m2] = self.metres(cycles);
        m1 - m2
    }

    /// Geometry-free combination of two codes `[m]`: P₂ − P₁, the ionosphere with the sign that it has in the phases'.
    pub fn geometry_free_code(&self, codes: [f64; 2]) -> f64 {
        codes[1] - codes[0]
    }

    /// Melbourne–Wübbena combination of two phases `[cycles]` and two codes `[m]`, in metres.
    pub fn melbourne_wubbena(&self, cycles: [f64; 2], codes: [f64; 2]) -> f64 {
        let (f1, f2) = (self.f1, self.f2);
        let [l1, l2] = self.metres(cycles);
        (f1 * l1 - f2 * l2) / (f1 - f2) - (f1 * codes[0] + f2 * codes[1]) / (f1 + f2)
    }

    /// Melbourne–Wübbena combination in wide-lane cycles: the wide-lane ambiguity, biases and noise included.
    pub fn melbourne_wubbena_cycles(&self, cycles: [f64; 2], codes: [f64; 2]) -> f64 {
        self.melbourne_wubbena(cycles, codes) / self.wide_lane_wavelength()
    }

    /// Two phases from cycles to metres.
    pub fn metres(&self, cycles: [f64; 2]) -> [f64; 2] {
        let [lambda1, lambda2] = self.wavelengths();
        [cycles[0] * lambda1, cycles[1] * lambda2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn gps() -> FrequencyPair {
        FrequencyPair::new(1_575.42e6, 1_227.60e6).unwrap()
    }

    #[test]
    fn gps_coefficients_are_the_published_ones() {
        // Hofmann-Wellenhof et al. 2008, 5.2: wide lane 86.2 cm, narrow lane 10.7 cm; IF coefficients 2.546, −1.546.
        let [alpha, beta] = gps().ionosphere_free_coefficients();
        assert!((alpha - 2.546).abs() < 5e-4 && (beta + 1.546).abs() < 5e-4);
        assert!((gps().wide_lane_wavelength() - 0.862).abs() < 5e-4);
        assert!((gps().narrow_lane_wavelength() - 0.107).abs() < 5e-4);
        assert!((gps().ionosphere_free_noise() - 2.978).abs() < 5e-4);
        assert!((gps().ionosphere_ratio() - (77.0 / 60.0_f64).powi(2)).abs() < 1e-14); // IS-GPS-200N 20.3.3.3.3.2
    }

    #[test]
    fn equal_or_absurd_frequencies_are_refused() {
        for (f1, f2) in [(1e9, 1e9), (0.0, 1e9), (1e9, -1.0), (f64::NAN, 1e9), (1e9, f64::INFINITY)] {
            assert_eq!(FrequencyPair::new(f1, f2), None);
        }
    }

    proptest! {
        /// Phase and code of range ρ, ionosphere I and integers N: each combination sees only what it should.
        #[test]
        fn each_combination_removes_what_it_is_for(
            range in 2e7..4e7_f64, iono in 0.0..50.0_f64, n1 in -1000_i32..1000, n2 in -1000_i32..1000,
        ) {
            let pair = gps();
            let [lambda1, lambda2] = pair.wavelengths();
            let ratio = pair.ionosphere_ratio();
            let codes = [range + iono, range + ratio * iono];
            let (n1, n2) = (f64::from(n1), f64::from(n2));
            let cycles = [(range - iono) / lambda1 + n1, (range - ratio * iono) / lambda2 + n2];
            prop_assert!((pair.ionosphere_free(codes) - range).abs() < 1e-6);
            prop_assert!((pair.melbourne_wubbena_cycles(cycles, codes) - (n1 - n2)).abs() < 1e-5);
            let geometry_free = (ratio - 1.0) * iono + lambda1 * n1 - lambda2 * n2;
            prop_assert!((pair.geometry_free(cycles) - geometry_free).abs() < 1e-6);
            prop_assert!((pair.geometry_free_code(codes) - (ratio - 1.0) * iono).abs() < 1e-6);
        }
    }
}
