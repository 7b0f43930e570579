//! Every pixel that arrives is the one that was sent.

use std::sync::Arc;

use kinect::freenect::depth::{Constants, FARTHEST, Mapping, Polynomial};
use kinect::source::{Frame, Source};
use kinect_testing::scene;

use super::bus::{frame, on_bus, started};

const FRAMES: u32 = 4;

/// What the library itself makes of the scene in a format; `None` where it is missing.
fn of_library(format: &str) -> Option<Vec<Arc<Frame>>> {
    let mut source = started(on_bus("freenect-format", format, &[("FRAMES", &FRAMES.to_string())])?);
    Some((0..FRAMES).map(|_| frame(&mut source)).collect())
}

fn of_driver() -> Option<Vec<Arc<Frame>>> {
    let mut source = started(on_bus("freenect", "", &[("FRAMES", &FRAMES.to_string())])?);
    Some((0..FRAMES).map(|_| frame(&mut source)).collect())
}

#[test]
fn raw_depth_of_eleven_and_ten_bits() {
    let (Some(eleven), Some(ten)) = (of_library("raw"), of_library("ten-bits")) else { return };
    for (index, (eleven, ten)) in eleven.iter().zip(&ten).enumerate() {
        let sent = scene::raw_depth(index as u32);
        assert!(eleven.depth.data == sent, "frame {index}");
        assert!(ten.depth.data == sent.iter().map(|raw| raw & 0x3ff).collect::<Vec<_>>(), "frame {index}");
    }
}

#[test]
fn millimetres_are_the_library_s_to_the_last_one() {
    let Some(frames) = of_library("millimetres") else { return };
    let mapping = Mapping::new(&Constants::default());
    for (index, frame) in frames.iter().enumerate() {
        let ours = mapping.millimetres(&scene::raw_depth(index as u32));
        // The library says 10000 where nothing but noise was measured.
        let theirs: Vec<u16> = frame.depth.data.iter().map(|&d| if d < FARTHEST { d } else { 0 }).collect();
        assert!(ours == theirs, "frame {index}");
        assert!(theirs.iter().filter(|&&d| d > 0).count() > 290_000);
    }
}

#[test]
fn registered_depth_is_the_library_s() {
    let (Some(theirs), Some(ours)) = (of_library("registered"), of_driver()) else { return };
    for (index, (theirs, ours)) in theirs.iter().zip(&ours).enumerate() {
        let pairs = theirs.depth.data.iter().zip(&ours.depth.data);
        let equal = pairs.filter(|(a, b)| a == b).count();
        let share = equal as f64 / (scene::WIDTH * scene::HEIGHT) as f64;
        let measured = ours.depth.data.iter().filter(|&&d| d > 0).count();
        println!("frame {index}: {:.4} % equal, {measured} pixels measured", 100.0 * share);
        assert!(share >= 0.999, "frame {index}: {share}");
        // Not equal because both are empty.
        assert!(measured > 200_000, "frame {index}: {measured}");
    }
    // The table moves things: registered depth is not the raw one in millimetres.
    let flat =
        Constants { across: Polynomial::default(), down: Polynomial::default(), ..Constants::default() };
    let unmoved = Mapping::new(&flat).registered(&scene::raw_depth(0));
    let moved = unmoved.iter().zip(&ours[0].depth.data).filter(|(a, b)| a != b).count();
    assert!(moved > 100_000, "{moved}");
}

/// The simulated device's table is another than the one for unknown units.
#[test]
fn cameras_are_the_device_s_own() {
    let Some(launch) = on_bus("freenect", "", &[("FRAMES", "1")]) else { return };
    let source = started(launch);
    let (own, usual) = (source.sensor().rig, Constants::default().color_camera().unwrap());
    assert!((own.color.fx - 525.0).abs() < 10.0 && own.color.fx != usual.fx, "{own:?}");
    assert_eq!(own.depth, own.color);
}

#[test]
fn colour_is_the_library_s_and_the_one_that_was_sent() {
    let (Some(theirs), Some(bayer), Some(ours)) = (of_library("color"), of_library("bayer"), of_driver())
    else {
        return;
    };
    for (index, ours) in ours.iter().enumerate() {
        assert!(ours.color == theirs[index].color, "frame {index}");
        let sent = scene::bayer(index as u32, 640, 480);
        let got = bayer[index].color.data.iter().map(|[value, ..]| *value);
        assert!(got.eq(sent), "frame {index}");
        for (x, y) in [(10, 10), (101, 200), (300, 401)] {
            assert_eq!(
                ours.color.data[y * 640 + x],
                scene::even_color(index as u32),
                "frame {index} at {x} {y}"
            );
        }
    }
}

#[test]
fn frames_say_when_they_were_taken_and_in_what_order() {
    let Some(frames) = of_driver() else { return };
    for (index, frame) in frames.iter().enumerate() {
        assert_eq!((frame.index, frame.skipped, frame.lost_packets), (index as u64, 0, 0));
        assert_eq!(frame.color_timestamp_nanos - frame.depth_timestamp_nanos, 1_500_000);
        let ticks = 100_000 + 2_000_000 * index as u64;
        assert_eq!(frame.depth_timestamp_nanos, ticks * 1_000_000_000 / 60_000_000);
        assert_eq!((frame.depth.units_per_metre, frame.depth.width, frame.depth.height), (1000.0, 640, 480));
    }
}

#[test]
fn the_counter_begins_again_in_mid_stream() {
    let start = u32::MAX - 3_000_000;
    let settings = [("FRAMES", "4"), ("START_TICKS", &start.to_string())];
    let Some(launch) = on_bus("freenect", "", &settings) else { return };
    let mut source = started(launch);
    let times: Vec<u64> = (0..4).map(|_| frame(&mut source).depth_timestamp_nanos).collect();
    for pair in times.windows(2) {
        assert!((33_333_332..=33_333_334).contains(&(pair[1] - pair[0])), "{times:?}");
    }
}

#[test]
fn lost_packets_mark_their_frame_and_no_other() {
    for (dropped, lost) in [("depth:2:100,101", 2), ("video:2:30", 1)] {
        let Some(launch) = on_bus("freenect", "", &[("FRAMES", "5"), ("DROP", dropped)]) else { return };
        let mut source = started(launch);
        let told: Vec<u32> = (0..5).map(|_| frame(&mut source).lost_packets).collect();
        assert_eq!(told, [0, 0, lost, 0, 0], "{dropped}");
    }
}
