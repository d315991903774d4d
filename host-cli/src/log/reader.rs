//! Reads device logs frame by frame, with the place of each.

use super::error::{LogError, check_start};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use surefix_core::log::{Counts, FrameError, Record, RecordReader};

/// A frame of a log.
#[derive(Debug)]
pub struct Frame<'a> {
    /// Where it starts: bytes before it.
    pub offset: u64,
    /// Its bytes, delimiters not counted.
    pub length: u64,
    /// The file ends before the delimiter that should end the frame.
    pub cut_off: bool,
    /// What it says, or why it says nothing.
    pub record: Result<Record<'a>, FrameError>,
}

/// Reads a log from `R` in constant memory.
///
/// ```no_run
/// # fn main() -> Result<(), surefix::log::LogError> {
/// let mut log = surefix::log::LogReader::open("drive.sfl".as_ref())?;
/// while let Some(frame) = log.next_frame()? {
///     println!("{} {:?}", frame.offset, frame.record);
/// }
/// println!("{:?}", log.counts());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct LogReader<R> {
    file: String,
    input: R,
    reader: RecordReader,
    /// Bytes read.
    offset: u64,
}

impl LogReader<BufReader<File>> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let file = path.display().to_string();
        match File::open(path) {
            Ok(input) => Self::new(&file, BufReader::new(input)),
            Err(source) => Err(LogError::Open { file, source }),
        }
    }
}

impl<R: BufRead> LogReader<R> {
    /// Reads `input`, called `file` in messages.
    pub fn new(file: &str, mut input: R) -> Result<Self, LogError> {
        check_start(file, &mut input)?;
        Ok(Self { file: file.to_owned(), input, reader: RecordReader::new(), offset: 0 })
    }

    /// The next frame, good or bad; `None` at the end of a log that has at least one good one.
    pub fn next_frame(&mut self) -> Result<Option<Frame<'_>>, LogError> {
        let mut length = 0;
        let cut_off = loop {
            match self.next_byte()? {
                Some(0) if length == 0 => {}
                Some(0) => break false,
                Some(byte) => {
                    length += 1;
                    let inside = self.reader.push(byte);
                    debug_assert!(inside.is_none(), "only a delimiter ends a frame");
                }
                None => break true,
            }
        };
        let offset = self.offset - length - u64::from(!cut_off);
        if length == 0 {
            let found_any = self.reader.counts().good > 0;
            let error = LogError::NoRecord { file: self.file.clone(), bytes: self.offset };
            return if found_any { Ok(None) } else { Err(error) };
        }
        Ok(self.reader.finish().map(|record| Frame { offset, length, cut_off, record }))
    }

    /// What was read so far.
    pub fn counts(&self) -> &Counts {
        self.reader.counts()
    }

    fn next_byte(&mut self) -> Result<Option<u8>, LogError> {
        let io = |source| LogError::Io { file: self.file.clone(), offset: self.offset, source };
        let byte = self.input.fill_buf().map_err(io)?.first().copied();
        if byte.is_some() {
            self.input.consume(1);
            self.offset += 1;
        }
        Ok(byte)
    }
}
