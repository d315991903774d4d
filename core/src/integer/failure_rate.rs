//! The ratio test with a fixed failure rate.
//!
//! A fixed threshold of, say, 3 is too strict for strong models and too lax for weak ones. Here the threshold follows
//! from the failure rate that is tolerated, from the model's own failure rate P_f before any test, and from the
//! dimension n:
//! ```text
//! accept when ‖ǎ₁‖² / ‖ǎ₂‖² ≤ μ,   μ = e₁ P_f^e₂ + e₃, within [0, 1]
//! μ = 1 (no test needed) for P_f below what is tolerated,   μ = 0 (never accept) for P_f > 0.2
//! ```
//! Y. Hou, S. Verhagen & J. Wu, *An efficient implementation of fixed failure-rate ratio test for GNSS ambiguity
//! resolution*, Sensors 16 (2016) 945, eq. (9) and its table of coefficients (open access), fitted to simulations of
//! GNSS models and meant for the failure rate of integer least squares; the bootstrapped rate in its place makes the
//! test more careful. S. Verhagen & P. J. G. Teunissen, GPS Solutions 17 (2013) 535–548, for the idea.

use super::success_rate::Probability;

/// How often accepted integers may be wrong, counted over all epochs, accepted or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureRate {
    /// 0.1 %.
    PerMille,
    /// 1 %.
    Percent,
}

impl FailureRate {
    /// As a probability.
    pub const fn probability(self) -> f64 {
        match self {
            Self::PerMille => 1e-3,
            Self::Percent => 1e-2,
        }
    }

    /// Threshold R = 1/μ for the ratio ‖ǎ₂‖²/‖ǎ₁‖² of n ambiguities: 1 where no test is needed, ∞ where none may
    /// pass. Above n = 40 the row of 40 is used, which is on the careful side.
    pub fn ratio_threshold(self, model: Probability, n: usize) -> f64 {
        let table = match self {
            Self::PerMille => &PER_MILLE,
            Self::Percent => &PERCENT,
        };
        let Some([e1, e2, e3]) = n.min(table.len()).checked_sub(1).and_then(|row| table.get(row)) else {
            return f64::INFINITY;
        };
        if model.failure < self.probability() {
            return 1.0;
        }
        let mu = e1 * libm::pow(model.failure, *e2) + e3;
        if model.failure <= MAX_MODEL_FAILURE && mu > 0.0 { libm::fmax(1.0 / mu, 1.0) } else { f64::INFINITY }
    }
}

/// Models that fail more often than this are never accepted.
const MAX_MODEL_FAILURE: f64 = 0.2;

/// e₁, e₂, e₃ for n = 1…40 at 0.1 %.
#[rustfmt::skip]
#[allow(clippy::approx_constant)] // one happens to be near 1/√2
const PER_MILLE: [[f64; 3]; 40] = [
    [0.0549, -0.4626, -0.1968],
    [0.0507, -0.4739, -0.1450],
    [0.0838, -0.3960, -0.1556],
    [0.1343, -0.3225, -0.1755],
    [0.1946, -0.2672, -0.1980],
    [0.1876, -0.2651, -0.1429],
    [0.1645, -0.2750, -0.0755],
    [0.1751, -0.2605, -0.0404],
    [0.1229, -0.3011, 0.0634],
    [0.1133, -0.3065, 0.1151],
    [0.0938, -0.3238, 0.1795],
    [0.0636, -0.3737, 0.2505],
    [0.0630, -0.3670, 0.2833],
    [0.0522, -0.3879, 0.3263],
    [0.0512, -0.3843, 0.3543],
    [0.0498, -0.3824, 0.3789],
    [0.0483, -0.3801, 0.4054],
    [0.0489, -0.3726, 0.4257],
    [0.0492, -0.3659, 0.4450],
    [0.0454, -0.3699, 0.4690],
    [0.0443, -0.3689, 0.4880],
    [0.0419, -0.3721, 0.5072],
    [0.0347, -0.3933, 0.5322],
    [0.0321, -0.3999, 0.5500],
    [0.0318, -0.3958, 0.5613],
    [0.0273, -0.4144, 0.5805],
    [0.0261, -0.4147, 0.5928],
    [0.0242, -0.4219, 0.6072],
    [0.0226, -0.4288, 0.6193],
    [0.0208, -0.4348, 0.6309],
    [0.0172, -0.4602, 0.6431],
    [0.0189, -0.4421, 0.6524],
    [0.0212, -0.4206, 0.6574],
    [0.0197, -0.4278, 0.6673],
    [0.0206, -0.4178, 0.6716],
    [0.0174, -0.4399, 0.6852],
    [0.0182, -0.4294, 0.6901],
    [0.0161, -0.4431, 0.7004],
    [0.0132, -0.4681, 0.7071],
    [0.0137, -0.4613, 0.7155],
];

/// e₁, e₂, e₃ for n = 1…40 at 1 %.
#[rustfmt::skip]
const PERCENT: [[f64; 3]; 40] = [
    [0.0916, -0.5801, -0.2850],
    [0.1576, -0.4633, -0.3145],
    [0.2164, -0.3864, -0.2878],
    [0.3364, -0.2968, -0.3335],
    [0.4401, -0.2435, -0.3686],
    [0.3794, -0.2521, -0.2291],
    [0.2904, -0.2793, -0.0730],
    [0.2874, -0.2702, -0.0146],
    [0.1797, -0.3314, 0.1593],
    [0.1569, -0.3439, 0.2290],
    [0.1310, -0.3615, 0.2998],
    [0.0793, -0.4428, 0.3928],
    [0.0839, -0.4222, 0.4166],
    [0.0721, -0.4411, 0.4563],
    [0.0700, -0.4381, 0.4825],
    [0.0664, -0.4378, 0.5096],
    [0.0645, -0.4339, 0.5321],
    [0.0674, -0.4175, 0.5449],
    [0.0683, -0.4074, 0.5598],
    [0.0647, -0.4090, 0.5783],
    [0.0659, -0.3980, 0.5912],
    [0.0661, -0.3910, 0.6039],
    [0.0514, -0.4286, 0.6342],
    [0.0519, -0.4202, 0.6435],
    [0.0529, -0.4098, 0.6531],
    [0.0425, -0.4442, 0.6762],
    [0.0381, -0.4575, 0.6916],
    [0.0458, -0.4183, 0.6885],
    [0.0386, -0.4443, 0.7059],
    [0.0387, -0.4380, 0.7124],
    [0.0385, -0.4329, 0.7204],
    [0.0384, -0.4287, 0.7267],
    [0.0393, -0.4191, 0.7318],
    [0.0360, -0.4300, 0.7419],
    [0.0392, -0.4103, 0.7426],
    [0.0345, -0.4277, 0.7549],
    [0.0323, -0.4356, 0.7627],
    [0.0300, -0.4443, 0.7704],
    [0.0286, -0.4493, 0.7759],
    [0.0264, -0.4594, 0.7842],
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer::{Config, Workspace, resolve};
    use crate::linalg::{Mat, MatMut, cholesky, dot};
    use crate::stats::normal;

    fn model(failure: f64) -> Probability {
        Probability { success: 1.0 - failure, failure }
    }

    #[test]
    fn strong_models_pass_and_weak_ones_do_not() {
        for rate in [FailureRate::PerMille, FailureRate::Percent] {
            for n in 1..=64 {
                assert_eq!(rate.ratio_threshold(model(0.5 * rate.probability()), n), 1.0);
                assert_eq!(rate.ratio_threshold(model(0.3), n), f64::INFINITY);
                let mut last = 1.0;
                for step in 0..20 {
                    let failure = rate.probability() * (0.2 / rate.probability()).powf(f64::from(step) / 20.0);
                    let threshold = rate.ratio_threshold(model(failure), n);
                    assert!(threshold >= last, "threshold falls at n = {n}, failure {failure}");
                    last = threshold;
                }
            }
            assert_eq!(rate.ratio_threshold(model(0.01), 0), f64::INFINITY);
            assert_eq!(rate.ratio_threshold(model(f64::NAN), 5), f64::INFINITY);
        }
    }

    /// Simulation: 20 000 float vectors around 0 for double differences of short-baseline code and phase with three
    /// coordinates, of a strength that fails 7 and 2 per cent of the time. After the test, wrong fixes stay below the
    /// tolerated rate (within three standard deviations of counting): 23 and 207 for n = 5, 1 and 59 for n = 8.
    #[test]
    fn simulated_failures_stay_below_the_tolerated_rate() {
        let mut seed = 1u64;
        let mut uniform = move || {
            // SplitMix64 (Steele, Lea & Flood 2014).
            seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = (seed ^ (seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + f64::EPSILON / 4.0
        };
        for (n, sigma) in [(5, 0.08), (8, 0.3)] {
            // Line-of-sight differences of a regular sky; position variance from code, ambiguity in cycles of 0.19 m.
            let los: Vec<[f64; 3]> = (0..n)
                .map(|k| {
                    let (azimuth, elevation) = (2.4 * k as f64, 0.3 + 0.9 * (k as f64 / n as f64));
                    let flat = libm::cos(elevation);
                    [flat * libm::sin(azimuth), flat * libm::cos(azimuth), libm::sin(elevation) - 1.0]
                })
                .collect();
            let mut normal_matrix = [0.0; 9];
            for u in &los {
                for i in 0..3 {
                    for j in 0..3 {
                        normal_matrix[3 * i + j] += u[i] * u[j] / (sigma * sigma);
                    }
                }
            }
            cholesky::factor(&mut MatMut::square(&mut normal_matrix, 3).unwrap()).unwrap();
            let mut q = vec![0.0; n * n];
            for i in 0..n {
                let mut column = los[i];
                cholesky::solve(Mat::square(&normal_matrix, 3).unwrap(), &mut column).unwrap();
                for j in 0..n {
                    q[i * n + j] = dot(&column, &los[j]) / (0.19 * 0.19) + if i == j { 4e-3 } else { 2e-3 };
                }
            }
            let mut l = q.clone();
            cholesky::factor(&mut MatMut::square(&mut l, n).unwrap()).unwrap();
            let q = Mat::square(&q, n).unwrap();
            let mut workspace = Workspace::<f64, 8>::new();
            let runs = 20_000;
            let (mut wrong, mut accepted, mut accepted_wrong) = (0, [0; 2], [0; 2]);
            let rates = [FailureRate::PerMille, FailureRate::Percent];
            for _ in 0..runs {
                let e: Vec<f64> = (0..n).map(|_| normal::quantile(uniform())).collect();
                let a: Vec<f64> = (0..n).map(|i| dot(&l[i * n..=i * n + i], &e[..=i])).collect();
                let found = resolve(&a, q, &Config::default(), &mut workspace).unwrap();
                let is_wrong = found.best.iter().any(|&z| z != 0);
                wrong += u32::from(is_wrong);
                for (k, rate) in rates.iter().enumerate() {
                    if found.ratio >= rate.ratio_threshold(found.success_rate, n) {
                        accepted[k] += 1;
                        accepted_wrong[k] += u32::from(is_wrong);
                    }
                }
            }
            assert!(wrong > runs / 50 && wrong < runs / 5, "n = {n}: the model fails {wrong} times");
            for (k, rate) in rates.iter().enumerate() {
                let tolerated = rate.probability() * f64::from(runs);
                assert!(f64::from(accepted_wrong[k]) < tolerated + 3.0 * tolerated.sqrt(), "{n}: {accepted_wrong:?}");
                assert!(accepted[k] > runs / 10, "{n}: {accepted:?} accepted");
            }
        }
    }
}
