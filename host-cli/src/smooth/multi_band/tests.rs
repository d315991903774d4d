//! The model against its dense form: the paper's rows, with R and C written out.

use super::*;
use crate::study::smoothing::geometry::Geometry;
use nalgebra::{DMatrix, DVector, Vector3};
use surefix_core::filter::linearize::Rule;
use surefix_core::model::multi_band::{Bands, Satellite};

fn settings(base: Option<Vector3<f64>>) -> Settings {
    Settings::recommended(Bands::new([1575.42e6, 1227.6e6, 1176e6]).unwrap(), base)
}

fn base() -> Option<Vector3<f64>> {
    Some(Geometry::g2().base)
}

/// Some number of the size of 1.
fn number(i: usize) -> f64 {
    (1.7 * i as f64 + 0.3).sin()
}

fn satellites(k: usize) -> Vec<Satellite> {
    let mut satellites = Geometry::g2().satellites(5.0 * k as f64);
    satellites.truncate(5);
    satellites
}

/// Measurements near x = 0, in the paper's order.
fn measurements(settings: &Settings, k: usize) -> Vec<f64> {
    let satellites = satellites(k);
    let model = settings.model(&satellites);
    let mut values = vec![0.0; model.outputs()];
    model.evaluate(&[0.0; 4], &mut values);
    (0..model.rows()).map(|row| model.nonlinear_part(row, &values) + 0.1 * number(row + k)).collect()
}

fn model(settings: Settings) -> MultiBand {
    let record = |k| Record::from_rows(&settings, satellites(k), &measurements(&settings, k)).unwrap();
    let records = (0..3).map(record).collect();
    MultiBand::new(settings, records).unwrap()
}

/// A density of n states with correlations, of variances near `variance`.
fn density(n: usize, variance: f64) -> Density {
    let a = DMatrix::from_fn(n, n, |i, j| 0.1 * number(i * n + j)) + DMatrix::identity(n, n);
    let p = &a * a.transpose() * variance;
    Density { mean: (0..n).map(|i| 0.2 * number(7 * i)).collect(), covariance: p.as_slice().to_vec() }
}

/// C without the columns of fixed ambiguities, y without their part, R, and where ∂g/∂z is to be added.
struct Dense {
    y: DVector<f64>,
    h: DMatrix<f64>,
    r: DMatrix<f64>,
    g: DVector<f64>,
}

fn dense(settings: &Settings, k: usize, fixed: &[(usize, f64)], z: &[f64]) -> Dense {
    let satellites = satellites(k);
    let model = settings.model(&satellites);
    let (rows, states) = (model.rows(), model.layout().states());
    let mut c = DMatrix::zeros(rows, states);
    for row in 0..rows {
        model.row(row, &mut |state, value| c[(row, state)] += value);
    }
    let mut y = DVector::from_vec(measurements(settings, k));
    let mut gone = vec![];
    for &(i, value) in fixed {
        let state = model.layout().ambiguities().start + i;
        y -= c.column(state) * value;
        gone.push(state);
    }
    let mut values = vec![0.0; model.outputs()];
    model.evaluate(z, &mut values);
    let mut slopes = vec![0.0; 4 * model.outputs()];
    slopes.chunks_mut(4).enumerate().for_each(|(row, slope)| model.gradient(z, row, slope));
    let g = DVector::from_fn(rows, |row, _| model.nonlinear_part(row, &values));
    let mut h = c;
    for input in 0..4 {
        let column: Vec<f64> = slopes.iter().skip(input).step_by(4).copied().collect();
        (0..rows).for_each(|row| h[(row, input)] += model.nonlinear_part(row, &column));
    }
    let r = DMatrix::from_fn(rows, rows, |i, j| model.noise(i, j));
    Dense { y, h: h.remove_columns_at(&gone), r, g }
}

/// All integers of these numbers of an epoch.
fn fix(model: &mut MultiBand, k: usize, fixed: &[(usize, f64)]) {
    let mut integers = vec![];
    model.integers(k, &mut integers);
    let (which, values): (Vec<Integer>, Vec<f64>) = fixed.iter().map(|&(i, value)| (integers[i], value)).unzip();
    assert_eq!(model.fix(k, &which, &values), 0);
    model.settle();
}

/// No ambiguity, some, and all twelve.
fn fixes() -> [Vec<(usize, f64)>; 3] {
    [vec![], vec![(1, 3.0), (6, -2.0)], (0..12).map(|i| (i, i as f64 - 5.0)).collect()]
}

#[test]
fn the_update_equals_that_with_the_papers_rows() {
    for (base, rule) in [(None, Rule::Taylor), (base(), Rule::Taylor), (base(), Rule::Cubature)] {
        for fixed in fixes() {
            let settings = Settings { rule, ..settings(base) };
            let mut model = model(settings.clone());
            fix(&mut model, 1, &fixed);
            let prior = density(model.states(1), 1.0);
            let n = prior.dim();
            let mut updated = prior.clone();
            let gauge = model.update(1, &mut updated, &mut Scratch::default()).unwrap();

            let Dense { y, h, r, g } = dense(&settings, 1, &fixed, &prior.mean[..4]);
            let m = DVector::from_column_slice(&prior.mean);
            let p = DMatrix::from_row_slice(n, n, &prior.covariance);
            // h holds ∂g/∂z too: the prediction takes z out of it again.
            let mut z_only = m.clone();
            z_only.rows_mut(4, n - 4).fill(0.0);
            let innovation = y - g - &h * (&m - z_only);
            let s = &h * &p * h.transpose() + &r;
            let inverse = s.clone().cholesky().unwrap();
            // The information form: nothing cancels.
            let weighted = h.transpose() * r.cholesky().unwrap().inverse();
            let covariance = (p.cholesky().unwrap().inverse() + &weighted * &h).cholesky().unwrap().inverse();
            let mean = &m + &covariance * weighted * &innovation;
            for i in 0..n {
                let sigma = covariance[(i, i)].sqrt();
                assert!((updated.mean[i] - mean[i]).abs() < 1e-6 * sigma, "{base:?} {rule:?} {i}");
                for j in 0..=i {
                    let scale = sigma * covariance[(j, j)].sqrt();
                    let deviation = (updated.covariance(i, j) - covariance[(i, j)]).abs() / scale;
                    assert!(deviation < 1e-7, "{base:?} {rule:?} {i} {j} {deviation}");
                }
            }
            assert_eq!(gauge.rows, s.nrows());
            let squared = innovation.dot(&inverse.solve(&innovation));
            assert!((gauge.normalized_innovation_squared / squared - 1.0).abs() < 1e-7);
            let log_determinant = 2.0 * inverse.l().diagonal().map(f64::ln).sum();
            assert!((gauge.log_determinant - log_determinant).abs() < 1e-7);
        }
    }
}

/// A prior of 100 km: Ω counts, and the update with all rows at once must agree with Ω in each of them.
#[test]
fn a_curved_range_ties_the_rows_together() {
    let settings = Settings { rule: Rule::Cubature, ..settings(base()) };
    let model = model(settings.clone());
    let mut prior = density(model.states(1), 1.0);
    let n = prior.dim();
    for i in 0..3 {
        for j in 0..n {
            prior.covariance[i * n + j] *= 1e5;
            prior.covariance[j * n + i] *= 1e5;
        }
    }
    let mut updated = prior.clone();
    model.update(1, &mut updated, &mut Scratch::default()).unwrap();
    let mut taylor = prior.clone();
    let plain = MultiBand::new(Settings { rule: Rule::Taylor, ..settings }, model.records.clone()).unwrap();
    plain.update(1, &mut taylor, &mut Scratch::default()).unwrap();
    for i in 0..3 {
        // Curvature of σ²/(2ρ), hundreds of metres, is not explained by a centimetre of noise.
        assert!(updated.covariance(i, i) > 100.0 * taylor.covariance(i, i), "{i}");
    }
}

/// E[eᵀ R_c⁻¹ e] by signal with the paper's rows and dense traces.
#[test]
fn residuals_equal_the_dense_traces() {
    for base in [None, base()] {
        for fixed in fixes() {
            let settings = settings(base);
            let mut model = model(settings.clone());
            fix(&mut model, 1, &fixed);
            let smoothed = density(model.states(1), 1e-4);
            let n = smoothed.dim();
            let mut sums = Sums::new(model.parameters().len());
            model.residuals(1, &smoothed, &mut Scratch::default(), &mut sums);

            let Dense { y, h, r, g } = dense(&settings, 1, &fixed, &smoothed.mean[..4]);
            let m = DVector::from_column_slice(&smoothed.mean);
            let p = DMatrix::from_row_slice(n, n, &smoothed.covariance);
            let mut z_only = m.clone();
            z_only.rows_mut(4, n - 4).fill(0.0);
            let e = y - g - &h * (&m - z_only);
            let second = &e * e.transpose() + &h * p * h.transpose();
            let (differences, satellites) = (4, 5);
            let first = model.noise_parameter();
            for parameter in first..sums.count.len() {
                let kind = parameter - first;
                let rows: Vec<usize> = if kind < 3 {
                    let group = |band: usize| (3 * band + kind) * differences;
                    (0..3).flat_map(|band| group(band)..group(band) + differences).collect()
                } else {
                    let start = 9 * differences + (kind - 3) * satellites;
                    (start..start + satellites).collect()
                };
                let block = |of: &DMatrix<f64>| DMatrix::from_fn(rows.len(), rows.len(), |i, j| of[(rows[i], rows[j])]);
                let shape = block(&r) / model.parameters()[parameter].variance;
                let expected = (shape.clone().try_inverse().unwrap() * block(&second)).trace();
                assert!((sums.quadratic[parameter] / expected - 1.0).abs() < 1e-7, "{base:?} {parameter}");
                assert_eq!(sums.count[parameter], rows.len() as f64);
                let expected = shape.determinant().ln();
                assert!((sums.log_determinant[parameter] - expected).abs() < 1e-7, "{parameter}");
            }
        }
    }
}

#[test]
fn slips_are_flagged_where_they_are_and_start_an_arc() {
    let mut model = model(settings(base()));
    let slipped = model.layout().ambiguity(1, 2) - 4;
    let mut predicted = density(model.states(1), 1e-4);
    predicted.mean.fill(0.0);
    // Phases are up to 0.1 m from what is predicted, less than half a cycle but for rounding in L1.
    predicted.mean[4 + slipped] = 3.0;
    let mut scratch = Scratch::default();
    assert!(model.detect(1, &predicted, &mut scratch));
    assert!(model.flags()[0][slipped]);
    assert!(!model.detect(1, &predicted, &mut scratch), "nothing new");
    assert!(!model.detect(0, &predicted, &mut scratch), "no step leads to epoch 0");
    let arc = |model: &MultiBand, k: usize| {
        let mut integers = vec![];
        model.integers(k, &mut integers);
        integers[slipped].arc
    };
    assert_ne!(arc(&model, 0), arc(&model, 1));
    let mut transition = Transition::default();
    model.transition(0, &mut transition);
    let variance = |state: usize| transition.noise.iter().find(|block| block.states[0] == state).unwrap().scale;
    assert_eq!(variance(4 + slipped), 100.0);
    model.forget_detections();
    assert_eq!(arc(&model, 0), arc(&model, 1));
}

#[test]
fn fixed_integers_leave_the_states_and_hand_on_their_value() {
    let mut model = model(settings(None));
    let all = model.states(0);
    fix(&mut model, 1, &fixes()[2]);
    assert_eq!((model.states(0), model.states(1)), (all, all - 12));
    let mut transition = Transition::default();
    model.transition(1, &mut transition);
    let step = transition.step();
    assert_eq!((step.map.rows(), step.map.columns), (all, all - 12));
    // Ambiguity 9 is born of its fixed value 4.
    assert!(step.map.row(4 + 9).is_empty() && step.offset[4 + 9] == 4.0);
    model.transition(0, &mut transition);
    assert_eq!((transition.step().map.rows(), transition.step().map.columns), (all - 12, all));
    let mut integers = vec![];
    model.integers(0, &mut integers);
    model.fix(0, &integers[..1], &[2.0]);
    assert_eq!(model.fix(0, &integers[..1], &[3.0]), 1, "contradicts");
    model.release();
    assert_eq!(model.states(1), all);
}

#[test]
fn variances_reach_motion_and_noise() {
    let mut model = model(settings(base()));
    let variances: Vec<f64> = (1..=10).map(f64::from).collect();
    model.set_variances(&variances);
    assert_eq!(model.settings().motion.variances[..5], [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!((model.settings().variances.code, model.settings().variances.troposphere), (6.0, 10.0));
    assert!(model.parameters().iter().zip(&variances).all(|(p, &v)| p.variance == v));
}

#[test]
fn the_first_epoch_may_be_left_to_the_fixed_pass() {
    let settings = Settings { first_epoch: false, ..settings(base()) };
    let mut model = model(settings);
    let mut prior = Density::default();
    model.prior(&mut prior);
    assert_eq!(prior.covariance(4, 4), 1e4);
    let mut updated = prior.clone();
    assert_eq!(model.update(0, &mut updated, &mut Scratch::default()).unwrap(), Gauge::default());
    assert_eq!(updated, prior);
    fix(&mut model, 0, &fixes()[2]);
    model.prior(&mut prior);
    assert!(model.update(0, &mut prior, &mut Scratch::default()).unwrap().rows > 0);
}

#[test]
fn records_that_differ_are_refused_by_their_epoch() {
    let settings = settings(base());
    let mut records = model(settings.clone()).records;
    records[2].virtual_rows.pop();
    assert_eq!(MultiBand::new(settings.clone(), records).unwrap_err(), MultiBandError::Epoch { epoch: 2 });
    assert_eq!(MultiBand::new(settings.clone(), vec![]).unwrap_err(), MultiBandError::Empty);
    assert_eq!(Record::from_rows(&settings, satellites(0), &[1.0]), None);
}
