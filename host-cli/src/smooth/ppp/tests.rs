//! The model against dense batch least squares, and what learning promises.

use super::learn::{Learning, Status, Step};
use super::pools::Rule;
use super::tape::{Arc, Epoch, Geometry, Group, Kind, Row, Tape};
use super::*;
use crate::smooth::batch::solve;
use crate::smooth::dense::{Dense, Measurement, System};
use crate::smooth::model::{Density, Model, Transition};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;

/// A tape drawn from the model, and what it was drawn with.
pub struct Drawn {
    /// The tape.
    pub tape: Tape,
    /// Position in each epoch `[m]`.
    pub positions: Vec<Vector3<f64>>,
}

/// Two constellations of five satellites, 24 epochs of 30 s: arcs that are born, slip and end, outages, a white clock.
pub fn drawn(seed: u64) -> Drawn {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || -> f64 { rng.sample(StandardNormal) };
    let mut other = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
    let (epochs, satellites) = (24, 10);
    let group = |name: &str, constellation, isb| Group { name: name.into(), constellation, isb };
    let groups = vec![group("G IF", Constellation::Gps, None), group("E IF", Constellation::Galileo, Some(0))];
    let mut tape = Tape { groups, ..Tape::default() };
    let truth = Vector3::new(3.0, -2.0, 5.0);
    let (mut positions, mut zenith, bias) = (Vec::new(), 0.1, 4.0);
    let mut live: Vec<Option<(u32, f64)>> = vec![None; satellites];
    for k in 0..epochs {
        let clock = 50.0 * normal();
        zenith += 1e-3 * normal();
        let first = tape.rows.len();
        for s in 0..satellites {
            let rises = k < s % 4 || k + s % 3 > epochs;
            let lost = other.random_bool(0.05);
            if rises || lost {
                if other.random_bool(0.5) {
                    live[s] = None;
                }
                continue;
            }
            let group = (s % 2) as u16;
            let constellation = [Constellation::Gps, Constellation::Galileo][s % 2];
            let satellite = SatelliteId::new(constellation, s as u8 + 1).unwrap();
            let elevation = (12.0 + 7.5 * s as f64 + 0.3 * k as f64).to_radians();
            let azimuth = 2.4 * s as f64 + 0.01 * k as f64;
            let direction = [-elevation.cos() * azimuth.sin(), -elevation.cos() * azimuth.cos(), -elevation.sin()];
            let wet = 1.0 / elevation.sin();
            let (arc, ambiguity) = *live[s].get_or_insert_with(|| {
                tape.arcs.push(Arc { satellite, group, first: k, last: k, prior: 0.0 });
                ((tape.arcs.len() - 1) as u32, 20.0 * normal())
            });
            tape.arcs[arc as usize].last = k;
            let isb = if group == 1 { bias } else { 0.0 };
            let range = Vector3::from(direction).dot(&truth) + clock + isb + wet * zenith;
            let row = |kind, value, sigma: f64| Row {
                kind,
                satellite,
                group,
                arc,
                elevation,
                direction,
                wet,
                gradients: [wet * azimuth.cos(), wet * azimuth.sin()],
                ionosphere: 0.0,
                value,
                variance: sigma * sigma,
                shape: 1.0,
            };
            tape.rows.push(row(Kind::Code, range + 0.6 * normal(), 1.0));
            tape.rows.push(row(Kind::Phase, range + ambiguity + 0.006 * normal(), 0.02));
        }
        positions.push(truth);
        let time = GpsTime::from_week_tow(2100, 30.0 * k as f64);
        tape.epochs.push(Epoch { time, rows: first..tape.rows.len(), clock: 0.0, position: Vector3::zeros() });
    }
    Drawn { tape, positions }
}

/// At rest, priors that a dense solution can stand.
fn narrow() -> Options {
    let at_rest = Options::at_rest();
    let priors = Priors { position: 10.0, velocity: 0.01, clock: 100.0, bias: 10.0, ambiguity: 30.0, ..at_rest.priors };
    Options { priors, ..at_rest }
}

fn run(tape: &Tape, options: &Options) -> Smoothed {
    smooth(tape, options, None).unwrap()
}

/// The model as dense matrices, for the batch solution.
fn dense(model: &PppModel) -> Dense {
    let mut system = System::default();
    model.prior(&mut system.prior);
    for k in 0..model.epochs() {
        if k > 0 {
            let mut step = Transition::default();
            model.transition(k - 1, &mut step);
            step.noise.iter_mut().for_each(|block| block.component = None);
            system.steps.push(step);
        }
        let (n, order): (_, Vec<usize>) = (model.states(k), model.order(k).collect());
        let m = order.len();
        let mut measurement =
            Measurement { values: vec![], rows: vec![0.0; m * n], noise: vec![0.0; m * m], parameter: None };
        for (row, &i) in order.iter().enumerate() {
            let line = model.line(k, i);
            measurement.values.push(line.residual(&vec![0.0; n]));
            line.entries().for_each(|(state, h)| measurement.rows[row * n + state] += h);
            measurement.noise[row * m + row] = model.noise.row(i);
        }
        system.measurements.push(measurement);
    }
    Dense::new(system, Vec::new())
}

/// Arcs are born, slip and die, satellites come and go: means and covariances are those of dense batch least squares, and so
/// is ℓ. (Phases of 0.3 m, as the dense solution loses digits to the square of 100 m over the noise.)
#[test]
fn smoothed_states_are_those_of_batch_least_squares() {
    for (seed, motion) in [(1, Motion::Walk), (2, Motion::ConstantVelocity), (3, Motion::Walk)] {
        let mut options = Options { motion, gradients: seed == 3, start: Some([1.0, 0.3]), ..narrow() };
        options.walks[Class::Motion as usize].sigma = if seed == 3 { 0.0 } else { 1e-3 };
        let mut tape = drawn(seed).tape;
        if seed == 2 {
            tape.rows.iter_mut().for_each(|row| row.ionosphere = [0.6, -0.6][row.kind as usize]);
        }
        let model = PppModel::new(tape, options);
        let mut passes = Passes::new(PassOptions::default());
        let fit = passes.forward(&model).unwrap();
        let mut smoothed = vec![Density::default(); model.epochs()];
        passes.backward(&model, |epoch| smoothed[epoch.k].clone_from(epoch.smoothed)).unwrap();
        let (batch, likelihood) = solve(&dense(&model));
        let own = fit.negative_log_likelihood();
        assert!((own / likelihood - 1.0).abs() < 1e-6, "{own} {likelihood}");
        for (density, (mean, covariance)) in smoothed.iter().zip(&batch) {
            for i in 0..density.dim() {
                let sigma = covariance[(i, i)].sqrt();
                assert!(
                    (density.mean[i] - mean[i]).abs() < 1e-5 * sigma,
                    "{seed} {i}: {} {}",
                    density.mean[i],
                    mean[i]
                );
                assert!((density.covariance(i, i).sqrt() / sigma - 1.0).abs() < 1e-5, "{seed} {i}");
            }
        }
    }
}

/// What each scheme promises: ℓ never rises for maximum likelihood, the variational bound for Student-t errors, ℓ and the prior
/// of the step for inverse gamma. (Rounding: 1e-6 of some thousands.)
#[test]
fn objectives_never_rise() {
    let tape = drawn(4).tape;
    let learning = Learning { iterations: 25, decrease: 0.0, scan: Vec::new(), accelerated: 0, ..Learning::default() };
    let base = Options { minimum: 0, start: Some([3.0, 0.03]), learning, ..narrow() };
    let pooled = [Rule::Type, Rule::Satellite, Rule::Elevation].map(Measurements::Pooled);
    for measurements in
        pooled.into_iter().chain([Measurements::Fixed, Measurements::StudentT(5.0), Measurements::Map(6.0)])
    {
        let mut options = Options { measurements, ..base.clone() };
        if measurements == Measurements::Map(6.0) {
            options.walks[Class::Motion as usize].learned = Process::Map(4.0);
        }
        let history = run(&tape, &options).report.history;
        assert_eq!(history.len(), 26);
        let falls = |step: &Step| step.before.is_none_or(|before| step.objective <= before + 1e-6 * before.abs());
        assert!(history.iter().all(falls), "{measurements:?} {history:?}");
        if options.is_likelihood() || measurements == Measurements::StudentT(5.0) {
            let objectives: Vec<f64> = history.iter().map(|step| step.objective).collect();
            assert!(objectives.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6 * pair[0].abs()), "{objectives:?}");
        }
    }
    let mut options = base.by_epoch();
    options.floors = [1e-6; 2];
    let history = run(&tape, &options).report.history;
    let likelihoods: Vec<f64> = history.iter().map(|step| step.likelihood).collect();
    assert!(likelihoods.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6 * pair[0].abs()), "{likelihoods:?}");
}

/// A walk of 0 stays 0: one position for all epochs, and nothing breaks. A scan finds it, as the receiver is at rest.
#[test]
fn a_walk_of_zero_is_exact_and_found() {
    let tape = drawn(5).tape;
    let mut options = narrow();
    options.walks[Class::Motion as usize].sigma = 0.0;
    let zero = run(&tape, &options);
    let first = &zero.states[0];
    for state in &zero.states {
        assert!((state.position - first.position).norm() < 1e-8);
        assert!((state.covariance - first.covariance).amax() < 1e-8 * first.covariance.amax());
    }
    assert!(zero.report.walks[0].sigmas.iter().flatten().all(|&sigma| sigma == 0.0));
    let found = run(&tape, &narrow());
    let scan = found.report.scan.unwrap();
    assert_eq!(scan.taken, Some(0.0), "{scan:?}");
    assert!((found.states[3].position - zero.states[3].position).norm() < 5e-3);
    assert_eq!(found.report.status, Status::Converged);
}

/// 3 m in one phase of 6 mm: with Student-t weights the answer is that without this phase, to 3 mm; with plain pools it is not.
/// (The outlier counts as ν + 1 good ones in its pool, which has to be large enough for that.)
#[test]
fn student_t_weights_leave_an_outlier_alone() {
    let mut tape = drawn(6).tape;
    let outlier = tape.rows.iter().enumerate().filter(|(_, row)| row.kind == Kind::Phase).nth(90).unwrap().0;
    tape.rows[outlier].value += 3.0;
    let ends = |options: &Options| {
        [true, false].map(|used| {
            let mut active = vec![true; tape.rows.len()];
            active[outlier] = used;
            let mut model = PppModel::without(tape.clone(), options.clone(), active);
            let (start, mut passes) = (model.noise.clone(), Passes::new(PassOptions::default()));
            let learned = learn::learn(&mut model, &mut passes).unwrap();
            let smoothed = conclude(&model, &start, learned, &mut passes).unwrap();
            (smoothed.states.last().unwrap().position, model.noise.trust(outlier))
        })
    };
    let [(with, trust), (without, _)] = ends(&Options { minimum: 100, ..narrow() });
    assert!(trust < 1e-3, "{trust}");
    assert!((with - without).norm() < 3e-3, "{with} {without}");
    let [(with, _), (without, _)] = ends(&Options { measurements: Measurements::Pooled(Rule::Type), ..narrow() });
    assert!((with - without).norm() > 3e-3, "{with} {without}");
}

/// Variances of nothing at all: the filter fails in some iteration, the answer is that of the last that worked, and the
/// report says so.
#[test]
fn a_failed_iteration_leaves_the_last_variances() {
    let tape = drawn(7).tape;
    let mut model = PppModel::new(tape, narrow());
    let mut passes = Passes::new(PassOptions::default());
    let before = learn::learn(&mut model, &mut passes).unwrap();
    assert!(matches!(before.status, Status::Converged | Status::Iterations));
    // A prior that is no covariance is what a collapsed P₀ comes to.
    let mut options = model.options().clone();
    options.learning = Learning { covariance: true, iterations: 400, decrease: 0.0, ..options.learning };
    options.floors = [1e-12; 2];
    let collapsing = Options { form: Form::Sequential, ..options.by_epoch() };
    let outcome = run(&drawn(7).tape, &collapsing);
    let Status::Failed { iteration, reason } = &outcome.report.status else { panic!("{:?}", outcome.report.status) };
    assert!(*iteration > 0 && !reason.is_empty());
    assert!(outcome.states.iter().all(|state| state.position.iter().all(|x| x.is_finite())));
    assert!(outcome.report.warning.is_some());
}

/// Linearised 80 m away: the trajectory is found in spite of it, as from its own place.
#[test]
fn linearised_again_the_start_does_not_matter() {
    let place = Vector3::new(4e6, 1e6, 4.8e6);
    let mut drawn = drawn(8);
    let truth = place + drawn.positions[0];
    drawn.tape.origin = place;
    drawn.tape.geometry = (drawn.tape.rows.iter())
        .map(|row| {
            let satellite = truth - 2.2e7 * Vector3::from(row.direction);
            let other = row.value - Vector3::from(row.direction).dot(&drawn.positions[0]);
            Geometry { satellite, measured: 2.2e7 + other }
        })
        .collect();
    let from = |offset: f64| {
        let mut tape = drawn.tape.clone();
        tape.epochs.iter_mut().for_each(|epoch| epoch.position = place + Vector3::new(offset, 0.0, -offset));
        let options = Options { measurements: Measurements::Pooled(Rule::Type), ..Options::at_rest() };
        run(&tape, &options)
    };
    let (near, far) = (from(0.0), from(80.0));
    let last = near.states.len() - 1;
    assert!((near.states[last].position - far.states[last].position).norm() < 1e-4);
    assert!((far.states[last].position - truth).norm() < 0.5);
    assert_eq!(far.tape.epochs[last].position.map(f64::round), truth.map(f64::round));
}

/// Innovations are what they should be, and so is what was held out: 1 within four standard errors of χ² with so many
/// degrees of freedom, for each kind, under the variances that the tape was drawn with.
#[test]
fn known_noise_is_consistent() {
    let learning = Learning { iterations: 0, ..Learning::default() };
    let mut options = Options { measurements: Measurements::Fixed, start: Some([0.6, 0.006]), learning, ..narrow() };
    options.walks[Class::Motion as usize].sigma = 0.0;
    options.walks[Class::Zenith as usize].sigma = 1e-3 / 30f64.sqrt();
    options.walks[Class::Biases as usize].sigma = 0.0;
    let tape = drawn(9).tape;
    for pool in run(&tape, &options).report.pools {
        let band = 4.0 * (2.0 / pool.count as f64).sqrt();
        // (The first row of an epoch pays for the clock, and the first phase of an arc for its ambiguity.)
        assert!((pool.consistency.unwrap() - 1.0).abs() < band + 0.15, "{pool:?}");
    }
    let outcome = held_out::held_out(&tape, &options, 0.1, 1).unwrap();
    let share = outcome.count as f64 / tape.rows.len() as f64;
    assert!((share - 0.1).abs() < 0.05, "{share}");
    assert!((outcome.consistency - 1.0).abs() < 4.0 * (2.0 / outcome.count as f64).sqrt(), "{outcome:?}");
}

/// A variance of its own for each measurement predicts what it has not seen worse than pools do.
#[test]
fn held_out_measurements_tell_pools_from_epochs() {
    let tape = drawn(10).tape;
    let of = |options: Options| held_out::held_out(&tape, &options, 0.1, 2).unwrap().likelihood;
    let pooled = of(Options { measurements: Measurements::Pooled(Rule::Type), ..narrow() });
    let epoch = of(narrow().by_epoch());
    assert!(pooled + 1.0 < epoch, "{pooled} {epoch}");
}
