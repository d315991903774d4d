//! Which satellites to fix: by elevation, or by a search, and what the fixed ones do for the rest.
//!
//! Ambiguities of one satellite (its bands) come and go together. Strategies:
//! * [`Strategy::Elevation`]: the k highest satellites, from all of them down to the first k whose success rate reaches P₀.
//!   (Rates are not monotone in k: one newly risen satellite in the middle spoils all larger sets, so that growing from
//!   below would stop there.) L. Wang et al. (2022), sec. 3.1, with the order of search corrected.
//! * [`Strategy::Search`]: from all of them down, each time without the satellite whose absence helps most, as long as a
//!   budget of examined sets lasts; then the lowest goes.
//!
//! The subset is fixed by integer least squares. Then the fixed ones *help the rest*: each satellite left out, the highest
//! first, is fixed as well if, given all integers so far, the product of all success rates still reaches P₀. The product
//! bounds the accumulated risk.
//!
//! [`resolve_subset`] does all of it on memory of its own; [`choose`] and [`help_rest`] are its two halves for an owner of
//! a larger density with tests and memory of its own.
//!
//! The third way, by conditional variance in the decorrelated space, is [`super::partial`].
//!
//! Cost: one decorrelation for each set examined, at most as many as there are satellites, or the budget; one Cholesky
//! factor of the fixed ones for each satellite helped. No panics.

use super::condition::condition_on_integers;
use super::partial::select;
use super::resolve::{Config, Method, Workspace, resolve};
use super::success_rate::Probability;
use super::{IntegerError, success_rate};
use crate::linalg::{Mat, MatMut};
use crate::real::Real;
use heapless::Vec;

/// Most bands of a satellite.
pub const MAX_BANDS: usize = 4;

/// How to choose the subset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Strategy {
    /// By elevation.
    Elevation,
    /// By search, with so many sets examined.
    Search {
        /// Sets.
        budget: u16,
    },
}

/// What a subset has to satisfy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How to choose it.
    pub strategy: Strategy,
    /// P₀, of the product of all success rates.
    pub min_success: f64,
    /// Fewest satellites.
    pub min_satellites: usize,
    /// Whether the fixed ones help the rest.
    pub assist: bool,
    /// Least ratio of the two best norms of what is helped (1: not tested).
    pub min_ratio: f64,
    /// How much larger variances are than the covariance says, for all success rates.
    pub variance_factor: f64,
    /// How far each search for integers may go.
    pub config: Config,
}

impl Options {
    /// The paper's, for a `static`: by elevation, P₀ = 0.95.
    pub const DEFAULT: Self = Self {
        strategy: Strategy::Elevation,
        min_success: 0.95,
        min_satellites: 3,
        assist: true,
        min_ratio: 1.0,
        variance_factor: 1.0,
        config: Config::DEFAULT,
    };
}

impl Default for Options {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Integers of a subset.
#[derive(Clone, Copy, Debug)]
pub struct Subset<'w, T> {
    /// Which ambiguities, in the order of their fixing: the chosen ones, then those helped, satellite by satellite.
    pub indices: &'w [usize],
    /// Their integers `[cycles]`.
    pub values: &'w [T],
    /// How many of them were chosen; the rest was helped.
    pub chosen: usize,
    /// Product of all success rates.
    pub success_rate: Probability,
    /// Ratio of the two best norms of the chosen ones.
    pub ratio: T,
    /// Squared norms of the best and the second best integers of the chosen ones.
    pub norms: [T; 2],
    /// How the chosen ones were found.
    pub method: Method,
    /// Success rate of all ambiguities together.
    pub full_success_rate: Probability,
    /// Sets examined.
    pub examined: usize,
}

/// The joint density of which ambiguities are to be fixed.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a, T> {
    /// Mean of all states; ambiguities `[cycles]`.
    pub mean: &'a [T],
    /// Covariance of all states.
    pub covariance: Mat<'a, T>,
    /// Which states are ambiguities (n).
    pub ambiguities: &'a [usize],
    /// The satellite of each (n).
    pub of: &'a [u8],
    /// The satellites, the most trusted first; only the first mention of each counts.
    pub order: &'a [u8],
}

/// Which satellites and ambiguities are in a subset.
#[derive(Debug)]
pub struct Sets<T, const N: usize> {
    /// Satellites of the subset, the most trusted first.
    pub trial: Vec<u8, N>,
    /// States of the subset, in the order of their fixing.
    pub states: Vec<usize, N>,
    /// Their integers `[cycles]`.
    pub values: Vec<T, N>,
}

impl<T, const N: usize> Default for Sets<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T, const N: usize> Sets<T, N> {
    /// Nothing.
    pub const fn new() -> Self {
        Self { trial: Vec::new(), states: Vec::new(), values: Vec::new() }
    }

    /// Takes all satellites of `order`, each once, as the subset to start from.
    pub fn begin(&mut self, order: impl Iterator<Item = u8>) -> Result<(), IntegerError> {
        self.trial.clear();
        for satellite in order {
            if !self.trial.contains(&satellite) {
                self.trial.push(satellite).map_err(|_| IntegerError::Capacity)?;
            }
        }
        Ok(())
    }
}

/// Memory that nothing is left in, to be borrowed from an owner that has other uses for it.
#[derive(Debug)]
pub struct Scratch<'w, T, const N: usize> {
    /// For decorrelation and search.
    pub integers: &'w mut Workspace<T, N>,
    /// A part of the mean, or of residuals.
    pub vector: &'w mut [T; N],
    /// A part of the covariance, or its Cholesky factor.
    pub square: &'w mut [[T; N]; N],
    /// N × [`MAX_BANDS`] numbers.
    pub cross: &'w mut [T],
}

/// Memory for up to N ambiguities: 5 N² numbers of 8 bytes.
#[derive(Debug)]
pub struct SubsetWorkspace<T, const N: usize> {
    integers: Workspace<T, N>,
    vector: [T; N],
    square: [[T; N]; N],
    cross: [[T; MAX_BANDS]; N],
    ambiguities: Vec<usize, N>,
    sets: Sets<T, N>,
}

impl<T: Real, const N: usize> Default for SubsetWorkspace<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const N: usize> SubsetWorkspace<T, N> {
    /// An empty workspace.
    pub const fn new() -> Self {
        Self {
            integers: Workspace::new(),
            vector: [T::ZERO; N],
            square: [[T::ZERO; N]; N],
            cross: [[T::ZERO; MAX_BANDS]; N],
            ambiguities: Vec::new(),
            sets: Sets::new(),
        }
    }

    /// Bootstrapped success rate of the ambiguities `a` (n) with covariance `q` (n × n) after decorrelation.
    pub fn success_rate(&mut self, a: &[T], q: Mat<'_, T>) -> Result<Probability, IntegerError> {
        let mut work = self.integers.work(a.len())?;
        work.prepare(a, q)?;
        Ok(success_rate::bootstrapped(work.variances))
    }
}

/// Chooses satellites, fixes their ambiguities, and those of others that can be helped. `None` if no set reaches P₀.
///
/// `of` (n) names the satellite of each ambiguity, `order` the satellites, the most trusted (highest) first.
pub fn resolve_subset<'w, T: Real, const N: usize>(
    a: &[T],
    q: Mat<'_, T>,
    of: &[u8],
    order: &[u8],
    options: &Options,
    workspace: &'w mut SubsetWorkspace<T, N>,
) -> Result<Option<Subset<'w, T>>, IntegerError> {
    let n = a.len();
    if of.len() != n || [q.rows(), q.cols()] != [n; 2] {
        return Err(IntegerError::Shape);
    }
    if n > N {
        return Err(IntegerError::Capacity);
    }
    let SubsetWorkspace { integers, vector, square, cross, ambiguities, sets } = workspace;
    ambiguities.clear();
    for i in 0..n {
        // There are at most N, as checked above.
        let _ = ambiguities.push(i);
    }
    sets.begin(order.iter().copied().filter(|satellite| of.contains(satellite)))?;
    let problem = Problem { mean: a, covariance: q, ambiguities, of, order };
    let mut scratch = Scratch { integers, vector, square, cross: cross.as_flattened_mut() };
    let Some(Chosen { success_rate, first: full_success_rate, examined }) =
        choose(&problem, options, sets, &mut scratch)?
    else {
        return Ok(None);
    };
    let m = sets.states.len();
    let sub_q = MatMut::new(scratch.square.as_flattened_mut(), m, m, N)?;
    let sub_a = scratch.vector.get(..m).ok_or(IntegerError::Capacity)?;
    let resolution = resolve(sub_a, sub_q.as_ref(), &options.config, scratch.integers)?;
    let (ratio, norms, method) = (resolution.ratio, [resolution.best_norm, resolution.second_norm], resolution.method);
    sets.values.clear();
    for &integer in resolution.best {
        let _ = sets.values.push(T::from_f64(integer as f64));
    }
    let mut product = success_rate;
    if options.assist {
        match help_rest(&problem, options, success_rate, sets, &mut scratch) {
            Ok(helped) => product = helped,
            // What cannot be helped leaves the chosen ones as they are.
            Err(_) => {
                sets.states.truncate(m);
                sets.values.truncate(m);
            }
        }
    }
    Ok(Some(Subset {
        indices: &sets.states,
        values: &sets.values,
        chosen: m,
        success_rate: product,
        ratio,
        norms,
        method,
        full_success_rate,
        examined,
    }))
}

/// What [`choose`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Success rate of the set.
    pub success_rate: Probability,
    /// Success rate of the first set examined.
    pub first: Probability,
    /// Sets examined.
    pub examined: usize,
}

/// From the satellites in `sets.trial` down, the first set that reaches P₀; `None` if none does. It is left in
/// `sets.trial` and `sets.states`, its part of the density in `scratch`.
pub fn choose<T: Real, const N: usize>(
    problem: &Problem<'_, T>,
    options: &Options,
    sets: &mut Sets<T, N>,
    scratch: &mut Scratch<'_, T, N>,
) -> Result<Option<Chosen>, IntegerError> {
    let least = options.min_satellites.max(1);
    let (mut first, mut examined) = (None, 0);
    while sets.trial.len() >= least {
        let rate = rate(problem, options, None, sets, scratch)?;
        examined += 1;
        let all = *first.get_or_insert(rate);
        if rate.success >= options.min_success {
            return Ok(Some(Chosen { success_rate: rate, first: all, examined }));
        }
        let worst = weakest(problem, options, &mut examined, sets, scratch)?;
        sets.trial.retain(|satellite| Some(*satellite) != worst);
    }
    Ok(None)
}

/// The satellite in `sets.trial` that is to go next; none where there is none.
fn weakest<T: Real, const N: usize>(
    problem: &Problem<'_, T>,
    options: &Options,
    examined: &mut usize,
    sets: &mut Sets<T, N>,
    scratch: &mut Scratch<'_, T, N>,
) -> Result<Option<u8>, IntegerError> {
    let mut worst = sets.trial.last().copied();
    let Strategy::Search { budget } = options.strategy else { return Ok(worst) };
    let mut best = -1.0;
    for leave in (0..sets.trial.len()).rev() {
        if *examined >= usize::from(budget) || sets.trial.len() <= options.min_satellites.max(1) {
            break;
        }
        let left = sets.trial.get(leave).copied();
        let rate = rate(problem, options, left, sets, scratch)?.success;
        *examined += 1;
        if rate > best {
            (best, worst) = (rate, left);
        }
    }
    Ok(worst)
}

/// Bootstrapped success rate of the satellites in `sets.trial`, one left out, after decorrelation; their states into
/// `sets.states`.
fn rate<T: Real, const N: usize>(
    problem: &Problem<'_, T>,
    options: &Options,
    leave: Option<u8>,
    sets: &mut Sets<T, N>,
    scratch: &mut Scratch<'_, T, N>,
) -> Result<Probability, IntegerError> {
    sets.states.clear();
    for (&state, satellite) in problem.ambiguities.iter().zip(problem.of) {
        if Some(*satellite) != leave && sets.trial.contains(satellite) {
            sets.states.push(state).map_err(|_| IntegerError::Capacity)?;
        }
    }
    let m = sets.states.len();
    let mut sub_q = MatMut::new(scratch.square.as_flattened_mut(), m, m, N)?;
    let sub_a = scratch.vector.get_mut(..m).ok_or(IntegerError::Capacity)?;
    select(problem.mean, problem.covariance, &sets.states, sub_a, &mut sub_q)?;
    let mut work = scratch.integers.work(m)?;
    work.prepare(sub_a, sub_q.as_ref())?;
    let factor = T::from_f64(options.variance_factor);
    work.variances.iter_mut().for_each(|variance| *variance *= factor);
    Ok(success_rate::bootstrapped(work.variances))
}

/// Fixes, given the states and values in `sets`, the ambiguities of each satellite that is not among `sets.trial`, the
/// most trusted first, as far as the product of all success rates allows it. `so_far` is that of the set; returns the
/// product.
pub fn help_rest<T: Real, const N: usize>(
    problem: &Problem<'_, T>,
    options: &Options,
    so_far: Probability,
    sets: &mut Sets<T, N>,
    scratch: &mut Scratch<'_, T, N>,
) -> Result<Probability, IntegerError> {
    let mut product = so_far;
    for (k, &satellite) in problem.order.iter().enumerate() {
        let again = problem.order.iter().take(k).any(|&other| other == satellite);
        if !again && !sets.trial.contains(&satellite) {
            product = help(problem, satellite, options, product, sets, scratch)?;
        }
    }
    Ok(product)
}

/// Fixes the ambiguities of a satellite given those fixed so far, if the product of all rates allows it; returns the product.
fn help<T: Real, const N: usize>(
    problem: &Problem<'_, T>,
    satellite: u8,
    options: &Options,
    so_far: Probability,
    sets: &mut Sets<T, N>,
    scratch: &mut Scratch<'_, T, N>,
) -> Result<Probability, IntegerError> {
    let mut states: Vec<usize, MAX_BANDS> = Vec::new();
    for (&state, _) in problem.ambiguities.iter().zip(problem.of).filter(|(_, other)| **other == satellite) {
        if !sets.states.contains(&state) {
            states.push(state).map_err(|_| IntegerError::Capacity)?;
        }
    }
    let (m, s) = (sets.states.len(), states.len());
    if s == 0 {
        return Ok(so_far);
    }
    let (mut mean, mut covariance) = ([T::ZERO; MAX_BANDS], [[T::ZERO; MAX_BANDS]; MAX_BANDS]);
    let (Some(mean), Some(residual)) = (mean.get_mut(..s), scratch.vector.get_mut(..m)) else {
        return Err(IntegerError::Capacity);
    };
    let mut conditional = MatMut::new(covariance.as_flattened_mut(), s, s, MAX_BANDS)?;
    condition_on_integers(
        problem.mean,
        problem.covariance,
        &states,
        &sets.states,
        &sets.values,
        &mut MatMut::new(scratch.square.as_flattened_mut(), m, m, N)?,
        &mut MatMut::new(scratch.cross, m, s, MAX_BANDS)?,
        residual,
        mean,
        &mut conditional,
    )?;
    let resolution = resolve(mean, conditional.as_ref(), &options.config, scratch.integers)?;
    let mut variances = [T::ZERO; MAX_BANDS];
    for (scaled, &variance) in variances.iter_mut().zip(resolution.variances) {
        *scaled = variance * T::from_f64(options.variance_factor);
    }
    let product = so_far.and(success_rate::bootstrapped(variances.get(..s).unwrap_or_default()));
    let clear = resolution.method == Method::LeastSquares && resolution.ratio.to_f64() >= options.min_ratio;
    if product.success < options.min_success || !clear {
        return Ok(so_far);
    }
    for (&state, &integer) in states.iter().zip(resolution.best) {
        let _ = sets.states.push(state);
        let _ = sets.values.push(T::from_f64(integer as f64));
    }
    Ok(product)
}

#[cfg(test)]
mod tests {
    use super::Strategy as Choice;
    use super::*;
    use crate::linalg::spd;
    use proptest::prelude::*;

    type Work = SubsetWorkspace<f64, 12>;

    fn diagonal(sigmas: &[f64]) -> std::vec::Vec<f64> {
        let n = sigmas.len();
        let mut q = vec![0.0; n * n];
        sigmas.iter().enumerate().for_each(|(i, sigma)| q[i * (n + 1)] = sigma * sigma);
        q
    }

    /// Four satellites of one band, independent: 0.1 cycles succeed with 1 − 5.7e-7 (tables of Φ), 0.5 cycles with 0.683.
    #[test]
    fn one_bad_satellite_in_the_middle() {
        let q = diagonal(&[0.1, 0.5, 0.1, 0.1]);
        let (q, a) = (Mat::square(&q, 4).unwrap(), [3.02, -1.3, 7.1, -5.05]);
        let options = Options { min_satellites: 1, min_success: 0.99, ..Options::default() };
        let mut work = Work::new();
        let mut run = |options: &Options| {
            let subset = resolve_subset(&a, q, &[0, 1, 2, 3], &[0, 1, 2, 3], options, &mut work).unwrap().unwrap();
            (subset.indices.to_vec(), subset.values.to_vec(), subset.chosen, subset.success_rate.failure)
        };
        // By elevation only the first is left; it helps the two others that are good.
        let (indices, values, chosen, failure) = run(&options);
        assert_eq!((indices, values, chosen), (vec![0, 2, 3], vec![3.0, 7.0, -5.0], 1));
        assert!((failure / (3.0 * 5.733_031_437_583_87e-7) - 1.0).abs() < 1e-5, "{failure}");
        let (indices, ..) = run(&Options { assist: false, ..options });
        assert_eq!(indices, [0]);
        // A search finds the bad one.
        let (indices, _, chosen, _) =
            run(&Options { strategy: Choice::Search { budget: 20 }, assist: false, ..options });
        assert_eq!((indices, chosen), (vec![0, 2, 3], 3));
        // Without a budget it is the order that counts.
        let (indices, ..) = run(&Options { strategy: Choice::Search { budget: 1 }, assist: false, ..options });
        assert_eq!(indices, [0]);
        let none =
            resolve_subset(&a, q, &[0, 1, 2, 3], &[0, 1, 2, 3], &Options { min_satellites: 4, ..options }, &mut work);
        assert!(none.unwrap().is_none());
    }

    #[test]
    fn bands_go_together_and_shapes_are_checked() {
        let q = diagonal(&[0.1, 0.1, 0.1, 0.6]);
        let q = Mat::square(&q, 4).unwrap();
        let options = Options { min_satellites: 1, min_success: 0.99, ..Options::default() };
        let mut work = Work::new();
        let a = [1.1, 2.2, 2.9, 4.4];
        // Satellite 9 has the second and the fourth ambiguity.
        let subset = resolve_subset(&a, q, &[5, 9, 5, 9], &[5, 9], &options, &mut work).unwrap().unwrap();
        assert_eq!((subset.indices, subset.values), (&[0, 2][..], &[1.0, 3.0][..]));
        assert!(subset.full_success_rate.success < 0.7);
        assert!(matches!(resolve_subset(&a, q, &[5, 9, 5], &[5, 9], &options, &mut work), Err(IntegerError::Shape)));
        let mut small = SubsetWorkspace::<f64, 3>::new();
        assert!(matches!(
            resolve_subset(&a, q, &[5, 9, 5, 9], &[5, 9], &options, &mut small),
            Err(IntegerError::Capacity)
        ));
        assert!(resolve_subset(&a, q, &[5, 9, 5, 9], &[], &options, &mut work).unwrap().is_none());
    }

    proptest! {
        /// Whatever is fixed reaches P₀, each ambiguity once, and with P₀ = 0 all are.
        #[test]
        fn the_product_reaches_the_threshold((n, q) in spd::matrix(1..9usize), a in prop::collection::vec(-1e3..1e3f64, 8), least in 0.0..1.0, search: bool, factor in 1.0..4.0f64, ratio in 1.0..3.0f64) {
            let q: Vec<f64, 64> = q.iter().map(|x| 0.1 * x).collect();
            let q = Mat::square(&q, n).unwrap();
            let of: std::vec::Vec<u8> = (0..n as u8).map(|i| i / 2).collect();
            let strategy = if search { Choice::Search { budget: 10 } } else { Choice::Elevation };
            let mut work = Work::new();
            let options = Options { strategy, min_success: least, min_satellites: 1, min_ratio: ratio, variance_factor: factor, ..Options::default() };
            if let Some(subset) = resolve_subset(&a[..n], q, &of, &[3, 2, 1, 0], &options, &mut work).unwrap() {
                prop_assert!(subset.success_rate.success >= least);
                let mut indices = subset.indices.to_vec();
                indices.sort_unstable();
                indices.dedup();
                prop_assert!(indices.len() == subset.indices.len() && subset.values.len() == indices.len());
            }
            let all = Options { min_success: 0.0, min_ratio: 1.0, ..options };
            let subset = resolve_subset(&a[..n], q, &of, &[3, 2, 1, 0], &all, &mut work).unwrap().unwrap();
            prop_assert_eq!(subset.indices.len(), n);
        }
    }
}
