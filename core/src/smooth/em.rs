//! Sums of which the M-step of EM is the quotient.
//!
//! With Q⁻¹ linear in the inverse scales of disjoint blocks, the scale that maximises the expected likelihood is
//! ```text
//! scale = Σ_k E[q_bᵀ shape⁻¹ q_b | Y] / Σ_k dim b
//! ```
//! Greiff et al. (2023), eqs. (11) to (13), with the trace of (12) in terms of the disturbance q itself. Given what the
//! smoother knows of x⁺ the moments of q follow without gain and lag-one covariance, from d = mˢ⁺ − m⁻ alone:
//! ```text
//! r = (P⁻)⁻¹ d,   N = (P⁻)⁻¹ − (P⁻)⁻¹ Pˢ⁺ (P⁻)⁻¹,   E[q qᵀ | Y] = Q − Q N Q + (Q r)(Q r)ᵀ
//! ```
//! which is what [`super::disturbance`] carries along, and equal to the centred form of (13); the raw second moments
//! of (13) cancel in many digits. For a block of covariance s V (scale s, shape V) the trace is
//! ```text
//! E[q_bᵀ V⁻¹ q_b | Y] = s dim b − s² Tr(V N_bb) + s² r_bᵀ V r_b
//! ```
//! so no shape is ever inverted.
//!
//! Measurement noise: with R = scale · R⁰ on some rows, residuals r = y − h(mˢ) and rows H,
//! ```text
//! scale = Σ_k Tr[(R⁰)⁻¹ (r rᵀ + H Pˢ Hᵀ)] / Σ_k rows
//! ```
//!
//! Sums are `f64` whatever the scalar of the filter: they run over days. Panic contract: none.

use core::ops::Range;

use super::step::{BLOCK, Block, Step};
use super::{Moments, SmoothError, shape};
use crate::filter::update::Rows;
use crate::linalg::{Mat, MatMut, axpy, cholesky, dot, symmetric, triangular};
use crate::real::Real;

/// What some epochs say of one scale. The sums of two spans add.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// Σ E[eᵀ shape⁻¹ e], in units of the scale.
    pub quadratic: f64,
    /// Number of scalars in it.
    pub count: f64,
}

impl Sum {
    /// Adds that of another span.
    pub fn merge(&mut self, other: Self) {
        self.quadratic += other.quadratic;
        self.count += other.count;
    }

    /// The M-step: the scale that maximises the expected likelihood; `None` without terms.
    pub fn scale(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.quadratic / self.count)
    }

    /// s dim − s² Tr(V N) + s² rᵀ V r for one block.
    pub(super) fn of_disturbance<T: Real>(
        block: &Block<T>,
        score: &[T; BLOCK],
        information: &[[T; BLOCK]; BLOCK],
    ) -> Self {
        let (mut sum, dim) = (T::ZERO, block.dim.min(BLOCK));
        for i in 0..dim {
            for j in 0..dim {
                sum += block.shape[i][j] * (score[i] * score[j] - information[i][j]);
            }
        }
        let (scale, count) = (block.scale.to_f64(), dim as f64);
        Self { quadratic: scale * (count + scale * sum.to_f64()), count }
    }
}

/// Rows of n⁺ numbers that [`process`] works in.
pub const VECTORS: usize = BLOCK + 2;

/// What a step says of the scales of its noise: calls `add` with the component and the sum of each block that has one.
///
/// `predicted` is m⁻ and the lower Cholesky factor of P⁻, as [`super::rts::smooth`] leaves them, `next` is mˢ⁺ and Pˢ⁺.
/// `work` has [`VECTORS`] rows of n⁺. Cost 2 n⁺² multiply-adds for each state of such a block.
pub fn process<T: Real>(
    step: &Step<'_, T>,
    predicted: Moments<'_, T>,
    next: Moments<'_, T>,
    work: &mut MatMut<'_, T>,
    mut add: impl FnMut(usize, Sum),
) -> Result<(), SmoothError> {
    let after = step.map.rows();
    predicted.fits(after)?;
    next.fits(after)?;
    shape([work.cols()], [after])?;
    let [score, product, mut inverse @ ..] = work.rows_mut::<VECTORS>().ok_or(SmoothError::Shape)?;
    for ((score, &next), &predicted) in score.iter_mut().zip(next.mean).zip(predicted.mean) {
        *score = next - predicted;
    }
    let factor = predicted.covariance;
    cholesky::solve(factor, score)?;
    for block in step.noise {
        let (Some(component), Some(states)) = (block.component, block.states.get(..block.dim)) else { continue };
        let mut score_b = [T::ZERO; BLOCK];
        let mut information = [[T::ZERO; BLOCK]; BLOCK];
        for (row, &state) in inverse.iter_mut().zip(states) {
            row.fill(T::ZERO);
            *row.get_mut(state).ok_or(SmoothError::Shape)? = T::ONE;
            cholesky::solve(factor, row)?;
        }
        for (i, &state) in states.iter().enumerate() {
            score_b[i] = score.get(state).copied().unwrap_or_default();
            times(next.covariance, inverse[i], product);
            for (j, &other) in states.iter().enumerate() {
                information[i][j] = inverse[i].get(other).copied().unwrap_or_default() - dot(product, inverse[j]);
            }
        }
        add(component, Sum::of_disturbance(block, &score_b, &information));
    }
    Ok(())
}

/// out ← P x for the symmetric P of which the lower triangle counts.
fn times<T: Real>(p: Mat<'_, T>, x: &[T], out: &mut [T]) {
    out.fill(T::ZERO);
    for (i, (row, &x_i)) in p.iter().zip(x).enumerate() {
        let (before, diagonal) = row.split_at_checked(i).unwrap_or_default();
        let below = dot(before, x);
        axpy(out, x_i, before);
        if let (Some(out), Some(&diagonal)) = (out.get_mut(i), diagonal.first()) {
            *out += below + diagonal * x_i;
        }
    }
}

/// What independent rows say of the scale of their noise: Σ (r² + h Pˢ hᵀ)/R⁰ over `range` of `rows`. `unit` is R⁰ of a row;
/// rows without a positive one are left out. `work` has n entries.
pub fn independent<T: Real>(
    rows: &impl Rows<T>,
    range: Range<usize>,
    residual: impl Fn(usize) -> T,
    unit: impl Fn(usize) -> T,
    smoothed: Mat<'_, T>,
    work: &mut [T],
) -> Result<Sum, SmoothError> {
    shape([smoothed.rows(), smoothed.cols()], [work.len(); 2])?;
    let mut sum = Sum::default();
    for row in range {
        let unit = unit(row);
        if unit > T::ZERO {
            times_row(rows, row, smoothed, work);
            let residual = residual(row);
            sum.quadratic += ((residual * residual + along(rows, row, work)) / unit).to_f64();
            sum.count += 1.0;
        }
    }
    Ok(sum)
}

/// What correlated rows say of the scale of their noise: Tr[(R⁰)⁻¹ (r rᵀ + H Pˢ Hᵀ)] over the rows from `first` on, as many
/// as there are residuals (m). The lower triangle of `unit` (m × m) holds R⁰ and returns its factor; `residual` is
/// spoilt. `work` is m × n, `product` m × m.
pub fn correlated<T: Real>(
    rows: &impl Rows<T>,
    first: usize,
    residual: &mut [T],
    unit: &mut MatMut<'_, T>,
    smoothed: Mat<'_, T>,
    work: &mut MatMut<'_, T>,
    product: &mut MatMut<'_, T>,
) -> Result<Sum, SmoothError> {
    let (m, n) = (residual.len(), smoothed.rows());
    shape([unit.rows(), unit.cols(), product.rows(), product.cols(), work.rows(), work.cols()], [m, m, m, m, m, n])?;
    shape([smoothed.cols()], [n])?;
    let range = first..first.checked_add(m).ok_or(SmoothError::Shape)?;
    cholesky::factor(unit)?;
    for (i, row) in range.clone().enumerate() {
        times_row(rows, row, smoothed, work.row_mut(i));
        for (j, other) in range.clone().enumerate() {
            product.set(i, j, along(rows, other, work.row(i)));
        }
    }
    // Tr(L⁻¹ A L⁻ᵀ) for symmetric A: L⁻¹ on the rows, then on those of the transpose, whose diagonal counts.
    triangular::forward_rows(unit.as_ref(), product)?;
    product.transpose();
    triangular::forward_rows(unit.as_ref(), product)?;
    triangular::forward(unit.as_ref(), residual)?;
    let trace = (0..m).fold(dot(residual, residual), |sum, i| sum + product.at(i, i));
    Ok(Sum { quadratic: trace.to_f64(), count: m as f64 })
}

/// out ← h P for a row of H.
fn times_row<T: Real>(rows: &impl Rows<T>, row: usize, p: Mat<'_, T>, out: &mut [T]) {
    out.fill(T::ZERO);
    rows.for_each(row, &mut |state, coefficient| {
        if state < p.rows() {
            symmetric::add_row(p, state, coefficient, out);
        }
    });
}

/// h x for a row of H.
fn along<T: Real>(rows: &impl Rows<T>, row: usize, x: &[T]) -> T {
    let mut sum = T::ZERO;
    rows.for_each(row, &mut |state, coefficient| {
        sum += coefficient * x.get(state).copied().unwrap_or_default();
    });
    sum
}

#[cfg(test)]
mod tests {
    use super::super::batch::{Problem, problem, square};
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    /// The sums of components 0 and 1 over all steps, by [`process`].
    fn sums(problem: &Problem) -> [Sum; 2] {
        let mut sums = [Sum::default(); 2];
        problem.smooth(&problem.filter(), |k, predicted, next, _| {
            let after = predicted.mean.len();
            let mut work = vec![f64::NAN; VECTORS * after];
            let mut work = MatMut::new(&mut work, VECTORS, after, after).unwrap();
            let step = problem.transitions[k].step();
            process(&step, predicted, next, &mut work, |component, sum| sums[component].merge(sum)).unwrap();
        });
        sums
    }

    /// E[q qᵀ | Y] of step k in the centred form: q = x⁺ − F x − b under the joint density of the batch.
    fn moment(problem: &Problem, mean: &DVector<f64>, p: &DMatrix<f64>, k: usize) -> DMatrix<f64> {
        let (starts, transition) = (problem.starts(), &problem.transitions[k]);
        let (n, after) = (transition.columns, transition.ends.len());
        let mut map = DMatrix::zeros(after, n + after);
        map.view_mut((0, 0), (after, n)).copy_from(&-DMatrix::from_row_slice(after, n, &transition.dense()));
        map.view_mut((0, n), (after, after)).fill_with_identity();
        let pair = n + after;
        let q = &map * mean.rows(starts[k], pair) - DVector::from_column_slice(&transition.offset);
        &map * p.view((starts[k], starts[k]), (pair, pair)) * map.transpose() + &q * q.transpose()
    }

    /// −2 × the part of the expected log-likelihood that depends on the scale of a component.
    fn objective(problem: &Problem, component: usize, scale: f64) -> f64 {
        let (mean, p) = problem.batch();
        let mut sum = 0.0;
        for (k, transition) in problem.transitions.iter().enumerate() {
            let moment = moment(problem, &mean, &p, k);
            for block in transition.blocks.iter().filter(|block| block.component == Some(component)) {
                let covariance = DMatrix::from_fn(block.dim, block.dim, |i, j| scale * block.shape[i][j]);
                let moment = DMatrix::from_fn(block.dim, block.dim, |i, j| moment[(block.states[i], block.states[j])]);
                let factor = covariance.cholesky().unwrap();
                sum += 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>() + factor.solve(&moment).trace();
            }
        }
        sum
    }

    proptest! {
        #[test]
        fn the_m_step_is_the_minimum_of_the_expected_objective(problem in problem()) {
            for (component, sum) in sums(&problem).into_iter().enumerate().filter(|(_, sum)| sum.count > 0.0) {
                // Golden-section search on the logarithm of the scale.
                let (mut low, mut high) = (-20.0f64, 20.0f64);
                let golden = 0.5 * (5f64.sqrt() - 1.0);
                for _ in 0..60 {
                    let (a, b) = (high - golden * (high - low), low + golden * (high - low));
                    if objective(&problem, component, a.exp()) < objective(&problem, component, b.exp()) {
                        high = b;
                    } else {
                        low = a;
                    }
                }
                let found = sum.scale().unwrap();
                // A minimum is found to about the root of the rounding of the objective.
                prop_assert!((found.ln() - 0.5 * (low + high)).abs() < 1e-5, "{found}");
            }
        }

        #[test]
        fn equals_the_centred_form_and_the_disturbance_smoother(problem in problem()) {
            let (mean, p) = problem.batch();
            let mut centred = [Sum::default(); 2];
            for (k, transition) in problem.transitions.iter().enumerate() {
                let moment = moment(&problem, &mean, &p, k);
                for block in &transition.blocks {
                    let Some(component) = block.component else { continue };
                    let shape = DMatrix::from_fn(block.dim, block.dim, |i, j| block.shape[i][j]);
                    let moment = DMatrix::from_fn(block.dim, block.dim, |i, j| moment[(block.states[i], block.states[j])]);
                    let quadratic = shape.cholesky().unwrap().solve(&moment).trace();
                    centred[component].merge(Sum { quadratic, count: block.dim as f64 });
                }
            }
            let mut disturbed = [Sum::default(); 2];
            problem.smooth_by_disturbances(&problem.filter(), |k, adjoint| {
                for block in &problem.transitions[k].blocks {
                    if let Some(component) = block.component {
                        disturbed[component].merge(adjoint.noise(block).unwrap());
                    }
                }
            });
            for (sum, (centred, disturbed)) in sums(&problem).iter().zip(centred.iter().zip(&disturbed)) {
                prop_assert_eq!((sum.count, sum.count), (centred.count, disturbed.count));
                prop_assert!((sum.quadratic - centred.quadratic).abs() <= 1e-9 * centred.quadratic);
                prop_assert!((sum.quadratic - disturbed.quadratic).abs() <= 1e-9 * centred.quadratic);
            }
        }

        #[test]
        fn correlated_rows_are_the_dense_trace_and_with_a_diagonal_noise_independent_ones(
            problem in problem(),
            noise in -0.4..0.4f64,
        ) {
            let (_, p) = problem.filter().filtered.pop().unwrap();
            let (p, measurements) = (square(&p), problem.measurements.last().unwrap());
            let (m, n) = (measurements.values.len(), p.rows());
            let h: Vec<f64> = measurements.rows.concat();
            let rows = Mat::new(&h, m, n, n).unwrap();
            for noise in [0.0, noise] {
                let unit = DMatrix::from_fn(m, m, |i, j| if i == j { measurements.variances[i] } else { 0.04 * noise });
                let mut lower: Vec<f64> = unit.iter().copied().collect();
                let (mut work, mut product) = (vec![0.0; m * n], vec![0.0; m * m]);
                let sum = correlated(
                    &rows,
                    0,
                    &mut measurements.values.clone(),
                    &mut MatMut::square(&mut lower, m).unwrap(),
                    p,
                    &mut MatMut::new(&mut work, m, n, n).unwrap(),
                    &mut MatMut::square(&mut product, m).unwrap(),
                )
                .unwrap();
                let dense = DMatrix::from_row_slice(m, n, &h);
                let p_full = DMatrix::from_fn(n, n, |i, j| p.at(i.max(j), i.min(j)));
                let r = DVector::from_column_slice(&measurements.values);
                let expected = match unit.cholesky() {
                    Some(factor) => factor.solve(&(&r * r.transpose() + &dense * p_full * dense.transpose())).trace(),
                    None => 0.0,
                };
                prop_assert!((sum.quadratic - expected).abs() <= 1e-10 * (1.0 + expected));
                prop_assert_eq!(sum.count, m as f64);
                if noise == 0.0 {
                    let (residual, unit) = (|i| measurements.values[i], |i| measurements.variances[i]);
                    let apart = independent(&rows, 0..m, residual, unit, p, &mut vec![0.0; n]).unwrap();
                    prop_assert!((sum.quadratic - apart.quadratic).abs() <= 1e-10 * (1.0 + expected));
                    prop_assert_eq!(sum.count, apart.count);
                }
            }
        }

        #[test]
        fn sums_of_two_spans_are_the_sum_of_the_whole(parts in proptest::collection::vec((0.0..9.0f64, 1..5u8), 2..9)) {
            let sum = |parts: &[(f64, u8)]| {
                parts.iter().fold(Sum::default(), |mut sum, &(quadratic, count)| {
                    sum.merge(Sum { quadratic, count: f64::from(count) });
                    sum
                })
            };
            let (whole, (head, tail)) = (sum(&parts), parts.split_at(parts.len() / 2));
            let mut merged = sum(tail);
            merged.merge(sum(head));
            prop_assert!((merged.scale().unwrap() / whole.scale().unwrap() - 1.0).abs() < 1e-12 || whole.quadratic == 0.0);
            prop_assert_eq!(merged.count, whole.count);
        }
    }

    /// Numbers of rows that no index can hold.
    #[test]
    fn correlated_rows_beyond_all_numbers_are_refused() {
        let rows = Mat::new(&[1.0, 1.0], 2, 1, 1).unwrap();
        let attempt = |first: usize| {
            let (mut unit, mut work, mut product) = ([1.0, 0.0, 0.0, 1.0], [0.0; 2], [0.0; 4]);
            let [mut unit, mut product] = [&mut unit, &mut product].map(|square| MatMut::square(square, 2).unwrap());
            let mut work = MatMut::new(&mut work, 2, 1, 1).unwrap();
            let p = Mat::square(&[1.0], 1).unwrap();
            correlated(&rows, first, &mut [0.0; 2], &mut unit, p, &mut work, &mut product)
        };
        assert_eq!(attempt(usize::MAX), Err(SmoothError::Shape));
        assert_eq!(attempt(usize::MAX - 1), Err(SmoothError::Shape));
        assert_eq!(attempt(0), Ok(Sum { quadratic: 2.0, count: 2.0 }));
    }

    #[test]
    fn nothing_says_nothing() {
        assert_eq!(Sum::default().scale(), None);
        let rows = Mat::new(&[1.0], 1, 1, 1).unwrap();
        let sum = independent(&rows, 0..1, |_| 1.0, |_| 0.0, Mat::square(&[1.0], 1).unwrap(), &mut [0.0]).unwrap();
        assert_eq!(sum, Sum::default());
        assert_eq!(
            independent(&rows, 0..1, |_| 1.0, |_| 1.0, Mat::square(&[1.0], 1).unwrap(), &mut [0.0; 2]),
            Err(SmoothError::Shape)
        );
    }
}
