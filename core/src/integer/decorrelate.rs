//! Decorrelation of ambiguities: the Z-transform of LAMBDA.
//!
//! Finds an integer Z with |det Z| = 1 such that Q_z = Zᵀ Q Z = Lᵀ D L is as diagonal as integers allow, with d
//! descending towards the last element, which is fixed first. P. J. G. Teunissen, J. Geodesy 70 (1995), sec. 5;
//! X.-W. Chang, X. Yang & T. Zhou, *MLAMBDA*, J. Geodesy 79 (2005), sec. 3: integer Gauss transforms on L, and a swap
//! of neighbours j, j+1 wherever it makes the conditional variance of the later one smaller:
//! δ = d_j + l²_{j+1,j} d_{j+1} < d_{j+1}. Equivalent to LLL reduction with δ ≈ 1.
//!
//! Storage. U = Lᵀ is kept, unit upper triangular, Q_z = U D Uᵀ, because then every step works on contiguous rows;
//! likewise Zᵀ and Z⁻¹. Transforms are exact `i64`.
//!
//! Cost O(n³) to factor, then about n² a swap; at most [`MAX_SWAPS_PER_SQUARE`]·n² swaps, after which the transform
//! is still valid, only less reduced.

use super::IntegerError;
use crate::linalg::{Mat, MatMut, axpy, ldl};
use crate::real::Real;

/// Bound on swaps, as a multiple of n².
pub const MAX_SWAPS_PER_SQUARE: usize = 64;

/// A swap must lower the variance by this fraction, so that rounding cannot make two swaps undo each other for ever.
const MIN_GAIN: f64 = 1e-6;

/// Integer entries stay below this, exact in `f64` too.
const MAX_ENTRY: i64 = 1 << 52;

/// Decorrelates in place.
///
/// * `q` (n × n): Q on entry, lower triangle read; U on return (zeros below the diagonal).
/// * `d` (n): returns D `[cycles²]`.
/// * `transform` (n × n): returns Zᵀ.
/// * `inverse` (n × n): returns Z⁻¹.
///
/// Returns the number of swaps.
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
    ldl::factor_ltdl(q, d)?;
    for i in 0..n {
        q.row_mut(i)[i + 1..].fill(T::ZERO);
    }
    q.transpose();
    set_identity(transform);
    set_identity(inverse);
    reduce(q, d, transform, inverse)
}

/// Sets a square matrix to the identity.
fn set_identity(matrix: &mut MatMut<'_, i64>) {
    matrix.fill(0);
    for i in 0..matrix.rows() {
        *matrix.at_mut(i, i) = 1;
    }
}

/// The reduction proper, from the last pair upwards and back after every swap. Rows from `fresh` down to 0 still need
/// Gauss transforms; rows after it have had theirs.
fn reduce<T: Real>(
    u: &mut MatMut<'_, T>,
    d: &mut [T],
    transform: &mut MatMut<'_, i64>,
    inverse: &mut MatMut<'_, i64>,
) -> Result<usize, IntegerError> {
    let n = d.len();
    let keep = T::from_f64(1.0 - MIN_GAIN.max(8.0 * T::EPSILON.to_f64()));
    let limit = MAX_SWAPS_PER_SQUARE * n * n;
    let mut swaps = 0;
    let mut fresh = n.saturating_sub(1);
    let mut next = n.saturating_sub(1);
    while next > 0 {
        let j = next - 1;
        if j <= fresh {
            for i in j + 1..n {
                subtract_multiple(u, transform, inverse, j, i)?;
            }
        }
        let l = u.at(j, j + 1);
        let delta = d[j] + l * l * d[j + 1];
        if delta < keep * d[j + 1] && swaps < limit {
            swap(u, d, delta, j);
            transform.swap_rows(j, j + 1);
            inverse.swap_rows(j, j + 1);
            swaps += 1;
            fresh = j;
            next = n - 1;
        } else {
            next -= 1;
        }
    }
    Ok(swaps)
}

/// Integer Gauss transform: takes rint(u_ji) times component i from component j, so that |u_ji| ≤ ½.
fn subtract_multiple<T: Real>(
    u: &mut MatMut<'_, T>,
    transform: &mut MatMut<'_, i64>,
    inverse: &mut MatMut<'_, i64>,
    j: usize,
    i: usize,
) -> Result<(), IntegerError> {
    let mu = u.at(j, i).round();
    if mu == T::ZERO {
        return Ok(());
    }
    let (row_j, row_i) = u.row_pair(j, i);
    axpy(&mut row_j[i..], -mu, &row_i[i..]);
    let mu = to_integer(mu)?;
    let (row_j, row_i) = transform.row_pair(j, i);
    add_multiple(row_j, -mu, row_i)?;
    let (row_i, row_j) = inverse.row_pair(i, j);
    add_multiple(row_i, mu, row_j)
}

/// Exchanges components j and j+1; `delta` is the variance of the former j given all after j+1.
fn swap<T: Real>(u: &mut MatMut<'_, T>, d: &mut [T], delta: T, j: usize) {
    let l = u.at(j, j + 1);
    let eta = d[j] / delta;
    let lambda = d[j + 1] * l / delta;
    d[j] = eta * d[j + 1];
    d[j + 1] = delta;
    for k in 0..j {
        let row = u.row_mut(k);
        let (a, b) = (row[j], row[j + 1]);
        row[j] = b - l * a;
        row[j + 1] = eta * a + lambda * b;
    }
    *u.at_mut(j, j + 1) = lambda;
    for k in j + 2..d.len() {
        let a = u.at(j, k);
        *u.at_mut(j, k) = u.at(j + 1, k);
        *u.at_mut(j + 1, k) = a;
    }
}

/// y ← y + s x in exact integers.
fn add_multiple(y: &mut [i64], s: i64, x: &[i64]) -> Result<(), IntegerError> {
    for (y, &x) in y.iter_mut().zip(x) {
        let sum = s.checked_mul(x).and_then(|product| y.checked_add(product)).ok_or(IntegerError::Overflow)?;
        if sum.abs() > MAX_ENTRY {
            return Err(IntegerError::Overflow);
        }
        *y = sum;
    }
    Ok(())
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
