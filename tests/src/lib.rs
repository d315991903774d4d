//! Shared ground of the cross-crate tests: where the reference data is, real cases, and simulated drives.

pub mod cases;
pub mod section_v;

use std::path::{Path, PathBuf};

/// A path below the reference data that lies beside the checkout (`../shared`), or `None`, with a message that the
/// test was skipped, where it is absent.
pub fn shared(relative: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(relative);
    if path.exists() {
        Some(path)
    } else {
        println!("skipped: {} is absent", path.display());
        None
    }
}
