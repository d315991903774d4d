//! From densities to solutions.

use super::model::PppModel;
use super::{Class, Motion};
use crate::smooth::model::Density;
use nalgebra::{Matrix3, Vector3};
use surefix_core::gnss::time::GpsTime;

/// An estimate with its variance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The mean `[m]`.
    pub value: f64,
    /// Its variance `[m²]`.
    pub variance: f64,
}

/// All that is known of an epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// When.
    pub time: GpsTime,
    /// Position, ECEF `[m]`.
    pub position: Vector3<f64>,
    /// Its covariance, ECEF `[m²]`.
    pub covariance: Matrix3<f64>,
    /// Velocity, ECEF `[m/s]`, and its covariance; none of a receiver whose position walks.
    pub velocity: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Receiver clock against the reference system.
    pub clock: Estimate,
    /// Inter-system biases.
    pub biases: Vec<Estimate>,
    /// Zenith wet delay, beyond what the engine modelled.
    pub zenith: Estimate,
    /// Gradients to the north and to the east, if they were estimated.
    pub gradients: Option<[Estimate; 2]>,
    /// Slant delay of each satellite visit.
    pub slants: Vec<(usize, Estimate)>,
    /// Ambiguity of each arc, by its index in the tape.
    pub ambiguities: Vec<(usize, Estimate)>,
}

/// The state of epoch k by a density.
pub fn state(model: &PppModel, k: usize, density: &Density) -> State {
    let estimate = |state: usize| Estimate { value: density.mean[state], variance: density.covariance(state, state) };
    let vector = |first: usize| Vector3::from_fn(|i, _| density.mean[first + i]);
    let covariance = |first: usize| Matrix3::from_fn(|i, j| density.covariance(first + i, first + j));
    let zenith = model.zenith();
    State {
        time: model.tape().epochs[k].time,
        position: model.tape().origin + vector(0),
        covariance: covariance(0),
        velocity: (model.options().motion == Motion::ConstantVelocity).then(|| (vector(3), covariance(3))),
        clock: estimate(model.clock()),
        biases: (model.bias()..zenith).map(estimate).collect(),
        zenith: estimate(zenith),
        gradients: model.options().gradients.then(|| [estimate(zenith + 1), estimate(zenith + 2)]),
        slants: model.slants(k).map(|(state, visit)| (visit, estimate(state))).collect(),
        ambiguities: model.ambiguities(k).map(|(state, arc)| (arc, estimate(state))).collect(),
    }
}

/// Root of the variance (spectral density) of a class in each step, of a scheme with one for each, or one number: by axis.
pub fn walks(model: &PppModel, class: Class) -> Vec<Vec<f64>> {
    let axes = if class == Class::Motion { 3 } else { 1 };
    (0..axes).map(|axis| model.noise.history(class, axis).map(f64::sqrt).collect()).collect()
}
