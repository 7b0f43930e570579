use std::sync::Arc;

use kinect::source::Frame;
use reconstruct::board::Family;
use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;

use super::*;
use crate::recording::Recording;
use crate::simulate::{Paper, ring};

fn sensor() -> SensorInfo {
    let camera = Intrinsics::pinhole(32, 24, 30.0, 30.0, 15.5, 11.5);
    SensorInfo {
        backend: "test".into(),
        address: "test".into(),
        model: "Test".into(),
        serial: "1".into(),
        rig: Rig { color: camera, depth: camera, color_from_depth: Pose::identity() },
        units_per_metre: 1000.0,
        abilities: vec![],
    }
}

fn board() -> BoardFile {
    BoardFile::Known(ring(Paper::A4, Family::Aruco4x4_50))
}

fn frame(index: u64) -> Frame {
    let color = ColorImage::filled(32, 24, [index as u8, 2, 3]);
    let data = (0..32 * 24).map(|i| 700 + index as u16 + i % 9).collect();
    Frame {
        index,
        color: Arc::new(color),
        depth: Arc::new(DepthImage { width: 32, height: 24, data, units_per_metre: 1000.0 }),
        color_timestamp_nanos: 33 * index,
        depth_timestamp_nanos: 33 * index,
        lost_packets: 0,
        skipped: 0,
        gravity: None,
    }
}

fn take(journal: &mut Journal, frames: u64) {
    let mut view = journal.begin_view(frames as usize).unwrap();
    (0..frames).for_each(|i| view.add(&frame(i)).unwrap());
    journal.confirm(view).unwrap();
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn confirmed_views_are_read_back_bit_by_bit() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("scan");
    let mut journal = Journal::begin(&folder, &sensor(), &board()).unwrap();
    take(&mut journal, 3);
    let recording = Recording::open(&folder).unwrap();
    let view = recording.load_view(0).unwrap();
    assert_eq!(view.depths, [0, 1, 2].map(|i| (*frame(i).depth).clone()));
    assert_eq!(view.color, *frame(1).color);
    assert!(recording.board().is_some());
}

#[test]
fn an_unconfirmed_view_leaves_nothing_and_what_a_crash_left_goes() {
    let home = tempfile::tempdir().unwrap();
    let mut journal = Journal::begin(home.path(), &sensor(), &board()).unwrap();
    take(&mut journal, 1);
    let mut view = journal.begin_view(2).unwrap();
    view.add(&frame(0)).unwrap();
    drop(view);
    assert_eq!(names_in(&home.path().join(VIEWS)), ["000"]);
    // As a kill in the middle of a view and of a description leaves it.
    fs::create_dir(home.path().join("views/001")).unwrap();
    fs::write(home.path().join("views/001/color-000.png"), "half").unwrap();
    fs::write(home.path().join(".recording.json.partial"), "{\"vers").unwrap();
    drop(journal);
    let mut journal = Journal::resume(home.path()).unwrap();
    assert_eq!(names_in(home.path()), ["board.json", "capture.lock", "recording.json", "views"]);
    assert_eq!(names_in(&home.path().join(VIEWS)), ["000"]);
    assert!(journal.fits(&sensor()) && !journal.fits(&SensorInfo { serial: "2".into(), ..sensor() }));
    take(&mut journal, 1);
    assert_eq!(Recording::open(home.path()).unwrap().view_names(), ["000", "001"]);
}

#[test]
fn undoing_takes_name_and_files() {
    let home = tempfile::tempdir().unwrap();
    let mut journal = Journal::begin(home.path(), &sensor(), &board()).unwrap();
    (0..3).for_each(|_| take(&mut journal, 1));
    journal.undo("001").unwrap();
    assert_eq!(names_in(&home.path().join(VIEWS)), ["000", "002"]);
    assert!(matches!(journal.undo("001"), Err(JournalError::NoSuchView(_))));
    take(&mut journal, 1);
    assert_eq!(Recording::open(home.path()).unwrap().view_names(), ["000", "002", "003"]);
}

#[test]
fn recordings_of_other_origin_are_left_alone() {
    let home = tempfile::tempdir().unwrap();
    let mut journal = Journal::begin(home.path(), &sensor(), &board()).unwrap();
    take(&mut journal, 1);
    drop(journal);
    let path = home.path().join(RECORDING);
    let text = fs::read_to_string(&path).unwrap().replace("views/000/", "./views/000/");
    fs::write(&path, text).unwrap();
    assert!(matches!(Journal::resume(home.path()), Err(JournalError::NotOurs(_))));
    assert_eq!(names_in(&home.path().join("views/000")).len(), 2);
}

#[test]
fn a_full_disk_is_said_before_anything_is_written() {
    let home = tempfile::tempdir().unwrap();
    let mut journal = Journal::begin(home.path(), &sensor(), &board()).unwrap();
    journal.measure_free = |_| Ok(RESERVE_BYTES + 100);
    let error = journal.begin_view(10).unwrap_err();
    assert!(error.to_string().contains("nearly full: 64 MB are free"), "{error}");
    assert!(names_in(&home.path().join(VIEWS)).is_empty());
}

#[test]
fn a_folder_belongs_to_one_capture_at_a_time() {
    let home = tempfile::tempdir().unwrap();
    let journal = Journal::begin(home.path(), &sensor(), &board()).unwrap();
    assert!(matches!(Journal::resume(home.path()), Err(JournalError::InUse(_))));
    drop(journal);
    assert!(matches!(Journal::begin(home.path(), &sensor(), &board()), Err(JournalError::NotEmpty(_))));
    assert!(Journal::resume(home.path()).unwrap().file().views.is_empty());
}
