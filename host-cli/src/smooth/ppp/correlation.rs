//! Errors that last: by how much the noise of single measurements understates what they do to an answer.
//!
//! Reflections and what orbits, clocks and the troposphere leave in a phase change over minutes, so that ten epochs say hardly
//! more than one. EM on white noise finds the right size of the errors, takes them for independent, and so makes the answer too
//! sure of itself by several times, and the motion too lively. With the autocorrelation ρ_k of the smoothed residuals,
//! normalised by their standard deviations, the mean of many measurements has the variance
//! ```text
//! f R / n,     f = 1 + 2 Σ ρ_k
//! ```
//! (G. E. P. Box, G. M. Jenkins & G. C. Reinsel, *Time Series Analysis*, 3rd ed. 1994, sec. 2.1.5). R is multiplied by f, one for
//! codes and one for phases, and the process noise is learned once more with it. Estimates of ambiguities take off the slowest
//! part, so that f is rather too small than too large. No panics; O(rows · lags).

use super::model::PppModel;
use super::tape::Kind;
use std::collections::BTreeMap;

/// Longest lag that is looked at, in epochs.
const LAGS: usize = 240;
/// The sum ends where the correlation falls below this.
const NEGLIGIBLE: f64 = 0.05;
/// f is at most this.
const MOST: f64 = 100.0;

/// f of codes and phases, from smoothed residuals of all rows `[m]`; NaN are left out. Lags go up to `lags`: where motion is
/// learned within a window, the position of an epoch is a mean over that, and errors that last longer move with it.
pub fn factors(model: &PppModel, residuals: &[f64], lags: usize) -> [f64; 2] {
    let tape = model.tape();
    // By kind and arc, or satellite and signal: epoch and normalised residual.
    let mut series: BTreeMap<(Kind, u64), Vec<(usize, f64)>> = BTreeMap::new();
    for (k, epoch) in tape.epochs.iter().enumerate() {
        for i in epoch.rows.clone() {
            let row = &tape.rows[i];
            let normalised = residuals[i] / model.noise.row(i).sqrt();
            if !normalised.is_finite() {
                continue;
            }
            let of = match row.kind {
                Kind::Phase => u64::from(row.arc),
                Kind::Code => {
                    let satellite =
                        row.satellite.constellation().index() as u64 * 64 + u64::from(row.satellite.number());
                    u64::from(row.group) << 32 | satellite
                }
            };
            series.entry((row.kind, of)).or_default().push((k, normalised));
        }
    }
    Kind::ALL.map(|kind| {
        let own = || series.iter().filter(|((of, _), _)| *of == kind).map(|(_, list)| list.as_slice());
        factor(own, lags.min(LAGS))
    })
}

/// f of series of epochs and values.
fn factor<'a, I: Iterator<Item = &'a [(usize, f64)]>>(series: impl Fn() -> I, lags: usize) -> f64 {
    let power: f64 = series().flatten().map(|(_, value)| value * value).sum();
    let count: usize = series().map(<[_]>::len).sum();
    if count == 0 || power <= 0.0 {
        return 1.0;
    }
    let variance = power / count as f64;
    let mut sum = 1.0;
    for lag in 1..=lags {
        let (mut products, mut pairs) = (0.0, 0usize);
        for list in series() {
            let mut later = list.iter().peekable();
            for &(k, value) in list {
                while later.next_if(|(other, _)| *other < k + lag).is_some() {}
                if let Some((other, next)) = later.peek()
                    && *other == k + lag
                {
                    products += value * next;
                    pairs += 1;
                }
            }
        }
        let correlation = if pairs > 0 { products / pairs as f64 / variance } else { 0.0 };
        if correlation < NEGLIGIBLE {
            break;
        }
        sum += 2.0 * correlation;
    }
    sum.clamp(1.0, MOST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::distr::Distribution;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// x_{k+1} = φ x_k + e: 1 + 2 Σ φ^k = (1 + φ)/(1 − φ), here to a tenth over 40 000 values; the sum is cut where φ^k < 0.05,
    /// which takes off 2 · 0.05/(1 − φ) at most.
    #[test]
    fn an_autoregression_has_the_factor_of_its_coefficient() {
        for phi in [0.0, 0.5, 0.9] {
            let mut random = ChaCha8Rng::seed_from_u64(7);
            let mut x = 0.0;
            let lists: Vec<Vec<(usize, f64)>> = (0..10)
                .map(|_| {
                    let step = |k| {
                        let e: f64 = StandardNormal.sample(&mut random);
                        x = phi * x + e;
                        (k, x)
                    };
                    (0..4000).map(step).collect()
                })
                .collect();
            let expected = (1.0 + phi) / (1.0 - phi);
            let found = factor(|| lists.iter().map(Vec::as_slice), LAGS);
            let cut = if phi > 0.0 { 0.1 / (1.0 - phi) } else { 0.0 };
            assert!(found > 0.9 * (expected - cut) && found < 1.1 * expected, "{phi}: {found} {expected}");
        }
    }

    #[test]
    fn gaps_are_no_neighbours_and_nothing_is_white() {
        let alternating: Vec<(usize, f64)> = (0..100).map(|k| (2 * k, 1.0)).collect();
        // Only even lags have pairs: the first lag has none, and ends the sum.
        assert_eq!(factor(|| std::iter::once(alternating.as_slice()), LAGS), 1.0);
        assert_eq!(factor(std::iter::empty, LAGS), 1.0);
        let constant: Vec<(usize, f64)> = (0..100).map(|k| (k, 1.0)).collect();
        assert!((factor(|| std::iter::once(constant.as_slice()), 5) - 11.0).abs() < 1e-12);
    }
}
