//! Lines of a plain or gzipped file: bounded in length, LF or CR LF, any bytes.

use super::error::ReadError;
use super::report::{ReadReport, Reason};
use flate2::bufread::MultiGzDecoder;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// No line is longer: 1000 observation types take 16 KB.
const LONGEST_LINE: u64 = 1 << 16;

/// The lines of an input, one at a time.
pub struct Lines {
    file: String,
    input: Box<dyn BufRead + Send>,
    line: Vec<u8>,
    number: u64,
    whole: bool,
    unread: bool,
}

impl Lines {
    /// Opens a file, plain or gzipped (told by its first bytes, not by its name).
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let name = path.display().to_string();
        let fail = |source| ReadError::Open { file: name.clone(), source };
        let mut input = BufReader::with_capacity(1 << 16, File::open(path).map_err(fail)?);
        let gzipped = input.fill_buf().map_err(fail)?.starts_with(&[0x1f, 0x8b]);
        Ok(if gzipped {
            Self::new(&name, BufReader::with_capacity(1 << 16, MultiGzDecoder::new(input)))
        } else {
            Self::new(&name, input)
        })
    }

    /// The lines of `input`, called `file` in messages.
    pub fn new(file: &str, input: impl BufRead + Send + 'static) -> Self {
        Self { file: file.to_owned(), input: Box::new(input), line: Vec::new(), number: 0, whole: true, unread: false }
    }

    /// Goes to the next line; false at the end. A damaged compressed stream counts as the end.
    pub fn advance(&mut self, report: &mut ReadReport) -> Result<bool, ReadError> {
        if std::mem::take(&mut self.unread) {
            return Ok(true);
        }
        self.line.clear();
        match self.read_line() {
            Ok(Length::End) => Ok(false),
            Ok(Length::Whole) => Ok(true),
            Ok(Length::Cut) => {
                report.drop_one(Reason::LineTooLong, self.number);
                Ok(true)
            }
            Err(error) if is_damaged_stream(&error) => {
                report.drop_one(Reason::CompressionDamaged, self.number);
                self.input = Box::new(io::empty());
                Ok(false)
            }
            Err(source) => Err(ReadError::Io { file: self.file.clone(), line: self.number, source }),
        }
    }

    fn read_line(&mut self) -> io::Result<Length> {
        let read = self.input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut self.line)?;
        if read == 0 {
            return Ok(Length::End);
        }
        self.number += 1;
        self.whole = self.line.last() == Some(&b'\n');
        let cut = !self.whole && read as u64 == LONGEST_LINE;
        if cut {
            self.input.skip_until(b'\n')?;
        }
        while let Some(b'\n' | b'\r') = self.line.last() {
            self.line.pop();
        }
        Ok(if cut { Length::Cut } else { Length::Whole })
    }

    /// The current line, without its end.
    pub fn line(&self) -> &[u8] {
        &self.line
    }

    /// Whether the current line was ended by LF: the last line of a file may not be, and may be cut off.
    pub fn is_whole(&self) -> bool {
        self.whole
    }

    /// Number of the current line, from 1.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Lets the next [`Lines::advance`] stay on the current line.
    pub fn unread(&mut self) {
        self.unread = true;
    }

    /// What the input is called in messages.
    pub fn file(&self) -> &str {
        &self.file
    }
}

enum Length {
    End,
    Whole,
    Cut,
}

/// What the decompressor says of a stream that ends early or is garbled.
fn is_damaged_stream(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput)
}
