//! All of integer estimation in one call.
//!
//! [`resolve`] takes â and Q, returns the two nearest integer vectors with their norms, the bootstrapped success
//! rate, ADOP, and how the integers came about. Whether to believe them is for [`super::accept`].
//!
//! Memory: a [`Workspace`] of capacity N has 3 N² + 13 N numbers of 8 bytes (f64), 16 KB for N = 24; it is `const`
//! constructible and belongs into a `static` or the filter's own state. Stack: below 1 KB.

use super::decorrelate::{self, to_integer};
use super::search::{self, Level, Search};
use super::success_rate::{self, Probability};
use super::{IntegerError, bootstrap};
use crate::linalg::{Mat, MatMut, around_mut, dot, tail, tail_mut};
use crate::real::Real;

/// Q may differ from Qᵀ by this fraction of √(q_ii q_jj): it may come from a text file.
const MAX_ASYMMETRY: f64 = 1e-3;

/// Ambiguities from here on are refused `[cycles]`: on L1 these are 190 000 km, farther than any satellite is.
const MAX_AMBIGUITY: f64 = 1e9;

/// Ambiguities that the scalar rounds by more than this are refused `[cycles]`: of 1e6 cycles an `f32` knows no fraction.
const MAX_ROUNDING: f64 = 0.01;

/// How far to search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Nodes a search may visit before it gives up for bootstrapping.
    pub budget: u32,
}

impl Config {
    /// The default, for a `static`.
    pub const DEFAULT: Self = Self { budget: search::DEFAULT_BUDGET };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// How integers were found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Integer least squares, proven.
    LeastSquares,
    /// Bootstrapping after decorrelation, because the search exhausted its budget. There is no second candidate.
    Bootstrapped,
}

/// Integers for all ambiguities.
#[derive(Clone, Copy, Debug)]
pub struct Resolution<'w, T> {
    /// The nearest integer vector `[cycles]`.
    pub best: &'w [i64],
    /// The second nearest; equal to `best` where there is none, see [`Method::Bootstrapped`].
    pub second: &'w [i64],
    /// Squared norm of `best`.
    pub best_norm: T,
    /// Squared norm of `second`; that of `best` where there is none.
    pub second_norm: T,
    /// `second_norm / best_norm`, at least 1; exactly 1 where there is no second, so that no ratio test passes.
    pub ratio: T,
    /// Success rate of bootstrapping after decorrelation, a lower bound for integer least squares.
    pub success_rate: Probability,
    /// Ambiguity dilution of precision `[cycles]`.
    pub adop: f64,
    /// Nodes the search visited.
    pub nodes: u32,
    /// How the integers were found.
    pub method: Method,
    /// Conditional variances D of the decorrelated ambiguities, in the order of bootstrapping reversed.
    pub variances: &'w [T],
}

/// Memory for up to N ambiguities.
#[derive(Debug)]
pub struct Workspace<T, const N: usize> {
    /// Q, then U.
    factor: [[T; N]; N],
    /// Zᵀ.
    transform: [[i64; N]; N],
    /// Z⁻¹.
    inverse: [[i64; N]; N],
    variances: [T; N],
    /// rint(â).
    base: [i64; N],
    /// â − rint(â); later the float ambiguities given the fixed ones.
    fraction: [T; N],
    /// Zᵀ (â − rint(â)).
    reduced: [T; N],
    residual: [T; N],
    levels: [Level<T>; N],
    /// The two best ž.
    candidates: [[i64; N]; 2],
    /// The two best ǎ.
    fixed: [[i64; N]; 2],
}

impl<T: Real, const N: usize> Default for Workspace<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const N: usize> Workspace<T, N> {
    /// An empty workspace.
    pub const fn new() -> Self {
        Self {
            factor: [[T::ZERO; N]; N],
            transform: [[0; N]; N],
            inverse: [[0; N]; N],
            variances: [T::ZERO; N],
            base: [0; N],
            fraction: [T::ZERO; N],
            reduced: [T::ZERO; N],
            residual: [T::ZERO; N],
            levels: [Level::ZERO; N],
            candidates: [[0; N]; 2],
            fixed: [[0; N]; 2],
        }
    }

    /// The n-dimensional part of it.
    pub(super) fn work(&mut self, n: usize) -> Result<Work<'_, T>, IntegerError> {
        if n > N {
            return Err(IntegerError::Capacity);
        }
        if n == 0 {
            return Err(IntegerError::Shape);
        }
        Ok(Work {
            factor: MatMut::new(self.factor.as_flattened_mut(), n, n, N)?,
            transform: MatMut::new(self.transform.as_flattened_mut(), n, n, N)?,
            inverse: MatMut::new(self.inverse.as_flattened_mut(), n, n, N)?,
            variances: &mut self.variances[..n],
            base: &mut self.base[..n],
            fraction: &mut self.fraction[..n],
            reduced: &mut self.reduced[..n],
            residual: &mut self.residual[..n],
            levels: &mut self.levels[..n],
            candidates: MatMut::new(self.candidates.as_flattened_mut(), 2, n, N)?,
            fixed: MatMut::new(self.fixed.as_flattened_mut(), 2, n, N)?,
        })
    }
}

/// A workspace cut to the dimension of one problem; code on it is compiled once for every N.
pub(super) struct Work<'w, T> {
    pub factor: MatMut<'w, T>,
    pub transform: MatMut<'w, i64>,
    pub inverse: MatMut<'w, i64>,
    pub variances: &'w mut [T],
    pub base: &'w mut [i64],
    pub fraction: &'w mut [T],
    pub reduced: &'w mut [T],
    pub residual: &'w mut [T],
    pub levels: &'w mut [Level<T>],
    pub candidates: MatMut<'w, i64>,
    pub fixed: MatMut<'w, i64>,
}

/// What fixing a set of transformed ambiguities gave; vectors stay in the workspace.
pub(super) struct Fix<T> {
    pub best_norm: T,
    pub second_norm: T,
    pub ratio: T,
    pub nodes: u32,
    pub method: Method,
}

impl<T: Real> Work<'_, T> {
    /// Checks â and Q, splits off rint(â), symmetrises, decorrelates and transforms.
    pub fn prepare(&mut self, a: &[T], q: Mat<'_, T>) -> Result<(), IntegerError> {
        let n = self.base.len();
        if a.len() != n || q.rows() != n || q.cols() != n {
            return Err(IntegerError::Shape);
        }
        if !a.iter().chain(q.iter().flatten()).all(|x| x.is_finite()) {
            return Err(IntegerError::NotFinite);
        }
        let limit = MAX_AMBIGUITY.min(MAX_ROUNDING / T::EPSILON.to_f64());
        for (&a, (base, fraction)) in a.iter().zip(self.base.iter_mut().zip(self.fraction.iter_mut())) {
            if a.abs().to_f64() >= limit {
                return Err(IntegerError::Overflow);
            }
            let integer = a.round();
            *base = to_integer(integer)?;
            *fraction = a - integer;
        }
        check_symmetry(q)?;
        self.factor.copy_from(q)?;
        self.factor.symmetrize();
        decorrelate::decorrelate(&mut self.factor, self.variances, &mut self.transform, &mut self.inverse)?;
        decorrelate::transform(self.transform.as_ref(), self.fraction, self.reduced)
    }

    /// Fixes the transformed ambiguities `first`… in `candidates` and leaves their residuals in `residual`.
    pub fn fix_from(&mut self, first: usize, budget: u32) -> Result<Fix<T>, IntegerError> {
        let n = self.base.len();
        let m = n - first;
        let factor = self.factor.as_ref().block(first, first, m, m)?;
        let (reduced, variances) = (tail(self.reduced, first), tail(self.variances, first));
        let residual = tail_mut(self.residual, first);
        let mut candidates = self.candidates.block_mut(0, first, 2, m)?;
        let mut norms = [T::ZERO; 2];
        let levels = tail_mut(self.levels, first);
        match search::search(reduced, factor, variances, budget, &mut candidates, &mut norms, levels, residual)? {
            Search::Complete { nodes } => {
                // Residuals along the best candidate, which the search has since left.
                for (i, (&reduced, &integer)) in reduced.iter().zip(candidates.row(0)).enumerate().rev() {
                    let (_, residual, later) = around_mut(residual, i)?;
                    let conditional = reduced - dot(tail(factor.row(i), i + 1), later);
                    *residual = conditional - T::from_f64(integer as f64);
                }
                let [best_norm, second_norm] = norms;
                Ok(Fix { best_norm, second_norm, ratio: second_norm / best_norm, nodes, method: Method::LeastSquares })
            }
            Search::Exhausted { nodes } => {
                let norm = bootstrap::bootstrap(reduced, factor, variances, candidates.row_mut(0), residual)?;
                let (second, best) = candidates.row_pair(1, 0);
                second.iter_mut().zip(best).for_each(|(second, &best)| *second = best);
                let method = Method::Bootstrapped;
                Ok(Fix { best_norm: norm, second_norm: norm, ratio: T::ONE, nodes, method })
            }
        }
    }
}

/// Whether Q differs from Qᵀ by no more than a text file would make it.
fn check_symmetry<T: Real>(q: Mat<'_, T>) -> Result<(), IntegerError> {
    for (i, row) in q.iter().enumerate() {
        for (j, &entry) in row.iter().enumerate().take(i) {
            let difference = (entry - q.at(j, i)).abs();
            let scale = |i| q.at(i, i).abs().sqrt();
            if difference > T::ZERO && difference > T::from_f64(MAX_ASYMMETRY) * scale(i) * scale(j) {
                return Err(IntegerError::Asymmetric { row: i });
            }
        }
    }
    Ok(())
}

/// Resolves all ambiguities `a` `[cycles]` with covariance `q` `[cycles²]`.
pub fn resolve<'w, T: Real, const N: usize>(
    a: &[T],
    q: Mat<'_, T>,
    config: &Config,
    workspace: &'w mut Workspace<T, N>,
) -> Result<Resolution<'w, T>, IntegerError> {
    resolve_in(a, q, config, workspace.work(a.len())?)
}

fn resolve_in<'w, T: Real>(
    a: &[T],
    q: Mat<'_, T>,
    config: &Config,
    mut work: Work<'w, T>,
) -> Result<Resolution<'w, T>, IntegerError> {
    work.prepare(a, q)?;
    let fix = work.fix_from(0, config.budget)?;
    for candidate in 0..2 {
        let fixed = work.fixed.row_mut(candidate);
        fixed.iter_mut().zip(&*work.base).for_each(|(fixed, &base)| *fixed = base);
        decorrelate::back_transform_integers(work.inverse.as_ref(), work.candidates.row(candidate), fixed)?;
    }
    let fixed = work.fixed.into_ref();
    Ok(Resolution {
        best: fixed.row(0),
        second: fixed.row(1),
        best_norm: fix.best_norm,
        second_norm: fix.second_norm,
        ratio: fix.ratio,
        success_rate: success_rate::bootstrapped(work.variances),
        adop: success_rate::adop(work.variances),
        nodes: fix.nodes,
        method: fix.method,
        variances: work.variances,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{ldl, spd};
    use proptest::prelude::*;

    fn solve<const N: usize>(a: &[f64], q: &[f64], budget: u32, workspace: &mut Workspace<f64, N>) -> (Vec<i64>, f64) {
        let found = resolve(a, Mat::square(q, a.len()).unwrap(), &Config { budget }, workspace).unwrap();
        (found.best.to_vec(), found.best_norm)
    }

    /// P. de Jonge & C. Tiberius, LGR 12 (1996), sec. 4: the three-dimensional example.
    const TEXTBOOK: [f64; 9] = [6.290, 5.978, 0.544, 5.978, 6.292, 2.340, 0.544, 2.340, 6.288];

    #[test]
    fn textbook_example() {
        let mut workspace = Workspace::<f64, 4>::new();
        let q = Mat::square(&TEXTBOOK, 3).unwrap();
        let found = resolve(&[5.45, 3.10, 2.97], q, &Config::default(), &mut workspace).unwrap();
        assert_eq!(found.best, [5, 3, 4]);
        assert_eq!(found.second, [6, 4, 4]);
        assert!((found.best_norm - 0.218_331).abs() < 1e-5);
        assert!((found.second_norm - 0.307_273).abs() < 1e-5);
        assert_eq!(found.method, Method::LeastSquares);
    }

    #[test]
    fn textbook_example_in_single_precision_far_from_zero() {
        let q = TEXTBOOK.map(|q| q as f32);
        let mut workspace = Workspace::<f32, 3>::new();
        let q = Mat::square(&q, 3).unwrap();
        let found = resolve(&[1005.45, 3.10, -497.03], q, &Config::default(), &mut workspace).unwrap();
        assert_eq!(found.best, [1005, 3, -496]);
        assert!((found.best_norm - 0.2183).abs() < 1e-3);
    }

    #[test]
    fn an_exhausted_search_falls_back_and_says_so() {
        let mut workspace = Workspace::<f64, 3>::new();
        let q = Mat::square(&TEXTBOOK, 3).unwrap();
        let found = resolve(&[5.45, 3.10, 2.97], q, &Config { budget: 3 }, &mut workspace).unwrap();
        assert_eq!(found.method, Method::Bootstrapped);
        assert_eq!((found.nodes, found.ratio), (3, 1.0));
        assert_eq!(found.best, found.second);
        assert_eq!(found.best_norm, found.second_norm);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let refuse = |a: &[f64], q: &[f64]| {
            let mut workspace = Workspace::<f64, 2>::new();
            let q = Mat::square(q, a.len()).unwrap();
            resolve(a, q, &Config::default(), &mut workspace).map(|_| ()).unwrap_err()
        };
        let one = [1.0, 0.0, 0.0, 1.0];
        assert_eq!(refuse(&[], &[]), IntegerError::Shape);
        assert_eq!(refuse(&[0.0; 3], &[0.0; 9]), IntegerError::Capacity);
        assert_eq!(refuse(&[f64::NAN, 0.0], &one), IntegerError::NotFinite);
        assert_eq!(refuse(&[f64::INFINITY, 0.0], &one), IntegerError::NotFinite);
        for large in [1e300, 1e9, -1e9] {
            assert_eq!(refuse(&[large, 0.0], &one), IntegerError::Overflow);
        }
        let mut small = Workspace::<f32, 1>::new();
        let single = resolve(&[1e6], Mat::square(&[1.0], 1).unwrap(), &Config::default(), &mut small);
        assert_eq!(single.map(|_| ()), Err(IntegerError::Overflow));
        assert_eq!(refuse(&[0.0, 0.0], &[1.0, f64::NAN, 0.0, 1.0]), IntegerError::NotFinite);
        assert_eq!(refuse(&[0.0, 0.0], &[1.0, 0.5, 0.1, 1.0]), IntegerError::Asymmetric { row: 1 });
        assert_eq!(refuse(&[0.0, 0.0], &[1.0, 0.0, 0.0, 0.0]), IntegerError::NotPositiveDefinite { pivot: 1 });
        assert_eq!(refuse(&[0.0, 0.0], &[1.0, 1.0, 1.0, 1.0]), IntegerError::NotPositiveDefinite { pivot: 0 });
        assert_eq!(refuse(&[0.0, 0.0], &[-1.0, 0.0, 0.0, 1.0]), IntegerError::NotPositiveDefinite { pivot: 0 });
        let mut workspace = Workspace::<f64, 2>::new();
        let wide = Mat::new(&one, 1, 2, 2).unwrap();
        let error = resolve(&[0.0], wide, &Config::default(), &mut workspace).map(|_| ());
        assert_eq!(error, Err(IntegerError::Shape));
    }

    #[test]
    fn the_workspace_is_as_large_as_documented() {
        assert_eq!(size_of::<Workspace<f64, 24>>(), 8 * (3 * 24 * 24 + 13 * 24));
    }

    /// A refusal leaves nothing behind: the next call answers as the first one would have.
    #[test]
    fn a_refusal_leaves_nothing_behind() {
        let mut workspace = Workspace::<f64, 3>::new();
        let expected = solve(&[5.45, 3.10, 2.97], &TEXTBOOK, 100, &mut workspace);
        let mut singular = TEXTBOOK;
        singular[8] = 0.0;
        for (a, q) in [([1e9, 0.0, 0.0], TEXTBOOK), ([0.0, 0.0, f64::NAN], TEXTBOOK), ([0.0; 3], singular)] {
            assert!(resolve(&a, Mat::square(&q, 3).unwrap(), &Config::default(), &mut workspace).is_err());
            assert_eq!(solve(&[5.45, 3.10, 2.97], &TEXTBOOK, 100, &mut workspace), expected);
        }
    }

    /// Rounding in a text file makes Q asymmetric in its last digit; that is accepted.
    #[test]
    fn small_asymmetry_is_averaged() {
        let mut workspace = Workspace::<f64, 2>::new();
        let (best, norm) = solve(&[1.2, 0.4], &[0.1, 0.050_001, 0.050_000, 0.1], 100, &mut workspace);
        let (expected, expected_norm) = solve(&[1.2, 0.4], &[0.1, 0.050_000_5, 0.050_000_5, 0.1], 100, &mut workspace);
        assert_eq!(best, expected);
        assert!((norm / expected_norm - 1.0).abs() < 1e-12);
    }

    proptest! {
        /// For a' = T a, Q' = T Q Tᵀ with T unimodular, the nearest vector is T times the nearest and as near.
        #[test]
        fn unimodular_changes_do_not_matter(
            (n, q) in spd::matrix(2..7usize),
            a in proptest::collection::vec(-20.0..20.0f64, 6),
            steps in proptest::collection::vec((0..6usize, 0..6usize, -2..=2i64), 4),
        ) {
            let a = &a[..n];
            let (mut changed_a, mut changed_q) = (a.to_vec(), q.clone());
            let mut workspace = Workspace::<f64, 6>::new();
            let (mut expected, norm) = solve(a, &q, u32::MAX, &mut workspace);
            for (i, j, multiple) in steps {
                let (i, j) = (i % n, j % n);
                if i == j {
                    continue;
                }
                // Component i gains a multiple of component j.
                let factor = multiple as f64;
                expected[i] += multiple * expected[j];
                changed_a[i] += factor * changed_a[j];
                for k in 0..n {
                    changed_q[i * n + k] += factor * changed_q[j * n + k];
                }
                for k in 0..n {
                    changed_q[k * n + i] += factor * changed_q[k * n + j];
                }
            }
            let (best, changed_norm) = solve(&changed_a, &changed_q, u32::MAX, &mut workspace);
            prop_assert!((changed_norm - norm).abs() <= 1e-6 * norm.max(1e-9));
            prop_assert_eq!(best, expected);
        }

        /// The answer is that of a search without decorrelation, which [`search`] proves against brute force.
        #[test]
        fn decorrelation_does_not_change_the_answer(
            (n, q) in spd::matrix(1..5usize),
            a in proptest::collection::vec(-20.0..20.0f64, 4),
        ) {
            let a = &a[..n];
            let largest = (0..n).map(|i| q[i * (n + 1)]).fold(0.0, f64::max);
            let q: Vec<f64> = q.iter().map(|q| q / largest).collect();
            let mut workspace = Workspace::<f64, 4>::new();
            let view = Mat::square(&q, n).unwrap();
            let found = resolve(a, view, &Config { budget: u32::MAX }, &mut workspace).unwrap();

            let (mut u, mut d) = (q.clone(), vec![0.0; n]);
            let mut factor = MatMut::square(&mut u, n).unwrap();
            ldl::factor_ltdl(&mut factor, &mut d).unwrap();
            factor.transpose();
            let (mut candidates, mut norms) = (vec![0; 2 * n], [0.0; 2]);
            let (mut levels, mut residual) = (vec![Level::ZERO; n], vec![0.0; n]);
            let mut nearest = MatMut::new(&mut candidates, 2, n, n).unwrap();
            let (factor, levels) = (factor.as_ref(), &mut levels[..]);
            search::search(a, factor, &d, u32::MAX, &mut nearest, &mut norms, levels, &mut residual).unwrap();
            for (norm, expected) in [(found.best_norm, norms[0]), (found.second_norm, norms[1])] {
                prop_assert!((norm - expected).abs() <= 1e-7 * expected.max(1e-9), "{norm} {expected}");
            }
            // Candidates that are equally near may come in either order.
            if norms[1] > norms[0] * (1.0 + 1e-6) {
                prop_assert_eq!(found.best, nearest.row(0));
            }
        }

        /// A million cycles more change nothing but the integers.
        #[test]
        fn whole_cycles_do_not_matter(
            (n, q) in spd::matrix(1..7usize),
            a in proptest::collection::vec(-0.5..0.5f64, 6),
            offsets in proptest::collection::vec(-10_000_000..10_000_000i64, 6),
        ) {
            let mut workspace = Workspace::<f64, 6>::new();
            // Fractions of 2⁻²⁰ survive the addition exactly.
            let a: Vec<f64> = a[..n].iter().map(|a| (a * 1_048_576.0).round() / 1_048_576.0).collect();
            let far: Vec<f64> = a.iter().zip(&offsets).map(|(a, &offset)| a + offset as f64).collect();
            prop_assume!(a.iter().all(|a| a.abs() < 0.5));
            let (near, norm) = solve(&a, &q, 1000, &mut workspace);
            let (best, far_norm) = solve(&far, &q, 1000, &mut workspace);
            prop_assert_eq!(norm, far_norm);
            prop_assert!((0..n).all(|i| best[i] == near[i] + offsets[i]));
        }

        /// Any bits whatever give a result or a typed error.
        #[test]
        fn it_is_total(bits in proptest::collection::vec(any::<f64>(), 12), symmetric: bool, budget in 0..1000u32) {
            let mut workspace = Workspace::<f64, 3>::new();
            let mut q = bits[3..].to_vec();
            if symmetric {
                MatMut::square(&mut q, 3).unwrap().mirror_lower();
            }
            let found = resolve(&bits[..3], Mat::square(&q, 3).unwrap(), &Config { budget }, &mut workspace);
            if let Ok(found) = found {
                prop_assert!(found.nodes <= budget);
                prop_assert!((0.0..=1.0).contains(&found.success_rate.success) && found.ratio >= 1.0);
            }
        }

        /// Near-singular matrices, down to the last bits, give a result within the budget or a typed error.
        #[test]
        fn near_singular_matrices_are_survived(
            g in proptest::collection::vec(-1.0..1.0f64, 12),
            a in proptest::collection::vec(-5.0..5.0f64, 6),
            exponent in -18.0..-6.0f64,
        ) {
            let mut q = [0.0; 36];
            for i in 0..6 {
                for j in 0..6 {
                    q[6 * i + j] = g[2 * i] * g[2 * j] + g[2 * i + 1] * g[2 * j + 1];
                }
                q[7 * i] += 10f64.powf(exponent);
            }
            let mut workspace = Workspace::<f64, 6>::new();
            let found = resolve(&a, Mat::square(&q, 6).unwrap(), &Config::default(), &mut workspace);
            match found {
                Ok(found) => {
                    prop_assert!(found.nodes <= 100_000 && found.best_norm >= 0.0);
                    prop_assert!((0.0..=1.0).contains(&found.success_rate.success) && found.ratio >= 1.0);
                }
                Err(IntegerError::NotPositiveDefinite { .. } | IntegerError::Overflow | IntegerError::NotFinite) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
        }
    }
}
