//! The result files of a run: `.pos`, CSV and JSON summary side by side.

use crate::write::csv::CsvWriter;
use crate::write::partial_file::PartialFile;
use crate::write::pos::{Header, PosWriter};
use crate::write::summary::{Summary, SummaryBuilder};
use anyhow::Context;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surefix_core::gnss::solution::Solution;

/// Result files that are being written. They get their names when all are complete; until then, and after an error, the
/// files of an earlier run stay as they are.
pub struct Results {
    paths: [PathBuf; 3],
    pos: PosWriter<PartialFile>,
    csv: CsvWriter<PartialFile>,
    json: PartialFile,
    /// What the summary will say.
    pub summary: SummaryBuilder,
    inputs: Vec<String>,
    start: Instant,
}

impl Results {
    /// Starts `DIR/STEM.pos`, `.csv` and `.json`, and makes the directory if need be. The stem is the name of `input` up
    /// to its first dot.
    pub fn create(directory: &Path, input: &Path, header: &Header) -> anyhow::Result<Self> {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("{}: the directory cannot be made", directory.display()))?;
        let name = input.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.split('.').next().filter(|stem| !stem.is_empty()).unwrap_or("solution");
        let paths = ["pos", "csv", "json"].map(|extension| directory.join(format!("{stem}.{extension}")));
        let create = |path| PartialFile::create(path).with_context(|| cannot_write(path));
        let pos = PosWriter::new(create(&paths[0])?, header).with_context(|| cannot_write(&paths[0]))?;
        let (csv, json) = (CsvWriter::new(create(&paths[1])?), create(&paths[2])?);
        let inputs = header.inputs.clone();
        Ok(Self { paths, pos, csv, json, summary: SummaryBuilder::default(), inputs, start: Instant::now() })
    }

    /// Writes one epoch.
    pub fn push(&mut self, solution: &Solution) -> anyhow::Result<()> {
        self.pos.push(solution).with_context(|| cannot_write(&self.paths[0]))?;
        self.csv.push(solution).with_context(|| cannot_write(&self.paths[1]))?;
        self.summary.push(solution);
        Ok(())
    }

    /// Writes the summary and gives the files their names.
    pub fn finish(self, config: &impl Serialize) -> anyhow::Result<(Summary, [PathBuf; 3])> {
        let Self { paths, pos, csv, mut json, summary, inputs, start } = self;
        let pos = pos.finish().with_context(|| cannot_write(&paths[0]))?;
        let csv = csv.finish().with_context(|| cannot_write(&paths[1]))?;
        let summary = summary.finish(inputs, config, start.elapsed());
        summary.write(&mut json).with_context(|| cannot_write(&paths[2]))?;
        PartialFile::keep_all([pos, csv, json]).with_context(|| cannot_write(&paths[0]))?;
        Ok((summary, paths))
    }
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot be written; check the path, the permissions and the space", path.display())
}

/// The few lines that a run prints.
pub fn report(summary: &Summary) -> String {
    let percent = |name: &str| {
        let count = summary.by_quality.get(name).copied().unwrap_or(0);
        if summary.epochs > 0 { 100.0 * count as f64 / summary.epochs as f64 } else { 0.0 }
    };
    let first_fix = summary.first_fix_s.map_or("none".into(), |seconds| format!("after {seconds:.0} s"));
    let smoothing = summary.smoothing.as_ref().map_or(String::new(), |smoothing| format!("\n{smoothing}"));
    format!(
        "{} epochs: fixed {:.2} %, partially {:.2} %, float {:.2} %, code {:.2} %, none {:.2} %; first fix {first_fix}; \
         {:.0} epochs/s{smoothing}",
        summary.epochs,
        percent("fixed"),
        percent("partial"),
        percent("float"),
        percent("code"),
        percent("none"),
        summary.epochs_per_second.unwrap_or(0.0)
    )
}
