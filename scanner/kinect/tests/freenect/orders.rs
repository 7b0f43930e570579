//! What a sensor can be asked, and which one is asked.

use std::time::Duration;

use kinect::child::ChildSource;
use kinect::source::{Ability, Control, Event, Led, Source, SourceError};
use kinect_testing::scene;

use super::bus::{Journal, LONG, frame, on_bus, started, until};

#[test]
fn motor_lamp_and_exposure() {
    let journal = Journal::new();
    let Some(launch) = on_bus("freenect", "", &[("JOURNAL", journal.setting()), ("PACE_MILLIS", "5")]) else {
        return;
    };
    let mut source = started(launch);
    let info = source.sensor().clone();
    assert_eq!(
        (info.serial.as_str(), info.address.as_str()),
        ("A00365A00000000A", "freenect:A00365A00000000A")
    );
    for ability in
        [Ability::Tilt, Ability::Led, Ability::Accelerometer, Ability::ExposureLock, Ability::Stills]
    {
        assert!(info.abilities.contains(&ability), "{ability:?}");
    }
    frame(&mut source);
    source.control(Control::Tilt(10f64.to_radians())).unwrap();
    source.control(Control::Led(Led::Red)).unwrap();
    source.control(Control::LockExposure(false)).unwrap();
    assert!(matches!(source.control(Control::Station(1.0)), Err(SourceError::Unable(_))));
    let lines = journal.lines();
    assert!(lines.contains(&"tilt 10".into()) && lines.contains(&"lamp 2".into()), "{lines:?}");
}

/// Exposure runs free until the sensor is warm, then is held; an order comes before that.
#[test]
fn exposure_is_held_once_the_sensor_is_warm() {
    let journal = Journal::new();
    let Some(launch) = on_bus("freenect", "", &[("JOURNAL", journal.setting())]) else { return };
    let mut source = started(launch);
    for _ in 0..30 {
        frame(&mut source);
    }
    let held = |journal: &Journal| journal.last("cmos 0x106");
    for _ in 0..40 {
        frame(&mut source);
    }
    until(|| held(&journal).is_some());
    // The simulated chip begins with both automatics on: bits 14 and 1.
    let value = u16::from_str_radix(held(&journal).unwrap().trim_start_matches("0x"), 16).unwrap();
    assert_eq!(value & 0x4002, 0, "{value:#x}");
    source.control(Control::LockExposure(false)).unwrap();
    let value = u16::from_str_radix(held(&journal).unwrap().trim_start_matches("0x"), 16).unwrap();
    assert_eq!(value & 0x4002, 0x4002, "{value:#x}");
}

#[test]
fn gravity_comes_with_the_frames() {
    let Some(launch) = on_bus("freenect", "", &[("PACE_MILLIS", "10")]) else { return };
    let mut source = started(launch);
    let mut gravity = None;
    until(|| {
        gravity = frame(&mut source).gravity;
        gravity.is_some()
    });
    let [x, y, z] = gravity.unwrap();
    assert!(x.abs() < 0.1 && (y - 9.81).abs() < 0.1 && z.abs() < 0.1, "{x} {y} {z}");
}

#[test]
fn a_sensor_without_a_motor_is_a_camera() {
    let Some(launch) = on_bus("freenect", "", &[("NO_MOTOR", "1")]) else { return };
    let mut source = started(launch);
    frame(&mut source);
    let abilities = &source.sensor().abilities;
    assert_eq!(abilities, &[Ability::ExposureLock, Ability::Stills]);
    assert!(matches!(source.control(Control::Tilt(0.1)), Err(SourceError::Unable(_))));
}

#[test]
fn stills_are_large_and_frames_go_on_after() {
    let Some(launch) = on_bus("freenect", "", &[("PACE_MILLIS", "5")]) else { return };
    let mut source = started(launch);
    frame(&mut source);
    source.control(Control::Still).unwrap();
    let mut still = None;
    until(|| {
        if let Event::Still(taken) = source.next_event(LONG) {
            still = Some(taken);
        }
        still.is_some()
    });
    let still = still.unwrap();
    assert_eq!((still.width, still.height), (1280, 1024));
    let [red, green, _] = still.data[500 * 1280 + 300];
    assert_eq!([red, green], [200, 120]);
    // Those that were under way are small and whole, and so are those after.
    for _ in 0..10 {
        let frame = frame(&mut source);
        assert_eq!((frame.color.width, frame.color.data.len()), (640, scene::WIDTH * scene::HEIGHT));
    }
}

#[test]
fn two_sensors_are_told_apart_by_their_serial_numbers() {
    let settings = [("SERIALS", "AAAA,BBBB"), ("FRAMES", "1")];
    for (target, serial) in [("", "AAAA"), ("BBBB", "BBBB"), ("#2", "BBBB"), ("AAAA", "AAAA")] {
        let Some(launch) = on_bus("freenect", target, &settings) else { return };
        let mut source = started(launch);
        assert_eq!(source.sensor().serial, serial);
        let sees = frame(&mut source).color.data[100 * 640 + 100];
        assert_eq!(sees, scene::even_color(if serial == "AAAA" { 0 } else { 1000 }), "{target}");
    }
    let Some(launch) = on_bus("freenect", "CCCC", &settings) else { return };
    let opened = ChildSource::open(launch);
    assert!(matches!(&opened, Err(SourceError::NotFound(why)) if why.contains("AAAA, BBBB")), "{opened:?}");
}

#[test]
fn refusals_say_what_to_do() {
    for (setting, words) in
        [(("REFUSE_OPEN", "-3"), "may not use"), (("REFUSE_CLAIM", "-6"), "another program")]
    {
        let Some(launch) = on_bus("freenect", "#1", &[setting]) else { return };
        let opened = ChildSource::open(launch);
        assert!(matches!(&opened, Err(SourceError::Refused(why)) if why.contains(words)), "{opened:?}");
    }
}

#[test]
fn nothing_plugged_in_and_no_library() {
    let Some(launch) = on_bus("freenect", "", &[("PRESENT", "/nonexistent/plug")]) else { return };
    let opened = ChildSource::open(launch);
    assert!(matches!(&opened, Err(SourceError::NotFound(why)) if why.contains("no Kinect")), "{opened:?}");
    let mut launch = kinect_testing::launch("freenect", "");
    super::bus::set(&mut launch, "SCAN_FREENECT_LIB", "/nonexistent/libfreenect.so");
    let opened = ChildSource::open(launch);
    let Err(SourceError::LibraryMissing { library, advice }) = opened else { panic!("{opened:?}") };
    assert_eq!(library, "libfreenect");
    assert!(advice.contains("apt install libfreenect0.5"), "{advice}");
}

#[test]
fn waiting_for_nothing_takes_no_time() {
    let Some(launch) = on_bus("freenect", "", &[("FRAMES", "1")]) else { return };
    let mut source = started(launch);
    frame(&mut source);
    assert!(matches!(source.next_event(Duration::from_millis(50)), Event::Nothing));
}
