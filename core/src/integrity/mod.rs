//! How far a position may be off at a stated risk.
//!
//! * [`risk`]: how the risk is divided, and how many standard deviations it comes to.
//! * [`protection`]: protection levels from a covariance, and the status of an epoch.
//! * [`window`]: whether innovations agree with their covariance, over the last epochs.
//! * [`fault`]: faults of one satellite: detection, exclusion, and what may go unnoticed.
//! * [`stanford`]: what became of errors and protection levels once the truth is known.
//!
//! L. Wang et al. (2022), sec. 3.3, eqs. (27) to (31), corrected: the covariance is turned to east, north, up first; risk
//! is divided between horizontal and vertical; the protection level of a fixed position counts only where the integers are
//! as sure as the allocation wants, or a test of the data has accepted them.
//!
//! Nothing here allocates or panics. A protection level costs ten multiplications, a factor some hundred `erfc`, once for
//! a configuration.

pub mod fault;
pub mod protection;
pub mod risk;
pub mod stanford;
pub mod window;
