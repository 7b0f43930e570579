//! What a driver's process says to the program.
#![no_main]

use kinect::child::digest;
use kinect::source::{Ability, Event, SensorInfo};
use kinect::wire::{self, Failure, Message, Stamped};
use libfuzzer_sys::fuzz_target;
use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;

/// Few frames wait, one sharper picture, and the news of the end.
const MOST_EVENTS: usize = 5;

fn seeds() -> Vec<Vec<u8>> {
    let camera = Intrinsics::pinhole(16, 16, 20.0, 20.0, 7.5, 7.5);
    let rig = Rig { color: camera, depth: camera, color_from_depth: Pose::identity() };
    let info = SensorInfo {
        backend: "freenect".into(),
        address: "freenect:A1".into(),
        model: "Kinect".into(),
        serial: "A1".into(),
        rig,
        units_per_metre: 1000.0,
        abilities: vec![Ability::Tilt, Ability::Stills],
    };
    let color = ColorImage { width: 4, height: 2, data: vec![[1, 2, 3]; 8] };
    let depth = DepthImage { width: 4, height: 2, data: vec![700; 8], units_per_metre: 1000.0 };
    let opened = Message::Opened(Box::new(info));
    let color_of =
        |nanos| Message::Color(Stamped { image: color.clone(), timestamp_nanos: nanos, lost_packets: 1 });
    let depth_of =
        |nanos| Message::Depth(Stamped { image: depth.clone(), timestamp_nanos: nanos, lost_packets: 0 });
    let talks = [
        vec![opened.clone(), color_of(4), depth_of(0), Message::Gravity([0.0, 9.8, 0.1]), Message::Unplugged],
        vec![opened.clone(), depth_of(0), depth_of(33_000_000), color_of(40_000_000), Message::Ended],
        vec![opened, Message::Still(color.clone()), Message::Answer(Some("no".into())), Message::Answer(None)],
        vec![Message::Alive, Message::Failed(Failure::NotFound("nothing".into()))],
    ];
    let written = |talk: &Vec<Message>| {
        let mut bytes = Vec::new();
        talk.iter().for_each(|message| wire::write(&mut bytes, message).expect("it fits"));
        bytes
    };
    talks.iter().map(written).collect()
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    let said = digest(&mut &data[..]);
    assert!(said.events.len() <= MOST_EVENTS && said.messages <= data.len() / 5);
    if let Some(sensor) = said.sensor {
        assert!(sensor.rig.color.is_valid() && sensor.rig.depth.is_valid());
    }
    for event in said.events {
        if let Event::Frame(frame) = event {
            assert_eq!(frame.color.data.len(), frame.color.width * frame.color.height);
            assert_eq!(frame.depth.data.len(), frame.depth.width * frame.depth.height);
        }
    }
});
