//! Boards that are wrong, missing or not to be seen.

use std::fs;

use scanner::pictures::{decode_color, encode_color};
use serde_json::{Value, json};

use super::support::{Broken, simulated};

#[test]
fn the_same_id_twice() {
    let broken = Broken::mug();
    broken.edit("board.json", |board| board["tags"][3]["id"] = board["tags"][5]["id"].clone());
    broken.is_refused(&["board.json", "is on the board twice", "print the board again"]);
}

/// A word of the message, and what is done to the board.
type Change = (&'static str, fn(&mut Value));

#[test]
fn boards_that_are_none() {
    let changes: [Change; 7] = [
        ("family", |board| board["family"] = json!("qr")),
        ("no tag", |board| board["tags"] = json!([])),
        ("square", |board| board["tags"][0]["corners_m"][2] = json!([0.5, 0.5, 0.0])),
        ("version", |board| board["version"] = json!(7)),
        ("inner_region_m", |board| board["inner_region_m"] = json!([[0.0, 0.0]])),
        ("layout", |board| board["layout"] = json!("known")),
        ("board.json", |board| *board = json!("a3")),
    ];
    for (word, change) in changes {
        let broken = Broken::mug();
        broken.edit("board.json", change);
        broken.is_refused(&["board.json", word]);
    }
}

#[test]
fn ids_that_the_family_does_not_have() {
    let broken = Broken::mug();
    broken.edit("board.json", |board| board["tags"][0]["id"] = json!(4_000_000_000u64));
    broken.is_refused(&["board.json", "4000000000"]);
}

#[test]
fn a_board_of_another_family() {
    let broken = Broken::mug();
    broken.edit("board.json", |board| board["family"] = json!("aruco_6x6_250"));
    let report = broken.gives_no_scan(&["aruco_4x4_50", "aruco_6x6_250"]);
    assert!(report["views"].as_array().unwrap().iter().all(|view| view["used"] == false));
}

#[test]
fn no_tag_in_any_view() {
    let broken = Broken::mug();
    for view in 0..4 {
        paint(&broken, view, |_, _| true);
    }
    broken.gives_no_scan(&["no view could be placed on the board", "marker"]);
}

#[test]
fn a_black_picture_is_left_out() {
    let broken = Broken::mug();
    paint(&broken, 2, |_, _| true);
    broken.leaves_out("002", &["marker"]);
}

/// Everything is painted over but one tag: which pixels those are, the recording's own truth says.
#[test]
fn one_tag_only() {
    let broken = Broken::mug();
    for view in 0..4 {
        let tag = projected_tag(&broken, view);
        let middle = [0, 1].map(|k| tag.iter().map(|c| c[k]).sum::<f64>() / 4.0);
        let reach = tag.iter().map(|c| (c[0] - middle[0]).hypot(c[1] - middle[1])).fold(0.0, f64::max);
        paint(&broken, view, |x, y| (x - middle[0]).hypot(y - middle[1]) > 1.25 * reach);
    }
    let report = broken.gives_no_scan(&["only one marker"]);
    assert!(report["views"].as_array().unwrap().iter().all(|v| v["reason"].is_string()));
}

#[test]
fn without_board_json_the_surfaces_place_the_views_and_the_seller_is_told() {
    let broken = Broken::mug();
    fs::remove_file(broken.file("board.json")).unwrap();
    let ran = broken.build();
    assert!(matches!(ran.status, Some(0 | 1)), "{ran:?}");
    assert!(ran.err.contains("no board.json"), "{}", ran.err);
    assert!(broken.out().join("report.json").is_file());
    broken.nothing_half_written();
}

#[test]
fn a_board_that_is_mostly_hidden_still_places_the_views() {
    let options =
        ["--product", "camera", "--views", "4", "--frames", "2", "--hide-board", "0.5", "--seed", "3"];
    let broken = Broken::copy_of(&simulated("half-hidden", &options));
    let ran = broken.build().with_status(0);
    assert!(ran.out.contains("from 4 of 4 views"), "{}", ran.out);
}

/// Blackens the pixels of a view's colour picture that `covers` names.
fn paint(broken: &Broken, view: usize, covers: impl Fn(f64, f64) -> bool) {
    let path = broken.file(&format!("color/{view:06}.png"));
    let mut image = decode_color(&fs::read(&path).unwrap(), 640, 480).unwrap();
    for (i, pixel) in image.data.iter_mut().enumerate() {
        if covers((i % 640) as f64, (i / 640) as f64) {
            *pixel = [0; 3];
        }
    }
    fs::write(path, encode_color(&image).unwrap()).unwrap();
}

/// Corners in pixels of the tag nearest to the middle of the lower picture half: near the camera and in full view.
fn projected_tag(broken: &Broken, view: usize) -> [[f64; 2]; 4] {
    let read = |name: &str| super::support::json(&broken.file(name));
    let (truth, board) = (read("truth/poses.json"), read("board.json"));
    let rows = &truth["views"][view]["world_from_camera"];
    let m = |i: usize| rows[i].as_f64().unwrap();
    let project = |corner: &Value| {
        let d: [f64; 3] = std::array::from_fn(|k| corner[k].as_f64().unwrap() - m(4 * k + 3));
        let [x, y, z] = std::array::from_fn(|c| (0..3).map(|r| m(4 * r + c) * d[r]).sum::<f64>());
        [319.5 + 525.0 * x / z, 239.5 + 525.0 * y / z]
    };
    let tags = board["tags"].as_array().unwrap().iter();
    let projected = tags.map(|tag| std::array::from_fn(|i| project(&tag["corners_m"][i])));
    let off = |tag: &[[f64; 2]; 4]| (tag[0][0] - 320.0).hypot(tag[0][1] - 400.0);
    projected.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
}
