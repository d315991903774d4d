//! # surefix-core
//!
//! Precise GNSS positioning for receiver firmware and for hosts, from one source: `no_std`, no allocation, no
//! `unsafe`, no panic on any input, bounded loops and bounded stack.
//!
//! ## Rooms, ground floor first
//! A room uses only rooms above it in this table.
//!
//! | room | holds |
//! |---|---|
//! | [`real`], [`linalg`] | the scalar trait over `f32`/`f64`; in-place kernels on slices |
//! | [`stats`] | normal and χ² distributions |
//! | [`integrity`] | risk, protection levels, their status and their record |
//! | [`gnss`] | time, satellites, signals, epochs, orbits, atmosphere, geodesy, [`gnss::solution::Solution`] |
//! | [`log`] | the device log: framed, checksummed records (feature `log`) |
//! | [`integer`] | decorrelation, bootstrapping, integer least squares, success rates, acceptance |
//! | [`spp`] | single-point position and velocity with fault exclusion |
//! | [`model`] | motion, observation noise, combinations; partially linear models |
//! | [`filter`] | densities, linearisation, updates, slip detection, the mixed-integer filter |
//! | [`rtk`] | the engine: epochs of rover and base in, [`gnss::solution::Solution`] out |
//!
//! One principle to hold on to: whatever is decided about an epoch is decided here, and is the same bit for bit on a
//! Cortex-M and on a server. Therefore transcendental functions come from `libm` only.
//!
//! ## Panic contract
//! No public function panics, whatever its input. Errors are small `Copy` enums, one per operation.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod filter;
pub mod gnss;
pub mod integer;
pub mod integrity;
pub mod linalg;
#[cfg(feature = "log")]
pub mod log;
pub mod model;
pub mod ppp;
pub mod real;
pub mod rtk;
pub mod smooth;
pub mod spp;
pub mod stats;
