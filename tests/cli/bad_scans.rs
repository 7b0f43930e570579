//! Recordings that can be read but were taken badly: exit 1 with a reason, or a model without the views at fault.

use std::fs;

use reconstruct::image::DepthImage;
use scanner::pictures::{decode_depth, encode_depth};
use serde_json::json;

use super::support::{Broken, simulated};

#[test]
fn a_view_without_depth_is_left_out() {
    let broken = Broken::mug();
    change_depth(&broken, &[2, 3], |_| 0);
    broken.leaves_out("001", &["no depth"]);
}

#[test]
fn one_frame_without_depth_is_no_harm() {
    let broken = Broken::mug();
    change_depth(&broken, &[2], |_| 0);
    let ran = broken.build().with_status(0);
    assert!(ran.out.contains("from 4 of 4 views"), "{}", ran.out);
}

#[test]
fn no_depth_in_any_view() {
    let broken = Broken::mug();
    change_depth(&broken, &[0, 1, 2, 3, 4, 5, 6, 7], |_| 0);
    broken.gives_no_scan(&["depth"]);
}

#[test]
fn a_single_pixel_of_depth() {
    let broken = Broken::mug();
    for index in 0..8 {
        let mut data = vec![0; 640 * 480];
        data[320 + 640 * 240] = 800;
        write_depth(&broken, index, data);
    }
    broken.gives_no_scan(&[]);
}

#[test]
fn depth_of_noise_gives_no_model() {
    let broken = Broken::mug();
    let mut state = 1u32;
    change_depth(&broken, &[0, 1, 2, 3, 4, 5, 6, 7], |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        500 + (state >> 16) as u16 % 1000
    });
    broken.gives_no_scan(&[]);
}

/// Depth that is off by far more than any sensor's is written in another unit than it says.
#[test]
fn a_wrong_unit_within_what_a_sensor_measures_is_noticed() {
    for units in [100.0, 200.0, 500.0, 2000.0, 5000.0] {
        let broken = Broken::mug();
        broken.edit_recording(|recording| recording["depth"]["units_per_metre"] = json!(units));
        let ran = broken.build();
        assert!(matches!(ran.status, Some(1 | 2)), "{units}: {ran:?}");
        let said = format!("{}{}", ran.out, ran.err);
        assert!(said.contains("units_per_metre"), "{units}: {said}");
        broken.nothing_half_written();
    }
}

#[test]
fn a_product_outside_of_the_region() {
    let broken = Broken::mug();
    broken.edit("board.json", |board| {
        board["inner_region_m"] = json!([[0.16, 0.08], [0.2, 0.08], [0.2, 0.14], [0.16, 0.14]]);
    });
    broken.gives_no_scan(&["middle of the board"]);
}

#[test]
fn a_board_without_a_product() {
    let broken = Broken::mug();
    let board = [0, 1, 2, 3].map(|view| flat_board(&broken, view));
    for (view, data) in board.into_iter().enumerate() {
        write_depth(&broken, 2 * view, data.clone());
        write_depth(&broken, 2 * view + 1, data);
    }
    broken.gives_no_scan(&["nothing stands"]);
}

#[test]
fn a_knocked_view_is_named() {
    let options = ["--product", "crackerbox", "--views", "6", "--frames", "2", "--knock", "3", "--seed", "2"];
    let broken = Broken::copy_of(&simulated("knocked", &options));
    broken.leaves_out("003", &["knocked", "take this view again"]);
}

#[test]
fn the_same_picture_in_all_views_is_one_view_at_most() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| {
        let first = recording["views"][0]["frames"].clone();
        for view in recording["views"].as_array_mut().unwrap() {
            view["frames"] = first.clone();
        }
    });
    broken.build().with_status(0);
}

#[test]
fn one_view_alone() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| recording["views"].as_array_mut().unwrap().truncate(1));
    let ran = broken.build().with_status(0);
    assert!(ran.out.contains("only 1 view"), "{}", ran.out);
}

#[test]
fn views_of_different_numbers_of_frames() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| {
        recording["views"][0]["frames"].as_array_mut().unwrap().truncate(1);
        let frames = recording["views"][1]["frames"].as_array().unwrap().clone();
        recording["views"][1]["frames"] = json!([frames.clone(), frames.clone(), frames].concat());
    });
    let ran = broken.build().with_status(0);
    assert!(ran.out.contains("from 4 of 4 views"), "{}", ran.out);
}

#[test]
fn frames_of_another_scene_in_one_view_do_no_harm_elsewhere() {
    let broken = Broken::mug();
    broken.edit_recording(|recording| {
        recording["views"][1]["frames"][1]["depth"] = recording["views"][3]["frames"][1]["depth"].clone();
    });
    let ran = broken.build().with_status(0);
    assert!(ran.out.contains("from 4 of 4 views") || ran.err.contains("view 001: "), "{ran:?}");
    assert!(!["000", "002", "003"].iter().any(|v| ran.err.contains(&format!("view {v}: "))), "{}", ran.err);
}

/// Pictures of the smallest size that is read: nothing can be seen in them, and nothing breaks.
#[test]
fn tiny_pictures() {
    let broken = Broken::mug();
    for side in ["color", "depth"] {
        broken.edit_recording(|recording| {
            let camera = recording[side].as_object_mut().unwrap();
            camera.extend([("width".into(), json!(16)), ("height".into(), json!(16))]);
            camera.extend(["fx", "fy"].map(|field| (field.into(), json!(16.0))));
            camera.extend(["cx", "cy"].map(|field| (field.into(), json!(7.5))));
        });
    }
    let color = reconstruct::image::ColorImage::filled(16, 16, [200; 3]);
    for view in 0..4 {
        let bytes = scanner::pictures::encode_color(&color).unwrap();
        fs::write(broken.file(&format!("color/{view:06}.png")), bytes).unwrap();
    }
    for index in 0..8 {
        let depth = DepthImage { width: 16, height: 16, data: vec![800; 256], units_per_metre: 1000.0 };
        fs::write(depth_file(&broken, index), encode_depth(&depth).unwrap()).unwrap();
    }
    broken.gives_no_scan(&["marker"]);
    let ran = super::support::build(&broken.recording(), &broken.out(), &["--no-board"]);
    ran.with_status(1);
}

#[test]
fn without_a_board_bad_depth_gives_no_model_either() {
    let broken = Broken::mug();
    change_depth(&broken, &[0, 1, 2, 3, 4, 5, 6, 7], |_| 800);
    super::support::build(&broken.recording(), &broken.out(), &["--no-board"]).with_status(1);
    broken.nothing_half_written();
}

fn depth_file(broken: &Broken, index: usize) -> std::path::PathBuf {
    broken.file(&format!("depth/{index:06}.png"))
}

fn change_depth(broken: &Broken, indices: &[usize], mut change: impl FnMut(u16) -> u16) {
    for &index in indices {
        let bytes = fs::read(depth_file(broken, index)).unwrap();
        let image = decode_depth(&bytes, 640, 480, 1000.0).unwrap();
        write_depth(broken, index, image.data.into_iter().map(&mut change).collect());
    }
}

fn write_depth(broken: &Broken, index: usize, data: Vec<u16>) {
    let image = DepthImage { width: 640, height: 480, data, units_per_metre: 1000.0 };
    fs::write(depth_file(broken, index), encode_depth(&image).unwrap()).unwrap();
}

/// Depth of the board's plane as the camera of a view sees it, millimetres.
fn flat_board(broken: &Broken, view: usize) -> Vec<u16> {
    let truth = super::support::json(&broken.file("truth/poses.json"));
    let m = |i: usize| truth["views"][view]["world_from_camera"][i].as_f64().unwrap();
    let [x, y, z, height] = [m(8), m(9), m(10), m(11)];
    let depth = |u: f64, v: f64| -height / (x * (u - 319.5) / 525.0 + y * (v - 239.5) / 525.0 + z);
    let metres = (0..640 * 480).map(|i| depth((i % 640) as f64, (i / 640) as f64));
    metres.map(|d| if (0.4..3.0).contains(&d) { (1000.0 * d).round() as u16 } else { 0 }).collect()
}
