//! One tile of a matrix in registers: sums of outer products, and the triangle on the diagonal of a factor.
//!
//! A tile has [`ROWS`] × [`LANES`] numbers. `a` gives a row of factors for its rows, `b` one for its columns, k after k; each
//! entry is one sum in the order of k. Cost: ROWS · LANES multiply-adds for each k. Panic contract: none.

use super::{LANES, ROWS};
use crate::linalg::{LinalgError, head, tail};
use crate::real::Real;

/// Sums in registers.
pub(super) type Tile<T> = [[T; LANES]; ROWS];

/// Whether products are added or taken off.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sign {
    Add,
    Subtract,
}

/// tile ± aᵀ b for one k.
#[inline(always)]
pub(super) fn accumulate<T: Real>(tile: &mut Tile<T>, sign: Sign, a: &[T; ROWS], b: &[T; LANES]) {
    for (row, &a) in tile.iter_mut().zip(a) {
        for (sum, &b) in row.iter_mut().zip(b) {
            match sign {
                Sign::Add => *sum += a * b,
                Sign::Subtract => *sum -= a * b,
            }
        }
    }
}

/// The group at `group` of every row of `data`.
#[inline(always)]
pub(super) fn column<T>(data: &[[T; LANES]], groups: usize, group: usize) -> Column<'_, T> {
    Column { data: tail(data, group), stride: groups.max(1) }
}

/// The four numbers of a group from which the rows of a tile come; `part` is 0 or 1.
#[inline(always)]
pub(super) fn part<T: Real>(group: &[T; LANES], part: usize) -> [T; ROWS] {
    if part == 0 { core::array::from_fn(|r| group[r]) } else { core::array::from_fn(|r| group[LANES - ROWS + r]) }
}

/// One group of every row of a matrix, from some row on.
#[derive(Clone, Copy)]
pub(super) struct Column<'k, T> {
    pub data: &'k [[T; LANES]],
    pub stride: usize,
}

impl<'k, T> Column<'k, T> {
    #[inline(always)]
    pub fn iter(self) -> impl Iterator<Item = &'k [T; LANES]> {
        self.data.iter().step_by(self.stride)
    }

    /// The first rows alone.
    #[inline(always)]
    pub fn take(self, rows: usize) -> Self {
        Self { data: head(self.data, rows.saturating_mul(self.stride)), stride: self.stride }
    }
}

/// tile ± Σ_k a[k]ᵀ b[k], a being the `half` of its groups, over as many k as both have.
#[inline(always)]
pub(super) fn run<T: Real>(tile: &mut Tile<T>, sign: Sign, half: usize, a: Column<'_, T>, b: Column<'_, T>) {
    if half == 0 { run_half::<T, 0>(tile, sign, a, b) } else { run_half::<T, 1>(tile, sign, a, b) }
}

#[inline(always)]
pub(super) fn run_half<T: Real, const HALF: usize>(tile: &mut Tile<T>, sign: Sign, a: Column<'_, T>, b: Column<'_, T>) {
    let mut sums = *tile;
    let (mut at_a, mut at_b) = (0, 0);
    while let (Some(a_k), Some(b_k)) = (a.data.get(at_a), b.data.get(at_b)) {
        accumulate(&mut sums, sign, &part(a_k, HALF), b_k);
        at_a += a.stride;
        at_b += b.stride;
    }
    settle(tile, sums);
}

/// tile − r x, for four rows of r, over as many k as both have.
#[inline(always)]
pub(super) fn run_across<T: Real>(tile: &mut Tile<T>, r: [&[[T; LANES]]; ROWS], x: Column<'_, T>) {
    let mut sums = *tile;
    let mut at = 0;
    for (((r0, r1), r2), r3) in r[0].iter().zip(r[1]).zip(r[2]).zip(r[3]) {
        for k in 0..LANES {
            let Some(x_k) = x.data.get(at) else { break };
            accumulate(&mut sums, Sign::Subtract, &[r0[k], r1[k], r2[k], r3[k]], x_k);
            at += x.stride;
        }
    }
    settle(tile, sums);
}

/// tile ← sums, in memory: so the compiler sees the sums of a loop end in stores of whole vectors, and keeps them in vectors
/// all along, whatever follows.
#[inline(always)]
pub(super) fn settle<T: Real>(tile: &mut Tile<T>, sums: Tile<T>) {
    *tile = sums;
    core::hint::black_box(tile);
}

/// The triangle on the diagonal of R for the rows of a tile, and the inverses of its diagonal.
#[derive(Clone, Copy)]
pub(super) struct Corner<T> {
    pub r: [[T; ROWS]; ROWS],
    pub inverse: [T; ROWS],
}

impl<T: Real> Corner<T> {
    /// R⁻ᵀ tile.
    #[inline(always)]
    pub fn forward(&self, tile: &mut Tile<T>) {
        for i in 0..ROWS {
            let mut row = tile[i];
            for k in 0..i {
                for c in 0..LANES {
                    row[c] -= self.r[k][i] * tile[k][c];
                }
            }
            for (x, to) in row.iter().zip(&mut tile[i]) {
                *to = *x * self.inverse[i];
            }
        }
    }

    /// R⁻¹ tile.
    #[inline(always)]
    pub fn backward(&self, tile: &mut Tile<T>) {
        for i in (0..ROWS).rev() {
            let mut row = tile[i];
            for k in i + 1..ROWS {
                for c in 0..LANES {
                    row[c] -= self.r[i][k] * tile[k][c];
                }
            }
            for (x, to) in row.iter().zip(&mut tile[i]) {
                *to = *x * self.inverse[i];
            }
        }
    }
}

/// Cholesky factorisation of one tile, given its diagonal before anything was subtracted.
#[inline(always)]
pub(super) fn factor_corner<T: Real>(
    a: [[T; ROWS]; ROWS],
    diagonal: [T; ROWS],
    row: usize,
) -> Result<Corner<T>, LinalgError> {
    let mut corner = Corner { r: [[T::ZERO; ROWS]; ROWS], inverse: [T::ZERO; ROWS] };
    for i in 0..ROWS {
        for j in i..ROWS {
            let mut sum = a[i][j];
            for k in 0..i {
                sum -= corner.r[k][i] * corner.r[k][j];
            }
            if j == i {
                if !(sum > T::EPSILON * diagonal[i] && sum.is_finite()) {
                    return Err(LinalgError::NotPositiveDefinite { pivot: row + i });
                }
                corner.r[i][i] = sum.sqrt();
                corner.inverse[i] = T::ONE / corner.r[i][i];
            } else {
                corner.r[i][j] = sum * corner.inverse[i];
            }
        }
    }
    Ok(corner)
}

#[inline(always)]
pub(super) fn transposed<T: Real>(square: &[[T; LANES]; LANES]) -> [[T; LANES]; LANES] {
    core::array::from_fn(|r| core::array::from_fn(|c| square[c][r]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: R = [2 1; 0 3] of A = [4 2; 2 10].
    #[test]
    fn a_corner_factors_and_solves() {
        let mut a = [[0.0; ROWS]; ROWS];
        (0..ROWS).for_each(|i| a[i][i] = 1.0);
        [a[0][0], a[0][1], a[1][0], a[1][1]] = [4.0, 2.0, 2.0, 10.0];
        let corner = factor_corner(a, core::array::from_fn(|i| a[i][i]), 0).unwrap();
        assert_eq!([corner.r[0][0], corner.r[0][1], corner.r[1][1], corner.inverse[1]], [2.0, 1.0, 3.0, 1.0 / 3.0]);
        // R⁻ᵀ (2, 7) = (1, 2) and R⁻¹ of that = (1/6, 2/3).
        let mut tile = [[0.0; LANES]; ROWS];
        (tile[0][3], tile[1][3]) = (2.0, 7.0);
        corner.forward(&mut tile);
        assert_eq!([tile[0][3], tile[1][3]], [1.0, 2.0]);
        corner.backward(&mut tile);
        assert!((tile[0][3] - 1.0f64 / 6.0).abs() < 1e-15 && (tile[1][3] - 2.0 / 3.0).abs() < 1e-15);
        a[1][1] = 1.0;
        let refused = factor_corner(a, core::array::from_fn(|i| a[i][i]), 8).map(|corner| corner.r);
        assert_eq!(refused, Err(LinalgError::NotPositiveDefinite { pivot: 9 }));
    }

    #[test]
    fn products_are_added_and_taken_off_row_by_row() {
        let a: [[f64; LANES]; 2] = [core::array::from_fn(|i| i as f64), [1.0; LANES]];
        let b: [[f64; LANES]; 2] = [[2.0; LANES], core::array::from_fn(|i| i as f64)];
        let mut tile = [[0.0; LANES]; ROWS];
        run(&mut tile, Sign::Add, 0, column(&a, 1, 0), column(&b, 1, 0));
        assert!((0..ROWS).all(|r| (0..LANES).all(|c| tile[r][c] == 2.0 * r as f64 + c as f64)));
        run(&mut tile, Sign::Subtract, 0, column(&a, 1, 0), column(&b, 1, 0));
        assert_eq!(tile, [[0.0; LANES]; ROWS]);
    }
}
