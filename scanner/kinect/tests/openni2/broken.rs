//! Files that are none, and sensors that are not there: one clear error each, which says what to do.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use kinect::child::ChildSource;
use kinect::source::SourceError;
use kinect_testing::launch;

use crate::support::{color_stream, depth_stream, file_launch, openni2, play, recording, write};

/// Fails, in time, with words that hold all of `expected` and advice behind a semicolon or colon.
#[track_caller]
fn check_refused(path: &Path, expected: &[&str]) {
    // built outside of the measured time
    kinect_testing::built("kinect-testing", "driver-host");
    let started = Instant::now();
    let error = play(path).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(expected.iter().all(|words| error.contains(words)), "{expected:?} are not in {error:?}");
    assert!(!error.contains('\n'), "{error}");
    assert!(started.elapsed() < Duration::from_secs(8), "{:?}", started.elapsed());
}

#[test]
fn missing_and_foreign_files() {
    let Some(_) = openni2() else { return };
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.oni");
    check_refused(&path, &["a.oni", "check the path"]);
    check_refused(home.path().join("folder/a.oni").as_path(), &["a.oni", "check the path"]);
    for junk in [&b""[..], b"NI", b"PK\x03\x04 and much more that is no recording"] {
        fs::write(&path, junk).unwrap();
        check_refused(&path, &["a.oni", "name a .oni file"]);
    }
    fs::write(&path, [b"NI10".as_slice(), &[0x5a; 4096]].concat()).unwrap();
    check_refused(&path, &["a.oni", "copy it again"]);
    let folder = home.path().join("b.oni");
    fs::create_dir(&folder).unwrap();
    check_refused(&folder, &["b.oni", "check the path"]);
}

#[test]
fn cut_off_at_every_kind_of_place() {
    let Some(_) = openni2() else { return };
    let (_home, path) = recording(3, 64, 48);
    let whole = fs::read(&path).unwrap();
    for share in [0.002, 0.05, 0.3, 0.7, 0.99] {
        fs::write(&path, &whole[..(whole.len() as f64 * share) as usize]).unwrap();
        check_refused(&path, &["test.oni", "copy it again"]);
    }
}

#[test]
fn one_stream_is_not_enough() {
    let Some(_) = openni2() else { return };
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("half.oni");
    write(&path, &[depth_stream(2, 64, 48)]);
    check_refused(&path, &["half.oni", "colour stream"]);
    write(&path, &[color_stream(2, 64, 48)]);
    check_refused(&path, &["half.oni", "depth stream"]);
}

#[test]
fn a_path_that_is_too_long_for_the_library() {
    let Some(_) = openni2() else { return };
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("a".repeat(120)).join("b".repeat(120));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("long.oni");
    write(&path, &[depth_stream(1, 64, 48), color_stream(1, 64, 48)]);
    check_refused(&path, &["255", "shorter path"]);
}

#[test]
fn a_library_that_is_not_there() {
    let mut launch = file_launch(Path::new("a.oni"));
    launch.environment.push(("SCAN_OPENNI2_LIB".into(), "/nowhere/libOpenNI2.so.0".into()));
    match ChildSource::open(launch) {
        Err(SourceError::LibraryMissing { library, advice }) => {
            assert!(library.contains("OpenNI2") && advice.contains("/nowhere/libOpenNI2.so.0"), "{advice}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn no_sensor_is_plugged_in() {
    let Some(_) = openni2() else { return };
    for (target, words) in [("", "libfreenect"), ("1d27/0601@1/2", "1d27/0601@1/2")] {
        match ChildSource::open(launch("openni2", target)) {
            Err(SourceError::NotFound(text)) => assert!(text.contains(words), "{text}"),
            other => panic!("{other:?}"),
        }
    }
}
