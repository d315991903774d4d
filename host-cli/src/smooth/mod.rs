//! Smoothing of recorded data: forward and backward passes, integers on either posterior, EM for the noise.
//!
//! * [`model`]: what a smoother is told about the world, whichever engine or study it comes from.

pub mod model;
