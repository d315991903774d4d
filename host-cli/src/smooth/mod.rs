//! Smoothing of recorded data: forward and backward passes, integers on either posterior, EM for the noise.
//!
//! * [`model`]: what a smoother is told about the world, whichever engine or study it comes from.
//! * [`rtk`]: what the RTK engine recorded, smoothed.

pub mod model;
pub mod rtk;
