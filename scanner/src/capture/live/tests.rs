use std::sync::Arc;
use std::time::Duration;

use kinect::source::{Control, Event, Source};
use reconstruct::board::Family;

use super::*;
use crate::capture::hints::Code;
use crate::capture::simulated::Simulated;
use crate::simulate::{Paper, ring};

fn a3() -> KnownBoard {
    ring(Paper::A3, Family::Aruco4x4_50)
}

fn frame(sensor: &mut Simulated) -> Arc<Frame> {
    match sensor.next_event(Duration::from_secs(1)) {
        Event::Frame(frame) => frame,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_good_scene_is_green_once_it_has_been_still_and_moving_starts_again() {
    let mut sensor = Simulated::open("simulated:mug", None).unwrap();
    sensor.start().unwrap();
    let mut live = Live::new(&sensor.sensor().rig, None, Some(&a3()));
    let start = Instant::now();
    let first = live.look(&frame(&mut sensor), start);
    assert_eq!((first.light, first.header.hints[0].code), (Level::Yellow, Code::Moving));
    let later = live.look(&frame(&mut sensor), start + Duration::from_secs(1));
    assert_eq!(later.light, Level::Green, "{:?}", later.header.hints);
    assert!(later.header.still_seconds > 0.9 && later.header.tags.len() > 8);
    assert!(later.header.region.len() == 4 && later.keep.iter().any(|&k| k));
    let distance = later.header.distance_metres.unwrap();
    assert!((0.5..1.0).contains(&distance), "{distance}");
    sensor.control(Control::Station(1.0)).unwrap();
    let moved = live.look(&frame(&mut sensor), start + Duration::from_secs(2));
    assert!(moved.header.still_seconds == 0.0, "{:?}", moved.header);
}

#[test]
fn another_board_is_told() {
    let mut sensor = Simulated::open("simulated:mug", None).unwrap();
    sensor.start().unwrap();
    let a4 = ring(Paper::A4, Family::Aruco4x4_50);
    let look = Live::new(&sensor.sensor().rig, None, Some(&a4)).look(&frame(&mut sensor), Instant::now());
    assert_eq!((look.light, look.header.hints[0].code), (Level::Red, Code::BoardUnknown));
    let other = ring(Paper::A3, Family::Tag36h11);
    let look = Live::new(&sensor.sensor().rig, None, Some(&other)).look(&frame(&mut sensor), Instant::now());
    assert_eq!(look.header.hints[0].code, Code::BoardHidden);
}

#[test]
fn depth_is_as_the_unit_was_calibrated() {
    let mut sensor = Simulated::open("simulated:mug", None).unwrap();
    sensor.start().unwrap();
    let (rig, frame) = (sensor.sensor().rig, frame(&mut sensor));
    let mut prior = CalibrationPrior::of_any_kinect();
    let depth = |prior: Option<&CalibrationPrior>| {
        Live::new(&rig, prior, Some(&a3())).look(&frame, Instant::now()).depth
    };
    let plain = depth(None);
    let is_scaled = |other: &[f32], scale: f32| {
        plain.iter().zip(other).all(|(plain, other)| (plain * scale - other).abs() < 1e-5)
    };
    assert!(is_scaled(&depth(Some(&prior)), 1.0));
    prior.coefficients[0] = 0.02;
    assert!(is_scaled(&depth(Some(&prior)), 1.0 / 1.02));
}

#[test]
fn the_message_holds_what_its_header_says() {
    let mut sensor = Simulated::open("simulated:mug", None).unwrap();
    sensor.start().unwrap();
    let mut live = Live::new(&sensor.sensor().rig, None, Some(&a3()));
    let frame = frame(&mut sensor);
    let look = live.look(&frame, Instant::now());
    let message = live.picture(&frame, look).unwrap();
    let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&message[4..4 + length]).unwrap();
    let bytes = |name: &str| header[name].as_u64().unwrap() as usize;
    assert_eq!(message.len(), 4 + length + bytes("color_bytes") + bytes("depth_bytes"));
    let color = &message[4 + length..4 + length + bytes("color_bytes")];
    assert_eq!(crate::pictures::size(color).unwrap().width, 640);
    let depth =
        crate::pictures::decode_color(&message[4 + length + bytes("color_bytes")..], 320, 240).unwrap();
    let (grey, colored): (Vec<_>, Vec<_>) = depth
        .data
        .iter()
        .filter(|p| p.iter().any(|&v| v > 60))
        .copied()
        .partition(|[r, _, b]| r.abs_diff(*b) < 12);
    assert!(grey.len() > 5_000 && colored.len() > 500, "{} {}", grey.len(), colored.len());
}
