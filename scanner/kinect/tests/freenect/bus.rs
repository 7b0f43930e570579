//! Opens sensors on the simulated bus.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use kinect::child::{ChildSource, Launch, Overflow};
use kinect::source::{Event, Frame, Source};
use kinect_testing::{built, launch, library};

/// Generous for a busy machine; what is measured is measured apart.
pub(crate) const LONG: Duration = Duration::from_secs(30);

/// A driver under which the bus is simulated with these settings (`FAKE_USB_…`); `None` where libfreenect is missing.
pub(crate) fn on_bus(driver: &str, target: &str, settings: &[(&str, &str)]) -> Option<Launch> {
    let library = library(&[
        "/usr/lib/x86_64-linux-gnu/libfreenect.so.0.5",
        "/usr/lib/aarch64-linux-gnu/libfreenect.so.0.5",
        "/usr/lib64/libfreenect.so.0",
        "/usr/lib/libfreenect.so.0",
    ])?;
    let mut launch = launch(driver, target);
    launch.overflow = Overflow::Wait;
    set(&mut launch, "LD_PRELOAD", built("fake-usb", "libfake_usb.so"));
    set(&mut launch, "SCAN_FREENECT_LIB", library);
    for (name, value) in settings {
        set(&mut launch, &format!("FAKE_USB_{name}"), value);
    }
    Some(launch)
}

pub(crate) fn set(launch: &mut Launch, name: &str, value: impl Into<OsString>) {
    launch.environment.push((name.into(), value.into()));
}

/// Opens and starts.
pub(crate) fn started(launch: Launch) -> ChildSource {
    let mut source = ChildSource::open(launch).unwrap();
    source.start().unwrap();
    source
}

/// The next frame, however long a busy machine takes.
#[track_caller]
pub(crate) fn frame(source: &mut ChildSource) -> Arc<Frame> {
    match source.next_event(LONG) {
        Event::Frame(frame) => frame,
        other => panic!("no frame but {other:?}"),
    }
}

/// Waits until something holds.
#[track_caller]
pub(crate) fn until(mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < LONG, "waited in vain");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Where the bus writes down what the driver does to the sensor.
pub(crate) struct Journal {
    _home: tempfile::TempDir,
    pub(crate) path: PathBuf,
}

impl Journal {
    pub(crate) fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("journal");
        Self { _home: home, path }
    }

    pub(crate) fn setting(&self) -> &str {
        self.path.to_str().unwrap()
    }

    pub(crate) fn lines(&self) -> Vec<String> {
        lines(&self.path)
    }

    /// The last value written to a register.
    pub(crate) fn last(&self, what: &str) -> Option<String> {
        let wanted = format!("{what} = ");
        self.lines().iter().rev().find_map(|line| line.strip_prefix(&wanted).map(str::to_owned))
    }
}

fn lines(path: &Path) -> Vec<String> {
    std::fs::read_to_string(path).unwrap_or_default().lines().map(str::to_owned).collect()
}
