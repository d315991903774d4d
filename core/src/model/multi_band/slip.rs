//! The slip detector, eqs. (19) and (20): n̄ = |(GᵀG)⁻¹Gᵀ(y − ŷ)| > ε.
//!
//! G = ∂h/∂n has entries in the phase rows alone, and those are square: the pseudo-inverse, weighted or not, gives the
//! innovation of each band's phase over its wavelength. The prediction contains the ambiguities as they were, hence a slip
//! between k − 1 and k appears in the innovation at k with its sign; it belongs to the transition k − 1 → k.
//!
//! Cost: one walk through a row for each ambiguity. Panic contract: none.

use super::combination::{BANDS, Bands};

/// Signed change `[cycles]` of the ambiguities of one difference on each band that would explain the innovations `[m]` of
/// its phases in L1 and both ionosphere-free combinations.
pub fn ambiguity_innovation(bands: &Bands, innovations: [f64; BANDS]) -> [f64; BANDS] {
    let [raw1, raw2, raw5] = bands.from_ionosphere_free(innovations);
    let [lambda1, lambda2, lambda5] = bands.wavelengths();
    [raw1 / lambda1, raw2 / lambda2, raw5 / lambda5]
}

#[cfg(test)]
mod tests {
    use super::super::tests::model;
    use super::*;
    use crate::model::multi_band::Signal;

    /// Integers added to the ambiguities come back from the rows that contain them.
    #[test]
    fn a_slip_is_found_with_its_size_and_sign() {
        let model = model(None);
        let slip = [3.0, -1.0, 7.0];
        let innovations = model.bands.ionosphere_free().map(|combination| {
            let mut innovation = 0.0;
            model.linear_entries(Signal::Phase, &combination, 1, &mut |state, coefficient| {
                if let Some(band) = (0..BANDS).find(|&band| model.layout().ambiguity(band, 1) == state) {
                    innovation += coefficient * slip[band];
                }
            });
            innovation
        });
        for (found, slip) in ambiguity_innovation(&model.bands, innovations).iter().zip(slip) {
            assert!((found - slip).abs() < 1e-12);
        }
    }
}
