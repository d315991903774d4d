//! Smoothing: estimates of the past from all measurements, and what they say of the noise.
//!
//! One step of each recursion; the loops and the storage belong to the caller, so that the same steps serve a host with
//! a day of data and a target with a ring of a few epochs.
//!
//! * [`step`]: x⁺ = F x + b + q, rectangular where states are born or die.

pub mod step;
