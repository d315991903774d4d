//! Probabilities of fixing correctly, before the integers are known.
//!
//! With d_i the conditional variances of Q = Lᵀ D L, σ_i = √d_i, and Φ the normal distribution:
//!
//! | function | formula | for |
//! |---|---|---|
//! | [`bootstrapped`] | Π (2Φ(1/(2σ_i)) − 1) | bootstrapping in this order, exact; lower bound of ILS |
//! | [`rounding_lower`] | Π (2Φ(1/(2√q_ii)) − 1) | rounding, lower bound |
//! | [`adop`] | (Π σ_i)^(1/n) = det(Q)^(1/2n) | measure of precision [cycles], invariant under Z |
//! | [`adop_upper`] | (2Φ(1/(2 ADOP)) − 1)ⁿ | bootstrapping, upper bound; only an approximation for ILS |
//! | [`ils_upper`] | P(χ²_n ≤ c_n / ADOP²), c_n = ((n/2) Γ(n/2))^(2/n) / π | ILS, upper bound |
//! | [`ball_lower`] | P(χ²_n ≤ min ‖z‖²_Q / 4) over integer z ≠ 0 | ILS, lower bound |
//!
//! P. J. G. Teunissen, J. Geodesy 72 (1998) 606–612 and Artificial Satellites 33 (1998) 3–22; S. Verhagen, *The GNSS
//! integer ambiguities: estimation and validation* (2005), sec. 3.2 and 3.3; A. Hassibi & S. Boyd, IEEE Trans. Signal
//! Proc. 46 (1998) for the last two. Some papers call the ADOP expression a lower bound of ILS; it is not: for
//! diag(0.04, 0.0004, 0.09) it gives 1.000 where integer least squares succeeds in 0.894 of cases.
//!
//! Products are formed as Σ log1p(−failure), so that a failure rate of 1e-9 keeps its digits.

use crate::linalg::Mat;
use crate::real::Real;
use crate::stats::chi_square;

/// A probability together with its complement, both accurate when small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probability {
    /// Probability that it succeeds.
    pub success: f64,
    /// 1 − success.
    pub failure: f64,
}

impl Probability {
    /// From the logarithm of the success probability.
    fn from_log(log: f64) -> Self {
        Self { success: libm::exp(log), failure: -libm::expm1(log) }
    }
}

/// ln(2Φ(1/(2σ)) − 1) for variance σ² [cycles²].
pub(crate) fn log_success(variance: f64) -> f64 {
    let half_width = 0.5 / libm::sqrt(2.0 * variance);
    let failure = libm::erfc(half_width);
    if failure < 0.5 { libm::log1p(-failure) } else { libm::log(libm::erf(half_width)) }
}

/// Success rate of bootstrapping with these conditional variances [cycles²]. 1 for none, NaN where one is negative.
pub fn bootstrapped<T: Real>(variances: &[T]) -> Probability {
    Probability::from_log(variances.iter().map(|d| log_success(d.to_f64())).sum())
}

/// Lower bound for rounding each component of â by itself, from the diagonal of Q.
pub fn rounding_lower<T: Real>(q: Mat<'_, T>) -> Probability {
    Probability::from_log((0..q.rows().min(q.cols())).map(|i| log_success(q.at(i, i).to_f64())).sum())
}

/// Ambiguity dilution of precision [cycles] from conditional variances [cycles²]. 0 for none.
pub fn adop<T: Real>(variances: &[T]) -> f64 {
    if variances.is_empty() {
        return 0.0;
    }
    let log_determinant: f64 = variances.iter().map(|d| libm::log(d.to_f64())).sum();
    libm::exp(0.5 * log_determinant / variances.len() as f64)
}

/// Upper bound of the bootstrapped success rate, from ADOP [cycles] and dimension.
pub fn adop_upper(adop: f64, n: usize) -> Probability {
    Probability::from_log(n as f64 * log_success(adop * adop))
}

/// Upper bound of the success rate of integer least squares, from ADOP [cycles] and dimension.
pub fn ils_upper(adop: f64, n: usize) -> Probability {
    let half = 0.5 * n as f64;
    let c = libm::exp((libm::log(half) + libm::lgamma(half)) / half) / core::f64::consts::PI;
    from_chi_square(c / (adop * adop), n)
}

/// Lower bound of the success rate of integer least squares, from the smallest squared norm zᵀ Q⁻¹ z over integer
/// z ≠ 0 and the dimension.
pub fn ball_lower(shortest_squared_norm: f64, n: usize) -> Probability {
    from_chi_square(0.25 * shortest_squared_norm, n)
}

/// P(χ²_n ≤ x) and its complement.
fn from_chi_square(x: f64, n: usize) -> Probability {
    let degrees = u32::try_from(n).unwrap_or(u32::MAX);
    Probability { success: chi_square::cdf(x, degrees), failure: chi_square::survival(x, degrees) }
}
