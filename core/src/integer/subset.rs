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

/// Memory for up to N ambiguities: 6 N² numbers of 8 bytes.
#[derive(Debug)]
pub struct SubsetWorkspace<T, const N: usize> {
    integers: Workspace<T, N>,
    a: [T; N],
    q: [[T; N]; N],
    factor: [[T; N]; N],
    cross: [[T; MAX_BANDS]; N],
    residual: [T; N],
    indices: Vec<usize, N>,
    values: Vec<T, N>,
    satellites: Vec<u8, N>,
    trial: Vec<u8, N>,
    kept: Vec<u8, N>,
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
            a: [T::ZERO; N],
            q: [[T::ZERO; N]; N],
            factor: [[T::ZERO; N]; N],
            cross: [[T::ZERO; MAX_BANDS]; N],
            residual: [T::ZERO; N],
            indices: Vec::new(),
            values: Vec::new(),
            satellites: Vec::new(),
            trial: Vec::new(),
            kept: Vec::new(),
        }
    }

    /// Bootstrapped success rate of the ambiguities `a` (n) with covariance `q` (n × n) after decorrelation.
    pub fn success_rate(&mut self, a: &[T], q: Mat<'_, T>) -> Result<Probability, IntegerError> {
        let mut work = self.integers.work(a.len())?;
        work.prepare(a, q)?;
        Ok(success_rate::bootstrapped(work.variances))
    }

    /// The ambiguities of the satellites in `trial`, in the order of `a`, into `indices`.
    fn gather(&mut self, of: &[u8]) {
        self.indices.clear();
        for (i, satellite) in of.iter().enumerate() {
            if self.trial.contains(satellite) {
                // There are at most N, as checked on entry.
                let _ = self.indices.push(i);
            }
        }
    }

    /// Bootstrapped success rate of `trial` after decorrelation.
    fn rate(&mut self, a: &[T], q: Mat<'_, T>, of: &[u8]) -> Result<Probability, IntegerError> {
        self.gather(of);
        let m = self.indices.len();
        let mut sub_q = MatMut::new(self.q.as_flattened_mut(), m, m, N)?;
        let sub_a = self.a.get_mut(..m).ok_or(IntegerError::Capacity)?;
        select(a, q, &self.indices, sub_a, &mut sub_q)?;
        let mut work = self.integers.work(m)?;
        work.prepare(sub_a, sub_q.as_ref())?;
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
    workspace.satellites.clear();
    for satellite in order.iter().filter(|satellite| of.contains(satellite)) {
        if !workspace.satellites.contains(satellite) {
            workspace.satellites.push(*satellite).map_err(|_| IntegerError::Capacity)?;
        }
    }
    let Some((chosen_rate, full_success_rate, examined)) = choose(a, q, of, options, workspace)? else {
        return Ok(None);
    };
    let m = workspace.indices.len();
    let sub_q = MatMut::new(workspace.q.as_flattened_mut(), m, m, N)?;
    let sub_a = workspace.a.get(..m).ok_or(IntegerError::Capacity)?;
    let resolution = resolve(sub_a, sub_q.as_ref(), &options.config, &mut workspace.integers)?;
    let (ratio, norms, method) = (resolution.ratio, [resolution.best_norm, resolution.second_norm], resolution.method);
    workspace.values.clear();
    for &integer in resolution.best {
        let _ = workspace.values.push(T::from_f64(integer as f64));
    }
    let mut success_rate = chosen_rate;
    if options.assist {
        for k in 0..workspace.satellites.len() {
            let Some(&satellite) = workspace.satellites.get(k) else { break };
            if !workspace.trial.contains(&satellite) {
                success_rate = help(a, q, of, satellite, options, success_rate, workspace)?;
            }
        }
    }
    Ok(Some(Subset {
        indices: &workspace.indices,
        values: &workspace.values,
        chosen: m,
        success_rate,
        ratio,
        norms,
        method,
        full_success_rate,
        examined,
    }))
}

/// The first set that reaches P₀ is left in `trial`, `indices`, `a` and `q`: its rate, that of all, and sets examined.
fn choose<T: Real, const N: usize>(
    a: &[T],
    q: Mat<'_, T>,
    of: &[u8],
    options: &Options,
    workspace: &mut SubsetWorkspace<T, N>,
) -> Result<Option<(Probability, Probability, usize)>, IntegerError> {
    workspace.trial = workspace.satellites.clone();
    let least = options.min_satellites.max(1);
    let (mut full, mut examined) = (None, 0);
    while workspace.trial.len() >= least {
        let rate = workspace.rate(a, q, of)?;
        examined += 1;
        let all = *full.get_or_insert(rate);
        if rate.success >= options.min_success {
            return Ok(Some((rate, all, examined)));
        }
        workspace.kept = workspace.trial.clone();
        let mut worst = workspace.kept.len() - 1;
        if let Strategy::Search { budget } = options.strategy {
            let mut best = -1.0;
            for leave in (0..workspace.kept.len()).rev() {
                if examined >= usize::from(budget) || workspace.kept.len() <= least {
                    break;
                }
                workspace.trial = workspace.kept.clone();
                workspace.trial.remove(leave);
                let rate = workspace.rate(a, q, of)?.success;
                examined += 1;
                if rate > best {
                    (best, worst) = (rate, leave);
                }
            }
        }
        workspace.trial = workspace.kept.clone();
        workspace.trial.remove(worst);
    }
    Ok(None)
}

/// Fixes the ambiguities of a satellite given those fixed so far, if the product of all rates allows it; returns the product.
fn help<T: Real, const N: usize>(
    a: &[T],
    q: Mat<'_, T>,
    of: &[u8],
    satellite: u8,
    options: &Options,
    so_far: Probability,
    workspace: &mut SubsetWorkspace<T, N>,
) -> Result<Probability, IntegerError> {
    let mut states: Vec<usize, MAX_BANDS> = Vec::new();
    for (i, _) in of.iter().enumerate().filter(|(_, other)| **other == satellite) {
        states.push(i).map_err(|_| IntegerError::Capacity)?;
    }
    let (m, s) = (workspace.indices.len(), states.len());
    let (mut mean, mut covariance) = ([T::ZERO; MAX_BANDS], [[T::ZERO; MAX_BANDS]; MAX_BANDS]);
    let (Some(mean), Some(residual)) = (mean.get_mut(..s), workspace.residual.get_mut(..m)) else {
        return Err(IntegerError::Capacity);
    };
    let mut conditional = MatMut::new(covariance.as_flattened_mut(), s, s, MAX_BANDS)?;
    condition_on_integers(
        a,
        q,
        &states,
        &workspace.indices,
        &workspace.values,
        &mut MatMut::new(workspace.factor.as_flattened_mut(), m, m, N)?,
        &mut MatMut::new(workspace.cross.as_flattened_mut(), m, s, MAX_BANDS)?,
        residual,
        mean,
        &mut conditional,
    )?;
    let resolution = resolve(mean, conditional.as_ref(), &options.config, &mut workspace.integers)?;
    let product = so_far.and(resolution.success_rate);
    if product.success < options.min_success || resolution.method != Method::LeastSquares {
        return Ok(so_far);
    }
    for (&state, &integer) in states.iter().zip(resolution.best) {
        let _ = workspace.indices.push(state);
        let _ = workspace.values.push(T::from_f64(integer as f64));
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
        fn the_product_reaches_the_threshold((n, q) in spd::matrix(1..9usize), a in prop::collection::vec(-1e3..1e3f64, 8), least in 0.0..1.0, search: bool) {
            let q: Vec<f64, 64> = q.iter().map(|x| 0.1 * x).collect();
            let q = Mat::square(&q, n).unwrap();
            let of: std::vec::Vec<u8> = (0..n as u8).map(|i| i / 2).collect();
            let strategy = if search { Choice::Search { budget: 10 } } else { Choice::Elevation };
            let mut work = Work::new();
            let options = Options { strategy, min_success: least, min_satellites: 1, ..Options::default() };
            if let Some(subset) = resolve_subset(&a[..n], q, &of, &[3, 2, 1, 0], &options, &mut work).unwrap() {
                prop_assert!(subset.success_rate.success >= least);
                let mut indices = subset.indices.to_vec();
                indices.sort_unstable();
                indices.dedup();
                prop_assert!(indices.len() == subset.indices.len() && subset.values.len() == indices.len());
            }
            let all = Options { min_success: 0.0, ..options };
            let subset = resolve_subset(&a[..n], q, &of, &[3, 2, 1, 0], &all, &mut work).unwrap().unwrap();
            prop_assert_eq!(subset.indices.len(), n);
        }
    }
}
