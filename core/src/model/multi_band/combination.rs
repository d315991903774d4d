//! Three carrier frequencies and linear combinations of signals on them.
//!
//! Cost: some multiplications, a square root where a length becomes 1. Panic contract: none.

use crate::gnss::SPEED_OF_LIGHT;
use crate::linalg::dot;
use crate::model::combination::FrequencyPair;

/// Number of bands.
pub const BANDS: usize = 3;

/// Coefficients of a linear combination of one kind of signal `[1]`, one for each band.
pub type Combination = [f64; BANDS];

/// The bands L1, L2 and L5 by their frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bands {
    wavelengths: [f64; BANDS],
    ratios: [f64; BANDS],
}

/// Sums of coefficients below this are rounding.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl Bands {
    /// From frequencies `[Hz]`; `None` unless all are positive and finite and the second and third differ from the first
    /// and from each other.
    pub fn new(frequencies: [f64; BANDS]) -> Option<Self> {
        let [f1, f2, f5] = frequencies;
        let ratio = |f: f64| Some(FrequencyPair::new(f1, f)?.ionosphere_ratio());
        FrequencyPair::new(f2, f5)?;
        Some(Self { wavelengths: frequencies.map(|f| SPEED_OF_LIGHT / f), ratios: [1.0, ratio(f2)?, ratio(f5)?] })
    }

    /// λ_b `[m]`.
    pub fn wavelengths(&self) -> [f64; BANDS] {
        self.wavelengths
    }

    /// Wavelength of a band `[m]`; 0 beyond the last.
    pub fn wavelength(&self, band: usize) -> f64 {
        self.wavelengths.get(band).copied().unwrap_or_default()
    }

    /// α_d = f_d²/f₁² of the second and third band `[1]`.
    pub fn alpha(&self) -> [f64; 2] {
        let [_, r2, r5] = self.ratios;
        [1.0 / r2, 1.0 / r5]
    }

    /// The bands themselves.
    pub fn raw(&self) -> [Combination; BANDS] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    }

    /// B: L1 and the two combinations g₁ − α_d g_d, free of the ionosphere (Definition 1).
    pub fn ionosphere_free(&self) -> [Combination; BANDS] {
        let [a2, a5] = self.alpha();
        [[1.0, 0.0, 0.0], [1.0, -a2, 0.0], [1.0, 0.0, -a5]]
    }

    /// ln |det B| of [`Bands::ionosphere_free`].
    pub fn ionosphere_free_log_determinant(&self) -> f64 {
        let [a2, a5] = self.alpha();
        libm::log(a2 * a5)
    }

    /// The bands from L1 and the two ionosphere-free combinations: B⁻¹.
    pub fn from_ionosphere_free(&self, [first, second, third]: [f64; BANDS]) -> [f64; BANDS] {
        let [_, r2, r5] = self.ratios;
        [first, r2 * (first - second), r5 * (first - third)]
    }

    /// An orthonormal basis of combinations: the mean (times √3), one without geometry, and one with neither geometry nor
    /// ionosphere. Signals without ambiguities say nothing of the states in the third.
    pub fn orthonormal(&self) -> [Combination; BANDS] {
        let unit = |c: Combination| {
            let length = libm::sqrt(dot(&c, &c));
            c.map(|c| c / length)
        };
        let mean = self.ratios.iter().sum::<f64>() / BANDS as f64;
        let [a1, a2, a3] = unit([1.0; BANDS]);
        let [b1, b2, b3] = unit(self.ratios.map(|r| r - mean));
        [[a1, a2, a3], [b1, b2, b3], [a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1]]
    }

    /// What a combination makes of the geometry `[1]`: the sum of its coefficients.
    pub fn geometry(&self, combination: &Combination) -> f64 {
        significant(combination.iter().sum())
    }

    /// What a combination makes of the ionospheric delay on L1 `[1]`.
    pub fn ionosphere(&self, combination: &Combination) -> f64 {
        significant(dot(combination, &self.ratios))
    }
}

/// The number, or zero if it is of the size of rounding of numbers around 1.
fn significant(value: f64) -> f64 {
    if value.abs() < ROUNDING { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The frequencies of the paper.
    fn bands() -> Bands {
        Bands::new([1575.42e6, 1227.6e6, 1176e6]).unwrap()
    }

    #[test]
    fn constants_of_the_paper() {
        let [a2, a5] = bands().alpha();
        // f₂²/f₁² = (60/77)², f₅²/f₁² by hand.
        assert!((a2 - (60.0_f64 / 77.0).powi(2)).abs() < 1e-15 && (a5 - (1176.0_f64 / 1575.42).powi(2)).abs() < 1e-15);
        assert!((bands().wavelength(0) - 0.190_293_672_798).abs() < 1e-12);
        assert_eq!(bands().wavelength(3), 0.0);
    }

    #[test]
    fn the_ionosphere_is_gone_where_it_should_be_and_geometry_is_scaled() {
        let bands = bands();
        let [first, second, third] = bands.ionosphere_free();
        assert_eq!([bands.geometry(&first), bands.ionosphere(&first)], [1.0, 1.0]);
        assert_eq!([bands.ionosphere(&second), bands.ionosphere(&third)], [0.0, 0.0]);
        assert!((bands.geometry(&second) - 0.3928).abs() < 5e-5 && (bands.geometry(&third) - 0.4428).abs() < 5e-5);
        let [mean, free, neither] = bands.orthonormal();
        assert_eq!(bands.geometry(&free), 0.0);
        assert_eq!([bands.geometry(&neither), bands.ionosphere(&neither)], [0.0, 0.0]);
        for (i, a) in [mean, free, neither].iter().enumerate() {
            for (j, b) in [mean, free, neither].iter().enumerate() {
                assert!((dot(a, b) - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn unusable_frequencies_are_refused() {
        for f in [[1e9, 1e9, 2e9], [1e9, 2e9, 2e9], [0.0, 1e9, 2e9], [1e9, f64::NAN, 2e9]] {
            assert_eq!(Bands::new(f), None);
        }
    }

    proptest! {
        #[test]
        fn bands_come_back_from_their_combinations(raw in proptest::array::uniform3(-1e6..1e6_f64)) {
            let combined = bands().ionosphere_free().map(|c| dot(&c, &raw));
            for (back, raw) in bands().from_ionosphere_free(combined).iter().zip(raw) {
                prop_assert!((back - raw).abs() < 1e-8);
            }
        }
    }
}
