//! RINEX 2.10–2.11 and 3.00–3.05: observations and navigation messages, plain, gzipped or (observations) compact.
//!
//! Sources: W. Gurtner, L. Estey, *RINEX 2.11* (2007); IGS/RTCM-SC104, *RINEX 3.05* (2020), tables A2, A3, A6–A18.
//!
//! Observations are streamed: memory is bounded by one epoch. Fields are read from bytes in fixed columns, so that
//! damaged or non-UTF-8 bytes cost the value they hit and nothing else.

mod compact;
mod header;
mod navigation;
mod observation;
mod observation_types;
#[cfg(test)]
mod samples;
mod time_scale;

pub use header::{ObservationHeader, Version};
pub use navigation::NavigationData;
pub use observation::{ObservationEpoch, ObservationReader};
pub use time_scale::TimeScale;
