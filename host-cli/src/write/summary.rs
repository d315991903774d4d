//! What a run came to, as JSON: how many epochs of which quality, first fix, ratio, what was dropped, how fast.

use crate::process::smoothing::Smoothing;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::time::Duration;
use surefix_core::gnss::solution::{Quality, Solution};
use surefix_core::gnss::time::GpsTime;

/// Summary of a run. Times are GPST; rates are fractions of 1.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Program and version.
    pub program: String,
    /// Names of the input files.
    pub inputs: Vec<String>,
    /// First and last epoch as week and seconds of week; `None` if there was no epoch.
    pub span: Option<[WeekTow; 2]>,
    /// Epochs of which a solution was attempted.
    pub epochs: u64,
    /// Epochs by quality: fixed, partial, float, code, none.
    pub by_quality: BTreeMap<&'static str, u64>,
    /// Epochs by the reason why they are not better.
    pub by_reason: BTreeMap<String, u64>,
    /// Fixed and partial epochs over all epochs.
    pub fix_rate: f64,
    /// From the first epoch to the first fixed or partial one `[s]`.
    pub first_fix_s: Option<f64>,
    /// The ratio test's statistic over epochs that made the test.
    pub ratio: Option<Spread>,
    /// Satellites used.
    pub satellites: Option<Spread>,
    /// Largest age of the base data `[s]`.
    pub age_max_s: f64,
    /// Epochs with a cycle slip, and with a rejected measurement.
    pub epochs_with_slip: u64,
    /// Epochs with a rejected measurement.
    pub epochs_with_rejection: u64,
    /// Input records that were dropped, by what was wrong with them.
    pub dropped: BTreeMap<String, u64>,
    /// Warnings given on the way.
    pub warnings: Vec<String>,
    /// What smoothing found out; absent where there was none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<Smoothing>,
    /// Processing time `[s]`.
    pub seconds: f64,
    /// Epochs processed in a second.
    pub epochs_per_second: Option<f64>,
    /// The configuration used.
    pub config: serde_json::Value,
}

/// A time as GPS week and seconds of week.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WeekTow {
    /// Continuous GPS week.
    pub week: i32,
    /// Seconds of week `[s]`.
    pub tow_s: f64,
}

impl From<GpsTime> for WeekTow {
    fn from(t: GpsTime) -> Self {
        Self { week: t.week(), tow_s: t.tow() }
    }
}

/// Smallest, median, mean and largest of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Smallest.
    pub min: f64,
    /// Median (the upper one of an even sample).
    pub median: f64,
    /// Arithmetic mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// Of a sample; `None` if it has no finite value.
    pub fn of(sample: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = sample.into_iter().filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let (min, max) = (*values.first()?, *values.last()?);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        Some(Self { min, median: values[values.len() / 2], mean, max })
    }
}

/// Gathers what a [`Summary`] says while the solutions come.
#[derive(Clone, Debug, Default)]
pub struct SummaryBuilder {
    span: Option<(GpsTime, GpsTime)>,
    epochs: u64,
    by_quality: [u64; 5],
    by_reason: BTreeMap<String, u64>,
    first_fix: Option<GpsTime>,
    ratios: Vec<f64>,
    satellites: Vec<f64>,
    age_max: f64,
    epochs_with_slip: u64,
    epochs_with_rejection: u64,
    dropped: BTreeMap<String, u64>,
    warnings: Vec<String>,
    smoothing: Option<Smoothing>,
}

/// The qualities and their names in the summary.
const QUALITIES: [(Quality, &str); 5] = [
    (Quality::Fixed, "fixed"),
    (Quality::Partial, "partial"),
    (Quality::Float, "float"),
    (Quality::Code, "code"),
    (Quality::None, "none"),
];

impl SummaryBuilder {
    /// Takes note of one epoch.
    pub fn push(&mut self, solution: &Solution) {
        self.epochs += 1;
        self.span = Some((self.span.map_or(solution.time, |(first, _)| first), solution.time));
        self.by_quality[solution.quality as usize] += 1;
        *self.by_reason.entry(format!("{:?}", solution.reason)).or_default() += 1;
        if matches!(solution.quality, Quality::Fixed | Quality::Partial) {
            self.first_fix.get_or_insert(solution.time);
        }
        if solution.ratio > 0.0 {
            self.ratios.push(solution.ratio);
        }
        if solution.quality != Quality::None {
            self.satellites.push(solution.satellites_used.len() as f64);
        }
        self.age_max = self.age_max.max(solution.age.abs());
        self.epochs_with_slip += u64::from(!solution.satellites_slipped.is_empty());
        self.epochs_with_rejection += u64::from(!solution.satellites_rejected.is_empty());
    }

    /// Takes note of input records that were dropped for the same reason.
    pub fn dropped(&mut self, what: impl Into<String>, count: u64) {
        if count > 0 {
            *self.dropped.entry(what.into()).or_default() += count;
        }
    }

    /// Takes note of a warning.
    pub fn warn(&mut self, warning: impl Into<String>) {
        self.warnings.push(warning.into());
    }

    /// Takes note of what smoothing found out.
    pub fn smoothing(&mut self, smoothing: Smoothing) {
        self.smoothing = Some(smoothing);
    }

    /// The summary of a run that read `inputs`, used `config` and took `elapsed`.
    pub fn finish(self, inputs: Vec<String>, config: &impl Serialize, elapsed: Duration) -> Summary {
        let count = |quality: Quality| self.by_quality[quality as usize];
        let fixed = count(Quality::Fixed) + count(Quality::Partial);
        let seconds = elapsed.as_secs_f64();
        let start = self.span.map(|(first, _)| first);
        Summary {
            program: concat!("surefix ", env!("CARGO_PKG_VERSION")).to_string(),
            inputs,
            span: self.span.map(|(first, last)| [first.into(), last.into()]),
            epochs: self.epochs,
            by_quality: QUALITIES.map(|(quality, name)| (name, count(quality))).into(),
            by_reason: self.by_reason,
            fix_rate: if self.epochs > 0 { fixed as f64 / self.epochs as f64 } else { 0.0 },
            first_fix_s: self.first_fix.zip(start).map(|(fix, start)| fix.since(start)),
            ratio: Spread::of(self.ratios),
            satellites: Spread::of(self.satellites),
            age_max_s: self.age_max,
            epochs_with_slip: self.epochs_with_slip,
            epochs_with_rejection: self.epochs_with_rejection,
            dropped: self.dropped,
            warnings: self.warnings,
            smoothing: self.smoothing,
            seconds,
            epochs_per_second: (seconds > 0.0).then(|| self.epochs as f64 / seconds),
            config: serde_json::to_value(config).unwrap_or(serde_json::Value::Null),
        }
    }
}

impl Summary {
    /// Writes the summary as indented JSON with a final newline.
    pub fn write(&self, mut out: impl Write) -> io::Result<()> {
        serde_json::to_writer_pretty(&mut out, self)?;
        writeln!(out)?;
        out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::solution::Reason;

    #[test]
    fn counts_rates_and_first_fix() {
        let mut builder = SummaryBuilder::default();
        let qualities = [Quality::None, Quality::Float, Quality::Partial, Quality::Fixed];
        for (i, quality) in qualities.into_iter().enumerate() {
            let time = GpsTime::from_week_tow(2114, 100.0 + i as f64);
            builder.push(&Solution {
                quality,
                ratio: i as f64, // 0 means that no search was made
                age: -0.5 * i as f64,
                ..Solution::none(time, Reason::RatioLow)
            });
        }
        builder.dropped("out of order", 2);
        builder.dropped("out of order", 1);
        builder.dropped("absurd", 0);
        let config = serde_json::json!({"bands": 2});
        let summary = builder.finish(vec!["a.obs".into()], &config, Duration::from_millis(500));
        let json = serde_json::to_value(&summary).unwrap();
        assert_eq!(json["by_quality"], serde_json::json!({"fixed":1,"partial":1,"float":1,"code":0,"none":1}));
        assert_eq!(json["by_reason"], serde_json::json!({"RatioLow": 4}));
        assert_eq!(json["dropped"], serde_json::json!({"out of order": 3}));
        assert_eq!((summary.fix_rate, summary.first_fix_s, summary.age_max_s), (0.5, Some(2.0), 1.5));
        assert_eq!(summary.ratio, Some(Spread { min: 1.0, median: 2.0, mean: 2.0, max: 3.0 }));
        assert_eq!((summary.epochs_per_second, &json["config"]["bands"]), (Some(8.0), &serde_json::json!(2)));
    }

    #[test]
    fn an_empty_run_has_a_summary_too() {
        let summary = SummaryBuilder::default().finish(vec![], &(), Duration::ZERO);
        let mut text = Vec::new();
        summary.write(&mut text).unwrap();
        assert!(String::from_utf8(text).unwrap().contains("\"fix_rate\": 0.0"));
    }
}
