//! Probabilities of fixing correctly, before the integers are known.
//!
//! With d_i the conditional variances of Q = Lᵀ D L, σ_i = √d_i, Φ the normal distribution, λ the eigenvalues of Q, IR
//! rounding, IB bootstrapping and ILS integer least squares:
//!
//! | function | formula | for |
//! |---|---|---|
//! | [`rounding_lower`] | Π (2Φ(1/(2√q_ii)) − 1) | IR, lower bound |
//! | [`rounding_upper`] | min_i 2Φ(1/(2√q_ii)) − 1 | IR, upper bound |
//! | [`bootstrapped`] | Π (2Φ(1/(2σ_i)) − 1) | IB in this order, exact; lower bound of ILS |
//! | [`adop`] | (Π σ_i)^(1/n) = det(Q)^(1/2n) | measure of precision `[cycles]`, invariant under Z |
//! | [`adop_upper`] | (2Φ(1/(2 ADOP)) − 1)ⁿ | IB in any order and after any Z, upper bound; only an approximation for ILS |
//! | [`ils_upper`] | P(χ²_n ≤ c_n / ADOP²), c_n = ((n/2) Γ(n/2))^(2/n) / π | ILS, upper bound |
//! | [`ball_lower`] | P(χ²_n ≤ min ‖z‖²_Q / 4) over integer z ≠ 0 | ILS, lower bound |
//! | [`eigenvalue_lower`], [`eigenvalue_upper`] | (2Φ(1/(2√λ)) − 1)ⁿ with λ_max, λ_min | ILS; useless unless Q is decorrelated |
//! | [`slab_upper`] | Π (2Φ(1/(2σ_{v_i∣V})) − 1), v_i = u_iᵀ Q⁻¹ â / ‖u_i‖²_Q | ILS, upper bound from n short integer vectors u_i |
//!
//! P. J. G. Teunissen, J. Geodesy 72 (1998) 606–612 and Artificial Satellites 33 (1998) 3–22; S. Verhagen, *The GNSS
//! integer ambiguities: estimation and validation* (2005), sec. 3.2 and 3.3; A. Hassibi & S. Boyd, IEEE Trans. Signal
//! Proc. 46 (1998) for the bounds by χ². The table that gathers them in L. Wang et al. (2022) has two errors. It calls
//! the ADOP expression a lower bound of ILS; for diag(0.04, 0.0004, 0.09) that is 1.000 where ILS succeeds in 0.893 of
//! cases. And it bounds ILS from above by the conditional variances of â, which give the bootstrapped rate, a lower
//! bound; the upper bound is that of [`slab_upper`]: the pull-in region of ILS lies in each slab |v_i| ≤ ½, the
//! probability of lying in all of them is the rate of rounding v, and bootstrapping v succeeds more often than that.
//!
//! Products are formed as Σ log1p(−failure), so that a failure rate of 1e-9 keeps its digits.

use super::IntegerError;
use crate::linalg::{Mat, MatMut, cholesky, dot, ldl, scale, triangular};
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
    /// That both of two independent ones succeed.
    pub fn and(self, other: Self) -> Self {
        let failure = self.failure + other.failure - self.failure * other.failure;
        Self { success: self.success * other.success, failure }
    }

    /// From the logarithm of the success probability.
    fn from_log(log: f64) -> Self {
        Self { success: libm::exp(log), failure: -libm::expm1(log) }
    }
}

/// ln(2Φ(1/(2σ)) − 1) for variance σ² `[cycles²]`.
pub(crate) fn log_success(variance: f64) -> f64 {
    let half_width = 0.5 / libm::sqrt(2.0 * variance);
    let failure = libm::erfc(half_width);
    if failure < 0.5 { libm::log1p(-failure) } else { libm::log(libm::erf(half_width)) }
}

/// Success rate of bootstrapping with these conditional variances `[cycles²]`. 1 for none, NaN where one is negative.
pub fn bootstrapped<T: Real>(variances: &[T]) -> Probability {
    Probability::from_log(variances.iter().map(|d| log_success(d.to_f64())).sum())
}

/// Lower bound for rounding each component of â by itself, from the diagonal of Q.
pub fn rounding_lower<T: Real>(q: Mat<'_, T>) -> Probability {
    Probability::from_log((0..q.rows().min(q.cols())).map(|i| log_success(q.at(i, i).to_f64())).sum())
}

/// Upper bound for rounding each component of â by itself, from the diagonal of Q.
pub fn rounding_upper<T: Real>(q: Mat<'_, T>) -> Probability {
    let logs = (0..q.rows().min(q.cols())).map(|i| log_success(q.at(i, i).to_f64()));
    // NaN, from a negative variance, stays NaN.
    Probability::from_log(logs.fold(0.0, |least, log| if log >= least || least.is_nan() { least } else { log }))
}

/// Ambiguity dilution of precision `[cycles]` from conditional variances `[cycles²]`. 0 for none.
pub fn adop<T: Real>(variances: &[T]) -> f64 {
    if variances.is_empty() {
        return 0.0;
    }
    let log_determinant: f64 = variances.iter().map(|d| libm::log(d.to_f64())).sum();
    libm::exp(0.5 * log_determinant / variances.len() as f64)
}

/// Upper bound of the bootstrapped success rate, from ADOP `[cycles]` and dimension.
pub fn adop_upper(adop: f64, n: usize) -> Probability {
    Probability::from_log(n as f64 * log_success(adop * adop))
}

/// Upper bound of the success rate of integer least squares, from ADOP `[cycles]` and dimension.
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

/// Lower bound of the success rate of integer least squares, from the largest eigenvalue of Q `[cycles²]`.
pub fn eigenvalue_lower(largest: f64, n: usize) -> Probability {
    Probability::from_log(n as f64 * log_success(largest))
}

/// Upper bound of the success rate of integer least squares, from the smallest eigenvalue of Q `[cycles²]`.
pub fn eigenvalue_upper(smallest: f64, n: usize) -> Probability {
    Probability::from_log(n as f64 * log_success(smallest))
}

/// Upper bound of the success rate of integer least squares from m linearly independent integer vectors u_i, the rows of
/// `vectors` (m × n): the shorter in the metric of Q, the closer the bound. Unit vectors are short once Q is decorrelated.
/// The last row is conditioned on first.
///
/// `factor` (n × n), `rows` (m × n), `gram` (m × m) and `variances` (m) are workspace.
pub fn slab_upper<T: Real>(
    q: Mat<'_, T>,
    vectors: Mat<'_, i64>,
    factor: &mut MatMut<'_, T>,
    rows: &mut MatMut<'_, T>,
    gram: &mut MatMut<'_, T>,
    variances: &mut [T],
) -> Result<Probability, IntegerError> {
    let (n, m) = (q.rows(), vectors.rows());
    let fits = [q.cols(), vectors.cols(), factor.rows(), factor.cols(), rows.cols()] == [n; 5]
        && [rows.rows(), gram.rows(), gram.cols(), variances.len()] == [m; 4];
    if !fits {
        return Err(IntegerError::Shape);
    }
    factor.copy_from(q)?;
    cholesky::factor(factor)?;
    // w_i = L⁻¹ u_i / ‖L⁻¹ u_i‖², so that w_iᵀ w_j is the covariance of v_i and v_j.
    for (row, vector) in rows.iter_mut().zip(vectors.iter()) {
        for (entry, &u) in row.iter_mut().zip(vector) {
            *entry = T::from_f64(u as f64);
        }
        triangular::forward(factor.as_ref(), row)?;
        let norm = dot(row, row);
        scale(row, T::ONE / norm);
    }
    for (entries, row) in gram.iter_mut().zip(rows.iter()) {
        for (entry, other) in entries.iter_mut().zip(rows.iter()) {
            *entry = dot(row, other);
        }
    }
    ldl::factor_ltdl(gram, variances)?;
    Ok(bootstrapped(variances))
}

/// P(χ²_n ≤ x) and its complement.
fn from_chi_square(x: f64, n: usize) -> Probability {
    let degrees = u32::try_from(n).unwrap_or(u32::MAX);
    Probability { success: chi_square::cdf(x, degrees), failure: chi_square::survival(x, degrees) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slabs(q: Mat<'_, f64>, vectors: Mat<'_, i64>) -> Result<Probability, IntegerError> {
        let (n, m) = (q.rows(), vectors.rows());
        slab_upper(
            q,
            vectors,
            &mut MatMut::square(&mut vec![0.0; n * n], n)?,
            &mut MatMut::new(&mut vec![0.0; m * n], m, n, n)?,
            &mut MatMut::square(&mut vec![0.0; m * m], m)?,
            &mut vec![0.0; m],
        )
    }

    /// In one dimension the slab of u = 1 is the pull-in region itself; for u = 2 it is |â| ≤ 1, 2Φ(2) − 1 for σ = ½.
    #[test]
    fn slabs_by_hand() {
        let q = [0.25];
        let q = Mat::square(&q, 1).unwrap();
        let with = |u: &[i64]| slabs(q, Mat::new(u, u.len(), 1, 1).unwrap());
        assert!((with(&[1]).unwrap().success - 0.682_689_492_137_086).abs() < 1e-14);
        assert!((with(&[2]).unwrap().success - 0.954_499_736_103_642).abs() < 1e-14);
        assert!(matches!(with(&[1, 1]), Err(IntegerError::NotPositiveDefinite { .. })));
        assert!(matches!(with(&[0]), Err(IntegerError::NotPositiveDefinite { .. })));
        assert_eq!(with(&[]).unwrap().success, 1.0);
        let indefinite = [-1.0];
        let one = [1];
        let refused = slabs(Mat::square(&indefinite, 1).unwrap(), Mat::square(&one, 1).unwrap());
        assert!(matches!(refused, Err(IntegerError::NotPositiveDefinite { .. })));
    }

    /// One ambiguity of 0.1 and of 0.5 cycles: 2Φ(5) − 1 and 2Φ(1) − 1 (tables of Φ); failure 2Q(5).
    #[test]
    fn by_table() {
        let strong = bootstrapped(&[0.01]);
        assert!((strong.failure / 5.733_031_437_583_87e-7 - 1.0).abs() < 1e-12);
        assert!((bootstrapped(&[0.25f32]).success - 0.682_689_492_137_086).abs() < 1e-14);
        let two = bootstrapped(&[0.01, 0.01]);
        assert!((two.failure / (2.0 * strong.failure - strong.failure * strong.failure) - 1.0).abs() < 1e-12);
        assert!((adop(&[0.04, 0.09]) - (0.2f64 * 0.3).sqrt()).abs() < 1e-15);
    }

    /// For diag(0.04, 0.0004, 0.09) the components are independent, so that ILS is rounding and its success rate the
    /// product of the single rates, 0.8932; the ADOP expression says 1.000 and is no lower bound.
    #[test]
    fn adop_is_no_lower_bound_of_least_squares() {
        let variances = [0.04, 0.0004, 0.09];
        let exact = bootstrapped(&variances).success;
        let adop = adop(&variances);
        assert!((exact - 0.8932).abs() < 5e-5, "{exact}");
        assert!(adop_upper(adop, 3).success > 0.9995);
        assert!(ils_upper(adop, 3).success >= exact);
        assert!(ball_lower(1.0 / 0.09, 3).success <= exact);
    }

    #[test]
    fn edges() {
        let none: [f64; 0] = [];
        assert_eq!(bootstrapped(&none), Probability { success: 1.0, failure: 0.0 });
        assert_eq!(adop(&none), 0.0);
        assert_eq!(bootstrapped(&[0.0]).failure, 0.0);
        let negative = [-1.0, 0.0, 0.0, 0.01];
        assert!(rounding_upper(Mat::square(&negative, 2).unwrap()).success.is_nan());
        assert!(bootstrapped(&[-1.0]).success.is_nan() && bootstrapped(&[f64::NAN]).success.is_nan());
        assert!(bootstrapped(&[1e12]).success < 1e-6);
    }

    proptest! {
        #[test]
        fn the_bounds_are_ordered(variances in proptest::collection::vec(1e-4..1.0f64, 1..12)) {
            let n = variances.len();
            let exact = bootstrapped(&variances);
            let adop = adop(&variances);
            prop_assert!(adop_upper(adop, n).success >= exact.success - 1e-12);
            prop_assert!(ils_upper(adop, n).success >= exact.success - 1e-12);
            let largest = variances.iter().fold(0.0, |a: f64, &b| a.max(b));
            prop_assert!(ball_lower(1.0 / largest, n).success <= exact.success + 1e-12);
            prop_assert!((exact.success + exact.failure - 1.0).abs() < 1e-14);
        }

        /// For independent ambiguities rounding, bootstrapping and least squares are the same, and unit vectors give the
        /// slabs that bound their region: all these bounds are attained.
        #[test]
        fn independent_ambiguities_attain_the_bounds(variances in proptest::collection::vec(1e-3..1.0f64, 1..8)) {
            let n = variances.len();
            let mut q = vec![0.0; n * n];
            let mut unit = vec![0; n * n];
            for (i, &variance) in variances.iter().enumerate() {
                q[i * (n + 1)] = variance;
                unit[i * (n + 1)] = 1;
            }
            let exact = bootstrapped(&variances).success;
            let q = Mat::square(&q, n).unwrap();
            let slabs = slabs(q, Mat::square(&unit, n).unwrap()).unwrap().success;
            prop_assert!((slabs - exact).abs() < 1e-12);
            prop_assert!((rounding_lower(q).success - exact).abs() < 1e-12);
            prop_assert!(rounding_upper(q).success >= exact);
            let (smallest, largest) = variances.iter().fold((1.0f64, 0.0f64), |(a, b), &d| (a.min(d), b.max(d)));
            prop_assert!(eigenvalue_lower(largest, n).success <= exact + 1e-12);
            prop_assert!(eigenvalue_upper(smallest, n).success >= exact - 1e-12);
        }
    }
}
