//! Random linear systems, and their smoothed densities by dense batch least squares: what the passes are tested against.
//!
//! All that is random in x_0 … x_K is w = (x_0 − m_0, q_0, …, q_{K−1}), of covariance W = diag(P_0, Q_0, …). With
//! x = X w + c and y = Y w + d + e: S = Y W Yᵀ + R, and w given y is N(W Yᵀ S⁻¹ (y − d), W − W Yᵀ S⁻¹ Y W).

use super::dense::{Dense, Measurement, System};
use super::model::{Density, Integer, Model, Parameter, Transition};
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// θ of random systems: two of Q, one of R.
fn parameters(rng: &mut ChaCha8Rng) -> Vec<Parameter> {
    let parameter = |name: &str, variance| {
        let name = name.to_owned();
        Parameter { name, unit: "m", variance, bounds: [1e-8, 1e8], learned: true }
    };
    ["walk", "drift", "measurements"].map(|name| parameter(name, 10f64.powf(rng.random_range(-1.0..1.0)))).into()
}

/// A system whose states move, are born, die and are re-defined as differences, with measurements drawn from it.
pub(super) fn random(seed: u64, epochs: usize) -> Dense {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let parameters = parameters(&mut rng);
    let n = rng.random_range(2..5);
    let mut prior = Density::default();
    prior.reset(n);
    let root = DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
    let covariance = &root * root.transpose() + DMatrix::identity(n, n) * 0.5;
    (0..n).for_each(|i| prior.mean[i] = rng.random_range(-2.0..2.0));
    prior.covariance.copy_from_slice(covariance.as_slice());

    let mut truth: Vec<f64> =
        (&root * DVector::from_fn(n, |_, _| rng.sample::<f64, _>(StandardNormal))).as_slice().into();
    let mut system = System { prior, ..System::default() };
    for k in 0..epochs {
        if k > 0 {
            let transition = random_step(truth.len(), &mut rng);
            truth = drive(&transition, &truth, &parameters, &mut rng);
            system.steps.push(transition);
        }
        let (m, n) = (rng.random_range(0..4), truth.len());
        let rows: Vec<f64> = (0..m * n).map(|_| rng.random_range(-1.0..1.0)).collect();
        let root = DMatrix::from_fn(m, m, |i, j| if i == j { 1.0 } else { rng.random_range(-0.3..0.3) });
        let sigma = parameters[2].variance.sqrt();
        let noise = &root * DVector::from_fn(m, |_, _| sigma * rng.sample::<f64, _>(StandardNormal));
        let values = (0..m).map(|i| (0..n).map(|j| rows[i * n + j] * truth[j]).sum::<f64>() + noise[i]).collect();
        let noise = (&root * root.transpose()).as_slice().to_vec();
        system.measurements.push(Measurement { values, rows, noise, parameter: Some(2) });
    }
    Dense::new(system, parameters)
}

fn random_step(n: usize, rng: &mut ChaCha8Rng) -> Transition {
    let mut transition = Transition::default();
    transition.reset(n);
    let mut kept: Vec<usize> = (0..n).collect();
    kept.shuffle(rng);
    if n > 2 && rng.random_bool(0.3) {
        kept.pop();
    }
    let reference = if rng.random_bool(0.2) { Some(kept[0]) } else { None };
    let mut moved = Vec::new();
    for &state in &kept {
        let entries: &[(usize, f64)] = match reference {
            Some(reference) if reference != state => &[(state, 1.0), (reference, -1.0)],
            _ => &[(state, 0.9)],
        };
        moved.push(transition.push(rng.random_range(-0.1..0.1), entries));
    }
    if n < 6 && rng.random_bool(0.4) {
        transition.birth(rng.random_range(-5.0..5.0), 10f64.powf(rng.random_range(0.0..2.0)));
    }
    // A pair that moves together, one by itself, the others without noise.
    if let [first, second, rest @ ..] = &moved[..] {
        transition.noise(&[*first, *second], &[&[1.0, 0.4], &[0.4, 0.7]], 1.0, Some(1));
        if let [third, ..] = rest {
            transition.noise(&[*third], &[&[0.8]], 1.0, Some(0));
        }
    }
    transition
}

/// A draw of x⁺.
fn drive(transition: &Transition, x: &[f64], parameters: &[Parameter], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let step = transition.step();
    let mut after: Vec<f64> = (0..step.map.rows())
        .map(|i| step.offset[i] + step.map.row(i).iter().map(|&(column, f)| f * x[column]).sum::<f64>())
        .collect();
    let q = noise(transition, parameters);
    let root = nalgebra::SymmetricEigen::new(q);
    let white = DVector::from_fn(after.len(), |i, _| {
        root.eigenvalues[i].max(0.0).sqrt() * rng.sample::<f64, _>(StandardNormal)
    });
    let q = &root.eigenvectors * white;
    after.iter_mut().zip(q.iter()).for_each(|(x, q)| *x += q);
    after
}

/// Q.
fn noise(transition: &Transition, parameters: &[Parameter]) -> DMatrix<f64> {
    let n = transition.states();
    let mut q = DMatrix::zeros(n, n);
    for block in &transition.noise {
        let scale = block.component.map_or(block.scale, |j| parameters[j].variance);
        for i in 0..block.dim {
            for j in 0..block.dim {
                q[(block.states[i], block.states[j])] += scale * block.shape[i][j];
            }
        }
    }
    q
}

/// Mean and covariance.
type Moments = (DVector<f64>, DMatrix<f64>);

/// The smoothed mean and covariance of every epoch, and −ln p(y).
pub(super) fn solve(model: &Dense) -> (Vec<Moments>, f64) {
    let (system, parameters) = (model.system(), model.parameters());
    let total = system.prior.dim() + system.steps.iter().map(Transition::states).sum::<usize>();
    let mut w = DMatrix::zeros(total, total);
    let n = system.prior.dim();
    let prior = DMatrix::from_fn(n, n, |i, j| system.prior.covariance(i, j));
    w.view_mut((0, 0), (n, n)).copy_from(&prior);
    let mut x = DMatrix::zeros(n, total);
    x.view_mut((0, 0), (n, n)).fill_with_identity();
    let mut states = vec![(x, DVector::from_column_slice(&system.prior.mean))];
    let mut start = n;
    for transition in &system.steps {
        let (x, c) = &states[states.len() - 1];
        let step = transition.step();
        let n = step.map.rows();
        w.view_mut((start, start), (n, n)).copy_from(&noise(transition, parameters));
        let mut f = DMatrix::zeros(n, x.nrows());
        for i in 0..n {
            step.map.row(i).iter().for_each(|&(column, coefficient)| f[(i, column)] += coefficient);
        }
        let mut next = &f * x;
        let mut own = next.view_mut((0, start), (n, n));
        own += DMatrix::identity(n, n);
        let mean = &f * c + DVector::from_column_slice(step.offset);
        states.push((next, mean));
        start += n;
    }
    let rows: usize = system.measurements.iter().map(|m| m.values.len()).sum();
    let (mut y, mut r, mut innovation) =
        (DMatrix::zeros(rows, total), DMatrix::zeros(rows, rows), DVector::zeros(rows));
    let mut start = 0;
    for (measurement, (x, c)) in system.measurements.iter().zip(&states) {
        let m = measurement.values.len();
        let h = DMatrix::from_row_slice(m, x.nrows(), &measurement.rows);
        y.view_mut((start, 0), (m, total)).copy_from(&(&h * x));
        let scale = measurement.parameter.map_or(1.0, |j| parameters[j].variance);
        r.view_mut((start, start), (m, m)).copy_from(&(DMatrix::from_row_slice(m, m, &measurement.noise) * scale));
        innovation.rows_mut(start, m).copy_from(&(DVector::from_column_slice(&measurement.values) - &h * c));
        start += m;
    }
    let wy = &w * y.transpose();
    let s = (&y * &wy + r).cholesky().expect("R is positive definite");
    let explained = s.solve(&innovation);
    let (mean, covariance) = (&wy * &explained, &w - &wy * s.solve(&wy.transpose()));
    let log_determinant = 2.0 * s.l().diagonal().iter().map(|l| l.ln()).sum::<f64>();
    let nll = 0.5 * (innovation.dot(&explained) + log_determinant + rows as f64 * super::pass::LN_2_PI);
    let smoothed = states.iter().map(|(x, c)| (x * &mean + c, x * &covariance * x.transpose()));
    (smoothed.collect(), nll)
}

/// A receiver on a line that walks, `arcs` integer ambiguities of `length` epochs each at a time, two bands; and the truth:
/// (model, integer of each arc). Each epoch has a code and two phases for each of `channels` satellites.
pub(super) fn ambiguous(seed: u64, epochs: usize, channels: usize, length: usize) -> (Dense, Vec<i64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [walk, code, phase, wavelength] = [0.3, 0.5, 0.005, 0.19];
    let n = 1 + channels;
    let mut prior = Density::default();
    prior.reset(n);
    (0..n).for_each(|i| prior.covariance[i * n + i] = if i == 0 { 100.0 } else { 900.0 });
    let mut system = System { prior, ..System::default() };
    let mut position = 0.0;
    let mut truth: Vec<i64> = Vec::new();
    // Channels change their arcs one after the other.
    let arc = |k: usize, channel: usize| (k + channel * length / channels) / length * channels + channel;
    for k in 0..epochs {
        if k > 0 {
            position += walk * rng.sample::<f64, _>(StandardNormal);
            let mut transition = Transition::default();
            transition.reset(n);
            transition.push(0.0, &[(0, 1.0)]);
            transition.noise(&[0], &[&[1.0]], walk * walk, Some(0));
            for channel in 0..channels {
                if arc(k, channel) == arc(k - 1, channel) {
                    transition.push(0.0, &[(1 + channel, 1.0)]);
                } else {
                    transition.birth(0.0, 900.0);
                }
            }
            system.steps.push(transition);
        }
        let arcs: Vec<usize> = (0..channels).map(|channel| arc(k, channel)).collect();
        let mut measurement = Measurement::default();
        let mut variances = Vec::new();
        for (channel, &arc) in arcs.iter().enumerate() {
            while truth.len() <= arc {
                truth.push(rng.random_range(-20..=20));
            }
            let slope = 1.0 - 1.7 * channel as f64 / channels as f64;
            for (sigma, ambiguity) in [(code, 0.0), (phase, wavelength)] {
                let mut row = vec![0.0; n];
                (row[0], row[1 + channel]) = (slope, ambiguity);
                let noise = sigma * rng.sample::<f64, _>(StandardNormal);
                measurement.values.push(slope * position + ambiguity * truth[arc] as f64 + noise);
                measurement.rows.extend(row);
                variances.push(sigma * sigma);
            }
        }
        measurement.noise = DMatrix::from_diagonal(&DVector::from_vec(variances)).as_slice().to_vec();
        system.measurements.push(measurement);
        system.integers.push(arcs.iter().enumerate().map(|(i, &arc)| Integer { state: 1 + i, arc }).collect());
    }
    let name = "walk".to_owned();
    let walk = Parameter { name, unit: "m", variance: walk * walk, bounds: [1e-8, 1e8], learned: true };
    (Dense::new(system, vec![walk]), truth)
}
