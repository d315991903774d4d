//! Decorrelation of ambiguities: the Z-transform of LAMBDA.
//!
//! Finds an integer Z with |det Z| = 1 such that Q_z = Zᵀ Q Z = Lᵀ D L is as diagonal as integers allow, with d
//! descending towards the last element, which is fixed first. P. J. G. Teunissen, J. Geodesy 70 (1995), sec. 5;
//! X.-W. Chang, X. Yang & T. Zhou, *MLAMBDA*, J. Geodesy 79 (2005), sec. 3, whose three savings are all taken:
//! 1. The factorisation sorts: the component of smallest conditional variance goes last, and so on upwards.
//! 2. Neighbours j, j+1 are exchanged wherever it makes the conditional variance of the later one smaller,
//!    δ = d_j + l² d_{j+1} < d_{j+1} with l = l_{j+1,j} − rint(l_{j+1,j}), and only then the integer Gauss transform
//!    that takes rint(l_{j+1,j}) times component j+1 from j is done. After an exchange the search for the next one
//!    goes on with the pair after it, the first that can have changed.
//! 3. All other entries of L are reduced to |l| ≤ ½ once, at the end. Neither the success rate nor the number of
//!    nodes of the search depends on them. (Not reducing them lets the entries of Z grow; where they become large, as for 27
//!    ambiguities known to 100 cycles by themselves and to a fraction of one together, all are reduced at once and the
//!    exchanges go on.)
//!
//! Equivalent to LLL reduction with δ ≈ 1.
//!
//! Storage. U = Lᵀ is kept, unit upper triangular, Q_z = U D Uᵀ, because then every step works on contiguous rows;
//! likewise Zᵀ and Z⁻¹. Transforms are exact `i64`.
//!
//! Cost n³/6 to factor, about 4 n an exchange, n³ at most for step 3; at most [`MAX_SWAPS_PER_SQUARE`]·n² exchanges,
//! after which the transform is still valid, only less reduced.

use super::IntegerError;
use crate::linalg::{Mat, MatMut, around_mut, at_mut, axpy, ldl, tail, tail_mut};
use crate::real::Real;

/// Bound on swaps, as a multiple of n².
pub const MAX_SWAPS_PER_SQUARE: usize = 64;

/// A swap must lower the variance by this fraction, so that rounding cannot make two swaps undo each other for ever.
const MIN_GAIN: f64 = 1e-6;

/// Entries of Z and Z⁻¹ that are larger than this are a reason to reduce all of L.
const LARGE_ENTRY: u64 = 1 << 24;

/// Integer entries stay below this, exact in `f64` too.
const MAX_ENTRY: i64 = 1 << 52;

/// Multiples up to this are added without a check of each product.
const SMALL_MULTIPLE: u64 = 1 << 9;

/// Decorrelates in place.
///
/// * `q` (n × n): Q on entry, lower triangle read; U on return (zeros below the diagonal).
/// * `d` (n): returns D `[cycles²]`.
/// * `transform` (n × n): returns Zᵀ.
/// * `inverse` (n × n): returns Z⁻¹.
///
/// Returns the number of exchanges. On an error all four are spoilt.
pub fn decorrelate<T: Real>(
    q: &mut MatMut<'_, T>,
    d: &mut [T],
    transform: &mut MatMut<'_, i64>,
    inverse: &mut MatMut<'_, i64>,
) -> Result<usize, IntegerError> {
    let n = d.len();
    if [transform.rows(), transform.cols(), inverse.rows(), inverse.cols()] != [n; 4] {
        return Err(IntegerError::Shape);
    }
    set_identity(transform);
    set_identity(inverse);
    let exchanged = |i, j| {
        transform.swap_rows(i, j);
        inverse.swap_rows(i, j);
    };
    let factored = ldl::factor_ltdl_sorted(q, d, exchanged);
    factored.map_err(|error| match error.into() {
        IntegerError::NotPositiveDefinite { pivot } => {
            IntegerError::NotPositiveDefinite { pivot: original_place(transform.row(pivot)) }
        }
        other => other,
    })?;
    for (i, row) in q.iter_mut().enumerate() {
        tail_mut(row, i + 1).fill(T::ZERO);
    }
    q.transpose();
    let swaps = reduce(q, d, transform, inverse)?;
    reduce_entries(q, transform, inverse)?;
    Ok(swaps)
}

/// Reduces all entries of U to at most ½.
fn reduce_entries<T: Real>(
    u: &mut MatMut<'_, T>,
    transform: &mut MatMut<'_, i64>,
    inverse: &mut MatMut<'_, i64>,
) -> Result<(), IntegerError> {
    let n = u.rows();
    for j in (0..n).rev() {
        for i in j + 1..n {
            let multiple = nearest(u.at(j, i));
            subtract_multiple(u, transform, inverse, j, i, multiple)?;
        }
    }
    Ok(())
}

/// The largest magnitude of an entry.
fn largest(matrix: &MatMut<'_, i64>) -> u64 {
    matrix.as_ref().iter().flatten().fold(0, |largest, entry| largest.max(entry.unsigned_abs()))
}

/// Sets a square matrix to the identity.
fn set_identity(matrix: &mut MatMut<'_, i64>) {
    for (i, row) in matrix.iter_mut().enumerate() {
        row.fill(0);
        row.iter_mut().skip(i).take(1).for_each(|diagonal| *diagonal = 1);
    }
}

/// Which component a row of a permutation matrix picks.
fn original_place(row: &[i64]) -> usize {
    row.iter().take_while(|&&entry| entry == 0).count()
}

/// The nearest whole number, zero at once for the many entries that are already reduced.
fn nearest<T: Real>(entry: T) -> T {
    if entry.abs() <= T::from_f64(0.5) { T::ZERO } else { entry.round() }
}

/// Exchanges neighbours until none pays any more. Returns how many were exchanged.
fn reduce<T: Real>(
    u: &mut MatMut<'_, T>,
    d: &mut [T],
    transform: &mut MatMut<'_, i64>,
    inverse: &mut MatMut<'_, i64>,
) -> Result<usize, IntegerError> {
    let last = d.len().saturating_sub(1);
    let keep = T::from_f64(1.0 - MIN_GAIN.max(8.0 * T::EPSILON.to_f64()));
    let limit = MAX_SWAPS_PER_SQUARE * d.len() * d.len();
    let (mut swaps, mut large) = (0, LARGE_ENTRY);
    // The pair (j, j + 1).
    let mut next = last;
    while let Some(j) = next.checked_sub(1) {
        let l = u.at(j, next);
        let multiple = nearest(l);
        let l = l - multiple;
        let (_, &mut d_j, later) = around_mut(d, j)?;
        let d_next = *at_mut(later, 0)?;
        let delta = d_j + l * l * d_next;
        if delta < keep * d_next && swaps < limit {
            exchange(u, d, delta, j, multiple)?;
            let multiple = to_integer(multiple)?;
            let (row_j, row_next) = transform.two_rows_mut(j, next);
            let size = combine_and_exchange(row_j, -multiple, row_next)?;
            let (row_j, row_next) = inverse.two_rows_mut(j, next);
            let size = size.max(combine_and_exchange(row_next, multiple, row_j)?);
            if size > large {
                reduce_entries(u, transform, inverse)?;
                large = large.max(4 * largest(transform).max(largest(inverse)));
            }
            swaps += 1;
            next = last.min(next + 1);
        } else {
            next = j;
        }
    }
    Ok(swaps)
}

/// Integer Gauss transform: takes a whole `multiple` of component i from component j < i.
fn subtract_multiple<T: Real>(
    u: &mut MatMut<'_, T>,
    transform: &mut MatMut<'_, i64>,
    inverse: &mut MatMut<'_, i64>,
    j: usize,
    i: usize,
    multiple: T,
) -> Result<(), IntegerError> {
    if multiple == T::ZERO {
        return Ok(());
    }
    let (row_j, row_i) = u.row_pair(j, i);
    axpy(tail_mut(row_j, i), -multiple, tail(row_i, i));
    let multiple = to_integer(multiple)?;
    let (row_j, row_i) = transform.row_pair(j, i);
    add_multiple(row_j, -multiple, row_i)?;
    let (row_i, row_j) = inverse.row_pair(i, j);
    add_multiple(row_i, multiple, row_j).map(|_| ())
}

/// Takes `multiple` of component j+1 from component j and exchanges the two; `delta` is the variance of what was j, given
/// all after j+1.
fn exchange<T: Real>(u: &mut MatMut<'_, T>, d: &mut [T], delta: T, j: usize, multiple: T) -> Result<(), IntegerError> {
    let (_, d_j, later) = around_mut(d, j)?;
    let d_next = at_mut(later, 0)?;
    let (mut above, mut rows) = u.split_at(j);
    let (row_j, row_next) = rows.two_rows_mut(0, 1);
    let (_, entry, tail_j) = around_mut(row_j, j + 1)?;
    let l = *entry - multiple;
    let eta = *d_j / delta;
    let lambda = *d_next * l / delta;
    *entry = lambda;
    (*d_j, *d_next) = (eta * *d_next, delta);
    for (a, b) in tail_j.iter_mut().zip(tail_mut(row_next, j + 2)) {
        (*a, *b) = (*b, *a - multiple * *b);
    }
    for row in above.iter_mut() {
        if let [a, b, ..] = tail_mut(row, j) {
            (*a, *b) = (*b - l * *a, eta * *a + lambda * *b);
        }
    }
    Ok(())
}

/// (y, x) ← (x, y + s x) in exact integers. Returns a bound of the magnitudes that changed.
fn combine_and_exchange(y: &mut [i64], s: i64, x: &mut [i64]) -> Result<u64, IntegerError> {
    let size = if s == 0 { 0 } else { add_multiple(y, s, x)? };
    y.iter_mut().zip(x).for_each(|(y, x)| core::mem::swap(y, x));
    Ok(size)
}

/// y ← y + s x in exact integers. Returns a bound of the magnitudes, at most twice the largest.
fn add_multiple(y: &mut [i64], s: i64, x: &[i64]) -> Result<u64, IntegerError> {
    let mut magnitudes = 0;
    if s.unsigned_abs() <= SMALL_MULTIPLE {
        // No entry is above MAX_ENTRY, so that nothing here overflows: 2⁹ · 2⁵² + 2⁵² < 2⁶³.
        for (y, &x) in y.iter_mut().zip(x) {
            *y = y.wrapping_add(s.wrapping_mul(x));
            magnitudes |= y.unsigned_abs();
        }
        return if magnitudes < MAX_ENTRY.unsigned_abs() { Ok(magnitudes) } else { Err(IntegerError::Overflow) };
    }
    for (y, &x) in y.iter_mut().zip(x) {
        let sum = s.checked_mul(x).and_then(|product| y.checked_add(product)).ok_or(IntegerError::Overflow)?;
        if sum.abs() > MAX_ENTRY {
            return Err(IntegerError::Overflow);
        }
        magnitudes |= sum.unsigned_abs();
        *y = sum;
    }
    Ok(magnitudes)
}

/// A whole number as an integer.
pub(crate) fn to_integer<T: Real>(x: T) -> Result<i64, IntegerError> {
    let x = x.to_f64();
    if libm::fabs(x) <= MAX_ENTRY as f64 { Ok(x as i64) } else { Err(IntegerError::Overflow) }
}

/// z = Zᵀ a, given Zᵀ.
pub fn transform<T: Real>(transform: Mat<'_, i64>, a: &[T], z: &mut [T]) -> Result<(), IntegerError> {
    if transform.cols() != a.len() || transform.rows() != z.len() {
        return Err(IntegerError::Shape);
    }
    for (i, z) in z.iter_mut().enumerate() {
        let terms = transform.row(i).iter().zip(a);
        *z = terms.fold(T::ZERO, |sum, (&t, &a)| sum + T::from_f64(t as f64) * a);
    }
    Ok(())
}

/// a = Z⁻ᵀ z, given Z⁻¹.
pub fn back_transform<T: Real>(inverse: Mat<'_, i64>, z: &[T], a: &mut [T]) -> Result<(), IntegerError> {
    if inverse.rows() != z.len() || inverse.cols() != a.len() {
        return Err(IntegerError::Shape);
    }
    a.fill(T::ZERO);
    for (i, &z) in z.iter().enumerate() {
        for (a, &t) in a.iter_mut().zip(inverse.row(i)) {
            *a += T::from_f64(t as f64) * z;
        }
    }
    Ok(())
}

/// a ← a + Z⁻ᵀ z in exact integers, given Z⁻¹.
pub fn back_transform_integers(inverse: Mat<'_, i64>, z: &[i64], a: &mut [i64]) -> Result<(), IntegerError> {
    if inverse.rows() != z.len() || inverse.cols() != a.len() {
        return Err(IntegerError::Shape);
    }
    for (i, &z) in z.iter().enumerate() {
        add_multiple(a, z, inverse.row(i))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer::success_rate;
    use crate::linalg::spd;
    use proptest::prelude::*;

    struct Reduced {
        u: Vec<f64>,
        d: Vec<f64>,
        transform: Vec<i64>,
        inverse: Vec<i64>,
    }

    fn reduced(n: usize, q: &[f64]) -> Result<Reduced, IntegerError> {
        let mut r = Reduced { u: q.to_vec(), d: vec![0.0; n], transform: vec![0; n * n], inverse: vec![0; n * n] };
        decorrelate(
            &mut MatMut::square(&mut r.u, n)?,
            &mut r.d,
            &mut MatMut::square(&mut r.transform, n)?,
            &mut MatMut::square(&mut r.inverse, n)?,
        )?;
        Ok(r)
    }

    proptest! {
        #[test]
        fn a_unimodular_transform_decorrelates((n, q) in spd::matrix(1..12usize)) {
            let mut original = q.clone();
            let mut before = vec![0.0; n];
            ldl::factor_ltdl(&mut MatMut::square(&mut original, n).unwrap(), &mut before).unwrap();
            let r = reduced(n, &q).unwrap();
            for i in 0..n {
                for j in 0..n {
                    let one: i64 = (0..n).map(|k| r.inverse[i * n + k] * r.transform[j * n + k]).sum();
                    prop_assert_eq!(one, i64::from(i == j));
                }
                prop_assert!((i + 1..n).all(|j| r.u[i * n + j].abs() <= 0.5 + 1e-9), "size reduced");
                prop_assert!((0..i).all(|j| r.u[i * n + j] == 0.0));
            }
            for i in 1..n {
                let l = r.u[(i - 1) * n + i];
                prop_assert!(r.d[i - 1] + l * l * r.d[i] >= r.d[i] * (1.0 - 2.0 * MIN_GAIN), "no swap pays any more");
            }
            prop_assert!((success_rate::adop(&r.d) / success_rate::adop(&before) - 1.0).abs() < 1e-9);
            let (rate, old) = (success_rate::bootstrapped(&r.d).success, success_rate::bootstrapped(&before).success);
            prop_assert!(rate >= old - 1e-9);
            // Zᵀ Q Z = U D Uᵀ
            let z: Vec<f64> = r.transform.iter().map(|&t| t as f64).collect();
            let zqz = spd::product(n, &spd::product(n, &z, &q), &spd::transposed(n, &z));
            let ud: Vec<f64> = (0..n * n).map(|k| r.u[k] * r.d[k % n]).collect();
            let udu = spd::product(n, &ud, &spd::transposed(n, &r.u));
            let size = (0..n).map(|i| q[i * (n + 1)]).fold(0.0, f64::max);
            for k in 0..n * n {
                prop_assert!((zqz[k] - udu[k]).abs() < 1e-8 * size);
            }
        }

        #[test]
        fn there_and_back((n, q) in spd::matrix(1..12usize), a in proptest::collection::vec(-100.0..100.0f64, 12)) {
            let r = reduced(n, &q).unwrap();
            let (transform_view, inverse_view) =
                (Mat::square(&r.transform, n).unwrap(), Mat::square(&r.inverse, n).unwrap());
            let (mut z, mut back) = (vec![0.0; n], vec![0.0; n]);
            transform(transform_view, &a[..n], &mut z).unwrap();
            back_transform(inverse_view, &z, &mut back).unwrap();
            let growth: i64 = r.inverse.iter().chain(&r.transform).map(|t| t.abs()).max().unwrap();
            for i in 0..n {
                prop_assert!((back[i] - a[i]).abs() < 1e-12 * (growth * growth) as f64);
            }
        }
    }

    #[test]
    fn what_cannot_be_decorrelated_is_refused() {
        assert_eq!(reduced(2, &[1.0, 1.0, 1.0, 1.0]).err(), Some(IntegerError::NotPositiveDefinite { pivot: 0 }));
        assert_eq!(reduced(2, &[1.0, 0.0, 0.0, f64::NAN]).err(), Some(IntegerError::NotPositiveDefinite { pivot: 1 }));
        // A multiple of 1e20 does not fit an integer.
        assert_eq!(reduced(2, &[2e40, 1e20, 1e20, 1.0]).err(), Some(IntegerError::Overflow));
        let mut d = [0.0; 2];
        let (mut q, mut small, mut other) = ([1.0, 0.0, 0.0, 1.0], [0; 1], [0; 4]);
        let refused = decorrelate(
            &mut MatMut::square(&mut q, 2).unwrap(),
            &mut d,
            &mut MatMut::square(&mut small, 1).unwrap(),
            &mut MatMut::square(&mut other, 2).unwrap(),
        );
        assert_eq!(refused, Err(IntegerError::Shape));
    }
}
