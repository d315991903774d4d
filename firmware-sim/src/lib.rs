//! # surefix-firmware
//!
//! What a Cortex-M needs around `surefix-core` to replay a device log: a board layer for two QEMU machines, and small
//! programs in `src/bin`, each with what it must say by defmt in a file of the same name ending in `.out`.
//!
//! | machine | core | `f64` |
//! |---|---|---|
//! | `mps2-an386` | Cortex-M4F | in software |
//! | `mps2-an500` | Cortex-M7 | in hardware |
//!
//! Both have the peripherals used here at the same addresses, so one source serves both; `cargo xtask firmware` builds
//! it for each with its own `target-cpu`.
//!
//! Two channels lead out, and never share one: defmt messages go by semihosting, the binary stream goes over UART0.
#![no_std]

use defmt_semihosting as _; // the global logger

pub mod board;
pub mod fixed_lag;
pub mod moving_base;
mod panic;
pub mod ppp;
pub mod random;
pub mod replay;
pub mod section_v;
