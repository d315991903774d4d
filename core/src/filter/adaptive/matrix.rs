//! R* as a whole matrix.
//!
//! [`blend`] with innovations is what L. Wang et al. (2022) print in eq. (25) and is not positive definite; with residuals
//! it is, for as long as the measurements stay the same. Both need [`floor`] once channels restart, and [`remap`] when
//! satellites come, go, or give the reference to another.
//!
//! The floor: with R₀ = L Lᵀ the generalised eigenvalues of R* are those of L⁻¹ R* L⁻ᵀ = Vᵀ Λ V; they are clipped to
//! [low, high], and R* = (L Vᵀ) Λ' (L Vᵀ)ᵀ is positive definite by construction.
//!
//! Cost for m measurements: m² for a blend, about 50 m³ for the floor (Jacobi). No panics.

use super::ratio::within;
use crate::linalg::{LinalgError, Mat, MatMut, cholesky, dot, eigen, head, triangular};
use crate::real::Real;

/// What an epoch says of R, see [`super`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// ν νᵀ − H P⁻ Hᵀ, of innovations.
    Innovation,
    /// ε εᵀ + H P⁺ Hᵀ, of residuals.
    Residual,
}

/// R ← (1 − β) R + β E, for the innovations or residuals `x` (m) and `spread` = H P Hᵀ (m × m), prior or posterior.
pub fn blend<T: Real>(
    r: &mut MatMut<'_, T>,
    beta: T,
    x: &[T],
    spread: Mat<'_, T>,
    form: Form,
) -> Result<(), LinalgError> {
    let m = x.len();
    if [r.rows(), r.cols(), spread.rows(), spread.cols()] != [m; 4] {
        return Err(LinalgError::Shape);
    }
    let sign = if form == Form::Innovation { -T::ONE } else { T::ONE };
    for ((row, spread), &own) in r.iter_mut().zip(spread.iter()).zip(x) {
        for ((entry, &spread), &other) in row.iter_mut().zip(spread).zip(x) {
            *entry = (T::ONE - beta) * *entry + beta * (own * other + sign * spread);
        }
    }
    Ok(())
}

/// Whether R is positive definite: its Cholesky factor into `factor` (m × m), or which row it fails at.
pub fn check<T: Real>(r: Mat<'_, T>, factor: &mut MatMut<'_, T>) -> Result<(), LinalgError> {
    factor.copy_from(r)?;
    cholesky::factor(factor)
}

/// Workspace of [`floor`], for m measurements.
#[derive(Debug)]
pub struct FloorWork<'w, T> {
    /// m × m.
    pub factor: MatMut<'w, T>,
    /// m × m.
    pub square: MatMut<'w, T>,
    /// m × m.
    pub vectors: MatMut<'w, T>,
    /// m.
    pub values: &'w mut [T],
}

/// Clips the generalised eigenvalues of R by R₀ to [low, high], 0 < low ≤ high. R stays as it was on an error.
pub fn floor<T: Real>(
    r: &mut MatMut<'_, T>,
    r0: Mat<'_, T>,
    [low, high]: [T; 2],
    work: &mut FloorWork<'_, T>,
) -> Result<(), LinalgError> {
    let m = work.values.len();
    let FloorWork { factor, square, vectors, values } = work;
    factor.copy_from(r0)?;
    cholesky::factor(factor)?;
    let l = factor.as_ref();
    square.copy_from(r.as_ref())?;
    square.symmetrize();
    triangular::forward_rows(l, square)?;
    square.transpose();
    triangular::forward_rows(l, square)?;
    square.symmetrize();
    eigen::decompose(square, values, vectors)?;
    // Columns of L Vᵀ √Λ', as the rows of `square`.
    for ((vector, &value), column) in vectors.iter().zip(values.iter()).zip(square.iter_mut()) {
        let root = within(value, [low, high]).sqrt();
        for (i, (entry, l)) in column.iter_mut().zip(l.iter()).enumerate() {
            *entry = root * dot(head(l, i + 1), vector);
        }
    }
    square.transpose();
    for i in 0..m {
        for j in 0..=i {
            let entry = dot(square.row(i), square.row(j));
            r.set(i, j, entry);
            r.set(j, i, entry);
        }
    }
    Ok(())
}

/// Where a measurement of now comes from: up to two of those before, with their signs. A double difference to a new
/// reference is the old one minus that of the new reference; that of the old reference is minus that of the new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// New, or come again.
    New,
    /// Plus that one.
    Same(usize),
    /// The first minus the second.
    Difference(usize, usize),
    /// Minus that one.
    Negative(usize),
}

impl Origin {
    /// Indices and signs.
    fn terms<T: Real>(self) -> [(usize, T); 2] {
        match self {
            Self::New => [(0, T::ZERO); 2],
            Self::Same(i) => [(i, T::ONE), (0, T::ZERO)],
            Self::Difference(i, j) => [(i, T::ONE), (j, -T::ONE)],
            Self::Negative(i) => [(i, -T::ONE), (0, T::ZERO)],
        }
    }
}

/// `to` ← T R Tᵀ for the origins of all measurements of now (m); rows and columns of new ones are those of R₀ (m × m). Where
/// there are new ones, `to` may be indefinite: [`floor`] mends that.
pub fn remap<T: Real>(
    to: &mut MatMut<'_, T>,
    from: Mat<'_, T>,
    r0: Mat<'_, T>,
    origins: &[Origin],
) -> Result<(), LinalgError> {
    let m = origins.len();
    let known = |origin: &Origin| match *origin {
        Origin::New => true,
        Origin::Same(i) | Origin::Negative(i) => i < from.rows(),
        Origin::Difference(i, j) => i < from.rows() && j < from.rows(),
    };
    if [to.rows(), to.cols(), r0.rows(), r0.cols()] != [m; 4] || from.rows() != from.cols() {
        return Err(LinalgError::Shape);
    }
    if !origins.iter().all(known) {
        return Err(LinalgError::Shape);
    }
    for (i, (row, own)) in to.iter_mut().zip(origins).enumerate() {
        for (j, (entry, other)) in row.iter_mut().zip(origins).enumerate() {
            if *own == Origin::New || *other == Origin::New {
                *entry = r0.at(i, j);
                continue;
            }
            let mut sum = T::ZERO;
            for (a, x) in own.terms::<T>() {
                for (b, y) in other.terms::<T>() {
                    if x != T::ZERO && y != T::ZERO {
                        sum += x * y * from.at(a, b);
                    }
                }
            }
            *entry = sum;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::spd;
    use proptest::prelude::*;

    fn floored(r: &[f64], r0: &[f64], m: usize, bounds: [f64; 2]) -> Vec<f64> {
        let mut r = r.to_vec();
        let [mut factor, mut square, mut vectors] = [(); 3].map(|()| vec![0.0; m * m]);
        let mut work = FloorWork {
            factor: MatMut::square(&mut factor, m).unwrap(),
            square: MatMut::square(&mut square, m).unwrap(),
            vectors: MatMut::square(&mut vectors, m).unwrap(),
            values: &mut vec![0.0; m],
        };
        floor(&mut MatMut::square(&mut r, m).unwrap(), Mat::square(r0, m).unwrap(), bounds, &mut work).unwrap();
        r
    }

    /// diag(−1, 0.5, 9) by R₀ = diag(1, 1, 4): ratios −1, 0.5, 2.25 become 0.25, 0.5, 2.
    #[test]
    fn a_diagonal_is_clipped() {
        let r = floored(
            &[-1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 9.0],
            &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0],
            3,
            [0.25, 2.0],
        );
        for (got, want) in r.iter().zip([0.25, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 8.0]) {
            assert!((got - want).abs() < 1e-14, "{r:?}");
        }
    }

    /// Eq. (25) as printed: any β loses definiteness where the innovation says less than the prior.
    #[test]
    fn the_literal_form_is_refused() {
        let (mut r, mut factor) = ([1.0, 0.5, 0.5, 1.0], [0.0; 4]);
        let mut r = MatMut::square(&mut r, 2).unwrap();
        blend(&mut r, 0.05, &[1.0, 1.0], Mat::square(&[100.0, 0.0, 0.0, 100.0], 2).unwrap(), Form::Innovation).unwrap();
        // 0.95 + 0.05 (1 − 100) = −4.
        assert!((r.at(0, 0) + 4.0).abs() < 1e-12);
        let refused = check(r.as_ref(), &mut MatMut::square(&mut factor, 2).unwrap());
        assert_eq!(refused, Err(LinalgError::NotPositiveDefinite { pivot: 0 }));
        assert_eq!(
            blend(&mut r, 0.05, &[1.0], Mat::square(&[1.0], 1).unwrap(), Form::Innovation),
            Err(LinalgError::Shape)
        );
    }

    proptest! {
        /// Within the bounds nothing changes; beyond them all generalised eigenvalues end inside.
        #[test]
        fn the_floor_keeps_what_is_good((m, r0) in spd::matrix(1..8usize), x in prop::collection::vec(-30.0..30.0, 64)) {
            let same = floored(&r0, &r0, m, [0.25, 4.0]);
            let size = r0.iter().fold(0.0f64, |size, entry| size.max(entry.abs()));
            prop_assert!(same.iter().zip(&r0).all(|(a, b)| (a - b).abs() < 1e-11 * size));
            let any: Vec<f64> = (0..m * m).map(|k| x[(k / m).max(k % m) * 8 + (k / m).min(k % m)]).collect();
            let mut good = floored(&any, &r0, m, [0.25, 4.0]);
            prop_assert!(cholesky::factor(&mut MatMut::square(&mut good, m).unwrap()).is_ok());
        }

        /// R of single differences σᵢ²: R of double differences to one reference becomes that to another, exactly as if it
        /// had been made there.
        #[test]
        fn a_change_of_reference_is_exact(sigmas in prop::collection::vec(0.1..9.0, 5), old in 0usize..5, new in 0usize..5) {
            let double = |reference: usize| -> Vec<f64> {
                let others: Vec<usize> = (0..5).filter(|&i| i != reference).collect();
                others.iter().flat_map(|&i| others.iter().map(move |&j| (i, j)))
                    .map(|(i, j)| sigmas[reference] + if i == j { sigmas[i] } else { 0.0 }).collect()
            };
            let place = |satellite: usize| satellite - usize::from(satellite > old);
            let origins: Vec<Origin> = (0..5).filter(|&i| i != new).map(|i| {
                if old == new { Origin::Same(place(i)) }
                else if i == old { Origin::Negative(place(new)) }
                else { Origin::Difference(place(i), place(new)) }
            }).collect();
            let (from, expected) = (double(old), double(new));
            let mut to = [0.0; 16];
            let r0 = [0.0; 16];
            let mut view = MatMut::square(&mut to, 4).unwrap();
            remap(&mut view, Mat::square(&from, 4).unwrap(), Mat::square(&r0, 4).unwrap(), &origins).unwrap();
            prop_assert!(to.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{:?} {:?}", to, expected);
        }
    }

    #[test]
    fn new_measurements_begin_as_r0_says() {
        let from = [4.0, 1.0, 1.0, 9.0];
        let r0 = [2.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 2.0];
        let mut to = [0.0; 9];
        let mut view = MatMut::square(&mut to, 3).unwrap();
        let (from, r0) = (Mat::square(&from, 2).unwrap(), Mat::square(&r0, 3).unwrap());
        remap(&mut view, from, r0, &[Origin::Same(1), Origin::New, Origin::Same(0)]).unwrap();
        assert_eq!(to, [9.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 4.0]);
        let mut view = MatMut::square(&mut to, 3).unwrap();
        assert_eq!(remap(&mut view, from, r0, &[Origin::Same(2); 3]), Err(LinalgError::Shape));
        assert_eq!(remap(&mut view, from, r0, &[Origin::New]), Err(LinalgError::Shape));
    }
}
