//! One run: simulated epochs through the mixed-integer filter, its densities against the truth.

use super::constellation::Constellation;
use super::scenario::{AMBIGUITIES, Epoch, REAL, Scenario, Simulation, Truth};
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;
use std::array::from_fn;
use surefix_core::filter::mixed_integer::{FilterError, Options, SectionV};
use surefix_core::linalg::Mat;
use surefix_core::model::partially_linear::{Elementary, Nonlinear, PartiallyLinear};
use surefix_core::model::virtual_bias::VirtualBiasModel;

/// A filter on a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    /// What happens.
    pub scenario: Scenario,
    /// How it is estimated.
    pub options: Options,
}

/// The position of one density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Estimate minus truth, east, north, up `[m]`.
    pub error: Vector3<f64>,
    /// Its covariance according to the filter `[m²]`.
    pub covariance: Matrix3<f64>,
}

/// An epoch after its update.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Time since the start `[s]`.
    pub time: f64,
    /// Relaxed density.
    pub relaxed: Position,
    /// Constrained density.
    pub constrained: Position,
    /// Real-valued ambiguities minus truth `[cycles]`.
    pub float_errors: [f64; AMBIGUITIES],
    /// Integers minus truth `[cycles]`.
    pub integer_errors: [i64; AMBIGUITIES],
    /// True jumps since the epoch before `[cycles]`.
    pub jumps: [i64; AMBIGUITIES],
    /// Jumps that the filter took to have happened.
    pub flags: [bool; AMBIGUITIES],
    /// Slip estimates of the filter's detector `[cycles]`.
    pub slip_estimates: [f64; AMBIGUITIES],
    /// Those of the paper's projection of the same innovations `[cycles]`.
    pub projections: [f64; AMBIGUITIES],
    /// Whether it is one of those at the start that do not count.
    pub transient: bool,
    /// Whether the filter refused the epoch; it is then as it was before.
    pub refused: bool,
}

impl Position {
    /// Normalised error squared, expected 3; infinite where the covariance is not positive definite.
    pub fn nees(&self) -> f64 {
        self.covariance.cholesky().map_or(f64::INFINITY, |factor| self.error.dot(&factor.solve(&self.error)))
    }

    fn new(mean: &[f64], covariance: Mat<'_, f64>, truth: &Vector3<f64>) -> Self {
        let entry = |i: usize, j: usize| covariance.get(i.max(j), i.min(j)).unwrap_or(f64::NAN);
        Self {
            error: Vector3::from_fn(|i, _| mean.get(i).copied().unwrap_or(f64::NAN)) - truth,
            covariance: Matrix3::from_fn(entry),
        }
    }
}

impl Snapshot {
    /// How many integers are wrong.
    pub fn wrong(&self) -> usize {
        self.integer_errors.iter().filter(|&&error| error != 0).count()
    }
}

/// Runs a configuration and shows each epoch to `observe`.
///
/// An epoch that the filter refuses is passed over, and marked. An error is one of the initial density.
pub fn trial(
    configuration: &Configuration,
    constellation: &Constellation,
    random: ChaCha8Rng,
    mut observe: impl FnMut(&Snapshot),
) -> Result<(), FilterError> {
    let Configuration { scenario, options } = *configuration;
    let mut simulation = Simulation::new(scenario, constellation, random);
    let mut filter = Box::new(SectionV::<f64>::new(options));
    let prior = simulation.prior();
    filter.reset_independent(REAL, &prior.mean, &prior.variances)?;
    let mut epochs = 0;
    while let Some((epoch, truth)) = simulation.next_epoch() {
        epochs += 1;
        let model = VirtualBiasModel { satellites: &epoch.satellites, parameters: scenario.parameters };
        let projections = project(&model, filter.mean(), &epoch.measurements);
        let refused = filter.step(&model, &epoch.measurements).is_err();
        observe(&Snapshot {
            projections,
            refused,
            transient: epochs <= scenario.transient,
            ..snapshot(&filter, &epoch, truth)
        });
    }
    Ok(())
}

/// What the filter says against what is.
fn snapshot(filter: &SectionV<f64>, epoch: &Epoch, truth: &Truth) -> Snapshot {
    let entry = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(f64::NAN);
    Snapshot {
        time: epoch.time,
        relaxed: Position::new(filter.mean(), filter.covariance(), &truth.position),
        constrained: Position::new(filter.constrained_mean(), filter.constrained_covariance(), &truth.position),
        float_errors: from_fn(|i| entry(filter.mean(), REAL + i) - truth.ambiguities[i] as f64),
        integer_errors: from_fn(|i| filter.integers().get(i).copied().unwrap_or(0) - truth.ambiguities[i]),
        jumps: truth.jumps,
        flags: from_fn(|i| filter.slips().get(i).copied().unwrap_or(false)),
        slip_estimates: from_fn(|i| entry(filter.slip_estimates(), i)),
        projections: [0.0; AMBIGUITIES],
        transient: false,
        refused: false,
    }
}

/// (31) for a filter with any detector: (y_Φ − ŷ_Φ)/λ with ŷ at the predicted `mean`.
fn project(model: &VirtualBiasModel<'_>, mean: &[f64], measurements: &[f64]) -> [f64; AMBIGUITIES] {
    let mut state = mean.to_vec();
    model.transition(&mut |step| match step {
        Elementary::Shear { to, from, factor } => state[to] += factor * state[from],
        Elementary::Scale { state: i, factor } => state[i] *= factor,
    });
    let mut predicted = [0.0; 2 * AMBIGUITIES];
    model.evaluate(&state[model.nonlinear()], &mut predicted);
    from_fn(|i| {
        let row = AMBIGUITIES + i;
        model.linear_row(row, &mut |i, coefficient| predicted[row] += coefficient * state[i]);
        (measurements[row] - predicted[row]) / model.parameters.wavelength
    })
}
