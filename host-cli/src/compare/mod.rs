//! A solution against the truth: how often fixed, how often wrongly, how far off, and whether its own standard
//! deviations can be believed.
//!
//! Errors are solution − truth in the local frame (east, north, up) at the truth. *Fixed* means [`Quality::Fixed`] or
//! [`Quality::Partial`]; a fixed epoch is *wrong* if its 3-D error exceeds a threshold (10 cm).

mod matching;
pub mod stanford;
mod statistics;
mod table;

use crate::read::solution::Track;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::collections::BTreeMap;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::solution::Quality;
use surefix_core::gnss::time::GpsTime;

pub use matching::Truth;
pub use stanford::Stanford;
pub use statistics::{Enu, Errors, Normalized, Percentiles};

/// How to compare.
#[derive(Clone, Debug)]
pub struct Options {
    /// Largest difference of time between an epoch and its truth `[s]`. The truth is taken as it is: nothing is moved
    /// by velocity times that difference, since receivers stamp one instant up to half a second apart.
    pub tolerance: f64,
    /// Where no truth is that near: interpolate linearly between truths at most this far apart `[s]`; 0 for never.
    pub interpolate: f64,
    /// A fixed epoch is wrong beyond this 3-D error `[m]`.
    pub wrong_threshold: f64,
    /// Rover epochs that could have been fixed; the epochs of the solution file if not given.
    pub epochs: Option<usize>,
    /// Start of the clock for the first fix; the first epoch of the solution file if not given.
    pub start: Option<GpsTime>,
    /// Horizontal and vertical alert limit, to judge protection levels `[m]`.
    pub alert_limits: Option<[f64; 2]>,
}

impl Default for Options {
    fn default() -> Self {
        Self { tolerance: 0.05, interpolate: 0.0, wrong_threshold: 0.1, epochs: None, start: None, alert_limits: None }
    }
}

/// An epoch that has a truth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// When.
    pub time: GpsTime,
    /// Grade of the solution.
    pub quality: Quality,
    /// Solution − truth, east, north, up `[m]`.
    pub error: Vector3<f64>,
    /// What the solution says of it, in the same frame `[m²]`.
    pub covariance: Option<Matrix3<f64>>,
    /// HPL and VPL `[m]`.
    pub protection: Option<[f64; 2]>,
}

impl Sample {
    fn is_fixed(&self) -> bool {
        matches!(self.quality, Quality::Fixed | Quality::Partial)
    }
}

/// The comparison. Rates are fractions of 1, lengths metres, times seconds.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Epochs in the solution file, or those of the rover if their number was given: what the fix rate refers to.
    pub epochs: usize,
    /// Epochs of the solution with a position.
    pub positions: usize,
    /// Of those, the ones that have a truth.
    pub matched: usize,
    /// Epochs with a position, by quality.
    pub by_quality: BTreeMap<&'static str, usize>,
    /// Fixed epochs over `epochs`.
    pub fix_rate: f64,
    /// Fixed epochs that have a truth and are wrong.
    pub wrong_fixes: usize,
    /// Wrong over fixed epochs that have a truth; 0 if there is none.
    pub wrong_fix_rate: f64,
    /// 3-D error beyond which a fixed epoch is wrong `[m]`.
    pub wrong_threshold_m: f64,
    /// From the start to the first fixed epoch `[s]`.
    pub first_fix_s: Option<f64>,
    /// From the start to the first fixed epoch that is not wrong `[s]`; an epoch without truth does not count.
    pub first_right_fix_s: Option<f64>,
    /// Errors of fixed epochs.
    pub fixed: Option<Errors>,
    /// Errors of float epochs.
    pub float: Option<Errors>,
    /// Errors of code epochs.
    pub code: Option<Errors>,
    /// Errors of all epochs.
    pub all: Option<Errors>,
    /// Errors over their own standard deviations, fixed epochs.
    pub fixed_normalized: Option<Normalized>,
    /// Errors over their own standard deviations, all epochs.
    pub all_normalized: Option<Normalized>,
    /// Errors against protection levels, if alert limits were given.
    pub stanford: Option<Stanford>,
    /// Pauses longer than one and a half usual intervals.
    pub gaps: Gaps,
    /// Rows of the two files that could not be read.
    pub unreadable: [usize; 2],
}

/// Pauses between positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Gaps {
    /// Usual interval between positions (median) `[s]`.
    pub interval_s: f64,
    /// How many pauses exceed one and a half of it.
    pub count: usize,
    /// The longest pause `[s]`.
    pub longest_s: f64,
}

/// Compares a solution with the truth.
pub fn compare(solution: &Track, truth: &Truth, options: &Options) -> Report {
    let samples = samples(solution, truth, options);
    let of = |keep: fn(&Sample) -> bool| samples.iter().filter(move |sample| keep(sample)).copied().collect::<Vec<_>>();
    let fixed = of(Sample::is_fixed);
    let wrong = |sample: &Sample| sample.error.norm() > options.wrong_threshold;
    let wrong_fixes = fixed.iter().filter(|sample| wrong(sample)).count();

    let count = |quality| solution.points.iter().filter(|point| point.quality == quality).count();
    let fixes = count(Quality::Fixed) + count(Quality::Partial);
    let epochs = options.epochs.unwrap_or(solution.epochs);
    let start = options.start.or(solution.start);
    let after_start = |time: GpsTime| start.map(|start| time.since(start));
    let mut fixed_points =
        solution.points.iter().filter(|point| matches!(point.quality, Quality::Fixed | Quality::Partial));
    let rate = |part: usize, whole: usize| if whole > 0 { part as f64 / whole as f64 } else { 0.0 };

    Report {
        epochs,
        positions: solution.points.len(),
        matched: samples.len(),
        by_quality: [
            ("fixed", count(Quality::Fixed)),
            ("partial", count(Quality::Partial)),
            ("float", count(Quality::Float)),
            ("code", count(Quality::Code)),
        ]
        .into(),
        fix_rate: rate(fixes, epochs),
        wrong_fixes,
        wrong_fix_rate: rate(wrong_fixes, fixed.len()),
        wrong_threshold_m: options.wrong_threshold,
        first_fix_s: fixed_points.next().and_then(|point| after_start(point.time)),
        first_right_fix_s: fixed.iter().find(|sample| !wrong(sample)).and_then(|sample| after_start(sample.time)),
        fixed: Errors::of(&fixed),
        float: Errors::of(&of(|sample| sample.quality == Quality::Float)),
        code: Errors::of(&of(|sample| sample.quality == Quality::Code)),
        all: Errors::of(&samples),
        fixed_normalized: Normalized::of(&fixed),
        all_normalized: Normalized::of(&samples),
        stanford: options.alert_limits.and_then(|limits| Stanford::of(&samples, limits)),
        gaps: Gaps::of(solution),
        unreadable: [solution.unreadable, truth.unreadable()],
    }
}

/// The epochs of the solution that have a truth.
fn samples(solution: &Track, truth: &Truth, options: &Options) -> Vec<Sample> {
    solution
        .points
        .iter()
        .filter_map(|point| {
            let reference = truth.at(point.time, options.tolerance, options.interpolate)?;
            let here = Geodetic::from_ecef(&reference);
            Some(Sample {
                time: point.time,
                quality: point.quality,
                error: here.ecef_to_enu(&(point.position - reference)),
                covariance: point.covariance.map(|covariance| here.covariance_to_enu(&covariance)),
                protection: point.protection,
            })
        })
        .collect()
}

impl Gaps {
    fn of(solution: &Track) -> Self {
        let mut intervals: Vec<f64> = solution.points.windows(2).map(|pair| pair[1].time.since(pair[0].time)).collect();
        intervals.sort_by(f64::total_cmp);
        let Some(&interval_s) = intervals.get(intervals.len() / 2) else { return Self::default() };
        let mut longer = intervals.iter().filter(|&&interval| interval > 1.5 * interval_s);
        Self { interval_s, count: longer.clone().count(), longest_s: longer.next_back().copied().unwrap_or(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::solution::TrackPoint;

    /// On the equator at longitude 0: east is y, north z, up x.
    const ORIGIN: Vector3<f64> = Vector3::new(6_378_137.0, 0.0, 0.0);

    fn point(seconds: f64, quality: Quality, [e, n, u]: [f64; 3]) -> TrackPoint {
        TrackPoint {
            time: GpsTime::from_week_tow(2000, seconds),
            position: ORIGIN + Vector3::new(u, e, n),
            covariance: Some(Matrix3::from_diagonal(&Vector3::new(0.0004, 0.0001, 0.0001))), // σ u 2 cm, e and n 1 cm
            velocity: None,
            quality,
            protection: None,
        }
    }

    fn track(points: Vec<TrackPoint>) -> Track {
        Track { epochs: points.len() + 1, start: Some(GpsTime::from_week_tow(2000, 0.0)), points, ..Track::default() }
    }

    #[test]
    fn a_report_by_hand() {
        // Start at 0 without a position, float at 1, wrong fix at 2, right fixes at 3 and 4, a pause, partial at 8.
        let solution = track(vec![
            point(1.0, Quality::Float, [0.3, 0.4, 0.0]),
            point(2.0, Quality::Fixed, [0.0, 0.0, 0.5]),
            point(3.0, Quality::Fixed, [0.03, 0.04, 0.0]),
            point(4.0, Quality::Fixed, [-0.03, -0.04, 0.0]),
            point(8.0, Quality::Partial, [0.0, 0.0, 0.0]),
        ]);
        let report = compare(&solution, &Truth::Fixed(ORIGIN), &Options::default());
        assert_eq!((report.epochs, report.positions, report.matched), (6, 5, 5));
        assert_eq!((report.fix_rate, report.wrong_fixes, report.wrong_fix_rate), (4.0 / 6.0, 1, 0.25));
        assert_eq!((report.first_fix_s, report.first_right_fix_s), (Some(2.0), Some(3.0)));
        assert_eq!(report.gaps, Gaps { interval_s: 1.0, count: 1, longest_s: 4.0 });
        let fixed = report.fixed.unwrap();
        // Horizontal errors 0, 5, 5, 0 cm; vertical 50, 0, 0, 0 cm.
        assert!((fixed.rms_horizontal_m - (0.005_f64 / 4.0).sqrt()).abs() < 1e-9);
        assert!((fixed.rms_vertical_m - 0.25).abs() < 1e-9 && (fixed.mean_m.up - 0.125).abs() < 1e-9);
        let float = report.float.unwrap();
        assert!((float.rms_3d_m - 0.5).abs() < 1e-9 && report.code.is_none());
        // East error over σ: 30, 0, 3, −3, 0; up: 0, 25, 0, 0, 0.
        let normalized = report.all_normalized.unwrap();
        assert!((normalized.rms.east - (918.0_f64 / 5.0).sqrt()).abs() < 1e-6);
        assert!((normalized.worst - 40.0).abs() < 1e-6 && normalized.beyond_10_sigma == 2);
        // NEES: 2500, 625, 25, 25, 0
        assert!((normalized.nees_mean - 635.0).abs() < 1e-6, "{normalized:?}");
    }

    #[test]
    fn rover_epochs_and_start_can_be_given() {
        let solution = track(vec![point(5.0, Quality::Fixed, [0.0; 3])]);
        let start = Some(GpsTime::from_week_tow(1999, 604_800.0 - 5.0));
        let options = Options { epochs: Some(10), start, ..Options::default() };
        let report = compare(&solution, &Truth::Fixed(ORIGIN), &options);
        assert_eq!((report.fix_rate, report.first_fix_s), (0.1, Some(10.0)));
    }

    #[test]
    fn nothing_in_common_gives_a_report_without_errors() {
        let solution = track(vec![point(5.0, Quality::Fixed, [0.0; 3])]);
        let truth = Truth::Track(track(vec![point(7.0, Quality::Fixed, [0.0; 3])]));
        let report = compare(&solution, &truth, &Options::default());
        assert_eq!((report.matched, report.wrong_fix_rate), (0, 0.0));
        assert!(report.all.is_none() && report.to_string().contains("no epoch has a truth"));
    }
}
