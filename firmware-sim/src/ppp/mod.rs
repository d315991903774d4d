//! Precise point positioning of a receiver at rest and one that moves, with the ionosphere combined away and estimated.
//!
//! No input; the answer on UART0 is each epoch's, kind after kind, see [`drive::write`]. It is the same byte for byte as the
//! host's. One engine does all drives, one after the other.

pub mod drive;

use crate::board::InstructionCounter;
use crate::replay::Cost;
use drive::{Drive, EPOCHS, Kind, write};
use embedded_io::Write;
use surefix_core::gnss::solution::Quality;

/// What came of a drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Instructions for an epoch, from observations to answer.
    pub epochs: Cost,
    /// Epochs with a position by phases.
    pub float: u32,
    /// Position error of the last epoch `[m]`.
    pub error: f64,
}

/// Drives all epochs of a kind and writes the answers to `sink`.
pub fn run<W: Write>(
    drive: &mut Drive,
    kind: Kind,
    sink: &mut W,
    counter: &InstructionCounter,
) -> Result<Summary, W::Error> {
    let mut summary = Summary::default();
    drive.start(kind);
    for _ in 0..EPOCHS {
        let observations = drive.observe();
        let (answer, instructions) = counter.measure(|| drive.advance(&observations));
        summary.epochs.add(instructions);
        summary.float += u32::from(answer.solution.quality == Quality::Float);
        summary.error = drive.error(&answer);
        write(&answer, |bytes| sink.write_all(bytes))?;
    }
    sink.flush()?;
    Ok(summary)
}
