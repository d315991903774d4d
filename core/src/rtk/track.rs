//! Keeping track of the channels: births, deaths, cycle slips and outliers.
//!
//! A slip is suspected when a receiver says so, after a gap, when a signal pair changes, when the geometry-free
//! combination of two bands jumps, when the phase contradicts its own Doppler, or when it contradicts the other phases
//! ([`crate::filter::screen`]). It changes the *prior* of the ambiguity: its variance grows by σ_slip² and its mean
//! moves to where the code puts it, while everything else that the filter knows stays (Greiff 2021, eqs. 32-33). If the
//! reference of a group slipped, another channel first becomes the reference, which is exact.

use super::channel::{Channel, GROUPS};
use super::link::Link;
use super::{CODE_BIAS, CONTRADICTED, DISAGREEMENT, RtkFilter};
use crate::filter::mixed_integer::Detector;
use crate::filter::screen::{Row, Screened, screen};
use crate::gnss::satellite::SatelliteId;
use crate::gnss::solution::Solution;
use crate::gnss::time::GpsTime;
use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

/// Degrees of freedom that the estimate of a variance factor remembers.
const MEMORY: f64 = 300.0;

/// Variance of code residuals of good receivers, in units of the configured one, which overbounds it: what matters to the
/// integers is the slow part (multipath), which residuals over an epoch do not show. Geodetic receivers have 0.05 to 0.2,
/// a patch antenna on a cheap receiver 0.8.
const USUAL_CODE: f64 = 0.25;
/// The same for phases: 0.01 to 0.1 with geodetic antennas, 0.3 on a walk under trees.
pub(super) const USUAL_PHASE: f64 = 0.06;

/// Longest step over which a phase is predicted by Doppler `[s]`; beyond it changes of acceleration matter.
const MAX_DOPPLER_STEP: f64 = 2.0;
/// Standard deviations of a Doppler, held for the whole step, that a phase may differ from its prediction.
const DOPPLER_SIGMAS: f64 = 5.0;

/// How much noisier one kind of observation is than configured, from its own residuals: a running mean of χ² per degree
/// of freedom.
#[derive(Clone, Copy, Debug)]
pub(super) struct VarianceFactor {
    mean: f64,
    degrees_of_freedom: f64,
}

impl VarianceFactor {
    /// As configured, until residuals say otherwise.
    pub const NOMINAL: Self = Self { mean: 1.0, degrees_of_freedom: 2.0 };

    /// The first epochs count by their degrees of freedom, later ones by the memory.
    fn learn(&mut self, outcome: Screened) {
        if outcome.degrees_of_freedom > 0 {
            let dof = outcome.degrees_of_freedom as f64;
            self.degrees_of_freedom = (self.degrees_of_freedom + dof).min(MEMORY);
            self.mean += (outcome.chi_square / dof - self.mean) * dof / self.degrees_of_freedom;
        }
    }

    /// The factor for a kind of observation whose residuals are normally `usual` times as large (in variance) as
    /// configured; at least 1, because residuals cannot show what all satellites or epochs have in common.
    pub fn above(&self, usual: f64) -> f64 {
        (self.mean / usual).max(1.0)
    }
}

/// When a code was last used, whatever its phase did.
#[derive(Clone, Copy, Debug)]
pub(super) struct CodeUse {
    satellite: SatelliteId,
    slot: usize,
    last_used: GpsTime,
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Remembers losses of lock of rover signals, whether or not this epoch will use them.
    pub(super) fn note_slips(&mut self) {
        for channel in self.channels.as_mut_slice() {
            let signal = channel.signals[0];
            let observation =
                self.observations.iter().find(|o| o.satellite == channel.satellite && o.signal.band() == signal.band());
            channel.slip_pending |= observation.is_some_and(|o| o.loss_of_lock);
        }
    }

    /// Matches links and channels, deals with slips and outliers of the phase, and lets new ambiguities be born.
    pub(super) fn track(&mut self, time: GpsTime, solution: &mut Solution) {
        self.forget_old(time);
        for link in &mut self.links {
            link.channel = self.channels.find(link.satellite, link.slot).filter(|_| link.phase.is_some());
        }
        self.suspect(time);
        self.check_geometry_free();
        self.check_doppler(time);
        self.reopen();
        self.screen_phase(solution);
        self.reopen();
        for link in self.links.iter().filter(|link| link.slipped) {
            solution.satellites_slipped.insert(link.satellite);
        }
        self.welcome(time);
    }

    fn forget_old(&mut self, time: GpsTime) {
        let forget = self.config.screening.forget;
        while let Some(old) = self.channels.as_slice().iter().position(|channel| time.since(channel.last_seen) > forget)
        {
            self.channels.remove(&mut self.density, old);
        }
    }

    /// Slips that the receivers report, or that a gap makes possible.
    fn suspect(&mut self, time: GpsTime) {
        let step = self.time.map_or(0.0, |before| time.since(before));
        let max_gap = self.config.screening.max_gap.max(1.5 * step);
        for link in &mut self.links {
            let Some(channel) = link.channel.and_then(|i| self.channels.as_slice().get(i)) else { continue };
            link.slipped = link.loss_of_lock
                || channel.slip_pending
                || channel.half_cycle != link.half_cycle
                || channel.signals != link.signals
                || time.since(channel.last_seen) > max_gap;
        }
    }

    /// Two bands of a satellite whose difference jumped between consecutive epochs: either may have slipped.
    fn check_geometry_free(&mut self) {
        let Some(before) = self.time else { return };
        let limit = self.config.screening.geometry_free;
        for i in 0..self.links.len() {
            for j in 0..i {
                if self.links[i].satellite != self.links[j].satellite {
                    continue;
                }
                let change = |k: usize| {
                    let link = &self.links[k];
                    let channel = self.channels.as_slice().get(link.channel?)?;
                    (channel.last_seen == before && !link.slipped).then_some(())?;
                    Some(link.phase? - channel.wavelength * channel.offset - channel.phase)
                };
                if let (Some(a), Some(b)) = (change(i), change(j))
                    && libm::fabs(a - b) > limit
                {
                    self.links[i].slipped = true;
                    self.links[j].slipped = true;
                }
            }
        }
    }

    /// Rover phases that moved otherwise than their own Doppler says, beyond what all have in common (the clock).
    fn check_doppler(&mut self, time: GpsTime) {
        let Some(before) = self.time else { return };
        let step = time.since(before);
        if step > MAX_DOPPLER_STEP {
            return;
        }
        let jump = |link: &Link| {
            let channel = self.channels.as_slice().get(link.channel?)?;
            (channel.last_seen == before && !link.slipped).then_some(())?;
            Some(link.carrier?.jump_since(&channel.carrier?, step))
        };
        let mut jumps: Vec<f64, C> = Vec::new();
        for jump in self.links.iter().filter_map(jump).filter(|jump| jump.is_finite()) {
            let _ = jumps.push(jump);
        }
        jumps.sort_unstable_by(f64::total_cmp);
        // Fewer than three have no majority.
        let (Some(&common), true) = (jumps.get(jumps.len() / 2), jumps.len() > 2) else { return };
        for link in &mut self.links {
            let limit = DOPPLER_SIGMAS * libm::sqrt(link.doppler_variance) * step
                + self.config.screening.slip * link.wavelength;
            link.slipped |= jump(link).is_some_and(|jump| libm::fabs(jump - common) > limit);
        }
    }

    /// Marks the phases that contradict the others: as slips where the error is that large, else as outliers.
    fn screen_phase(&mut self, solution: &mut Solution) {
        self.rows.clear();
        for link in &self.links {
            let channel = link.channel.and_then(|i| self.channels.as_slice().get(i));
            let settled = channel.filter(|channel| channel.lock > 0 && !link.slipped);
            let innovation = settled.zip(link.phase).map(|(channel, phase)| {
                phase - channel.wavelength * channel.offset + channel.unit() * self.ambiguity(channel)
            });
            let row = Row {
                gradient: -link.direction,
                group: settled.map_or(0, Channel::group),
                innovation: innovation.unwrap_or(0.0),
                // The float ambiguity carries the noise of the epochs before.
                variance: 2.0 * link.phase_variance,
                excluded: innovation.is_none(),
                error: 0.0,
            };
            // Capacity is that of the links.
            let _ = self.rows.push(row);
        }
        let detector = self.config.estimation.detector;
        if detector == Detector::Projection {
            self.project_slips();
        }
        let examined = self.rows.iter().filter(|row| !row.excluded).count();
        let information = self.information(0);
        let outcome = screen(&mut self.rows, &information, self.config.screening.outlier);
        self.phase_factor.learn(outcome);
        if detector != Detector::Weighted {
            return;
        }
        // If most contradict each other there is no telling who is right.
        let hopeless = 2 * outcome.outliers > examined;
        for (link, row) in self.links.iter_mut().zip(&self.rows).filter(|(_, row)| row.error != 0.0 || hopeless) {
            if hopeless || libm::fabs(row.error) > self.config.screening.slip * link.wavelength {
                link.slipped = link.channel.is_some();
            } else {
                link.phase_rejected = true;
                solution.satellites_rejected.insert(link.satellite);
            }
        }
    }

    /// The paper's detector: δn is the innovation of a double difference in cycles, whatever its predicted covariance
    /// (Greiff 2021, eq. 31).
    fn project_slips(&mut self) {
        let channels = self.channels.as_slice();
        for group in 0..GROUPS {
            let of_group = |(_, row): &(&Link, &Row)| !row.excluded && row.group == group;
            let is_reference = |(link, _): &(&Link, &Row)| {
                link.channel.and_then(|i| channels.get(i)).is_some_and(|channel| channel.state.is_none())
            };
            let reference = self.links.iter().zip(&self.rows).filter(of_group).find(is_reference);
            let Some(reference) = reference.map(|(_, row)| row.innovation) else { continue };
            for (link, row) in
                self.links.iter_mut().zip(&self.rows).filter(|(_, row)| !row.excluded && row.group == group)
            {
                let jump = (reference - row.innovation) / link.wavelength;
                link.slipped |= libm::fabs(jump) > self.config.estimation.threshold;
            }
        }
    }

    /// The rows of all codes, for screening.
    fn collect_codes(&mut self) {
        self.rows.clear();
        for link in &self.links {
            let _ = self.rows.push(Row {
                gradient: -link.direction,
                group: super::channel::group(link.satellite.constellation(), link.slot),
                innovation: link.code.unwrap_or(0.0),
                variance: link.code_variance,
                excluded: link.code.is_none(),
                error: 0.0,
            });
        }
    }

    /// Marks the codes that contradict the others.
    /// False if most do: then it is the predicted position that is wrong.
    pub(super) fn screen_code(&mut self, solution: &mut Solution) -> bool {
        if self.is_contradicted(solution.time) {
            return false;
        }
        self.collect_codes();
        let information = self.information(0);
        let examined = self.rows.iter().filter(|row| !row.excluded).count();
        let outcome = screen(&mut self.rows, &information, self.config.screening.outlier);
        if 2 * outcome.outliers > examined {
            return false;
        }
        self.code_factor.learn(outcome);
        for (link, _) in self.links.iter_mut().zip(&self.rows).filter(|(_, row)| row.error != 0.0) {
            link.code_rejected = true;
            solution.satellites_rejected.insert(link.satellite);
        }
        // Correlated noise: after the first use of a code, information accrues at 1/2τ and not once an epoch.
        let (time, correlation) = (solution.time, 2.0 * self.config.code_correlation);
        self.codes.retain(|code| time.since(code.last_used) < correlation);
        for link in self.links.iter_mut().filter(|link| link.code.is_some() && !link.code_rejected) {
            link.code_variance *= self.code_factor.above(USUAL_CODE);
            let is_same = |code: &&mut CodeUse| code.satellite == link.satellite && code.slot == link.slot;
            match self.codes.iter_mut().find(is_same) {
                Some(code) => {
                    link.code_variance *= correlation / time.since(code.last_used);
                    code.last_used = time;
                }
                // A code without room here counts as news.
                None => {
                    let _ = self.codes.push(CodeUse { satellite: link.satellite, slot: link.slot, last_used: time });
                }
            }
        }
        true
    }

    /// Whether the codes alone have put the rover elsewhere for so long that multipath is no explanation. The screening
    /// with the predicted position cannot see it: a wrong position that is far enough off, and sure enough of itself,
    /// looks like noisy codes.
    fn is_contradicted(&mut self, time: GpsTime) -> bool {
        self.collect_codes();
        let alone = screen(&mut self.rows, &Matrix3::zeros(), self.config.screening.outlier);
        let factor = (alone.chi_square / alone.degrees_of_freedom.max(1) as f64).max(1.0);
        let variance: f64 = (0..3).map(|i| self.density.covariance(i, i) + factor * alone.covariance[(i, i)]).sum();
        // Three of the rows make a position, the rest have to confirm it.
        let certain = alone.degrees_of_freedom > 4 && alone.outliers < alone.degrees_of_freedom / 2;
        let apart = alone.delta.norm() > DISAGREEMENT * libm::sqrt(variance) + CODE_BIAS;
        let since = self.contradicted_since.filter(|_| certain && apart);
        self.contradicted_since = (certain && apart).then_some(since.unwrap_or(time));
        since.is_some_and(|since| time.since(since) > CONTRADICTED)
    }

    /// Leaves out the Doppler of satellites that contradict the others.
    pub(super) fn screen_doppler(&mut self) {
        if self.config.motion.order() < 2 {
            return;
        }
        let velocity = Vector3::from_fn(|i, _| self.density.mean().get(3 + i).copied().unwrap_or(0.0));
        self.rows.clear();
        for link in &self.links {
            let _ = self.rows.push(Row {
                gradient: -link.direction,
                group: 0,
                innovation: link.doppler.map_or(0.0, |rate| rate + link.direction.dot(&velocity)),
                variance: link.doppler_variance,
                excluded: link.doppler.is_none(),
                error: 0.0,
            });
        }
        let information = self.information(3);
        screen(&mut self.rows, &information, self.config.screening.outlier);
        for (link, _) in self.links.iter_mut().zip(&self.rows).filter(|(_, row)| row.excluded) {
            link.doppler = None;
        }
    }

    /// Inverse of the covariance of the predicted position (first = 0) or velocity (3).
    fn information(&self, first: usize) -> Matrix3<f64> {
        let covariance: Matrix3<f64> = Matrix3::from_fn(|i, j| self.density.covariance(first + i, first + j));
        covariance.try_inverse().unwrap_or_else(Matrix3::zeros)
    }

    /// The float ambiguity of a channel, in units of its state.
    pub(super) fn ambiguity(&self, channel: &Channel) -> f64 {
        channel.state.and_then(|state| self.density.mean().get(state)).copied().unwrap_or(0.0)
    }

    /// Phase minus code of a link, in metres, less `offset` cycles; none where the code was rejected.
    fn phase_minus_code(&self, index: usize, offset: f64) -> Option<f64> {
        let link = self.links.get(index)?;
        Some(link.phase? - link.code.filter(|_| !link.code_rejected)? - link.wavelength * offset)
    }

    /// Phase minus code of the reference of a group, in metres: from all settled channels of the group if there are
    /// any, else from the reference itself.
    fn reference_phase_minus_code(&self, group: usize) -> Option<f64> {
        let (mut sum, mut count, mut reference) = (0.0, 0.0, None);
        for (index, link) in self.links.iter().enumerate() {
            let Some(channel) = link.channel.and_then(|i| self.channels.as_slice().get(i)) else { continue };
            if channel.group() != group {
                continue;
            }
            let Some(b) = self.phase_minus_code(index, channel.offset) else { continue };
            if channel.state.is_none() {
                reference = Some(b);
            }
            if channel.lock > 0 && !link.slipped {
                sum += b + channel.unit() * self.ambiguity(channel);
                count += 1.0;
            }
        }
        if count > 0.0 { Some(sum / count) } else { reference }
    }

    /// Widens the prior of every slipped channel that has not been dealt with.
    fn reopen(&mut self) {
        let sigma = self.config.screening.sigma_slip;
        for group in 0..GROUPS {
            let slipped = |index: usize| {
                self.links.iter().any(|link| link.channel == Some(index) && link.slipped && !link.reopened)
            };
            let Some(reference) = self.channels.reference(group) else { continue };
            if slipped(reference)
                && let Some(heir) = self.channels.best_reference(group, |i, channel| !slipped(i) && channel.lock > 0)
            {
                self.channels.make_reference(&mut self.density, heir);
            }
            let anchor = self.reference_phase_minus_code(group);
            for index in 0..self.links.len() {
                self.reopen_channel(index, group, anchor, sigma);
            }
        }
    }

    /// Widens the prior of the channel of a link, if it slipped and is of the group; `anchor` is the group's phase minus
    /// code `[m]`.
    fn reopen_channel(&mut self, index: usize, group: usize, anchor: Option<f64>, sigma: f64) {
        let Some(&link) = self.links.get(index).filter(|link| link.slipped && !link.reopened) else { return };
        let Some(i) = link.channel else { return };
        let Some(&channel) = self.channels.as_slice().get(i).filter(|channel| channel.group() == group) else { return };
        let jump = anchor.zip(self.phase_minus_code(index, channel.offset)).map(|(anchor, b)| {
            // The jump that the code suggests, in whole cycles where the ambiguity is whole.
            let jump = (anchor - b) / channel.unit() - self.ambiguity(&channel);
            if channel.is_integer() { libm::round(jump) } else { jump }
        });
        let arc = self.channels.new_arc();
        let (Some(link), Some(tracked)) = (self.links.get_mut(index), self.channels.as_mut_slice().get_mut(i)) else {
            return;
        };
        if let Some(state) = channel.state {
            let Some(jump) = jump else {
                // Without a code there is no telling where the ambiguity went: the phase waits for one.
                link.phase = None;
                tracked.slip_pending = true;
                return;
            };
            let variance = sigma * channel.wavelength / channel.unit();
            self.density.inflate(state, variance * variance);
            if let Some(mean) = self.density.mean_mut().get_mut(state) {
                *mean += jump;
            }
        }
        link.reopened = true;
        tracked.arc = arc;
        tracked.lock = 0;
        tracked.fixed = None;
        tracked.slip_pending = false;
        tracked.signals = link.signals;
        tracked.half_cycle = link.half_cycle;
    }

    /// Births: a channel for every link with a phase that has none.
    fn welcome(&mut self, time: GpsTime) {
        for index in 0..self.links.len() {
            let Some(&link) = self.links.get(index) else { continue };
            let (None, Some(_)) = (link.channel, link.phase) else { continue };
            let mut channel = Channel {
                satellite: link.satellite,
                slot: link.slot,
                signals: link.signals,
                wavelength: link.wavelength,
                offset: 0.0,
                state: None,
                last_seen: time,
                lock: 0,
                slip_pending: false,
                half_cycle: link.half_cycle,
                sin_elevation: link.sin_elevation,
                phase: 0.0,
                carrier: None,
                fixed: None,
                arc: 0,
            };
            // Without a code there is nothing to start from; the phase waits for one.
            let Some(b) = self.phase_minus_code(index, 0.0) else { continue };
            let anchor = self.reference_phase_minus_code(channel.group()).unwrap_or(0.0);
            channel.offset = libm::round((b - anchor) / channel.wavelength);
            let mean = (anchor - (b - channel.wavelength * channel.offset)) / channel.unit();
            let sigma = self.config.screening.sigma_slip * channel.wavelength / channel.unit();
            channel.arc = self.channels.new_arc();
            // A channel without room is not tracked: its code still serves.
            let added = self.channels.add(&mut self.density, channel, mean, sigma * sigma).ok();
            if let Some(link) = self.links.get_mut(index) {
                link.channel = added;
            }
        }
    }

    /// After the update: what the channels remember of this epoch, and who took part.
    pub(super) fn settle(&mut self, time: GpsTime, solution: &mut Solution) {
        for link in &self.links {
            if link.code.is_some() && !link.code_rejected {
                solution.satellites_used.insert(link.satellite);
            }
            let (Some(phase), Some(i)) = (link.phase, link.channel) else { continue };
            let Some(channel) = self.channels.as_mut_slice().get_mut(i) else { continue };
            channel.last_seen = time;
            channel.slip_pending = false;
            channel.half_cycle = link.half_cycle;
            channel.sin_elevation = link.sin_elevation;
            channel.phase = phase - channel.wavelength * channel.offset;
            channel.carrier = link.carrier;
            if !link.phase_rejected {
                channel.lock = channel.lock.saturating_add(1);
                solution.satellites_used.insert(link.satellite);
            }
        }
        self.report_relaxed(solution);
    }
}
