//! Against batch least squares over all epochs.

use super::super::tests::{Static, measure, measurement, model};
use super::*;
use nalgebra::{DMatrix, DVector};

const PRIOR: [f64; 9] = [4.0, 0.5, 0.0, 0.5, 3.0, 0.2, 0.0, 0.2, 5.0];

fn started() -> RecursiveMils<f64, 3, 3, 10> {
    let mut filter = RecursiveMils::new();
    filter.reset(&[0.1, 0.2, 0.3], Mat::square(&PRIOR, 3).unwrap()).unwrap();
    filter
}

fn epoch(k: u64) -> (Static, Vec<f64>) {
    let model = model(11 * k + 5);
    let y = measure(&model, &[0.3, -1.0, 2.0], &[7 - 3 * k as i64, 2, -90], k);
    (model, y)
}

fn close(density: (&[f64], Mat<'_, f64>), information: DMatrix<f64>, vector: DVector<f64>) {
    let covariance = information.try_inverse().unwrap();
    let mean = &covariance * vector;
    for i in 0..3 {
        assert!((density.0[i] - mean[i]).abs() < 1e-10, "{} {}", density.0[i], mean[i]);
        for j in 0..3 {
            assert!((density.1.get(i, j).unwrap() - covariance[(i, j)]).abs() < 1e-11 * covariance.amax().max(1.0));
        }
    }
}

/// The relaxed density is least squares with each epoch's ambiguities free; the constrained one with them fixed.
#[test]
fn both_densities_are_batch_least_squares() {
    let mut filter = started();
    let prior = DMatrix::from_row_slice(3, 3, &PRIOR).try_inverse().unwrap();
    let start = &prior * DVector::from_row_slice(&[0.1, 0.2, 0.3]);
    let (mut relaxed, mut constrained) = ((prior.clone(), start.clone()), (prior, start));
    for k in 0..8 {
        let (model, y) = epoch(k);
        filter.step(&measurement(&model, &y).view()).unwrap();
        let weight = model.r.clone().try_inverse().unwrap();
        let weighted = &weight * &model.g;
        let free =
            &weight - &weighted * (model.g.transpose() * &weighted).try_inverse().unwrap() * weighted.transpose();
        let y = DVector::from_vec(y);
        relaxed.0 += model.h.transpose() * &free * &model.h;
        relaxed.1 += model.h.transpose() * &free * &y;
        close(filter.relaxed(), relaxed.0.clone(), relaxed.1.clone());

        let integers = DVector::from_iterator(3, filter.integers().iter().map(|&n| n as f64));
        constrained.0 += model.h.transpose() * &weight * &model.h;
        constrained.1 += model.h.transpose() * &weight * (y - &model.g * integers);
        close(filter.constrained(), constrained.0.clone(), constrained.1.clone());
    }
}

/// Without a prior the first epoch is as with a prior that says nothing.
#[test]
fn starting_is_the_limit_of_a_wide_prior() {
    let (model, y) = epoch(1);
    let (mut free, mut wide) = (RecursiveMils::<f64, 3, 3, 10>::new(), RecursiveMils::<f64, 3, 3, 10>::new());
    free.start(&measurement(&model, &y).view()).unwrap();
    let prior = [1e6, 0.0, 0.0, 0.0, 1e6, 0.0, 0.0, 0.0, 1e6];
    wide.reset(&[0.0; 3], Mat::square(&prior, 3).unwrap()).unwrap();
    wide.step(&measurement(&model, &y).view()).unwrap();
    assert_eq!(free.integers(), wide.integers());
    for (a, b) in [(free.relaxed(), wide.relaxed()), (free.constrained(), wide.constrained())] {
        for i in 0..3 {
            assert!((a.0[i] - b.0[i]).abs() < 1e-6);
            assert!((a.1.get(i, i).unwrap() / b.1.get(i, i).unwrap() - 1.0).abs() < 1e-6);
        }
    }
    for (a, b) in free.float().0.iter().zip(wide.float().0) {
        assert!((a - b).abs() < 1e-5);
    }
}

#[test]
fn errors_change_nothing() {
    let mut filter = started();
    let (model, y) = epoch(2);
    filter.step(&measurement(&model, &y).view()).unwrap();
    let rows = |covariance: Mat<'_, f64>| (0..3).flat_map(|i| covariance.row(i).to_vec()).collect::<Vec<_>>();
    let snapshot = |filter: &RecursiveMils<f64, 3, 3, 10>| {
        let (relaxed, constrained) = (filter.relaxed(), filter.constrained());
        (
            [
                relaxed.0.to_vec(),
                rows(relaxed.1),
                constrained.0.to_vec(),
                rows(constrained.1),
                filter.float().0.to_vec(),
            ],
            filter.integers().to_vec(),
        )
    };
    let before = snapshot(&filter);
    let mut singular = model.clone();
    singular.g.set_column(1, &DVector::zeros(10));
    let mut indefinite = model.clone();
    indefinite.r *= -1.0;
    let mut nan = y.clone();
    nan[3] = f64::NAN;
    let mut far = y.clone();
    far[8] = 3e8;
    for start in [false, true] {
        let mut attempt = |model: &Static, y: &[f64]| {
            let owned = measurement(model, y);
            let outcome = if start { filter.start(&owned.view()) } else { filter.step(&owned.view()) };
            outcome.unwrap_err()
        };
        assert_eq!(attempt(&singular, &y), FilterError::Undetermined { index: 1 });
        assert!(matches!(attempt(&indefinite, &y), FilterError::NotPositiveDefinite { .. }));
        assert_eq!(attempt(&model, &nan), FilterError::NotFinite);
        assert!(matches!(attempt(&model, &far), FilterError::Ambiguity { .. }));
    }
    let asymmetric = [1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let error = filter.reset(&[0.0; 3], Mat::square(&asymmetric, 3).unwrap()).unwrap_err();
    assert!(matches!(error, FilterError::Covariance(_)));
    let indefinite = [1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let error = filter.reset(&[0.0; 3], Mat::square(&indefinite, 3).unwrap()).unwrap_err();
    assert_eq!(error, FilterError::NotPositiveDefinite { state: 1 });
    assert!(before == snapshot(&filter));
}
