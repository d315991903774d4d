//! Readers: files of others into the core's vocabulary.

pub mod solution;
