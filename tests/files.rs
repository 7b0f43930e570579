//! Recordings and model files that nobody in this project made.

use scanner::recording::Recording;
use tests::shared;

/// Loads every view and checks what the images hold against what the data's description says.
#[track_caller]
fn check_recording(name: &str, views: usize, frames: usize, has_board: bool) {
    let Some(folder) = shared(name) else { return };
    let recording = Recording::open(&folder).unwrap();
    assert_eq!(recording.view_count(), views);
    assert_eq!(recording.board().is_some(), has_board);
    for i in 0..views {
        let view = recording.load_view(i).unwrap();
        assert_eq!(view.depths.len(), frames, "view {}", view.name);
        assert_eq!((view.color.width, view.color.height), (640, 480));
        let measured = view.depths[0].data.iter().filter(|&&raw| raw != 0).count();
        assert!(measured > 640 * 480 / 4, "view {}: {measured} pixels measured", view.name);
    }
}

#[test]
fn mustard() {
    check_recording("simulated/mustard-8views", 8, 5, true);
}

#[test]
fn stream_without_markers() {
    check_recording("simulated/drill-markerless-stream", 36, 1, false);
}

#[test]
fn juice_cartons() {
    check_recording("juice-cartons", 3, 1, true);
}

#[test]
fn living_room() {
    check_recording("livingroom", 211, 1, false);
}

#[test]
fn redwood() {
    check_recording("redwood", 5, 1, false);
}
