//! Mean and covariance of some states given that some ambiguities are integers.
//!
//! ```text
//! x̂|ň = x̂ − Q_xn Q_nn⁻¹ (n̂ − ň)          P|ň = P_xx − Q_xn Q_nn⁻¹ Q_nx
//! ```
//! P. J. G. Teunissen (1995), eq. (2.6). With Q_nn = L Lᵀ, W = L⁻¹ Q_nx (m × s) and z = L⁻¹ (n̂ − ň) this is
//! x̂ − Wᵀ z and P_xx − Wᵀ W. Cost m³/3 + m² s + m s²; the joint density is not touched.
//!
//! Integers of *combinations* z = Z₂ᵀ n, as [`super::partial::resolve_partial`] finds them, come with their factors,
//! Z₂ᵀ Q_nn Z₂ = U D Uᵀ. With W = U⁻¹ Z₂ᵀ Q_nx and e = U⁻¹ (ẑ − ž) it is x̂ − Wᵀ D⁻¹ e and P_xx − Wᵀ D⁻¹ W; cost
//! m n s + m² s + m s².

use super::IntegerError;
use super::partial::PartialResolution;
use crate::linalg::{Mat, MatMut, axpy, block, cholesky, dot, triangular};
use crate::real::Real;

/// The states `states` (s) of the density (`mean`, `covariance`) given that the states `ambiguities` (m) have the
/// `values`. Indices refer to `mean`.
///
/// `factor` (m × m), `cross` (m × s) and `residual` (m) are workspace; `conditional_mean` (s) and
/// `conditional_covariance` (s × s) return the result. Returns the squared norm (n̂ − ň)ᵀ Q_nn⁻¹ (n̂ − ň), χ² with m
/// degrees of freedom if the integers are right.
pub fn condition_on_integers<T: Real>(
    mean: &[T],
    covariance: Mat<'_, T>,
    states: &[usize],
    ambiguities: &[usize],
    values: &[T],
    factor: &mut MatMut<'_, T>,
    cross: &mut MatMut<'_, T>,
    residual: &mut [T],
    conditional_mean: &mut [T],
    conditional_covariance: &mut MatMut<'_, T>,
) -> Result<T, IntegerError> {
    let (n, s, m) = (mean.len(), states.len(), ambiguities.len());
    let fits = [covariance.rows(), covariance.cols()] == [n; 2]
        && [values.len(), factor.rows(), factor.cols(), cross.rows(), residual.len()] == [m; 5]
        && [cross.cols(), conditional_mean.len()] == [s; 2]
        && [conditional_covariance.rows(), conditional_covariance.cols()] == [s; 2]
        && states.iter().chain(ambiguities).all(|&i| i < n);
    if !fits {
        return Err(IntegerError::Shape);
    }
    let rows = factor.iter_mut().zip(cross.iter_mut()).zip(residual.iter_mut());
    for ((&ambiguity, &value), ((factor, cross), residual)) in ambiguities.iter().zip(values).zip(rows) {
        for (entry, &column) in factor.iter_mut().zip(ambiguities) {
            *entry = covariance.at(ambiguity, column);
        }
        for (entry, &state) in cross.iter_mut().zip(states) {
            *entry = covariance.at(ambiguity, state);
        }
        *residual = *mean.get(ambiguity).ok_or(IntegerError::Shape)? - value;
    }
    cholesky::factor(factor)?;
    triangular::forward_rows(factor.as_ref(), cross)?;
    triangular::forward(factor.as_ref(), residual)?;
    let norm = dot(residual, residual);
    if !norm.is_finite() {
        return Err(IntegerError::NotFinite);
    }
    let rows = conditional_mean.iter_mut().zip(conditional_covariance.iter_mut());
    for (&state, (conditional_mean, row)) in states.iter().zip(rows) {
        *conditional_mean = *mean.get(state).ok_or(IntegerError::Shape)?;
        for (entry, &column) in row.iter_mut().zip(states) {
            *entry = covariance.at(state, column);
        }
    }
    for (&z, row) in residual.iter().zip(cross.iter()) {
        axpy(conditional_mean, -z, row);
    }
    block::subtract_gram(conditional_covariance, cross.as_ref());
    Ok(norm)
}

/// The states `states` (s) of the density (`mean`, `covariance`) given the combinations `found` of the states
/// `ambiguities` (n).
///
/// `cross` (m × s) is workspace; `conditional_mean` (s) and `conditional_covariance` (s × s) return the result.
pub fn condition_on_combinations<T: Real>(
    mean: &[T],
    covariance: Mat<'_, T>,
    states: &[usize],
    ambiguities: &[usize],
    found: &PartialResolution<'_, T>,
    cross: &mut MatMut<'_, T>,
    conditional_mean: &mut [T],
    conditional_covariance: &mut MatMut<'_, T>,
) -> Result<(), IntegerError> {
    let (n, s, m) = (mean.len(), states.len(), found.values.len());
    let fits = [covariance.rows(), covariance.cols()] == [n; 2]
        && [found.combinations.cols(), found.combinations.rows()] == [ambiguities.len(), m]
        && [cross.rows(), cross.cols()] == [m, s]
        && [conditional_mean.len(), conditional_covariance.rows(), conditional_covariance.cols()] == [s; 3]
        && states.iter().chain(ambiguities).all(|&i| i < n);
    if !fits {
        return Err(IntegerError::Shape);
    }
    let rows = conditional_mean.iter_mut().zip(conditional_covariance.iter_mut());
    for (&state, (conditional_mean, row)) in states.iter().zip(rows) {
        *conditional_mean = *mean.get(state).ok_or(IntegerError::Shape)?;
        for (entry, &column) in row.iter_mut().zip(states) {
            *entry = covariance.at(state, column);
        }
    }
    for i in (0..m).rev() {
        for (entry, &state) in cross.row_mut(i).iter_mut().zip(states) {
            *entry = T::ZERO;
            for (&t, &ambiguity) in found.combinations.row(i).iter().zip(ambiguities).filter(|(t, _)| **t != 0) {
                *entry += T::from_f64(t as f64) * covariance.at(ambiguity, state);
            }
        }
        for k in i + 1..m {
            let (row, later) = cross.row_pair(i, k);
            axpy(row, -found.factor.at(i, k), later);
        }
    }
    for (row, (&variance, &residual)) in cross.iter_mut().zip(found.variances.iter().zip(found.residual)) {
        axpy(conditional_mean, -residual / variance, row);
        let sigma = variance.sqrt();
        row.iter_mut().for_each(|entry| *entry /= sigma);
    }
    block::subtract_gram(conditional_covariance, cross.as_ref());
    if conditional_mean.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(IntegerError::NotFinite) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::block::update_block;
    use crate::linalg::spd;
    use proptest::prelude::*;

    struct Conditioned {
        mean: Vec<f64>,
        covariance: Vec<f64>,
        norm: Result<f64, IntegerError>,
    }

    fn condition(mean: &[f64], p: &[f64], states: &[usize], ambiguities: &[usize], values: &[f64]) -> Conditioned {
        let (n, s, m) = (mean.len(), states.len(), ambiguities.len());
        let (mut factor, mut cross, mut residual) = (vec![0.0; m * m], vec![0.0; m * s], vec![0.0; m]);
        let (mut conditional, mut covariance) = (vec![0.0; s], vec![0.0; s * s]);
        let norm = condition_on_integers(
            mean,
            Mat::square(p, n).unwrap(),
            states,
            ambiguities,
            values,
            &mut MatMut::square(&mut factor, m).unwrap(),
            &mut MatMut::new(&mut cross, m, s, s).unwrap(),
            &mut residual,
            &mut conditional,
            &mut MatMut::square(&mut covariance, s).unwrap(),
        );
        Conditioned { mean: conditional, covariance, norm }
    }

    proptest! {
        /// Conditioning is a measurement of the ambiguities without noise.
        #[test]
        fn it_is_an_update_without_noise(
            (n, p) in spd::matrix(3..9usize),
            mean in proptest::collection::vec(-5.0..5.0f64, 8),
        ) {
            let mean = &mean[..n];
            let states: Vec<usize> = (0..n / 2).collect();
            let ambiguities: Vec<usize> = (n / 2..n).rev().collect();
            let m = ambiguities.len();
            let values: Vec<f64> = ambiguities.iter().map(|&i| mean[i].round()).collect();
            let got = condition(mean, &p, &states, &ambiguities, &values);

            let mut h = vec![0.0; m * n];
            let mut innovation = vec![0.0; m];
            for (i, &ambiguity) in ambiguities.iter().enumerate() {
                h[i * n + ambiguity] = 1.0;
                innovation[i] = values[i] - mean[ambiguity];
            }
            let (mut updated, mut covariance) = (mean.to_vec(), p.clone());
            let update = update_block(
                &mut updated,
                &mut MatMut::square(&mut covariance, n).unwrap(),
                Mat::new(&h, m, n, n).unwrap(),
                &mut innovation,
                &mut MatMut::square(&mut vec![0.0; m * m], m).unwrap(),
                &mut MatMut::new(&mut vec![0.0; m * n], m, n, n).unwrap(),
            )
            .unwrap();
            prop_assert!((got.norm.unwrap() / update.normalized_innovation_squared - 1.0).abs() < 1e-9);
            let s = states.len();
            for i in 0..s {
                prop_assert!((got.mean[i] - updated[i]).abs() < 1e-9 * mean[i].abs().max(updated[i].abs()).max(1.0));
                for j in 0..s {
                    prop_assert!((got.covariance[i * s + j] - covariance[i * n + j]).abs() < 1e-12 * p[i * (n + 1)].max(p[j * (n + 1)]));
                    prop_assert_eq!(got.covariance[i * s + j], got.covariance[j * s + i]);
                }
            }
        }
    }

    /// Correlation ½ between unit variances: x|n = ½ (ň − n̂), variance ¾.
    #[test]
    fn by_hand() {
        let got = condition(&[0.0, 0.4], &[1.0, 0.5, 0.5, 1.0], &[0], &[1], &[1.0]);
        assert!((got.mean[0] - 0.3).abs() < 1e-15);
        assert!((got.covariance[0] - 0.75).abs() < 1e-15);
        assert!((got.norm.unwrap() - 0.36).abs() < 1e-15);
        let nothing = condition(&[2.0, 0.4], &[1.0, 0.5, 0.5, 1.0], &[0], &[], &[]);
        assert_eq!((nothing.mean, nothing.covariance, nothing.norm), (vec![2.0], vec![1.0], Ok(0.0)));
    }

    #[test]
    fn bad_arguments_are_refused() {
        let p = [1.0, 0.5, 0.5, 1.0];
        assert_eq!(condition(&[0.0, 0.4], &p, &[0], &[2], &[1.0]).norm, Err(IntegerError::Shape));
        assert_eq!(condition(&[0.0, 0.4], &p, &[2], &[1], &[1.0]).norm, Err(IntegerError::Shape));
        let twice = condition(&[0.0, 0.4], &p, &[0], &[1, 1], &[1.0, 1.0]).norm;
        assert_eq!(twice, Err(IntegerError::NotPositiveDefinite { pivot: 1 }));
        assert_eq!(condition(&[0.0, f64::NAN], &p, &[0], &[1], &[1.0]).norm, Err(IntegerError::NotFinite));
        let zero = condition(&[0.0, 0.4], &[1.0, 0.0, 0.0, 0.0], &[0], &[1], &[1.0]).norm;
        assert_eq!(zero, Err(IntegerError::NotPositiveDefinite { pivot: 0 }));
    }
}
