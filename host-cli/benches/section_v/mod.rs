//! Section V of Greiff et al. (CCTA 2021), simulated, for a benchmark and for tests; and the same filter in dense matrices.

pub mod dense;

use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surefix_core::filter::jump::JumpProcess;
use surefix_core::model::partially_linear::{Nonlinear, PartiallyLinear};
use surefix_core::model::virtual_bias::{VirtualBiasModel, VirtualBiasParameters};

/// Prior and measurements of a run, with the truth.
pub struct Run {
    /// Relative to the base, the highest first.
    pub satellites: Vec<Vector3<f64>>,
    pub parameters: VirtualBiasParameters,
    /// Prior mean of (x, n) and its variances.
    pub mean: Vec<f64>,
    pub variances: Vec<f64>,
    pub epochs: Vec<Epoch>,
}

/// An epoch: the measurements and the true state.
#[allow(dead_code)] // A benchmark does not look at the truth.
pub struct Epoch {
    pub y: Vec<f64>,
    pub x: Vec<f64>,
    pub n: Vec<i64>,
}

impl Run {
    /// `count` satellites spread over the sky, `epochs` of 0.1 s, jumps with probability `jump` a step and ambiguity.
    pub fn new(count: usize, epochs: usize, jump: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move |sigma: f64| sigma * random.sample::<f64, _>(StandardNormal);
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x9e37_79b9);
        let satellites: Vec<Vector3<f64>> = (0..count).map(satellite).collect();
        let parameters = VirtualBiasParameters::default();
        let model = VirtualBiasModel { satellites: &satellites, parameters };
        let shape = model.shape();

        let mut x = vec![0.0; shape.real];
        x[..3].copy_from_slice(&[7000.0, 7141.0, -8.0]);
        let mut mean = vec![0.0; shape.states()];
        let mut variances = vec![1.0; shape.real];
        variances.resize(shape.states(), 100.0);
        for i in 0..3 {
            mean[i] = x[i] + normal(10.0);
            variances[i] = 100.0;
        }
        (3..shape.real).for_each(|i| x[i] = normal(1.0));
        let mut n: Vec<i64> = (0..shape.ambiguities).map(|_| random.random_range(-10..=10)).collect();
        let process = JumpProcess { largest: 10, probability: jump };
        let epochs = (0..epochs)
            .map(|_| {
                advance(&model, &mut x, &mut normal);
                n.iter_mut().for_each(|n| *n += process.from_uniform(random.random()));
                Epoch { y: measure(&model, &x, &n, &mut normal), x: x.clone(), n: n.clone() }
            })
            .collect();
        Self { satellites, parameters, mean, variances, epochs }
    }

    /// The model at every epoch: the satellites stand still.
    pub fn model(&self) -> VirtualBiasModel<'_> {
        VirtualBiasModel { satellites: &self.satellites, parameters: self.parameters }
    }
}

/// Satellite i, the first near the zenith, the others in golden-angle azimuths down to 10°, at 2.2e7 m `[m]`.
fn satellite(i: usize) -> Vector3<f64> {
    let (elevation, azimuth) =
        if i == 0 { (80.0, 0.0) } else { (70.0 - 60.0 * ((i * 5 % 13) as f64) / 13.0, 137.5 * i as f64) };
    let (elevation, azimuth) = (f64::to_radians(elevation), f64::to_radians(azimuth));
    2.2e7 * Vector3::new(elevation.cos() * azimuth.sin(), elevation.cos() * azimuth.cos(), elevation.sin())
}

/// x ← F x + w; the noise of position and velocity is correlated.
fn advance(model: &VirtualBiasModel, x: &mut [f64], normal: &mut impl FnMut(f64) -> f64) {
    let VirtualBiasParameters { interval: h, acceleration, bias_walk, .. } = model.parameters;
    for axis in 0..3 {
        let (velocity, rest) = (normal((acceleration * h).sqrt()), normal((acceleration * h * h * h / 12.0).sqrt()));
        x[axis] += h * x[axis + 3] + 0.5 * h * velocity + rest;
        x[axis + 3] += velocity;
    }
    x[6..].iter_mut().for_each(|bias| *bias += normal((h * bias_walk).sqrt()));
}

/// y = g(p) + L w + G n + e.
fn measure(model: &VirtualBiasModel, x: &[f64], n: &[i64], normal: &mut impl FnMut(f64) -> f64) -> Vec<f64> {
    let shape = model.shape();
    let mut y = vec![0.0; shape.rows()];
    model.evaluate(&x[..3], &mut y[..shape.correlated]);
    for (row, y) in y.iter_mut().enumerate() {
        model.linear_row(row, &mut |state, c| {
            *y += c * if state < shape.real { x[state] } else { n[state - shape.real] as f64 };
        });
    }
    // Noise of double differences from that of single ones, so that it is correlated as R says.
    let sigmas = [model.parameters.sigma_code, model.parameters.sigma_phase];
    for (block, sigma) in y.chunks_mut(shape.ambiguities).zip(sigmas) {
        let reference = normal(2f64.sqrt() * sigma);
        block.iter_mut().for_each(|y| *y += reference - normal(2f64.sqrt() * sigma));
    }
    y[shape.correlated..].iter_mut().for_each(|y| *y += normal(model.parameters.sigma_bias));
    y
}
