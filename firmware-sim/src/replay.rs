//! Replays a device log: inputs from any byte stream to the engine, solution frames to any other.
//!
//! The answer is a device log too: a frame for each solution, in order, and an end mark. It is the same byte for byte
//! as the host's.

use crate::board::InstructionCounter;
use embedded_io::{Read, Write};
use surefix_core::gnss::solution::{Quality, Solution};
use surefix_core::log::{Event, FrameError, Input, InputReader, MAX_FRAME, WriteError, write_event, write_solution};
use surefix_core::rtk::RtkFilter;

/// Room for observations of an epoch.
const OBSERVATIONS: usize = 192;

/// Instructions that one kind of work took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// How often it was done.
    pub count: u32,
    /// Instructions in all.
    pub total: u64,
    /// Most instructions at once.
    pub max: u64,
}

impl Cost {
    pub(crate) fn add(&mut self, instructions: u64) {
        self.count += 1;
        self.total += instructions;
        self.max = self.max.max(instructions);
    }

    /// Instructions each time, on the average.
    pub fn mean(&self) -> u64 {
        self.total.checked_div(u64::from(self.count)).unwrap_or(0)
    }
}

/// What came of a replay.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Instructions for a rover epoch, from observations to solution.
    pub epochs: Cost,
    /// Solutions by quality: fixed, partial, float, code, none.
    pub qualities: [u32; 5],
    /// Damaged frames of the log.
    pub damaged: u32,
    /// The log had its end mark.
    pub ended: bool,
}

impl Summary {
    fn count(&mut self, solution: &Solution) {
        let index = match solution.quality {
            Quality::Fixed => 0,
            Quality::Partial => 1,
            Quality::Float => 2,
            Quality::Code => 3,
            Quality::None => 4,
        };
        self.qualities[index] += 1;
    }

    /// Says it by defmt, one `name: value` a line, as the task runner reads it.
    pub fn report(&self) {
        let [fixed, partial, float, code, none] = self.qualities;
        defmt::info!("fixed, partial, float, code, none: {} {} {} {} {}", fixed, partial, float, code, none);
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

/// A filter of any size.
pub trait Filter {
    /// Takes one record of a log. A rover epoch is answered by a solution.
    fn feed(&mut self, input: &Input<'_>) -> Option<Solution>;
}

impl<const C: usize, const N: usize, const E: usize> Filter for RtkFilter<C, N, E> {
    fn feed(&mut self, input: &Input<'_>) -> Option<Solution> {
        RtkFilter::feed(self, input)
    }
}

/// State of a replay by a filter of some size, for a `static`.
pub struct Replay<F> {
    inputs: InputReader<OBSERVATIONS>,
    filter: F,
    frame: [u8; MAX_FRAME],
}

impl<F: Filter> Replay<F> {
    /// A replay by a filter that has seen nothing.
    pub const fn new(filter: F) -> Self {
        Self { inputs: InputReader::new(), filter, frame: [0; MAX_FRAME] }
    }

    /// Reads a log from `source` up to its first end mark or the end of the stream, and writes the answer to `sink`.
    pub fn run<R: Read, W: Write>(
        &mut self,
        mut source: R,
        sink: W,
        counter: &InstructionCounter,
    ) -> Result<Summary, Stopped<R::Error, W::Error>> {
        let Self { inputs, filter, frame } = self;
        let mut answer = Answer { filter, frame, sink, counter, summary: Summary::default(), failed: None };
        let mut buffer = [0; 64];
        while !answer.summary.ended && answer.failed.is_none() {
            let count = source.read(&mut buffer).map_err(Stopped::Read)?;
            if count == 0 {
                break;
            }
            for &byte in buffer.iter().take(count) {
                if let Some(error) = inputs.push(byte, |input| answer.take(input)) {
                    answer.note_damage(error);
                }
                if answer.summary.ended {
                    break;
                }
            }
        }
        if let Some(error) = inputs.finish(|input| answer.take(input)) {
            answer.note_damage(error);
        }
        answer.finish().map_err(Stopped::Write)
    }
}

/// The answer while it is given.
struct Answer<'a, F, W: Write> {
    filter: &'a mut F,
    frame: &'a mut [u8; MAX_FRAME],
    sink: W,
    counter: &'a InstructionCounter,
    summary: Summary,
    failed: Option<W::Error>,
}

impl<F: Filter, W: Write> Answer<'_, F, W> {
    /// Tells the engine; writes its solution, if it has one now.
    fn take(&mut self, input: Input<'_>) {
        self.summary.ended |= matches!(input, Input::Event(Event::End));
        let (solution, instructions) = self.counter.measure(|| self.filter.feed(&input));
        if let Some(solution) = solution {
            self.summary.epochs.add(instructions);
            self.summary.count(&solution);
            let written = write_solution(&solution, self.frame);
            self.send(written);
        }
    }

    fn note_damage(&mut self, error: FrameError) {
        defmt::warn!("damaged frame: {}", defmt::Display2Format(&error));
        self.summary.damaged += 1;
    }

    /// Writes the end mark.
    fn finish(mut self) -> Result<Summary, W::Error> {
        let written = write_event(&Event::End, self.frame);
        self.send(written);
        match self.failed {
            None => self.sink.flush().map(|()| self.summary),
            Some(error) => Err(error),
        }
    }

    /// Sends the frame just written, unless the sink has failed before. A frame has room for each of these records.
    fn send(&mut self, written: Result<usize, WriteError>) {
        let bytes = written.ok().and_then(|length| self.frame.get(..length)).unwrap_or(&[]);
        if self.failed.is_none() {
            self.failed = self.sink.write_all(bytes).err();
        }
    }
}

/// Makes a program of a preset of the filter: it replays the log that comes over UART0, answers there, and says by defmt
/// what that took.
#[macro_export]
macro_rules! replay_over_uart {
    ($preset:ty) => {
        #[cortex_m_rt::entry]
        fn main() -> ! {
            static mut REPLAY: $crate::replay::Replay<$preset> =
                $crate::replay::Replay::new(<$preset>::new(surefix_core::rtk::RtkConfig::DEFAULT, None));
            use $crate::board::{self, Board};
            let Some(Board { counter, uart, stack }) = Board::take() else { board::exit(1) };
            let Ok(summary) = REPLAY.run(uart.receiver, uart.transmitter, &counter);
            summary.report();
            defmt::info!("peak stack: {=usize}", stack.peak());
            board::exit(if summary.ended { 0 } else { 1 })
        }
    };
}

/// Which stream failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped<R, W> {
    /// The log cannot be read.
    Read(R),
    /// The answer cannot be written.
    Write(W),
}
