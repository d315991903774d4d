//! Measurement noise that follows the data, signal by signal.
//!
//! Each signal has a ratio of its code's and of its phase's variance to the configured one, R* = D^½ R₀ D^½, estimated from
//! residuals after the update ([`crate::filter::adaptive::ratio`]):
//! ```text
//! d ← (1 − β) d + β [(rᵢ − r̄)²/R₀ + f d],     f = ((hᵢ − h̄) P⁺ (hᵢ − h̄)ᵀ + 1/W)/R
//! ```
//! with the common term c of the group free, c | x ~ N(r̄, 1/W), means weighted by 1/R over the group. f is the share of the
//! noise that the residual does not show; R, the variance that the filter uses, overbounds that of single codes, whose
//! noise is correlated in time, so that f times the noise estimated so far, d R₀, and not the spread itself, completes the
//! residual (the two are the same where R = d R₀, as for phases). So a satellite that
//! comes, goes, or gives the reference to another changes nothing for the rest, and a new one begins with 1. All noise
//! stays positive by construction.
//!
//! Cost for a group of g signals: 4 g (3 + g) multiply-adds. Memory: 80 bytes for each signal, in the filter and not on the
//! stack. Panic contract: none.

use super::RtkFilter;
use super::channel::{GROUPS, group};
use super::config::{Adaptation, Scope};
use super::link::Link;
use super::rows;
use crate::filter::adaptive::forgetting::Beta;
use crate::filter::adaptive::ratio::blend;
use crate::gnss::satellite::SatelliteId;
use crate::gnss::time::GpsTime;
use heapless::Vec;

/// A signal's ratios, and when it was last seen.
#[derive(Clone, Copy, Debug)]
struct Ratio {
    satellite: SatelliteId,
    slot: usize,
    /// Of code and phase.
    ratios: [f32; 2],
    last_seen: GpsTime,
}

/// What was learned.
pub(super) struct Adaptive<const C: usize> {
    signals: Vec<Ratio, C>,
    beta: Beta,
    epochs: u32,
    /// Ratios of all codes and of all phases.
    types: [f32; 2],
    /// Success rate of all ambiguities of the latest epoch.
    pub success: f64,
    /// Workspace: the rows of a group.
    rows: Vec<GroupRow, C>,
}

impl<const C: usize> Adaptive<C> {
    pub const fn new() -> Self {
        Self { signals: Vec::new(), beta: Beta::new(1.0), epochs: 0, types: [1.0; 2], success: 0.0, rows: Vec::new() }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    /// Multiplies the variances of links by what was learned of their signals.
    pub fn apply(&self, config: &Adaptation, links: &mut [Link]) {
        if !config.enabled || self.epochs < config.warm_up {
            return;
        }
        for link in links {
            if config.scope == Scope::Type {
                let [code, phase] = self.types.map(f64::from);
                link.code_variance *= code;
                link.phase_variance *= phase;
                continue;
            }
            let same = |signal: &&Ratio| signal.satellite == link.satellite && signal.slot == link.slot;
            if let Some(signal) = self.signals.iter().find(same) {
                let [code, phase] = signal.ratios.map(f64::from);
                link.code_variance *= code;
                link.phase_variance *= phase;
            }
        }
    }

    /// The ratios of a signal, made if need be; none without room.
    fn entry(&mut self, satellite: SatelliteId, slot: usize, time: GpsTime) -> Option<&mut Ratio> {
        let found = self.signals.iter().position(|signal| signal.satellite == satellite && signal.slot == slot);
        let place = match found {
            Some(place) => place,
            None => {
                self.signals.push(Ratio { satellite, slot, ratios: [1.0; 2], last_seen: time }).ok()?;
                self.signals.len() - 1
            }
        };
        let entry = self.signals.get_mut(place)?;
        entry.last_seen = time;
        Some(entry)
    }
}

/// One row of a group: its link, state and coefficient of its ambiguity, what the density leaves of it, and (P h̄) along its
/// ambiguity.
#[derive(Clone, Copy, Debug)]
struct GroupRow {
    link: u8,
    ambiguity: Option<(u8, f64)>,
    residual: f64,
    along: f64,
}

impl GroupRow {
    /// States and coefficients.
    fn entries(&self, link: &Link) -> impl Iterator<Item = (usize, f64)> + use<> {
        let [x, y, z] = [0, 1, 2].map(|axis| (axis, -link.direction[axis]));
        [x, y, z].into_iter().chain(self.ambiguity.map(|(state, h)| (usize::from(state), h)))
    }
}

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Learns from the residuals of an update.
    pub(super) fn adapt(&mut self, time: GpsTime) {
        let config = self.config.adaptation;
        if !config.enabled {
            return;
        }
        let forget = self.config.screening.forget;
        self.adaptive.signals.retain(|signal| time.since(signal.last_seen) <= forget);
        let success = self.adaptive.success;
        let beta = self.adaptive.beta.next(&config.forgetting, success);
        self.adaptive.epochs = self.adaptive.epochs.saturating_add(1);
        for kind in 0..2 {
            let (mut sum, mut count) = (0.0, 0.0);
            for group in 0..GROUPS {
                let (more, rows) = self.adapt_group(&config, kind, group, beta, time);
                sum += more;
                count += rows;
            }
            if let Some(ratio) = self.adaptive.types.get_mut(kind).filter(|_| count > 0.0) {
                *ratio = blend(f64::from(*ratio), beta, sum / count, config.bounds) as f32;
            }
        }
    }

    /// Learns from the codes (0) or phases (1) of a group; returns the sum of what is blended in, for all of a type, and
    /// their number.
    fn adapt_group(&mut self, config: &Adaptation, kind: usize, of: usize, beta: f64, time: GpsTime) -> (f64, f64) {
        let apart = self.position - self.linearized;
        let of_type = self.adaptive.types.get(kind).map_or(1.0, |ratio| f64::from(*ratio));
        let Self { links, channels, density, adaptive, .. } = self;
        adaptive.rows.clear();
        let variance = |link: &Link| if kind == 0 { link.code_variance } else { link.phase_variance };
        for (i, link) in links.iter().enumerate() {
            if group(link.satellite.constellation(), link.slot) != of {
                continue;
            }
            let one = core::slice::from_ref(link);
            let found = if kind == 0 {
                rows::code(one, of).next().map(|row| (row, None))
            } else {
                let row = rows::phase(one, channels.as_slice(), of).next();
                row.map(|(row, channel)| (row, channel.state.map(|state| (state as u8, -channel.unit()))))
            };
            let Some((row, ambiguity)) = found else { continue };
            let mut group_row = GroupRow { link: i as u8, ambiguity, residual: 0.0, along: 0.0 };
            let known = |(state, h): (usize, f64)| match apart.get(state) {
                Some(apart) => h * apart,
                None => h * density.mean().get(state).copied().unwrap_or(0.0),
            };
            group_row.residual = row.value - group_row.entries(link).map(known).sum::<f64>();
            let _ = adaptive.rows.push(group_row);
        }
        if adaptive.rows.len() < 2 {
            return (0.0, 0.0);
        }
        let each = |rows: &[GroupRow], value: &dyn Fn(&GroupRow, &Link) -> f64| -> f64 {
            let terms = rows.iter().filter_map(|row| {
                let link = links.get(usize::from(row.link))?;
                Some(value(row, link) / variance(link))
            });
            terms.sum()
        };
        let weights = each(&adaptive.rows, &|_, _| 1.0);
        let mean = each(&adaptive.rows, &|row, _| row.residual) / weights;
        // (P h̄) at a state, h̄ being the weighted mean of all rows.
        let mean_row = |rows: &[GroupRow], state: usize| {
            let along =
                |row: &GroupRow, link: &Link| row.entries(link).map(|(i, h)| h * density.covariance(state, i)).sum();
            each(rows, &along) / weights
        };
        let axes: [f64; 3] = core::array::from_fn(|axis| mean_row(&adaptive.rows, axis));
        for i in 0..adaptive.rows.len() {
            let state = adaptive.rows.get(i).and_then(|row| row.ambiguity).map(|(state, _)| usize::from(state));
            let along = state.map_or(0.0, |state| mean_row(&adaptive.rows, state));
            if let Some(row) = adaptive.rows.get_mut(i) {
                row.along = along;
            }
        }
        let along = |row: &GroupRow, link: &Link| -> f64 {
            row.entries(link).map(|(state, h)| h * axes.get(state).copied().unwrap_or(row.along)).sum()
        };
        let middle = each(&adaptive.rows, &along) / weights;
        let mut sum = 0.0;
        for i in 0..adaptive.rows.len() {
            let Some(&row) = adaptive.rows.get(i) else { break };
            let Some(link) = links.get(usize::from(row.link)) else { continue };
            let mut square = 0.0;
            for (i, a) in row.entries(link) {
                for (j, b) in row.entries(link) {
                    square += a * b * density.covariance(i, j);
                }
            }
            let spread = square - 2.0 * along(&row, link) + middle + 1.0 / weights;
            let error = row.residual - mean;
            let hidden = (spread / variance(link)).clamp(0.0, 1.0);
            let configured = if kind == 0 { link.single_code_variance } else { link.single_phase_variance };
            let seen = error * error / configured;
            sum += seen + hidden * of_type;
            if let Some(entry) = adaptive.entry(link.satellite, link.slot, time)
                && let Some(ratio) = entry.ratios.get_mut(kind)
            {
                let before = f64::from(*ratio);
                *ratio = blend(before, beta, seen + hidden * before, config.bounds) as f32;
            }
        }
        (sum, adaptive.rows.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::super::RtkConfig;
    use super::super::preset::Rtk32;
    use super::super::sky::{BASE, ROVER, Sky, start};
    use super::*;
    use crate::gnss::epoch::EpochView;
    use crate::gnss::geodesy::Geodetic;
    use crate::gnss::solution::Solution;
    use nalgebra::Vector3;

    /// A rover at rest, 300 m from its base. `spoil` changes the sky before each epoch.
    fn run(adaptation: Adaptation, epochs: u32, mut spoil: impl FnMut(u32, &mut Sky)) -> (Box<Rtk32>, Solution) {
        let mut sky = Sky::new(&["1C", "2W"]);
        let base = Geodetic { latitude: 0.85, longitude: 0.2, height: 200.0 }.to_ecef();
        let rover = base + Vector3::new(100.0, 250.0, -130.0);
        let mut filter = Box::new(Rtk32::new(RtkConfig { adaptation, ..RtkConfig::DEFAULT }, Some(base)));
        sky.ephemerides.iter().for_each(|&ephemeris| filter.push_ephemeris(ephemeris));
        let mut last = None;
        for epoch in 0..epochs {
            spoil(epoch, &mut sky);
            let time = start().plus_seconds(f64::from(epoch));
            let observations = sky.observe(BASE, time, base, Vector3::zeros());
            filter.push_base(EpochView { time, observations: &observations });
            let observations = sky.observe(ROVER, time, rover, Vector3::zeros());
            last = Some(filter.push_rover(EpochView { time, observations: &observations }));
        }
        (filter, last.unwrap())
    }

    const ON: Adaptation = Adaptation { enabled: true, ..Adaptation::DEFAULT };

    /// Simulated noise, 0.3 m and 2 mm, is less than the configured one, which overbounds: ratios stay near 1 (first epochs
    /// say little more than the prior), and the position within a millimetre of that of the plain filter.
    #[test]
    fn what_is_no_noisier_than_configured_is_left_alone() {
        let (_, plain) = run(Adaptation::DEFAULT, 60, |_, _| ());
        for scope in [Scope::Channel, Scope::Type] {
            let (filter, adapted) = run(Adaptation { scope, ..ON }, 60, |_, _| ());
            assert_eq!(adapted.quality, plain.quality);
            assert!((adapted.position - plain.position).norm() < 1e-3, "{scope:?}");
            let signals = &filter.adaptive.signals;
            assert!(signals.len() > 8);
            assert!(signals.iter().flat_map(|signal| signal.ratios).all(|r| (1.0..1.3).contains(&r)), "{signals:?}");
            assert!(filter.adaptive.types.iter().all(|r| (1.0..1.3).contains(r)), "{:?}", filter.adaptive.types);
        }
    }

    /// One satellite's codes jump by ±2.5 m: their ratio grows, those of the others hardly.
    #[test]
    fn a_noisy_satellite_is_found() {
        let (_, first) = run(ON, 2, |_, _| ());
        let noisy = first.satellites_used.iter().nth(3).unwrap();
        let (filter, _) = run(ON, 90, |epoch, sky| {
            let error = if epoch % 2 == 0 { 2.5 } else { -2.5 };
            sky.code_errors.insert((ROVER, noisy), error);
        });
        let signals = &filter.adaptive.signals;
        let of =
            |is_noisy: bool| signals.iter().filter(move |s| (s.satellite == noisy) == is_noisy).map(|s| s.ratios[0]);
        let (least_noisy, most_quiet) = (of(true).fold(f32::INFINITY, f32::min), of(false).fold(0.0, f32::max));
        assert_eq!(of(true).count(), 2);
        assert!(least_noisy > 1.5 && most_quiet < 1.05, "{least_noisy} {most_quiet} {signals:?}");
    }

    #[test]
    fn a_restart_forgets_and_satellites_that_set_are_forgotten() {
        let (mut filter, _) = run(ON, 40, |_, _| ());
        assert!(!filter.adaptive.signals.is_empty() && filter.adaptive.epochs == 40);
        filter.configure(RtkConfig { adaptation: ON, ..RtkConfig::DEFAULT });
        assert!(filter.adaptive.signals.is_empty() && filter.adaptive.epochs == 0);
    }
}
