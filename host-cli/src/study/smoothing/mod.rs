//! Simulations of Greiff et al., *Adaptive Smoothing with Ambiguity Fixation for GNSS Post-Processing* (2023).

pub mod geometry;
