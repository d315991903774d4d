//! Why an input cannot be used at all. Each message names the file, the place and the remedy.

use std::fmt;
use std::io;

/// What a file was recognised as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// RINEX observations.
    Observation,
    /// RINEX navigation messages.
    Navigation,
    /// RINEX meteorological data.
    Meteorology,
    /// RINEX clocks.
    Clock,
    /// Precise orbits, SP3.
    PreciseOrbit,
    /// Antenna phase centres, ANTEX.
    Antenna,
    /// Biases of signals.
    Bias,
    /// Ocean loading.
    OceanLoading,
    /// Orientation of the Earth.
    EarthOrientation,
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Observation => "an observation file",
            Self::Navigation => "a navigation file",
            Self::Meteorology => "a meteorological file",
            Self::Clock => "a clock file",
            Self::PreciseOrbit => "an SP3 orbit file",
            Self::Antenna => "an ANTEX antenna file",
            Self::Bias => "a file of biases",
            Self::OceanLoading => "a file of ocean loading",
            Self::EarthOrientation => "a file of Earth orientation",
        })
    }
}

impl FileKind {
    /// What to do with a file of this kind that was given in the place of another.
    const fn remedy(self) -> &'static str {
        match self {
            Self::Observation => "give it as ROVER or BASE",
            Self::Navigation => "give it as NAV",
            _ => "it is not used here, leave it out",
        }
    }
}

/// An input that cannot be used at all.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file is missing or not readable.
    #[error("{file}: cannot be opened ({source}); check the path and the permissions")]
    Open {
        /// The file.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The file holds nothing.
    #[error("{file}: is empty; was it downloaded or written to the end?")]
    Empty {
        /// The file.
        file: String,
    },
    /// The file is not RINEX.
    #[error("{file}, line 1: is not RINEX but {found}; {remedy}")]
    NotRinex {
        /// The file.
        file: String,
        /// What it looks like.
        found: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// The file is not of the format that is needed, which its first line would say.
    #[error("{file}, line 1: is not {expected}; {remedy}")]
    NotOfKind {
        /// The file.
        file: String,
        /// What it should be.
        expected: FileKind,
        /// What to do.
        remedy: &'static str,
    },
    /// RINEX, but of another kind than is needed here.
    #[error("{file}: this is {found}, where {expected} is needed; {}", found.remedy())]
    WrongKind {
        /// The file.
        file: String,
        /// What it is.
        found: FileKind,
        /// What it should be.
        expected: FileKind,
    },
    /// A version of RINEX or CRINEX that is not read.
    #[error(
        "{file}, line 1: version {version} is not supported; convert the file to RINEX 3.05 (for instance with gfzrnx)"
    )]
    Version {
        /// The file.
        file: String,
        /// The version it states.
        version: String,
    },
    /// A header that cannot be used.
    #[error("{file}, line {line}: {problem}; {remedy}")]
    Header {
        /// The file.
        file: String,
        /// The line.
        line: u64,
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A file of stations has not the one that is needed.
    #[error("{file}: has no station {station}; {remedy}")]
    NoStation {
        /// The file.
        file: String,
        /// The station, as it was asked for.
        station: String,
        /// What to do.
        remedy: &'static str,
    },
    /// Reading failed in the middle.
    #[error("{file}, after line {line}: cannot be read on ({source}); check the disk")]
    Io {
        /// The file.
        file: String,
        /// The last line that was read.
        line: u64,
        /// What the system says.
        source: io::Error,
    },
}
