//! RINEX 2.10–2.11 and 3.00–3.05: observations and navigation messages, plain, gzipped or (observations) compact.
//!
//! Sources: W. Gurtner, L. Estey, *RINEX 2.11* (2007); IGS/RTCM-SC104, *RINEX 3.05* (2020), tables A2, A3, A6–A18.
//!
//! Observations are streamed: memory is bounded by one epoch. Fields are read from bytes in fixed columns, so that
//! damaged or non-UTF-8 bytes cost the value they hit and nothing else. Plain files are read at 400 MB/s, a day of
//! compact ones (2880 epochs, 10 MB) in 0.2 s.
//!
//! # Why not a library
//! The crate `rinex` 0.24.0, the best kept one, was measured in November 2026. On ten RINEX 3 files and a day of compact
//! RINEX its values and loss-of-lock bits are ours, 1.6 million values in the day. But a file of sbf2rin, whose header
//! declares the receiver channel as `X1`, comes out with every value one column off and no error; a byte that is not
//! UTF-8 ends the reading ("i/o: input error"), no message names a line, the file is held in memory as a whole, and
//! 320 crates take 8 minutes of processor time to build, too many even for an oracle in the tests. Samples compacted by
//! the reference programs serve as that instead.

mod compact;
mod header;
mod navigation;
mod observation;
mod observation_types;
#[cfg(test)]
mod samples;
mod time_scale;

pub(super) use header::first_line;
pub use header::{ObservationHeader, Version};
pub use navigation::NavigationData;
pub use observation::{ObservationEpoch, ObservationReader};
pub use time_scale::TimeScale;
