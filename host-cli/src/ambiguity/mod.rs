//! Studies of ambiguity resolution on simulated models: what the core's integer estimation is measured on.
//!
//! | module | holds |
//! |---|---|
//! | [`model`] | float ambiguities and their covariance for a pair of receivers under a random sky |
//! | [`monte_carlo`] | success rates by simulation |

pub mod model;
pub mod monte_carlo;
