//! The time step of a filter: the moments of x⁺ = F x + b + q from those of x.
//!
//! ```text
//! m⁻ = F m + b,   P⁻ = F P Fᵀ + Q
//! ```
//! Greiff et al. (2023), before eq. (4), with F rectangular: see [`super::step`]. Cost about z n + z n⁺/2 multiply-adds
//! for z entries in F, against n⁺ n² + n⁺² n/2 of a dense one. Lower triangles only. Panic contract: none; entries
//! outside of the dimensions are ignored.

use super::step::Step;
use super::{Moments, MomentsMut, SmoothError, shape};
use crate::linalg::{Mat, MatMut, symmetric};
use crate::real::Real;

/// The moments of x⁺. `work` is n⁺ × n and returns F P.
#[inline(always)]
pub fn predict<T: Real>(
    step: &Step<'_, T>,
    filtered: Moments<'_, T>,
    predicted: &mut MomentsMut<'_, T>,
    work: &mut MatMut<'_, T>,
) -> Result<(), SmoothError> {
    let (n, after) = (step.map.columns, step.map.rows());
    filtered.fits(n)?;
    predicted.as_ref().fits(after)?;
    shape([step.offset.len(), work.rows(), work.cols()], [after, after, n])?;
    map_mean(step, filtered.mean, predicted.mean);
    map_rows(step, filtered.covariance, work);
    for i in 0..after {
        let mapped = work.row(i);
        for (j, entry) in predicted.covariance.row_mut(i).iter_mut().take(i + 1).enumerate() {
            *entry = sparse_dot(step.map.row(j), mapped);
        }
    }
    add_noise(step, &mut predicted.covariance);
    Ok(())
}

/// out ← F x + b.
#[inline(always)]
pub(super) fn map_mean<T: Real>(step: &Step<'_, T>, x: &[T], out: &mut [T]) {
    for (i, (out, &offset)) in out.iter_mut().zip(step.offset).enumerate() {
        *out = offset + sparse_dot(step.map.row(i), x);
    }
}

/// `out` ← F P for the symmetric P of which the lower triangle counts.
#[inline(always)]
pub(super) fn map_rows<T: Real>(step: &Step<'_, T>, p: Mat<'_, T>, out: &mut MatMut<'_, T>) {
    for (i, row) in out.iter_mut().enumerate() {
        row.fill(T::ZERO);
        for &(column, coefficient) in step.map.row(i).iter().filter(|(column, _)| *column < p.rows()) {
            symmetric::add_row(p, column, coefficient, row);
        }
    }
}

/// Σ coefficient · x_column.
#[inline(always)]
fn sparse_dot<T: Real>(entries: &[(usize, T)], x: &[T]) -> T {
    entries
        .iter()
        .filter_map(|&(column, coefficient)| x.get(column).map(|&x| coefficient * x))
        .fold(T::ZERO, |sum, term| sum + term)
}

/// P ← P + Q in the lower triangle.
#[inline(always)]
pub(super) fn add_noise<T: Real>(step: &Step<'_, T>, p: &mut MatMut<'_, T>) {
    for block in step.noise {
        for (&i, shape) in block.states.iter().zip(&block.shape).take(block.dim) {
            for (&j, &shape) in block.states.iter().zip(shape).take(block.dim).filter(|(j, _)| **j <= i) {
                p.add(i, j, block.scale * shape);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::{Problem, problem};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_the_dense_formula(problem in problem()) {
            let Problem { transitions, prior, .. } = problem;
            let transition = &transitions[0];
            let step = transition.step();
            let (n, after) = (step.map.columns, step.map.rows());
            let (mut mean, mut p, mut work) = (vec![f64::NAN; after], vec![f64::NAN; after * after], vec![0.0; after * n]);
            let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
            let mut work = MatMut::new(&mut work, after, n, n).unwrap();
            predict(&step, Moments::packed(&prior.0, &prior.1).unwrap(), &mut predicted, &mut work).unwrap();
            let f = transition.dense();
            let q = transition.noise();
            for i in 0..after {
                let expected: f64 = (0..n).map(|a| f[i * n + a] * prior.0[a]).sum::<f64>() + step.offset[i];
                prop_assert!((mean[i] - expected).abs() < 1e-12 * (1.0 + expected.abs()));
                for j in 0..=i {
                    let mut expected = q[i * after + j];
                    for a in 0..n {
                        for b in 0..n {
                            expected += f[i * n + a] * prior.1[a.max(b) * n + a.min(b)] * f[j * n + b];
                        }
                    }
                    prop_assert!((p[i * after + j] - expected).abs() < 1e-11 * (1.0 + expected.abs()));
                }
                prop_assert!(p[i * after + i + 1..(i + 1) * after].iter().all(|x| x.is_nan()));
            }
        }
    }

    #[test]
    fn entries_outside_are_ignored_and_shapes_are_checked() {
        use super::super::step::{Block, SparseMap};
        let entries = [(0, 2.0), (7, 1.0)];
        let map = SparseMap { ends: &[2], entries: &entries, columns: 1 };
        let noise = [Block { states: [4, 0, 9], dim: 9, shape: [[1.0; 3]; 3], scale: 0.5, component: None }];
        let step = Step { map, offset: &[1.0], noise: &noise };
        let (mut mean, mut p, mut work) = ([0.0], [0.0], [0.0]);
        let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
        let filtered = Moments::packed(&[3.0], &[1.0]).unwrap();
        predict(&step, filtered, &mut predicted, &mut MatMut::square(&mut work, 1).unwrap()).unwrap();
        assert_eq!((mean, p), ([7.0], [4.5]));
        let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
        let wide = Moments::packed(&[3.0, 0.0], &[1.0; 4]).unwrap();
        let refused = predict(&step, wide, &mut predicted, &mut MatMut::square(&mut work, 1).unwrap());
        assert_eq!(refused, Err(SmoothError::Shape));
    }
}
