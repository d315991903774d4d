//! The passes against an independent implementation of the Kalman filter and the Rauch–Tung–Striebel smoother, the crate
//! `adskalman` 0.18, on linear models that do not change with time.

use adskalman::{KalmanFilterNoControl, ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Matrix4x2, U2, U4, Vector2, Vector4};
use surefix::smooth::dense::{Dense, Measurement, System};
use surefix::smooth::model::{Density, Transition};
use surefix::smooth::pass::{PassOptions, Passes};

struct Motion {
    f: Matrix4<f64>,
    transposed: Matrix4<f64>,
    q: Matrix4<f64>,
}

impl TransitionModelLinearNoControl<f64, U4> for Motion {
    fn F(&self) -> &Matrix4<f64> {
        &self.f
    }

    fn FT(&self) -> &Matrix4<f64> {
        &self.transposed
    }

    fn Q(&self) -> &Matrix4<f64> {
        &self.q
    }
}

struct Sensor {
    h: Matrix2x4<f64>,
    transposed: Matrix4x2<f64>,
    r: Matrix2<f64>,
}

impl ObservationModel<f64, U4, U2> for Sensor {
    fn H(&self) -> &Matrix2x4<f64> {
        &self.h
    }

    fn HT(&self) -> &Matrix4x2<f64> {
        &self.transposed
    }

    fn R(&self) -> &Matrix2<f64> {
        &self.r
    }
}

/// Some number in −1 … 1 for each (seed, i, j).
fn number(seed: usize, i: usize, j: usize) -> f64 {
    (12.9898 * (i + 1) as f64 + 78.233 * (j + 1) as f64 + 37.719 * (seed + 1) as f64).sin()
}

/// The same system for the passes. The peer's first estimate is one step before the first measurement.
fn system(motion: &Motion, sensor: &Sensor, start: &StateAndCovariance<f64, U4>, y: &[Vector2<f64>]) -> Dense {
    let by_rows = |matrix: &Matrix4<f64>| matrix.transpose().as_slice().to_vec();
    let mut step = Transition::default();
    step.reset(4);
    for row in motion.f.row_iter() {
        step.push(0.0, &row.iter().copied().enumerate().collect::<Vec<_>>());
    }
    step.dense_noise(&by_rows(&motion.q));
    let covariance = motion.f * start.covariance() * motion.transposed + motion.q;
    let prior = Density { mean: (motion.f * start.state()).as_slice().to_vec(), covariance: by_rows(&covariance) };
    let measurement = |y: &Vector2<f64>| Measurement {
        values: y.as_slice().to_vec(),
        rows: sensor.h.transpose().as_slice().to_vec(),
        noise: sensor.r.as_slice().to_vec(),
        parameter: None,
    };
    let measurements: Vec<Measurement> = y.iter().map(measurement).collect();
    let system = System { prior, steps: vec![step; y.len() - 1], measurements, integers: Vec::new() };
    Dense::new(system, Vec::new())
}

#[test]
fn filter_and_smoother_agree_with_adskalman() {
    for seed in 0..20 {
        let f = Matrix4::from_fn(|i, j| f64::from(u8::from(i == j)) * 0.8 + 0.2 * number(seed, i, j));
        let root = Matrix4::from_fn(|i, j| number(seed, i + 10, j));
        let (q, p) = (root * root.transpose() + Matrix4::identity() * 0.1, Matrix4::identity() * 9.0);
        let h = Matrix2x4::from_fn(|i, j| number(seed, i + 20, j));
        let r = Matrix2::new(0.5, 0.2, 0.2, 0.4);
        let motion = Motion { f, transposed: f.transpose(), q };
        let sensor = Sensor { h, transposed: h.transpose(), r };
        let start = StateAndCovariance::new(Vector4::from_fn(|i, _| number(seed, i, 30)), p);
        let y: Vec<Vector2<f64>> = (0..60).map(|k| Vector2::from_fn(|i, _| 3.0 * number(seed, i, 40 + k))).collect();

        let peer = KalmanFilterNoControl::new(&motion, &sensor);
        let filtered = peer.filter(&start, &y).unwrap();
        let smoothed = peer.smooth(&start, &y).unwrap();
        let model = system(&motion, &sensor, &start, &y);
        let mut passes = Passes::new(PassOptions::default());
        passes.forward(&model).unwrap();
        let mut seen = 0;
        passes
            .backward(&model, |epoch| {
                for (ours, peer) in [(epoch.filtered, &filtered[epoch.k]), (epoch.smoothed, &smoothed[epoch.k])] {
                    for i in 0..4 {
                        let sigma = peer.covariance()[(i, i)].sqrt();
                        assert!((ours.mean[i] - peer.state()[i]).abs() < 1e-9 * (sigma + peer.state()[i].abs()));
                        for j in 0..4 {
                            let scale = sigma * peer.covariance()[(j, j)].sqrt();
                            assert!((ours.covariance(i, j) - peer.covariance()[(i, j)]).abs() < 1e-9 * scale);
                        }
                    }
                }
                seen += 1;
            })
            .unwrap();
        assert_eq!(seen, y.len());
    }
}
