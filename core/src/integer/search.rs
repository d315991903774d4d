//! Integer least squares: the k integer vectors nearest to â in the metric of Q.
//!
//! Depth-first over the levels n…1 of Q = U D Uᵀ: at each level the integers are tried in order of their distance
//! from the conditional mean (C. P. Schnorr & M. Euchner, 1994), and the ellipsoid shrinks to the k-th best norm
//! found so far (X.-W. Chang et al., MLAMBDA, 2005, sec. 4). The first vector found is the bootstrapped one.
//!
//! The number of nodes is exponential in the worst case, so it is bounded by a budget. When that is spent the
//! nearest vector is not known; the caller gets [`Search::Exhausted`] and should bootstrap. Cost n/2 multiply-adds a
//! node; decorrelated GNSS problems of n = 12 need about 25 nodes.

use super::IntegerError;
use super::decorrelate::to_integer;
use crate::linalg::{Mat, MatMut, at, at_mut, dot, tail};
use crate::real::Real;

/// Nodes allowed by default, of order 1 ms on a host.
pub const DEFAULT_BUDGET: u32 = 100_000;

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// The k nearest vectors are proven to be the nearest.
    Complete {
        /// Nodes visited.
        nodes: u32,
    },
    /// The budget was spent; the vectors found are not proven to be the nearest.
    Exhausted {
        /// Nodes visited.
        nodes: u32,
    },
}

/// State of one level of the search.
#[derive(Clone, Copy, Debug)]
pub struct Level<T> {
    conditional: T,
    integer: T,
    step: T,
    /// Norm gathered by the levels above this one.
    distance: T,
}

impl<T: Real> Level<T> {
    /// For workspaces.
    pub const ZERO: Self = Self { conditional: T::ZERO, integer: T::ZERO, step: T::ZERO, distance: T::ZERO };

    /// Starts a level at the integer nearest to the conditional mean.
    fn enter(conditional: T, distance: T) -> Self {
        let integer = conditional.round();
        let step = if conditional < integer { -T::ONE } else { T::ONE };
        Self { conditional, integer, step, distance }
    }

    /// Goes on to the next nearest integer: c, c+1, c−1, c+2, …
    fn advance(&mut self) {
        self.integer += self.step;
        self.step = if self.step > T::ZERO { -self.step - T::ONE } else { T::ONE - self.step };
    }
}

/// Finds the k nearest integer vectors to `a`, given U (`factor`, n × n) and `variances` D.
///
/// `candidates` (k × n) and `norms` (k) return them, nearest first; k is the length of `norms`, at least 1. A norm
/// that stays infinite belongs to a vector that was not found within the budget. `levels` and `residual` (n) are
/// workspace.
pub fn search<T: Real>(
    a: &[T],
    factor: Mat<'_, T>,
    variances: &[T],
    budget: u32,
    candidates: &mut MatMut<'_, i64>,
    norms: &mut [T],
    levels: &mut [Level<T>],
    residual: &mut [T],
) -> Result<Search, IntegerError> {
    let (n, k) = (a.len(), norms.len());
    let shapes = [factor.rows(), factor.cols(), variances.len(), candidates.cols(), levels.len(), residual.len()];
    if n == 0 || k == 0 || shapes != [n; 6] || candidates.rows() != k {
        return Err(IntegerError::Shape);
    }
    for (&a, &variance) in a.iter().zip(variances) {
        to_integer(a)?;
        if !(variance > T::ZERO && variance.is_finite()) {
            return Err(IntegerError::NotFinite);
        }
    }
    norms.fill(T::ONE / T::ZERO);
    let mut bound = T::ONE / T::ZERO;
    let top = n - 1;
    let mut level = top;
    *at_mut(levels, top)? = Level::enter(*at(a, top)?, T::ZERO);
    let mut nodes = 0;
    loop {
        if nodes == budget {
            return Ok(Search::Exhausted { nodes });
        }
        nodes += 1;
        let here = at_mut(levels, level)?;
        let offset = here.conditional - here.integer;
        let distance = here.distance + offset * offset / *at(variances, level)?;
        if distance < bound {
            if level > 0 {
                *at_mut(residual, level)? = offset;
                let carried = dot(tail(factor.row(level - 1), level), tail(residual, level));
                level -= 1;
                *at_mut(levels, level)? = Level::enter(*at(a, level)? - carried, distance);
            } else {
                insert(candidates, norms, distance, levels)?;
                bound = norms.last().copied().unwrap_or(bound);
                at_mut(levels, 0)?.advance();
            }
        } else if level < top {
            // Every other integer of this level is farther away: back to the level above.
            level += 1;
            at_mut(levels, level)?.advance();
        } else {
            return Ok(Search::Complete { nodes });
        }
    }
}

/// Puts the vector held by `levels` into its place among the candidates and drops the last of them.
fn insert<T: Real>(
    candidates: &mut MatMut<'_, i64>,
    norms: &mut [T],
    norm: T,
    levels: &[Level<T>],
) -> Result<(), IntegerError> {
    let place = norms.iter().take_while(|&&nearer| nearer <= norm).count();
    let mut moved = norm;
    for (later, held) in norms.iter_mut().enumerate().skip(place) {
        core::mem::swap(held, &mut moved);
        candidates.swap_rows(place, later);
    }
    for (entry, level) in candidates.row_mut(place).iter_mut().zip(levels) {
        *entry = to_integer(level.integer)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer::bootstrap::bootstrap;
    use crate::linalg::{ldl, spd};
    use proptest::prelude::*;

    /// U and D of Q, scaled to a largest variance of 1 cycle² (without decorrelation).
    fn factors(n: usize, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let largest = (0..n).map(|i| q[i * (n + 1)]).fold(0.0, f64::max);
        let mut u: Vec<f64> = q.iter().map(|q| q / largest).collect();
        let mut d = vec![0.0; n];
        let mut view = MatMut::square(&mut u, n).unwrap();
        ldl::factor_ltdl(&mut view, &mut d).unwrap();
        view.transpose();
        (u, d)
    }

    struct Found {
        outcome: Search,
        candidates: Vec<Vec<i64>>,
        norms: Vec<f64>,
    }

    fn run(a: &[f64], u: &[f64], d: &[f64], k: usize, budget: u32) -> Found {
        let n = a.len();
        let (mut candidates, mut norms) = (vec![0; k * n], vec![0.0; k]);
        let (mut levels, mut residual) = (vec![Level::ZERO; n], vec![0.0; n]);
        let factor = Mat::square(u, n).unwrap();
        let mut view = MatMut::new(&mut candidates, k, n, n).unwrap();
        let outcome = search(a, factor, d, budget, &mut view, &mut norms, &mut levels, &mut residual).unwrap();
        Found { outcome, candidates: candidates.chunks(n).map(<[i64]>::to_vec).collect(), norms }
    }

    /// Squared norm of a − z, term by term from the definition of U and D.
    fn norm(a: &[f64], z: &[i64], u: &[f64], d: &[f64]) -> f64 {
        let n = a.len();
        let mut residual = vec![0.0; n];
        let mut sum = 0.0;
        for i in (0..n).rev() {
            let carried: f64 = (i + 1..n).map(|k| u[i * n + k] * residual[k]).sum();
            residual[i] = a[i] - z[i] as f64 - carried;
            sum += residual[i] * residual[i] / d[i];
        }
        sum
    }

    proptest! {
        /// Whatever is nearer than the k-th candidate lies in the box a ± √(q_ii ‖·‖²); all its integers are tried.
        #[test]
        fn brute_force_finds_nothing_nearer(
            (n, q) in spd::matrix(1..5usize),
            a in proptest::collection::vec(-3.0..3.0f64, 4),
            k in 1..5usize,
        ) {
            let a = &a[..n];
            let (u, d) = factors(n, &q);
            let found = run(a, &u, &d, k, u32::MAX);
            prop_assert!(matches!(found.outcome, Search::Complete { .. }), "the budget is unlimited");
            for (z, &expected) in found.candidates.iter().zip(&found.norms) {
                prop_assert!((norm(a, z, &u, &d) - expected).abs() <= 1e-9 * expected.max(1e-12));
            }
            prop_assert!(found.norms.windows(2).all(|pair| pair[0] <= pair[1]));
            prop_assert!((1..k).all(|i| !found.candidates[..i].contains(&found.candidates[i])));

            let worst = found.norms[k - 1];
            let bounds: Vec<(i64, i64)> = (0..n)
                .map(|i| {
                    let variance: f64 = (i..n).map(|j| u[i * n + j].powi(2) * d[j]).sum();
                    let half = (variance * worst).sqrt() + 1e-6;
                    ((a[i] - half).ceil() as i64, (a[i] + half).floor() as i64)
                })
                .collect();
            let points: i64 = bounds.iter().map(|(low, high)| high - low + 1).product();
            if points < 300_000 {
                let mut nearer = 0;
                for mut index in 0..points {
                    let z: Vec<i64> = bounds
                        .iter()
                        .map(|(low, high)| {
                            let width = high - low + 1;
                            let digit = index % width;
                            index /= width;
                            low + digit
                        })
                        .collect();
                    nearer += usize::from(norm(a, &z, &u, &d) < worst * (1.0 - 1e-9));
                }
                prop_assert!(nearer < k, "{nearer} vectors are nearer than candidate {k}");
            }
        }

        #[test]
        fn the_budget_is_kept(
            (n, q) in spd::matrix(1..9usize),
            a in proptest::collection::vec(-3.0..3.0f64, 8),
            budget in 0..400u32,
        ) {
            let a = &a[..n];
            let (u, d) = factors(n, &q);
            let found = run(a, &u, &d, 2, budget);
            match found.outcome {
                Search::Complete { nodes } => {
                    prop_assert!(nodes <= budget);
                    prop_assert_eq!(&run(a, &u, &d, 2, u32::MAX).candidates, &found.candidates);
                }
                Search::Exhausted { nodes } => prop_assert_eq!(nodes, budget),
            }
        }

        /// The first vector reached is the bootstrapped one.
        #[test]
        fn the_first_leaf_is_bootstrapped(
            (n, q) in spd::matrix(1..9usize),
            a in proptest::collection::vec(-3.0..3.0f64, 8),
        ) {
            let a = &a[..n];
            let (u, d) = factors(n, &q);
            let first = run(a, &u, &d, 1, n as u32);
            let (mut fixed, mut residual) = (vec![0; n], vec![0.0; n]);
            let norm = bootstrap(a, Mat::square(&u, n).unwrap(), &d, &mut fixed, &mut residual).unwrap();
            prop_assert_eq!(&first.candidates[0], &fixed);
            prop_assert!((first.norms[0] - norm).abs() <= 1e-12 * norm);
        }
    }

    /// Uncorrelated ambiguities: half-way floats give ties; the one away from zero is tried first.
    #[test]
    fn ties_round_away_from_zero() {
        let u = [1.0, 0.0, 0.0, 1.0];
        let found = run(&[0.5, -1.5], &u, &[1.0, 1.0], 4, 1000);
        assert_eq!(found.candidates[0], [1, -2]);
        assert_eq!(found.norms, [0.5; 4]);
    }

    #[test]
    fn bad_arguments_are_refused() {
        let u = [1.0];
        let factor = Mat::square(&u, 1).unwrap();
        let refused = |a: &[f64], d: &[f64], k: usize| {
            let (mut candidates, mut norms) = ([0; 2], [0.0; 2]);
            let (mut levels, mut residual) = ([Level::ZERO], [0.0]);
            let mut view = MatMut::new(&mut candidates, k, 1, 1).unwrap();
            search(a, factor, d, 10, &mut view, &mut norms[..k], &mut levels, &mut residual).unwrap_err()
        };
        assert_eq!(refused(&[], &[1.0], 1), IntegerError::Shape);
        assert_eq!(refused(&[0.0], &[1.0], 0), IntegerError::Shape);
        assert_eq!(refused(&[0.0], &[0.0], 1), IntegerError::NotFinite);
        assert_eq!(refused(&[0.0], &[f64::NAN], 1), IntegerError::NotFinite);
        assert_eq!(refused(&[f64::NAN], &[1.0], 1), IntegerError::Overflow);
        assert_eq!(refused(&[1e16], &[1.0], 1), IntegerError::Overflow);
    }
}
