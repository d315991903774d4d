//! A simulated drive with two bands and slips, from the engine's record to smoothed positions.

use super::clusters::Clusters;
use super::fix::Fixing;
use super::model::RtkModel;
use super::noise::{Kind, Noise};
use super::tape::Tape;
use super::{EVALUATIONS, Options, smooth};
use crate::process::run::Engine;
use crate::process::stream::{Input, Merge};
use crate::simulate::scenario::Scenario;
use crate::simulate::{Truth, simulate};
use crate::smooth::integers::{Scope, Search, Source};
use crate::smooth::model::{Integer, Model, Sums, Transition};
use crate::smooth::pass::{PassOptions, Passes};
use std::convert::Infallible;
use surefix_core::gnss::epoch::Observation;
use surefix_core::gnss::solution::Quality;
use surefix_core::log::Header;
use surefix_core::rtk::RtkConfig;

/// What the engine recorded of `seconds` at 1 Hz with the slips of the default scenario, and the truth.
pub(super) fn drive(seconds: f64) -> (Tape, Vec<Truth>) {
    spoilt_drive(seconds, |_, _| ())
}

/// The same, with something done to each observation of the rover, given the number of its epoch.
fn spoilt_drive(seconds: f64, mut spoil: impl FnMut(usize, &mut Observation)) -> (Tape, Vec<Truth>) {
    let mut scenario = Scenario { duration_s: seconds - 1.0, ..Scenario::default() };
    for receiver in [&mut scenario.rover.receiver, &mut scenario.base.receiver] {
        receiver.interval_s = 1.0;
        receiver.outages.clear();
    }
    let mut simulation = simulate(&scenario).unwrap();
    for (k, epoch) in simulation.rover.iter_mut().enumerate() {
        epoch.observations.iter_mut().for_each(|observation| spoil(k, observation));
    }
    let header = Header { base_position: Some(simulation.base_position.into()), ..Header::default() };
    let [rover, base] = [simulation.rover, simulation.base].map(|epochs| epochs.into_iter().map(Ok::<_, Infallible>));
    let mut engine = Engine::new(RtkConfig::default());
    let mut tape = Tape::new(RtkConfig::default());
    for input in Merge::new(header, [], simulation.ephemerides, rover, base) {
        let input: Input = input.unwrap();
        if let Some(solution) = engine.feed(&input) {
            assert!(tape.record(&engine, &solution));
            assert!(!tape.record(&engine, &solution), "the same epoch twice");
        }
    }
    (tape, simulation.truth)
}

pub(super) fn model(tape: &Tape) -> RtkModel<'_> {
    RtkModel::new(tape, Noise::new(tape, Options::default().time_constants, true))
}

#[test]
fn a_tape_has_every_epoch_and_each_phase_an_arc_that_lasts() {
    let (tape, truth) = drive(60.0);
    assert_eq!((tape.epochs().len(), truth.len()), (60, 60));
    assert_eq!(tape.solutions().len(), 60);
    assert!(tape.groups().len() >= 2 && tape.links(0).len() > 8);
    for k in 0..60 {
        for link in tape.links(k).iter().filter(|link| !link.phase.is_nan()) {
            let arc = tape.arcs()[link.arc as usize];
            assert!(arc.span[0] <= k && k <= arc.span[1]);
            assert_eq!(arc.signal, usize::from(link.signal));
        }
        let dopplers = tape.links(k).iter().filter(|link| !link.doppler.is_nan());
        let satellites: Vec<_> = dopplers.map(|link| tape.signals()[usize::from(link.signal)].satellite).collect();
        assert!(satellites.iter().enumerate().all(|(i, satellite)| !satellites[..i].contains(satellite)));
    }
    assert!(tape.links(60).is_empty(), "beyond the end");
}

/// Give each arc any number: the states made of them go from epoch to epoch by F, whichever the reference is, before and
/// after some were fixed.
#[test]
fn transitions_carry_ambiguities_exactly() {
    let (tape, _) = drive(90.0);
    let mut model = model(&tape);
    let number = |arc: usize| ((arc * 7919) % 41) as f64 - 20.0;
    for round in 0..2 {
        let values = |model: &RtkModel<'_>, k: usize| -> Vec<f64> {
            let layout = model.layouts().of(k);
            layout.ambiguities.iter().map(|a| number(a.cluster) - number(layout.references[a.group].unwrap())).collect()
        };
        let (mut transition, mut carried) = (Transition::default(), 0);
        for k in 0..tape.epochs().len() - 1 {
            model.transition(k, &mut transition);
            let step = transition.step();
            assert_eq!((step.map.columns, step.map.rows()), (model.states(k), model.states(k + 1)));
            let (before, after) = (values(&model, k), values(&model, k + 1));
            for (i, &value) in after.iter().enumerate().filter(|&(i, _)| !step.map.row(6 + i).is_empty()) {
                let sum: f64 = step.map.row(6 + i).iter().map(|&(column, f)| f * before[column - 6]).sum();
                assert_eq!(sum, value, "epoch {k} state {i} round {round}");
                carried += 1;
            }
        }
        assert!(carried > 500, "{carried}");
        let mut integers = Vec::new();
        model.integers(0, &mut integers);
        let fixed: Vec<Integer> = integers.into_iter().take(3).collect();
        let pairs: Vec<f64> = fixed
            .iter()
            .map(|integer| {
                let [cluster, reference] = model.layouts().pairs[integer.arc];
                number(cluster) - number(reference)
            })
            .collect();
        let states = model.states(0);
        assert_eq!(model.fix(0, &fixed, &pairs), 0);
        model.settle();
        assert_eq!(model.states(0), states - fixed.len());
    }
    let floating = Clusters::new(tape.arcs().len());
    model.release();
    assert!((0..tape.arcs().len()).all(|arc| model.clusters().find(arc) == floating.find(arc)));
}

/// Bug: coloured noise of the first epoch was left out. The closed forms of EM are those of the likelihood: by Fisher's
/// identity its derivative by ln v is ½ (n − quadratic/v).
#[test]
fn sums_of_em_count_the_prior_of_coloured_noise_and_are_the_derivative_of_the_likelihood() {
    let (tape, _) = drive(25.0);
    let mut model = model(&tape);
    let mut passes = Passes::new(PassOptions::default());
    passes.forward(&model).unwrap();
    let sums: Sums = passes.backward_learning(&model, |_| ()).unwrap();
    let variances: Vec<f64> = model.parameters().iter().map(|parameter| parameter.variance).collect();
    let mut checked = 0;
    let learned: Vec<bool> = model.parameters().iter().map(|parameter| parameter.learned).collect();
    for (j, &variance) in variances.iter().enumerate().filter(|&(j, _)| learned[j] && sums.count[j] > 0.0) {
        let likelihood = |model: &mut RtkModel<'_>, passes: &mut Passes<'_>, change: f64| {
            let mut changed = variances.clone();
            changed[j] *= f64::exp(change);
            model.set_variances(&changed);
            passes.forward(model).unwrap().negative_log_likelihood()
        };
        let h = 1e-3;
        let slope = (likelihood(&mut model, &mut passes, h) - likelihood(&mut model, &mut passes, -h)) / (2.0 * h);
        let expected = 0.5 * (sums.count[j] - sums.quadratic[j] / variance);
        let name = &model.parameters()[j].name;
        assert!((slope - expected).abs() < 1e-3 * (1.0 + sums.count[j]), "{name}: {slope} {expected}");
        checked += 1;
    }
    assert!(checked > 8, "{checked}");
}

#[test]
fn every_epoch_is_fixed_and_right() {
    let (tape, truth) = drive(90.0);
    for em in [false, true] {
        let smoothed = smooth(&tape, &Options { em, ..Options::default() }, None).unwrap();
        assert_eq!(smoothed.solutions.len(), truth.len());
        for (solution, truth) in smoothed.solutions.iter().zip(&truth) {
            assert_eq!(solution.quality, Quality::Fixed, "em {em}");
            let error = solution.position - truth.position;
            assert!(error.norm() < 0.05, "em {em}: {error}");
            let sigma = solution.position_covariance.trace().sqrt();
            assert!((0.002..0.03).contains(&sigma), "em {em}: {sigma}");
        }
        let report = &smoothed.report;
        assert!(report.arcs.fixed > 8 && report.arcs.contradictory == 0, "{:?}", report.arcs);
        assert_eq!(report.negative_log_likelihood.len() > 1, em);
    }
}

/// The first epochs know least of their integers by what came before them, and as much as any by all there is. Arc by arc
/// what is fixed at the end of a span holds at its start.
#[test]
fn integers_are_right_from_either_posterior_by_either_search_and_scope() {
    let (tape, truth) = drive(90.0);
    for search in [Search::LeastSquares, Search::Bootstrapping] {
        for (source, scope) in [
            (Source::Smoother, Scope::Arc),
            (Source::Filter, Scope::Arc),
            (Source::Smoother, Scope::Epoch),
            (Source::Filter, Scope::Epoch),
        ] {
            let fixing = Fixing { source, scope, search };
            let smoothed = smooth(&tape, &Options { fixing, ..Options::default() }, None).unwrap();
            let qualities: Vec<Quality> = smoothed.solutions.iter().map(|solution| solution.quality).collect();
            let fixed = |quality: &Quality| matches!(quality, Quality::Fixed | Quality::Partial);
            if (source, scope) == (Source::Filter, Scope::Epoch) {
                assert!(!fixed(&qualities[0]) && fixed(&qualities[89]), "{fixing:?}: {qualities:?}");
            } else {
                assert!(qualities.iter().all(fixed), "{fixing:?}: {qualities:?}");
            }
            for (solution, truth) in smoothed.solutions.iter().zip(&truth).filter(|(s, _)| fixed(&s.quality)) {
                let error = (solution.position - truth.position).norm();
                assert!(error < 0.05, "{fixing:?}: {error}");
            }
            let arcs = smoothed.report.arcs;
            assert!(arcs.fixed > 8 && arcs.contradictory == 0, "{fixing:?}: {arcs:?}");
        }
    }
}

/// Where no integer helps another epoch, forward passes are those of EM and the last; else there are rounds of fixing.
#[test]
fn epoch_by_epoch_em_learns_without_integers() {
    let (tape, _) = drive(60.0);
    let passes = |scope, em| {
        let fixing = Fixing { scope, ..Fixing::default() };
        smooth(&tape, &Options { em, fixing, ..Options::default() }, None).unwrap().report.passes
    };
    assert_eq!(passes(Scope::Epoch, false), 1);
    assert!(passes(Scope::Arc, false) > 2);
    // Of each evaluation one forward pass, at most two more where an extrapolation or a halving was tried.
    let learning: usize = EVALUATIONS.iter().sum();
    let with_em = passes(Scope::Epoch, true);
    assert!((3..=1 + 3 * learning).contains(&with_em), "{with_em}");
}

#[test]
fn the_likeliest_of_several_starts_counts() {
    let (tape, truth) = drive(60.0);
    let options = Options { em: true, ..Options::default() };
    let single = smooth(&tape, &options, None).unwrap();
    assert!(single.report.starts.is_empty());
    // From a start that is a thousand times wrong the best is out of reach in ten evaluations; itself again is a draw.
    for starts in [vec![[1e-3, 1e3]], vec![[1.0, 1.0]]] {
        let smoothed = smooth(&tape, &Options { starts, ..options.clone() }, None).unwrap();
        let ends = &smoothed.report.starts;
        assert_eq!(ends.iter().map(|start| start.taken).collect::<Vec<_>>(), [true, false], "{ends:?}");
        assert!(ends[0].negative_log_likelihood.unwrap() <= ends[1].negative_log_likelihood.unwrap(), "{ends:?}");
        assert_eq!(smoothed.solutions, single.solutions, "the start as configured was the best, so nothing changes");
    }
    // A wrong start and back: the second is the configured one.
    let wrong = Options { start_factors: [1e-3, 1e3], starts: vec![[1e3, 1e-3]], ..options };
    let smoothed = smooth(&tape, &wrong, None).unwrap();
    let ends = &smoothed.report.starts;
    assert_eq!(ends.iter().map(|start| start.taken).collect::<Vec<_>>(), [false, true], "{ends:?}");
    for (solution, truth) in smoothed.solutions.iter().zip(&truth) {
        assert!((solution.position - truth.position).norm() < 0.05);
    }
}

#[test]
fn an_empty_tape_is_an_error_with_a_remedy() {
    let tape = Tape::new(RtkConfig::default());
    let error = smooth(&tape, &Options::default(), None).unwrap_err().to_string();
    assert!(error.contains("give data that overlap"), "{error}");
}

#[test]
fn parameters_have_their_places_and_bounds() {
    let (tape, _) = drive(5.0);
    let mut noise = Noise::new(&tape, Options::default().time_constants, true);
    let mut places = vec![Noise::motion(0), Noise::motion(2), Noise::STAY];
    places.extend(noise.white_components(Kind::Doppler, 0));
    for group in 0..tape.groups().len() {
        for kind in [Kind::Phase, Kind::Code] {
            places.push(noise.coloured(kind, group).0);
            places.extend(noise.white_components(kind, group));
        }
    }
    places.sort_unstable();
    assert_eq!(places, (0..noise.parameters().len()).collect::<Vec<_>>());
    let (motion, phase) = (noise.variance(0), noise.white(Kind::Phase, 0)[0]);
    noise.scale([2.0, 0.5]);
    assert!(
        (noise.variance(0) / motion - 4.0).abs() < 1e-12
            && (noise.white(Kind::Phase, 0)[0] / phase - 0.25).abs() < 1e-12
    );
    noise.scale([1e9, 1e-9]);
    assert!(noise.parameters().iter().all(|p| (p.bounds[0]..=p.bounds[1]).contains(&p.variance)));
}

/// Bent signals: the Doppler of a satellite is off by 0.2 m/s for 20 s, which is less than the engine rejects. Noise with
/// heavy tails distrusts these twenty and nothing else, and smooths no worse.
#[test]
fn spoilt_measurements_are_distrusted() {
    let spoil = |k: usize, observation: &mut Observation| {
        if (30..50).contains(&k) && observation.satellite.number() % 7 == 3 {
            observation.doppler = observation.doppler.map(|doppler| doppler + 1.0);
        }
    };
    let (tape, truth) = spoilt_drive(90.0, spoil);
    let rms = |smoothed: &super::Smoothed, velocity: bool| {
        let squares = smoothed.solutions.iter().zip(&truth).map(|(solution, truth)| {
            let error = if velocity { solution.velocity - truth.velocity } else { solution.position - truth.position };
            error.norm_squared()
        });
        (squares.sum::<f64>() / truth.len() as f64).sqrt()
    };
    let run = |robust| smooth(&tape, &Options { em: true, robust, ..Options::default() }, None).unwrap();
    let (robust, plain) = (run(true), run(false));
    let distrusted = |of: &str| robust.report.tails.iter().find(|tail| tail.of == of).unwrap().distrusted;
    assert_eq!(distrusted("doppler"), 20, "{:?}", robust.report.tails);
    assert_eq!(robust.report.tails.iter().map(|tail| tail.distrusted).sum::<usize>(), 20, "{:?}", robust.report.tails);
    assert!(rms(&robust, true) < 1.1 * rms(&plain, true), "{} {}", rms(&robust, true), rms(&plain, true));
    assert!(rms(&robust, false) < 1.05 * rms(&plain, false), "{} {}", rms(&robust, false), rms(&plain, false));
    assert!(plain.report.tails.is_empty());
}
