//! How well a model predicts measurements that it has not seen: the plainest test of noise that was learned too well.

use super::learn;
use super::model::PppModel;
use super::noise::Measurements;
use super::tape::Tape;
use super::{Options, PppError};
use crate::smooth::pass::{PassOptions, Passes};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What was predicted, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut {
    /// Number of measurements held out.
    pub count: usize,
    /// Mean of −2 ln of their predicted density, without the constant ln 2π: lower is better.
    pub likelihood: f64,
    /// Mean of their squared errors over the predicted variances: 1 if the noise is right.
    pub consistency: f64,
}

/// Learns without a random share of the measurements and predicts these, each from the smoothed density of its epoch.
///
/// A measurement that was held out has the variance of its pool; with Student-t errors its density is a Student-t one.
/// Where each measurement has a variance of its own, it is that of the nearest measurement of the same satellite, signal
/// and kind.
pub fn held_out(tape: &Tape, options: &Options, share: f64, seed: u64) -> Result<HeldOut, PppError> {
    tape.check()?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let active: Vec<bool> = tape.rows.iter().map(|_| !rng.random_bool(share.clamp(0.0, 1.0))).collect();
    let mut model = PppModel::without(tape.clone(), options.clone(), active);
    let mut passes = Passes::new(PassOptions { budget: options.budget, ..PassOptions::default() });
    learn::learn(&mut model, &mut passes)?;
    passes.forward(&model)?;
    let (mut count, mut total, mut squares) = (0, 0.0, 0.0);
    let near = nearest(&model);
    passes.backward(&model, |epoch| {
        for i in model.tape().epochs[epoch.k].rows.clone().filter(|&i| !model.active()[i]) {
            let line = model.line(epoch.k, i);
            let (error, spread) = (line.residual(&epoch.smoothed.mean), line.spread(epoch.smoothed));
            let measurements = model.options().measurements;
            let r = match measurements {
                Measurements::Pooled(_) | Measurements::StudentT(_) => model.noise.scale(i),
                _ => near[i].map_or(model.noise.row(i), |other| model.noise.row(other)),
            };
            let s = r + spread;
            squares += error * error / s;
            total += density(measurements, error, s);
            count += 1;
        }
    })?;
    let mean = |sum: f64| sum / f64::from(count).max(1.0);
    Ok(HeldOut { count: count as usize, likelihood: mean(total), consistency: mean(squares) })
}

/// −2 ln of the density of an error of variance (or squared scale) s, without ln 2π.
pub fn density(measurements: Measurements, error: f64, s: f64) -> f64 {
    match measurements {
        Measurements::StudentT(nu) => {
            let constant = libm::lgamma(0.5 * nu) - libm::lgamma(0.5 * (nu + 1.0)) + 0.5 * (0.5 * nu).ln();
            2.0 * constant + s.ln() + (nu + 1.0) * (error * error / (nu * s)).ln_1p()
        }
        _ => s.ln() + error * error / s,
    }
}

/// Of each row that is not used, the nearest one that is, of the same satellite, signal and kind.
fn nearest(model: &PppModel) -> Vec<Option<usize>> {
    let (tape, active) = (model.tape(), model.active());
    let mut near = vec![None; tape.rows.len()];
    let mut walk = |epochs: &mut dyn Iterator<Item = usize>| {
        let mut last = std::collections::HashMap::new();
        for k in epochs {
            for i in tape.epochs[k].rows.clone() {
                let row = &tape.rows[i];
                let key = (row.satellite.constellation().index(), row.satellite.number(), row.group, row.kind);
                if active[i] {
                    last.insert(key, (k, i));
                } else if let Some(&(other, at)) = last.get(&key) {
                    let distance = k.abs_diff(other);
                    if near[i].is_none_or(|(least, _)| distance < least) {
                        near[i] = Some((distance, at));
                    }
                }
            }
        }
    };
    walk(&mut (0..tape.epochs.len()));
    walk(&mut (0..tape.epochs.len()).rev());
    near.into_iter().map(|near| near.map(|(_, at)| at)).collect()
}
