//! Variances of linear problems by several principles, on small dense matrices: what the learning of noise is compared
//! with, not what computes it.
//!
//! X. Zhang et al., *Automatic Calibration of Process Noise Matrix and Measurement Noise Covariance for Multi-GNSS Precise
//! Point Positioning*, Remote Sensing 12 (2020), Sections 2 to 4: "the paper" in these modules.
//!
//! * [`linear`]: filter, smoother and EM for any linear state-space model, (7) to (27).
//! * [`components`]: least-squares EM, maximum likelihood, REML and LS-VCE for variance components, (28) to (34).

pub mod components;
pub mod linear;
