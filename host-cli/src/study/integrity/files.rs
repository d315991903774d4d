//! The study as CSV and drawings.

use super::super::statistics::both;
use super::variant::RECOMMENDED;
use super::{Study, bounds, figure, risk};
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
            files.push("filters.csv", self.filters_csv().map_err(at)?);
        }
        if let Some(outcome) = &self.risk {
            let mut csv = Csv::new(["level", "risk", "promised", "rate", "standard_error"]).map_err(at)?;
            for (of, rates) in risk::RISKS.iter().zip(&outcome.rates) {
                for (level, rate) in risk::LEVELS.iter().zip(rates) {
                    csv.row(&[level], [*of, risk::promised(*of), rate.value, rate.standard_error]).map_err(at)?;
                }
            }
            files.push("risk.csv", csv.finish().map_err(at)?);
        }
        if let Some(of) = &self.bounds {
            let mut csv = Csv::new(bounds::COLUMNS).map_err(at)?;
            of.rows.iter().try_for_each(|row| csv.row(&[], *row)).map_err(at)?;
            files.push("figure4.csv", csv.finish().map_err(at)?);
            files.draw("figure4", &figure::success_rates(of))?;
        }
        for table in &self.tables {
            let name = table.noise.name();
            files.draw(&format!("figure10-{name}"), &figure::success(table))?;
            files.draw(&format!("figure11-{name}"), &figure::errors(table))?;
            files.draw(&format!("figure12-{name}"), &figure::levels(table))?;
            let runs = [(13, "KF"), (14, "AKF residual, floor"), (15, "IAVAKF residual, floor"), (16, RECOMMENDED)];
            for (number, of) in runs {
                if let Some(stanford) = table.first(of).and_then(figure::stanford) {
                    files.draw(&format!("figure{number}-{name}"), &stanford.drawing())?;
                }
            }
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

    fn filters_csv(&self) -> io::Result<Vec<u8>> {
        let header = "noise,filter,runs,mean_m,std_m,rms_m,fixed,fixed_se,wrong,wrong_se,beyond_h,beyond_h_se,beyond_v,\
                      beyond_v_se,hpl_m,vpl_m,refused,indefinite";
        let mut csv = Csv::new(header.split(','))?;
        for table in &self.tables {
            for (variant, o) in &table.rows {
                let numbers = [o.runs as f64, o.mean, o.deviation, o.rms]
                    .into_iter()
                    .chain([o.fixed, o.wrong, o.beyond[0], o.beyond[1]].into_iter().flat_map(both))
                    .chain([o.levels[0], o.levels[1], o.refused as f64, o.indefinite as f64]);
                csv.row(&[table.noise.name(), variant.name], numbers)?;
            }
        }
        csv.finish()
    }
}
