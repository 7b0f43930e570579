//! Recordings that can't be read: exit 2, one line that says what to do, and an older result stays.

use std::fs;

use scanner::pictures::{decode_color, decode_depth, encode_color, encode_depth};
use serde_json::{Value, json};

use super::support::{Broken, scan};

#[test]
fn a_missing_picture_is_named() {
    let broken = Broken::mug();
    fs::remove_file(broken.file("depth/000003.png")).unwrap();
    broken.is_refused(&["depth/000003.png is missing", "copy the whole recording again"]);
}

#[test]
fn a_truncated_depth_picture_is_named() {
    check_truncated("depth/000002.png");
}

#[test]
fn a_truncated_colour_picture_is_named() {
    check_truncated("color/000001.png");
}

#[track_caller]
fn check_truncated(name: &str) {
    let broken = Broken::mug();
    let bytes = fs::read(broken.file(name)).unwrap();
    for length in [0, 20, bytes.len() / 2] {
        fs::write(broken.file(name), &bytes[..length]).unwrap();
        broken.is_refused(&[name]);
    }
}

#[test]
fn a_picture_of_another_size_is_named() {
    let broken = Broken::mug();
    let depth = reconstruct::image::DepthImage {
        width: 320,
        height: 240,
        data: vec![800; 320 * 240],
        units_per_metre: 1000.0,
    };
    fs::write(broken.file("depth/000001.png"), encode_depth(&depth).unwrap()).unwrap();
    broken.is_refused(&["depth/000001.png", "320", "240", "640", "480"]);

    let broken = Broken::mug();
    let color = reconstruct::image::ColorImage::filled(16, 16, [90; 3]);
    fs::write(broken.file("color/000000.png"), encode_color(&color).unwrap()).unwrap();
    broken.is_refused(&["color/000000.png", "16", "640"]);
}

#[test]
fn colour_and_depth_swapped_are_noticed() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| {
        for frame in frames(recording) {
            let (color, depth) = (frame["color"].clone(), frame["depth"].clone());
            *frame = json!({"color": depth, "depth": color, "timestamp_nanos": 0});
        }
    });
    broken.is_refused(&["cannot be used", "16"]);
}

#[test]
fn missing_intrinsics_are_named() {
    for (camera, field) in
        [("color", "fx"), ("depth", "cy"), ("depth", "units_per_metre"), ("color", "width")]
    {
        let broken = Broken::mug();
        broken.edit_recording(|recording| {
            recording[camera].as_object_mut().unwrap().remove(field).unwrap();
        });
        broken.is_refused(&[&format!("{camera}.{field}"), "write"]);
    }
}

#[test]
fn intrinsics_that_are_no_cameras_are_named() {
    let values = [
        ("fx", json!(0.0)),
        ("fy", json!(-525)),
        ("cx", json!(1e9)),
        ("fx", json!("525")),
        ("width", json!(0)),
    ];
    for (field, value) in values {
        let broken = Broken::mug();
        broken.edit_recording(|recording| recording["depth"][field] = value);
        broken.is_refused(&[&format!("depth.{field}")]);
    }
}

#[test]
fn sizes_that_would_fill_the_memory_are_refused() {
    for side in [json!(100_000), json!(4_294_967_295u64), json!(1e300), json!(-4)] {
        let broken = Broken::mug();
        broken.edit_recording(|recording| recording["color"]["width"] = side);
        broken.is_refused(&["recording.json"]);
    }
}

#[test]
fn a_unit_that_makes_giants_or_dwarfs_is_refused() {
    for units in [0.0, -1000.0, 1.0, 30.0, 100_000.0, 1e9] {
        let broken = Broken::mug();
        broken.edit_recording(|recording| recording["depth"]["units_per_metre"] = json!(units));
        broken.is_refused(&["units_per_metre", "1000"]);
    }
}

#[test]
fn colour_and_depth_of_different_lengths() {
    for missing in ["color", "depth"] {
        let broken = Broken::mug();
        broken.edit_recording(|recording| {
            recording["views"][2]["frames"][1].as_object_mut().unwrap().remove(missing).unwrap();
        });
        broken.is_refused(&[&format!("views[2].frames[1].{missing}"), "remove the frame"]);
    }
}

#[test]
fn paths_stay_inside_the_folder() {
    for path in ["../outside.png", "/etc/hostname", "color/../../outside.png", ""] {
        let broken = Broken::mug();
        fs::copy(broken.file("color/000000.png"), broken.home.path().join("outside.png")).unwrap();
        broken.edit_recording(|recording| recording["views"][0]["frames"][0]["color"] = json!(path));
        broken.is_refused(&["leaves the recording's folder"]);
    }
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_outside_either() {
    let broken = Broken::mug();
    let outside = broken.home.path().join("outside.png");
    fs::rename(broken.file("color/000000.png"), &outside).unwrap();
    std::os::unix::fs::symlink(&outside, broken.file("color/000000.png")).unwrap();
    broken.is_refused(&["leaves the recording's folder"]);
}

#[test]
fn a_folder_instead_of_a_picture() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| recording["views"][0]["frames"][0]["depth"] = json!("depth"));
    broken.is_refused(&["depth is not a file"]);
}

#[test]
fn descriptions_that_are_none() {
    let deep = vec![b'['; 100_000];
    let texts: [&[u8]; 8] = [
        b"",
        b"{",
        b"[]",
        b"null",
        b"\xff\xfe",
        br#"{"version": 1}"#,
        br#"{"version": 2, "views": []}"#,
        &deep,
    ];
    for text in texts {
        let broken = Broken::mug();
        fs::write(broken.file("recording.json"), text).unwrap();
        broken.is_refused(&["recording.json"]);
    }
}

#[test]
fn no_views_and_no_frames() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| recording["views"] = json!([]));
    broken.is_refused(&["no views", "record at least one"]);

    let broken = Broken::mug();
    broken.edit_recording(|recording| recording["views"][1]["frames"] = json!([]));
    broken.is_refused(&["\"001\"", "no frames"]);
}

#[test]
fn a_transform_that_is_not_rigid() {
    for matrix in [json!([1, 2, 3]), json!(vec![0.0; 16]), json!(vec![1.0; 16])] {
        let broken = Broken::mug();
        broken.edit_recording(|recording| recording["color_from_depth"] = matrix);
        broken.is_refused(&["recording.json"]);
    }
}

#[test]
fn no_recording_at_all() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let out = out.to_str().unwrap();
    let nowhere = home.path().join("nowhere");
    let ran = scan(["build", nowhere.to_str().unwrap(), "--out", out]).with_status(2);
    assert!(ran.err.contains("name the folder that holds recording.json"), "{}", ran.err);
    let ran = scan(["build", home.path().to_str().unwrap(), "--out", out]).with_status(2);
    assert!(ran.err.contains("recording.json is missing"), "{}", ran.err);
    assert_eq!(ran.err.lines().count(), 1, "{}", ran.err);
    assert_eq!(super::support::names(home.path()), [""; 0]);
}

#[test]
fn the_simulated_pictures_are_what_the_tests_take_them_for() {
    let mug = super::support::mug();
    let color = fs::read(mug.join("color/000000.png")).unwrap();
    assert!(decode_color(&color, 640, 480).is_ok());
    let depth = fs::read(mug.join("depth/000000.png")).unwrap();
    assert!(decode_depth(&depth, 640, 480, 1000.0).is_ok());
}

fn frames(recording: &mut Value) -> impl Iterator<Item = &mut Value> {
    let views = recording["views"].as_array_mut().unwrap().iter_mut();
    views.flat_map(|view| view["frames"].as_array_mut().unwrap())
}
