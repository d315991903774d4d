//! Smoothing of recorded data: forward and backward passes, integers on either posterior, EM for the noise.
//!
//! * [`model`]: what a smoother is told about the world, whichever engine or study it comes from.
//! * [`multi_band`]: recorded epochs of the DD-IF and SD-IF models of Greiff (2023).
//! * [`rtk`]: what the RTK engine recorded, smoothed.

pub mod model;
pub mod multi_band;
pub mod rtk;
