//! Support shared by the cross-crate tests.

pub mod corners;

use std::path::{Path, PathBuf};

/// A folder or file of the shared test data. `None`, with a message, where it is absent; a failure where
/// `SCAN_REQUIRE_SHARED=1` says that it must be there.
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("SCAN_SHARED_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"), PathBuf::from);
    let path = root.join("data").join(name);
    if path.exists() {
        return Some(path);
    }
    let required = std::env::var("SCAN_REQUIRE_SHARED").is_ok_and(|v| v == "1");
    assert!(!required, "{} is required but absent", path.display());
    println!("skipped: {} is absent", path.display());
    None
}
