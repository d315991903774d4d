//! What is remembered of each satellite from epoch to epoch: its arc, and what shows that the arc has ended.
//!
//! | sign | of | cannot see |
//! |---|---|---|
//! | loss-of-lock indicator, another signal, a long gap | the receiver | slips it does not notice |
//! | geometry-free phase against its linear prediction | L₁ − L₂ | pairs of slips such as (9, 7) on GPS |
//! | Melbourne–Wübbena against its mean | wide lane | equal slips on both bands |
//! | innovations (in `screen`) | all that is modelled | what it cannot tell from clock and position |
//!
//! W. Hatch 1982 and G. Blewitt, *An automatic editing algorithm for GPS data*, Geophys. Res. Lett. 17 (1990) for the two
//! combinations. Receivers that steer their clocks by whole milliseconds move codes, and some of them not the phases: then
//! codes and phases of all satellites part by the same number of milliseconds, and phases are moved after them.
//!
//! Panic contract: none. Cost: O(1) a satellite, O(S log S) for the clock.

use super::config::Screening;
use super::select::PairReading;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::satellite::SatelliteId;
use crate::gnss::signal::Signal;
use crate::gnss::time::GpsTime;
use heapless::Vec;

/// A millisecond of light `[m]`.
const MILLISECOND: f64 = 1e-3 * SPEED_OF_LIGHT;
/// Codes and phases that part by a whole number of milliseconds do so within this `[m]`.
const JUMP_TOLERANCE: f64 = 30.0;
/// Epochs that the mean of Melbourne–Wübbena is of, at most.
const MEMORY: f64 = 60.0;
/// Standard deviation of Melbourne–Wübbena before it was observed `[wide-lane cycles]`.
const WIDE_LANE_NOISE: f64 = 0.4;

/// Why an arc ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum ArcEnd {
    /// The satellite was not seen for too long.
    Gap,
    /// The receiver reports it.
    LossOfLock,
    /// The phase is that of another signal.
    Signal,
    /// Geometry-free phases jumped.
    GeometryFree,
    /// Melbourne–Wübbena jumped.
    MelbourneWubbena,
    /// The phase contradicted all others for too long.
    Innovations,
}

/// A satellite under watch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    /// Which.
    pub satellite: SatelliteId,
    /// When it was seen last.
    pub time: GpsTime,
    /// Number of its arc, never used before.
    pub arc: u32,
    /// Taken off its phases so that ambiguities stay small `[m]`, for each band or, first, for their combination.
    pub offset: [f64; 2],
    /// Phase wind-up accumulated `[cycles]`.
    pub wind_up: Option<f64>,
    /// Epochs in which its phase was rejected, in a row.
    pub rejected: u8,
    /// Epochs since the arc began.
    pub age: u32,
    signals: [Signal; 2],
    geometry_free: f64,
    /// Rate of the geometry-free phase `[m/s]`, once it is known.
    rate: Option<f64>,
    wide_lane: f64,
    variance: f64,
    count: f64,
}

impl Track {
    /// A track that begins with a reading, as arc `arc`.
    pub fn begin(reading: &PairReading, time: GpsTime, arc: u32) -> Self {
        Self {
            satellite: reading.satellite,
            time,
            arc,
            offset: [0.0; 2],
            wind_up: None,
            rejected: 0,
            age: 0,
            signals: reading.bands.map(|band| band.phase_signal),
            geometry_free: reading.pair.geometry_free(reading.cycles()),
            rate: None,
            wide_lane: reading.pair.melbourne_wubbena_cycles(reading.cycles(), reading.codes()),
            variance: WIDE_LANE_NOISE * WIDE_LANE_NOISE,
            count: 1.0,
        }
    }

    /// Lets the next reading begin a new arc: what came before counts no more.
    pub fn forget(&mut self) {
        self.time = GpsTime::from_nanoseconds(i64::MIN);
    }

    /// Takes the next reading; why its arc has ended, if it has. Then the track has to begin anew.
    pub fn advance(&mut self, reading: &PairReading, time: GpsTime, screening: &Screening) -> Option<ArcEnd> {
        let step = time.since(self.time);
        if !(step > 0.0 && step <= screening.gap) {
            return Some(ArcEnd::Gap);
        }
        if reading.bands.iter().any(|band| band.loss_of_lock) {
            return Some(ArcEnd::LossOfLock);
        }
        if reading.bands.map(|band| band.phase_signal) != self.signals {
            return Some(ArcEnd::Signal);
        }
        let geometry_free = reading.pair.geometry_free(reading.cycles());
        let rate = (geometry_free - self.geometry_free) / step;
        let predicted = self.geometry_free + self.rate.unwrap_or(0.0) * step;
        // Without a rate, and where the ionosphere turns, the plain difference may be the better one.
        let jump = libm::fabs(geometry_free - predicted).min(libm::fabs(geometry_free - self.geometry_free));
        if jump.is_nan() || jump > screening.geometry_free {
            return Some(ArcEnd::GeometryFree);
        }
        let wide_lane = reading.pair.melbourne_wubbena_cycles(reading.cycles(), reading.codes());
        let deviation = wide_lane - self.wide_lane;
        let sigma = libm::sqrt(self.variance * (1.0 + 1.0 / self.count));
        if deviation.is_nan() || libm::fabs(deviation) > (screening.melbourne_wubbena * sigma).max(screening.wide_lane)
        {
            return Some(ArcEnd::MelbourneWubbena);
        }
        self.count = (self.count + 1.0).min(MEMORY);
        self.wide_lane += deviation / self.count;
        // The prior counts as five observations.
        self.variance += (deviation * deviation - self.variance) / (self.count + 5.0);
        (self.geometry_free, self.rate, self.time) = (geometry_free, Some(rate), time);
        self.age = self.age.saturating_add(1);
        None
    }
}

/// Whole milliseconds by which codes moved and phases did not since the epoch before, as a distance `[m]`; 0 if none.
///
/// `apart` are code minus phase of each satellite, now and before `[m]`; its order is spoilt.
pub fn clock_jump<const S: usize>(apart: &mut Vec<f64, S>) -> f64 {
    if apart.len() < 3 {
        return 0.0;
    }
    apart.sort_unstable_by(f64::total_cmp);
    let median = apart.get(apart.len() / 2).copied().unwrap_or(0.0);
    let jump = MILLISECOND * libm::round(median / MILLISECOND);
    // Most satellites must agree.
    let agree = apart.iter().filter(|change| libm::fabs(**change - jump) < JUMP_TOLERANCE).count();
    // (−0 is none.)
    if 2 * agree > apart.len() && jump != 0.0 { jump } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::select::{BandPairs, select};
    use super::*;
    use crate::gnss::epoch::Observation;
    use proptest::prelude::*;

    const LAMBDA: [f64; 2] = [0.190_293_672_798, 0.244_210_213_425]; // c/f of IS-GPS-200N 3.3.1.1

    /// Readings of a GPS satellite at `range` with a delay of the ionosphere and ambiguities `n`.
    fn reading(range: f64, ionosphere: f64, n: [f64; 2]) -> PairReading {
        let mut observations = Vec::<Observation, 2>::new();
        for (i, signal) in ["1C", "2W"].into_iter().enumerate() {
            let mut observation = Observation::new("G07".parse().unwrap(), signal.parse().unwrap());
            let delay = ionosphere * if i == 0 { 1.0 } else { 77.0 * 77.0 / 3600.0 };
            observation.code = Some(range + delay);
            observation.phase = Some((range - delay) / LAMBDA[i] + n[i]);
            observations.push(observation).unwrap();
        }
        let mut pairs = Vec::<PairReading, 1>::new();
        select(&observations, &BandPairs::DEFAULT, |_| None, &|_, _| false, &mut pairs);
        pairs[0]
    }

    fn time(s: f64) -> GpsTime {
        GpsTime::from_week_tow(2111, s)
    }

    proptest! {
        /// Every slip that is a cycle or more on either band is found, but for those that both combinations cannot see.
        #[test]
        fn slips_are_found_by_one_combination_or_the_other(n1 in -20i32..=20, n2 in -20i32..=20, drift in -0.02..0.02f64) {
            let mut track = Track::begin(&reading(2.2e7, 5.0, [3.0, 4.0]), time(0.0), 0);
            for k in 1..6 {
                let ionosphere = 5.0 + drift * f64::from(k);
                let now = reading(2.2e7 + 400.0 * f64::from(k), ionosphere, [3.0, 4.0]);
                prop_assert_eq!(track.advance(&now, time(30.0 * f64::from(k)), &Screening::DEFAULT), None);
            }
            let slipped = reading(2.2e7 + 2400.0, 5.0 + drift * 6.0, [3.0 + f64::from(n1), 4.0 + f64::from(n2)]);
            let end = track.advance(&slipped, time(180.0), &Screening::DEFAULT);
            let geometry_free = (LAMBDA[0] * f64::from(n1) - LAMBDA[1] * f64::from(n2)).abs();
            if geometry_free > 0.05 + 0.03 {
                prop_assert_eq!(end, Some(ArcEnd::GeometryFree));
            } else if (n1 - n2).abs() > 2 {
                prop_assert!(end.is_some());
            } else if geometry_free < 0.02 && (n1 - n2).abs() <= 1 {
                prop_assert_eq!(end, None);
            }
        }
    }

    #[test]
    fn gaps_flags_and_other_signals_end_an_arc() {
        let first = reading(2.2e7, 5.0, [0.0; 2]);
        let ends = |change: &dyn Fn(&mut PairReading), at: f64| {
            let mut track = Track::begin(&first, time(0.0), 0);
            let mut next = first;
            change(&mut next);
            track.advance(&next, time(at), &Screening::DEFAULT)
        };
        assert_eq!(ends(&|_| (), 30.0), None);
        assert_eq!(ends(&|_| (), 121.0), Some(ArcEnd::Gap));
        assert_eq!(ends(&|_| (), 0.0), Some(ArcEnd::Gap));
        assert_eq!(ends(&|r| r.bands[1].loss_of_lock = true, 30.0), Some(ArcEnd::LossOfLock));
        assert_eq!(ends(&|r| r.bands[0].phase_signal = "1W".parse().unwrap(), 30.0), Some(ArcEnd::Signal));
        assert_eq!(ends(&|r| r.bands[0].phase = f64::NAN, 30.0), Some(ArcEnd::GeometryFree));
        assert_eq!(ends(&|r| r.bands[0].code = f64::NAN, 30.0), Some(ArcEnd::MelbourneWubbena));
    }

    #[test]
    fn a_jump_is_whole_milliseconds_that_most_satellites_show() {
        let jump = |changes: &[f64]| clock_jump(&mut Vec::<f64, 8>::from_slice(changes).unwrap());
        let ms = MILLISECOND;
        assert_eq!(jump(&[ms + 3.0, ms - 2.0, ms, 0.5]), ms);
        assert_eq!(jump(&[-2.0 * ms, 1.0 - 2.0 * ms, -2.0 * ms - 4.0]), -2.0 * ms);
        assert_eq!(jump(&[0.5, -0.5, 1.0, 2.0]), 0.0);
        assert_eq!(jump(&[0.4 * ms, 0.4 * ms, 0.4 * ms]), 0.0); // no whole millisecond: that is something else
        assert_eq!(jump(&[ms, ms]), 0.0);
    }
}
