//! The study as CSV and drawings.

use super::super::statistics::both;
use super::trial::LOOKS;
use super::variant::names;
use super::{Study, Table};
use crate::plot::panel::{Frame, Panel, Range};
use crate::plot::{BLUE, Color, Drawing, GREEN, ORANGE, RED};
use crate::write::files::{Csv, Files, FilesError};
use std::io;
use std::path::{Path, PathBuf};

impl Study {
    /// Writes every table and drawing into a directory, and returns where they are.
    pub fn write(&self, directory: &Path) -> Result<Vec<PathBuf>, FilesError> {
        let mut files = Files::default();
        let at = |error: io::Error| FilesError::Io { path: directory.to_owned(), error };
        files.push("acceptance.csv", self.acceptance_csv().map_err(at)?);
        if !self.tables.is_empty() {
            files.push("schemes.csv", self.schemes_csv().map_err(at)?);
        }
        for table in &self.tables {
            files.draw(&format!("likelihood-{}", table.motion.name()), &likelihoods(table))?;
        }
        if !self.starts.is_empty() {
            let mut csv = Csv::new("scheme,ended,likelihood,position_m,nees_low,nees_high".split(',')).map_err(at)?;
            for of in &self.starts {
                let numbers = [of.ended as f64, of.likelihood, of.position, of.nees[0], of.nees[1]];
                csv.row(&[of.name], numbers).map_err(at)?;
            }
            files.push("starts.csv", csv.finish().map_err(at)?);
        }
        if !self.speed.is_empty() {
            let mut csv = Csv::new("motion,em,within_10,within_1,within_0.1".split(',')).map_err(at)?;
            for of in &self.speed {
                for (name, row) in ["plain", "accelerated"].iter().zip(&of.evaluations) {
                    let numbers = row.map(|n| n.map_or(f64::NAN, |n| n as f64));
                    csv.row(&[of.motion.name(), name], numbers).map_err(at)?;
                }
            }
            files.push("speed.csv", csv.finish().map_err(at)?);
        }
        files.write(directory)
    }

    fn acceptance_csv(&self) -> io::Result<Vec<u8>> {
        let mut csv = Csv::new(["quantity", "verdict", "value", "standard_error", "low", "high"])?;
        for line in self.acceptance() {
            let numbers = both(line.value).into_iter().chain([line.low, line.high]);
            csv.row(&[&line.quantity, line.verdict().name()], numbers)?;
        }
        csv.finish()
    }

    /// Every run at every look.
    fn schemes_csv(&self) -> io::Result<Vec<u8>> {
        let header = "motion,scheme,run,iterations,likelihood,filter_rms_m,smoother_rms_m,nees,walk,held_out,truth";
        let mut csv = Csv::new(header.split(','))?;
        for table in &self.tables {
            for (variant, trials) in &table.rows {
                for (run, trial) in trials.iter().enumerate() {
                    for (look, at) in trial.looks.iter().zip(LOOKS) {
                        let Some(look) = look else { continue };
                        let likelihood = trial.likelihoods.get(at).copied().unwrap_or(f64::NAN);
                        let numbers = [run as f64, at as f64, likelihood, look.filter, look.smoother, look.nees];
                        let more = [look.walk, look.held_out, table.truth.get(run).copied().unwrap_or(f64::NAN)];
                        csv.row(&[table.motion.name(), variant.name], numbers.into_iter().chain(more))?;
                    }
                }
            }
        }
        csv.finish()
    }
}

/// ℓ of the first run against iterations.
fn likelihoods(table: &Table) -> Drawing {
    let mut drawing = Drawing::new(900, 360);
    let colors: [(&str, Color); 4] =
        [(names::EPOCH, RED), (names::TYPE, ORANGE), (names::ELEVATION, GREEN), (names::STUDENT, BLUE)];
    let drawn: Vec<_> = colors
        .into_iter()
        .filter_map(|(name, color)| Some((name, color, &table.trials(name).first()?.likelihoods)))
        .collect();
    let values = drawn.iter().flat_map(|(_, _, list)| list.iter().copied());
    let (low, high) = values.fold((0.0f64, 1.0f64), |(low, high), x| (low.min(x), high.max(x)));
    let last = drawn.iter().map(|(_, _, list)| list.len()).max().unwrap_or(1).max(2) - 1;
    let frame = Frame { left: 90.0, top: 50.0, width: 780.0, height: 250.0 };
    let (x, y) = (Range { low: 0.0, high: last as f64 }, Range { low, high });
    let mut panel = Panel::new(&mut drawing, frame, x, y, "-2 ln likelihood by iteration", true);
    for (_, color, list) in &drawn {
        let points: Vec<(f64, f64)> = list.iter().enumerate().map(|(i, &value)| (i as f64, value)).collect();
        panel.line(&points, *color, 1.5);
    }
    let legend: Vec<(&str, Color)> = drawn.iter().map(|(name, color, _)| (*name, *color)).collect();
    panel.finish(&legend);
    drawing
}
