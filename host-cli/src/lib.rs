//! Host side of surefix: readers, processing, simulation, comparison and writers around `surefix-core`.
//!
//! Arrows: [`cli`] → everything; readers → core types; processing → core; writers → results and [`plot`]. Readers and writers
//! do not know each other.

pub mod ambiguity;
pub mod cli;
pub mod compare;
pub mod degrade;
pub mod log;
pub mod plot;
pub mod process;
pub mod read;
pub mod simulate;
pub mod smooth;
pub mod study;
pub mod variance;
pub mod vectors;
pub mod write;
