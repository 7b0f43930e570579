use super::*;
use std::collections::VecDeque;
use std::sync::Arc;

use kinect::source::{Control, SensorInfo, SourceError};
use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose::Pose;

use crate::recording::Recording;

const FRAME: u64 = 33_333_333;

/// A sensor that says what it is told to.
struct Told {
    info: SensorInfo,
    events: VecDeque<Event>,
}

impl Told {
    fn new(events: impl IntoIterator<Item = Event>) -> Self {
        let camera = Intrinsics::pinhole(64, 48, 60.0, 60.0, 31.5, 23.5);
        let info = SensorInfo {
            backend: "freenect".to_owned(),
            address: "freenect:A1".to_owned(),
            model: "Told".to_owned(),
            serial: "A1".to_owned(),
            rig: Rig { color: camera, depth: camera, color_from_depth: Pose::identity() },
            units_per_metre: 1000.0,
            abilities: Vec::new(),
        };
        Self { info, events: events.into_iter().collect() }
    }
}

impl Source for Told {
    fn sensor(&self) -> &SensorInfo {
        &self.info
    }

    fn start(&mut self) -> Result<(), SourceError> {
        Ok(())
    }

    fn next_event(&mut self, _patience: Duration) -> Event {
        self.events.pop_front().unwrap_or(Event::Ended)
    }

    fn control(&mut self, _control: Control) -> Result<(), SourceError> {
        Err(SourceError::Unable("told"))
    }

    fn stop(&mut self) {}
}

fn frame(i: u64) -> Frame {
    let pixels = |p: usize| (p as u64 * 7 + i * 131) as u16;
    let data: Vec<u16> = (0..64 * 48).map(pixels).collect();
    let color = data.iter().map(|v| [*v as u8, (v >> 3) as u8, i as u8]).collect();
    Frame {
        index: i,
        color: Arc::new(ColorImage { width: 64, height: 48, data: color }),
        depth: Arc::new(DepthImage { width: 64, height: 48, data, units_per_metre: 1000.0 }),
        color_timestamp_nanos: 7_000_000_000 + i * FRAME,
        depth_timestamp_nanos: 7_000_000_000 + i * FRAME,
        lost_packets: 0,
        skipped: 0,
        gravity: None,
    }
}

fn frames(count: u64) -> impl Iterator<Item = Event> {
    (0..count).map(|i| Event::Frame(Arc::new(frame(i))))
}

/// Records; the plan can wait, so that nothing depends on how fast this computer is.
fn recorded(
    source: &mut Told,
    change: impl FnOnce(&mut Plan),
) -> (tempfile::TempDir, Result<Recorded, RecordError>) {
    let home = tempfile::tempdir().unwrap();
    let mut plan = Plan::of(source, &home.path().join("rec"));
    plan.may_drop = false;
    change(&mut plan);
    let recorded = record(source, &plan, &AtomicBool::new(false), |_| ());
    (home, recorded)
}

#[test]
fn every_frame_is_kept_as_it_came() {
    let (home, recorded) = recorded(&mut Told::new(frames(40)), |_| ());
    let recorded = recorded.unwrap();
    assert_eq!((recorded.frames, recorded.dropped, &recorded.end), (40, 0, &End::SourceEnded));
    assert_eq!(recorded.missing, 0);
    assert_eq!(recorded.length, Duration::from_nanos(39 * FRAME));
    let recording = Recording::open(&home.path().join("rec")).unwrap();
    assert!(recording.is_stream());
    assert_eq!(recording.file().device, Device { backend: "freenect".to_owned(), serial: "A1".to_owned() });
    for (i, entry) in recording.file().frames.iter().enumerate() {
        let frame = frame(i as u64);
        assert_eq!(recording.load_color(&entry.color).unwrap(), *frame.color);
        assert_eq!(recording.load_depth(&entry.depth).unwrap(), *frame.depth);
        assert_eq!(entry.timestamp_nanos, frame.color_timestamp_nanos);
    }
    let on_disk = |folder: &str| {
        let files = std::fs::read_dir(home.path().join("rec").join(folder)).unwrap();
        files.map(|file| file.unwrap().metadata().unwrap().len()).sum::<u64>()
    };
    assert_eq!(recorded.bytes, on_disk("color") + on_disk("depth"));
}

#[test]
fn it_ends_when_the_time_is_up() {
    let (_home, recorded) =
        recorded(&mut Told::new(frames(100)), |plan| plan.most = Some(Duration::from_secs(1)));
    let recorded = recorded.unwrap();
    assert_eq!((recorded.frames, recorded.end), (31, End::TimeIsUp));
}

#[test]
fn every_so_many() {
    let (_home, recorded) = recorded(&mut Told::new(frames(10)), |plan| plan.every = 4);
    assert_eq!(recorded.unwrap().frames, 3);
}

#[test]
fn what_was_lost_is_counted() {
    let mut late = frame(3);
    (late.skipped, late.lost_packets) = (2, 5);
    let mut other = frame(4);
    other.color = Arc::new(ColorImage::filled(32, 24, [0; 3]));
    let events = frames(3).chain([late, other].map(|frame| Event::Frame(Arc::new(frame))));
    let (_home, recorded) = recorded(&mut Told::new(events), |_| ());
    let recorded = recorded.unwrap();
    assert_eq!((recorded.frames, recorded.dropped, recorded.lost_packets), (4, 3, 5));
}

#[test]
fn what_came_before_the_plug_was_pulled_is_kept() {
    for (last, end) in [
        (Event::Unplugged, End::Unplugged),
        (Event::Failed("it crashed".to_owned()), End::Failed("it crashed".to_owned())),
    ] {
        let (home, recorded) = recorded(&mut Told::new(frames(5).chain([last])), |_| ());
        let recorded = recorded.unwrap();
        assert_eq!((recorded.frames, recorded.end.is_as_wished(), recorded.end), (5, false, end));
        assert_eq!(Recording::open(&home.path().join("rec")).unwrap().view_count(), 5);
    }
}

#[test]
fn nothing_recorded_leaves_nothing() {
    for (last, words) in [(Event::Unplugged, "unplugged"), (Event::Ended, "no pair")] {
        let (home, recorded) = recorded(&mut Told::new([last]), |_| ());
        assert!(matches!(&recorded, Err(RecordError::NoFrames(why)) if why.contains(words)), "{recorded:?}");
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    }
}

#[test]
fn the_disk_is_not_filled_up() {
    let (home, recorded) = recorded(&mut Told::new(frames(5)), |plan| {
        plan.free_bytes = |_| Ok(100 << 20);
    });
    let error = recorded.unwrap_err();
    assert!(matches!(error, RecordError::NoSpace { free_megabytes: 100, .. }), "{error}");
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    // Enough before it begins, too little from the moment the folder is there.
    let (home, recorded) = self::recorded(&mut Told::new(frames(5)), |plan| {
        plan.free_bytes = |out| {
            let has_begun = std::fs::read_dir(out.parent().unwrap())?.next().is_some();
            Ok(if has_begun { 100 << 20 } else { 10 << 30 })
        };
    });
    assert!(matches!(recorded, Err(RecordError::NoFrames(_))), "{recorded:?}");
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
}

#[test]
fn stopping_keeps_what_there_is() {
    let home = tempfile::tempdir().unwrap();
    let mut source = Told::new(frames(50));
    let mut plan = Plan::of(&source, &home.path().join("rec"));
    plan.may_drop = false;
    let stop = AtomicBool::new(false);
    let recorded = record(&mut source, &plan, &stop, |passed| {
        if passed.as_nanos() as u64 >= 9 * FRAME {
            stop.store(true, Ordering::SeqCst);
        }
    });
    let recorded = recorded.unwrap();
    assert_eq!((recorded.frames, recorded.end), (10, End::Stopped));
}

#[test]
fn gaps_in_time_are_missing_frames() {
    let events = (0..20).filter(|i| ![4, 9, 10, 11].contains(i)).map(|i| Event::Frame(Arc::new(frame(i))));
    let (_home, recorded) = recorded(&mut Told::new(events), |_| ());
    let recorded = recorded.unwrap();
    assert_eq!((recorded.frames, recorded.missing, recorded.dropped), (16, 4, 0));
}

#[test]
fn a_part_that_is_of_no_use_is_not_kept() {
    let (home, recorded) = recorded(&mut Told::new(frames(5).chain([Event::Unplugged])), |plan| {
        plan.keeps_part = false;
    });
    assert!(matches!(recorded, Err(RecordError::Part(_))), "{recorded:?}");
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
}
