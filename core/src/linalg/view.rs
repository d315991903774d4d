//! Row-major matrix views on slices.
//!
//! Entry (i, j) of a view is `data[i·ld + j]`, with `ld ≥ cols` the leading dimension. The constructors check that
//! the slice is long enough; afterwards rows are plain slices and loops over them need no arithmetic on indices.
//!
//! Panic contract: none. A row out of range is the empty slice, an entry out of range is `None`.

use super::{LinalgError, head, head_mut, tail_mut};
use crate::real::Real;

/// Whether `rows × cols` with leading dimension `ld` fits into `len` numbers.
const fn fits(len: usize, rows: usize, cols: usize, ld: usize) -> bool {
    if rows == 0 || cols == 0 {
        return true;
    }
    if ld < cols {
        return false;
    }
    match (rows - 1).checked_mul(ld) {
        Some(start) => match start.checked_add(cols) {
            Some(needed) => needed <= len,
            None => false,
        },
        None => false,
    }
}

/// A matrix to read.
#[derive(Clone, Copy, Debug)]
pub struct Mat<'a, T> {
    data: &'a [T],
    rows: usize,
    cols: usize,
    ld: usize,
}

impl<'a, T: Copy> Mat<'a, T> {
    /// Views `data` as `rows × cols` with leading dimension `ld`.
    pub const fn new(data: &'a [T], rows: usize, cols: usize, ld: usize) -> Result<Self, LinalgError> {
        if !fits(data.len(), rows, cols, ld) {
            return Err(LinalgError::Shape);
        }
        let ld = if rows == 0 || cols == 0 { 0 } else { ld };
        Ok(Self { data, rows, cols, ld })
    }

    /// The matrix without entries.
    pub const fn empty() -> Self {
        Self { data: &[], rows: 0, cols: 0, ld: 0 }
    }

    /// Views `data` as a packed n × n matrix.
    pub const fn square(data: &'a [T], n: usize) -> Result<Self, LinalgError> {
        Self::new(data, n, n, n)
    }

    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Row `i`, empty where there is none.
    pub fn row(&self, i: usize) -> &'a [T] {
        if i >= self.rows {
            return &[];
        }
        let start = i * self.ld;
        self.data.get(start..start + self.cols).unwrap_or(&[])
    }

    /// Entry (i, j), `None` where there is none.
    pub fn get(&self, i: usize, j: usize) -> Option<T> {
        self.row(i).get(j).copied()
    }

    /// The block of `rows × cols` whose corner is at (i, j).
    pub fn block(&self, i: usize, j: usize, rows: usize, cols: usize) -> Result<Self, LinalgError> {
        if !block_fits(self.rows, self.cols, i, j, rows, cols) {
            return Err(LinalgError::Shape);
        }
        let start = if rows == 0 || cols == 0 { 0 } else { i * self.ld + j };
        Self::new(self.data.get(start..).unwrap_or(&[]), rows, cols, self.ld)
    }

    /// The rows in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &'a [T]> + use<'a, T> {
        let cols = self.cols;
        self.data.chunks(self.ld.max(1)).take(self.rows).map(move |row| head(row, cols))
    }
}

impl<T> Mat<'_, T> {
    /// Calls `each` with the entries (k, j) of column j for k > j, as many as there are in `others`, and with those.
    pub(crate) fn zip_below<U>(&self, j: usize, others: &mut [U], mut each: impl FnMut(&T, &mut U)) {
        let mut k = (j + 1) * self.ld + j;
        for other in others {
            let Some(entry) = self.data.get(k) else { return };
            each(entry, other);
            k += self.ld;
        }
    }
}

impl<T: Copy + Default> Mat<'_, T> {
    /// Entry (i, j) known to be in range; 0 where there is none.
    pub(crate) fn at(&self, i: usize, j: usize) -> T {
        self.data.get(i * self.ld + j).copied().unwrap_or_default()
    }
}

/// A matrix to read and write.
#[derive(Debug)]
pub struct MatMut<'a, T> {
    data: &'a mut [T],
    rows: usize,
    cols: usize,
    ld: usize,
}

impl<'a, T: Copy> MatMut<'a, T> {
    /// Views `data` as `rows × cols` with leading dimension `ld`.
    pub const fn new(data: &'a mut [T], rows: usize, cols: usize, ld: usize) -> Result<Self, LinalgError> {
        if !fits(data.len(), rows, cols, ld) {
            return Err(LinalgError::Shape);
        }
        let ld = if rows == 0 || cols == 0 { 0 } else { ld };
        Ok(Self { data, rows, cols, ld })
    }

    /// Views `data` as a packed n × n matrix.
    pub const fn square(data: &'a mut [T], n: usize) -> Result<Self, LinalgError> {
        Self::new(data, n, n, n)
    }

    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// The same matrix to read.
    pub fn as_ref(&self) -> Mat<'_, T> {
        Mat { data: self.data, rows: self.rows, cols: self.cols, ld: self.ld }
    }

    /// The same matrix for a shorter time, as `&mut *` is for a reference.
    pub fn reborrow(&mut self) -> MatMut<'_, T> {
        MatMut { data: self.data, rows: self.rows, cols: self.cols, ld: self.ld }
    }

    /// The same matrix to read, for as long as the buffer is borrowed.
    pub fn into_ref(self) -> Mat<'a, T> {
        Mat { data: self.data, rows: self.rows, cols: self.cols, ld: self.ld }
    }

    /// Row `i`, empty where there is none.
    pub fn row(&self, i: usize) -> &[T] {
        self.as_ref().row(i)
    }

    /// Row `i` to write, empty where there is none.
    pub fn row_mut(&mut self, i: usize) -> &mut [T] {
        if i >= self.rows {
            return &mut [];
        }
        let start = i * self.ld;
        self.data.get_mut(start..start + self.cols).unwrap_or(&mut [])
    }

    /// Row `target` to write and row `source` to read; both empty unless they are two different rows of the matrix.
    pub fn row_pair(&mut self, target: usize, source: usize) -> (&mut [T], &[T]) {
        let (target, source) = self.two_rows_mut(target, source);
        (target, source)
    }

    /// Rows `i` and `j` to write; both empty unless they are two different rows of the matrix.
    pub(crate) fn two_rows_mut(&mut self, i: usize, j: usize) -> (&mut [T], &mut [T]) {
        if i == j {
            return (&mut [], &mut []);
        }
        let (above, second) = self.split_row(i.max(j));
        if second.is_empty() {
            return (&mut [], &mut []);
        }
        let first = above.take_row(i.min(j));
        if i < j { (first, second) } else { (second, first) }
    }

    /// The rows above row `i`, and row `i`; that is empty where there is none.
    pub(crate) fn split_row(&mut self, i: usize) -> (MatMut<'_, T>, &mut [T]) {
        let (above, rest) = self.split_at(i);
        (above, rest.take_row(0))
    }

    /// The rows above row `i`, and the others.
    pub(crate) fn split_at(&mut self, i: usize) -> (MatMut<'_, T>, MatMut<'_, T>) {
        let (rows, cols, ld) = (i.min(self.rows), self.cols, self.ld);
        let (above, rest) = self.data.split_at_mut_checked(rows * ld).unwrap_or((&mut [], &mut []));
        (MatMut { data: above, rows, cols, ld }, MatMut { data: rest, rows: self.rows - rows, cols, ld })
    }

    /// The rows in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[T]> {
        self.as_ref().iter()
    }

    /// The rows in order, to write.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut [T]> {
        let cols = self.cols;
        self.data.chunks_mut(self.ld.max(1)).take(self.rows).map(move |row| head_mut(row, cols))
    }

    /// Row `i` to write for as long as the buffer is borrowed, empty where there is none.
    fn take_row(self, i: usize) -> &'a mut [T] {
        if i >= self.rows {
            return &mut [];
        }
        let start = i * self.ld;
        self.data.get_mut(start..start + self.cols).unwrap_or(&mut [])
    }

    /// The first K rows to write; `None` where there are fewer.
    pub fn rows_mut<const K: usize>(&mut self) -> Option<[&mut [T]; K]> {
        if K > self.rows {
            return None;
        }
        let cols = self.cols;
        let mut rows = self.data.chunks_mut(self.ld.max(1));
        Some(core::array::from_fn(|_| rows.next().and_then(|row| row.get_mut(..cols)).unwrap_or(&mut [])))
    }

    /// Exchanges rows `i` and `j`; nothing happens where one does not exist.
    pub fn swap_rows(&mut self, i: usize, j: usize) {
        let (row_i, row_j) = self.two_rows_mut(i, j);
        for (a, b) in row_i.iter_mut().zip(row_j) {
            core::mem::swap(a, b);
        }
    }

    /// Entry (i, j), `None` where there is none.
    pub fn get(&self, i: usize, j: usize) -> Option<T> {
        self.as_ref().get(i, j)
    }

    /// Sets entry (i, j); nothing happens where there is none.
    pub fn set(&mut self, i: usize, j: usize, value: T) {
        if let Some(entry) = self.row_mut(i).get_mut(j) {
            *entry = value;
        }
    }

    /// The block of `rows × cols` whose corner is at (i, j).
    pub fn block_mut(&mut self, i: usize, j: usize, rows: usize, cols: usize) -> Result<MatMut<'_, T>, LinalgError> {
        if !block_fits(self.rows, self.cols, i, j, rows, cols) {
            return Err(LinalgError::Shape);
        }
        let start = if rows == 0 || cols == 0 { 0 } else { i * self.ld + j };
        MatMut::new(self.data.get_mut(start..).unwrap_or(&mut []), rows, cols, self.ld)
    }

    /// Sets every entry to `value`.
    pub fn fill(&mut self, value: T) {
        self.iter_mut().for_each(|row| row.fill(value));
    }

    /// Copies `source`, which must have the same shape.
    pub fn copy_from(&mut self, source: Mat<'_, T>) -> Result<(), LinalgError> {
        if self.rows != source.rows || self.cols != source.cols {
            return Err(LinalgError::Shape);
        }
        for (row, source) in self.iter_mut().zip(source.iter()) {
            for (entry, &value) in row.iter_mut().zip(source) {
                *entry = value;
            }
        }
        Ok(())
    }

    /// Copies the strict lower triangle of a square matrix onto the upper one.
    pub fn mirror_lower(&mut self) {
        self.for_pairs(|upper, lower| *upper = *lower);
    }

    /// Copies the strict upper triangle of a square matrix onto the lower one.
    pub fn mirror_upper(&mut self) {
        self.for_pairs(|upper, lower| *lower = *upper);
    }

    /// Transposes a square matrix in place; of a wide or tall one, its leading square.
    pub fn transpose(&mut self) {
        self.for_pairs(core::mem::swap);
    }

    /// Calls `change` with entries (j, i) and (i, j) for all j < i of the leading square.
    fn for_pairs(&mut self, change: impl Fn(&mut T, &mut T)) {
        for i in 1..self.rows.min(self.cols) {
            let (above, row) = self.split_row(i);
            let column = tail_mut(above.data, i).iter_mut().step_by(above.ld.max(1));
            column.zip(row).for_each(|(upper, lower)| change(upper, lower));
        }
    }
}

impl<T: Copy + Default> MatMut<'_, T> {
    /// Entry (i, j) known to be in range; 0 where there is none.
    pub(crate) fn at(&self, i: usize, j: usize) -> T {
        self.as_ref().at(i, j)
    }
}

impl<T: Real> MatMut<'_, T> {
    /// Adds to entry (i, j); nothing happens where there is none.
    pub(crate) fn add(&mut self, i: usize, j: usize, value: T) {
        if let Some(entry) = self.row_mut(i).get_mut(j) {
            *entry += value;
        }
    }

    /// Replaces a square matrix by (A + Aᵀ)/2.
    pub fn symmetrize(&mut self) {
        let half = T::from_f64(0.5);
        self.for_pairs(|upper, lower| {
            let mean = half * (*upper + *lower);
            (*upper, *lower) = (mean, mean);
        });
    }
}

/// Whether a block at (i, j) lies inside a matrix.
fn block_fits(outer_rows: usize, outer_cols: usize, i: usize, j: usize, rows: usize, cols: usize) -> bool {
    i.checked_add(rows).is_some_and(|end| end <= outer_rows) && j.checked_add(cols).is_some_and(|end| end <= outer_cols)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corner_of_a_larger_buffer() {
        let mut buffer = [0.0; 12];
        let mut m = MatMut::new(&mut buffer, 2, 3, 4).unwrap();
        m.set(1, 2, 7.0);
        m.set(1, 3, 9.0);
        assert_eq!(m.get(1, 2), Some(7.0));
        assert_eq!(m.get(1, 3), None);
        assert_eq!(m.row(2), &[] as &[f64]);
        assert_eq!(m.block_mut(1, 1, 1, 2).unwrap().row(0), &[0.0, 7.0]);
        assert_eq!(buffer[6], 7.0);
    }

    #[test]
    fn shapes_that_do_not_fit_are_refused() {
        let data = [0.0; 6];
        assert!(Mat::new(&data, 2, 3, 3).is_ok());
        assert!(Mat::new(&data, 2, 3, 2).is_err());
        assert!(Mat::new(&data, 3, 3, 3).is_err());
        assert!(Mat::new(&data, usize::MAX, 3, 3).is_err());
        assert!(Mat::new(&data, 2, 3, 3).unwrap().block(1, 1, 2, 2).is_err());
        assert!(Mat::new(&data, 0, 5, 0).is_ok());
    }

    #[test]
    fn row_pairs_are_told_apart() {
        let mut data = [1, 2, 3, 4];
        let mut m = MatMut::square(&mut data, 2).unwrap();
        let (target, source) = m.row_pair(1, 0);
        target.copy_from_slice(source);
        assert_eq!(m.row_pair(0, 0).0.len(), 0);
        assert_eq!(m.row_pair(0, 2).0.len(), 0);
        assert_eq!(data, [1, 2, 1, 2]);
    }

    #[test]
    fn symmetry_operations() {
        let mut data = [1.0, 2.0, 4.0, 3.0];
        let mut m = MatMut::square(&mut data, 2).unwrap();
        m.transpose();
        assert_eq!((m.at(0, 1), m.at(1, 0)), (4.0, 2.0));
        m.symmetrize();
        assert_eq!((m.at(0, 1), m.at(1, 0)), (3.0, 3.0));
        m.set(1, 0, 8.0);
        m.mirror_lower();
        assert_eq!(m.at(0, 1), 8.0);
    }
}
