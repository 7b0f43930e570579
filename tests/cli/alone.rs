//! A product that stands free before nothing: no board, no table, nothing behind it. `scan-product build RECORDING --no-board`.

use std::path::Path;

use nalgebra::Point3;
use reconstruct::pose::{Pose, from_row_major};
use scanner::simulate::truth::{Surface, centre, percentile, pose_error, surface_errors};
use scanner::simulate::{Kind, ScanSpec, SimulatedScan, scan as simulate, write};
use serde_json::Value;
use tempfile::TempDir;

use super::support::{asc_points, build, json, names};

/// A scan of which every pixel that is not the product's has no depth, written to `folder`.
fn cut_out(folder: &Path, product: Kind) -> SimulatedScan {
    let spec = ScanSpec { warp_px: 0.0, scale_error: 0.0, frames: 3, ..ScanSpec::new(product, 5) };
    let mut scan = simulate(&spec).unwrap();
    let surface = Surface::of(&scan.truth.mesh).unwrap();
    let camera = scan.rig.color;
    let rays = camera.ray_table();
    for (view, world_from_camera) in scan.views.iter_mut().zip(&scan.truth.world_from_camera) {
        for depth in &mut view.depths {
            for (raw, ray) in depth.data.iter_mut().zip(&rays) {
                let z = f64::from(*raw) / depth.units_per_metre;
                let p = world_from_camera * Point3::new(f64::from(ray[0]) * z, f64::from(ray[1]) * z, z);
                if p.z < 0.003 || surface.distance(p.map(|v| v as f32).into()) > 0.008 {
                    *raw = 0;
                }
            }
        }
    }
    write(&scan, folder).unwrap();
    std::fs::remove_file(folder.join("board.json")).unwrap();
    scan
}

fn pose_of(view: &Value) -> Pose {
    let numbers: Vec<f64> =
        view["world_from_camera"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    from_row_major(&numbers.try_into().unwrap()).unwrap()
}

#[test]
fn a_product_before_nothing_is_placed_by_its_shape() {
    let home = TempDir::new().unwrap();
    let (folder, out) = (home.path().join("shoe"), home.path().join("out"));
    let scan = cut_out(&folder, Kind::Shoe);
    let ran = build(&folder, &out, &["--no-board"]).with_status(0);
    assert!(names(&out).contains(&"model.glb".to_owned()), "{}", ran.out);
    let report = json(&out.join("report.json"));
    let views = report["views"].as_array().unwrap();
    assert!(views.iter().all(|v| v["used"] == true), "{views:?}");
    assert!(report["warnings"].to_string().contains("which way is up is unknown"), "{report}");

    // The world is the first view's camera frame.
    let truth = &scan.truth.world_from_camera;
    for (view, world_from_camera) in views.iter().zip(truth) {
        let expected = truth[0].inverse() * world_from_camera;
        let middle = world_from_camera.inverse() * centre(&scan.truth.mesh);
        let off = pose_error(&expected, &pose_of(view), &middle);
        assert!(off.metres < 0.001 && off.degrees < 0.4, "{}: {off:?}", view["name"]);
    }
    let on_board = asc_points(&out.join("model.asc"))
        .into_iter()
        .map(|p| (truth[0] * Point3::from(p.map(|v| v / 1000.0))).map(|v| v as f32).into());
    let errors = surface_errors(&Surface::of(&scan.truth.mesh).unwrap(), &on_board.collect::<Vec<_>>());
    let [median, p95] = [0.5, 0.95].map(|share| 1000.0 * percentile(&errors, share));
    assert!(median < 0.4 && p95 < 1.3, "median {median} mm, p95 {p95} mm");
}

/// Round things look the same from every side: they are refused, not put together anyhow.
#[test]
fn a_round_product_before_nothing_is_not_guessed_at() {
    let home = TempDir::new().unwrap();
    let (folder, out) = (home.path().join("bottle"), home.path().join("out"));
    cut_out(&folder, Kind::Bottle);
    let ran = build(&folder, &out, &["--no-board"]).with_status(1);
    assert!(ran.out.contains("use the marker board"), "{}", ran.out);
    assert_eq!(names(&out), ["report.json"]);
}
