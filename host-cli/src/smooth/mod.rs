//! Smoothing of recorded data: forward and backward passes, integers on either posterior, EM for the noise.
//!
//! * [`model`]: what a smoother is told about the world, whichever engine or study it comes from.
//! * [`rtk`]: what the RTK engine recorded, smoothed; [`multi_band`]: recorded epochs of the DD-IF and SD-IF models of
//!   Greiff (2023); [`dense`]: a linear model by its matrices.
//! * [`ppp`]: what the PPP engine recorded, smoothed, with its noise learned as by Zhang (2020).
//! * [`pass`]: forward and backward passes; [`history`]: the densities between them, within a budget of memory.
//! * [`integers`]: fixing on either posterior, by epoch or by arc.
//! * [`rtsap`]: smoothing with fixed integers, Algorithm 1 of the paper; [`app`]: the same with learned noise, Algorithm 2.
//! * [`em`]: learning the noise; [`objective`]: the function that EM minimises.
//! * [`vector`]: the kernels compiled for the vector unit at hand.
//! * [`progress`]: time left, and how to stop.

pub mod app;
#[cfg(test)]
mod batch;
pub mod dense;
pub mod em;
pub mod history;
pub mod integers;
pub mod model;
pub mod multi_band;
pub mod objective;
pub mod pass;
pub mod ppp;
pub mod progress;
pub mod rtk;
pub mod rtsap;
pub mod vector;
