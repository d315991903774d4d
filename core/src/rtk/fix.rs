//! Integers: which ambiguities may be fixed, whether the result is believed, and the constrained density.
//!
//! The integer vector ň minimises (n̂ − n)ᵀ Q⁻¹ (n̂ − n) over the candidates; it is accepted if the bootstrapped success
//! rate *and* the ratio of the two best norms reach their thresholds ([`super::config::Acceptance`]). If the whole set
//! is not accepted, the weakest satellites are taken out one after the other, and the first set that is accepted is
//! used (partial fixing). The constrained density is the relaxed one given the accepted integers, and only those; or, by
//! [`Output::DualDensity`], one that lives on ([`super::constrained`]).

use super::RtkFilter;
use super::channel::{Channel, GROUPS};
use crate::filter::mixed_integer::Output;
use crate::gnss::solution::{Quality, Reason, Solution};
use crate::gnss::time::GpsTime;
use crate::integer::condition::condition_on_integers;
use crate::integer::{self, Config, Method, Workspace};
use crate::linalg::{Mat, MatMut};
use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

/// Most subsets tried in one epoch.
const MAX_SUBSETS: usize = 10;
/// States of the constrained density: position and velocity.
const KINEMATIC: usize = 6;

/// Workspace of the integer step for up to `C` ambiguities.
pub(super) struct Integers<const C: usize> {
    workspace: Workspace<f64, C>,
    /// Channels that may be fixed, the most trusted first.
    candidates: Vec<u8, C>,
    states: Vec<usize, C>,
    float: [f64; C],
    values: [f64; C],
    residual: [f64; C],
    covariance: [[f64; C]; C],
    cross: [[f64; KINEMATIC]; C],
}

impl<const C: usize> Integers<C> {
    pub const fn new() -> Self {
        Self {
            workspace: Workspace::new(),
            candidates: Vec::new(),
            states: Vec::new(),
            float: [0.0; C],
            values: [0.0; C],
            residual: [0.0; C],
            covariance: [[0.0; C]; C],
            cross: [[0.0; KINEMATIC]; C],
        }
    }
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Fixes what can be fixed and reports the constrained density, or why it could not.
    pub(super) fn fix(&mut self, solution: &mut Solution) {
        self.choose_references(solution.time);
        self.choose_candidates(solution.time);
        let whole = self.integers.candidates.len();
        solution.ambiguities = whole.min(255) as u8;
        let least = self.config.acceptance.min_ambiguities.max(1);
        for subset in 0..MAX_SUBSETS {
            if self.integers.candidates.len() < least {
                break;
            }
            if self.try_set(solution, subset == 0) {
                solution.quality = if subset == 0 { Quality::Fixed } else { Quality::Partial };
                solution.reason = if subset == 0 { Reason::Complete } else { Reason::SubsetOnly };
                return;
            }
            // The least trusted eighth goes, at least one.
            let keep = self.integers.candidates.len() - (self.integers.candidates.len() / 8).max(1);
            self.integers.candidates.truncate(keep);
        }
        self.constrained.end();
        for channel in self.channels.as_mut_slice() {
            channel.fixed = None;
        }
    }

    /// Which channels may be fixed in the epoch at `time`: seen, whole, high and locked.
    fn fixable(&self, time: GpsTime) -> impl Fn(&Channel) -> bool + use<C, N, E> {
        let acceptance = self.config.acceptance;
        let mask = libm::sin(acceptance.elevation_mask);
        let seen = move |channel: &Channel| channel.last_seen == time;
        // After a start or an outage all are young.
        let oldest = self.channels.as_slice().iter().filter(|c| seen(c)).map(|channel| channel.lock).max().unwrap_or(0);
        let min_lock = acceptance.min_lock.min(oldest);
        move |channel| {
            seen(channel) && channel.is_integer() && channel.sin_elevation >= mask && channel.lock >= min_lock
        }
    }

    /// Each group is to be referred to a channel that may be fixed itself.
    fn choose_references(&mut self, time: GpsTime) {
        let fixable = self.fixable(time);
        for group in 0..GROUPS {
            let Some(reference) = self.channels.reference(group) else { continue };
            if self.channels.as_slice().get(reference).is_some_and(&fixable) {
                continue;
            }
            if let Some(heir) = self.channels.best_reference(group, |_, channel| fixable(channel)) {
                self.channels.make_reference(&mut self.density, heir);
            }
        }
    }

    /// Channels that may be fixed and are referred to one that may be as well: those with proven integers first, then
    /// the highest.
    fn choose_candidates(&mut self, time: GpsTime) {
        let fixable = self.fixable(time);
        let channels = self.channels.as_slice();
        self.integers.candidates.clear();
        for (i, channel) in channels.iter().enumerate() {
            let reference_serves =
                self.channels.reference(channel.group()).and_then(|r| channels.get(r)).is_some_and(&fixable);
            if channel.state.is_some() && fixable(channel) && reference_serves {
                // Capacity is that of the channels, of which there are at most 255.
                let _ = self.integers.candidates.push(i as u8);
            }
        }
        self.integers.candidates.sort_unstable_by(|&a, &b| {
            let elevation = |i: u8| channels.get(usize::from(i)).map_or(0.0, |channel| channel.sin_elevation);
            let known = |i: u8| channels.get(usize::from(i)).is_some_and(|channel| channel.fixed.is_some());
            known(b).cmp(&known(a)).then(elevation(b).total_cmp(&elevation(a))).then(a.cmp(&b))
        });
    }

    /// Tries to fix the current candidates. On success the solution holds the constrained density.
    fn try_set(&mut self, solution: &mut Solution, first: bool) -> bool {
        let acceptance = self.config.acceptance;
        let work = &mut self.integers;
        let m = work.candidates.len().min(C);
        work.states.clear();
        for &i in &work.candidates {
            let state = self.channels.as_slice().get(usize::from(i)).and_then(|channel| channel.state);
            let Some(state) = state else { return false };
            let _ = work.states.push(state);
        }
        let floats = work.float.iter_mut().zip(&mut work.covariance);
        for ((float, row), &state) in floats.zip(&work.states) {
            *float = self.density.mean().get(state).copied().unwrap_or(0.0);
            for (q, &other) in row.iter_mut().zip(&work.states) {
                *q = self.density.covariance(state, other);
            }
        }
        let flat = work.covariance.as_flattened();
        let Ok(q) = Mat::new(flat, m, m, C) else { return false };
        let resolution = match integer::resolve(&work.float[..m], q, &Config::default(), &mut work.workspace) {
            Ok(resolution) => resolution,
            Err(_) => {
                solution.reason = Reason::Inconsistent;
                return false;
            }
        };
        let confirmed = work.candidates.iter().zip(resolution.best).all(|(&i, &n)| {
            self.channels.as_slice().get(usize::from(i)).and_then(|channel| channel.fixed) == Some(n as f64)
        });
        // The distance of the floats from the integers is χ² with m degrees of freedom. Where it is larger, the floats
        // are worse than their covariance says, and so is the success rate; integers that were proven before are not.
        let factor = if confirmed { 1.0 } else { (resolution.best_norm / m as f64).max(1.0) };
        work.residual[..m].copy_from_slice(resolution.variances);
        for variance in &mut work.residual[..m] {
            *variance *= factor;
        }
        let success_rate = integer::success_rate::bootstrapped(&work.residual[..m]).success;
        if first {
            self.adaptive.success = resolution.success_rate.success;
        }
        if first || success_rate > solution.success_rate {
            solution.ratio = resolution.ratio;
            solution.success_rate = success_rate;
        }
        let (least_success, least_ratio) = if confirmed {
            (acceptance.success_rate_confirmed, acceptance.ratio_confirmed)
        } else {
            (acceptance.success_rate, acceptance.ratio)
        };
        let refused = if success_rate < least_success {
            Some(Reason::SuccessRateLow)
        } else if resolution.method == Method::Bootstrapped {
            Some(Reason::SearchBudget)
        } else if resolution.ratio < least_ratio {
            Some(Reason::RatioLow)
        } else {
            None
        };
        if let Some(reason) = refused {
            solution.reason = reason;
            return false;
        }
        for (value, &n) in work.values.iter_mut().zip(resolution.best) {
            *value = n as f64;
        }
        solution.ratio = resolution.ratio;
        solution.success_rate = success_rate;
        self.constrain(solution)
    }

    /// The constrained density: position and velocity given the values of the current candidates.
    fn constrain(&mut self, solution: &mut Solution) -> bool {
        let work = &mut self.integers;
        let m = work.candidates.len().min(C);
        let kinematic = if self.config.motion.order() > 1 { KINEMATIC } else { 3 };
        let states = [0, 1, 2, 3, 4, 5];
        let (mut mean, mut covariance) = ([0.0; KINEMATIC], [[0.0; KINEMATIC]; KINEMATIC]);
        let n = self.density.dim();
        let conditioned = (|| {
            condition_on_integers(
                self.density.mean(),
                Mat::new(self.density.covariance_flat(), n, n, N)?,
                &states[..kinematic],
                &work.states,
                &work.values[..m],
                &mut MatMut::new(work.covariance.as_flattened_mut(), m, m, C)?,
                &mut MatMut::new(work.cross.as_flattened_mut(), m, kinematic, KINEMATIC)?,
                &mut work.residual[..m],
                &mut mean[..kinematic],
                &mut MatMut::new(covariance.as_flattened_mut(), kinematic, kinematic, KINEMATIC)?,
            )
        })();
        if conditioned.is_err() {
            solution.reason = Reason::Inconsistent;
            return false;
        }
        solution.position = self.position + Vector3::new(mean[0], mean[1], mean[2]);
        solution.position_covariance = Matrix3::from_fn(|i, j| covariance[i][j]);
        if kinematic > 3 {
            solution.velocity = Vector3::new(mean[3], mean[4], mean[5]);
            solution.velocity_covariance = Matrix3::from_fn(|i, j| covariance[3 + i][3 + j]);
        }
        solution.ambiguities_fixed = m.min(255) as u8;
        let revised = self.remember_integers();
        if self.config.estimation.output == Output::DualDensity {
            if revised {
                self.constrained.end();
            }
            self.report_constrained(solution);
        }
        true
    }

    /// Notes the accepted integers; true if one of them is another one than before.
    fn remember_integers(&mut self) -> bool {
        let (channels, work) = (self.channels.as_mut_slice(), &self.integers);
        let accepted = || work.candidates.iter().map(|&i| usize::from(i)).zip(&work.values);
        let differs =
            |(i, &n): (usize, &f64)| channels.get(i).and_then(|channel| channel.fixed).is_some_and(|m| m != n);
        let revised = accepted().any(differs);
        for channel in channels.iter_mut() {
            channel.fixed = channel.state.is_none().then_some(0.0);
        }
        for (i, &n) in accepted() {
            if let Some(channel) = channels.get_mut(i) {
                channel.fixed = Some(n);
            }
        }
        revised
    }

    /// Brings the constrained density to this epoch and reports it.
    fn report_constrained(&mut self, solution: &mut Solution) {
        let form = self.config.estimation.form;
        let Some(density) = self.constrained.update(form, &self.links, &self.channels).filter(|d| d.is_sound()) else {
            // The conditional density of this epoch stays in the solution.
            return self.constrained.end();
        };
        solution.position_covariance = Matrix3::from_fn(|i, j| density.covariance(i, j));
        if density.dim() > 3 {
            solution.velocity = Vector3::from_fn(|i, _| density.mean().get(3 + i).copied().unwrap_or(0.0));
            solution.velocity_covariance = Matrix3::from_fn(|i, j| density.covariance(3 + i, 3 + j));
        }
        solution.position = self.constrained.position();
    }
}
