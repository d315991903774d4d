//! Whether a receiver tracks the phase of a signal, and with which ambiguity: locks, cycle slips, half cycles.

use super::scenario::Slips;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use surefix_core::gnss::satellite::SatelliteId;
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::GpsTime;

/// Why an ambiguity changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// A cycle slip while tracking.
    Slip,
    /// Half a cycle, not resolved for a while.
    HalfCycle,
    /// The half cycle was resolved.
    HalfCycleResolved,
    /// The signal was lost and acquired again.
    Reacquired,
}

/// A change of an ambiguity, the truth that a slip detector is to find.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbiguityChange {
    /// First epoch with the new ambiguity.
    pub time: GpsTime,
    /// Whose.
    pub satellite: SatelliteId,
    /// Which signal's.
    pub signal: Signal,
    /// New minus old ambiguity `[cycles]`.
    pub cycles: f64,
    /// Whether the receiver raised its loss-of-lock indicator.
    pub flagged: bool,
    /// Why.
    pub change: Change,
}

/// The phase of a tracked signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracked {
    /// Ambiguity `[cycles]`.
    pub cycles: f64,
    /// Loss-of-lock indicator.
    pub loss_of_lock: bool,
    /// Half-cycle indicator.
    pub half_cycle: bool,
}

/// The tracking loop of one signal of one satellite.
#[derive(Clone, Debug)]
pub struct Tracker {
    satellite: SatelliteId,
    signal: Signal,
    rng: ChaCha8Rng,
    cycles: f64,
    /// Latest epoch with lock.
    last: Option<GpsTime>,
    /// Whether the signal has been lost since.
    lost: bool,
    /// When and by how much a half cycle will be resolved.
    half_cycle: Option<(GpsTime, f64)>,
}

impl Tracker {
    /// A loop that has not seen its signal yet.
    pub fn new(satellite: SatelliteId, signal: Signal, rng: ChaCha8Rng) -> Self {
        Self { satellite, signal, rng, cycles: 0.0, last: None, lost: false, half_cycle: None }
    }

    /// An epoch at which the signal cannot be seen.
    pub fn lose(&mut self) {
        self.lost = true;
    }

    /// An epoch at which it can: what is tracked. Changes of the ambiguity are added to `changes`.
    pub fn track(&mut self, time: GpsTime, slips: &Slips, changes: &mut Vec<AmbiguityChange>) -> Tracked {
        let mut flagged = false;
        match self.last {
            None => self.cycles = self.any_integer(),
            Some(_) if self.lost => {
                let step = self.any_integer() - self.cycles;
                self.half_cycle = None;
                flagged = true;
                self.change(time, step, true, Change::Reacquired, changes);
            }
            Some(last) => {
                if let Some((_, step)) = self.half_cycle.filter(|&(at, _)| time >= at) {
                    self.half_cycle = None;
                    flagged = true;
                    self.change(time, step, true, Change::HalfCycleResolved, changes);
                }
                let probability = 1.0 - (-slips.per_hour * time.since(last) / 3_600.0).exp();
                if self.rng.random_bool(probability.clamp(0.0, 1.0)) {
                    flagged |= self.slip(time, slips, changes);
                }
            }
        }
        (self.last, self.lost) = (Some(time), false);
        Tracked { cycles: self.cycles, loss_of_lock: flagged, half_cycle: self.half_cycle.is_some() }
    }

    /// A slip; whether it is flagged.
    fn slip(&mut self, time: GpsTime, slips: &Slips, changes: &mut Vec<AmbiguityChange>) -> bool {
        let sign = if self.rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let size = f64::from(self.rng.random_range(1..=slips.largest.max(1)));
        let flagged = !self.rng.random_bool(slips.unflagged);
        let half = self.rng.random_bool(slips.half_cycle) && self.half_cycle.is_none();
        if half {
            self.half_cycle = Some((time.plus_seconds(slips.half_cycle_s), -0.5 * sign));
            self.change(time, 0.5 * sign, flagged, Change::HalfCycle, changes);
        } else {
            self.change(time, sign * size, flagged, Change::Slip, changes);
        }
        flagged
    }

    fn change(&mut self, time: GpsTime, cycles: f64, flagged: bool, change: Change, to: &mut Vec<AmbiguityChange>) {
        self.cycles += cycles;
        to.push(AmbiguityChange { time, satellite: self.satellite, signal: self.signal, cycles, flagged, change });
    }

    fn any_integer(&mut self) -> f64 {
        f64::from(self.rng.random_range(-1_000_000..=1_000_000))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    const SLIPS: Slips = Slips { per_hour: 60.0, largest: 3, unflagged: 0.25, half_cycle: 0.2, half_cycle_s: 5.0 };

    fn tracker() -> Tracker {
        Tracker::new("G05".parse().unwrap(), "1C".parse().unwrap(), ChaCha8Rng::seed_from_u64(3))
    }

    fn at(seconds: i32) -> GpsTime {
        GpsTime::from_week_tow(2400, f64::from(seconds))
    }

    #[test]
    fn slips_come_as_often_and_as_large_as_configured() {
        let (mut tracker, mut changes) = (tracker(), Vec::new());
        let mut cycles = Vec::new();
        for k in 0..200_000 {
            cycles.push(tracker.track(at(k), &SLIPS, &mut changes).cycles);
        }
        // Every change of the phase is in the list, and nothing else.
        let total: f64 = changes.iter().map(|change| change.cycles).sum();
        assert_eq!(cycles.last().unwrap() - cycles[0], total);
        let slips: Vec<_> = changes.iter().filter(|change| change.change != Change::HalfCycleResolved).collect();
        // 200 000 s at 60 an hour: 3333 ± 58.
        assert!((3150..3520).contains(&slips.len()), "{}", slips.len());
        let fraction = |keep: fn(&AmbiguityChange) -> bool| {
            slips.iter().filter(|change| keep(change)).count() as f64 / slips.len() as f64
        };
        assert!((fraction(|change| !change.flagged) - 0.25).abs() < 0.03);
        // Half cycles that would overlap become whole ones, hence a little below 0.2.
        assert!((0.15..0.23).contains(&fraction(|change| change.change == Change::HalfCycle)));
        for size in 1..=3 {
            assert!(slips.iter().any(|change| change.cycles.abs() == f64::from(size)));
        }
        assert!(slips.iter().all(|change| change.cycles.abs() <= 3.0));
    }

    #[test]
    fn half_cycles_are_flagged_until_resolved_and_leave_an_integer() {
        let (mut tracker, mut changes) = (tracker(), Vec::new());
        for k in 0..20_000 {
            let tracked = tracker.track(at(k), &SLIPS, &mut changes);
            assert_eq!(tracked.half_cycle, tracked.cycles.fract() != 0.0);
        }
        assert!(changes.iter().any(|change| change.change == Change::HalfCycleResolved));
    }

    #[test]
    fn losing_the_signal_gives_a_new_flagged_ambiguity() {
        let (mut tracker, mut changes) = (tracker(), Vec::new());
        let never = Slips { per_hour: 0.0, ..SLIPS };
        tracker.lose();
        let first = tracker.track(at(0), &never, &mut changes);
        assert!(!first.loss_of_lock && changes.is_empty());
        assert_eq!(tracker.track(at(1), &never, &mut changes), first);
        tracker.lose();
        let again = tracker.track(at(3), &never, &mut changes);
        assert!(again.loss_of_lock && again.cycles != first.cycles && again.cycles.fract() == 0.0);
        assert_eq!((changes.len(), changes[0].change), (1, Change::Reacquired));
        assert!(!tracker.track(at(4), &never, &mut changes).loss_of_lock);
    }
}
