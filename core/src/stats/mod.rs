//! Normal and χ² distributions in bounded time, from `libm` only.
//!
//! All functions are total: an argument outside the domain gives NaN, never a panic.

pub mod chi_square;
pub mod normal;
