//! Reads a device log as the stream of inputs that an engine is fed with.

use super::error::{LogError, check_start};
use crate::process::stream::Input;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use surefix_core::log::{self, Event, FrameError, InputReader};

/// Room for observations of an epoch; more than any receiver has channels.
const OBSERVATIONS: usize = 1024;
/// How many damaged places are remembered; all are counted.
const REMEMBERED: usize = 20;

/// Damage to a log: what there was and what is known of the places.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// The first damaged frames: byte offset and reason.
    pub frames: Vec<(u64, FrameError)>,
    /// Damaged frames in all.
    pub bad: u32,
    /// Epochs of which a part is missing.
    pub incomplete: u32,
    /// Observables that are NaN or infinite and were dropped.
    pub not_finite: u32,
    /// Records that the recording device says it lost.
    pub dropped: u64,
    /// The log was not ended on purpose: its end is missing, or the device lost power.
    pub no_end: bool,
}

impl Damage {
    /// Whether all is well.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Reads a log from `R`, in constant memory.
pub struct LogInputs<R> {
    file: String,
    input: R,
    reader: Box<InputReader<OBSERVATIONS>>,
    /// Inputs that were read and not yet given.
    queue: VecDeque<Input>,
    /// Bytes read, and where the frame that is being read starts.
    offset: u64,
    frame_start: u64,
    damage: Damage,
    finished: bool,
}

impl LogInputs<BufReader<File>> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let file = path.display().to_string();
        match File::open(path) {
            Ok(input) => Self::new(&file, BufReader::new(input)),
            Err(source) => Err(LogError::Open { file, source }),
        }
    }
}

impl<R: BufRead> LogInputs<R> {
    /// Reads `input`, called `file` in messages.
    pub fn new(file: &str, mut input: R) -> Result<Self, LogError> {
        check_start(file, &mut input)?;
        Ok(Self {
            file: file.to_owned(),
            input,
            reader: Box::default(),
            queue: VecDeque::new(),
            offset: 0,
            frame_start: 0,
            damage: Damage { no_end: true, ..Damage::default() },
            finished: false,
        })
    }

    /// What was damaged; complete after the end.
    pub fn damage(&self) -> &Damage {
        &self.damage
    }

    /// Reads on until there is something to give, or to the end.
    fn read_on(&mut self) -> Result<(), LogError> {
        let mut sink = |input: log::Input<'_>| {
            self.damage.no_end = !matches!(input, log::Input::Event(Event::End));
            if let log::Input::Event(Event::Dropped(count)) = input {
                self.damage.dropped += u64::from(count);
            }
            self.queue.extend(Input::from_log(input));
        };
        let io = |source| LogError::Io { file: self.file.clone(), offset: self.offset, source };
        let bytes = self.input.fill_buf().map_err(io)?;
        let (length, mut errors) = (bytes.len(), Vec::new());
        for &byte in bytes {
            errors.extend(self.reader.push(byte, &mut sink).map(|error| (self.frame_start, error)));
            self.offset += 1;
            if byte == 0 {
                self.frame_start = self.offset;
            }
        }
        self.input.consume(length);
        if length == 0 {
            self.finished = true;
            errors.extend(self.reader.finish(&mut sink).map(|error| (self.frame_start, error)));
            if self.reader.counts().good == 0 {
                return Err(LogError::NoRecord { file: self.file.clone(), bytes: self.offset });
            }
        }
        let room = REMEMBERED - self.damage.frames.len();
        self.damage.frames.extend(errors.into_iter().take(room));
        self.damage.bad = self.reader.counts().bad();
        self.damage.not_finite = self.reader.counts().observables_not_finite;
        self.damage.incomplete = self.reader.incomplete();
        Ok(())
    }
}

impl<R: BufRead> Iterator for LogInputs<R> {
    type Item = Result<Input, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.queue.is_empty() && !self.finished {
            if let Err(error) = self.read_on() {
                self.finished = true;
                return Some(Err(error));
            }
        }
        self.queue.pop_front().map(Ok)
    }
}
