//! Integers: which ambiguities may be fixed, whether the result is believed, and the constrained density.
//!
//! The integer vector ň minimises (n̂ − n)ᵀ Q⁻¹ (n̂ − n) over the candidates; it is accepted if the bootstrapped success
//! rate *and* the ratio of the two best norms reach their thresholds ([`super::config::Acceptance`]). If the whole set
//! is not accepted, a part of it may be ([`super::partial`]). The constrained density is the relaxed one given the accepted
//! integers, and only those; or, by [`Output::DualDensity`], one that lives on ([`super::constrained`]).

use super::RtkFilter;
use super::channel::{Channel, GROUPS};
use crate::filter::gaussian::Gaussian;
use crate::filter::mixed_integer::Output;
use crate::gnss::solution::{Quality, Reason, Solution};
use crate::gnss::time::GpsTime;
use crate::integer::condition::condition_on_integers;
use crate::integer::partial::select;
use crate::integer::subset::{Problem, Scratch, Sets};
use crate::integer::{self, Config, IntegerError, Method, Workspace};
use crate::linalg::{Mat, MatMut};
use crate::spp::SinglePoint;
use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

/// States of the constrained density: position and velocity.
pub(super) const KINEMATIC: usize = 6;

/// Workspace of the integer step for up to `C` ambiguities.
pub(super) struct Integers<const C: usize> {
    pub workspace: Workspace<f64, C>,
    /// States of the ambiguities that may be fixed, the most trusted first.
    pub ambiguities: Vec<usize, C>,
    /// Their satellites, each by the place of its first candidate.
    pub of: Vec<u8, C>,
    /// The subset in question: its states, and their integers once they are accepted.
    pub sets: Sets<f64, C>,
    pub vector: [f64; C],
    pub covariance: [[f64; C]; C],
    pub cross: [[f64; KINEMATIC]; C],
}

impl<const C: usize> Integers<C> {
    pub const fn new() -> Self {
        Self {
            workspace: Workspace::new(),
            ambiguities: Vec::new(),
            of: Vec::new(),
            sets: Sets::new(),
            vector: [0.0; C],
            covariance: [[0.0; C]; C],
            cross: [[0.0; KINEMATIC]; C],
        }
    }

    /// Takes all candidates as the subset.
    pub fn take_all(&mut self) {
        self.sets.states.clear();
        // Both have the same capacity.
        let _ = self.sets.states.extend_from_slice(&self.ambiguities);
    }

    /// The subset's part of `density`, into `vector` and `covariance`; returns how many ambiguities it has.
    pub fn gather<const N: usize>(&mut self, density: &Gaussian<f64, N>) -> Result<usize, IntegerError> {
        let (n, m) = (density.dim(), self.sets.states.len());
        let all = Mat::new(density.covariance_flat(), n, n, N)?;
        let mut q = MatMut::new(self.covariance.as_flattened_mut(), m, m, C)?;
        let a = self.vector.get_mut(..m).ok_or(IntegerError::Capacity)?;
        select(density.mean(), all, &self.sets.states, a, &mut q)?;
        Ok(m)
    }

    /// The choice of a subset of `density`, on this memory.
    pub fn subset<'a, const N: usize>(
        &'a mut self,
        density: &'a Gaussian<f64, N>,
    ) -> Option<(Problem<'a, f64>, &'a mut Sets<f64, C>, Scratch<'a, f64, C>)> {
        let n = density.dim();
        let covariance = Mat::new(density.covariance_flat(), n, n, N).ok()?;
        let problem =
            Problem { mean: density.mean(), covariance, ambiguities: &self.ambiguities, of: &self.of, order: &self.of };
        let scratch = Scratch {
            integers: &mut self.workspace,
            vector: &mut self.vector,
            square: &mut self.covariance,
            cross: self.cross.as_flattened_mut(),
        };
        Some((problem, &mut self.sets, scratch))
    }
}

/// The kinematic states.
pub(super) const STATES: [usize; KINEMATIC] = [0, 1, 2, 3, 4, 5];

/// Integers that were found.
pub(super) struct Found {
    /// Success rate as the covariance has it.
    pub full_success: f64,
    /// Squared norm of the best.
    pub norm: f64,
    /// Ratio of the two best squared norms.
    pub ratio: f64,
    pub method: Method,
}

/// What accepted integers say of the rest.
#[derive(Clone, Copy)]
pub(super) struct Accepted {
    /// How much larger variances are than the covariance says, by the distance of the floats from these integers.
    pub variance_factor: f64,
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Fixes what can be fixed and reports the constrained density, or why it could not.
    pub(super) fn fix(&mut self, solution: &mut Solution, single: Option<&SinglePoint>) {
        self.choose_references(solution.time);
        self.choose_candidates(solution.time);
        let whole = self.integers.ambiguities.len();
        solution.ambiguities = whole.min(255) as u8;
        let fixed = self.fix_all(solution) && self.keep_length(solution, single)
            || self.fix_part(solution) && self.keep_length(solution, single);
        if fixed {
            let all = solution.ambiguities_fixed == solution.ambiguities;
            solution.quality = if all { Quality::Fixed } else { Quality::Partial };
            solution.reason = if all { Reason::Complete } else { Reason::SubsetOnly };
            return;
        }
        self.forget_integers();
    }

    /// Forgets the integers that were accepted.
    pub(super) fn forget_integers(&mut self) {
        self.constrained.end();
        for channel in self.channels.as_mut_slice() {
            channel.fixed = None;
        }
    }

    /// Takes a fix back whose vector has not the length that it is known to have.
    pub(super) fn keep_length(&mut self, solution: &mut Solution, single: Option<&SinglePoint>) -> bool {
        if self.has_length(solution, single) {
            return true;
        }
        self.forget_integers();
        self.report_relaxed(solution);
        solution.ambiguities_fixed = 0;
        solution.reason = Reason::BaselineLength;
        false
    }

    /// Tries the whole set.
    fn fix_all(&mut self, solution: &mut Solution) -> bool {
        let work = &mut self.integers;
        work.take_all();
        work.sets.states.len() >= self.least_ambiguities()
            && self.accept(solution, true).is_some()
            && self.constrain(solution)
    }

    /// Fewest ambiguities to fix.
    pub(super) fn least_ambiguities(&self) -> usize {
        self.config.acceptance.min_ambiguities.max(1)
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
        let mut candidates: Vec<u8, C> = Vec::new();
        for (i, channel) in channels.iter().enumerate() {
            let reference_serves =
                self.channels.reference(channel.group()).and_then(|r| channels.get(r)).is_some_and(&fixable);
            if channel.state.is_some() && fixable(channel) && reference_serves {
                // Capacity is that of the channels, of which there are at most 255.
                let _ = candidates.push(i as u8);
            }
        }
        candidates.sort_unstable_by(|&a, &b| {
            let elevation = |i: u8| channels.get(usize::from(i)).map_or(0.0, |channel| channel.sin_elevation);
            let known = |i: u8| channels.get(usize::from(i)).is_some_and(|channel| channel.fixed.is_some());
            known(b).cmp(&known(a)).then(elevation(b).total_cmp(&elevation(a))).then(a.cmp(&b))
        });
        let Integers { ambiguities, of, .. } = &mut self.integers;
        ambiguities.clear();
        of.clear();
        let satellite = |i: u8| channels.get(usize::from(i)).map(|channel| channel.satellite);
        for &i in candidates.iter() {
            // Each has a state, and there are as many places as candidates.
            let _ =
                ambiguities.push(channels.get(usize::from(i)).and_then(|channel| channel.state).unwrap_or(usize::MAX));
            let first = candidates.iter().position(|&j| satellite(j) == satellite(i)).unwrap_or(0);
            let _ = of.push(first as u8);
        }
    }

    /// The integer that was accepted for the ambiguity at a state.
    pub(super) fn known_integer(&self, state: usize) -> Option<f64> {
        self.channels.as_slice().iter().find(|channel| channel.state == Some(state))?.fixed
    }

    /// Integers for the states of the subset; if they pass all tests they are its values.
    pub(super) fn accept(&mut self, solution: &mut Solution, first: bool) -> Option<Accepted> {
        let work = &mut self.integers;
        let gathered = work.gather(&self.density).and_then(|m| {
            let q = Mat::new(work.covariance.as_flattened(), m, m, C)?;
            let a = work.vector.get(..m).ok_or(IntegerError::Capacity)?;
            Ok((m, integer::resolve(a, q, &Config::default(), &mut work.workspace)?))
        });
        let Ok((m, resolution)) = gathered else {
            solution.reason = Reason::Inconsistent;
            return None;
        };
        work.sets.values.clear();
        for &n in resolution.best {
            let _ = work.sets.values.push(n as f64);
        }
        work.vector.iter_mut().zip(resolution.variances).for_each(|(variance, &found)| *variance = found);
        let found = Found {
            full_success: resolution.success_rate.success,
            norm: resolution.best_norm,
            ratio: resolution.ratio,
            method: resolution.method,
        };
        let sets = &self.integers.sets;
        let confirmed = sets.states.iter().zip(&sets.values).all(|(&state, &n)| self.known_integer(state) == Some(n));
        if first {
            self.adaptive.success = found.full_success;
        }
        self.judge(solution, &found, m, confirmed, first)
    }

    /// Whether `m` integers are believed, whose conditional variances are in the workspace.
    pub(super) fn judge(
        &mut self,
        solution: &mut Solution,
        found: &Found,
        m: usize,
        confirmed: bool,
        first: bool,
    ) -> Option<Accepted> {
        let acceptance = self.config.acceptance;
        let work = &mut self.integers;
        // The distance of the floats from the integers is χ² with m degrees of freedom. Where it is larger, the floats
        // are worse than their covariance says, and so is the success rate; integers that were proven before are not.
        let scatter = (found.norm / m as f64).max(1.0);
        let factor = if confirmed { 1.0 } else { scatter };
        for variance in work.vector.iter_mut().take(m) {
            *variance *= factor;
        }
        let variances = work.vector.get(..m).unwrap_or_default();
        let success_rate = integer::success_rate::bootstrapped(variances).success;
        if first || success_rate > solution.success_rate {
            solution.ratio = found.ratio;
            solution.success_rate = success_rate;
        }
        let (least_success, least_ratio) = if confirmed {
            (acceptance.success_rate_confirmed, acceptance.ratio_confirmed)
        } else {
            (acceptance.success_rate, acceptance.ratio)
        };
        let refused = if success_rate < least_success {
            Some(Reason::SuccessRateLow)
        } else if found.method == Method::Bootstrapped {
            Some(Reason::SearchBudget)
        } else if found.ratio < least_ratio {
            Some(Reason::RatioLow)
        } else {
            None
        };
        if let Some(reason) = refused {
            solution.reason = reason;
            return None;
        }
        solution.ratio = found.ratio;
        solution.success_rate = success_rate;
        Some(Accepted { variance_factor: scatter })
    }

    /// The constrained density: position and velocity given the values of the subset.
    pub(super) fn constrain(&mut self, solution: &mut Solution) -> bool {
        let work = &mut self.integers;
        let m = work.sets.states.len().min(C);
        let kinematic = if self.config.motion.order() > 1 { KINEMATIC } else { 3 };
        let (mut mean, mut covariance) = ([0.0; KINEMATIC], [[0.0; KINEMATIC]; KINEMATIC]);
        let n = self.density.dim();
        let conditioned = (|| {
            condition_on_integers(
                self.density.mean(),
                Mat::new(self.density.covariance_flat(), n, n, N)?,
                &STATES[..kinematic],
                &work.sets.states,
                &work.sets.values,
                &mut MatMut::new(work.covariance.as_flattened_mut(), m, m, C)?,
                &mut MatMut::new(work.cross.as_flattened_mut(), m, kinematic, KINEMATIC)?,
                &mut work.vector[..m],
                &mut mean[..kinematic],
                &mut MatMut::new(covariance.as_flattened_mut(), kinematic, kinematic, KINEMATIC)?,
            )
        })();
        if conditioned.is_err() {
            solution.reason = Reason::Inconsistent;
            return false;
        }
        self.report_conditional(solution, &mean, &covariance, m);
        let revised = self.remember_integers();
        if self.config.estimation.output == Output::DualDensity {
            if revised {
                self.constrained.end();
            }
            self.report_constrained(solution);
        }
        true
    }

    /// Reports position and velocity given `m` integers, as the density of the kinematic states has them.
    pub(super) fn report_conditional(
        &self,
        solution: &mut Solution,
        mean: &[f64; KINEMATIC],
        covariance: &[[f64; KINEMATIC]; KINEMATIC],
        m: usize,
    ) {
        solution.position = self.position + Vector3::new(mean[0], mean[1], mean[2]);
        solution.position_covariance = Matrix3::from_fn(|i, j| covariance[i][j]);
        if self.config.motion.order() > 1 {
            solution.velocity = Vector3::new(mean[3], mean[4], mean[5]);
            solution.velocity_covariance = Matrix3::from_fn(|i, j| covariance[3 + i][3 + j]);
        }
        solution.ambiguities_fixed = m.min(255) as u8;
    }

    /// Notes the accepted integers; true if one of them is another one than before.
    fn remember_integers(&mut self) -> bool {
        let (channels, sets) = (self.channels.as_mut_slice(), &self.integers.sets);
        let mut revised = false;
        for channel in channels.iter_mut() {
            let Some(state) = channel.state else {
                channel.fixed = Some(0.0);
                continue;
            };
            let accepted =
                sets.states.iter().position(|&other| other == state).and_then(|i| sets.values.get(i)).copied();
            revised |= accepted.is_some_and(|n| channel.fixed.is_some_and(|before| before != n));
            channel.fixed = accepted;
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
