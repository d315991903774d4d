//! Writers of results: one format a file. They know core types only, not the readers.

pub mod csv;
pub mod pos;
pub mod summary;
