//! What smoothing made of a run, for the summary and for people.
//!
//! ```text
//! smoothing         11 passes, −ln likelihood 20312.4 → 18934.0 in 5 iterations
//! starts            motion ×1, measurements ×1: 18934.0 (taken); motion ×0.1, measurements ×10: 18951.2
//! integers          38 arcs: 36 fixed, 0 refused, 0 contradictory, 2 float by nature
//! innovations²/σ²   phase 0.98, code 1.03, doppler 1.01 (1 is expected)
//! heavy tails       code G1 ν 8, 1.2 % distrusted; doppler ν 3, 6.0 % distrusted
//! engine            rms from smoothed positions H 0.61 cm, 3D 1.72 cm; over its σ e, n, u 0.61 0.72 0.90
//! noise                                         start        learned
//! phase G1, constant part                     3.00 mm        2.11 mm
//! ```

use crate::compare::{Enu, Options, Truth, compare};
use crate::read::solution::Track;
use crate::smooth::rtk::report::{Learned, Report, Start, Tail};
use serde::Serialize;
use std::fmt;
use surefix_core::gnss::solution::{Quality, Solution};

/// What smoothing found out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Smoothing {
    /// What the smoother says of noise, likelihood, innovations and ambiguities.
    #[serde(flatten)]
    pub report: Report,
    /// The engine's positions about the smoothed ones, where both are fixed; `None` if there are none.
    pub engine: Option<EngineErrors>,
}

/// Errors of the engine's positions if the smoothed ones were the truth. Over their standard deviations they are below 1
/// where the engine promises no more than it keeps: what both have in common does not show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EngineErrors {
    /// Epochs.
    pub epochs: usize,
    /// Root mean square, horizontal `[m]`.
    pub rms_horizontal_m: f64,
    /// Root mean square, all three components `[m]`.
    pub rms_3d_m: f64,
    /// Root mean square over the engine's standard deviations.
    pub normalized: Option<Enu>,
    /// Mean of the normalised error squared (NEES), at most about 3.
    pub nees: Option<f64>,
}

impl Smoothing {
    /// Of a run whose solutions by the engine were smoothed.
    pub fn new(report: Report, engine: &[Solution], smoothed: &[Solution]) -> Self {
        let fixed = |solutions: &[Solution]| {
            let mut track = Track::of(solutions);
            track.points.retain(|point| point.quality <= Quality::Partial);
            track
        };
        let compared = compare(&fixed(engine), &Truth::Track(fixed(smoothed)), &Options::default());
        let normalized = compared.fixed_normalized;
        let engine = compared.fixed.map(|errors| EngineErrors {
            epochs: errors.count,
            rms_horizontal_m: errors.rms_horizontal_m,
            rms_3d_m: errors.rms_3d_m,
            normalized: normalized.map(|normalized| normalized.rms),
            nees: normalized.map(|normalized| normalized.nees_mean),
        });
        Self { report, engine }
    }
}

impl fmt::Display for Smoothing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { parameters, starts, negative_log_likelihood, consistency, tails, arcs, passes, memory } =
            &self.report;
        write!(f, "{:18}{passes} passes over {memory}", "smoothing")?;
        match negative_log_likelihood.as_slice() {
            [] => writeln!(f)?,
            [only] => writeln!(f, ", −ln likelihood {only:.1}")?,
            [first, more @ .., last] => {
                writeln!(f, ", −ln likelihood {first:.1} → {last:.1} in {} iterations", more.len() + 1)?;
            }
        }
        if !starts.is_empty() {
            let ends: Vec<_> = starts.iter().map(ToString::to_string).collect();
            writeln!(f, "{:18}{}", "starts", ends.join("; "))?;
        }
        writeln!(
            f,
            "{:18}{} arcs: {} fixed, {} refused, {} contradictory, {} float by nature",
            "integers", arcs.total, arcs.fixed, arcs.refused, arcs.contradictory, arcs.float_by_nature
        )?;
        let types: Vec<_> = consistency.iter().map(|types| format!("{} {:.2}", types.of, types.mean)).collect();
        writeln!(f, "{:18}{} (1 is expected)", "innovations²/σ²", types.join(", "))?;
        let heavy: Vec<_> = tails.iter().filter_map(|tail| Some((tail, tail.freedom?))).collect();
        if !heavy.is_empty() {
            let describe = |(tail, freedom): &(&Tail, f64)| {
                let share = 100.0 * tail.distrusted as f64 / tail.count as f64;
                format!("{} ν {freedom:.0}, {share:.1} % distrusted", tail.of)
            };
            let list: Vec<_> = heavy.iter().map(describe).collect();
            writeln!(f, "{:18}{}", "heavy tails", list.join("; "))?;
        }
        if let Some(EngineErrors { rms_horizontal_m, rms_3d_m, normalized, .. }) = &self.engine {
            let [horizontal, three_d] = [rms_horizontal_m, rms_3d_m].map(|rms| 100.0 * rms);
            write!(f, "{:18}rms from smoothed positions H {horizontal:.2} cm, 3D {three_d:.2} cm", "engine")?;
            if let Some(Enu { east, north, up }) = normalized {
                write!(f, "; over its σ e, n, u {east:.2} {north:.2} {up:.2}")?;
            }
            writeln!(f)?;
        }
        write!(f, "{:36}{:>15}{:>15}", "noise", "start", "learned")?;
        for Learned { name, unit, start, end, .. } in parameters.iter().filter(|parameter| parameter.learned) {
            write!(f, "\n{name:36}{:>15}{:>15}", plain(*start, unit), plain(*end, unit))?;
        }
        Ok(())
    }
}

impl fmt::Display for Start {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "motion ×{}, measurements ×{}: ", self.motion, self.measurements)?;
        match self.negative_log_likelihood {
            Some(end) => write!(f, "{end:.1}")?,
            None => write!(f, "failed")?,
        }
        write!(f, "{}", if self.taken { " (taken)" } else { "" })
    }
}

/// A value with its unit, metres below 0.1 as millimetres.
fn plain(value: f64, unit: &str) -> String {
    let (value, prefix) = if unit.starts_with('m') && value < 0.1 { (1_000.0 * value, "m") } else { (value, "") };
    format!("{value:.2} {prefix}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smooth::rtk::report::{ArcCount, Consistency};
    use nalgebra::{Matrix3, Vector3};
    use surefix_core::gnss::time::GpsTime;

    fn solution(seconds: f64, quality: Quality, up: f64) -> Solution {
        Solution {
            quality,
            position: Vector3::new(6_378_137.0 + up, 0.0, 0.0), // up is x there
            position_covariance: Matrix3::from_diagonal(&Vector3::new(4e-4, 1e-4, 1e-4)),
            ..Solution::none(GpsTime::from_week_tow(2114, seconds), surefix_core::gnss::solution::Reason::Complete)
        }
    }

    #[test]
    fn the_engine_is_judged_where_both_are_fixed() {
        let engine = [
            solution(0.0, Quality::Float, 0.7),
            solution(1.0, Quality::Fixed, 0.02),
            solution(2.0, Quality::Partial, 0.04),
        ];
        let smoothed = [0.0, 1.0, 2.0].map(|seconds| solution(seconds, Quality::Fixed, 0.0));
        let errors = Smoothing::new(Report::default(), &engine, &smoothed).engine.unwrap();
        // 2 and 4 cm by a σ of 2 cm: 1 and 2.
        assert_eq!(errors.epochs, 2);
        assert!((errors.rms_3d_m - 1e-3_f64.sqrt()).abs() < 1e-9 && errors.rms_horizontal_m < 1e-6);
        assert!((errors.normalized.unwrap().up - 2.5_f64.sqrt()).abs() < 1e-6);
        assert!((errors.nees.unwrap() - 2.5).abs() < 1e-6);
        assert!(Smoothing::new(Report::default(), &engine[..1], &smoothed).engine.is_none());
    }

    #[test]
    fn people_read_plain_units() {
        let learned = |name: &str, unit, start, end, learned| Learned { name: name.into(), unit, start, end, learned };
        let report = Report {
            parameters: vec![
                learned("phase noise G L1", "m", 0.003, 0.002, true),
                learned("ambiguities", "cycles/√s", 1e-5, 1e-5, false),
            ],
            starts: Start::list(&[[0.1, 10.0]], &[f64::NAN, 12.0]),
            negative_log_likelihood: vec![30.0, 20.0, 10.0],
            consistency: vec![Consistency { of: "phase", count: 9, mean: 0.98 }],
            tails: vec![
                Tail { of: "code G1".into(), freedom: Some(8.0), window_s: 20.0, count: 200, distrusted: 3 },
                Tail { of: "phase G1".into(), freedom: None, window_s: 0.0, count: 200, distrusted: 0 },
            ],
            arcs: ArcCount { total: 3, fixed: 2, refused: 1, ..ArcCount::default() },
            passes: 7,
            memory: "checkpoints",
        };
        let text = Smoothing { report, engine: None }.to_string();
        for part in [
            "7 passes over checkpoints, −ln likelihood 30.0 → 10.0 in 2 iterations\n",
            "starts            motion ×1, measurements ×1: failed; motion ×0.1, measurements ×10: 12.0 (taken)\n",
            "3 arcs: 2 fixed, 1 refused, 0 contradictory, 0 float by nature\n",
            "phase 0.98 (1 is expected)\n",
            "heavy tails       code G1 ν 8, 1.5 % distrusted\n",
            "phase noise G L1                            3.00 mm        2.00 mm",
        ] {
            assert!(text.contains(part), "{part:?} is not in\n{text}");
        }
        assert!(!text.contains("ambiguities  "), "what is not learned is in\n{text}");
        let json = serde_json::to_value(Smoothing { report: Report::default(), engine: None }).unwrap();
        assert_eq!(json["passes"], 0);
    }
}
