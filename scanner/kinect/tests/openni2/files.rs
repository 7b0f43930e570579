//! Recordings come back as they were written, and come to an end.

use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use kinect::child::{ChildSource, SUBCOMMAND};
use kinect::source::{Event, Source};
use kinect::wire::{self, Message};
use oni_writer::Kind;

use crate::support::{
    color, color_stream, depth, depth_stream, file_launch, openni2, play, recording, write,
};

#[test]
fn every_frame_comes_back_bit_by_bit() {
    let Some(_) = openni2() else { return };
    let (_home, path) = recording(12, 640, 480);
    let (source, frames) = play(&path).unwrap();
    assert_eq!(frames.len(), 12);
    for (i, frame) in frames.iter().enumerate() {
        assert!(frame.depth.data == depth(i, 640, 480), "depth {i}");
        assert!(frame.color.data == color(i, 640, 480), "colour {i}");
        let times = (frame.depth_timestamp_nanos, frame.color_timestamp_nanos);
        assert_eq!(times, (33_333_000 * i as u64, 33_333_000 * i as u64 + 4_000_000));
        assert_eq!((frame.index, frame.skipped, frame.lost_packets), (i as u64, 0, 0));
    }
    let sensor = source.sensor();
    assert_eq!((sensor.backend.as_str(), sensor.units_per_metre), ("openni2", 1000.0));
    assert_eq!(sensor.address, format!("openni2:{}", path.display()));
    assert_eq!(sensor.rig.depth, sensor.rig.color);
    // 320 px / tan(1.01447 / 2): the Kinect's.
    assert!((sensor.rig.color.fx - 575.816).abs() < 0.01 && (sensor.rig.color.fy - 575.816).abs() < 0.01);
    assert_eq!((sensor.rig.color.cx, sensor.rig.color.cy), (319.5, 239.5));
}

#[test]
fn a_reader_that_takes_its_time_loses_nothing() {
    let Some(_) = openni2() else { return };
    let (_home, path) = recording(40, 64, 48);
    let mut source = ChildSource::open(file_launch(&path)).unwrap();
    source.start().unwrap();
    let mut count = 0;
    loop {
        match source.next_event(Duration::from_secs(10)) {
            Event::Frame(frame) => {
                assert!(frame.depth.data == depth(count, 64, 48));
                assert_eq!(frame.skipped, 0);
                count += 1;
                if count.is_multiple_of(8) {
                    std::thread::sleep(Duration::from_millis(60));
                }
            }
            Event::Ended => break,
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(count, 40);
}

/// The player would keep a core busy; and what has ended can be started again from the beginning.
#[test]
fn the_end_is_noticed_and_starting_again_begins_anew() {
    let Some(_) = openni2() else { return };
    let (_home, path) = recording(3, 64, 48);
    let (mut source, frames) = play(&path).unwrap();
    assert_eq!(frames.len(), 3);
    assert!(matches!(source.next_event(Duration::from_millis(200)), Event::Nothing));
    source.start().unwrap();
    let started = Instant::now();
    let mut count = 0;
    while let Event::Frame(frame) = source.next_event(Duration::from_secs(5)) {
        assert!(frame.depth.data == depth(count, 64, 48));
        count += 1;
    }
    assert_eq!(count, 3);
    assert!(started.elapsed() < Duration::from_secs(2), "{:?}", started.elapsed());
    source.stop();
    source.stop();
}

#[test]
fn tenths_of_millimetres_are_said_to_be_such() {
    let Some(_) = openni2() else { return };
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("fine.oni");
    let mut fine = depth_stream(2, 64, 48);
    fine.kind = Kind::FineDepth;
    write(&path, &[fine, color_stream(2, 64, 48)]);
    let (source, frames) = play(&path).unwrap();
    assert_eq!((source.sensor().units_per_metre, frames[0].depth.units_per_metre), (10_000.0, 10_000.0));
    assert!(frames[1].depth.data == depth(1, 64, 48));
}

#[test]
fn mirrored_pictures_are_turned() {
    let Some(_) = openni2() else { return };
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("mirrored.oni");
    let (mut depths, mut colors) = (depth_stream(2, 64, 48), color_stream(2, 64, 48));
    (depths.is_mirrored, colors.is_mirrored) = (true, true);
    write(&path, &[depths, colors]);
    let (_, frames) = play(&path).unwrap();
    let mut expected = depth(1, 64, 48);
    expected.chunks_exact_mut(64).for_each(<[u16]>::reverse);
    assert!(frames[1].depth.data == expected);
    let mut expected = color(1, 64, 48);
    expected.chunks_exact_mut(64).for_each(<[[u8; 3]]>::reverse);
    assert!(frames[1].color.data == expected);
}

#[test]
fn colour_of_another_size_has_its_own_camera() {
    let Some(_) = openni2() else { return };
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("sizes.oni");
    write(&path, &[depth_stream(2, 320, 240), color_stream(2, 640, 480)]);
    let (source, frames) = play(&path).unwrap();
    let rig = source.sensor().rig;
    assert_eq!((rig.depth.width, rig.color.width), (320, 640));
    assert!((rig.color.fx - 2.0 * rig.depth.fx).abs() < 1e-9);
    assert!(frames[1].depth.data == depth(1, 320, 240) && frames[1].color.data == color(1, 640, 480));
}

/// The folder that the program works in stays what it was, though the library changes it.
#[test]
fn a_path_relative_to_the_folder() {
    let Some(_) = openni2() else { return };
    let (home, _path) = recording(2, 64, 48);
    let mut shell = Command::new("sh");
    shell.args(["-c", "exec \"$0\" \"$1\" openni2 3 test.oni 3>&1 >/dev/null"]);
    let host = kinect_testing::built("kinect-testing", "driver-host");
    shell.arg(host).arg(SUBCOMMAND).current_dir(home.path());
    assert_eq!(played_by(&mut shell), (2, true));
}

/// Opens, reads and closes 200 times: the driver's process ends as it should each time.
#[test]
fn two_hundred_runs_without_a_crash() {
    let Some(_) = openni2() else { return };
    let (_home, path) = recording(3, 64, 48);
    let host = kinect_testing::built("kinect-testing", "driver-host");
    let left = AtomicUsize::new(200);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| n.checked_sub(1)).is_ok() {
                    let mut shell = Command::new("sh");
                    shell.args(["-c", "exec \"$0\" \"$1\" openni2 3 \"$2\" 3>&1 >/dev/null"]);
                    shell.arg(&host).arg(SUBCOMMAND).arg(&path);
                    assert_eq!(played_by(&mut shell), (3, true));
                }
            });
        }
    });
}

/// Runs a driver by hand: how many depth images it sent, and whether it said the end and left with status 0.
fn played_by(shell: &mut Command) -> (usize, bool) {
    let mut driver =
        shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut messages = driver.stdout.take().unwrap();
    let mut orders = driver.stdin.take();
    let (mut depths, mut has_ended) = (0, false);
    while let Some(message) = wire::read(&mut messages).unwrap() {
        match message {
            Message::Opened(_) => {
                let start = serde_json::to_string(&wire::Order::Start).unwrap() + "\n";
                std::io::Write::write_all(orders.as_mut().unwrap(), start.as_bytes()).unwrap();
            }
            Message::Depth(_) => depths += 1,
            Message::Ended => has_ended = true,
            Message::Color(_) | Message::Alive => {}
            other => panic!("{other:?}"),
        }
    }
    drop(orders);
    let status = driver.wait().unwrap();
    assert!(status.success(), "{status}");
    (depths, has_ended)
}
