//! Processing: inputs in order of time, through the engine of the core, to solutions.

pub mod base_check;
pub mod ppp;
pub mod run;
pub mod settings;
pub mod smoothing;
pub mod stream;
