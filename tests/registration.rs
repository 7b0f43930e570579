//! Registration of clouds and recordings that nobody in this project made.

use std::io::BufReader;
use std::path::Path;

use nalgebra::Point3;
use reconstruct::cloud::PointCloud;
use reconstruct::knn::Tree;
use reconstruct::model_file::{Limits, ply};
use reconstruct::normals::{Neighbourhood, estimate};
use reconstruct::pose::{Pose, from_row_major, rotation_error_radians};
use reconstruct::register::global::{GlobalConfig, Moving, place_views};
use reconstruct::register::icp::{IcpConfig, Metric, Target, register, register_in_rounds};
use reconstruct::register::svd::rigid_transform;
use reconstruct::register::view::RegisterView;
use reconstruct::voxel::downsample;
use scanner::recording::Recording;
use tests::shared;

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|word| word.parse().unwrap()).collect()
}

/// A street scan at 25 cm with normals.
fn street(path: &Path) -> PointCloud {
    let file = BufReader::new(std::fs::File::open(path).unwrap());
    let cloud = ply::read(file, &Limits::default()).unwrap().vertices;
    let mut cloud = downsample(&cloud, 0.25).unwrap().cloud;
    let tree = Tree::new(&cloud.points);
    cloud.normals = estimate(&cloud.points, &tree, Neighbourhood::Nearest(20), &[0.0; 3]).normals;
    cloud
}

#[test]
fn lidar_pair_from_where_it_was_taken() {
    let Some(folder) = shared("lidar-pair") else { return };
    let (source, target) = (street(&folder.join("source.ply")), street(&folder.join("target.ply")));
    let rows = numbers(&std::fs::read_to_string(folder.join("T_target_source.txt")).unwrap());
    let truth = from_row_major(&rows.try_into().unwrap()).unwrap();
    let far =
        IcpConfig { max_distance: 1.5, sigma_metres: 0.05, tolerance_metres: 1e-3, ..IcpConfig::default() };
    let near = IcpConfig { max_distance: 0.5, tolerance_metres: 1e-4, ..far.clone() };
    let last = IcpConfig { max_distance: 0.3, ..near.clone() };
    for metric in [Metric::PointToPlane, Metric::Symmetric] {
        let rounds = [&far, &near, &last].map(|round| IcpConfig { metric, ..round.clone() });
        let check = |from: &PointCloud, to: &PointCloud, truth: &Pose| {
            let found = register_in_rounds(from, &Target::new(to), &Pose::identity(), &rounds).unwrap();
            let error = truth.inverse() * found.target_from_source;
            let (moved, turned) = (error.translation.vector.norm(), error.rotation.angle().to_degrees());
            println!("{metric:?}: {moved:.4} m, {turned:.4} degrees, {} iterations", found.iterations);
            // Both metrics and both directions end at 0.23 to 0.28 degrees from the file's pose, so that is as true as it gets.
            assert!(moved < 0.05 && turned < 0.3, "{metric:?}: {moved} m, {turned} degrees");
        };
        check(&source, &target, &truth);
        check(&target, &source, &truth.inverse());
    }
}

/// The views of a recording whose depth is registered to its colour, and its true poses.
fn views(folder: &Path, indices: impl Iterator<Item = usize>) -> (Vec<RegisterView>, Vec<Pose>) {
    let recording = Recording::open(folder).unwrap();
    let truth = std::fs::read_to_string(folder.join("truth/poses.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let camera = recording.rig().color;
    let rays = camera.ray_table();
    let mut cell = None;
    indices
        .map(|i| {
            let images = recording.load_view(i).unwrap();
            let depth = &images.depths[0];
            let points: Vec<[f32; 3]> = (0..rays.len())
                .map(|k| {
                    depth
                        .metres(k % depth.width, k / depth.width)
                        .map_or([0.0; 3], |z| [rays[k][0] * z, rays[k][1] * z, z])
                })
                .collect();
            let cell = *cell.get_or_insert_with(|| RegisterView::cell_for(&camera, &points).unwrap());
            let rows: Vec<f64> =
                serde_json::from_value(truth["views"][i]["world_from_camera"].clone()).unwrap();
            let pose = from_row_major(&rows.try_into().unwrap()).unwrap();
            (RegisterView::organised(camera, &points, &images.color.data, cell).unwrap(), pose)
        })
        .unzip()
}

#[test]
fn stream_without_markers_is_placed() {
    let Some(folder) = shared("simulated/drill-markerless-stream") else { return };
    let (views, truth) = views(&folder, 0..12);
    let placement = place_views(&views, &GlobalConfig::default());
    assert_eq!(placement.moving, Moving::Camera);
    let found: Vec<Pose> = placement.world_from_view.iter().map(|p| p.expect("placed")).collect();
    let place = |p: &Pose| p.translation.vector.map(|v| v as f32).into();
    let truth_from_world =
        rigid_transform(found.iter().zip(&truth).map(|(f, t)| (place(f), place(t), 1.0))).unwrap();
    let ahead = Point3::new(0.0, 0.0, f64::from(views[0].distance));
    let mut errors: Vec<(f64, f64)> = found
        .iter()
        .zip(&truth)
        .map(|(f, t)| {
            let f = truth_from_world * f;
            ((f * ahead - t * ahead).norm() * 1e3, rotation_error_radians(&f, t).to_degrees())
        })
        .collect();
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!("millimetres and degrees: {errors:.2?}");
    assert!(errors[errors.len() / 2].0 < 2.0 && errors[errors.len() - 1].0 < 4.0, "{errors:?}");
    assert!(errors.iter().all(|e| e.1 < 0.5), "{errors:?}");
}

#[test]
fn a_rabbit_is_turned_back() {
    let Some(folder) = shared("pcl") else { return };
    let file = BufReader::new(std::fs::File::open(folder.join("bun0.pcd")).unwrap());
    let mut cloud = reconstruct::model_file::pcd::read(file, &Limits::default()).unwrap();
    let tree = Tree::new(&cloud.points);
    cloud.normals = estimate(&cloud.points, &tree, Neighbourhood::Nearest(12), &[0.0, 0.1, 1.0]).normals;
    let truth =
        Pose::new(nalgebra::Vector3::new(0.004, -0.003, 0.002), nalgebra::Vector3::new(0.05, 0.08, -0.06));
    let moved = cloud.transformed(&truth.inverse());
    let config = IcpConfig { max_distance: 0.03, metric: Metric::Symmetric, ..IcpConfig::default() };
    let found = register(&moved, &Target::new(&cloud), &Pose::identity(), &config).unwrap();
    let error = truth.inverse() * found.target_from_source;
    assert!(error.translation.vector.norm() < 1e-5 && error.rotation.angle() < 1e-4, "{found:?}");
}
