//! Precise point positioning of recorded data: products from files, the core's engine over all epochs, its record for the
//! smoother, and one answer for each epoch.

pub mod files;
pub mod products;
pub mod record;
pub mod run;
pub mod settings;
