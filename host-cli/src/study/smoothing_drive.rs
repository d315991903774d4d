//! Smoothing on a real drive: what it gains over the filter, and whether EM finds the noise from a wrong start.
//!
//! The engine runs once; what it recorded is smoothed with its noise as configured, with noise learned from there, and
//! with noise learned from starts whose standard deviations of process and measurement noise are a tenth and ten times as
//! large. All are judged against one truth; a start is forgiven if its rms errors, horizontal and in all three, end within
//! a tenth of those of the configured start.

use crate::compare::{Errors, Options as Comparison, Report, Truth, compare};
use crate::process::run::Engine;
use crate::process::stream::Input;
use crate::read::solution::Track;
use crate::smooth::pass::PassError;
use crate::smooth::rtk::tape::Tape;
use crate::smooth::rtk::{Options, smooth};
use rayon::prelude::*;
use std::fmt;
use surefix_core::gnss::solution::Solution;
use surefix_core::rtk::RtkConfig;

/// Factors on standard deviations of a wrong start.
const WRONG: [f64; 2] = [0.1, 10.0];
/// How much larger than from the configured start errors may be.
const FORGIVEN: f64 = 1.1;

/// One way to the solution and what it reaches.
pub struct Row {
    /// What it is.
    pub name: String,
    /// −ln likelihood at the end; the filter has none.
    pub negative_log_likelihood: Option<f64>,
    /// Its solution against the truth.
    pub report: Report,
}

/// The table: filter, smoother, smoother with EM, and the same from wrong starts.
pub struct Table(pub Vec<Row>);

/// Rows before those of wrong starts.
const OTHERS: usize = 3;

/// Runs all of them over the same inputs, on all cores.
pub fn run(inputs: &[Input], config: &RtkConfig, options: &Options, truth: &Truth) -> Result<Table, PassError> {
    let mut engine = Engine::new(*config);
    let mut tape = Tape::new(*config);
    for input in inputs {
        if let Some(solution) = engine.feed(input) {
            tape.record(&engine, &solution);
        }
    }
    let judge = |solutions: &[Solution]| compare(&Track::of(solutions), truth, &Comparison::default());
    let filter = Row { name: "filter".into(), negative_log_likelihood: None, report: judge(tape.solutions()) };
    let mut runs = vec![("smoothed".to_owned(), Options { em: false, ..options.clone() })];
    let learning = Options { em: true, ..options.clone() };
    runs.push(("EM".to_owned(), learning.clone()));
    for process in WRONG {
        for measurement in WRONG {
            let name = format!("EM, process × {process}, measurement × {measurement}");
            runs.push((name, Options { start_factors: [process, measurement], ..learning.clone() }));
        }
    }
    let row = |(name, options): (String, Options)| {
        let smoothed = smooth(&tape, &options, None)?;
        let negative_log_likelihood = smoothed.report.negative_log_likelihood.last().copied();
        Ok(Row { name, negative_log_likelihood, report: judge(&smoothed.solutions) })
    };
    let rows: Result<Vec<Row>, PassError> = runs.into_par_iter().map(row).collect();
    rows.map(|rows| Table(std::iter::once(filter).chain(rows).collect()))
}

impl Table {
    /// Wrong starts that are not forgiven.
    pub fn missed(&self) -> usize {
        let tuned = self.tuned();
        self.0.iter().skip(OTHERS).filter(|row| ratio(row, tuned).is_none_or(|ratio| ratio > FORGIVEN)).count()
    }

    /// Errors from the configured start.
    fn tuned(&self) -> Option<Errors> {
        self.0.get(OTHERS - 1).and_then(|row| row.report.all)
    }
}

/// The larger ratio of rms errors, horizontal and in all three, to those of the configured start.
fn ratio(row: &Row, tuned: Option<Errors>) -> Option<f64> {
    let (errors, tuned) = (row.report.all?, tuned?);
    Some((errors.rms_horizontal_m / tuned.rms_horizontal_m).max(errors.rms_3d_m / tuned.rms_3d_m))
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| {:35} | fix % | wrong % | rms H cm | rms 3D cm | 95 % cm | error/σ e, n, u   | −ln L    | ratio |",
            "of all epochs"
        )?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        let tuned = self.tuned();
        for (i, row) in self.0.iter().enumerate() {
            let Row { name, negative_log_likelihood, report } = row;
            let [horizontal, three_d, p95] = report.all.map_or([f64::NAN; 3], |errors| {
                [errors.rms_horizontal_m, errors.rms_3d_m, errors.three_d_m.p95].map(|error| 100.0 * error)
            });
            write!(
                f,
                "| {name:35} | {:5.2} | {:7.2} | {horizontal:8.2} | {three_d:9.2} | {p95:7.2} |",
                100.0 * report.fix_rate,
                100.0 * report.wrong_fix_rate,
            )?;
            match report.all_normalized.map(|normalized| normalized.rms) {
                Some(rms) => write!(f, " {:4.2}, {:4.2}, {:4.2}  |", rms.east, rms.north, rms.up)?,
                None => write!(f, " {:17} |", "")?,
            }
            match negative_log_likelihood {
                Some(value) => write!(f, " {value:8.0} |")?,
                None => write!(f, " {:8} |", "")?,
            }
            match ratio(row, tuned).filter(|_| i >= OTHERS) {
                Some(ratio) => writeln!(f, " {ratio:5.2} |")?,
                None => writeln!(f, " {:5} |", "")?,
            }
        }
        Ok(())
    }
}
