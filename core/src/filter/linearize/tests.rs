//! Moments against closed forms and against each other.

use super::*;
use nalgebra::{DMatrix, DVector};

/// g(u) = (u₀², u₀ u₁, 3 u₁ + 1).
struct Quadratic;

impl Nonlinear for Quadratic {
    fn inputs(&self) -> usize {
        2
    }
    fn outputs(&self) -> usize {
        3
    }
    fn evaluate(&self, u: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&[u[0] * u[0], u[0] * u[1], 3.0 * u[1] + 1.0]);
    }
    fn gradient(&self, u: &[f64], row: usize, gradient: &mut [f64]) {
        gradient.copy_from_slice(&[[2.0 * u[0], 0.0], [u[1], u[0]], [0.0, 3.0]][row]);
    }
}

const MEAN: [f64; 2] = [0.7, -1.2];
const COVARIANCE: [f64; 4] = [0.5, 0.2, 0.2, 0.8];

struct Moments {
    prediction: DVector<f64>,
    jacobian: DMatrix<f64>,
    noise: DMatrix<f64>,
}

fn run(rule: Rule, function: &impl Nonlinear, mean: &[f64], covariance: &[f64], samples: usize) -> Moments {
    let (d, p) = (mean.len(), function.outputs());
    let (mut prediction, mut jacobian, mut noise) = (vec![0.0; p], vec![0.0; p * d], vec![0.0; p * p]);
    let (mut values, mut reference, mut samples) = (vec![0.0; p], vec![0.0; p], vec![0.0; samples]);
    linearize(
        rule,
        function,
        mean,
        Mat::square(covariance, d).unwrap(),
        &mut prediction,
        &mut MatMut::new(&mut jacobian, p, d, d).unwrap(),
        &mut MatMut::square(&mut noise, p).unwrap(),
        Work { values: &mut values, reference: &mut reference, samples: &mut samples },
    )
    .unwrap();
    let noise = DMatrix::from_fn(p, p, |i, j| noise[i.max(j) * p + i.min(j)]);
    Moments { prediction: DVector::from_vec(prediction), jacobian: DMatrix::from_row_slice(p, d, &jacobian), noise }
}

/// Gaussian moments of the quadratic (Isserlis 1918): E = m² + P, covariance 4 m² P + 2 P² and so on.
#[test]
fn gauss_hermite_is_exact_for_quadratics() {
    let ([m0, m1], [p00, p01, _, p11]) = (MEAN, COVARIANCE);
    let jacobian = DMatrix::from_row_slice(3, 2, &[2.0 * m0, 0.0, m1, m0, 0.0, 3.0]);
    let omega = [2.0 * p00 * p00, 2.0 * p00 * p01, p00 * p11 + p01 * p01];
    for order in 3..=5 {
        let found = run(Rule::GaussHermite { order }, &Quadratic, &MEAN, &COVARIANCE, 3 * 25);
        let expected = DVector::from_vec(vec![m0 * m0 + p00, m0 * m1 + p01, 3.0 * m1 + 1.0]);
        assert!((&found.prediction - expected).amax() < 1e-14);
        assert!((&found.jacobian - &jacobian).amax() < 1e-14);
        let expected =
            DMatrix::from_row_slice(3, 3, &[omega[0], omega[1], 0.0, omega[1], omega[2], 0.0, 0.0, 0.0, 0.0]);
        assert!((found.noise - expected).amax() < 1e-14);
    }
}

/// Cubature and unscented rules have the exact mean and cross-covariance of quadratics, if not their Ω.
#[test]
fn degree_three_rules_have_mean_and_slope_of_quadratics() {
    let exact = run(Rule::GaussHermite { order: 3 }, &Quadratic, &MEAN, &COVARIANCE, 27);
    for rule in [Rule::Cubature, Rule::unscented(2), Rule::Unscented { alpha: 0.3, beta: 2.0, kappa: 0.0 }] {
        let found = run(rule, &Quadratic, &MEAN, &COVARIANCE, 15);
        assert!((found.prediction - &exact.prediction).amax() < 1e-13);
        assert!((found.jacobian - &exact.jacobian).amax() < 1e-13);
    }
}

#[test]
fn taylor_is_value_and_gradient() {
    let found = run(Rule::Taylor, &Quadratic, &MEAN, &COVARIANCE, 0);
    assert_eq!(found.prediction.as_slice(), &[0.7 * 0.7, 0.7 * -1.2, 3.0 * -1.2 + 1.0]);
    assert_eq!(found.jacobian, DMatrix::from_row_slice(3, 2, &[1.4, 0.0, -1.2, 0.7, 0.0, 3.0]));
    assert_eq!(found.noise, DMatrix::zeros(3, 3));
}

/// Whether deviations are stored or evaluated again changes nothing, not even a bit.
#[test]
fn few_samples_give_the_same_result() {
    for rule in [Rule::Cubature, Rule::unscented(2), Rule::GaussHermite { order: 3 }] {
        let all = run(rule, &Quadratic, &MEAN, &COVARIANCE, 27);
        for samples in [3, 4, 8, 20] {
            let few = run(rule, &Quadratic, &MEAN, &COVARIANCE, samples);
            assert_eq!((&few.prediction, &few.jacobian, &few.noise), (&all.prediction, &all.jacobian, &all.noise));
        }
    }
}

#[test]
fn bad_arguments_are_refused() {
    let attempt = |rule, mean: [f64; 2], covariance: [f64; 4], p: usize, samples: usize| {
        let (mut prediction, mut jacobian, mut noise) = (vec![0.0; p], vec![0.0; p * 2], vec![0.0; p * p]);
        let (mut values, mut reference, mut samples) = (vec![0.0; p], vec![0.0; p], vec![0.0; samples]);
        linearize(
            rule,
            &Quadratic,
            &mean,
            Mat::square(&covariance, 2).unwrap(),
            &mut prediction,
            &mut MatMut::new(&mut jacobian, p, 2, 2).unwrap(),
            &mut MatMut::square(&mut noise, p).unwrap(),
            Work { values: &mut values, reference: &mut reference, samples: &mut samples },
        )
    };
    let indefinite = [1.0, 2.0, 2.0, 1.0];
    assert_eq!(attempt(Rule::Cubature, MEAN, COVARIANCE, 2, 12), Err(LinearizeError::Shape));
    assert_eq!(attempt(Rule::Cubature, MEAN, COVARIANCE, 3, 2), Err(LinearizeError::Shape));
    assert_eq!(attempt(Rule::Cubature, MEAN, indefinite, 3, 12), Err(LinearizeError::NotPositiveDefinite));
    assert_eq!(attempt(Rule::Cubature, [f64::NAN, 0.0], COVARIANCE, 3, 12), Err(LinearizeError::NotFinite));
    assert_eq!(attempt(Rule::Taylor, [f64::INFINITY, 0.0], COVARIANCE, 3, 0), Err(LinearizeError::NotFinite));
    assert_eq!(attempt(Rule::GaussHermite { order: 9 }, MEAN, COVARIANCE, 3, 12), Err(LinearizeError::Rule));
}
