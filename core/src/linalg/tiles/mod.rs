//! Dense algebra of larger matrices, in tiles that stay in registers.
//!
//! A [`Tiles`] matrix has rows of whole groups of [`LANES`] numbers and a number of rows that is a multiple of it as well;
//! what is beyond the logical dimension is 0, for factors 1 on the diagonal. So kernels need no remainders: they keep a tile
//! of [`ROWS`] × [`LANES`] sums in registers and run along k once,
//! ```text
//! tile ← tile ± Σ_k a[k, i..i+ROWS]ᵀ b[k, j..j+LANES]
//! ```
//! with contiguous loads of a and b, which any vector unit likes. Hence factors are upper triangular, A = Rᵀ R. Each
//! entry is one sum in the order of k, whatever the shape of the tile and the width of the vectors: results are the same
//! to the last bit on every machine. Everything is inlined, so that a caller may compile it for the processor it finds.
//!
//! | method | result | multiply-adds (n × n, m columns) |
//! |---|---|---|
//! | [`Tiles::factor`] | A = Rᵀ R | n³/6 |
//! | [`Tiles::forward`] | R⁻ᵀ B | n² m/2 |
//! | [`Tiles::backward`] | R⁻¹ B, of an upper triangular B n³/6 | n² m/2 |
//! | [`Tiles::product`] | Aᵀ B | n² m |
//! | [`Tiles::gram_lower`] | lower triangle of C + Aᵀ B | n² m/2 |
//!
//! Golub & Van Loan, *Matrix Computations*, 4th ed., secs. 1.5 and 4.2.6. Panic contract: none; where dimensions do not fit
//! together, the smaller ones count.

mod register;

use super::{LinalgError, Mat, MatMut, axpy, head, tail, tail_mut};
use crate::real::Real;
use register::{Corner, Sign, Tile, accumulate, column, factor_corner, part, run, run_across, transposed};

/// Numbers of a group: two vectors of four `f64` where there are such.
pub const LANES: usize = if cfg!(target_pointer_width = "64") { 8 } else { 4 };

/// Rows of a tile.
pub const ROWS: usize = 4;

/// A dimension with what fills up the last group.
pub const fn padded(n: usize) -> usize {
    n.next_multiple_of(LANES)
}

/// Numbers in the buffer of a matrix of so many logical rows and columns.
pub const fn buffer_len(rows: usize, cols: usize) -> usize {
    padded(rows) * padded(cols)
}

/// A matrix of whole tiles on a buffer of the caller.
#[derive(Debug)]
pub struct Tiles<'a, T> {
    data: &'a mut [[T; LANES]],
    /// Rows, a multiple of [`LANES`].
    rows: usize,
    /// Groups of a row.
    groups: usize,
}

impl<'a, T: Real> Tiles<'a, T> {
    /// On the first [`buffer_len`] numbers of a buffer, as they are; and the rest of it.
    pub fn split(buffer: &'a mut [T], rows: usize, cols: usize) -> Result<(Self, &'a mut [T]), LinalgError> {
        let (head, rest) = buffer.split_at_mut_checked(buffer_len(rows, cols)).ok_or(LinalgError::Shape)?;
        let (data, _) = head.as_chunks_mut::<LANES>();
        Ok((Self { data, rows: padded(rows), groups: padded(cols) / LANES }, rest))
    }

    /// Its first rows and columns to read.
    pub fn view(&self, rows: usize, cols: usize) -> Result<Mat<'_, T>, LinalgError> {
        Mat::new(self.data.as_flattened(), rows, cols, self.groups * LANES)
    }

    /// Its first rows and columns to write.
    pub fn view_mut(&mut self, rows: usize, cols: usize) -> Result<MatMut<'_, T>, LinalgError> {
        let ld = self.groups * LANES;
        MatMut::new(self.data.as_flattened_mut(), rows, cols, ld)
    }

    /// Sets every number to 0.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.data.as_flattened_mut().fill(T::ZERO);
    }

    /// Row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[T] {
        self.data.get(i * self.groups..(i + 1) * self.groups).unwrap_or(&[]).as_flattened()
    }

    /// Row `i` to write.
    #[inline(always)]
    pub fn row_mut(&mut self, i: usize) -> &mut [T] {
        self.data.get_mut(i * self.groups..(i + 1) * self.groups).unwrap_or(&mut []).as_flattened_mut()
    }

    /// Becomes a symmetric matrix, both triangles: `write` is given i < `n` and the first i + 1 numbers of row i; after
    /// those rows, `beyond` stands on the diagonal.
    #[inline(always)]
    pub fn load_symmetric(&mut self, n: usize, beyond: T, mut write: impl FnMut(usize, &mut [T])) {
        for i in 0..self.rows {
            let row = self.row_mut(i);
            if i < n {
                if let Some(head) = row.get_mut(..=i) {
                    write(i, head);
                }
                tail_mut(row, n).fill(T::ZERO);
            } else {
                row.fill(T::ZERO);
                if let Some(diagonal) = row.get_mut(i) {
                    *diagonal = beyond;
                }
            }
        }
        self.mirror_lower();
    }

    /// The groups of the tile of LANES rows at (`row_group`, `group`).
    #[inline(always)]
    fn square(&self, row_group: usize, group: usize) -> [[T; LANES]; LANES] {
        let mut square = [[T::ZERO; LANES]; LANES];
        let rows = column(tail(self.data, row_group * LANES * self.groups), self.groups, group).iter();
        for (to, from) in square.iter_mut().zip(rows) {
            *to = *from;
        }
        square
    }

    /// Writes the tile of LANES rows at (`row_group`, `group`).
    #[inline(always)]
    fn set_square(&mut self, row_group: usize, group: usize, square: &[[T; LANES]; LANES]) {
        let start = row_group * LANES * self.groups + group;
        for (to, from) in tail_mut(self.data, start).iter_mut().step_by(self.groups.max(1)).zip(square) {
            *to = *from;
        }
    }

    /// Copies the lower triangle onto the upper one.
    #[inline(always)]
    pub fn mirror_lower(&mut self) {
        for i in 0..self.rows / LANES {
            for j in 0..i {
                let square = transposed(&self.square(i, j));
                self.set_square(j, i, &square);
            }
            let square = self.square(i, i);
            let mirrored = core::array::from_fn(|r| core::array::from_fn(|c| square[r.max(c)][r.min(c)]));
            self.set_square(i, i, &mirrored);
        }
    }

    /// Becomes the transpose of `other`.
    #[inline(always)]
    pub fn copy_transposed(&mut self, other: &Tiles<'_, T>) {
        for i in 0..self.rows / LANES {
            for j in 0..self.groups {
                let square = transposed(&other.square(j, i));
                self.set_square(i, j, &square);
            }
        }
    }

    /// Becomes the transpose of the upper triangle of `other`, which has the same shape, with zeros above.
    #[inline(always)]
    pub fn copy_transposed_upper(&mut self, other: &Tiles<'_, T>) {
        for i in 0..self.rows / LANES {
            for j in 0..=i {
                let square = transposed(&other.square(j, i));
                self.set_square(i, j, &square);
            }
            for j in i + 1..self.groups {
                self.set_square(i, j, &[[T::ZERO; LANES]; LANES]);
            }
        }
    }

    /// Becomes `other` with rows and columns in opposite order, as far as the upper triangle of the result goes.
    #[inline(always)]
    pub fn copy_reversed(&mut self, other: &Tiles<'_, T>) {
        let n = self.rows.min(other.rows);
        for i in 0..n {
            let from = other.row(n - 1 - i);
            for (to, &from) in self.row_mut(i).iter_mut().zip(from.iter().rev()) {
                *to = from;
            }
        }
    }

    /// Becomes the transpose about the other diagonal of the upper triangular `other`: D_ij = C_{n−1−j, n−1−i}.
    #[inline(always)]
    pub fn copy_flipped(&mut self, other: &Tiles<'_, T>) {
        let last = self.groups.saturating_sub(1);
        for i in 0..self.rows / LANES {
            for j in i..self.groups {
                let square = other.square(last - j, last - i);
                let flipped = core::array::from_fn(|r| core::array::from_fn(|c| square[LANES - 1 - c][LANES - 1 - r]));
                self.set_square(i, j, &flipped);
            }
        }
    }

    /// The groups of the ROWS rows from `row` on at `group`.
    #[inline(always)]
    fn tile(data: &[[T; LANES]], groups: usize, row: usize, group: usize) -> Tile<T> {
        let mut tile = [[T::ZERO; LANES]; ROWS];
        for (to, from) in tile.iter_mut().zip(column(tail(data, row * groups), groups, group).iter()) {
            *to = *from;
        }
        tile
    }

    #[inline(always)]
    fn set_tile(data: &mut [[T; LANES]], groups: usize, row: usize, group: usize, tile: &Tile<T>) {
        for (to, from) in tail_mut(data, row * groups + group).iter_mut().step_by(groups.max(1)).zip(tile) {
            *to = *from;
        }
    }

    /// The triangle of R on the diagonal at `row`.
    #[inline(always)]
    fn corner(&self, row: usize) -> Corner<T> {
        let tile = Self::tile(self.data, self.groups, row, row / LANES);
        let r = tile.map(|group| part(&group, row % LANES / ROWS));
        Corner { r, inverse: core::array::from_fn(|i| T::ONE / r[i][i]) }
    }

    /// Replaces the upper triangle of a symmetric matrix by R, A = Rᵀ R. Reads the upper triangle; the strict lower one is
    /// left undefined. Pivots are refused as by [`super::cholesky::factor`], then the matrix is spoilt.
    #[inline(always)]
    pub fn factor(&mut self) -> Result<(), LinalgError> {
        let groups = self.groups;
        for row in (0..self.rows).step_by(ROWS) {
            let (first, half) = (row / LANES, row % LANES / ROWS);
            let Some((above, below)) = self.data.split_at_mut_checked(row * groups) else {
                return Err(LinalgError::Shape);
            };
            let mut corner = Corner { r: [[T::ZERO; ROWS]; ROWS], inverse: [T::ZERO; ROWS] };
            for group in first..groups {
                let mut tile = Self::tile(below, groups, 0, group);
                let diagonal: [T; ROWS] = core::array::from_fn(|i| part(&tile[i], half)[i]);
                run(&mut tile, Sign::Subtract, half, column(above, groups, first), column(above, groups, group));
                if group == first {
                    corner = factor_corner(tile.map(|group| part(&group, half)), diagonal, row)?;
                }
                corner.forward(&mut tile);
                Self::set_tile(below, groups, 0, group, &tile);
            }
        }
        Ok(())
    }

    /// b ← R⁻ᵀ b for the R in the upper triangle.
    #[inline(always)]
    pub fn forward(&self, b: &mut Tiles<'_, T>) {
        for group in 0..b.groups {
            for row in (0..self.rows).step_by(ROWS) {
                let (first, half) = (row / LANES, row % LANES / ROWS);
                let Some((solved, open)) = b.data.split_at_mut_checked(row * b.groups) else { return };
                let mut tile = Self::tile(open, b.groups, 0, group);
                let solved = column(solved, b.groups, group);
                run(&mut tile, Sign::Subtract, half, column(self.data, self.groups, first), solved);
                self.corner(row).forward(&mut tile);
                Self::set_tile(open, b.groups, 0, group, &tile);
            }
        }
    }

    /// b ← R⁻¹ b for the R in the upper triangle; of an upper triangular `b` only that triangle is read and written.
    #[inline(always)]
    pub fn backward(&self, b: &mut Tiles<'_, T>, triangular: bool) {
        for group in 0..b.groups {
            let end = if triangular { ((group + 1) * LANES).min(self.rows) } else { self.rows };
            for row in (0..end).step_by(ROWS).rev() {
                let (first, half) = (row / LANES, row % LANES / ROWS);
                let mut tile = Self::tile(b.data, b.groups, row, group);
                if half + 1 < LANES / ROWS {
                    let r = Self::tile(self.data, self.groups, row, first);
                    let x = column(tail(b.data, (row + ROWS) * b.groups), b.groups, group).take(ROWS);
                    for (k, x) in (ROWS..LANES).zip(x.iter()) {
                        accumulate(&mut tile, Sign::Subtract, &core::array::from_fn(|i| r[i][k]), x);
                    }
                }
                let after = (first + 1) * LANES;
                let r = core::array::from_fn(|i| {
                    let row = tail(self.data, (row + i) * self.groups);
                    tail(head(row, end / LANES), first + 1)
                });
                run_across(&mut tile, r, column(tail(b.data, after * b.groups), b.groups, group));
                self.corner(row).backward(&mut tile);
                Self::set_tile(b.data, b.groups, row, group, &tile);
            }
        }
    }

    /// Becomes aᵀ b. Of a lower triangular `b` only that triangle is read.
    #[inline(always)]
    pub fn product(&mut self, a: &Tiles<'_, T>, b: &Tiles<'_, T>, triangular: bool) {
        for group in 0..self.groups {
            let skip = if triangular { group * LANES } else { 0 };
            for row in (0..self.rows).step_by(ROWS) {
                let mut tile = [[T::ZERO; LANES]; ROWS];
                let a_column = column(tail(a.data, skip * a.groups), a.groups, row / LANES);
                let b_column = column(tail(b.data, skip * b.groups), b.groups, group);
                run(&mut tile, Sign::Add, row % LANES / ROWS, a_column, b_column);
                Self::set_tile(self.data, self.groups, row, group, &tile);
            }
        }
    }

    /// Gives `each` the row, the first column and a group of numbers of aᵀ b for all groups that touch the lower triangle,
    /// the sum over k running from `from(row)` to `to(group)` as far as there are rows.
    #[inline(always)]
    fn for_lower(
        a: &Tiles<'_, T>,
        b: &Tiles<'_, T>,
        bounds: impl Fn(usize, usize) -> (usize, usize),
        mut each: impl FnMut(usize, usize, &[T; LANES]),
    ) {
        for group in 0..b.groups {
            for row in (group * LANES..a.groups * LANES).step_by(ROWS) {
                let (from, to) = bounds(row, group);
                let mut tile = [[T::ZERO; LANES]; ROWS];
                let a_column = column(tail(a.data, from * a.groups), a.groups, row / LANES);
                let b_column = column(tail(b.data, from * b.groups), b.groups, group).take(to.saturating_sub(from));
                run(&mut tile, Sign::Add, row % LANES / ROWS, a_column, b_column);
                for (i, lanes) in (row..).zip(&tile) {
                    each(i, group * LANES, lanes);
                }
            }
        }
    }

    /// out ← c + aᵀ b in the lower triangle of `out`.
    #[inline(always)]
    pub fn gram_lower(a: &Tiles<'_, T>, b: &Tiles<'_, T>, c: Mat<'_, T>, out: &mut MatMut<'_, T>) {
        Self::for_lower(
            a,
            b,
            |_, _| (0, usize::MAX),
            |i, j, lanes| {
                let row = out.row_mut(i).get_mut(..=i).unwrap_or(&mut []);
                for ((to, &from), &sum) in tail_mut(row, j).iter_mut().zip(tail(c.row(i), j)).zip(lanes) {
                    *to = from + sum;
                }
            },
        );
    }

    /// out ← xᵀ x in the lower triangle of `out`, for the upper triangle x of this matrix.
    #[inline(always)]
    pub fn square_upper(&self, out: &mut MatMut<'_, T>) {
        Self::for_lower(
            self,
            self,
            |_, group| (0, (group + 1) * LANES),
            |i, j, lanes| {
                let row = out.row_mut(i).get_mut(..=i).unwrap_or(&mut []);
                for (to, &sum) in tail_mut(row, j).iter_mut().zip(lanes) {
                    *to = sum;
                }
            },
        );
    }

    /// Becomes lᵀ l, both triangles, for a lower triangular l.
    #[inline(always)]
    pub fn square_of_lower(&mut self, l: &Tiles<'_, T>) {
        Self::for_lower(
            l,
            l,
            |row, _| (row, usize::MAX),
            |i, j, lanes| {
                for (to, &sum) in tail_mut(self.row_mut(i), j).iter_mut().zip(lanes) {
                    *to = sum;
                }
            },
        );
        self.mirror_lower();
    }

    /// Row `i` ← row `i` − s · row `j`, which comes later.
    #[inline(always)]
    pub fn subtract_row(&mut self, i: usize, s: T, j: usize) {
        let Some((first, second)) = self.data.split_at_mut_checked(j * self.groups) else { return };
        let to = first.get_mut(i * self.groups..(i + 1) * self.groups).unwrap_or(&mut []);
        axpy(to.as_flattened_mut(), -s, head(second, self.groups).as_flattened());
    }

    /// Its lower triangle becomes 1 + lᵀ b, for a lower triangular l.
    #[inline(always)]
    pub fn one_plus_lower(&mut self, l: &Tiles<'_, T>, b: &Tiles<'_, T>) {
        Self::for_lower(
            l,
            b,
            |row, _| (row, usize::MAX),
            |i, j, lanes| {
                let row = self.row_mut(i);
                for (to, &sum) in tail_mut(row, j).iter_mut().zip(lanes) {
                    *to = sum;
                }
                if let Some(diagonal) = row.get_mut(i).filter(|_| (j..j + LANES).contains(&i)) {
                    *diagonal += T::ONE;
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::{cholesky, spd, triangular};
    use super::*;
    use proptest::prelude::*;

    fn load<'b>(buffer: &'b mut Vec<f64>, n: usize, a: &[f64]) -> Tiles<'b, f64> {
        *buffer = vec![f64::NAN; buffer_len(n, n)];
        let (mut tiles, _) = Tiles::split(buffer, n, n).unwrap();
        tiles.load_symmetric(n, 1.0, |i, row| row.copy_from_slice(&a[i * n..][..=i]));
        tiles
    }

    fn close(a: f64, b: f64, scale: f64) -> bool {
        (a - b).abs() <= 1e-11 * scale
    }

    proptest! {
        #[test]
        fn the_factor_and_its_solves_are_those_of_the_plain_kernels(
            (n, a) in spd::matrix(1..22usize),
            b in proptest::collection::vec(-1.0..1.0f64, 22 * 9),
        ) {
            let (mut buffer, mut l) = (Vec::new(), a.clone());
            let mut r = load(&mut buffer, n, &a);
            r.factor().unwrap();
            cholesky::factor(&mut MatMut::square(&mut l, n).unwrap()).unwrap();
            for i in 0..n {
                for j in i..n {
                    prop_assert!(close(r.row(i)[j], l[j * n + i], a[j * (n + 1)].sqrt()));
                }
            }
            let mut solution = vec![0.0; buffer_len(n, 9)];
            let (mut x, _) = Tiles::split(&mut solution, n, 9).unwrap();
            for i in 0..n {
                x.row_mut(i)[..9].copy_from_slice(&b[i * 9..][..9]);
            }
            let mut plain = b.clone();
            let mut plain = MatMut::new(&mut plain, n, 9, 9).unwrap();
            let l = Mat::square(&l, n).unwrap();
            for back in [false, true] {
                if back {
                    r.backward(&mut x, false);
                    triangular::back_transposed_rows(l, &mut plain).unwrap();
                } else {
                    r.forward(&mut x);
                    triangular::forward_rows(l, &mut plain).unwrap();
                }
                for j in 0..9 {
                    let size = (0..n).map(|i| plain.at(i, j).abs()).fold(0.0, f64::max);
                    for i in 0..n {
                        prop_assert!((x.row(i)[j] - plain.at(i, j)).abs() <= 1e-9 * size);
                    }
                }
            }
        }

        #[test]
        fn products_are_the_plain_ones((n, a) in spd::matrix(1..20usize), (m, b) in spd::matrix(1..20usize)) {
            let n = n.min(m);
            let (a, b): (Vec<f64>, Vec<f64>) = (a[..n * n].to_vec(), b[..n * n].to_vec());
            let fill = |buffer: &mut Vec<f64>, from: &[f64], lower: bool| {
                *buffer = vec![0.0; buffer_len(n, n)];
                let (mut tiles, _) = Tiles::split(buffer, n, n).unwrap();
                for i in 0..n {
                    let end = if lower { i + 1 } else { n };
                    tiles.row_mut(i)[..end].copy_from_slice(&from[i * n..][..end]);
                }
            };
            for lower in [false, true] {
                let (mut a_buffer, mut b_buffer, mut c_buffer) = (Vec::new(), Vec::new(), vec![f64::NAN; buffer_len(n, n)]);
                fill(&mut a_buffer, &a, false);
                fill(&mut b_buffer, &b, lower);
                let (a_tiles, _) = Tiles::split(&mut a_buffer, n, n).unwrap();
                let (b_tiles, _) = Tiles::split(&mut b_buffer, n, n).unwrap();
                let (mut c, _) = Tiles::split(&mut c_buffer, n, n).unwrap();
                c.product(&a_tiles, &b_tiles, lower);
                let b = if lower { spd::lower(n, &b) } else { b.clone() };
                let expected = spd::product(n, &spd::transposed(n, &a), &b);
                let size: f64 = expected.iter().map(|x| x.abs()).fold(0.0, f64::max);
                for i in 0..n {
                    for j in 0..n {
                        prop_assert!(close(c.row(i)[j], expected[i * n + j], size));
                    }
                }
                let mut out = vec![f64::NAN; n * n];
                Tiles::gram_lower(&a_tiles, &b_tiles, Mat::square(&a, n).unwrap(), &mut MatMut::square(&mut out, n).unwrap());
                for i in 0..n {
                    prop_assert!((0..=i).all(|j| close(out[i * n + j], a[i * n + j] + expected[i * n + j], size + a[i * n + j].abs())));
                    prop_assert!(out[i * n + i + 1..(i + 1) * n].iter().all(|x| x.is_nan()));
                }
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        let refused = |a: [f64; 4]| load(&mut Vec::new(), 2, &a).factor().unwrap_err();
        assert_eq!(refused([1.0, 2.0, 2.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 1 });
        assert_eq!(refused([1.0, 1.0, 1.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 1 });
        assert_eq!(refused([0.0, 0.0, 0.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 0 });
        assert_eq!(refused([f64::NAN, 0.0, 0.0, 1.0]), LinalgError::NotPositiveDefinite { pivot: 0 });
        assert!(Tiles::split(&mut [0.0; 3], 1, 1).is_err());
    }
}
