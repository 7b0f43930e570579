use super::*;
use reconstruct::pose::Pose;

pub(crate) fn info() -> SensorInfo {
    let camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
    SensorInfo {
        backend: "freenect".into(),
        address: "freenect:A1".into(),
        model: "Xbox 360 Kinect".into(),
        serial: "A1".into(),
        rig: Rig { color: camera, depth: camera, color_from_depth: Pose::translation(0.025, 0.0, 0.0) },
        units_per_metre: 1000.0,
        abilities: vec![Ability::Tilt, Ability::Led],
    }
}

fn every_message() -> Vec<Message> {
    let color = ColorImage { width: 3, height: 2, data: (0..6).map(|i| [i, i + 1, i + 2]).collect() };
    let depth =
        DepthImage { width: 2, height: 2, data: vec![0, 1, 10_000, u16::MAX], units_per_metre: 1000.0 };
    vec![
        Message::Opened(Box::new(info())),
        Message::Color(Stamped { image: color.clone(), timestamp_nanos: u64::MAX, lost_packets: 0 }),
        Message::Depth(Stamped { image: depth, timestamp_nanos: 7, lost_packets: 3 }),
        Message::Still(color),
        Message::Gravity([0.0, 9.81, -0.5]),
        Message::Answer(None),
        Message::Answer(Some("the motor is at its end".into())),
        Message::Found(LibraryFacts { path: Some("/usr/lib/l.so".into()), version: None, sensors: vec![] }),
        Message::Alive,
        Message::Unplugged,
        Message::Ended,
        Message::Failed(Failure::LibraryMissing("install it".into())),
    ]
}

fn bytes_of(message: &Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes, message).unwrap();
    bytes
}

#[test]
fn every_message_arrives_as_it_was_sent() {
    let messages = every_message();
    let bytes: Vec<u8> = messages.iter().flat_map(bytes_of).collect();
    let mut input = bytes.as_slice();
    for message in &messages {
        assert_eq!(read(&mut input).unwrap().as_ref(), Some(message));
    }
    assert_eq!(read(&mut input).unwrap(), None);
}

#[test]
fn a_message_cut_short_anywhere_is_an_error() {
    for message in every_message() {
        let bytes = bytes_of(&message);
        for end in 1..bytes.len() {
            let error = read(&mut &bytes[..end]).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof, "{message:?} at {end}");
        }
    }
}

#[test]
fn any_byte_may_be_wrong_without_harm() {
    for message in every_message() {
        let good = bytes_of(&message);
        for at in 0..good.len() {
            for wrong in [0, 1, 0x7f, 0xff] {
                let mut bytes = good.clone();
                bytes[at] = wrong;
                // An error or another message, but never a panic or memory for what is not there.
                let _ = read(&mut bytes.as_slice());
            }
        }
    }
}

#[test]
fn sizes_that_cannot_be_are_refused_before_memory_is_taken() {
    let mut huge = bytes_of(&every_message()[1]);
    huge[5..9].copy_from_slice(&60_000u32.to_le_bytes());
    assert_eq!(read(&mut huge.as_slice()).unwrap_err().kind(), io::ErrorKind::InvalidData);
    let words = [kind::WORDS, 0xff, 0xff, 0xff, 0xff];
    assert_eq!(read(&mut words.as_slice()).unwrap_err().kind(), io::ErrorKind::InvalidData);
    let image = ColorImage { width: 0, height: 0, data: vec![] };
    assert!(write(&mut Vec::new(), &Message::Still(image)).is_err());
}

#[test]
fn orders_are_lines() {
    for order in [Order::Start, Order::Control(Control::Tilt(0.1)), Order::Control(Control::Still)] {
        let line = serde_json::to_string(&order).unwrap();
        assert!(!line.contains('\n'));
        assert_eq!(serde_json::from_str::<Order>(&line).unwrap(), order);
    }
}
