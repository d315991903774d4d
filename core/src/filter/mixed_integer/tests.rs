//! The filter with a small linear model: its limit, its options, and what it refuses. Runs of Section V are tested from the
//! host, where they can be simulated.

use super::super::linearize::Rule;
use super::super::update::{Form, UpdateError};
use super::*;
use crate::model::partially_linear::{Elementary, Nonlinear};
use core::ops::Range;
use nalgebra::{DMatrix, DVector};

/// y = H x + G n + e with x static, all rows correlated: what [`RecursiveMils`] is for.
#[derive(Clone)]
pub(super) struct Static {
    pub h: DMatrix<f64>,
    pub g: DMatrix<f64>,
    pub r: DMatrix<f64>,
}

impl Nonlinear for Static {
    fn inputs(&self) -> usize {
        0
    }
    fn outputs(&self) -> usize {
        self.h.nrows()
    }
    fn evaluate(&self, _u: &[f64], values: &mut [f64]) {
        values.fill(0.0);
    }
    fn gradient(&self, _u: &[f64], _row: usize, _gradient: &mut [f64]) {}
}

impl PartiallyLinear for Static {
    fn shape(&self) -> Shape {
        let unambiguous = (0..self.g.nrows()).take_while(|&i| self.g.row(i).amax() == 0.0).count();
        let (real, ambiguities) = (self.h.ncols(), self.g.ncols());
        Shape { real, ambiguities, correlated: self.h.nrows(), unambiguous, independent: 0 }
    }
    fn nonlinear(&self) -> Range<usize> {
        0..0
    }
    fn linear_row(&self, row: usize, entry: &mut dyn FnMut(usize, f64)) {
        let coefficients = self.h.row(row).iter().chain(self.g.row(row).iter()).copied().collect::<Vec<_>>();
        coefficients.into_iter().enumerate().filter(|(_, c)| *c != 0.0).for_each(|(state, c)| entry(state, c));
    }
    fn noise(&self, i: usize, j: usize) -> f64 {
        self.r[(i, j)]
    }
    fn variance(&self, _row: usize) -> f64 {
        1.0
    }
    fn transition(&self, _step: &mut dyn FnMut(Elementary)) {}
    fn process_noise(&self, _entry: &mut dyn FnMut(usize, usize, f64)) {}
}

/// Numbers between −1 and 1 from a seed (Numerical Recipes' generator).
pub(super) fn numbers(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Seven codes and three phases of three states, as in the golden file; the noise is correlated.
pub(super) fn model(seed: u64) -> Static {
    let mut next = numbers(seed);
    let h = DMatrix::from_fn(10, 3, |_, _| 2.0 * next());
    let g = DMatrix::from_fn(10, 3, |i, j| if i == 7 + j { 0.2 } else { 0.0 });
    let sigma = |i: usize| if i < 7 { 0.1 } else { 0.01 };
    let mix = DMatrix::from_fn(10, 10, |i, j| sigma(i) * (0.3 * next() + f64::from(u8::from(i == j))));
    Static { h, g, r: &mix * mix.transpose() }
}

/// Measurements of x and n with small errors.
pub(super) fn measure(model: &Static, x: &[f64; 3], n: &[i64; 3], seed: u64) -> Vec<f64> {
    let mut next = numbers(seed);
    let n = DVector::from_iterator(3, n.iter().map(|&n| n as f64));
    let noise = DVector::from_fn(10, |i, _| next() * model.r[(i, i)].sqrt());
    (&model.h * DVector::from_row_slice(x) + &model.g * n + noise).as_slice().to_vec()
}

type Filter = MixedIntegerFilter<f64, 6, 3, 3, 10>;

fn options(sigma: f64, form: Form) -> Options {
    Options { sigma_jump: sigma, sigma_stay: sigma, form, ..Options::default() }
}

/// Findings, 3.9: Algorithm 1 tends to recursive least squares as 1/V; 1e-5 at V = 1e6, 1e-7 at 1e9.
#[test]
fn a_free_ambiguity_is_the_recursive_limit() {
    for (variance, tolerance) in [(1e6, 1e-5), (1e9, 1e-7)] {
        for form in [Form::Joseph, Form::Array] {
            for seed in 0..5 {
                let mut filter = Filter::new(options(f64::sqrt(variance), form));
                let mut mean = [0.0; 6];
                mean[..3].copy_from_slice(&[1.0, -2.0, 0.5]);
                let variances = [4.0, 4.0, 4.0, variance, variance, variance];
                filter.reset_independent(3, &mean, &variances).unwrap();
                let mut limit = RecursiveMils::<f64, 3, 3, 10>::new();
                let prior = [4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 4.0];
                limit.reset(&mean[..3], Mat::square(&prior, 3).unwrap()).unwrap();
                for k in 0..6 {
                    let model = model(seed + 100 * k);
                    let n = [5 - k as i64, 40 * k as i64, -3];
                    let y = measure(&model, &[0.3, -1.0, 2.0], &n, seed + 7 * k);
                    filter.step(&model, &y).unwrap();
                    limit.step(&measurement(&model, &y).view()).unwrap();
                    assert_eq!(filter.integers(), limit.integers());
                    let pairs = [
                        (filter.mean(), filter.covariance(), limit.relaxed()),
                        (filter.constrained_mean(), filter.constrained_covariance(), limit.constrained()),
                    ];
                    for (mean, covariance, (expected, expected_covariance)) in pairs {
                        for i in 0..3 {
                            let variance = expected_covariance.get(i, i).unwrap();
                            assert!((mean[i] - expected[i]).abs() < tolerance * variance.sqrt().max(1.0));
                            assert!((covariance.get(i, i).unwrap() / variance - 1.0).abs() < tolerance);
                        }
                    }
                }
            }
        }
    }
}

/// Row-major copies of a model's matrices.
pub(super) struct Owned {
    h: Vec<f64>,
    g: Vec<f64>,
    r: Vec<f64>,
    y: Vec<f64>,
    m: usize,
    n: usize,
}

pub(super) fn measurement(model: &Static, y: &[f64]) -> Owned {
    let rows = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
    let (m, n) = (model.h.ncols(), model.g.ncols());
    Owned { h: rows(&model.h), g: rows(&model.g), r: rows(&model.r), y: y.to_vec(), m, n }
}

impl Owned {
    pub(super) fn view(&self) -> Measurement<'_, f64> {
        let p = self.y.len();
        Measurement {
            h: Mat::new(&self.h, p, self.m, self.m).unwrap(),
            g: Mat::new(&self.g, p, self.n, self.n).unwrap(),
            r: Mat::square(&self.r, p).unwrap(),
            y: &self.y,
        }
    }
}

fn started(options: Options) -> Filter {
    let mut filter = Filter::new(options);
    filter.reset_independent(3, &[0.0; 6], &[100.0, 100.0, 100.0, 1e4, 1e4, 1e4]).unwrap();
    filter
}

/// The gate leaves the phases out of the constrained update: it is then the least-squares solution from codes.
#[test]
fn a_closed_gate_uses_the_unambiguous_rows_only() {
    let model = model(3);
    let y = measure(&model, &[0.3, -1.0, 2.0], &[7, 0, -9], 1);
    let mut filter = started(Options { gate: 1.1, ..Options::default() });
    let outcome = filter.step(&model, &y).unwrap();
    assert!(outcome.gated && outcome.constrained.rows == 7 && outcome.relaxed.rows == 10);

    let h = model.h.rows(0, 7).into_owned();
    let weight = model.r.view((0, 0), (7, 7)).into_owned().try_inverse().unwrap();
    let information = h.transpose() * &weight * &h + DMatrix::identity(3, 3) * 0.01;
    let x = information.try_inverse().unwrap() * h.transpose() * weight * DVector::from_row_slice(&y[..7]);
    for i in 0..3 {
        assert!((filter.constrained_mean()[i] - x[i]).abs() < 1e-9);
    }
    // Gated, the conditional fix is the marginal of the relaxed density.
    let mut filter = started(Options { gate: 1.1, output: Output::ConditionalFix, ..Options::default() });
    filter.step(&model, &y).unwrap();
    assert_eq!(filter.constrained_mean(), &filter.mean()[..3]);
}

/// The relaxed density given the integers, by the textbook formula.
#[test]
fn the_conditional_fix_is_the_conditional_density() {
    let model = model(4);
    let y = measure(&model, &[0.3, -1.0, 2.0], &[7, 0, -9], 2);
    let mut filter = started(Options { output: Output::ConditionalFix, ..Options::default() });
    filter.step(&model, &y).unwrap();
    let p = DMatrix::from_fn(6, 6, |i, j| filter.covariance().get(i, j).unwrap());
    let gain = p.view((0, 3), (3, 3)) * p.view((3, 3), (3, 3)).into_owned().try_inverse().unwrap();
    let offset = DVector::from_fn(3, |i, _| filter.integers()[i] as f64 - filter.mean()[3 + i]);
    let mean = DVector::from_row_slice(&filter.mean()[..3]) + &gain * offset;
    let covariance = p.view((0, 0), (3, 3)) - &gain * p.view((3, 0), (3, 3));
    for i in 0..3 {
        assert!((filter.constrained_mean()[i] - mean[i]).abs() < 1e-8);
        for j in 0..3 {
            assert!((filter.constrained_covariance().get(i, j).unwrap() - covariance[(i, j)]).abs() < 1e-8);
        }
    }
}

#[test]
fn faulty_models_are_refused_by_name() {
    let good = model(5);
    let y = [0.0; 10];
    let refused = |model: &Static, detector| {
        let mut filter = started(Options { detector, ..Options::default() });
        let before = filter.mean().to_vec();
        let error = filter.step(model, &y).unwrap_err();
        assert_eq!(filter.mean(), before);
        error
    };
    let mut model = good.clone();
    model.g[(8, 1)] = 0.0;
    model.g[(8, 0)] = 0.2;
    for detector in [Detector::Projection, Detector::Weighted] {
        assert_eq!(refused(&model, detector), FilterError::Undetermined { index: 1 });
    }
    let mut model = good.clone();
    model.h.set_row(2, &DMatrix::zeros(1, 3).row(0));
    assert_eq!(refused(&model, Detector::None), FilterError::Update(UpdateError::EmptyRow { row: 2 }));
    let mut model = good.clone();
    model.h[(2, 1)] = f64::NAN;
    assert_eq!(refused(&model, Detector::None), FilterError::NotFinite);
    let mut model = good.clone();
    model.r *= -1e9;
    assert!(matches!(refused(&model, Detector::None), FilterError::Update(UpdateError::IndefiniteNoise { .. })));
    let none = Static { h: DMatrix::zeros(0, 3), g: DMatrix::zeros(0, 3), r: DMatrix::zeros(0, 0) };
    assert_eq!(refused(&none, Detector::None), FilterError::NoRows);
    let more = Static { h: DMatrix::zeros(11, 3), g: DMatrix::zeros(11, 3), r: DMatrix::zeros(11, 11) };
    assert_eq!(refused(&more, Detector::None), FilterError::Capacity);
}

/// Without ambiguities the filter is a Kalman filter, twice.
#[test]
fn no_ambiguities_at_all() {
    let mut model = model(6);
    model.g = DMatrix::zeros(10, 0);
    let mut filter = Filter::new(Options { rule: Rule::Taylor, ..Options::default() });
    filter.reset_independent(3, &[0.0; 3], &[100.0; 3]).unwrap();
    let outcome = filter.step(&model, &[1.0; 10]).unwrap();
    assert_eq!((outcome.integers, outcome.slips, outcome.gated), (None, 0, false));
    assert_eq!(filter.mean(), filter.constrained_mean());
}

/// The promise of 96 KB for state and workspace of Section V, and half of that in single precision.
#[test]
fn memory_of_section_v() {
    assert!(size_of::<SectionV<f64>>() <= 96 * 1024, "{}", size_of::<SectionV<f64>>());
    assert!(size_of::<SectionV<f32>>() <= 48 * 1024, "{}", size_of::<SectionV<f32>>());
}
