//! One product in two poses: `scan-product build STANDING LYING` joins them, or says why it cannot.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use reconstruct::knn::Tree;
use reconstruct::mesh::Mesh;
use scanner::simulate::truth::{Surface, percentile, surface_errors};
use scanner::simulate::{Kind, Rest, ScanSpec, scan as simulate, write};
use serde_json::Value;
use tempfile::TempDir;

use super::support::{RESULT, Ran, asc_points, bytes_of, command, copy, json, mug, names, scan, simulated};

/// Five views of two frames on disk, and the true surface.
fn recorded(folder: &Path, product: Kind, rest: Rest) -> Mesh {
    let spec = ScanSpec { rest, views: 5, frames: 2, ..ScanSpec::new(product, 3) };
    written(folder, &spec)
}

fn written(folder: &Path, spec: &ScanSpec) -> Mesh {
    let scan = simulate(spec).unwrap();
    write(&scan, folder).unwrap();
    scan.truth.mesh
}

fn joined(recordings: &[PathBuf], out: &Path) -> Ran {
    command().arg("build").args(recordings).arg("--out").arg(out).output().unwrap().into()
}

/// Share of the true underside with a measured point within 2 mm.
fn underside(truth: &Mesh, points: &[[f32; 3]]) -> f64 {
    let tree = Tree::new(points);
    let faces_down = |i: &usize| truth.vertices.points[*i][2] < 0.002 && truth.vertices.normals[*i][2] < -0.9;
    let all: Vec<usize> = (0..truth.vertices.len()).filter(faces_down).collect();
    assert!(all.len() > 100, "a product stands on something");
    let near = |i: &&usize| tree.nearest_within(&truth.vertices.points[**i], 0.002).is_some();
    all.iter().filter(near).count() as f64 / all.len() as f64
}

fn measured(out: &Path) -> Vec<[f32; 3]> {
    asc_points(&out.join("model.asc")).into_iter().map(|p| p.map(|v| (v / 1000.0) as f32)).collect()
}

#[track_caller]
fn assert_joined(product: Kind, rest: Rest) {
    let home = TempDir::new().unwrap();
    let places = ["standing", "lying", "out", "alone"].map(|name| home.path().join(name));
    let [standing, lying, out, alone] = &places;
    let truth = recorded(standing, product, Rest::Standing);
    recorded(lying, product, rest);
    joined(std::slice::from_ref(standing), alone).with_status(0);
    let ran = joined(&[standing.clone(), lying.clone()], out).with_status(0);
    assert_eq!(names(out), RESULT);
    assert!(ran.out.contains("underside: "), "{}", ran.out);

    let report = json(&out.join("report.json"));
    let view_names: Vec<&str> =
        report["views"].as_array().unwrap().iter().map(|v| v["name"].as_str().unwrap()).collect();
    let expected =
        ["000", "001", "002", "003", "004", "2/000", "2/001", "2/002", "2/003", "2/004"].as_slice();
    assert_eq!(view_names, expected);
    let join = &report["recordings"][1]["joined"];
    assert!(join["overlap_percent"].as_f64().unwrap() >= 30.0, "{join}");
    assert!(join["lead_percent"].as_f64().unwrap() >= 15.0, "{join}");
    assert!(report["surface"]["underside_measured_percent"].as_f64().unwrap() > 90.0, "{report}");
    assert_refined_together(&json(&alone.join("report.json")), &report);

    // The underside was nobody's before and is measured now, and the model is as true as that of one recording.
    let (both, one) = (measured(out), measured(alone));
    assert!(underside(&truth, &one) < 0.1, "{}", underside(&truth, &one));
    assert!(underside(&truth, &both) > 0.9, "{}", underside(&truth, &both));
    let surface = Surface::of(&truth).unwrap();
    let (both, one) = (surface_errors(&surface, &both), surface_errors(&surface, &one));
    let [median, p95] = [0.5, 0.95].map(|share| 1000.0 * percentile(&both, share));
    assert!(median < 0.4 && p95 < 1.3, "{product}: median {median} mm, p95 {p95} mm");
    assert!(p95 < 1000.0 * percentile(&one, 0.95) + 0.25, "{product}: joining made it worse, {p95} mm");
    let height = report["dimensions_m"][2].as_f64().unwrap();
    let high = truth.vertices.points.iter().map(|p| f64::from(p[2])).fold(0.0, f64::max);
    assert!((height - high).abs() < 0.002, "{product}: {height} for {high}");
    // The mesh faces down where it was measured: no cap lies over it.
    assert!(report["surface"]["holes"].as_array().unwrap().iter().all(|h| h["kind"] != "base"));
}

/// What the report says of the joint refinement is that of both recordings together.
#[track_caller]
fn assert_refined_together(alone: &Value, both: &Value) {
    let count = |report: &Value, name: &str| report["joint"][name].as_u64().unwrap();
    for name in ["corners", "surface_pairs", "board_samples"] {
        assert!(
            10 * count(both, name) > 15 * count(alone, name),
            "{name}: {} {}",
            alone["joint"],
            both["joint"]
        );
    }
    let sd = |view: &Value| view["pose_sd_mm"].as_f64().unwrap();
    let views = |report: &Value| report["views"].as_array().unwrap().clone();
    assert!(views(both).iter().all(|view| (0.001..1.0).contains(&sd(view))), "{}", both["views"]);
    let changed = views(alone).iter().zip(&views(both)).all(|(a, b)| sd(a) != sd(b));
    assert!(changed, "{} {}", alone["views"], both["views"]);
}

#[test]
fn a_box_on_its_side_gives_the_underside() {
    assert_joined(Kind::Crackerbox, Rest::Side);
}

#[test]
fn a_bottle_upside_down_is_found_by_its_label() {
    assert_joined(Kind::Bottle, Rest::UpsideDown);
}

#[test]
fn a_shoe_on_its_side_is_found_by_its_shape() {
    assert_joined(Kind::Shoe, Rest::Side);
}

#[test]
fn three_poses_become_one_model() {
    let home = TempDir::new().unwrap();
    let rests = [Rest::Standing, Rest::Side, Rest::UpsideDown];
    let places: Vec<PathBuf> = rests.iter().map(|rest| home.path().join(rest.to_string())).collect();
    let truths: Vec<Mesh> =
        places.iter().zip(rests).map(|(place, rest)| recorded(place, Kind::Shoe, rest)).collect();
    let out = home.path().join("out");
    let ran = joined(&places, &out).with_status(0);
    let report = json(&out.join("report.json"));
    let recordings = report["recordings"].as_array().unwrap();
    assert_eq!(recordings.len(), 3);
    assert!(recordings[1..].iter().all(|r| !r["joined"].is_null()), "{report}");
    assert!(report["views"].as_array().unwrap().iter().all(|v| v["used"] == true), "{}", ran.err);
    let errors = surface_errors(&Surface::of(&truths[0]).unwrap(), &measured(&out));
    let [median, p95] = [0.5, 0.95].map(|share| 1000.0 * percentile(&errors, share));
    assert!(median < 0.3 && p95 < 1.0, "median {median} mm, p95 {p95} mm");
    // What faces down is seen now: nothing is said to be missing because of the side it stands on.
    assert!(!ran.err.contains("the side it stands on"), "{}", ran.err);
}

/// A figurine as it stands; not to be changed.
fn figurine() -> &'static Path {
    static FIGURINE: OnceLock<PathBuf> = OnceLock::new();
    FIGURINE.get_or_init(|| {
        let options = ["--product", "figurine", "--seed", "3", "--views", "5", "--frames", "2"];
        simulated("figurine-standing", &options)
    })
}

#[track_caller]
fn assert_refused(recordings: &[PathBuf], words: &[&str]) -> Value {
    let home = TempDir::new().unwrap();
    let out = home.path().join("out");
    let ran = joined(recordings, &out).with_status(1);
    assert_eq!(names(&out), ["report.json"]);
    let report = json(&out.join("report.json"));
    let reason = report["verdict_reason"].as_str().unwrap();
    for word in words {
        assert!(reason.contains(word), "{word:?} is not in {reason:?}");
    }
    assert!(ran.out.contains(reason), "{}", ran.out);
    assert_eq!((&report["verdict"], &report["points"]), (&"poor".into(), &0.into()));
    report
}

#[test]
fn two_products_are_not_joined() {
    let report = assert_refused(&[figurine().into(), mug().into()], &["recording 2", "the same product"]);
    assert_eq!(report["recordings"][1]["world_from_board"], Value::Null);
    let second =
        report["views"].as_array().unwrap().iter().filter(|v| v["name"].as_str().unwrap().starts_with("2/"));
    assert!(second.clone().count() > 0 && second.into_iter().all(|v| v["used"] == false));
}

#[test]
fn the_same_kind_of_another_size_is_not_joined() {
    let home = TempDir::new().unwrap();
    let spec = |seed, rest| ScanSpec { rest, views: 5, frames: 2, ..ScanSpec::new(Kind::Camera, seed) };
    let places = ["one", "other"].map(|name| home.path().join(name));
    written(&places[0], &spec(3, Rest::Standing));
    written(&places[1], &spec(5, Rest::Side));
    assert_refused(&places, &["recording 2"]);
}

#[test]
fn too_little_common_surface_is_said_with_what_to_add() {
    let home = TempDir::new().unwrap();
    let lying = home.path().join("lying");
    let spec = ScanSpec {
        rest: Rest::UpsideDown,
        views: 1,
        frames: 2,
        elevations_deg: vec![80.0],
        ..ScanSpec::new(Kind::Camera, 3)
    };
    written(&lying, &spec);
    let standing = home.path().join("standing");
    written(&standing, &ScanSpec { views: 2, frames: 2, ..ScanSpec::new(Kind::Camera, 3) });
    assert_refused(&[standing, lying], &["recording 2", "add views"]);
}

#[test]
fn a_recording_that_is_no_scan_is_named() {
    let home = TempDir::new().unwrap();
    let other = home.path().join("other");
    copy(mug(), &other);
    let board = std::fs::read_to_string(other.join("board.json")).unwrap();
    std::fs::write(other.join("board.json"), board.replace("aruco_4x4_50", "aruco_5x5_100")).unwrap();
    assert_refused(&[figurine().into(), other], &["recording 2: ", "family"]);
}

#[test]
fn what_cannot_be_joined_by_boards_is_wrong_usage() {
    let home = TempDir::new().unwrap();
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let (a, b, out) = (text(figurine()), text(mug()), text(&home.path().join("out")));
    for (more, words) in [
        (vec![a.as_str(), a.as_str()], "twice"),
        (vec![&a, &b, "--no-board"], "--no-board"),
        (vec![&a, &b, "--method", "source"], "--method source"),
    ] {
        let ran = scan(["build", "--out", &out].iter().chain(&more)).with_status(2);
        assert!(ran.complaints().iter().any(|c| c.contains(words)), "{}", ran.err);
        assert!(!home.path().join("out").exists());
    }
}

#[test]
fn joining_gives_the_same_bytes_with_any_number_of_threads() {
    let home = TempDir::new().unwrap();
    let lying = home.path().join("lying");
    recorded(&lying, Kind::Figurine, Rest::Side);
    let with = |threads: &str| {
        let out = home.path().join(threads);
        let ran = command()
            .env("RAYON_NUM_THREADS", threads)
            .args(["build", figurine().to_str().unwrap(), lying.to_str().unwrap(), "--out"])
            .arg(&out)
            .output()
            .unwrap();
        Ran::from(ran).with_status(0);
        let mut files = bytes_of(&out);
        files.remove("report.json"); // it tells the time
        files
    };
    assert!(with("1") == with("3"));
}
