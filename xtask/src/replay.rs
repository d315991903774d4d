//! `cargo xtask replay`: a device log through the firmware.

use crate::firmware;
use crate::machine::Machine;
use crate::qemu;
use crate::toolchain::CortexM;
use anyhow::{Context, Result, ensure};
use std::path::PathBuf;

/// A frame that ends a log, as `surefix_core::log` writes it.
const END_MARK: &[u8] = include_bytes!("../../core/tests/golden/log_v1_event_end.bin");

/// Replay a device log on a simulated Cortex-M
///
/// The answer, a log of solutions or estimates, is what `surefix replay` writes on the host, byte for byte.
#[derive(clap::Args)]
pub struct Args {
    /// The log to replay
    log: PathBuf,
    /// Where to write the answer
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The machine
    #[arg(long, default_value = "an500")]
    machine: Machine,
    /// The program of the firmware: one of the presets; section_v64 or section_v32 for a log of the study of mixed-integer
    /// filters; fixed_lag64 or fixed_lag32, which need no log and answer smoothed densities; moving_base64 or moving_base32, and
    /// ppp64, which need none either and answer positions
    #[arg(long, default_value = "replay64")]
    program: String,
}

/// Builds the firmware, runs it and writes its answer.
pub fn run(args: &Args) -> Result<()> {
    let mut log = std::fs::read(&args.log).with_context(|| format!("{} cannot be read", args.log.display()))?;
    // A serial line has no end of its own: the firmware must stop even if the log was cut off.
    if !log.ends_with(END_MARK) {
        log.extend_from_slice(END_MARK);
    }
    let program = firmware::build_one(&CortexM::find_or_install()?, args.machine, &args.program)?;
    let run = qemu::run(&program, &log)?;
    run.messages.iter().for_each(|message| println!("{message}"));
    ensure!(run.success(), "the replay failed: {run}");
    if let Some(output) = &args.output {
        std::fs::write(output, &run.uart).with_context(|| format!("{} cannot be written", output.display()))?;
    }
    Ok(())
}
