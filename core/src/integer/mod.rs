//! Integer ambiguities: from a float vector â and its covariance Q to integers that can be trusted, or to the
//! statement that they cannot.
//!
//! ```text
//! â, Q ─► decorrelate ─► ẑ, Q_z = U D Uᵀ ─► search (budget) ─► ž, second best ─► ǎ = Z⁻ᵀ ž ─► accept
//!                              │                 └─ exhausted ─► bootstrap
//!                              └─► success rates, largest subset worth fixing (partial)
//! ```
//! [`resolve()`] does all of it in one call on a [`Workspace`]; the steps are public for those who need one.
//!
//! | module | holds |
//! |---|---|
//! | [`decorrelate`] | the Z-transform (LAMBDA reduction) |
//! | [`rounding`] | each ambiguity by itself |
//! | [`bootstrap`] | sequential conditional rounding |
//! | [`search`] | the k nearest integer vectors, bounded by a node budget |
//! | [`success_rate`] | success rate of bootstrapping, ADOP, bounds for rounding and integer least squares |
//! | [`accept`] | ratio, difference and success-rate tests |
//! | [`failure_rate`] | the ratio threshold that keeps a tolerated failure rate |
//! | [`partial`] | fixing a subset |
//! | [`condition`] | mean and covariance of other states given fixed ambiguities |
//!
//! Conventions. Ambiguities in cycles, variances in cycles², norms (a − z)ᵀ Q⁻¹ (a − z) without unit. Ties round
//! away from zero. â is split into rint(â), exact in `i64`, and a fraction before anything else, so that 1e7 cycles
//! cost no digits. Q may be asymmetric in its last digits, it is symmetrised.
//!
//! Speed. Medians of 60 problems each, two bands on a short baseline, beside `lambda()` of RTKLIB 2.4.3 in the same run on
//! x86-64 (`cargo bench -p surefix --bench lambda`); the times are for [`resolve()`], success rate and ADOP included:
//!
//! | n | RTKLIB µs | here µs | ratio |
//! |---|---|---|---|
//! | 12 | 13.9 | 10.1 | 0.73 |
//! | 24 | 81 | 37 | 0.46 |
//! | 40 | 320 | 91 | 0.28 |
//! | 60 | 825 | 191 | 0.23 |
//!
//! With an ionosphere of 30 cm, one epoch and n = 40, RTKLIB gives up in 50 of 60 cases; here 59 are proven and one is
//! bootstrapped, in 0.7 ms.
//!
//! Panic contract: no function panics; errors are [`IntegerError`].

pub mod accept;
pub mod bootstrap;
pub mod condition;
pub mod decorrelate;
mod error;
pub mod failure_rate;
pub mod partial;
pub mod resolve;
pub mod rounding;
pub mod search;
pub mod subset;
pub mod success_rate;

pub use error::IntegerError;
pub use partial::resolve_partial;
pub use resolve::{Config, Method, Resolution, Workspace, resolve};
