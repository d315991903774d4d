//! `surefix log pack`.

use crate::cli::Outcome;
use crate::cli::engine::EngineArgs;
use crate::cli::files::{Files, OpenFiles};
use crate::log::LogWriter;
use crate::write::partial_file::PartialFile;
use anyhow::Context;
use std::path::PathBuf;
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::feed::CONFIG_SCHEMA;

/// Make a device log of RINEX files, its records in the order in which a receiver would have them.
///
/// Nothing recorded is lost or rounded: `surefix replay` of the log gives what `surefix post` gives of the files. The
/// settings are put into the log, so that every replay uses them.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    engine: EngineArgs,
    /// The log to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let config = args.engine.rtk_config()?;
    let mut files = args.files.open()?;
    files.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    let cannot_write = || format!("{}: cannot be written", args.output.display());
    let file = PartialFile::create(&args.output).with_context(cannot_write)?;
    let done = write_log(&mut files, &config, LogWriter::new(file));
    files.reports().iter().for_each(|report| eprintln!("{report}"));
    let (file, records) = done?;
    file.keep().with_context(cannot_write)?;
    eprintln!("{}: {records} records", args.output.display());
    Ok(Outcome::Good)
}

fn write_log(
    files: &mut OpenFiles,
    config: &RtkConfig,
    mut log: LogWriter<PartialFile>,
) -> anyhow::Result<(PartialFile, u64)> {
    const CANNOT_WRITE: &str = "the log cannot be written";
    log.config(CONFIG_SCHEMA, config).context(CANNOT_WRITE)?;
    let mut records = 1;
    let mut stream = files.stream();
    for input in stream.by_ref() {
        log.input(&input?).context(CANNOT_WRITE)?;
        records += 1;
    }
    stream.coverage()?;
    Ok((log.finish().context(CANNOT_WRITE)?, records))
}
