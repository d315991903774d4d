//! The transition from one epoch to the next, with states that come, go and are re-defined.
//!
//! ```text
//! x⁺ = F x + b + q,   q ~ N(0, Q),   F n⁺ × n,   Q = Σ_b scale_b · E_b shape_b E_bᵀ
//! ```
//! One form for all that happens to a state:
//!
//! | event | row of F | b | Q |
//! |---|---|---|---|
//! | motion | F of the motion model | 0 | a [`Block`] of its states |
//! | birth, restart, slip | empty | prior mean | a block of one state: the prior variance |
//! | death (marginalisation) | none: no row of F uses that column | | |
//! | change of reference | differences of columns | 0 | as before |
//!
//! Q⁻¹ is linear in the inverse scales θ_j = 1/scale_j over disjoint blocks (Greiff 2023, eq. 11), which is what makes the
//! M-step of EM a quotient of two sums.
//!
//! Panic contract: none; entries outside of the dimensions are ignored.

use crate::filter::update::Rows;

/// Most states of one [`Block`].
pub const BLOCK: usize = 3;

/// One block of the process noise: `scale · shape` on up to [`BLOCK`] states of x⁺. Blocks of a step are disjoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block<T> {
    /// Indices in x⁺, of which the first `dim` count.
    pub states: [usize; BLOCK],
    /// Number of states of the block, 1 to [`BLOCK`].
    pub dim: usize,
    /// Covariance for a scale of 1, symmetric positive definite.
    pub shape: [[T; BLOCK]; BLOCK],
    /// The variance (or power spectral density) that multiplies the shape.
    pub scale: T,
    /// Which parameter the scale is; `None` if it is not to be learned (births, slips).
    pub component: Option<usize>,
}

/// A sparse matrix by rows, on slices of the caller.
#[derive(Clone, Copy, Debug)]
pub struct SparseMap<'a, T> {
    /// End of each row in `entries`; as many as there are rows.
    pub ends: &'a [usize],
    /// Column and coefficient, row after row.
    pub entries: &'a [(usize, T)],
    /// Number of columns n.
    pub columns: usize,
}

impl<'a, T: Copy> SparseMap<'a, T> {
    /// Number of rows n⁺.
    pub fn rows(&self) -> usize {
        self.ends.len()
    }

    /// Column and coefficient of each entry of a row; empty beyond the last row.
    pub fn row(&self, row: usize) -> &'a [(usize, T)] {
        let start = if row == 0 { 0 } else { self.ends.get(row - 1).copied().unwrap_or(usize::MAX) };
        self.ends.get(row).and_then(|&end| self.entries.get(start..end)).unwrap_or(&[])
    }
}

impl<T: Copy> Rows<T> for SparseMap<'_, T> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, T)) {
        self.row(row).iter().for_each(|&(column, coefficient)| entry(column, coefficient));
    }
}

/// x⁺ = F x + b + q.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a, T> {
    /// F.
    pub map: SparseMap<'a, T>,
    /// b, n⁺ entries.
    pub offset: &'a [T],
    /// Q.
    pub noise: &'a [Block<T>],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_by_their_ends_and_none_beyond() {
        let entries = [(0, 1.0), (1, 0.5), (2, -1.0)];
        let map = SparseMap { ends: &[2, 2, 3], entries: &entries, columns: 3 };
        assert_eq!(map.rows(), 3);
        assert_eq!(map.row(0), &entries[..2]);
        assert!(map.row(1).is_empty() && map.row(3).is_empty() && map.row(usize::MAX).is_empty());
        assert_eq!(map.row(2), &entries[2..]);
        let broken = SparseMap { ends: &[9, 1], entries: &entries, columns: 3 };
        assert!(broken.row(0).is_empty() && broken.row(1).is_empty());
    }
}
