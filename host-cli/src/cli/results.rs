//! The result files of a run: `.pos`, CSV and JSON summary side by side.

use crate::write::csv::CsvWriter;
use crate::write::pos::{Header, PosWriter};
use crate::write::summary::{Summary, SummaryBuilder};
use anyhow::Context;
use serde::Serialize;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surefix_core::gnss::solution::Solution;

/// Result files that are being written.
pub struct Results {
    paths: [PathBuf; 3],
    pos: PosWriter<BufWriter<File>>,
    csv: CsvWriter<BufWriter<File>>,
    /// What the summary will say.
    pub summary: SummaryBuilder,
    inputs: Vec<String>,
    start: Instant,
}

impl Results {
    /// Creates `DIR/STEM.pos`, `.csv` and `.json`, the directory too if need be. The stem is the name of `input` up to
    /// its first dot.
    pub fn create(directory: &Path, input: &Path, header: &Header) -> anyhow::Result<Self> {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("{}: the directory cannot be made", directory.display()))?;
        let name = input.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.split('.').next().filter(|stem| !stem.is_empty()).unwrap_or("solution");
        let paths = ["pos", "csv", "json"].map(|extension| directory.join(format!("{stem}.{extension}")));
        let create = |path: &Path| {
            File::create(path).map(BufWriter::new).with_context(|| format!("{}: cannot be written", path.display()))
        };
        let pos = PosWriter::new(create(&paths[0])?, header)?;
        let csv = CsvWriter::new(create(&paths[1])?);
        let inputs = header.inputs.clone();
        Ok(Self { paths, pos, csv, summary: SummaryBuilder::default(), inputs, start: Instant::now() })
    }

    /// Writes one epoch.
    pub fn push(&mut self, solution: &Solution) -> anyhow::Result<()> {
        self.pos.push(solution).with_context(|| format!("{}: cannot be written", self.paths[0].display()))?;
        self.csv.push(solution).with_context(|| format!("{}: cannot be written", self.paths[1].display()))?;
        self.summary.push(solution);
        Ok(())
    }

    /// Writes the summary and closes the files.
    pub fn finish(self, config: &impl Serialize) -> anyhow::Result<(Summary, [PathBuf; 3])> {
        let Self { paths, pos, csv, summary, inputs, start } = self;
        let [pos_path, csv_path, json_path] = &paths;
        pos.finish().with_context(|| format!("{}: cannot be written", pos_path.display()))?;
        csv.finish().with_context(|| format!("{}: cannot be written", csv_path.display()))?;
        let summary = summary.finish(inputs, config, start.elapsed());
        let file = File::create(json_path).with_context(|| format!("{}: cannot be written", json_path.display()))?;
        summary.write(BufWriter::new(file)).with_context(|| format!("{}: cannot be written", json_path.display()))?;
        Ok((summary, paths))
    }

    /// Removes what was written: an error made it worthless.
    pub fn discard(self) {
        let paths = self.paths.clone();
        drop(self);
        for path in paths {
            // The JSON may not exist yet; the error that led here is the news.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// The few lines that a run prints.
pub fn report(summary: &Summary) -> String {
    let percent = |name: &str| {
        let count = summary.by_quality.get(name).copied().unwrap_or(0);
        if summary.epochs > 0 { 100.0 * count as f64 / summary.epochs as f64 } else { 0.0 }
    };
    let first_fix = summary.first_fix_s.map_or("none".into(), |seconds| format!("after {seconds:.0} s"));
    format!(
        "{} epochs: fixed {:.2} %, partially {:.2} %, float {:.2} %, code {:.2} %, none {:.2} %; first fix {first_fix}; \
         {:.0} epochs/s",
        summary.epochs,
        percent("fixed"),
        percent("partial"),
        percent("float"),
        percent("code"),
        percent("none"),
        summary.epochs_per_second.unwrap_or(0.0)
    )
}
