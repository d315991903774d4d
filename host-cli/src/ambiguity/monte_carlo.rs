//! Success rates by simulation: how often a float vector around zero comes back as zero.
//!
//! The samples are drawn in blocks, each from its own stream of the random generator, and blocks are counted by whatever
//! thread is free: the numbers depend on the seed alone, not on the threads. Drawn is the decorrelated vector,
//! ẑ = U D^½ e with e standard normal, for which bootstrapping is right where all |√d_i e_i| < ½.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use surefix_core::integer::IntegerError;
use surefix_core::integer::decorrelate::{back_transform, decorrelate};
use surefix_core::integer::search::{Level, Search, search};
use surefix_core::linalg::{Mat, MatMut};

/// Samples of a block.
const BLOCK: u64 = 1_000;

/// How many samples, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MonteCarlo {
    /// Float vectors drawn.
    pub samples: u64,
    /// Seed of the random generator.
    pub seed: u64,
    /// Nodes that a search may visit.
    pub budget: u32,
}

impl Default for MonteCarlo {
    /// Standard error below 0.002, at most a second or two.
    fn default() -> Self {
        Self { samples: 100_000, seed: 1, budget: surefix_core::integer::search::DEFAULT_BUDGET }
    }
}

/// How many samples came back right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Samples drawn.
    pub samples: u64,
    /// By rounding each ambiguity of the original vector.
    pub rounding: u64,
    /// By bootstrapping after decorrelation.
    pub bootstrapping: u64,
    /// By integer least squares.
    pub least_squares: u64,
    /// Samples for which the search gave up; they count as wrong.
    pub exhausted: u64,
}

impl Counts {
    /// A count as a rate.
    pub fn rate(&self, count: u64) -> f64 {
        count as f64 / self.samples as f64
    }

    fn add(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            rounding: self.rounding + other.rounding,
            bootstrapping: self.bootstrapping + other.bootstrapping,
            least_squares: self.least_squares + other.least_squares,
            exhausted: self.exhausted + other.exhausted,
        }
    }
}

/// A decorrelated covariance.
struct Decorrelated {
    n: usize,
    factor: Vec<f64>,
    variances: Vec<f64>,
    inverse: Vec<i64>,
}

impl MonteCarlo {
    /// Simulates float vectors with covariance `q` `[cycles²]`.
    pub fn run(&self, q: Mat<'_, f64>) -> Result<Counts, IntegerError> {
        let n = q.rows();
        let (mut factor, mut variances) = (vec![0.0; n * n], vec![0.0; n]);
        let (mut transform, mut inverse) = (vec![0; n * n], vec![0; n * n]);
        let mut view = MatMut::square(&mut factor, n)?;
        view.copy_from(q)?;
        view.symmetrize();
        decorrelate(
            &mut view,
            &mut variances,
            &mut MatMut::square(&mut transform, n)?,
            &mut MatMut::square(&mut inverse, n)?,
        )?;
        let model = Decorrelated { n, factor, variances, inverse };
        let blocks = self.samples.div_ceil(BLOCK);
        let counted = (0..blocks).into_par_iter().map(|block| {
            let samples = BLOCK.min(self.samples - block * BLOCK);
            self.count(&model, block, samples)
        });
        counted.try_reduce(Counts::default, |a, b| Ok(a.add(b)))
    }

    /// Counts one block.
    fn count(&self, model: &Decorrelated, block: u64, samples: u64) -> Result<Counts, IntegerError> {
        let n = model.n;
        let factor = Mat::square(&model.factor, n)?;
        let inverse = Mat::square(&model.inverse, n)?;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(block);
        let (mut errors, mut float, mut original) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let (mut best, mut norm) = (vec![0; n], [0.0]);
        let (mut levels, mut residual) = (vec![Level::ZERO; n], vec![0.0; n]);
        let mut counts = Counts { samples, ..Counts::default() };
        for _ in 0..samples {
            for (error, variance) in errors.iter_mut().zip(&model.variances) {
                *error = variance.sqrt() * random.sample::<f64, _>(StandardNormal);
            }
            for (i, float) in float.iter_mut().enumerate() {
                *float = factor.row(i).iter().zip(&errors).skip(i).map(|(u, e)| u * e).sum();
            }
            back_transform(inverse, &float, &mut original)?;
            counts.rounding += u64::from(original.iter().all(|a| a.abs() < 0.5));
            counts.bootstrapping += u64::from(errors.iter().all(|e| e.abs() < 0.5));
            let mut candidate = MatMut::new(&mut best, 1, n, n)?;
            let variances = &model.variances;
            let budget = self.budget;
            match search(&float, factor, variances, budget, &mut candidate, &mut norm, &mut levels, &mut residual)? {
                Search::Complete { .. } => counts.least_squares += u64::from(best.iter().all(|&z| z == 0)),
                Search::Exhausted { .. } => counts.exhausted += 1,
            }
        }
        Ok(counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::integer::success_rate;

    /// diag(0.04, 0.0004, 0.09): all three estimators are rounding, whose rate is the product, 0.8932; standard error
    /// 0.0014.
    #[test]
    fn independent_ambiguities_have_the_product_rate() {
        let q = [0.04, 0.0, 0.0, 0.0, 0.0004, 0.0, 0.0, 0.0, 0.09];
        let counts = MonteCarlo { samples: 50_000, ..MonteCarlo::default() }.run(Mat::square(&q, 3).unwrap()).unwrap();
        let expected = success_rate::bootstrapped(&[0.04, 0.0004, 0.09]).success;
        for count in [counts.rounding, counts.bootstrapping, counts.least_squares] {
            assert!((counts.rate(count) - expected).abs() < 0.006, "{counts:?}");
        }
        assert_eq!((counts.samples, counts.exhausted), (50_000, 0));
    }

    #[test]
    fn threads_do_not_matter() {
        let q = [0.3, 0.25, 0.25, 0.3];
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| MonteCarlo { samples: 4_500, ..MonteCarlo::default() }.run(Mat::square(&q, 2).unwrap()))
        };
        let single = run(1).unwrap();
        assert_eq!(run(3).unwrap(), single);
        assert!(single.least_squares >= single.bootstrapping && single.bootstrapping > single.rounding, "{single:?}");
        let other = MonteCarlo { samples: 4_500, seed: 2, ..MonteCarlo::default() };
        assert_ne!(other.run(Mat::square(&q, 2).unwrap()).unwrap(), single);
    }

    #[test]
    fn a_search_that_gives_up_is_counted() {
        let q = [0.3, 0.25, 0.25, 0.3];
        let counts = MonteCarlo { samples: 10, budget: 1, seed: 1 }.run(Mat::square(&q, 2).unwrap()).unwrap();
        assert_eq!((counts.exhausted, counts.least_squares), (10, 0));
        let singular = [1.0, 1.0, 1.0, 1.0];
        assert!(MonteCarlo::default().run(Mat::square(&singular, 2).unwrap()).is_err());
    }
}
