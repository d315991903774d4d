//! What learning found out, in plain units.

use super::learn::{Learned, Scan, Status, Step};
use super::model::PppModel;
use super::noise::Noise;
use super::{Class, answer};
use serde::Serialize;

/// The variance of a pool of measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoolReport {
    /// What it is of.
    pub name: String,
    /// Number of measurements that it was learned from.
    pub count: usize,
    /// Standard deviation at the start `[m]`.
    pub start: f64,
    /// In the end; of Student-t distributed errors their scale, of schemes without pools the root mean square of the
    /// rows.
    pub end: f64,
    /// Mean of the squared innovations of its rows over their predicted variances: 1 if model and noise are right.
    pub consistency: Option<f64>,
}

/// The walk of a class of states.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WalkReport {
    /// Which.
    pub name: &'static str,
    /// By axis (of the motion), then by step where there is one for each: root of variance `[m/√s]` or `[m/s^1.5]`.
    pub sigmas: Vec<Vec<f64>>,
}

/// What was found out.
#[derive(Clone, Debug)]
pub struct Report {
    /// ℓ in each iteration, falling for schemes of maximum likelihood.
    pub history: Vec<Step>,
    /// How EM ended.
    pub status: Status,
    /// The look at walks of the position.
    pub scan: Option<Scan>,
    /// Forward and backward passes of EM.
    pub passes: [usize; 2],
    /// Variances of measurements.
    pub pools: Vec<PoolReport>,
    /// Variances of process noise.
    pub walks: Vec<WalkReport>,
    /// Number of measurements.
    pub observations: usize,
    /// What has to be said of the answer.
    pub warning: Option<&'static str>,
    /// By how much R of codes and phases was enlarged for errors that last.
    pub correlation: [f64; 2],
    /// Where filtered densities were kept.
    pub memory: &'static str,
}

impl Report {
    /// After the last passes over a model.
    pub fn new(model: &PppModel, start: &Noise, learned: Learned, memory: &'static str) -> Self {
        let noise = &model.noise;
        let innovations = model.innovations();
        let pools = noise.pools();
        let used = |i: usize, value: f64| if model.active()[i] { value } else { f64::NAN };
        let consistency = pools.means(|i| innovations[i], |_| f64::NAN);
        let rows = pools.means(|i| used(i, noise.row(i)), |_| f64::NAN);
        let at_start = pools.means(|i| used(i, start.row(i)), |_| f64::NAN);
        let pooled = model.options().measurements.is_pooled();
        let pool = |(i, pool): (usize, &super::pools::Pool)| PoolReport {
            name: pool.name.clone(),
            count: pool.count,
            start: at_start[i].sqrt(),
            end: if pooled { noise.pool_variance(i) } else { rows[i] }.sqrt(),
            // Of single measurements, without what errors that last add to their variances.
            consistency: (!consistency[i].is_nan()).then_some(consistency[i] * noise.correlation()[pool.kind as usize]),
        };
        let walk = |class: Class| WalkReport { name: class.name(), sigmas: answer::walks(model, class) };
        let Learned { history, status, scan, passes } = learned;
        Self {
            history,
            status,
            scan,
            passes,
            pools: pools.list().iter().enumerate().map(pool).collect(),
            walks: Class::ALL.into_iter().map(walk).collect(),
            observations: model.observations(),
            warning: model.options().measurements.warning(),
            correlation: noise.correlation(),
            memory,
        }
    }
}
