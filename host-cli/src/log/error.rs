//! Why a file cannot be read as a device log at all. Each message names the file, the place and the remedy.

use std::io::{self, BufRead};

/// A file that is no device log.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file is missing or not readable.
    #[error("{file}: cannot be opened ({source}); check the path and the permissions")]
    Open {
        /// The file.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The file holds nothing.
    #[error("{file}: is empty; was it downloaded or recorded to the end?")]
    Empty {
        /// The file.
        file: String,
    },
    /// The file is something else.
    #[error("{file}: is not a device log but {found}; {remedy}")]
    Foreign {
        /// The file.
        file: String,
        /// What it looks like.
        found: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// Not one intact record in the whole file.
    #[error(
        "{file}: not one of its {bytes} bytes belongs to an intact record; it is no device log, or damaged throughout \
         (was it copied as text?)"
    )]
    NoRecord {
        /// The file.
        file: String,
        /// Its length.
        bytes: u64,
    },
    /// Reading failed in the middle.
    #[error("{file}, byte {offset}: cannot be read on ({source}); check the disk")]
    Io {
        /// The file.
        file: String,
        /// Where.
        offset: u64,
        /// What the system says.
        source: io::Error,
    },
}

/// Refuses an empty input and one that starts as something else does.
pub(super) fn check_start(file: &str, input: &mut impl BufRead) -> Result<(), LogError> {
    let start = input.fill_buf().map_err(|source| LogError::Io { file: file.to_owned(), offset: 0, source })?;
    let foreign = |found, remedy| Err(LogError::Foreign { file: file.to_owned(), found, remedy });
    match start {
        [] => Err(LogError::Empty { file: file.to_owned() }),
        [0x1f, 0x8b, ..] => foreign("a gzip file", "unpack it first (gunzip)"),
        [0xb5, 0x62, ..] => {
            foreign("a u-blox log", "convert it to RINEX and make a log of that with `surefix log pack`")
        }
        _ if is_rinex(start) => foreign("RINEX", "make a log of it with `surefix log pack ROVER BASE NAV… -o FILE`"),
        _ => Ok(()),
    }
}

/// Whether the first line has the label that every RINEX and CRINEX file starts with.
fn is_rinex(start: &[u8]) -> bool {
    let line = start.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let label = line.get(60..80).unwrap_or_default().trim_ascii();
    label == b"RINEX VERSION / TYPE" || label == b"CRINEX VERS   / TYPE"
}
