//! Drivers that do what C libraries do: each end of theirs is an event, never the program's.

#![allow(clippy::unwrap_used)]

use std::time::{Duration, Instant};

use kinect::child::{ChildSource, Launch, Overflow, Patience};
use kinect::source::{Control, Event, Source, SourceError};
use kinect_testing::launch;

/// Generous for a busy machine; what is measured is measured apart.
const LONG: Duration = Duration::from_secs(30);

fn misbehaving(how: &str) -> Launch {
    let mut launch = launch("misbehave", how);
    launch.overflow = Overflow::Wait;
    launch.patience =
        Patience { opening: LONG, silence: Duration::from_millis(1200), images: Duration::from_millis(1200) };
    launch
}

/// Starts and takes all ten frames; what comes then.
fn after_the_frames(how: &str) -> (ChildSource, Event) {
    let mut source = ChildSource::open(misbehaving(how)).unwrap();
    source.start().unwrap();
    for index in 0..10 {
        let Event::Frame(frame) = source.next_event(LONG) else { panic!("{how}: no frame {index}") };
        assert_eq!((frame.index, frame.skipped, frame.lost_packets), (index, 0, 0));
        assert_eq!((frame.color.data[0][0], frame.depth.data[0]), (index as u8, index as u16));
        assert_eq!(frame.depth_timestamp_nanos - frame.color_timestamp_nanos, 1_000_000);
    }
    let event = source.next_event(LONG);
    (source, event)
}

#[test]
fn every_sudden_end_becomes_an_event_and_the_sensor_starts_again() {
    let ends = [
        ("abort", "abort"),
        ("exit", "status 3"),
        ("segfault", "crashed"),
        ("panic", "on purpose"),
        ("hang", "hangs"),
        ("starve", "sends no pictures"),
        ("fail", "on purpose"),
        ("chatter", "status 0"),
    ];
    for (how, words) in ends {
        let (mut source, event) = after_the_frames(how);
        let Event::Failed(said) = &event else { panic!("{how}: {event:?}") };
        assert!(said.contains(words), "{how}: {said}");
        assert!(matches!(source.next_event(Duration::from_millis(50)), Event::Nothing), "{how}");
        source.start().unwrap();
        assert!(matches!(source.next_event(LONG), Event::Frame(_)), "{how}");
    }
}

#[test]
fn every_end_before_the_sensor_is_open_is_an_error() {
    for (how, words) in [
        ("abort-at-once", "abort"),
        ("exit-at-once", "status 3"),
        ("segfault-at-once", "crashed"),
        ("panic-at-once", "on purpose"),
    ] {
        let opened = ChildSource::open(misbehaving(how));
        let Err(SourceError::Driver(said)) = opened else { panic!("{how}: {opened:?}") };
        assert!(said.contains(words), "{how}: {said}");
    }
    let mut hanging = misbehaving("hang-at-once");
    hanging.patience.opening = Duration::from_millis(500);
    let opened = ChildSource::open(hanging);
    assert!(matches!(&opened, Err(SourceError::Driver(said)) if said.contains("hangs")), "{opened:?}");
}

#[test]
fn the_end_of_a_recording() {
    let (_source, event) = after_the_frames("end");
    assert!(matches!(event, Event::Ended), "{event:?}");
}

#[test]
fn a_slow_reader_gets_the_newest_frames_and_how_many_it_missed() {
    let mut launch = misbehaving("stream");
    launch.overflow = Overflow::NewestWins;
    let mut source = ChildSource::open(launch).unwrap();
    source.start().unwrap();
    let Event::Frame(first) = source.next_event(LONG) else { panic!("no frame") };
    assert_eq!(first.index, 0);
    let mut sent = u64::from(first.depth.data[0]);
    let mut delivered = 0;
    for _ in 0..20 {
        std::thread::sleep(Duration::from_millis(40));
        let Event::Frame(frame) = source.next_event(LONG) else { panic!("no frame") };
        let now = u64::from(frame.depth.data[0]);
        assert_eq!(now - sent, u64::from(frame.skipped) + 1);
        (sent, delivered) = (now, delivered + 1);
        assert_eq!(frame.index, delivered);
    }
    assert!(sent > 40, "nothing was skipped: {sent}");
}

#[test]
fn orders_are_answered_in_words() {
    let mut source = ChildSource::open(misbehaving("stream")).unwrap();
    let too_early = source.control(Control::Tilt(0.1));
    assert!(
        matches!(&too_early, Err(SourceError::Refused(why)) if why.contains("not been started")),
        "{too_early:?}"
    );
    let mut launch = misbehaving("stream");
    launch.overflow = Overflow::NewestWins;
    let mut source = ChildSource::open(launch).unwrap();
    source.start().unwrap();
    let refused = source.control(Control::Tilt(0.25));
    assert!(matches!(&refused, Err(SourceError::Refused(why)) if why.contains("Tilt(0.25)")), "{refused:?}");
    assert!(matches!(source.control(Control::Still), Err(SourceError::Unable(_))));
    source.stop();
    source.stop();
    assert!(matches!(source.control(Control::Tilt(0.0)), Err(SourceError::Refused(_))));
    assert!(matches!(source.next_event(Duration::ZERO), Event::Nothing));
    source.start().unwrap();
    assert!(matches!(source.next_event(LONG), Event::Frame(_)));
}

/// A driver that never looks whether it is over is ended all the same, and soon.
#[test]
fn stopping_never_takes_long() {
    for (how, most) in [("stubborn", 3000), ("stream", 1000), ("hang", 3000)] {
        let mut launch = misbehaving(how);
        launch.overflow = Overflow::NewestWins;
        let mut source = ChildSource::open(launch).unwrap();
        source.start().unwrap();
        assert!(matches!(source.next_event(LONG), Event::Frame(_)));
        let begun = Instant::now();
        source.stop();
        assert!(begun.elapsed() < Duration::from_millis(most), "{how}: {:?}", begun.elapsed());
    }
}

#[test]
fn a_program_that_is_no_driver() {
    let mut launch = misbehaving("stream");
    launch.program = "/nonexistent/program".into();
    let opened = ChildSource::open(launch);
    assert!(
        matches!(&opened, Err(SourceError::Driver(said)) if said.contains("cannot be started")),
        "{opened:?}"
    );
    let mut launch = misbehaving("stream");
    launch.program = "/bin/true".into();
    let opened = ChildSource::open(launch);
    assert!(matches!(&opened, Err(SourceError::Driver(said)) if said.contains("status 0")), "{opened:?}");
}

#[test]
fn addresses_that_are_none() {
    for address in ["", "kinect", "freenec:1", ":", "/dev/video0"] {
        assert!(matches!(kinect::open(address), Err(SourceError::NotFound(_))), "{address}");
    }
}
