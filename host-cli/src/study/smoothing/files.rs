//! The study as files: CSV of every number with all its digits, and the figures.

use super::super::statistics::both;
use super::adaptation::Reading;
use super::section::{independent, paper};
use super::trial::{Posterior, Scheme};
use super::{Adaptation, Study, Table, figure};
use crate::write::files::{Csv, Files, FilesError};
use std::io;
use std::path::{Path, PathBuf};

impl Study {
    /// Writes what there is into a directory, which is made if need be. Returns the files.
    pub fn write(&self, directory: &Path) -> Result<Vec<PathBuf>, FilesError> {
        let in_directory = |error| FilesError::Io { path: directory.to_owned(), error };
        let mut files = Files::default();
        files.push("acceptance.csv", acceptance(self).map_err(in_directory)?);
        if !self.tables.is_empty() {
            files.push("table2.csv", table_2(&self.tables).map_err(in_directory)?);
        }
        for table in &self.tables {
            let name = format!("figure2-{:?}", table.part).to_lowercase();
            files.push(format!("{name}.csv"), epochs(table).map_err(in_directory)?);
            files.draw(&name, &figure::errors_in_time(table))?;
        }
        if let Some(adaptation) = &self.adaptation {
            files.push("figure3.csv", adaptation_epochs(adaptation).map_err(in_directory)?);
            files.draw("figure3", &figure::adaptation_in_time(adaptation))?;
            files.push("figure4.csv", iterations(adaptation).map_err(in_directory)?);
            files.draw("figure4", &figure::convergence(adaptation))?;
        }
        files.write(directory)
    }
}

fn acceptance(study: &Study) -> io::Result<Vec<u8>> {
    let mut csv = Csv::new(["quantity", "verdict", "value", "standard_error", "band_low", "band_high"])?;
    for line in study.acceptance() {
        let [value, standard_error] = both(line.value);
        let verdict = line.verdict().name().to_lowercase();
        csv.row(&[&line.quantity, &verdict], [value, standard_error, line.low, line.high])?;
    }
    csv.finish()
}

fn table_2(tables: &[Table]) -> io::Result<Vec<u8>> {
    #[rustfmt::skip]
    let mut csv = Csv::new([
        "configuration", "model", "integers_from", "fixed_estimate", "scheme",
        "ta_rmse_m", "ta_rmse_m_se", "s_rmse_m", "s_rmse_m_se", "s_rmse_window_m", "s_rmse_window_m_se", "s_rapc_m",
        "rmse_over_rapc", "rmse_over_rapc_se", "ta_ifa_percent", "ta_ifa_percent_se", "ct_s", "difference_from_erts_m",
        "paper_ta_rmse_m", "paper_s_rmse_m", "paper_s_rapc_m", "paper_ta_ifa_percent", "paper_ct_s",
        "independent_ta_rmse_m", "independent_s_rmse_window_m", "independent_s_rapc_m", "independent_ta_ifa_percent",
    ])?;
    for table in tables {
        for row in &table.rows {
            for (source, estimate) in Posterior::ALL.into_iter().flat_map(|s| Posterior::ALL.map(|e| (s, e))) {
                let outcome = row.outcome(source, estimate);
                let paper = (source == estimate).then(|| paper(row.differences, source, row.scheme));
                let independent = independent(table.part, row.differences, source, estimate);
                let [first, second] = [paper, independent].map(|reference| {
                    reference.map_or([f64::NAN; 5], |r| [r.mean_rmse, r.rmse, r.rapc, r.right, r.seconds])
                });
                let ours =
                    [outcome.mean_rmse, outcome.middle_rmse, outcome.window_rmse].map(both).into_iter().flatten();
                let numbers = ours
                    .chain([outcome.middle_rapc])
                    .chain([outcome.ratio, outcome.right].map(both).into_iter().flatten())
                    .chain([outcome.seconds, row.difference])
                    .chain(first)
                    .chain(second.into_iter().take(4));
                let part = format!("{:?}", table.part).to_lowercase();
                let names = [&part, row.differences.name(), source.name(), estimate.name(), row.scheme.name()];
                csv.row(&names, numbers)?;
            }
        }
    }
    csv.finish()
}

/// RMSE and RAPC of each epoch, of all rows and combinations.
fn epochs(table: &Table) -> io::Result<Vec<u8>> {
    let mut header = vec!["epoch".to_owned()];
    let mut series = Vec::new();
    for row in &table.rows {
        for (source, estimate) in Posterior::ALL.into_iter().flat_map(|s| Posterior::ALL.map(|e| (s, e))) {
            let outcome = row.outcome(source, estimate);
            let scheme = match row.scheme {
                Scheme::Erts => "erts",
                Scheme::Ut => "ut",
                Scheme::Sr => "sr",
            };
            let model = row.differences.name().to_lowercase().replace('-', "_");
            let name = format!("{model}_{scheme}_integers_{}_fixed_{}", source.name(), estimate.name());
            header.extend([format!("{name}_rmse_m"), format!("{name}_rapc_m")]);
            series.extend([outcome.rmse.as_slice(), outcome.rapc.as_slice()]);
        }
    }
    columns(&header, &series)
}

fn adaptation_epochs(adaptation: &Adaptation) -> io::Result<Vec<u8>> {
    let mut header = vec!["epoch".to_owned()];
    let mut series = Vec::new();
    for reading in Reading::ALL {
        for (name, case) in ["a", "b", "d"].into_iter().zip(&adaptation.cases[reading as usize]) {
            header.extend(["rmse", "rapc"].map(|quantity| format!("{}_{name}_{quantity}_m", reading.name())));
            series.extend(case.series.each_ref().map(Vec::as_slice));
        }
    }
    header.extend(["c_rmse_m".to_owned(), "c_rapc_m".to_owned()]);
    series.extend(adaptation.truth.series.each_ref().map(Vec::as_slice));
    columns(&header, &series)
}

/// Objective, likelihood and σ over their true ones, of each iteration of each run.
fn iterations(adaptation: &Adaptation) -> io::Result<Vec<u8>> {
    #[rustfmt::skip]
    let mut csv = Csv::new([
        "reading", "run", "iteration", "objective", "negative_log_likelihood", "sigma_x_over_true", "sigma_y_over_true",
        "sigma_z_over_true", "sigma_i_over_true", "sigma_t_over_true", "sigma_clock_over_true",
    ])?;
    for reading in Reading::ALL {
        for (run, adapted) in adaptation.runs.iter().enumerate() {
            let learning = &adapted.learning[reading as usize];
            for (i, (likelihood, ratios)) in
                learning.negative_log_likelihood.iter().zip(&learning.sigma_ratios).enumerate()
            {
                let objective = i.checked_sub(1).and_then(|i| learning.objective.get(i)).copied().unwrap_or(f64::NAN);
                let numbers = [run as f64, i as f64, objective, *likelihood].into_iter().chain(ratios.iter().copied());
                csv.row(&[reading.name()], numbers)?;
            }
        }
    }
    csv.finish()
}

/// Series side by side over their index.
fn columns(header: &[String], series: &[&[f64]]) -> io::Result<Vec<u8>> {
    let mut csv = Csv::new(header)?;
    let rows = series.iter().map(|series| series.len()).max().unwrap_or(0);
    for k in 0..rows {
        let values = series.iter().map(|series| series.get(k).copied().unwrap_or(f64::NAN));
        csv.row(&[], [k as f64].into_iter().chain(values))?;
    }
    csv.finish()
}
