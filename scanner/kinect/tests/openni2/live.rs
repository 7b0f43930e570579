//! A live sensor: the mock driver under the real core.

use std::time::{Duration, Instant};

use kinect::child::ChildSource;
use kinect::source::{Ability, Control, Event, Source, SourceError};
use mock_oni_driver::{SECOND_URI, SERIALS, URI, picture};

use crate::support::{Private, openni2, wait_for_frame};

const SOON: Duration = Duration::from_secs(2);

/// Registered, not mirrored, and paired: what the mock sends without being asked is neither of the three.
#[test]
fn frames_are_registered_unmirrored_and_paired() {
    let Some(core) = openni2() else { return };
    let private = Private::new(&core);
    for target in ["", URI] {
        let mut source = ChildSource::open(private.launch(target, &[])).unwrap();
        let sensor = source.sensor().clone();
        assert_eq!(sensor.address, format!("openni2:{URI}"));
        assert_eq!(sensor.model, "Mock Kinect for tests");
        assert_eq!(sensor.rig.color_from_depth, reconstruct::pose::Pose::identity());
        source.start().unwrap();
        for _ in 0..5 {
            let frame = wait_for_frame(&mut source, SOON, |_| true);
            // The first frames of either stream may be lost while the streams start: the number is in the picture.
            let index = u32::from(frame.depth.data[0]);
            assert!(frame.depth.data == picture::depth(index), "frame {index}");
            assert!(frame.color.data == picture::color(index, true, true), "frame {index}");
            assert_eq!(frame.depth_timestamp_nanos, u64::from(index) * 33_333_000);
            assert_eq!(frame.color_timestamp_nanos - frame.depth_timestamp_nanos, 4_000_000);
        }
        source.stop();
    }
}

/// Each of two sensors by its address and by its serial number, which finds it again after it was unplugged.
#[test]
fn two_sensors_are_told_apart() {
    let Some(core) = openni2() else { return };
    let private = Private::new(&core);
    let two = [("MOCK_KINECT_SECOND", "1")];
    let open = |target: &str| ChildSource::open(private.launch(target, &two));
    for (target, uri, serial) in [
        ("", URI, SERIALS[0]),
        (URI, URI, SERIALS[0]),
        (SECOND_URI, SECOND_URI, SERIALS[1]),
        (SERIALS[1], SECOND_URI, SERIALS[1]),
    ] {
        let source = open(target).unwrap();
        let sensor = source.sensor();
        assert_eq!((sensor.address.as_str(), sensor.serial.as_str()), (&*format!("openni2:{uri}"), serial));
    }
    let (mut first, mut second) = (open(URI).unwrap(), open(SECOND_URI).unwrap());
    first.start().unwrap();
    second.start().unwrap();
    wait_for_frame(&mut first, SOON, |_| true);
    wait_for_frame(&mut second, SOON, |_| true);
    private.unplug();
    assert!(second.start().is_err());
    private.plug_in();
    second.start().unwrap();
    assert_eq!(second.sensor().serial, SERIALS[1]);
    wait_for_frame(&mut second, SOON, |_| true);
    for missing in ["mock://kinect2", "MOCK0003"] {
        match open(missing) {
            Err(SourceError::NotFound(words)) => assert!(words.contains(SECOND_URI), "{words}"),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn exposure_is_held_and_let_go() {
    let Some(core) = openni2() else { return };
    let private = Private::new(&core);
    let mut source = ChildSource::open(private.launch("", &[])).unwrap();
    assert_eq!(source.sensor().abilities, [Ability::ExposureLock]);
    source.start().unwrap();
    for lock in [true, false, true] {
        source.control(Control::LockExposure(lock)).unwrap();
        let automatic = u8::from(!lock);
        wait_for_frame(&mut source, SOON, |frame| frame.color.data[0][1..] == [automatic; 2]);
    }
    assert!(matches!(source.control(Control::Tilt(0.1)), Err(SourceError::Unable(_))));
}

#[test]
fn unplugged_and_plugged_in_again_twenty_times() {
    let Some(core) = openni2() else { return };
    let private = Private::new(&core);
    let mut source = ChildSource::open(private.launch("", &[])).unwrap();
    source.start().unwrap();
    for round in 0..20 {
        wait_for_frame(&mut source, SOON, |_| true);
        private.unplug();
        let pulled = Instant::now();
        loop {
            match source.next_event(Duration::from_millis(100)) {
                Event::Unplugged => break,
                Event::Frame(_) | Event::Nothing => {}
                other => panic!("round {round}: {other:?}"),
            }
            assert!(pulled.elapsed() < SOON, "round {round}: nothing said");
        }
        match source.start() {
            Err(SourceError::NotFound(_)) => {}
            other => panic!("round {round}: {other:?} without a sensor"),
        }
        private.plug_in();
        let plugged = Instant::now();
        source.start().unwrap();
        wait_for_frame(&mut source, SOON, |_| true);
        assert!(plugged.elapsed() < SOON, "round {round}: {:?}", plugged.elapsed());
    }
}

#[test]
fn a_sensor_that_sends_nothing_is_reported() {
    let Some(core) = openni2() else { return };
    let private = Private::new(&core);
    let mut launch = private.launch("", &[("MOCK_KINECT_NO_FRAMES", "1")]);
    launch.patience.images = Duration::from_millis(600);
    let mut source = ChildSource::open(launch).unwrap();
    source.start().unwrap();
    let started = Instant::now();
    let event = loop {
        match source.next_event(Duration::from_millis(200)) {
            Event::Nothing if started.elapsed() < Duration::from_secs(5) => {}
            event => break event,
        }
    };
    assert!(matches!(&event, Event::Failed(words) if words.contains("no pictures")), "{event:?}");
}
