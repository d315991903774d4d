//! Studies: the papers' simulations by Monte Carlo, with the numbers they must give, and their choices on real drives.
//!
//! | module | holds |
//! |---|---|
//! | [`monte_carlo`] | trials on all cores, in order, with a progress bar |
//! | [`statistics`] | ratios over runs with their standard errors |
//! | [`acceptance`] | numbers with their bands |
//! | [`mixed_integer`] | Section V of Greiff et al. (CCTA 2021) |
//! | [`drive`] | its choices on a real drive |
//! | [`smoothing`] | Section 5 of Greiff et al. (2023) |
//! | [`smoothing_drive`] | smoothing and EM on a real drive |
//! | [`integrity`] | two vehicles, four kinds of noise: Wang et al. (2022) |
//! | [`em_ppp`] | noise of precise point positioning: Zhang et al. (2020) |
//! | [`urban`] | variants of the engine's configuration between buildings |

pub mod acceptance;
pub mod drive;
pub mod em_ppp;
pub mod integrity;
pub mod mixed_integer;
pub mod monte_carlo;
pub mod smoothing;
pub mod smoothing_drive;
pub mod statistics;
pub mod urban;
