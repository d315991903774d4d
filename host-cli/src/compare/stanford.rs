//! Errors against protection levels: counts by class, and the Stanford diagram.
//!
//! Counts are those of [`surefix_core::integrity::stanford`], horizontal and vertical each by itself. In the picture every
//! cell of the plane of error and protection level is as dark as many epochs lie in it; both axes end at one and a half
//! alert limits, and what is beyond lies on the edge.

use super::Sample;
use crate::plot::panel::{Frame, Panel, Range};
use crate::plot::{BLACK, BLUE, Color, Drawing, ORANGE, RED};
use crate::write::files::{Files, FilesError};
use nalgebra::Vector3;
use serde::Serialize;
use std::path::{Path, PathBuf};
use surefix_core::integrity::stanford::{Class, Counts};

/// Cells along each axis.
const CELLS: usize = 60;
/// Where the axes end, in alert limits.
const BEYOND: f64 = 1.5;

/// Counts of one comparison.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stanford {
    /// Alert limits, horizontal and vertical `[m]`.
    pub alert_limits_m: [f64; 2],
    /// Of horizontal errors.
    pub horizontal: Counts,
    /// Of vertical errors.
    pub vertical: Counts,
    /// Epochs with a truth that have no protection level.
    pub unmonitored: u64,
    /// Errors and protection levels, horizontal and vertical.
    #[serde(skip)]
    pairs: [Vec<(f64, f64)>; 2],
}

impl Stanford {
    /// Of samples; `None` if none of them has a protection level.
    pub(super) fn of(samples: &[Sample], alert_limits_m: [f64; 2]) -> Option<Self> {
        let bounded = samples.iter().filter_map(|sample| Some((sample.error, sample.protection?)));
        let unmonitored = samples.iter().filter(|sample| sample.protection.is_none()).count() as u64;
        Self::of_errors(bounded, alert_limits_m).map(|stanford| Self { unmonitored, ..stanford })
    }

    /// Of errors, east, north, up, and levels, horizontal and vertical `[m]`; `None` of none. What is NaN does not count.
    pub fn of_errors(errors: impl Iterator<Item = (Vector3<f64>, [f64; 2])>, alert_limits_m: [f64; 2]) -> Option<Self> {
        let [horizontal, vertical] = [Counts::default(); 2];
        let pairs = [Vec::new(), Vec::new()];
        let mut stanford = Self { alert_limits_m, horizontal, vertical, unmonitored: 0, pairs };
        for (error, levels) in errors {
            let errors = [error.xy().norm(), error.z.abs()];
            let counts = [&mut stanford.horizontal, &mut stanford.vertical];
            for (i, counts) in counts.into_iter().enumerate() {
                if counts.add(errors[i], levels[i], alert_limits_m[i]).is_some() {
                    stanford.pairs[i].push((errors[i], levels[i]));
                }
            }
        }
        (stanford.horizontal.total() > 0).then_some(stanford)
    }

    /// Rows for people.
    pub(super) fn rows(&self) -> Vec<String> {
        let percent = |part: u64, whole: u64| 100.0 * part as f64 / whole.max(1) as f64;
        let row = |name: &str, limit: f64, c: &Counts| {
            let total = c.total();
            format!(
                "{name:<12} {total:>7}  {:>8.3} %  {:>8.3} %  {:>8.3} %  {:>9.3} %  {:>9.3} %   AL {limit} m",
                percent(c.nominal, total),
                percent(c.misleading, total),
                percent(c.hazardously_misleading, total),
                percent(c.unavailable + c.unavailable_misleading, total),
                percent(c.beyond(), total),
            )
        };
        let [horizontal, vertical] = self.alert_limits_m;
        let mut rows = vec![
            format!(
                "{:<12} {:>7}  {:>10}  {:>10}  {:>10}  {:>11}  {:>11}",
                "PL", "epochs", "nominal", "misleading", "hazardous", "unavailable", "PE > PL"
            ),
            row("horizontal", horizontal, &self.horizontal),
            row("vertical", vertical, &self.vertical),
        ];
        if self.unmonitored > 0 {
            rows.push(format!("unmonitored  {:>7}", self.unmonitored));
        }
        rows
    }

    /// Writes the diagram as `NAME.svg` and `NAME.png`, and the counts as `NAME.csv`, into a directory.
    pub fn write(&self, directory: &Path, name: &str) -> Result<Vec<PathBuf>, FilesError> {
        let mut output = Files::default();
        output.draw(name, &self.drawing())?;
        let mut table = String::from(
            "component,alert_limit_m,epochs,nominal,misleading,hazardously_misleading,unavailable,unavailable_misleading,false_alerts,true_alerts\n",
        );
        let components = [("horizontal", &self.horizontal), ("vertical", &self.vertical)];
        for ((component, c), limit) in components.into_iter().zip(self.alert_limits_m) {
            table.push_str(&format!(
                "{component},{limit},{},{},{},{},{},{},{},{}\n",
                c.total(),
                c.nominal,
                c.misleading,
                c.hazardously_misleading,
                c.unavailable,
                c.unavailable_misleading,
                c.false_alerts,
                c.true_alerts
            ));
        }
        output.push(format!("{name}.csv"), table.into_bytes());
        output.write(directory)
    }

    /// The diagram: horizontal at the left, vertical at the right.
    pub fn drawing(&self) -> Drawing {
        let mut drawing = Drawing::new(900, 500);
        for (i, title) in ["horizontal", "vertical"].into_iter().enumerate() {
            let limit = self.alert_limits_m[i];
            let end = if limit.is_finite() { BEYOND * limit } else { self.largest(i) };
            let range = Range { low: 0.0, high: end };
            let frame = Frame { left: 60.0 + 440.0 * i as f64, top: 50.0, width: 380.0, height: 380.0 };
            cells(&mut drawing, frame, end, limit, &self.pairs[i]);
            let title = format!("{title}: protection level over error [m]");
            let mut panel = Panel::new(&mut drawing, frame, range, range, &title, true);
            panel.line(&[(0.0, 0.0), (end, end)], BLACK, 1.0);
            if limit.is_finite() {
                panel.line(&[(0.0, limit), (end, limit)], BLACK, 1.0);
                panel.line(&[(limit, 0.0), (limit, limit)], BLACK, 1.0);
            }
            panel.finish(&[]);
        }
        drawing
    }

    fn largest(&self, component: usize) -> f64 {
        self.pairs[component].iter().map(|&(error, level)| error.max(level)).fold(1e-3, f64::max)
    }
}

/// Fills the cells that epochs lie in.
fn cells(drawing: &mut Drawing, frame: Frame, end: f64, limit: f64, pairs: &[(f64, f64)]) {
    let cell = |value: f64| ((value / end * CELLS as f64) as usize).min(CELLS - 1);
    let mut counts = vec![[0u32; CELLS]; CELLS];
    pairs.iter().for_each(|&(error, level)| counts[cell(level)][cell(error)] += 1);
    let most = counts.iter().flatten().copied().max().unwrap_or(0).max(2);
    let (width, height) = (frame.width / CELLS as f64, frame.height / CELLS as f64);
    for (row, columns) in counts.iter().enumerate() {
        for (column, &count) in columns.iter().enumerate().filter(|(_, count)| **count > 0) {
            let middle = |index: usize| (index as f64 + 0.5) * end / CELLS as f64;
            let color = color(middle(column), middle(row), limit);
            let (left, bottom) = (frame.left + width * column as f64, frame.top + frame.height - height * row as f64);
            let corners =
                vec![(left, bottom), (left + width, bottom), (left + width, bottom - height), (left, bottom - height)];
            let opacity = 0.25 + 0.75 * f64::from(count).ln() / f64::from(most).ln();
            drawing.area(corners, color, opacity.min(1.0));
        }
    }
}

fn color(error: f64, level: f64, limit: f64) -> Color {
    match Class::of(error, level, limit) {
        Some(Class::Nominal) | None => BLUE,
        Some(Class::Unavailable) => ORANGE,
        Some(Class::Misleading | Class::HazardouslyMisleading | Class::UnavailableMisleading) => RED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix_core::gnss::solution::Quality;
    use surefix_core::gnss::time::GpsTime;

    fn sample(error: [f64; 3], protection: Option<[f64; 2]>) -> Sample {
        let time = GpsTime::from_week_tow(2000, 0.0);
        Sample { time, quality: Quality::Fixed, error: Vector3::from(error), covariance: None, protection }
    }

    /// Errors (5, 0.2) and (0.5, 3) m by limits of 1 and 2 m: 5 > 1 beyond a level of 0.6 is hazardous, 3 beyond 2.5 is
    /// warned of.
    #[test]
    fn counts_by_hand() {
        let samples = [
            sample([3.0, 4.0, -0.2], Some([0.6, 0.3])),
            sample([0.3, 0.4, -3.0], Some([0.6, 2.5])),
            sample([0.3, 0.4, -3.0], None),
        ];
        let stanford = Stanford::of(&samples, [1.0, 2.0]).unwrap();
        let Counts { nominal, hazardously_misleading, .. } = stanford.horizontal;
        assert_eq!((nominal, hazardously_misleading, stanford.unmonitored), (1, 1, 1));
        let Counts { nominal, unavailable_misleading, true_alerts, .. } = stanford.vertical;
        assert_eq!((nominal, unavailable_misleading, true_alerts), (1, 1, 1));
        assert!(stanford.rows()[1].contains("50.000 %"), "{:?}", stanford.rows());
        assert_eq!(Stanford::of(&samples[2..], [1.0, 2.0]), None);
        assert!(stanford.drawing().shapes.len() > 40);
        let directory = tempfile::tempdir().unwrap();
        let files = stanford.write(directory.path(), "pl").unwrap();
        assert_eq!(files.len(), 3);
        let table = std::fs::read_to_string(directory.path().join("pl.csv")).unwrap();
        assert!(table.contains("\nhorizontal,1,2,1,0,1,0,0,0,0\nvertical,2,2,1,0,0,0,1,0,1\n"), "{table}");
    }
}
