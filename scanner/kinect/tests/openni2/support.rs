//! Recordings to write, a private OpenNI2 with the mock driver, and sources on both.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use kinect::child::{ChildSource, Launch, Overflow};
use kinect::source::{Event, Frame, Source, SourceError};
use kinect_testing::{launch, library};
use oni_writer::{Kind, Stream};
use tempfile::TempDir;

/// Where distributions put the library.
const PLACES: [&str; 3] = [
    "/usr/lib/x86_64-linux-gnu/libOpenNI2.so.0",
    "/usr/lib/aarch64-linux-gnu/libOpenNI2.so.0",
    "/usr/lib/libOpenNI2.so.0",
];

/// The library; `None`, with a message, where it is not installed and that is allowed.
pub(crate) fn openni2() -> Option<PathBuf> {
    library(&PLACES)
}

/// The Kinect's field of view, radians.
pub(crate) const FIELD_OF_VIEW: [f64; 2] = [1.014_468_670_750_743_8, 0.789_809_063_457_491_5];

/// Depth of frame `i`: all of what a pixel can be, holes and the largest values too.
pub(crate) fn depth(i: usize, width: u32, height: u32) -> Vec<u16> {
    let pixel = |p: usize| if p.is_multiple_of(37) { 0 } else { (p * 7919 + i * 131) as u16 };
    let mut depth: Vec<u16> = (0..(width * height) as usize).map(pixel).collect();
    depth[..4].copy_from_slice(&[0, 1, 10_000, u16::MAX]);
    depth
}

/// Colour of frame `i`.
pub(crate) fn color(i: usize, width: u32, height: u32) -> Vec<[u8; 3]> {
    let pixel = |p: usize| [(p + i) as u8, (p / 7) as u8, (p * 31 + i * 17) as u8];
    (0..(width * height) as usize).map(pixel).collect()
}

pub(crate) fn depth_stream(frames: usize, width: u32, height: u32) -> Stream {
    let bytes = |i| depth(i, width, height).iter().flat_map(|mm| mm.to_le_bytes()).collect();
    let frames = (0..frames).map(|i| (33_333 * i as u64, bytes(i))).collect();
    Stream {
        kind: Kind::Depth,
        width,
        height,
        fps: 30,
        field_of_view: FIELD_OF_VIEW,
        is_mirrored: false,
        frames,
    }
}

/// Colour, 4 ms after depth.
pub(crate) fn color_stream(frames: usize, width: u32, height: u32) -> Stream {
    let bytes = |i| color(i, width, height).into_flattened();
    let frames = (0..frames).map(|i| (33_333 * i as u64 + 4000, bytes(i))).collect();
    Stream {
        kind: Kind::Color,
        width,
        height,
        fps: 30,
        field_of_view: FIELD_OF_VIEW,
        is_mirrored: false,
        frames,
    }
}

pub(crate) fn write(path: &Path, streams: &[Stream]) {
    oni_writer::write(&mut BufWriter::new(File::create(path).unwrap()), streams).unwrap();
}

/// A recording of so many pairs in a folder that goes with it.
pub(crate) fn recording(frames: usize, width: u32, height: u32) -> (TempDir, PathBuf) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("test.oni");
    write(&path, &[depth_stream(frames, width, height), color_stream(frames, width, height)]);
    (home, path)
}

/// A driver for a file: it waits for its reader.
pub(crate) fn file_launch(path: &Path) -> Launch {
    let mut launch = launch("openni2", path.to_str().unwrap());
    launch.overflow = Overflow::Wait;
    launch
}

/// Plays a file to its end.
pub(crate) fn play(path: &Path) -> Result<(ChildSource, Vec<Arc<Frame>>), SourceError> {
    let mut source = ChildSource::open(file_launch(path))?;
    source.start()?;
    let mut frames = Vec::new();
    loop {
        match source.next_event(Duration::from_secs(10)) {
            Event::Frame(frame) => frames.push(frame),
            Event::Ended => return Ok((source, frames)),
            Event::Failed(words) => return Err(SourceError::Driver(words)),
            other => panic!("{other:?} after {} frames", frames.len()),
        }
    }
}

/// The next frame that `is_wanted`, within `patience`.
pub(crate) fn wait_for_frame(
    source: &mut ChildSource,
    patience: Duration,
    is_wanted: impl Fn(&Frame) -> bool,
) -> Arc<Frame> {
    let until = Instant::now() + patience;
    while Instant::now() < until {
        match source.next_event(Duration::from_millis(100)) {
            Event::Frame(frame) if is_wanted(&frame) => return frame,
            Event::Frame(_) | Event::Nothing => {}
            other => panic!("{other:?}"),
        }
    }
    panic!("no such frame within {patience:?}");
}

/// A private OpenNI2: the installed core beside the mock driver alone.
pub(crate) struct Private {
    home: TempDir,
}

impl Private {
    pub(crate) fn new(core: &Path) -> Self {
        let home = tempfile::tempdir().unwrap();
        let drivers = home.path().join("OpenNI2/Drivers");
        std::fs::create_dir_all(&drivers).unwrap();
        std::os::unix::fs::symlink(core, home.path().join("libOpenNI2.so.0")).unwrap();
        let mock = kinect_testing::built("mock-oni-driver", "libmock_oni_driver.so");
        std::os::unix::fs::symlink(mock, drivers.join("libMockKinect.so.0")).unwrap();
        let private = Self { home };
        private.plug_in();
        private
    }

    fn plug(&self) -> PathBuf {
        self.home.path().join("plugged-in")
    }

    pub(crate) fn plug_in(&self) {
        std::fs::write(self.plug(), "").unwrap();
    }

    pub(crate) fn unplug(&self) {
        std::fs::remove_file(self.plug()).unwrap();
    }

    /// A driver on it; `more` goes into its environment.
    pub(crate) fn launch(&self, target: &str, more: &[(&str, &str)]) -> Launch {
        let mut launch = launch("openni2", target);
        let set = |name: &str, value: &Path| (name.into(), value.into());
        launch.environment = vec![
            set("SCAN_OPENNI2_LIB", &self.home.path().join("libOpenNI2.so.0")),
            set("MOCK_KINECT_PRESENT", &self.plug()),
        ];
        launch.environment.extend(more.iter().map(|(name, value)| (name.into(), value.into())));
        launch
    }
}
