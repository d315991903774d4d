//! Runs a device log of the study of mixed-integer filters: measurements from any byte stream to the engine of Section V,
//! estimates to any other.
//!
//! The answer is a device log too: a frame for each estimate, in order, and an end mark. It is the same byte for byte
//! as the host's.

use crate::board::InstructionCounter;
use crate::replay::{Cost, Stopped};
use embedded_io::{Read, Write};
use surefix_core::filter::section_v::SectionVEngine;
use surefix_core::log::{Event, MAX_FRAME, Record, RecordReader, WriteError, write_event};
use surefix_core::real::Real;

/// What came of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Instructions for an epoch, from measurements to both densities.
    pub epochs: Cost,
    /// Epochs that the filter refused.
    pub refused: u32,
    /// Slips that were flagged.
    pub slips: u32,
    /// Damaged frames of the log.
    pub damaged: u32,
    /// The log had its end mark.
    pub ended: bool,
}

impl Summary {
    /// Says it by defmt, one `name: value` a line, as the task runner reads it.
    pub fn report(&self) {
        defmt::info!("epochs: {=u32}", self.epochs.count);
        defmt::info!("refused: {=u32}", self.refused);
        defmt::info!("slips: {=u32}", self.slips);
        defmt::info!("instructions per epoch, mean: {=u64}", self.epochs.mean());
        defmt::info!("instructions per epoch, most: {=u64}", self.epochs.max);
        if self.damaged > 0 {
            defmt::warn!("damaged frames: {=u32}", self.damaged);
        }
        if !self.ended {
            defmt::warn!("the log has no end mark");
        }
    }
}

/// State of a run, for a `static`. T is the scalar of the covariances.
pub struct Replay<T> {
    reader: RecordReader,
    engine: SectionVEngine<T>,
    frame: [u8; MAX_FRAME],
}

impl<T: Real> Default for Replay<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Replay<T> {
    /// A run by an engine that was told nothing.
    pub const fn new() -> Self {
        Self { reader: RecordReader::new(), engine: SectionVEngine::new(), frame: [0; MAX_FRAME] }
    }

    /// Reads a log from `source` up to its first end mark or the end of the stream, and writes the answer to `sink`.
    pub fn run<R: Read, W: Write>(
        &mut self,
        mut source: R,
        mut sink: W,
        counter: &InstructionCounter,
    ) -> Result<Summary, Stopped<R::Error, W::Error>> {
        let mut summary = Summary::default();
        let mut byte = [0];
        while !summary.ended && source.read(&mut byte).map_err(Stopped::Read)? > 0 {
            let record = match self.reader.push(byte[0]) {
                None => continue,
                Some(Ok(record)) => record,
                Some(Err(error)) => {
                    defmt::warn!("damaged frame: {}", defmt::Display2Format(&error));
                    summary.damaged += 1;
                    continue;
                }
            };
            summary.ended = matches!(record, Record::Event(Event::End));
            let engine = &mut self.engine;
            let (answer, instructions) = counter.measure(move || engine.feed(&record));
            if let Some(answer) = answer {
                summary.epochs.add(instructions);
                match answer.outcome {
                    Ok(outcome) => summary.slips += outcome.slips as u32,
                    Err(_) => summary.refused += 1,
                }
                let written = answer.write(&mut self.frame);
                sink.write_all(bytes(&self.frame, written)).map_err(Stopped::Write)?;
            }
        }
        let written = write_event(&Event::End, &mut self.frame);
        sink.write_all(bytes(&self.frame, written)).map_err(Stopped::Write)?;
        sink.flush().map_err(Stopped::Write)?;
        Ok(summary)
    }
}

/// The frame just written. A frame has room for each of these records.
fn bytes(frame: &[u8; MAX_FRAME], written: Result<usize, WriteError>) -> &[u8] {
    written.ok().and_then(|length| frame.get(..length)).unwrap_or(&[])
}

/// Makes a program of the engine with a scalar: it runs the log that comes over UART0, answers there, and says by defmt
/// what that took.
#[macro_export]
macro_rules! section_v_over_uart {
    ($scalar:ty) => {
        #[cortex_m_rt::entry]
        fn main() -> ! {
            static mut REPLAY: $crate::section_v::Replay<$scalar> = $crate::section_v::Replay::new();
            use $crate::board::{self, Board};
            let Some(Board { counter, uart, stack }) = Board::take() else { board::exit(1) };
            let Ok(summary) = REPLAY.run(uart.receiver, uart.transmitter, &counter);
            summary.report();
            defmt::info!("state and workspace: {=usize}", core::mem::size_of_val(REPLAY));
            defmt::info!("peak stack: {=usize}", stack.peak());
            board::exit(if summary.ended { 0 } else { 1 })
        }
    };
}
