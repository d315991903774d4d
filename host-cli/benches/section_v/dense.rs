//! Algorithm 1 with cubature as one writes it down: dense matrices, Joseph's form. Slow, and an oracle for the filter that
//! uses the structure of the model.

use nalgebra::{Cholesky, DMatrix, DVector};
use surefix_core::filter::linearize::Rule;
use surefix_core::filter::mixed_integer::Options;
use surefix_core::integer::{Config, Workspace, resolve};
use surefix_core::linalg::Mat;
use surefix_core::model::partially_linear::{Elementary, Nonlinear, PartiallyLinear};
use surefix_core::model::virtual_bias::VirtualBiasModel;

/// N(m, P).
#[derive(Clone)]
pub struct Density {
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

/// Both densities and the integers of the last epoch.
pub struct DenseFilter {
    options: Options,
    pub relaxed: Density,
    pub constrained: Density,
    pub integers: Vec<i64>,
    pub slip_estimates: Vec<f64>,
    workspace: Box<Workspace<f64, 32>>,
}

/// What does not change: F, W, L with G, and R, for all states.
pub struct Matrices {
    transition: DMatrix<f64>,
    process: DMatrix<f64>,
    linear: DMatrix<f64>,
    noise: DMatrix<f64>,
    real: usize,
}

impl Matrices {
    pub fn new(model: &VirtualBiasModel) -> Self {
        let shape = model.shape();
        let (n, p) = (shape.states(), shape.rows());
        let mut transition = DMatrix::identity(n, n);
        model.transition(&mut |step| {
            if let Elementary::Shear { to, from, factor } = step {
                transition[(to, from)] = factor;
            }
        });
        let mut process = DMatrix::zeros(n, n);
        model.process_noise(&mut |i, j, w| {
            process[(i, j)] = w;
            process[(j, i)] = w;
        });
        let mut linear = DMatrix::zeros(p, n);
        for row in 0..p {
            model.linear_row(row, &mut |state, c| linear[(row, state)] += c);
        }
        let noise = DMatrix::from_fn(p, p, |i, j| match i.max(j) < shape.correlated {
            true => model.noise(i.max(j), i.min(j)),
            false if i == j => model.variance(i),
            false => 0.0,
        });
        Self { transition, process, linear, noise, real: shape.real }
    }
}

impl Density {
    fn predict(&mut self, matrices: &Matrices) {
        let n = self.mean.len();
        let f = matrices.transition.view((0, 0), (n, n));
        self.mean = f * &self.mean;
        self.covariance = f * &self.covariance * f.transpose() + matrices.process.view((0, 0), (n, n));
    }

    /// ŷ, J and R + Ω by cubature over the position.
    fn linearize(&self, model: &VirtualBiasModel, matrices: &Matrices) -> (DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
        let (n, p, d, c) = (self.mean.len(), matrices.noise.nrows(), 3, model.outputs());
        let factor = Cholesky::new(self.covariance.view((0, 0), (d, d)).into_owned()).unwrap().l();
        let mut points = Rule::Cubature.points(d).unwrap();
        let (count, mut xi) = (points.count(), [0.0; 3]);
        let (mut values, mut units) = (DMatrix::zeros(c, count), DMatrix::zeros(d, count));
        for k in 0..count {
            points.next(&mut xi).unwrap();
            units.set_column(k, &DVector::from_row_slice(&xi));
            let u = self.mean.rows(0, d) + &factor * units.column(k);
            let mut value = vec![0.0; c];
            model.evaluate(u.as_slice(), &mut value);
            values.set_column(k, &DVector::from_vec(value));
        }
        let weight = 1.0 / count as f64;
        let mean = values.column_sum() * weight;
        values.column_iter_mut().for_each(|mut column| column -= &mean);
        let slope = &values * units.transpose() * weight;
        let residuals = &values - &slope * &units;
        let omega = &residuals * residuals.transpose() * weight;
        let mut jacobian = matrices.linear.columns(0, n).into_owned();
        let slope = factor.transpose().solve_upper_triangular(&slope.transpose()).unwrap().transpose();
        // J_u C = A ᵀ, so that J_u = A ᵀ C⁻¹: the solve above is with Cᵀ.
        jacobian.view_mut((0, 0), (c, d)).copy_from(&slope);
        let mut noise = matrices.noise.clone();
        let mut block = noise.view_mut((0, 0), (c, c));
        block += omega;
        let mut predicted = matrices.linear.columns(0, n) * &self.mean;
        let mut top = predicted.rows_mut(0, c);
        top += mean;
        assert_eq!(predicted.len(), p);
        (predicted, jacobian, noise)
    }

    fn update(&mut self, innovation: &DVector<f64>, j: &DMatrix<f64>, noise: &DMatrix<f64>) {
        let n = self.mean.len();
        let cross = &self.covariance * j.transpose();
        let s = j * &cross + noise;
        let gain = Cholesky::new(s).unwrap().solve(&cross.transpose()).transpose();
        self.mean += &gain * innovation;
        let a = DMatrix::identity(n, n) - &gain * j;
        self.covariance = &a * &self.covariance * a.transpose() + &gain * noise * gain.transpose();
    }
}

impl DenseFilter {
    pub fn new(options: Options, mean: &[f64], variances: &[f64], real: usize) -> Self {
        let density = |n: usize| Density {
            mean: DVector::from_row_slice(&mean[..n]),
            covariance: DMatrix::from_diagonal(&DVector::from_row_slice(&variances[..n])),
        };
        Self {
            options,
            relaxed: density(mean.len()),
            constrained: density(real),
            integers: vec![0; mean.len() - real],
            slip_estimates: Vec::new(),
            workspace: Box::new(Workspace::new()),
        }
    }

    pub fn step(&mut self, model: &VirtualBiasModel, matrices: &Matrices, y: &[f64]) {
        let Options { threshold, sigma_jump, sigma_stay, .. } = self.options;
        let (real, shape) = (matrices.real, model.shape());
        let y = DVector::from_row_slice(y);
        self.relaxed.predict(matrices);
        let (predicted, jacobian, noise) = self.relaxed.linearize(model, matrices);
        let innovation = &y - predicted;
        let phases = innovation.rows(shape.unambiguous, shape.ambiguities);
        self.slip_estimates = phases.iter().map(|nu| nu / model.parameters.wavelength).collect();
        for (i, estimate) in self.slip_estimates.iter().enumerate() {
            let sigma = if estimate.abs() > threshold { sigma_jump } else { sigma_stay };
            self.relaxed.covariance[(real + i, real + i)] += sigma * sigma;
        }
        self.relaxed.update(&innovation, &jacobian, &noise);

        let n = shape.ambiguities;
        let float: Vec<f64> = self.relaxed.mean.rows(real, n).iter().copied().collect();
        let covariance = self.relaxed.covariance.view((real, real), (n, n)).into_owned();
        let found =
            resolve(&float, Mat::square(covariance.as_slice(), n).unwrap(), &Config::default(), &mut self.workspace);
        self.integers = found.unwrap().best.to_vec();

        self.constrained.predict(matrices);
        let (predicted, jacobian, noise) = self.constrained.linearize(model, matrices);
        let integers = DVector::from_iterator(n, self.integers.iter().map(|&integer| integer as f64));
        let innovation = y - predicted - matrices.linear.columns(real, n) * integers;
        self.constrained.update(&innovation, &jacobian, &noise);
    }
}
