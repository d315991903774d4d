//! Estimation: densities and the operations that predict, update and re-arrange them.
//!
//! ```text
//! model ─► linearize ─► ŷ, J, Ω ─► update (sequential, Joseph, array) ─► slip ─► integers
//! ```
//! | module | holds |
//! |---|---|
//! | [`gaussian`] | a density whose states are born, die and are re-defined |
//! | [`common_term`] | rows that share a free common term, made independent without differences |
//! | [`linearize`] | Taylor, unscented, cubature, Gauss–Hermite over the nonlinear states |
//! | [`update`] | the measurement update in three forms |
//! | [`adaptive`] | measurement noise that follows the data: Sage–Husa, IAVAKF |
//! | [`double_difference`] | both ends move, double differences of two bands: KF, AKF, IAVAKF |
//! | [`screen`] | observations that contradict the rest |
//! | [`jump`], [`slip`] | how ambiguities jump, and how that is seen |
//! | [`mixed_integer`] | both densities of any partially linear model: MI-EKF, MI-LRKF, recursive MILS |

pub mod adaptive;
pub mod common_term;
mod density;
pub mod double_difference;
pub mod gaussian;
pub mod jump;
pub mod linearize;
pub mod mixed_integer;
pub mod screen;
#[cfg(feature = "log")]
pub mod section_v;
pub mod slip;
pub mod update;
