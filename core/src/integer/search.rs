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
use crate::linalg::{Mat, MatMut, dot};
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
    let top = n - 1;
    let mut level = top;
    levels[top] = Level::enter(a[top], T::ZERO);
    let mut nodes = 0;
    loop {
        if nodes == budget {
            return Ok(Search::Exhausted { nodes });
        }
        nodes += 1;
        let here = &levels[level];
        let offset = here.conditional - here.integer;
        let distance = here.distance + offset * offset / variances[level];
        if distance < norms[k - 1] {
            if level > 0 {
                residual[level] = offset;
                level -= 1;
                let conditional = a[level] - dot(&factor.row(level)[level + 1..], &residual[level + 1..]);
                levels[level] = Level::enter(conditional, distance);
            } else {
                insert(candidates, norms, distance, levels)?;
                levels[0].advance();
            }
        } else if level < top {
            // Every other integer of this level is farther away: back to the level above.
            level += 1;
            levels[level].advance();
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
    let mut place = norms.len() - 1;
    while place > 0 && norm < norms[place - 1] {
        norms[place] = norms[place - 1];
        candidates.swap_rows(place, place - 1);
        place -= 1;
    }
    norms[place] = norm;
    for (entry, level) in candidates.row_mut(place).iter_mut().zip(levels) {
        *entry = to_integer(level.integer)?;
    }
    Ok(())
}
