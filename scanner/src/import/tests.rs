//! Folders as other programs lay them out, made here, and broken ones.

use reconstruct::image::{ColorImage, DepthImage};

use super::*;
use crate::recording::Recording;

const WIDTH: usize = 40;
const HEIGHT: usize = 30;
const CAMERA: [f64; 4] = [35.0, 35.0, 19.5, 14.5];

fn color() -> Vec<u8> {
    pictures::encode_color(&ColorImage::filled(WIDTH, HEIGHT, [9, 99, 200])).unwrap()
}

fn depth(raw: u16) -> Vec<u8> {
    let mut data = vec![raw; WIDTH * HEIGHT];
    data[0] = u16::MAX;
    pictures::encode_depth(&DepthImage { width: WIDTH, height: HEIGHT, data, units_per_metre: 1.0 }).unwrap()
}

/// Files by name and content, in a folder of their own.
fn folder(files: &[(&str, Vec<u8>)]) -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = home.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    home
}

fn options() -> Options {
    Options { color_camera: Some(CAMERA), every: 1, ..Options::default() }
}

#[track_caller]
fn imported(
    kind: Kind,
    files: &[(&str, Vec<u8>)],
    options: &Options,
) -> (Recording, Written, tempfile::TempDir) {
    let home = folder(files);
    assert_eq!(detect(home.path()), Some(kind));
    let out = tempfile::tempdir().unwrap();
    let source = read(kind, home.path()).unwrap();
    let written = write(&source, options, out.path(), || ()).unwrap();
    (Recording::open(out.path()).unwrap(), written, out)
}

fn tum() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("rgb.txt", b"# color images\n1.00 rgb/a.png\n1.04 rgb/b.png\n1.50 rgb/c.png\n".to_vec()),
        ("depth.txt", b"# depth maps\n1.045 depth/y.png\n1.001 depth/x.png\n".to_vec()),
        ("groundtruth.txt", b"# t x y z qx qy qz qw\n1.002 1 2 3 0 0 0 1\n".to_vec()),
        ("rgb/a.png", color()),
        ("rgb/b.png", color()),
        ("rgb/c.png", color()),
        ("depth/x.png", depth(5000)),
        ("depth/y.png", depth(6000)),
    ]
}

#[test]
fn tum_pictures_are_paired_by_time() {
    let (recording, written, out) = imported(Kind::Tum, &tum(), &options());
    assert_eq!(written, Written { frames: 2, poses: 1 });
    assert!(recording.is_stream());
    let view = recording.load_view(1).unwrap();
    assert_eq!(view.depths[0].metres(5, 5), Some(1.2));
    let poses: serde_json::Value =
        serde_json::from_slice(&fs::read(out.path().join("poses.json")).unwrap()).unwrap();
    assert_eq!(poses["views"][0]["world_from_camera"][7], 2.0);
}

#[test]
fn bop_scenes() {
    let camera = serde_json::json!({
        "cam_K": [35.0, 0, 19.5, 0, 35.0, 14.5, 0, 0, 1], "depth_scale": 0.5,
        "cam_R_w2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_w2c": [0, 0, 1000.0]
    });
    let cameras = serde_json::json!({"0": camera, "7": camera});
    let files = [
        ("scene_camera.json", cameras.to_string().into_bytes()),
        ("rgb/000000.png", color()),
        ("rgb/000007.png", color()),
        ("depth/000000.png", depth(2000)),
        ("depth/000007.png", depth(2200)),
    ];
    let (recording, written, _out) = imported(Kind::Bop, &files, &Options::default());
    assert_eq!(written, Written { frames: 2, poses: 2 });
    assert_eq!(recording.view_names(), ["000", "007"]);
    assert_eq!(recording.load_view(1).unwrap().depths[0].metres(5, 5), Some(1.1));
    assert_eq!(recording.rig().color.fx, 35.0);
}

#[test]
fn seven_scenes_frames_without_their_mark_of_nothing() {
    let files = [
        ("frame-000000.color.png", color()),
        ("frame-000000.depth.png", depth(900)),
        ("frame-000000.pose.txt", b"1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n".to_vec()),
    ];
    let (recording, written, _out) = imported(Kind::SevenScenes, &files, &options());
    assert_eq!(written, Written { frames: 1, poses: 1 });
    let view = recording.load_view(0).unwrap();
    assert_eq!((view.depths[0].data[0], view.depths[0].data[1]), (0, 900));
}

#[test]
fn pairs_with_cameras_of_the_command_line() {
    let files = [("box_rgb.png", color()), ("box_depth.png", depth(900)), ("notes.txt", Vec::new())];
    let shifted = Options {
        depth_camera: Some([36.0, 36.0, 20.0, 15.0]),
        color_from_depth: Some(Pose::translation(0.02, 0.0, 0.0)),
        mirrored: true,
        ..options()
    };
    let (recording, _, _out) = imported(Kind::Pairs, &files, &shifted);
    assert_eq!(recording.rig().depth.fx, 36.0);
    assert_eq!(recording.rig().color_from_depth.translation.x, 0.02);
    assert_eq!(recording.view_names(), ["box"]);
    assert_eq!(recording.load_view(0).unwrap().depths[0].data[WIDTH - 1], u16::MAX);
}

#[track_caller]
fn check_refused(kind: Kind, files: &[(&str, Vec<u8>)], options: &Options, expected: &str) {
    let home = folder(files);
    let out = tempfile::tempdir().unwrap();
    let target = out.path().join("rec");
    let result = read(kind, home.path()).and_then(|source| write(&source, options, &target, || ()));
    let message = result.unwrap_err().to_string();
    assert!(message.contains(expected) && message.contains(';'), "{message}");
    assert_eq!(fs::read_dir(out.path()).unwrap().count(), 0, "nothing half-written stays");
}

#[test]
fn broken_sources_are_refused_with_a_reason() {
    let replaced = |name: &str, content: &[u8]| {
        let mut files = tum();
        files.iter_mut().filter(|(n, _)| *n == name).for_each(|file| file.1 = content.to_vec());
        files
    };
    let check = |name: &str, content: &[u8], expected: &str| {
        check_refused(Kind::Tum, &replaced(name, content), &options(), expected);
    };
    check("rgb.txt", b"one rgb/a.png\n", "rgb.txt, line 1");
    check("depth.txt", b"1.0 ../../secret.png\n", "leaves the folder");
    check("depth.txt", b"9.0 depth/x.png\n", "no pair of colour and depth");
    check("groundtruth.txt", b"1.0 2 3\n", "groundtruth.txt, line 1");
    check("depth/y.png", &color(), "16-bit grey PNG");
    check("depth/y.png", &depth(1000)[..60], "cut off");
    let wide = pictures::encode_color(&ColorImage::filled(50, 20, [0; 3])).unwrap();
    check("rgb/b.png", &wide, "50x20 pixels");
    let pairs = [("a_rgb.png", color()), ("b_rgb.png", color()), ("a_depth.png", depth(900))];
    check_refused(Kind::Pairs, &pairs, &options(), "2 colour and 1 depth");
    let pair = [("a_rgb.png", color()), ("a_depth.png", depth(900))];
    check_refused(Kind::Pairs, &pair, &Options::default(), "--color-camera");
    let negative = Options { color_camera: Some([-1.0, 35.0, 20.0, 15.0]), ..options() };
    check_refused(Kind::Pairs, &pair, &negative, "color.fx is -1");
    let unit = Options { units_per_metre: Some(1.0), ..options() };
    check_refused(Kind::Pairs, &pair, &unit, "units_per_metre is 1");
    let seven = [("frame-000000.color.png", color())];
    check_refused(Kind::SevenScenes, &seven, &options(), "1 colour and 0 depth");
    check_refused(
        Kind::Bop,
        &[("scene_camera.json", b"{\"x\": 3}".to_vec())],
        &options(),
        "scene_camera.json",
    );
}

#[test]
fn times_are_associated_once() {
    let others = [(1.0, 'a'), (1.01, 'b'), (2.0, 'c')];
    assert_eq!(tum::associate(&[1.0, 1.001, 1.5, 2.019], &others), [Some(0), Some(1), None, Some(2)]);
}

#[test]
fn trajectories_of_five_lines_a_frame() {
    let text = "4 4 5\n1 0 0 0.25\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let poses = trajectory::parse_log(text).unwrap();
    assert_eq!((poses[0].0, poses[0].1.translation.x), (4, 0.25));
    assert!(trajectory::parse_log("4 4 5\n2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").is_err());
    assert!(trajectory::parse_log("4 4 5\n1 0 0 0\n").is_err());
}
