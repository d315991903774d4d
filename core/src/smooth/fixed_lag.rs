//! A fixed-lag smoother: a ring of the latest epochs, from which the state a few epochs back is smoothed on request.
//!
//! ```text
//! x_{k−d} | y_0 … y_k   for any d up to EPOCHS − 1
//! ```
//! The fixed-interval smoother on a window that moves with time: d steps of [`rts`] back from the filtered density of the
//! newest epoch (Greiff et al. 2023, eq. (4); B. D. O. Anderson & J. B. Moore, *Optimal Filtering* (1979), sec. 7.4). The
//! filter is any that tells its filtered density and the [`Step`] that led there, with births, deaths and changes of
//! reference; an extended one tells its Jacobian.
//!
//! An epoch is stored packed: the mean, the lower triangle of the covariance, and the step as sparse as it came. The
//! predicted density is not stored but computed again, which is cheap for a sparse F. No heap: the capacities are
//!
//! | constant | most |
//! |---|---|
//! | `EPOCHS` | epochs in the ring; the lag is up to `EPOCHS` − 1 |
//! | `N` | states of an epoch |
//! | `PACKED` | numbers of a lower triangle: [`packed`]`(N)`, no other value compiles |
//! | `WORK` | numbers that a step back works with: [`rts::buffer_len`]`(N, N)`, no other value compiles |
//! | `ENTRIES` | entries of F |
//! | `BLOCKS` | blocks of Q |
//!
//! Memory: `EPOCHS` · (`PACKED` + 2 `N` numbers + step) + 4 `N`² + `WORK` numbers of workspace. Cost: storing an epoch
//! copies it; a step back is 2.7 n³ multiply-adds for n states before and after. Who wants every epoch smoothed, and can
//! wait for it, takes twice the lag and asks once in L epochs for the depths L to 2L − 1 by [`FixedLag::smooth_each`]: two
//! steps an epoch instead of L. Stack: no matrix and no vector of states. Panic contract: none.
//!
//! ```
//! use surefix_core::smooth::fixed_lag::{FixedLag, packed};
//! use surefix_core::smooth::step::{Block, SparseMap, Step};
//! use surefix_core::smooth::{Moments, rts};
//!
//! // A random walk with a noise of 2, filtered to 2.
//! let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
//! let noise = [Block { states: [0; 3], dim: 1, shape: [[1.0; 3]; 3], scale: 2.0, component: None }];
//! let step = Step { map, offset: &[0.0], noise: &noise };
//! let mut ring = FixedLag::<f64, 11, 1, { packed(1) }, { rts::buffer_len(1, 1) }, 1, 1>::new();
//! ring.push(None, Moments::packed(&[0.0], &[2.0])?)?;
//! ring.push(Some(&step), Moments::packed(&[3.0], &[2.0])?)?;
//! assert_eq!(ring.smooth(1)?.mean, [1.5]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use core::fmt;

use super::step::{Block, SparseMap, Step};
use super::{Moments, MomentsMut, SmoothError, predict, rts};
use crate::linalg::{MatMut, copy, head};
use crate::real::Real;

/// Numbers in the lower triangle of an n × n matrix, with its diagonal.
pub const fn packed(n: usize) -> usize {
    n * (n + 1) / 2
}

/// Why an epoch was not stored, or not smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixedLagError {
    /// More states than `N`.
    TooManyStates,
    /// More entries of F than `ENTRIES`.
    TooManyEntries,
    /// More blocks of Q than `BLOCKS`.
    TooManyBlocks,
    /// The step does not lead from the epoch before to this one, or lengths do not fit together.
    Shape,
    /// The ring does not reach back as far.
    TooDeep,
    /// A step back failed.
    Step(SmoothError),
}

impl From<SmoothError> for FixedLagError {
    fn from(error: SmoothError) -> Self {
        Self::Step(error)
    }
}

impl fmt::Display for FixedLagError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyStates => f.write_str("more states than the ring has room for"),
            Self::TooManyEntries => f.write_str("more entries of the transition than the ring has room for"),
            Self::TooManyBlocks => f.write_str("more blocks of noise than the ring has room for"),
            Self::Shape => f.write_str("step and densities do not fit together"),
            Self::TooDeep => f.write_str("the ring does not reach back as far"),
            Self::Step(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for FixedLagError {}

/// The latest epochs of a filter. See [the module](self) for its capacities.
#[derive(Clone, Debug)]
pub struct FixedLag<
    T,
    const EPOCHS: usize,
    const N: usize,
    const PACKED: usize,
    const WORK: usize,
    const ENTRIES: usize,
    const BLOCKS: usize,
> {
    epochs: [Epoch<T, N, PACKED, ENTRIES, BLOCKS>; EPOCHS],
    /// How many of them count.
    len: usize,
    /// Where the newest of them is.
    newest: usize,
    work: Work<T, N, WORK>,
}

impl<
    T: Real,
    const EPOCHS: usize,
    const N: usize,
    const PACKED: usize,
    const WORK: usize,
    const ENTRIES: usize,
    const BLOCKS: usize,
> FixedLag<T, EPOCHS, N, PACKED, WORK, ENTRIES, BLOCKS>
{
    /// An empty ring, which suits a `static`.
    pub const fn new() -> Self {
        const {
            assert!(EPOCHS > 0, "a ring of no epochs");
            assert!(PACKED == packed(N), "PACKED must be packed(N)");
            assert!(WORK == rts::buffer_len(N, N), "WORK must be rts::buffer_len(N, N)");
        }
        Self { epochs: [const { Epoch::EMPTY }; EPOCHS], len: 0, newest: 0, work: Work::ZERO }
    }

    /// Epochs in the ring.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no epoch is in the ring.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Forgets all epochs.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Stores the filtered density of a new epoch, of which the lower triangle counts, and the step that led to it; the
    /// oldest epoch makes room if it must. `None` for a filter that was started anew: nothing connects it with what was
    /// before, which is forgotten.
    ///
    /// On an error the ring is empty, because the chain is broken; the epoch after it starts a new one, with or without a
    /// step.
    pub fn push(&mut self, step: Option<&Step<'_, T>>, filtered: Moments<'_, T>) -> Result<(), FixedLagError> {
        let newest = at(&self.epochs, self.len, self.newest, 0);
        let before = newest.map(|newest| newest.n).filter(|_| step.is_some());
        let kept = if before.is_some() { self.len } else { 0 };
        let place = (self.newest + 1) % EPOCHS.max(1);
        self.len = 0;
        let Some(epoch) = self.epochs.get_mut(place) else { return Err(FixedLagError::TooDeep) };
        epoch.store_density(filtered)?;
        if let (Some(step), Some(before)) = (step, before) {
            epoch.store_step(step, before)?;
        }
        self.newest = place;
        self.len = (kept + 1).min(EPOCHS);
        Ok(())
    }

    /// The density of the state `depth` epochs before the newest one, given all that the newest knows. Only the lower
    /// triangle of the covariance counts.
    pub fn smooth(&mut self, depth: usize) -> Result<Moments<'_, T>, FixedLagError> {
        self.smooth_each(depth, |_, _| ())
    }

    /// As [`Self::smooth`], calling `each` with every depth from 0 on and the density there.
    pub fn smooth_each(
        &mut self,
        depth: usize,
        mut each: impl FnMut(usize, Moments<'_, T>),
    ) -> Result<Moments<'_, T>, FixedLagError> {
        if depth >= self.len {
            return Err(FixedLagError::TooDeep);
        }
        let (len, newest) = (self.len, self.newest);
        let epoch = |depth| at(&self.epochs, len, newest, depth).ok_or(FixedLagError::TooDeep);
        let Work { filtered, predicted, smoothed: [next, smoothed], buffer } = &mut self.work;
        let (mut next, mut smoothed) = (next, smoothed);
        let mut after = epoch(0)?;
        each(0, next.load(after)?);
        for depth in 1..=depth {
            let before = epoch(depth)?;
            let step = after.step(before.n);
            let filtered = filtered.load(before)?;
            let mut predicted = predicted.moments_mut(after.n)?;
            // F P needs the room of the gain, which is made of it later.
            let mut mapped = MatMut::new(buffer, after.n, before.n, before.n).map_err(SmoothError::from)?;
            predict::predict(&step, filtered, &mut predicted, &mut mapped)?;
            let mut work = rts::Work::new(buffer, after.n, before.n)?;
            let mut to = smoothed.moments_mut(before.n)?;
            rts::smooth(&step, filtered, &mut predicted, next.moments(after.n)?, &mut to, &mut work)?;
            each(depth, to.as_ref());
            core::mem::swap(&mut next, &mut smoothed);
            after = before;
        }
        Ok(next.moments(after.n)?)
    }
}

impl<
    T: Real,
    const EPOCHS: usize,
    const N: usize,
    const PACKED: usize,
    const WORK: usize,
    const ENTRIES: usize,
    const BLOCKS: usize,
> Default for FixedLag<T, EPOCHS, N, PACKED, WORK, ENTRIES, BLOCKS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// The entry of a ring `depth` before the newest of `len`.
fn at<E>(ring: &[E], len: usize, newest: usize, depth: usize) -> Option<&E> {
    if depth >= len {
        return None;
    }
    let place = if depth <= newest { newest - depth } else { (newest + ring.len()).checked_sub(depth)? };
    ring.get(place)
}

/// One epoch, packed.
#[derive(Clone, Debug)]
struct Epoch<T, const N: usize, const PACKED: usize, const ENTRIES: usize, const BLOCKS: usize> {
    /// Number of states.
    n: usize,
    mean: [T; N],
    /// Lower triangle of the filtered covariance by rows.
    covariance: [T; PACKED],
    /// The step that led here, unless this is the oldest epoch: ends and entries of the rows of F, b, and Q.
    ends: [usize; N],
    entries: [(usize, T); ENTRIES],
    offset: [T; N],
    blocks: [Block<T>; BLOCKS],
    block_count: usize,
}

impl<T: Real, const N: usize, const PACKED: usize, const ENTRIES: usize, const BLOCKS: usize>
    Epoch<T, N, PACKED, ENTRIES, BLOCKS>
{
    const EMPTY: Self = Self {
        n: 0,
        mean: [T::ZERO; N],
        covariance: [T::ZERO; PACKED],
        ends: [0; N],
        entries: [(0, T::ZERO); ENTRIES],
        offset: [T::ZERO; N],
        blocks: [Block { states: [0; 3], dim: 0, shape: [[T::ZERO; 3]; 3], scale: T::ZERO, component: None }; BLOCKS],
        block_count: 0,
    };

    fn store_density(&mut self, density: Moments<'_, T>) -> Result<(), FixedLagError> {
        let n = density.mean.len();
        density.fits(n).map_err(|_| FixedLagError::Shape)?;
        store(&mut self.mean, density.mean).ok_or(FixedLagError::TooManyStates)?;
        let mut packed = self.covariance.iter_mut();
        for (i, row) in density.covariance.iter().enumerate() {
            row.iter().take(i + 1).zip(&mut packed).for_each(|(&from, to)| *to = from);
        }
        self.n = n;
        Ok(())
    }

    fn store_step(&mut self, step: &Step<'_, T>, before: usize) -> Result<(), FixedLagError> {
        let map = &step.map;
        if [map.columns, map.rows(), step.offset.len()] != [before, self.n, self.n] {
            return Err(FixedLagError::Shape);
        }
        // As many rows as there are states, for which there is room.
        store(&mut self.ends, map.ends).ok_or(FixedLagError::TooManyStates)?;
        store(&mut self.offset, step.offset).ok_or(FixedLagError::TooManyStates)?;
        store(&mut self.entries, map.entries).ok_or(FixedLagError::TooManyEntries)?;
        store(&mut self.blocks, step.noise).ok_or(FixedLagError::TooManyBlocks)?;
        self.block_count = step.noise.len();
        Ok(())
    }

    /// The step that led here from an epoch with so many states.
    fn step(&self, columns: usize) -> Step<'_, T> {
        Step {
            map: SparseMap { ends: head(&self.ends, self.n), entries: &self.entries, columns },
            offset: head(&self.offset, self.n),
            noise: head(&self.blocks, self.block_count),
        }
    }
}

/// Copies `from` to the front of `to`; `None` if it is longer.
fn store<E: Copy>(to: &mut [E], from: &[E]) -> Option<()> {
    to.get_mut(..from.len()).map(|to| copy(to, from))
}

/// Memory of the steps back.
#[derive(Clone, Debug)]
struct Work<T, const N: usize, const WORK: usize> {
    filtered: Density<T, N>,
    predicted: Density<T, N>,
    /// Of x⁺ and of x, in turns.
    smoothed: [Density<T, N>; 2],
    /// For [`rts::Work`].
    buffer: [T; WORK],
}

impl<T: Real, const N: usize, const WORK: usize> Work<T, N, WORK> {
    const ZERO: Self = Self {
        filtered: Density::ZERO,
        predicted: Density::ZERO,
        smoothed: [const { Density::ZERO }; 2],
        buffer: [T::ZERO; WORK],
    };
}

/// N(m, P) with up to `N` states; P of n of them is in the first n² numbers.
#[derive(Clone, Debug)]
struct Density<T, const N: usize> {
    mean: [T; N],
    covariance: [[T; N]; N],
}

impl<T: Real, const N: usize> Density<T, N> {
    const ZERO: Self = Self { mean: [T::ZERO; N], covariance: [[T::ZERO; N]; N] };

    fn moments(&self, n: usize) -> Result<Moments<'_, T>, SmoothError> {
        Moments::packed(head(&self.mean, n), self.covariance.as_flattened())
    }

    fn moments_mut(&mut self, n: usize) -> Result<MomentsMut<'_, T>, SmoothError> {
        let mean = self.mean.get_mut(..n).ok_or(SmoothError::Shape)?;
        MomentsMut::packed(mean, self.covariance.as_flattened_mut())
    }

    /// Unpacks the filtered density of an epoch.
    fn load<const PACKED: usize, const ENTRIES: usize, const BLOCKS: usize>(
        &mut self,
        epoch: &Epoch<T, N, PACKED, ENTRIES, BLOCKS>,
    ) -> Result<Moments<'_, T>, SmoothError> {
        let mut to = self.moments_mut(epoch.n)?;
        copy(to.mean, &epoch.mean);
        let mut packed = epoch.covariance.iter();
        for (i, row) in to.covariance.iter_mut().enumerate() {
            row.iter_mut().take(i + 1).zip(&mut packed).for_each(|(to, &from)| *to = from);
        }
        self.moments(epoch.n)
    }
}

#[cfg(test)]
mod tests {
    use super::super::batch::{Density as Known, Filtered, Problem, problem};
    use super::*;
    use proptest::prelude::*;

    /// Room for any [`problem`].
    type Ring<const EPOCHS: usize> = FixedLag<f64, EPOCHS, 6, { packed(6) }, { rts::buffer_len(6, 6) }, 12, 6>;

    fn moments(density: &Known) -> Moments<'_, f64> {
        Moments::packed(&density.0, &density.1).unwrap()
    }

    fn push<const EPOCHS: usize>(ring: &mut Ring<EPOCHS>, problem: &Problem, pass: &Filtered, k: usize) {
        let step = k.checked_sub(1).map(|k| problem.transitions[k].step());
        ring.push(step.as_ref(), moments(&pass.filtered[k])).unwrap();
    }

    /// The problem up to epoch k.
    fn until(problem: &Problem, k: usize) -> Problem {
        let mut problem = problem.clone();
        problem.transitions.truncate(k);
        problem.measurements.truncate(k + 1);
        problem
    }

    fn assert_same(found: Moments<'_, f64>, expected: &Known, tolerance: f64) {
        let n = expected.0.len();
        assert_eq!(found.mean.len(), n);
        let sigma = |i: usize| expected.1[i * n + i].sqrt();
        for i in 0..n {
            assert!((found.mean[i] - expected.0[i]).abs() <= tolerance * sigma(i));
            for j in 0..=i {
                let off = found.covariance.at(i, j) - expected.1[i * n + j];
                assert!(off.abs() <= tolerance * sigma(i) * sigma(j));
            }
        }
    }

    proptest! {
        /// At every epoch, every depth: the smoother of the interval up to there, which the batch confirms.
        #[test]
        fn equals_the_fixed_interval_smoother(problem in problem()) {
            let pass = problem.filter();
            let mut ring = Ring::<3>::new();
            for k in 0..pass.filtered.len() {
                push(&mut ring, &problem, &pass, k);
                prop_assert_eq!(ring.len(), (k + 1).min(3));
                let known = until(&problem, k);
                let smoothed = known.smooth(&known.filter(), |_, _, _, _| {});
                known.assert_batch(&smoothed, 1e-9);
                for depth in 0..ring.len() {
                    assert_same(ring.smooth(depth).unwrap(), &smoothed[k - depth], 1e-12);
                }
                prop_assert!(matches!(ring.smooth(ring.len()), Err(FixedLagError::TooDeep)));
                let mut depths = Vec::new();
                ring.smooth_each(ring.len() - 1, |depth, density| {
                    assert_same(density, &smoothed[k - depth], 1e-12);
                    depths.push(depth);
                }).unwrap();
                prop_assert_eq!(depths, (0..ring.len()).collect::<Vec<_>>());
            }
        }

        /// Numbers and lengths without sense, entries and ends anywhere: an answer or an error.
        #[test]
        fn nothing_panics(
            epochs in proptest::collection::vec(
                (
                    proptest::collection::vec(number(), 0..5),
                    proptest::collection::vec(number(), 25),
                    proptest::collection::vec((index(), number()), 0..8),
                    proptest::collection::vec(index(), 0..5),
                    proptest::collection::vec(block(), 0..4),
                    (index(), 0..5usize),
                ),
                1..9,
            ),
            shapes_fit in any::<bool>(),
        ) {
            let mut ring = FixedLag::<f64, 4, 4, { packed(4) }, { rts::buffer_len(4, 4) }, 6, 3>::new();
            let mut columns = 0;
            for (mean, covariance, entries, mut ends, noise, (depth, offset)) in epochs {
                let mut offset = vec![1.0; offset];
                if shapes_fit {
                    ends.resize(mean.len(), entries.len());
                    offset.resize(mean.len(), 0.0);
                } else {
                    columns = depth;
                }
                let map = SparseMap { ends: &ends, entries: &entries, columns };
                let step = Step { map, offset: &offset, noise: &noise };
                let pushed = ring.push(Some(&step), Moments::packed(&mean, &covariance).unwrap());
                prop_assert_eq!(pushed.is_err(), ring.is_empty());
                columns = mean.len();
                for depth in [0, 1, 2, 3, 4, depth] {
                    let smoothed = ring.smooth(depth).map(|_| ());
                    prop_assert!(depth < ring.len() || smoothed == Err(FixedLagError::TooDeep));
                }
            }
        }
    }

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![8 => -10.0..10.0, 1 => Just(0.0), 1 => any::<f64>()]
    }

    fn index() -> impl Strategy<Value = usize> {
        prop_oneof![8 => 0..6usize, 1 => any::<usize>()]
    }

    fn block() -> impl Strategy<Value = Block<f64>> {
        ([index(), index(), index()], index(), number(), number()).prop_map(|(states, dim, x, scale)| Block {
            states,
            dim,
            shape: [[x, 0.1, 0.0], [0.1, x, 0.0], [0.0, 0.0, x]],
            scale,
            component: None,
        })
    }

    const SCALAR: Block<f64> = Block { states: [0; 3], dim: 1, shape: [[1.0; 3]; 3], scale: 1.0, component: None };

    /// A ring with room for one state, one entry and one block, that holds two epochs.
    fn small() -> FixedLag<f64, 3, 1, 1, { rts::buffer_len(1, 1) }, 1, 1> {
        let mut ring = FixedLag::new();
        let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
        let step = Step { map, offset: &[0.0], noise: &[SCALAR] };
        ring.push(None, Moments::packed(&[0.0], &[1.0]).unwrap()).unwrap();
        ring.push(Some(&step), Moments::packed(&[3.0], &[1.0]).unwrap()).unwrap();
        ring
    }

    #[test]
    fn what_does_not_fit_is_refused_and_breaks_the_chain() {
        let refused = |ends: &[usize], entries: &[(usize, f64)], columns: usize, noise: &[Block<f64>], mean: &[f64]| {
            let mut ring = small();
            let map = SparseMap { ends, entries, columns };
            let step = Step { map, offset: mean, noise };
            let pushed = ring.push(Some(&step), Moments::packed(mean, &[1.0, 0.0, 0.0, 1.0]).unwrap());
            let error = pushed.unwrap_err();
            assert!(ring.is_empty() && matches!(ring.smooth(0), Err(FixedLagError::TooDeep)));
            error
        };
        let one = [(0, 1.0)];
        assert_eq!(refused(&[1, 1], &one, 1, &[], &[0.0; 2]), FixedLagError::TooManyStates);
        assert_eq!(refused(&[2], &[(0, 1.0), (0, 0.5)], 1, &[], &[0.0]), FixedLagError::TooManyEntries);
        assert_eq!(refused(&[1], &one, 1, &[SCALAR; 2], &[0.0]), FixedLagError::TooManyBlocks);
        assert_eq!(refused(&[1], &one, 2, &[SCALAR], &[0.0]), FixedLagError::Shape);
        assert_eq!(refused(&[1, 1], &one, 1, &[SCALAR], &[0.0]), FixedLagError::Shape);
    }

    #[test]
    fn a_new_start_forgets_what_was_before() {
        let mut ring = small();
        assert!((ring.smooth(1).unwrap().mean[0] - 1.5).abs() < 1e-15);
        ring.push(None, Moments::packed(&[7.0], &[1.0]).unwrap()).unwrap();
        assert_eq!((ring.len(), ring.smooth(0).unwrap().mean), (1, &[7.0][..]));
        ring.clear();
        assert!(ring.is_empty());
    }

    /// P = 0 and Q = 0: nothing to divide by.
    #[test]
    fn a_prediction_without_noise_is_an_error_of_the_step() {
        let mut ring = FixedLag::<f64, 2, 1, 1, { rts::buffer_len(1, 1) }, 1, 0>::default();
        let map = SparseMap { ends: &[1], entries: &[(0, 1.0)], columns: 1 };
        let step = Step { map, offset: &[0.0], noise: &[] };
        for step in [None, Some(&step)] {
            ring.push(step, Moments::packed(&[0.0], &[0.0]).unwrap()).unwrap();
        }
        let error = ring.smooth(1).unwrap_err();
        assert_eq!(error, FixedLagError::Step(SmoothError::NotPositiveDefinite { state: 0 }));
        assert_eq!(error.to_string(), "covariance is not positive definite at state 0");
    }

    /// 57 states and a lag of 10 in double precision: what a `static` takes.
    #[test]
    fn memory() {
        type Large = FixedLag<f64, 11, 57, { packed(57) }, { rts::buffer_len(57, 57) }, 128, 32>;
        let epoch = 8 * (packed(57) + 2 * 57) + size_of::<usize>() * (57 + 2) + 16 * 128 + size_of::<Block<f64>>() * 32;
        assert_eq!(
            size_of::<Large>(),
            11 * epoch + 8 * (4 * 57 * 57 + 4 * 57 + rts::buffer_len(57, 57)) + 2 * size_of::<usize>()
        );
    }
}
