//! The value of the function that the M-step minimises: Q(θ, θ') = E[−ln p(x, y | θ)], x smoothed with θ'.
//!
//! Greiff et al. (2023), eq. (10), with all constants. It is a function of few numbers: the sums of EM and the log
//! determinants of the shapes, gathered once for any number of θ. The measurements enter linearised at the smoothed mean.
//! (EM needs none of this; the paper's figure of the objective does.)

use super::model::{Density, Model, Sums, Transition};
use super::pass::{LN_2_PI, PassError, Passes};
use surefix_core::linalg::{MatMut, cholesky, triangular};
use surefix_core::smooth::SmoothError;
use surefix_core::smooth::step::Block;

/// What E[−ln p(x, y | θ)] depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// Of the process noise with parameters.
    pub process: Sums,
    /// Of the residuals of measurements.
    pub measurements: Sums,
    /// The part of the process noise without parameters: ambiguities, births.
    rest: f64,
    prior: f64,
}

/// Q(θ, θ') by parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Objective {
    /// Process noise with parameters.
    pub process: f64,
    /// Process noise without.
    pub rest: f64,
    /// The density before the first epoch.
    pub prior: f64,
    /// Measurements.
    pub measurements: f64,
}

impl Objective {
    /// Their sum.
    pub fn total(&self) -> f64 {
        self.process + self.rest + self.prior + self.measurements
    }
}

impl Expectation {
    /// Gathers it in a backward pass, after a forward pass of `passes` over the same model.
    pub fn gather<M: Model + ?Sized>(model: &M, passes: &mut Passes<'_>) -> Result<Self, PassError> {
        let mut process = Sums::new(model.parameters().len());
        let mut measurements = process.clone();
        let [mut rest, mut prior] = [0.0; 2];
        let mut density = Density::default();
        model.prior(&mut density);
        let mut all = Transition::default();
        let mut failure = None;
        passes.walk(
            model,
            |epoch, scratch| {
                model.residuals(epoch.k, epoch.smoothed, scratch, &mut measurements);
                if epoch.k == 0 {
                    match prior_term(&mut density, epoch.smoothed) {
                        Ok(term) => prior = term,
                        Err(source) => failure = Some(PassError::Step { epoch: 0, source }),
                    }
                }
            },
            |step, work| {
                let blocks = &step.transition.noise;
                let determinants = blocks.iter().map(log_determinant).collect::<Result<Vec<f64>, _>>()?;
                // Each block as a component of its own.
                all.clone_from(step.transition);
                all.noise.iter_mut().enumerate().for_each(|(i, block)| block.component = Some(i));
                step.sums(&all, work, |i, sum| match blocks[i].component {
                    Some(j) => {
                        process.add(j, sum.quadratic, sum.count);
                        process.add_log_determinant(j, determinants[i]);
                    }
                    None => rest += term(sum.quadratic, sum.count, determinants[i], blocks[i].scale),
                })
            },
        )?;
        failure.map_or(Ok(Self { process, measurements, rest, prior }), Err)
    }

    /// Q at the variances θ.
    pub fn value(&self, variances: &[f64]) -> Objective {
        let sum = |sums: &Sums| -> f64 {
            let terms = variances.iter().enumerate().filter(|(j, _)| sums.count[*j] > 0.0);
            terms.map(|(j, &v)| term(sums.quadratic[j], sums.count[j], sums.log_determinant[j], v)).sum()
        };
        let (process, measurements) = (sum(&self.process), sum(&self.measurements));
        Objective { process, rest: self.rest, prior: self.prior, measurements }
    }
}

/// ½ (E[eᵀ shape⁻¹ e]/s + n ln s + ln det shape + n ln 2π).
fn term(quadratic: f64, count: f64, log_determinant: f64, scale: f64) -> f64 {
    0.5 * (quadratic / scale + count * (scale.ln() + LN_2_PI) + log_determinant)
}

/// ln det shape.
fn log_determinant(block: &Block<f64>) -> Result<f64, SmoothError> {
    let mut shape = block.shape;
    let width = shape[0].len();
    let mut factor = MatMut::new(shape.as_flattened_mut(), block.dim, block.dim, width)?;
    cholesky::factor(&mut factor)?;
    Ok(cholesky::log_determinant(factor.as_ref()))
}

/// E[−ln p(x_0)]; spoils the covariance of `prior`.
fn prior_term(prior: &mut Density, smoothed: &Density) -> Result<f64, SmoothError> {
    let n = prior.dim();
    let mut difference: Vec<f64> = smoothed.mean.iter().zip(&prior.mean).map(|(a, b)| a - b).collect();
    let mut p: Vec<f64> = (0..n * n).map(|index| smoothed.covariance(index / n, index % n)).collect();
    let mut factor = MatMut::square(&mut prior.covariance, n)?;
    cholesky::factor(&mut factor)?;
    let l = factor.as_ref();
    triangular::forward(l, &mut difference)?;
    // Tr(P₀⁻¹ Pˢ) = Tr(L⁻¹ Pˢ L⁻ᵀ).
    let mut p = MatMut::square(&mut p, n)?;
    triangular::forward_rows(l, &mut p)?;
    p.transpose();
    triangular::forward_rows(l, &mut p)?;
    let trace: f64 = (0..n).filter_map(|i| p.get(i, i)).sum();
    let squares: f64 = difference.iter().map(|d| d * d).sum();
    Ok(0.5 * (squares + trace + cholesky::log_determinant(l) + n as f64 * LN_2_PI))
}

#[cfg(test)]
mod tests {
    use super::super::batch::random;
    use super::super::em;
    use super::super::pass::PassOptions;
    use super::*;
    use proptest::prelude::*;
    use surefix_core::filter::update::Form;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// The M-step is the argmin, and the gradient of Q at θ = θ' is that of the likelihood (Fisher's identity).
        #[test]
        fn m_step_minimises_it_and_its_slope_is_that_of_the_likelihood(seed: u64) {
            let mut model = random(seed, 12);
            model.form = Form::Joseph;
            let mut passes = Passes::new(PassOptions::default());
            passes.forward(&model).unwrap();
            let expectation = Expectation::gather(&model, &mut passes).unwrap();
            let mut sums = expectation.process.clone();
            sums.merge(&expectation.measurements);
            let theta: Vec<f64> = model.parameters().iter().map(|parameter| parameter.variance).collect();
            let best: Vec<f64> = em::maximize(&model, &sums).iter().map(|log| log.exp()).collect();
            let lowest = expectation.value(&best).total();
            prop_assert!(lowest <= expectation.value(&theta).total());
            for j in (0..3).filter(|&j| sums.count[j] > 0.0) {
                for factor in [0.9, 1.1] {
                    let mut other = best.clone();
                    other[j] *= factor;
                    prop_assert!(expectation.value(&other).total() > lowest);
                }
                let step = 1e-4;
                let slope = |value: &mut dyn FnMut(&[f64]) -> f64| {
                    let mut at = |sign: f64| {
                        let mut moved = theta.clone();
                        moved[j] *= (sign * step).exp();
                        value(&moved)
                    };
                    (at(1.0) - at(-1.0)) / (2.0 * step)
                };
                let of_objective = slope(&mut |theta| expectation.value(theta).total());
                let of_likelihood = slope(&mut |theta| {
                    let mut moved = model.clone();
                    moved.set_variances(theta);
                    Passes::new(PassOptions::default()).forward(&moved).unwrap().negative_log_likelihood()
                });
                prop_assert!((of_objective - of_likelihood).abs() < 1e-5 * (1.0 + of_likelihood.abs()));
            }
        }
    }
}
