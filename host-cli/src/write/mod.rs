//! Writers of results: one format a file. They know core types only, not the readers.

pub mod csv;
pub mod partial_file;
pub mod pos;
mod rinex_header;
pub mod rinex_navigation;
pub mod rinex_observation;
pub mod summary;
