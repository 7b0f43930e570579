//! The simulated Kinect as the rest of the program sees it: tags, files, and a build from memory.

use nalgebra::Point3;
use reconstruct::board::BoardFile;
use reconstruct::image::ColorImage;
use reconstruct::marker::{DetectConfig, Dictionary, detect};
use reconstruct::pose::from_row_major;
use scanner::config::Config;
use scanner::pipeline;
use scanner::recording::Recording;
use scanner::simulate::truth::{Surface, centre, percentile, pose_error, surface_errors};
use scanner::simulate::{Kind, ScanSpec, SimulatedScan, scan, write};
use scanner::ui::Ui;

fn small(product: Kind, seed: u64) -> ScanSpec {
    ScanSpec { views: 3, frames: 2, ..ScanSpec::new(product, seed) }
}

/// Distances in pixels between found and true corners of one view; every id must be one of the board's.
fn corner_errors(scan: &SimulatedScan, view: usize) -> Vec<f32> {
    let board = scan.board.as_ref().expect("this scan has a board");
    let camera_from_world = scan.truth.world_from_camera[view].inverse();
    let mut errors = Vec::new();
    let (gray, dictionary) = (scan.views[view].color.to_gray(), Dictionary::of(board.family));
    for found in detect(&gray, dictionary, Some(&scan.rig.color), &DetectConfig::default()) {
        let tag = board.tags.iter().find(|t| t.id == found.id).expect("only tags of the board are found");
        for (corner, truth) in found.corners.iter().zip(tag.corners_m) {
            let expected = scan.rig.color.project(&(camera_from_world * Point3::from(truth)));
            errors.push((expected.expect("tags lie before the camera") - corner).norm() as f32);
        }
    }
    errors
}

#[test]
fn rendered_tags_are_where_the_truth_says() {
    let scan = scan(&small(Kind::Bowl, 4)).expect("the specification is sound");
    let mut errors: Vec<f32> = (0..3).flat_map(|view| corner_errors(&scan, view)).collect();
    errors.sort_by(f32::total_cmp);
    assert!(errors.len() >= 3 * 12 * 4, "{} corners", errors.len());
    let median = percentile(&errors, 0.5);
    assert!(median < 0.2, "median {median} px");
}

#[test]
fn a_recording_comes_back_as_it_was_even_mirrored() {
    for (mirrored, unregistered) in [(false, true), (true, false)] {
        let spec = ScanSpec { mirrored, unregistered, knock: Some(1), ..small(Kind::Camera, 2) };
        let scan = scan(&spec).expect("the specification is sound");
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let out = folder.path().join("recording");
        write(&scan, &out).expect("the recording can be written");
        let recording = Recording::open(&out).expect("it can be read");
        let rig = recording.rig();
        assert_eq!((rig.color, rig.depth), (scan.rig.color, scan.rig.depth));
        assert!(
            (rig.color_from_depth.inverse() * scan.rig.color_from_depth).translation.vector.norm() < 1e-12
        );
        assert!(rig.color_from_depth.rotation.angle_to(&scan.rig.color_from_depth.rotation) < 1e-7);
        assert_eq!(recording.board(), scan.board.clone().map(BoardFile::Known).as_ref());
        for (index, view) in scan.views.iter().enumerate() {
            assert_eq!(&recording.load_view(index).expect("the view can be read"), view);
        }
        let truth = std::fs::read(out.join("truth/poses.json")).expect("the truth lies beside");
        let truth: serde_json::Value = serde_json::from_slice(&truth).expect("it is JSON");
        assert_eq!(truth["args"]["moved"], 1);
        assert_eq!(truth["views"].as_array().map(Vec::len), Some(3));
    }
}

#[test]
fn a_stream_without_a_board_has_frames_and_no_board_file() {
    let spec = ScanSpec { no_board: true, frames: 1, ..small(Kind::Shoe, 1) };
    let scan = scan(&spec).expect("the specification is sound");
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    write(&scan, folder.path()).expect("the recording can be written");
    let recording = Recording::open(folder.path()).expect("it can be read");
    assert!(recording.is_stream() && recording.board().is_none());
    assert_eq!(recording.view_count(), 3);
    let is_black = |image: &ColorImage| image.data.iter().all(|p| p.iter().all(|&v| v < 20));
    assert!(!is_black(&recording.load_view(2).expect("the view can be read").color));
}

#[test]
fn a_scan_with_a_scale_error_is_built_within_its_limits() {
    let scan = scan(&ScanSpec { scale_error: 0.02, ..ScanSpec::new(Kind::Mug, 11) })
        .expect("the specification is sound");
    let built = pipeline::build(&scan, &Config::default(), &Ui::silent()).expect("views come from memory");
    let centre = centre(&scan.truth.mesh);
    let mut used = 0;
    for (view, truth) in built.report.views.iter().zip(&scan.truth.world_from_camera).filter(|(v, _)| v.used)
    {
        let pose = view.world_from_camera.as_ref().and_then(from_row_major).expect("a used view has a pose");
        assert!(pose_error(truth, &pose, &centre).metres < 0.001);
        used += 1;
    }
    assert_eq!(used, 8);
    let surface = Surface::of(&scan.truth.mesh).expect("the truth has a surface");
    let errors = surface_errors(&surface, &built.model.measured().points);
    assert!(percentile(&errors, 0.5) < 0.0006, "{}", percentile(&errors, 0.5));
}
