//! Dumps, played by the replay library in the place of the real one.

use kinect::child::{ChildSource, Launch, Overflow};
use kinect::freenect::depth::{Constants, Mapping};
use kinect::source::{Ability, Event, Source, SourceError};
use kinect_testing::{dump, launch, library, scene};

use super::bus::{LONG, frame, set, started};

fn of_dump(folder: &str) -> Option<Launch> {
    let library = library(&[
        "/usr/lib/x86_64-linux-gnu/fakenect/libfreenect.so.0.5",
        "/usr/lib/aarch64-linux-gnu/fakenect/libfreenect.so.0.5",
    ])?;
    let mut launch = launch("freenect", "");
    launch.overflow = Overflow::Wait;
    set(&mut launch, "SCAN_FREENECT_LIB", library);
    set(&mut launch, "FAKENECT_PATH", folder);
    Some(launch)
}

#[test]
fn a_dump_is_played_to_the_last_bit_and_ends() {
    let home = tempfile::tempdir().unwrap();
    dump::write(home.path(), 6).unwrap();
    let Some(launch) = of_dump(home.path().to_str().unwrap()) else { return };
    let mut source = started(launch);
    assert_eq!(source.sensor().abilities, [Ability::Accelerometer]);
    let mapping = Mapping::new(&Constants::default());
    for index in 0..6 {
        let frame = frame(&mut source);
        assert!(frame.color.data == scene::picture(index), "picture {index}");
        assert!(frame.depth.data == mapping.registered(&scene::raw_depth(index)), "depth {index}");
        assert_eq!(frame.color_timestamp_nanos - frame.depth_timestamp_nanos, 4_000_000);
    }
    assert!(matches!(source.next_event(LONG), Event::Ended));
    // Again from the beginning.
    source.start().unwrap();
    assert_eq!(frame(&mut source).index, 0);
}

#[test]
fn dumps_that_are_none() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().to_str().unwrap();
    let refused = |words: &str| {
        let Some(launch) = of_dump(folder) else { return };
        let opened = ChildSource::open(launch);
        assert!(
            matches!(&opened, Err(SourceError::NotFound(why)) if why.contains(words)),
            "{words}: {opened:?}"
        );
    };
    refused("cannot be read");
    std::fs::write(home.path().join("INDEX.txt"), "\n").unwrap();
    refused("names no images");
    dump::write(home.path(), 2).unwrap();
    std::fs::remove_file(home.path().join("d-1000.000000-2100000.pgm")).unwrap();
    refused("is missing");
}
