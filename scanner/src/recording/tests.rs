//! Recordings: what comes back, and every bad input with its one clear sentence.

use std::path::Path;

use reconstruct::board::{BoardFile, Family, KnownBoard, Tag};
use reconstruct::camera::Intrinsics;
use reconstruct::pose::Pose;
use reconstruct::recording::Device;
use serde_json::{Value, json};

use super::*;

const WIDTH: usize = 32;
const HEIGHT: usize = 24;

fn rig() -> Rig {
    let camera = Intrinsics::pinhole(WIDTH as u32, HEIGHT as u32, 30.0, 30.0, 15.5, 11.5);
    Rig { color: camera, depth: camera, color_from_depth: Pose::identity() }
}

fn view(name: &str) -> ViewImages {
    let pixels = 0..WIDTH * HEIGHT;
    let color = pixels.clone().map(|i| [i as u8, (i / 3) as u8, 7]).collect();
    let depth = |offset: usize| DepthImage {
        width: WIDTH,
        height: HEIGHT,
        data: pixels.clone().map(|i| (800 + i % 50 + offset) as u16).collect(),
        units_per_metre: 1000.0,
    };
    ViewImages {
        name: name.to_owned(),
        color: ColorImage { width: WIDTH, height: HEIGHT, data: color },
        depths: vec![depth(0), depth(1)],
    }
}

fn board() -> KnownBoard {
    let corners_m = [[0.0, 0.05, 0.0], [0.05, 0.05, 0.0], [0.05, 0.0, 0.0], [0.0, 0.0, 0.0]];
    KnownBoard {
        version: 1,
        family: Family::Aruco4x4_50,
        tags: vec![Tag { id: 3, corners_m }],
        inner_region_m: vec![[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]],
    }
}

fn write(folder: &Path) {
    let device = Device { backend: "simulated".to_owned(), serial: String::new() };
    let mut writer = RecordingWriter::begin(folder, &rig(), 1000.0, device).unwrap();
    writer.write_board(&BoardFile::Known(board())).unwrap();
    writer.add_view(&view("000"), &[0, 33]).unwrap();
    writer.add_view(&view("001"), &[66, 99]).unwrap();
    writer.finish().unwrap();
}

/// The error of opening and loading a recording whose `recording.json` was changed.
fn complaint(change: impl FnOnce(&mut Value)) -> String {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let path = folder.path().join("recording.json");
    let mut value: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut value);
    fs::write(&path, value.to_string()).unwrap();
    complaint_of(folder.path())
}

fn complaint_of(folder: &Path) -> String {
    let loaded = Recording::open(folder).and_then(|recording| recording.load_view(0).map(|_| ()));
    let text = loaded.expect_err("a bad recording").to_string();
    assert!(text.contains(';') && !text.contains('\n'), "what is wrong; what to do: {text}");
    text
}

#[track_caller]
fn check(change: impl FnOnce(&mut Value), expected: &str) {
    let text = complaint(change);
    assert!(text.contains(expected), "{text}");
}

#[test]
fn a_recording_comes_back_as_written() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let recording = Recording::open(folder.path()).unwrap();
    assert_eq!(recording.view_names(), ["000", "001"]);
    assert_eq!(recording.rig(), rig());
    assert_eq!(recording.board(), Some(&BoardFile::Known(board())));
    assert_eq!(recording.load_view(1).unwrap(), view("001"));
    assert!(Recording::open(&folder.path().join("recording.json")).is_ok());
}

#[test]
fn mirrored_images_are_flipped() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device { backend: "import".to_owned(), serial: String::new() };
    let mut writer = RecordingWriter::begin(folder.path(), &rig(), 1000.0, device).unwrap();
    writer.set_mirrored(true);
    writer.add_view(&view("000"), &[]).unwrap();
    writer.finish().unwrap();
    let loaded = Recording::open(folder.path()).unwrap().load_view(0).unwrap();
    assert_eq!(loaded.color, view("000").color.mirrored());
    assert_eq!(loaded.depths[1], view("000").depths[1].clone().mirrored());
}

#[test]
fn an_unfinished_recording_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device { backend: "simulated".to_owned(), serial: String::new() };
    let mut writer = RecordingWriter::begin(&folder.path().join("rec"), &rig(), 1000.0, device).unwrap();
    writer.add_view(&view("000"), &[]).unwrap();
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn missing_values_are_named() {
    check(|v| drop(v["color"].as_object_mut().unwrap().remove("fx")), "recording.json has no color.fx");
    check(|v| drop(v.as_object_mut().unwrap().remove("depth")), "recording.json has no depth.width");
    check(|v| v["depth"]["units_per_metre"] = Value::Null, "no depth.units_per_metre");
    check(|v| drop(v.as_object_mut().unwrap().remove("color_from_depth")), "color_from_depth");
    check(|v| drop(v.as_object_mut().unwrap().remove("version")), "no version");
}

#[test]
fn values_of_no_camera_are_refused() {
    check(|v| v["color"]["fx"] = json!(-525.0), "color.fx is -525");
    check(|v| v["depth"]["fy"] = json!(0), "depth.fy is 0");
    check(|v| v["depth"]["cx"] = json!(1e9), "depth.cx is 1000000000");
    check(|v| v["color"]["width"] = json!(4_000_000_000u32), "color.width is 4000000000");
    check(|v| v["color"]["fx"] = json!("wide"), "color.fx is \"wide\"");
    check(|v| v["color"]["distortion"] = json!([0, 0, 0, 0, 1e30]), "color.distortion");
    check(|v| v["color_from_depth"][0] = json!(2.0), "not a rigid transform");
    check(|v| v["version"] = json!(2), "version 2");
}

#[test]
fn a_wrong_unit_is_refused_and_the_likely_one_named() {
    check(|v| v["depth"]["units_per_metre"] = json!(1.0), "write 1000");
    check(|v| v["depth"]["units_per_metre"] = json!(100.0), "units_per_metre in recording.json to 1000");
    check(|v| v["depth"]["units_per_metre"] = json!(-1000.0), "units_per_metre is -1000");
    check(|v| v["depth"]["units_per_metre"] = json!(50_000.0), "to 1000 if");
}

#[test]
fn paths_stay_inside() {
    for path in ["../secret.png", "/etc/passwd", "color/../../x.png", ""] {
        check(|v| v["views"][1]["frames"][0]["depth"] = json!(path), "leaves the recording's folder");
    }
}

#[test]
#[cfg(unix)]
fn a_link_out_of_the_folder_is_refused() {
    let outside = tempfile::NamedTempFile::new().unwrap();
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let depth = folder.path().join("depth/000000.png");
    fs::remove_file(&depth).unwrap();
    std::os::unix::fs::symlink(outside.path(), &depth).unwrap();
    assert!(complaint_of(folder.path()).contains("leaves the recording's folder"));
}

#[test]
fn lists_that_do_not_fit_are_refused() {
    check(|v| v["views"] = json!([]), "no views");
    check(|v| v["frames"] = v["views"][0]["frames"].clone(), "both views and frames");
    check(|v| v["views"][0]["frames"] = json!([]), "lists no frames");
    check(|v| v["views"][0]["name"] = json!("001"), "two views are named \"001\"");
    check(
        |v| drop(v["views"][1]["frames"][1].as_object_mut().unwrap().remove("depth")),
        "no views[1].frames[1].depth",
    );
}

#[test]
fn bad_images_are_named() {
    let check = |name: &str, change: &dyn Fn(&Path), expected: &str| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path());
        change(&folder.path().join(name));
        let text = complaint_of(folder.path());
        assert!(text.contains(name) && text.contains(expected), "{text}");
    };
    check("depth/000001.png", &|path| fs::remove_file(path).unwrap(), "is missing");
    let cut = |path: &Path| {
        let bytes = fs::read(path).unwrap();
        fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
    };
    check("depth/000000.png", &cut, "cut off");
    check("color/000000.png", &cut, "cut off");
    let small = |path: &Path| {
        let image = DepthImage { width: 20, height: 20, data: vec![900; 400], units_per_metre: 1000.0 };
        fs::write(path, pictures::encode_depth(&image).unwrap()).unwrap();
    };
    check("depth/000001.png", &small, "20x20 pixels where 32x24 are announced");
    let colored = |path: &Path| fs::write(path, pictures::encode_color(&view("x").color).unwrap()).unwrap();
    check("depth/000001.png", &colored, "16-bit grey PNG");
    check("color/000000.png", &|path| fs::write(path, "text").unwrap(), "neither a PNG nor a JPEG");
    let folder = |path: &Path| {
        fs::remove_file(path).unwrap();
        fs::create_dir(path).unwrap();
    };
    check("color/000000.png", &folder, "not a file");
}

#[test]
fn depth_of_zeros_is_named_and_concerns_its_view_alone() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let zeros =
        DepthImage { width: WIDTH, height: HEIGHT, data: vec![0; WIDTH * HEIGHT], units_per_metre: 1000.0 };
    for name in ["depth/000000.png", "depth/000001.png"] {
        fs::write(folder.path().join(name), pictures::encode_depth(&zeros).unwrap()).unwrap();
    }
    assert!(complaint_of(folder.path()).contains("view \"000\" is zero everywhere"));
    let recording = Recording::open(folder.path()).unwrap();
    assert!(recording.load_view(0).unwrap_err().concerns_one_view());
    assert!(recording.load_view(1).is_ok());
    assert!(matches!(recording.load_view(2), Err(RecordingError::NoSuchView(2))));
}

#[test]
fn a_folder_without_a_recording_is_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(complaint_of(folder.path()).contains("recording.json is missing"));
    assert!(complaint_of(&folder.path().join("nowhere")).contains("cannot open the recording"));
}

#[track_caller]
fn check_board(change: impl FnOnce(&mut Value), expected: &str) {
    let mut value = serde_json::to_value(BoardFile::Known(board())).unwrap();
    change(&mut value);
    let text = parse_board(value.to_string().as_bytes()).expect_err("a bad board").to_string();
    assert!(text.contains(expected) && text.contains(';'), "{text}");
}

#[test]
fn bad_boards_are_refused() {
    check_board(|v| v["tags"] = json!([v["tags"][0], v["tags"][0]]), "tag 3 is on the board twice");
    check_board(|v| v["tags"] = json!([]), "no tag on the board");
    check_board(|v| v["tags"][0]["corners_m"][0] = json!([0.2, 0.05, 0.0]), "tag 3 form no square");
    check_board(|v| v["family"] = json!("tag25h9"), "\"tag25h9\" is not known");
    check_board(|v| v["inner_region_m"] = json!([[0, 0], [1, 1], [2, 2]]), "no area");
    check_board(|v| drop(v.as_object_mut().unwrap().remove("tags")), "tags");
    check_board(|v| v["version"] = json!(7), "version 7");
}

#[test]
fn loose_sheets_are_read_and_checked() {
    let sheets = json!({
        "version": 1, "family": "aruco_original", "tag_size_m": 0.096, "layout": "unknown", "ids": [3, 4, 30]
    });
    assert!(matches!(parse_board(sheets.to_string().as_bytes()), Ok(BoardFile::Loose(_))));
    let mut twice = sheets.clone();
    twice["ids"] = json!([3, 3]);
    assert!(parse_board(twice.to_string().as_bytes()).unwrap_err().to_string().contains("tag 3"));
    let mut huge = sheets;
    huge["tag_size_m"] = json!(96.0);
    assert!(parse_board(huge.to_string().as_bytes()).unwrap_err().to_string().contains("tag_size_m is 96"));
}
