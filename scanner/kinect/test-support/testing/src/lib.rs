//! What the tests of the drivers share. Never shipped.
//!
//! `cargo test` builds neither another package's program nor a `cdylib`: [`built`] builds them once a run, in the profile
//! of the tests. Where a C library is not installed, tests pass with a message, unless `SCAN_REQUIRE_DRIVERS=1`.

pub mod dump;
pub mod scene;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use kinect::child::Launch;

/// A file that cargo builds of a package of the workspace: `driver-host` of `kinect-testing`, `libfake_usb.so` of `fake-usb`.
///
/// # Panics
/// Where it cannot be built.
pub fn built(package: &str, file: &str) -> PathBuf {
    static BUILT: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let tests = std::env::current_exe().expect("a running test has a path");
    let profile = tests.ancestors().nth(2).expect("cargo puts tests into target/PROFILE/deps");
    let mut built = BUILT.lock().unwrap_or_else(PoisonError::into_inner);
    if !built.contains(package) {
        build(package, profile);
        built.insert(package.to_owned());
    }
    let path = profile.join(file);
    assert!(path.is_file(), "{} was not built", path.display());
    path
}

fn build(package: &str, profile: &Path) {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["build", "--quiet", "-p", package]).current_dir(env!("CARGO_MANIFEST_DIR"));
    if profile.ends_with("release") {
        command.arg("--release");
    }
    let status = command.status().expect("cargo runs: it runs these tests");
    assert!(status.success(), "cargo could not build {package}");
}

/// A driver of the test's own program, with nothing of the caller's environment.
pub fn launch(driver: &str, target: &str) -> Launch {
    let mut launch = Launch::new(driver, target).expect("a running test has a path");
    launch.program = built("kinect-testing", "driver-host");
    launch
}

/// A C library by its names; `None`, with a message, where it is not installed and that is allowed.
///
/// # Panics
/// Where it is not installed and `SCAN_REQUIRE_DRIVERS=1`.
pub fn library(paths: &[&str]) -> Option<PathBuf> {
    let found = paths.iter().map(Path::new).find(|path| path.is_file());
    if found.is_none() {
        assert!(
            std::env::var_os("SCAN_REQUIRE_DRIVERS").is_none_or(|value| value != "1"),
            "none of {paths:?}"
        );
        eprintln!("skipped: none of {paths:?} is installed");
    }
    found.map(Path::to_owned)
}
