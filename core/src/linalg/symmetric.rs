//! Operations on a symmetric matrix of which only the lower triangle is kept up to date.
//!
//! This halves the work of an update, and leaves the strict upper triangle free to hold the last good matrix: with its
//! diagonal kept aside, [`restore`] takes everything back, and [`super::MatMut::mirror_lower`] makes the new matrix the
//! last good one. A filter gets "unchanged on error" for n numbers of memory.
//!
//! Shapes: P is n × n. Every function reads and writes the lower triangle only. Panic contract: none; indices beyond the
//! matrix are ignored.

use core::fmt;

use super::view::{Mat, MatMut};
use super::{LinalgError, axpy, dot, head, head_mut, subtract_four, tail_mut};
use crate::real::Real;

/// out ← out + s · (row i of P).
pub fn add_row<T: Real>(p: Mat<'_, T>, i: usize, s: T, out: &mut [T]) {
    axpy(head_mut(out, i + 1), s, p.row(i));
    p.zip_below(i, tail_mut(head_mut(out, p.rows()), i + 1), |&p, out| *out += s * p);
}

/// out ← row i of P.
pub fn copy_row<T: Real>(p: Mat<'_, T>, i: usize, out: &mut [T]) {
    for (out, &p) in head_mut(out, i + 1).iter_mut().zip(p.row(i)) {
        *out = p;
    }
    p.zip_below(i, tail_mut(head_mut(out, p.rows()), i + 1), |&p, out| *out = p);
}

/// out ← P x. Reads each row once; [`add_row`] is for an x of few entries.
pub fn multiply<T: Real>(p: Mat<'_, T>, x: &[T], out: &mut [T]) {
    out.fill(T::ZERO);
    for ((i, row), &x_i) in p.iter().enumerate().zip(x) {
        let below = head(row, i);
        axpy(head_mut(out, i), x_i, below);
        if let Some(out) = out.get_mut(i) {
            *out += dot(below, x) + p.at(i, i) * x_i;
        }
    }
}

/// hᵀ P h.
pub fn quadratic_form<T: Real>(p: Mat<'_, T>, h: &[T]) -> T {
    h.iter().zip(p.iter()).enumerate().fold(T::ZERO, |sum, (i, (&h_i, row))| {
        let below = dot(head(row, i), h);
        sum + h_i * (below + below + h_i * p.at(i, i))
    })
}

/// P_ij for any i and j, 0 where there is none.
fn entry<T: Real>(p: &MatMut<'_, T>, i: usize, j: usize) -> T {
    p.at(i.max(j), i.min(j))
}

/// P ← E P Eᵀ with E = I + `factor` · e_to e_fromᵀ: the covariance after x_to ← x_to + factor · x_from. Cost n.
pub fn shear<T: Real>(p: &mut MatMut<'_, T>, to: usize, from: usize, factor: T) {
    let n = p.rows();
    if to >= n || from >= n || to == from {
        return;
    }
    let (cross, variance) = (entry(p, to, from), entry(p, from, from));
    for k in (0..n).filter(|&k| k != to) {
        let term = factor * entry(p, from, k);
        p.add(to.max(k), to.min(k), term);
    }
    p.add(to, to, factor * (cross + cross + factor * variance));
}

/// The covariance after x_state ← factor · x_state.
pub fn scale_state<T: Real>(p: &mut MatMut<'_, T>, state: usize, factor: T) {
    for k in 0..p.rows() {
        let scaled = entry(p, state, k) * if k == state { factor * factor } else { factor };
        p.set(state.max(k), state.min(k), scaled);
    }
}

/// P ← P − Wᵀ W for W (m × n), four rows of W at a time, in their order. (Eight do not fit the registers of a Cortex-M7.)
pub fn subtract_gram<T: Real>(p: &mut MatMut<'_, T>, w: Mat<'_, T>) {
    let mut k = 0;
    while k + 4 <= w.rows() {
        let rows = core::array::from_fn(|i| w.row(k + i));
        for (i, row) in p.iter_mut().enumerate() {
            let a = rows.map(|w: &[T]| w.get(i).copied().unwrap_or_default());
            subtract_four(head_mut(row, i + 1), a, rows);
        }
        k += 4;
    }
    for w in w.iter().skip(k) {
        for ((i, row), &w_i) in p.iter_mut().enumerate().zip(w) {
            axpy(head_mut(row, i + 1), -w_i, w);
        }
    }
}

/// L ← L Lᵀ for the lower triangle of L, in place.
pub fn square<T: Real>(l: &mut MatMut<'_, T>) {
    for i in (0..l.rows().min(l.cols())).rev() {
        let (above, row) = l.split_row(i);
        let row = head_mut(row, i + 1);
        // From the diagonal back, so that what is still needed of the row is still there.
        let diagonal = dot(row, row);
        for j in (0..i).rev() {
            let product = dot(head(row, j + 1), above.row(j));
            if let Some(entry) = row.get_mut(j) {
                *entry = product;
            }
        }
        if let Some(entry) = row.last_mut() {
            *entry = diagonal;
        }
    }
}

/// L ← Lᵀ L for the lower triangle of L, in place; with L⁻¹ this is (L Lᵀ)⁻¹.
pub fn square_transposed<T: Real>(l: &mut MatMut<'_, T>) {
    let n = l.rows().min(l.cols());
    for i in 0..n {
        // Row i is not read again once it is written, its diagonal last.
        for j in 0..=i {
            let product = (i..n).fold(T::ZERO, |sum, k| sum + l.at(k, i) * l.at(k, j));
            l.set(i, j, product);
        }
    }
}

/// Takes the lower triangle back from the strict upper one and the `diagonal` that was kept.
pub fn restore<T: Real>(p: &mut MatMut<'_, T>, diagonal: &[T]) {
    p.mirror_upper();
    for (i, &d) in diagonal.iter().enumerate() {
        p.set(i, i, d);
    }
}

/// Keeps the diagonal of P for [`restore`].
pub fn keep_diagonal<T: Real>(p: Mat<'_, T>, diagonal: &mut [T]) {
    for (i, d) in diagonal.iter_mut().enumerate() {
        *d = p.at(i, i);
    }
}

/// What makes a covariance unfit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// A number of this row is NaN or infinite.
    NotFinite {
        /// Row, from 0.
        row: usize,
    },
    /// This row differs from its column by more than 1e-3 of √(P_ii P_jj).
    Asymmetric {
        /// Row, from 0.
        row: usize,
    },
    /// Not square.
    Shape,
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { row } => write!(f, "not finite in row {row}"),
            Self::Asymmetric { row } => write!(f, "not symmetric in row {row}"),
            Self::Shape => f.write_str("not square"),
        }
    }
}

/// Checks that a full matrix is finite and symmetric.
pub fn check<T: Real>(p: Mat<'_, T>) -> Result<(), Defect> {
    let n = p.rows();
    if p.cols() != n {
        return Err(Defect::Shape);
    }
    if let Some(row) = (0..n).find(|&i| !p.row(i).iter().all(|value| value.is_finite())) {
        return Err(Defect::NotFinite { row });
    }
    let tolerance = T::from_f64(1e-3);
    for i in 0..n {
        for j in 0..i {
            let difference = (p.at(i, j) - p.at(j, i)).abs();
            if difference != T::ZERO && difference > tolerance * (p.at(i, i).abs() * p.at(j, j).abs()).sqrt() {
                return Err(Defect::Asymmetric { row: i });
            }
        }
    }
    Ok(())
}

/// Checks that every variance is positive and finite, as a quick sign that P is still a covariance.
pub fn check_diagonal<T: Real>(p: Mat<'_, T>) -> Result<(), LinalgError> {
    match (0..p.rows()).find(|&i| !(p.at(i, i) > T::ZERO && p.at(i, i).is_finite())) {
        Some(pivot) => Err(LinalgError::NotPositiveDefinite { pivot }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::spd;
    use super::*;
    use proptest::prelude::*;

    /// The lower triangle with NaN above it: what reads the upper triangle shows.
    fn lower(n: usize, a: &[f64]) -> Vec<f64> {
        (0..n * n).map(|k| if k % n <= k / n { a[k] } else { f64::NAN }).collect()
    }

    fn assert_lower(n: usize, computed: &[f64], expected: &[f64]) {
        for i in 0..n {
            for j in 0..=i {
                let scale = (expected[i * (n + 1)] * expected[j * (n + 1)]).abs().sqrt();
                assert!((computed[i * n + j] - expected[i * n + j]).abs() <= 1e-12 * scale, "({i}, {j})");
            }
        }
    }

    proptest! {
        #[test]
        fn shear_and_scale_are_congruences((n, a) in spd::matrix(2..8usize), factor in -3.0..3.0f64, pick in 0..64usize) {
            let (to, from) = (pick % n, (pick / 8) % n);
            let mut e: Vec<f64> = (0..n * n).map(|k| f64::from(u8::from(k / n == k % n))).collect();
            let mut p = lower(n, &a);
            let mut view = MatMut::square(&mut p, n).unwrap();
            if to == from {
                e[to * (n + 1)] = factor;
                scale_state(&mut view, to, factor);
            } else {
                e[to * n + from] = factor;
                shear(&mut view, to, from, factor);
            }
            let expected = spd::product(n, &spd::product(n, &e, &a), &spd::transposed(n, &e));
            assert_lower(n, &p, &expected);
        }

        #[test]
        fn square_undoes_cholesky((n, a) in spd::matrix(1..9usize)) {
            let mut p = lower(n, &a);
            let mut view = MatMut::square(&mut p, n).unwrap();
            super::super::cholesky::factor(&mut view).unwrap();
            square(&mut view);
            assert_lower(n, &p, &a);
        }

        #[test]
        fn square_transposed_of_the_inverse_factor_is_the_inverse((n, a) in spd::matrix(1..7usize)) {
            let mut p = lower(n, &a);
            let mut view = MatMut::square(&mut p, n).unwrap();
            super::super::cholesky::factor(&mut view).unwrap();
            super::super::triangular::invert(&mut view).unwrap();
            square_transposed(&mut view);
            view.mirror_lower();
            let one = spd::product(n, &p, &a);
            for k in 0..n * n {
                let size: f64 = (0..n).map(|i| (p[k / n * n + i] * a[i * n + k % n]).abs()).sum();
                prop_assert!((one[k] - f64::from(u8::from(k / n == k % n))).abs() < 1e-11 * size);
            }
        }

        #[test]
        fn rows_are_those_of_the_full_matrix((n, a) in spd::matrix(1..9usize), pick in 0..8usize) {
            let p = lower(n, &a);
            let p = Mat::square(&p, n).unwrap();
            let (mut copied, mut added) = (vec![0.0; n], vec![0.0; n]);
            let i = pick % n;
            copy_row(p, i, &mut copied);
            add_row(p, i, 1.0, &mut added);
            for j in 0..n {
                prop_assert_eq!(copied[j], if j <= i { a[i * n + j] } else { a[j * n + i] });
                prop_assert_eq!(added[j], copied[j]);
            }
            let mut product = vec![f64::NAN; n];
            multiply(p, &copied, &mut product);
            let variance = quadratic_form(p, &copied);
            prop_assert!((dot(&product, &copied) / variance - 1.0).abs() < 1e-9, "(row i) P (row i)ᵀ");
            let expected = dot(&copied, &spd::product(n, &a, &spd::transposed(n, &a))[i * n..(i + 1) * n]);
            prop_assert!((variance / expected - 1.0).abs() < 1e-9, "(row i) P (row i)ᵀ = (P P)ᵢ · (row i)");
        }

        #[test]
        fn gram_is_subtracted((n, a) in spd::matrix(1..9usize), w in proptest::collection::vec(-1.0..1.0f64, 120), m in 0..15usize) {
            let mut p = lower(n, &a);
            let w = Mat::new(&w, m, n, n).unwrap();
            subtract_gram(&mut MatMut::square(&mut p, n).unwrap(), w);
            for i in 0..n {
                for j in 0..=i {
                    let gram: f64 = (0..m).map(|k| w.at(k, i) * w.at(k, j)).sum();
                    prop_assert!((p[i * n + j] - (a[i * n + j] - gram)).abs() < 1e-12 * (a[i * n + j].abs() + 10.0));
                }
            }
        }
    }

    #[test]
    fn a_spoilt_lower_triangle_comes_back() {
        let good = [4.0, 1.0, 2.0, 1.0, 5.0, 3.0, 2.0, 3.0, 6.0];
        let (mut p, mut diagonal) = (good, [0.0; 3]);
        let mut view = MatMut::square(&mut p, 3).unwrap();
        keep_diagonal(view.as_ref(), &mut diagonal);
        super::super::cholesky::factor(&mut view).unwrap();
        restore(&mut view, &diagonal);
        assert_eq!(p, good);
    }

    #[test]
    fn unfit_covariances_are_named() {
        let unfit = |p: [f64; 4]| check(Mat::square(&p, 2).unwrap()).unwrap_err();
        assert_eq!(unfit([1.0, 0.5, 0.4, 1.0]), Defect::Asymmetric { row: 1 });
        assert_eq!(unfit([1.0, 0.5, f64::NAN, 1.0]), Defect::NotFinite { row: 1 });
        assert_eq!(check(Mat::new(&[1.0; 2], 1, 2, 2).unwrap()), Err(Defect::Shape));
        assert!(check(Mat::square(&[0.0; 4], 2).unwrap()).is_ok());
        assert!(check_diagonal(Mat::square(&[0.0; 4], 2).unwrap()).is_err());
    }
}
