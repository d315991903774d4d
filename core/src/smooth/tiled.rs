//! The steps of [`super::predict`] and [`super::rts`] for tens of states, in tiles of registers ([`crate::linalg::tiles`]).
//!
//! The same formulas; the memory is larger, because dimensions are filled up to whole tiles. The step back predicts as
//! well, for both need F P. Where the same states stay (F square, upper triangular and far from singular), its gain is
//! ```text
//! G = P Fᵀ (P⁻)⁻¹ = F⁻¹ (P⁻ − Q)(P⁻)⁻¹ = F⁻¹ (I − Q (P⁻)⁻¹)
//! ```
//! which takes the inverse of P⁻ alone, as F and Q are sparse, and of what has no noise keeps every digit. Otherwise it
//! comes from two triangular solves for each column. What is inlined here can be compiled by the caller for the processor
//! it finds.
//!
//! Cost of a prediction: z n multiply-adds for z entries in F, and the transposition of F P; of a step back beside that
//! 2 n³ where the states stay, else n⁺³/6 + 2 n⁺² n + n⁺ n²/2. Lower triangles only. Panic contract: none.

use super::predict::{add_noise, map_mean};
use super::rts::add_gain;
use super::step::Step;
use super::{Moments, MomentsMut, SmoothError, shape};
use crate::linalg::tiles::{self, Tiles};
use crate::linalg::{Mat, MatMut, axpy, copy, head_mut, scale};
use crate::real::Real;

/// Memory of a prediction from n to n⁺ states.
#[derive(Debug)]
struct Mapping<'a, T> {
    /// P, both triangles, n × n.
    full: Tiles<'a, T>,
    /// F P, n⁺ × n.
    mapped: Tiles<'a, T>,
    /// P Fᵀ, n × n⁺.
    transposed: Tiles<'a, T>,
}

impl<'a, T: Real> Mapping<'a, T> {
    const fn buffer_len(after: usize, n: usize) -> usize {
        tiles::buffer_len(n, n) + tiles::buffer_len(after, n) + tiles::buffer_len(n, after)
    }

    fn split(buffer: &'a mut [T], after: usize, n: usize) -> Result<(Self, &'a mut [T]), SmoothError> {
        let (full, rest) = Tiles::split(buffer, n, n)?;
        let (mapped, rest) = Tiles::split(rest, after, n)?;
        let (transposed, rest) = Tiles::split(rest, n, after)?;
        Ok((Self { full, mapped, transposed }, rest))
    }

    /// F P and its transpose.
    #[inline(always)]
    fn map(&mut self, step: &Step<'_, T>, p: Mat<'_, T>) {
        self.full.load_symmetric(p.rows(), T::ZERO, |i, row| copy(row, p.row(i)));
        self.mapped.clear();
        for i in 0..step.map.rows() {
            combine(step, i, &self.full, p.rows(), self.mapped.row_mut(i));
        }
        self.transposed.copy_transposed(&self.mapped);
    }

    /// P⁻ = F P Fᵀ + Q in the lower triangle of `predicted`.
    #[inline(always)]
    fn covariance(&self, step: &Step<'_, T>, predicted: &mut MatMut<'_, T>) {
        for (i, row) in predicted.iter_mut().enumerate() {
            let row = head_mut(row, i + 1);
            row.fill(T::ZERO);
            combine(step, i, &self.transposed, step.map.columns, row);
        }
        add_noise(step, predicted);
    }

    /// `mapped` ← Gᵀ, G = F⁻¹ (I − Q (P⁻)⁻¹), for the Lᵀ in `factor`; `work` is spoilt.
    #[inline(always)]
    fn gain_by_inverse(&mut self, step: &Step<'_, T>, factor: &Tiles<'_, T>, work: &mut Tiles<'_, T>) {
        let n = step.map.columns;
        // R⁻¹, then its transpose Y, then (P⁻)⁻¹ = Yᵀ Y.
        work.load_symmetric(n, T::ONE, |_, row| {
            row.fill(T::ZERO);
            if let Some(diagonal) = row.last_mut() {
                *diagonal = T::ONE;
            }
        });
        factor.backward(work, true);
        self.transposed.copy_transposed_upper(work);
        self.full.square_of_lower(&self.transposed);
        work.clear();
        for block in step.noise {
            for (&i, shape) in block.states.iter().zip(&block.shape).take(block.dim).filter(|(i, _)| **i < n) {
                for (&j, &shape) in block.states.iter().zip(shape).take(block.dim).filter(|(j, _)| **j < n) {
                    axpy(work.row_mut(i), -(block.scale * shape), self.full.row(j));
                }
            }
        }
        // F is upper triangular: rows of F⁻¹ (…) from the last to the first.
        for i in (0..n).rev() {
            if let Some(entry) = work.row_mut(i).get_mut(i) {
                *entry += T::ONE;
            }
            let Some(((_, diagonal), others)) = step.map.row(i).split_first() else { continue };
            for &(column, coefficient) in others {
                work.subtract_row(i, coefficient, column);
            }
            if *diagonal != T::ONE {
                scale(work.row_mut(i), T::ONE / *diagonal);
            }
        }
        self.mapped.copy_transposed(work);
    }
}

/// Least and most on the diagonal of an F whose inverse is used: errors grow by no more than the inverse of the least.
const DIAGONAL: [f64; 2] = [0.5, 2.0];

/// Whether F is square and upper triangular, with a diagonal within [`DIAGONAL`]: states stay, in an order in which rates
/// follow what they move.
#[inline(always)]
fn invertible<T: Real>(step: &Step<'_, T>) -> bool {
    let [least, most] = DIAGONAL.map(T::from_f64);
    step.map.rows() == step.map.columns
        && (0..step.map.columns).all(|i| match step.map.row(i) {
            [(column, diagonal), others @ ..] => {
                *column == i && *diagonal >= least && *diagonal <= most && others.iter().all(|(column, _)| *column > i)
            }
            [] => false,
        })
}

/// out ← out + Σ_c F_ic · (row c of `rows`), of which there are `n`.
#[inline(always)]
fn combine<T: Real>(step: &Step<'_, T>, i: usize, rows: &Tiles<'_, T>, n: usize, out: &mut [T]) {
    for &(column, coefficient) in step.map.row(i).iter().filter(|(column, _)| *column < n) {
        axpy(out, coefficient, rows.row(column));
    }
}

/// How long a buffer [`predict`] needs for a step from `n` to `after` states.
pub const fn prediction_len(after: usize, n: usize) -> usize {
    Mapping::<f64>::buffer_len(after, n)
}

/// The moments of x⁺, on a `buffer` of at least [`prediction_len`] numbers, whatever is in it.
#[inline(always)]
pub fn predict<T: Real>(
    step: &Step<'_, T>,
    filtered: Moments<'_, T>,
    predicted: &mut MomentsMut<'_, T>,
    buffer: &mut [T],
) -> Result<(), SmoothError> {
    let (n, after) = (step.map.columns, step.map.rows());
    filtered.fits(n)?;
    predicted.as_ref().fits(after)?;
    shape([step.offset.len()], [after])?;
    let (mut mapping, _) = Mapping::split(buffer, after, n)?;
    map_mean(step, filtered.mean, predicted.mean);
    mapping.map(step, filtered.covariance);
    mapping.covariance(step, &mut predicted.covariance);
    Ok(())
}

/// Memory of a step back from n⁺ to n states; after it, the gain.
#[derive(Debug)]
pub struct Work<'a, T> {
    after: usize,
    n: usize,
    /// After the prediction, F P becomes Gᵀ.
    mapping: Mapping<'a, T>,
    /// (Pˢ⁺ − P⁻) Gᵀ, n⁺ × n.
    product: Tiles<'a, T>,
    /// Pˢ⁺ − P⁻, n⁺ × n⁺.
    difference: Tiles<'a, T>,
    /// Lᵀ, n⁺ × n⁺.
    factor: Tiles<'a, T>,
}

/// How long a buffer [`Work`] needs for a step from `n` to `after` states.
pub const fn buffer_len(after: usize, n: usize) -> usize {
    prediction_len(after, n) + tiles::buffer_len(after, n) + 2 * tiles::buffer_len(after, after)
}

impl<'a, T: Real> Work<'a, T> {
    /// On a buffer of at least [`buffer_len`] numbers, whatever is in it.
    pub fn new(buffer: &'a mut [T], after: usize, n: usize) -> Result<Self, SmoothError> {
        let (mapping, rest) = Mapping::split(buffer, after, n)?;
        let (product, rest) = Tiles::split(rest, after, n)?;
        let (difference, rest) = Tiles::split(rest, after, after)?;
        let (factor, _) = Tiles::split(rest, after, after)?;
        Ok(Self { after, n, mapping, product, difference, factor })
    }

    /// Gᵀ of the step that was taken, n⁺ × n.
    pub fn gain_transposed(&self) -> Mat<'_, T> {
        self.mapping.mapped.view(self.after, self.n).unwrap_or(Mat::empty())
    }
}

/// Smooths x, given the filtered moments of x and the smoothed ones of x⁺.
///
/// `predicted` returns m⁻, and L of P⁻ = L Lᵀ in its lower triangle. `smoothed` may be the buffers of a later use; both are
/// spoilt if an error is returned.
#[inline(always)]
pub fn smooth<T: Real>(
    step: &Step<'_, T>,
    filtered: Moments<'_, T>,
    predicted: &mut MomentsMut<'_, T>,
    next: Moments<'_, T>,
    smoothed: &mut MomentsMut<'_, T>,
    work: &mut Work<'_, T>,
) -> Result<(), SmoothError> {
    let (n, after) = (step.map.columns, step.map.rows());
    filtered.fits(n)?;
    smoothed.as_ref().fits(n)?;
    predicted.as_ref().fits(after)?;
    next.fits(after)?;
    shape([step.offset.len(), work.n, work.after], [after, n, after])?;
    let Work { mapping, product, difference, factor, .. } = work;

    map_mean(step, filtered.mean, predicted.mean);
    mapping.map(step, filtered.covariance);
    mapping.covariance(step, &mut predicted.covariance);
    factor.load_symmetric(after, T::ONE, |i, row| copy(row, predicted.covariance.row(i)));
    difference.load_symmetric(after, T::ZERO, |i, row| {
        for ((to, &next), &predicted) in row.iter_mut().zip(next.covariance.row(i)).zip(predicted.covariance.row(i)) {
            *to = next - predicted;
        }
    });
    factor.factor()?;
    if invertible(step) {
        mapping.gain_by_inverse(step, factor, product);
    } else {
        factor.forward(&mut mapping.mapped);
        factor.backward(&mut mapping.mapped, false);
    }
    let gain = &mapping.mapped;
    product.product(difference, gain, false);
    Tiles::gram_lower(gain, product, filtered.covariance, &mut smoothed.covariance);
    // The difference has been used: its place takes L.
    difference.copy_transposed_upper(factor);
    for i in 0..after {
        copy(head_mut(predicted.covariance.row_mut(i), i + 1), difference.row(i));
    }
    add_gain(gain.view(after, n)?, filtered.mean, predicted.mean, next.mean, smoothed.mean)
}

#[cfg(test)]
mod tests {
    use super::super::batch::problem;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Births, deaths, changes of reference, states without noise: as the plain step, factor and gain included.
        #[test]
        fn equals_the_plain_step(problem in problem()) {
            let pass = problem.filter();
            let mut tiled = pass.filtered.clone();
            let plain = problem.smooth(&pass, |k, factored, next, work| {
                let step = problem.transitions[k].step();
                let (n, after) = (step.map.columns, step.map.rows());
                let (mut mean, mut p) = (vec![f64::NAN; after], vec![f64::NAN; after * after]);
                let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
                let filtered = Moments::packed(&pass.filtered[k].0, &pass.filtered[k].1).unwrap();
                predict(&step, filtered, &mut predicted, &mut vec![f64::NAN; prediction_len(after, n)]).unwrap();
                let (plain_mean, plain) = &pass.predicted[k + 1];
                assert_eq!(predicted.mean, plain_mean);
                for i in 0..after {
                    for j in 0..=i {
                        let size = (plain[i * (after + 1)] * plain[j * (after + 1)]).sqrt();
                        assert!((predicted.covariance.at(i, j) - plain[i * after + j]).abs() <= 1e-13 * size);
                    }
                }
                let to = &mut tiled[k];
                let mut smoothed = MomentsMut::packed(&mut to.0, &mut to.1).unwrap();
                let mut buffer = vec![f64::NAN; buffer_len(after, n)];
                let mut tiles = Work::new(&mut buffer, after, n).unwrap();
                smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut tiles).unwrap();
                smoothed.covariance.mirror_lower();
                for i in 0..after {
                    for j in 0..=i {
                        let (factor, plain) = (predicted.covariance.at(i, j), factored.covariance.at(i, j));
                        assert!((factor - plain).abs() <= 1e-12 * factored.covariance.at(i, i).abs().max(plain.abs()));
                    }
                    let (gain, plain) = (tiles.gain_transposed(), work.gain_transposed());
                    assert!((0..n).all(|j| (gain.at(i, j) - plain.at(i, j)).abs() < 1e-9 * (1.0 + plain.at(i, j).abs())));
                }
            });
            problem.assert_batch(&tiled, 1e-9);
            problem.assert_batch(&plain, 1e-9);
        }
    }

    #[test]
    fn bad_input_is_refused() {
        use super::super::step::SparseMap;
        let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
        let step = Step { map, offset: &[0.0], noise: &[] };
        let attempt = |variance: f64, next_mean: f64, states: usize| {
            let (mut mean, mut p, mut buffer) = ([0.0], [f64::NAN], [0.0; buffer_len(2, 1)]);
            let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
            let (mut smoothed_mean, mut smoothed_p) = ([0.0], [0.0]);
            let mut smoothed = MomentsMut::packed(&mut smoothed_mean, &mut smoothed_p).unwrap();
            let filtered_p = [variance];
            let filtered = Moments::packed(&[0.0], &filtered_p).unwrap();
            let next_mean = [next_mean];
            let next = Moments::packed(&next_mean, &[0.5]).unwrap();
            let mut work = Work::new(&mut buffer, states, 1).unwrap();
            smooth(&step, filtered, &mut predicted, next, &mut smoothed, &mut work)
        };
        assert_eq!(attempt(0.0, 0.0, 1), Err(SmoothError::NotPositiveDefinite { state: 0 }));
        assert_eq!(attempt(f64::NAN, 0.0, 1), Err(SmoothError::NotPositiveDefinite { state: 0 }));
        assert_eq!(attempt(2.0, f64::NAN, 1), Err(SmoothError::NotFinite));
        assert_eq!(attempt(2.0, 0.0, 2), Err(SmoothError::Shape));
        assert!(Work::new(&mut [0.0; 2], 1, 1).is_err());
        let (filtered, mut mean, mut p) = (Moments::packed(&[0.0], &[1.0]).unwrap(), [0.0; 2], [0.0; 4]);
        let mut predicted = MomentsMut::packed(&mut mean, &mut p).unwrap();
        assert_eq!(predict(&step, filtered, &mut predicted, &mut [0.0; 999]), Err(SmoothError::Shape));
        let mut predicted = MomentsMut::packed(&mut mean[..1], &mut p).unwrap();
        assert_eq!(predict(&step, filtered, &mut predicted, &mut [0.0; 2]), Err(SmoothError::Shape));
    }

    /// Random problems seldom have a step of that kind: two pairs of value and rate, and a state that is forgotten by half.
    /// One rate has no noise, one state has a prior's. Expected: the plain step.
    #[test]
    fn the_gain_by_the_inverse_is_the_plain_one() {
        use super::super::step::{Block, SparseMap};
        let entries = [(0, 1.0), (2, 0.5), (1, 1.0), (3, 0.5), (2, 1.0), (3, 1.0), (4, 0.5)];
        let map = SparseMap { ends: &[2, 4, 5, 6, 7], entries: &entries, columns: 5 };
        let block = |states, dim, shape, scale| Block { states, dim, shape, scale, component: None };
        let pair = [[1.0 / 3.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0; 3]];
        let single = [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        let noise = [block([0, 2, 0], 2, pair, 0.01), block([4, 0, 0], 1, single, 1e4)];
        let step = Step { map, offset: &[0.0, 1.0, 0.0, 0.0, 2.0], noise: &noise };
        assert!(invertible(&step));
        let matrix = |scale: f64| -> Vec<f64> {
            let entry = |i: usize, j: usize| if i == j { scale } else { 0.3 * scale / (1 + i + j) as f64 };
            (0..25).map(|k| entry(k / 5, k % 5)).collect()
        };
        let (p, next_p, m, next_m) = (matrix(1.0), matrix(0.4), [1.0, 2.0, 3.0, 4.0, 5.0], [3.0, 5.0, 3.0, 4.5, 4.0]);
        let (filtered, next) = (Moments::packed(&m, &p).unwrap(), Moments::packed(&next_m, &next_p).unwrap());
        let [mut tiled, mut plain] = [(); 2].map(|()| ([f64::NAN; 5], [f64::NAN; 25]));
        let (mut mean, mut covariance) = ([0.0; 5], [0.0; 25]);
        let mut predicted = MomentsMut::packed(&mut mean, &mut covariance).unwrap();
        let mut buffer = [f64::NAN; buffer_len(5, 5)];
        let mut work = Work::new(&mut buffer, 5, 5).unwrap();
        let mut to = MomentsMut::packed(&mut tiled.0, &mut tiled.1).unwrap();
        smooth(&step, filtered, &mut predicted, next, &mut to, &mut work).unwrap();
        let mut mapped = [0.0; 25];
        let mut mapped = MatMut::square(&mut mapped, 5).unwrap();
        super::super::predict::predict(&step, filtered, &mut predicted, &mut mapped).unwrap();
        let mut buffer = [0.0; super::super::rts::buffer_len(5, 5)];
        let mut work = super::super::rts::Work::new(&mut buffer, 5, 5).unwrap();
        let mut to = MomentsMut::packed(&mut plain.0, &mut plain.1).unwrap();
        super::super::rts::smooth(&step, filtered, &mut predicted, next, &mut to, &mut work).unwrap();
        for i in 0..5 {
            assert!((tiled.0[i] - plain.0[i]).abs() < 1e-12);
            assert!((0..=i).all(|j| (tiled.1[i * 5 + j] - plain.1[i * 5 + j]).abs() < 1e-12));
        }
    }
}
