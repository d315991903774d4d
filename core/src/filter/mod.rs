//! Estimation: densities and the operations that predict, update and re-arrange them.

pub mod common_term;
pub mod gaussian;
pub mod jump;
pub mod linearize;
pub mod mixed_integer;
pub mod screen;
pub mod slip;
pub mod update;
