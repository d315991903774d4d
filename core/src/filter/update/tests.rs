//! The three forms against each other, and against bad input. Golden vectors are run from the host.

use super::*;
use crate::linalg::spd;
use proptest::prelude::*;

const FORMS: [Form; 3] = [Form::Sequential, Form::Joseph, Form::Array];

struct Problem<'a> {
    mean: &'a [f64],
    p: &'a [f64],
    h: &'a [f64],
    innovation: &'a [f64],
    noise: &'a [f64],
}

struct Posterior {
    mean: Vec<f64>,
    p: Vec<f64>,
    outcome: Result<Gauge<f64>, UpdateError>,
}

impl Problem<'_> {
    fn solve(&self, form: Form) -> Posterior {
        let (m, n) = (self.innovation.len(), self.mean.len());
        let (mut mean, mut p) = (self.mean.to_vec(), self.p.to_vec());
        let (mut innovation, mut noise) = (self.innovation.to_vec(), self.noise.to_vec());
        let mut buffer = vec![f64::NAN; buffer_len(m, n)];
        let outcome = update(
            form,
            &mut mean,
            &mut MatMut::square(&mut p, n).unwrap(),
            &Mat::new(self.h, m, n, n).unwrap(),
            &mut innovation,
            &mut MatMut::square(&mut noise, m).unwrap(),
            &mut buffer,
        );
        Posterior { mean, p, outcome }
    }
}

proptest! {
    #[test]
    fn all_forms_agree(
        (n, p) in spd::matrix(1..7usize),
        (m, noise) in spd::matrix(1..6usize),
        h in proptest::collection::vec(0.1..1.0f64, 36),
        innovation in proptest::collection::vec(-3.0..3.0f64, 6),
    ) {
        let mean = vec![1.0; n];
        let problem = Problem { mean: &mean, p: &p, h: &h[..m * n], innovation: &innovation[..m], noise: &noise };
        let first = problem.solve(Form::Sequential);
        let gauge = first.outcome.unwrap();
        for form in FORMS {
            let other = problem.solve(form);
            let found = other.outcome.unwrap();
            prop_assert_eq!(found.rows, m);
            let nis = found.normalized_innovation_squared / gauge.normalized_innovation_squared;
            prop_assert!((nis - 1.0).abs() < 1e-6);
            prop_assert!((found.log_determinant - gauge.log_determinant).abs() < 1e-8);
            for i in 0..n {
                let sigma = p[i * (n + 1)].sqrt();
                prop_assert!((other.mean[i] - first.mean[i]).abs() < 1e-7 * sigma);
                for j in 0..n {
                    prop_assert_eq!(other.p[i * n + j], other.p[j * n + i]);
                    let scale = sigma * p[j * (n + 1)].sqrt();
                    prop_assert!((other.p[i * n + j] - first.p[i * n + j]).abs() < 1e-9 * scale);
                }
            }
        }
    }

    /// Independent rows through a stage, whatever the form, equal correlated rows with a diagonal noise.
    #[test]
    fn independent_rows_equal_a_diagonal_noise(
        (n, p) in spd::matrix(2..7usize),
        h in proptest::collection::vec(0.1..1.0f64, 63),
        innovation in proptest::collection::vec(-3.0..3.0f64, 9),
        m in 1..10usize,
    ) {
        let variances: Vec<f64> = (0..m).map(|i| 0.5 + i as f64).collect();
        let noise: Vec<f64> = (0..m * m).map(|k| if k % (m + 1) == 0 { variances[k / m] } else { 0.0 }).collect();
        let mean = vec![0.0; n];
        let problem = Problem { mean: &mean, p: &p, h: &h[..m * n], innovation: &innovation[..m], noise: &noise };
        for form in FORMS {
            let expected = problem.solve(form);
            let (mut correction, mut q) = (vec![0.0; n], p.clone());
            let (mut rows, mut vectors) = (vec![0.0; n], vec![0.0; VECTORS * n]);
            let work = Work {
                rows: MatMut::new(&mut rows, 1, n, n).unwrap(),
                vectors: MatMut::new(&mut vectors, VECTORS, n, n).unwrap(),
            };
            let mut stage = Stage::begin(form, &mut correction, MatMut::square(&mut q, n).unwrap(), work).unwrap();
            let h = Mat::new(&h, m, n, n).unwrap();
            stage.independent(&h, 0..m, |i| innovation[i], |i| variances[i]).unwrap();
            let gauge = stage.finish().unwrap();
            let wanted = expected.outcome.unwrap();
            prop_assert!((gauge.log_determinant - wanted.log_determinant).abs() < 1e-9);
            for i in 0..n {
                prop_assert!((correction[i] - expected.mean[i]).abs() < 1e-7 * p[i * (n + 1)].sqrt());
                for j in 0..=i {
                    let scale = (p[i * (n + 1)] * p[j * (n + 1)]).sqrt();
                    prop_assert!((q[i * n + j] - expected.p[i * n + j]).abs() < 1e-9 * scale);
                }
            }
        }
    }
}

/// 10 km against 1 mm, as in [`crate::linalg::square_root`]: what each form keeps of hᵀ P h = r/2.
#[test]
fn a_wide_prior_tells_the_forms_apart() {
    let h = [1.0, 0.1, 1.0, 0.1, 0.1, 1.0];
    let noise = [1e-6, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-6];
    let problem =
        Problem { mean: &[0.0; 2], p: &[1e8, 0.9e8, 0.9e8, 1e8], h: &h, innovation: &[0.0; 3], noise: &noise };
    let error = |form| {
        let p = problem.solve(form).p;
        let exact = 0.5e-6;
        (p[0] + 0.2 * p[1] + 0.01 * p[3]) / exact - 1.0
    };
    assert!(error(Form::Array).abs() < 1e-8, "{}", error(Form::Array));
    assert!(error(Form::Joseph).abs() < 1e-3, "{}", error(Form::Joseph));
}

#[test]
fn refused_updates_change_nothing() {
    let good =
        Problem { mean: &[1.0, 2.0], p: &[2.0, 1.0, 1.0, 2.0], h: &[1.0, 0.5], innovation: &[0.3], noise: &[1.0] };
    let asymmetric = [2.0, 1.0, 0.5, 2.0];
    let indefinite = [1.0, 2.0, 2.0, 1.0];
    let nan = [2.0, f64::NAN, f64::NAN, 2.0];
    let cases = [
        (Problem { p: &asymmetric, ..good }, UpdateError::Covariance(Defect::Asymmetric { row: 1 })),
        (Problem { p: &indefinite, ..good }, UpdateError::NotPositiveDefinite { state: 1 }),
        (Problem { p: &nan, ..good }, UpdateError::Covariance(Defect::NotFinite { row: 0 })),
        (Problem { h: &[0.0, 0.0], ..good }, UpdateError::EmptyRow { row: 0 }),
        (Problem { h: &[f64::NAN, 0.0], ..good }, UpdateError::NotFinite),
        (Problem { innovation: &[f64::NAN], ..good }, UpdateError::NotFinite),
        (Problem { mean: &[f64::NAN, 2.0], ..good }, UpdateError::NotFinite),
        (Problem { noise: &[f64::NAN], ..good }, UpdateError::Noise(Defect::NotFinite { row: 0 })),
        (Problem { noise: &[-9.0], ..good }, UpdateError::IndefiniteNoise { row: 0 }),
        (Problem { h: &[], innovation: &[], noise: &[], ..good }, UpdateError::NoRows),
    ];
    for (problem, error) in cases {
        for form in FORMS {
            let after = problem.solve(form);
            assert_eq!(after.outcome, Err(error), "{form:?}");
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert_eq!((bits(&after.mean), bits(&after.p)), (bits(problem.mean), bits(problem.p)));
        }
    }
    let mut p = [1.0];
    let shape = update(
        Form::Joseph,
        &mut [0.0],
        &mut MatMut::square(&mut p, 1).unwrap(),
        &Mat::square(&[1.0], 1).unwrap(),
        &mut [1.0],
        &mut MatMut::square(&mut [1.0], 1).unwrap(),
        &mut [0.0; 6],
    );
    assert_eq!(shape, Err(UpdateError::Shape));
}
