//! Fixing a part of the ambiguities.
//!
//! Two ways to choose the part:
//! * In the decorrelated space ([`resolve_partial`]): the conditional variances descend towards the last component,
//!   so the largest trailing set whose bootstrapped success rate reaches P₀ is fixed. P. J. G. Teunissen, P. Joosten
//!   & C. Tiberius, *Geometry-free ambiguity success rates in case of partial fixing*, ION NTM (1999). What is fixed
//!   are integer combinations Z₂ᵀ a, not single ambiguities.
//! * In the original space, by the caller (elevation, signal, age): [`select`] extracts â and Q of a subset for
//!   [`super::resolve()`].

use super::accept::{Decision, Thresholds};
use super::resolve::{Config, Fix, Method, Work, Workspace};
use super::success_rate::{self, Probability};
use super::{IntegerError, decorrelate};
use crate::linalg::{Mat, MatMut, dot, tail};
use crate::real::Real;

/// Integers for m ≤ n combinations of ambiguities.
#[derive(Clone, Copy, Debug)]
pub struct PartialResolution<'w, T> {
    /// The fixed combinations, rows of Z₂ᵀ (m × n).
    pub combinations: Mat<'w, i64>,
    /// Their integers Z₂ᵀ a `[cycles]` (m).
    pub values: &'w [i64],
    /// All n ambiguities given those integers `[cycles]`.
    pub conditional: &'w [T],
    /// Squared norm of the best candidate.
    pub best_norm: T,
    /// Squared norm of the second best; that of the best where there is none.
    pub second_norm: T,
    /// `second_norm / best_norm`; 1 where there is no second.
    pub ratio: T,
    /// Bootstrapped success rate of the m combinations.
    pub success_rate: Probability,
    /// ADOP of the m combinations `[cycles]`.
    pub adop: f64,
    /// Nodes the search visited.
    pub nodes: u32,
    /// How the integers were found.
    pub method: Method,
    /// Conditional variances D of the combinations (m): Z₂ᵀ Q Z₂ = U D Uᵀ.
    pub variances: &'w [T],
    /// U (m × m), upper unit triangular.
    pub factor: Mat<'w, T>,
    /// U⁻¹ (Z₂ᵀ â − ž) (m).
    pub residual: &'w [T],
}

impl<T: Real> PartialResolution<'_, T> {
    /// Whether these integers may be used as if known. An empty set is never accepted.
    pub fn decide(&self, thresholds: &Thresholds) -> Decision {
        if self.values.is_empty() {
            return Decision::LowSuccessRate;
        }
        thresholds.decide(self.success_rate, self.method, self.best_norm, self.second_norm)
    }
}

/// Index of the first component of the largest trailing set with success rate ≥ `min_success`; n for none.
pub fn first_to_fix<T: Real>(variances: &[T], min_success: f64) -> usize {
    let mut log = 0.0;
    let mut first = variances.len();
    for (i, variance) in variances.iter().enumerate().rev() {
        log += success_rate::log_success(variance.to_f64());
        if libm::exp(log) >= min_success {
            first = i;
        } else {
            break;
        }
    }
    first
}

/// Fixes the largest set of decorrelated ambiguities whose bootstrapped success rate is at least `min_success`.
///
/// The set may be empty: `values` is then empty too and `conditional` is â.
pub fn resolve_partial<'w, T: Real, const N: usize>(
    a: &[T],
    q: Mat<'_, T>,
    min_success: f64,
    config: &Config,
    workspace: &'w mut Workspace<T, N>,
) -> Result<PartialResolution<'w, T>, IntegerError> {
    resolve_partial_in(a, q, min_success, config, workspace.work(a.len())?)
}

fn resolve_partial_in<'w, T: Real>(
    a: &[T],
    q: Mat<'_, T>,
    min_success: f64,
    config: &Config,
    mut work: Work<'w, T>,
) -> Result<PartialResolution<'w, T>, IntegerError> {
    work.prepare(a, q)?;
    let n = a.len();
    let first = first_to_fix(work.variances, min_success);
    let fix = if first < n {
        work.fix_from(first, config.budget)?
    } else {
        let method = Method::LeastSquares;
        Fix { best_norm: T::ZERO, second_norm: T::ZERO, ratio: T::ONE, nodes: 0, method }
    };
    // ẑ given the fixed components: the others follow through U, a fixed one is its integer.
    let fixed_residual = tail(work.residual, first);
    for ((i, reduced), row) in work.reduced.iter_mut().enumerate().zip(work.factor.iter()) {
        *reduced = if i < first {
            *reduced - dot(tail(row, first), fixed_residual)
        } else {
            T::from_f64(work.candidates.at(0, i) as f64)
        };
    }
    decorrelate::back_transform(work.inverse.as_ref(), work.reduced, work.fraction)?;
    // Integers of the combinations of a, not of a − rint(a).
    for (value, row) in work.candidates.row_mut(0).iter_mut().zip(work.transform.iter()).skip(first) {
        for (&t, &base) in row.iter().zip(&*work.base) {
            let sum = t.checked_mul(base).and_then(|product| value.checked_add(product));
            *value = sum.ok_or(IntegerError::Overflow)?;
        }
    }
    for (a, &base) in work.fraction.iter_mut().zip(&*work.base) {
        *a += T::from_f64(base as f64);
    }
    let variances = tail(work.variances, first);
    let success_rate = success_rate::bootstrapped(variances);
    let adop = success_rate::adop(variances);
    let combinations = work.transform.into_ref().block(first, 0, n - first, n)?;
    let factor = work.factor.into_ref().block(first, first, n - first, n - first)?;
    Ok(PartialResolution {
        combinations,
        values: tail(work.candidates.into_ref().row(0), first),
        conditional: work.fraction,
        best_norm: fix.best_norm,
        second_norm: fix.second_norm,
        ratio: fix.ratio,
        success_rate,
        adop,
        nodes: fix.nodes,
        method: fix.method,
        variances,
        factor,
        residual: tail(work.residual, first),
    })
}

/// Copies the ambiguities `indices` of (`a`, `q`) into `sub_a` (m) and `sub_q` (m × m).
pub fn select<T: Real>(
    a: &[T],
    q: Mat<'_, T>,
    indices: &[usize],
    sub_a: &mut [T],
    sub_q: &mut MatMut<'_, T>,
) -> Result<(), IntegerError> {
    let (n, m) = (a.len(), indices.len());
    if [q.rows(), q.cols()] != [n; 2] || [sub_a.len(), sub_q.rows(), sub_q.cols()] != [m; 3] {
        return Err(IntegerError::Shape);
    }
    if indices.iter().any(|&i| i >= n) {
        return Err(IntegerError::Shape);
    }
    for (&row, (sub_a, sub_q)) in indices.iter().zip(sub_a.iter_mut().zip(sub_q.iter_mut())) {
        *sub_a = *a.get(row).ok_or(IntegerError::Shape)?;
        for (entry, &col) in sub_q.iter_mut().zip(indices) {
            *entry = q.at(row, col);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer::condition::condition_on_combinations;
    use crate::integer::resolve;
    use crate::linalg::block::update_block;
    use crate::linalg::spd;
    use proptest::prelude::*;

    #[test]
    fn the_largest_trailing_set() {
        // Success rates 0.683 (σ = ½) and 1 − 5.7e-7 (σ = 0.1).
        assert_eq!(first_to_fix(&[0.25, 0.01, 0.01], 0.99), 1);
        assert_eq!(first_to_fix(&[0.25, 0.01, 0.01], 0.5), 0);
        assert_eq!(first_to_fix(&[0.01, 0.01, 0.25], 0.99), 3);
        assert_eq!(first_to_fix(&[0.01], f64::NAN), 1);
        assert_eq!(first_to_fix::<f64>(&[], 0.0), 0);
    }

    proptest! {
        #[test]
        fn all_of_it_is_the_full_resolution((n, q) in spd::matrix(1..9usize), a in proptest::collection::vec(-1e4..1e4f64, 8)) {
            let q = Mat::square(&q, n).unwrap();
            let (mut first, mut second) = (Workspace::<f64, 8>::new(), Workspace::<f64, 8>::new());
            let full = resolve(&a[..n], q, &Config::default(), &mut first).unwrap();
            let partial = resolve_partial(&a[..n], q, 0.0, &Config::default(), &mut second).unwrap();
            prop_assert_eq!(partial.values.len(), n);
            for i in 0..n {
                let value: i64 = partial.combinations.row(i).iter().zip(full.best).map(|(t, z)| t * z).sum();
                prop_assert_eq!(value, partial.values[i]);
                prop_assert!((partial.conditional[i] - full.best[i] as f64).abs() < 1e-6);
            }
            prop_assert_eq!(partial.ratio, full.ratio);
            prop_assert_eq!(partial.success_rate, full.success_rate);
        }

        /// The conditional ambiguities are those of a noise-free measurement of the fixed combinations.
        #[test]
        fn the_rest_follows((n, q) in spd::matrix(2..9usize), a in proptest::collection::vec(-30.0..30.0f64, 8), p0 in 0.3..0.999f64) {
            let a = &a[..n];
            let largest = (0..n).map(|i| q[i * (n + 1)]).fold(0.0, f64::max);
            let q: Vec<f64> = q.iter().map(|q| q / largest).collect();
            let mut workspace = Workspace::<f64, 8>::new();
            let q_view = Mat::square(&q, n).unwrap();
            let found = resolve_partial(a, q_view, p0, &Config::default(), &mut workspace).unwrap();
            let m = found.values.len();
            prop_assert!(m == 0 || found.success_rate.success >= p0);
            let mut h = vec![0.0; m * n];
            let mut innovation = vec![0.0; m];
            for i in 0..m {
                let row = found.combinations.row(i);
                for (h, &t) in h[i * n..(i + 1) * n].iter_mut().zip(row) {
                    *h = t as f64;
                }
                innovation[i] = found.values[i] as f64 - dot(&h[i * n..(i + 1) * n], a);
            }
            let (mut mean, mut p) = (a.to_vec(), q.clone());
            update_block(
                &mut mean,
                &mut MatMut::square(&mut p, n).unwrap(),
                Mat::new(&h, m, n, n).unwrap(),
                &mut innovation,
                &mut MatMut::square(&mut vec![0.0; m * m], m).unwrap(),
                &mut MatMut::new(&mut vec![0.0; m * n], m, n, n).unwrap(),
            )
            .unwrap();
            for i in 0..n {
                prop_assert!((mean[i] - found.conditional[i]).abs() < 1e-6, "{} {}", mean[i], found.conditional[i]);
            }
            // And so is any part of the density that holds them.
            let (states, all): (Vec<usize>, Vec<usize>) = ((0..2).collect(), (0..n).collect());
            let (mut cross, mut part, mut block) = (vec![0.0; m * 2], [0.0; 2], [0.0; 4]);
            condition_on_combinations(
                a,
                q_view,
                &states,
                &all,
                &found,
                &mut MatMut::new(&mut cross, m, 2, 2).unwrap(),
                &mut part,
                &mut MatMut::square(&mut block, 2).unwrap(),
            )
            .unwrap();
            for i in 0..2 {
                prop_assert!((part[i] - mean[i]).abs() < 1e-6, "{} {}", part[i], mean[i]);
                for j in 0..2 {
                    prop_assert!((block[2 * i + j] - p[i * n + j]).abs() < 1e-9, "{} {}", block[2 * i + j], p[i * n + j]);
                }
            }
        }
    }

    /// σ = 0.1 and 5 cycles, uncorrelated: only the first can be fixed.
    #[test]
    fn the_weak_one_stays_float() {
        let q = [0.01, 0.0, 0.0, 25.0];
        let mut workspace = Workspace::<f64, 2>::new();
        let q = Mat::square(&q, 2).unwrap();
        let found = resolve_partial(&[7.02, 3.4], q, 0.99, &Config::default(), &mut workspace).unwrap();
        assert_eq!(found.values, [7]);
        assert_eq!(found.combinations.row(0), [1, 0]);
        assert_eq!(found.conditional, [7.0, 3.4]);
        assert_eq!(found.decide(&Thresholds::default()), Decision::Accepted);
        let none = resolve_partial(&[7.02, 3.4], q, 1.1, &Config::default(), &mut workspace).unwrap();
        assert!(none.values.is_empty());
        assert_eq!(none.conditional, [7.02, 3.4]);
        assert_eq!(none.decide(&Thresholds { success_rate: 0.0, ..Thresholds::default() }), Decision::LowSuccessRate);
    }

    #[test]
    fn subsets_are_extracted() {
        let q = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let q = Mat::square(&q, 3).unwrap();
        let (mut sub_a, mut sub_q) = ([0.0; 2], [0.0; 4]);
        let mut view = MatMut::square(&mut sub_q, 2).unwrap();
        select(&[0.1, 0.2, 0.3], q, &[2, 0], &mut sub_a, &mut view).unwrap();
        assert_eq!(select(&[0.1, 0.2, 0.3], q, &[3, 0], &mut sub_a, &mut view), Err(IntegerError::Shape));
        assert_eq!(select(&[0.1, 0.2, 0.3], q, &[0], &mut sub_a, &mut view), Err(IntegerError::Shape));
        assert_eq!((sub_a, sub_q), ([0.3, 0.1], [9.0, 7.0, 3.0, 1.0]));
    }
}
