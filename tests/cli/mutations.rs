//! What quietly goes wrong in real life, done to a good recording: it must be noticed, or do no harm to the size.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use reconstruct::measure::extent;
use reconstruct::model_file::{self, Limits};
use scanner::pictures::{decode_color, encode_color};
use serde_json::{Value, json};

use super::support::{Broken, Ran, json, simulated};

const SCAN: [&str; 8] = ["--product", "mug", "--views", "8", "--frames", "2", "--seed", "3"];

fn mug() -> &'static Path {
    static MUG: OnceLock<PathBuf> = OnceLock::new();
    MUG.get_or_init(|| simulated("mutated", &SCAN))
}

/// The same scan with the product knocked before one view is taken; `name` tells its folder from others.
fn knocked(name: &str, view: usize) -> PathBuf {
    let view = view.to_string();
    simulated(&format!("mutated-{name}-{view}"), &[&SCAN[..], &["--knock", &view]].concat())
}

/// Length, width and height as built, what they may be off, and as they truly are, millimetres.
struct Sizes {
    built: [f64; 3],
    plus_minus: [f64; 3],
    truth: [f64; 3],
}

fn sizes(broken: &Broken) -> Sizes {
    let report = json(&broken.out().join("report.json"));
    let three = |field: &str| std::array::from_fn(|k| 1000.0 * report[field][k].as_f64().unwrap());
    let bytes = fs::read(broken.file("truth/mesh.ply")).unwrap();
    let mesh = model_file::ply::read(&bytes[..], &Limits::default()).unwrap();
    Sizes {
        built: three("dimensions_m"),
        plus_minus: three("dimensions_uncertainty_m"),
        truth: extent(&mesh.vertices.points).map(|metres| 1000.0 * metres),
    }
}

#[track_caller]
fn is_true_to_size(broken: &Broken) {
    let Sizes { built, plus_minus, truth } = sizes(broken);
    for k in 0..3 {
        assert!((built[k] - truth[k]).abs() <= plus_minus[k], "{built:?} ± {plus_minus:?}, truly {truth:?}");
    }
}

fn report(broken: &Broken) -> Value {
    json(&broken.out().join("report.json"))
}

/// Names of the views that were left out.
fn left_out(broken: &Broken) -> Vec<String> {
    let report = report(broken);
    let views = report["views"].as_array().unwrap().iter().filter(|v| v["used"] == false);
    views.map(|v| v["name"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn the_scan_itself_is_right() {
    let broken = Broken::copy_of(mug());
    let ran = broken.build().with_status(0);
    assert!(!ran.err.contains("100 mm") && !ran.err.contains("larger than measured"), "{}", ran.err);
    is_true_to_size(&broken);
}

/// `factor` of what the file says is on the paper.
fn printed(factor: f64) -> (Broken, Ran) {
    let broken = Broken::copy_of(mug());
    broken.edit("board.json", |board| {
        // The paper is what it is; the file that goes with it says another size.
        let larger = |point: &mut Value| {
            for coordinate in point.as_array_mut().unwrap() {
                *coordinate = json!(coordinate.as_f64().unwrap() / factor);
            }
        };
        board["inner_region_m"].as_array_mut().unwrap().iter_mut().for_each(larger);
        for tag in board["tags"].as_array_mut().unwrap() {
            tag["corners_m"].as_array_mut().unwrap().iter_mut().for_each(larger);
        }
    });
    let ran = broken.build();
    (broken, ran)
}

#[test]
fn a_board_printed_at_another_size_is_noticed() {
    for factor in [0.9, 0.94, 0.97, 1.03, 1.06] {
        let (_, ran) = printed(factor);
        assert!(matches!(ran.status, Some(0 | 1)), "{ran:?}");
        let said = format!("{}{}", ran.out, ran.err);
        assert!(said.contains("print at 100 %") || said.contains("printed at 100 %"), "{factor}: {said}");
    }
}

/// Half a pixel is 0.7 mm at the product.
#[test]
fn a_slip_of_half_a_pixel_between_colour_and_depth_moves_no_side_by_more_than_that() {
    const HALF_A_PIXEL_MM: f64 = 0.7;
    let straight = Broken::copy_of(mug());
    straight.build().with_status(0);
    let straight = sizes(&straight);
    for (across, down) in [(0.5, 0.0), (0.0, 0.5), (-0.5, -0.5)] {
        let broken = Broken::copy_of(mug());
        broken.edit_recording(|recording| {
            for (axis, slip) in [("cx", across), ("cy", down)] {
                let middle = recording["depth"][axis].as_f64().unwrap();
                recording["depth"][axis] = json!(middle + slip);
            }
        });
        broken.build().with_status(0);
        let slipped = sizes(&broken);
        for k in 0..3 {
            let by = (slipped.built[k] - straight.built[k]).abs();
            assert!(by <= 2.0 * HALF_A_PIXEL_MM, "{across} {down}: by {by} mm");
        }
    }
}

#[test]
fn half_of_the_tags_missing_does_no_harm() {
    let broken = Broken::copy_of(&simulated("mutated-half", &[&SCAN[..], &["--hide-board", "0.5"]].concat()));
    broken.build().with_status(0);
    is_true_to_size(&broken);
}

/// From view `first` on, everything was taken after the product had been knocked.
fn moved_before(first: usize) -> Broken {
    let broken = Broken::copy_of(mug());
    let recording = json(&broken.file("recording.json"));
    for view in first..8 {
        let knocked = knocked(&format!("from-{first}"), view);
        for frame in recording["views"][view]["frames"].as_array().unwrap() {
            for side in ["color", "depth"] {
                let name = frame[side].as_str().unwrap();
                fs::copy(knocked.join(name), broken.file(name)).unwrap();
            }
        }
    }
    broken
}

#[test]
fn views_after_the_product_was_moved_are_left_out() {
    let broken = moved_before(6);
    let ran = broken.build().with_status(0);
    assert_eq!(left_out(&broken), ["006", "007"]);
    assert!(ran.err.contains("view 006: the product stands differently"), "{}", ran.err);
    is_true_to_size(&broken);
}

/// Which half is to be believed, nobody can tell.
#[test]
fn a_product_moved_half_way_gives_no_model() {
    let broken = moved_before(4);
    broken.gives_no_scan(&["do not fit together", "moved", "scan again"]);
}

/// A tag whose corners the file names the wrong way round, as after a mirrored print, a turned one, and two that changed places.
#[test]
fn one_tag_that_is_not_as_the_file_says_does_no_harm() {
    let straight = Broken::copy_of(mug());
    straight.build().with_status(0);
    let straight = sizes(&straight).built;
    let mirrored = |board: &mut Value| board["tags"][0]["corners_m"].as_array_mut().unwrap().reverse();
    let turned = |board: &mut Value| board["tags"][0]["corners_m"].as_array_mut().unwrap().rotate_left(1);
    let swapped = |board: &mut Value| {
        let first = board["tags"][0]["id"].clone();
        board["tags"][0]["id"] = board["tags"][1]["id"].clone();
        board["tags"][1]["id"] = first;
    };
    let changes: [&dyn Fn(&mut Value); 3] = [&mirrored, &turned, &swapped];
    for change in changes {
        let broken = Broken::copy_of(mug());
        broken.edit("board.json", change);
        broken.build().with_status(0);
        assert_eq!(left_out(&broken), [""; 0]);
        let built = sizes(&broken).built;
        assert!((0..3).all(|k| (built[k] - straight[k]).abs() < 0.3), "{built:?} instead of {straight:?}");
    }
}

#[test]
fn mirrored_pictures_give_no_model() {
    let broken = Broken::copy_of(mug());
    mirror_colors(&broken);
    broken.gives_no_scan(&["tags do not lie as the board file says"]);
}

fn mirror_colors(broken: &Broken) {
    for view in 0..8 {
        let path = broken.file(&format!("color/{view:06}.png"));
        let mut image = decode_color(&fs::read(&path).unwrap(), 640, 480).unwrap();
        image.data.chunks_mut(640).for_each(<[_]>::reverse);
        fs::write(path, encode_color(&image).unwrap()).unwrap();
    }
}

#[test]
fn depth_of_other_views_gives_no_model() {
    let broken = Broken::copy_of(mug());
    broken.edit_recording(|recording| {
        let depth: Vec<Value> =
            (0..8).map(|view| recording["views"][view]["frames"][0]["depth"].clone()).collect();
        for view in 0..8 {
            for frame in recording["views"][view]["frames"].as_array_mut().unwrap() {
                frame["depth"] = depth[(view + 1) % 8].clone();
            }
        }
    });
    broken.gives_no_scan(&["do not fit together"]);
}

#[test]
fn a_black_picture_among_many_does_no_harm() {
    let broken = Broken::copy_of(mug());
    let black = reconstruct::image::ColorImage::filled(640, 480, [0; 3]);
    fs::write(broken.file("color/000002.png"), encode_color(&black).unwrap()).unwrap();
    let ran = broken.build().with_status(0);
    assert!(ran.out.contains("from 7 of 8 views"), "{}", ran.out);
    is_true_to_size(&broken);
}

/// What was never seen may be larger than what was: the stated size says so.
#[test]
fn a_product_seen_from_one_side_is_not_said_to_end_there() {
    for kept in [&[0][..], &[0, 1], &[0, 4], &[0, 1, 2, 3]] {
        let broken = Broken::copy_of(mug());
        broken.edit_recording(|recording| {
            let views: Vec<Value> = kept.iter().map(|&view| recording["views"][view].clone()).collect();
            recording["views"] = json!(views);
        });
        let ran = broken.build().with_status(0);
        assert!(ran.err.contains("may be larger than measured"), "{kept:?}: {}", ran.err);
        let Sizes { built, plus_minus, truth } = sizes(&broken);
        // A handle that no view shows has no bound, but each side that is cut off is said to be unsure.
        for k in (0..3).filter(|&k| truth[k] - built[k] > 2.0) {
            assert!(plus_minus[k] > 5.0, "{kept:?}: {built:?} ± {plus_minus:?}, truly {truth:?}");
        }
    }
}
