//! The chain on a figure made of boxes and balls, seen from several sides with marker poses a little off.

use super::*;
use crate::pose::exp;
use nalgebra::Vector6;

/// Surface points of a lopsided figure: a box, a ball beside it and a smaller box on top; with outward normals.
fn figure(count: usize, seed: u64) -> PointCloud {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut cloud = PointCloud::default();
    let boxes = [([0.0f32, 0.0, 0.05], [0.05f32, 0.03, 0.05]), ([0.02, 0.01, 0.13], [0.02, 0.015, 0.03])];
    for _ in 0..count {
        let (p, n) = match rng.u32(0..10) {
            0..3 => {
                let d = Vector3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5).normalize();
                (Vector3::new(-0.06, 0.03, 0.06) + d * 0.025, d)
            }
            k => {
                let (centre, half) = boxes[usize::from(k > 7)];
                let axis = rng.usize(0..3);
                let side = if rng.bool() { 1.0 } else { -1.0 };
                let mut p: Vector3<f32> =
                    Vector3::from_fn(|i, _| centre[i] + half[i] * (2.0 * rng.f32() - 1.0));
                p[axis] = centre[axis] + half[axis] * side;
                (p, Vector3::ith(axis, side))
            }
        };
        cloud.points.push(p.into());
        cloud.normals.push(n.into());
        cloud.colors.push([90, 120, 200]);
    }
    cloud
}

/// Views around the figure: what faces the camera, placed with a marker error of a few millimetres and degrees.
fn views(angles: &[f32]) -> (Vec<SourceView>, Vec<Pose>) {
    let mut rng = fastrand::Rng::with_seed(11);
    angles
        .iter()
        .enumerate()
        .map(|(i, angle)| {
            let camera = [0.7 * angle.cos(), 0.7 * angle.sin(), 0.5];
            let all = figure(24_000, 100 + i as u64);
            let seen: Vec<usize> = (0..all.len())
                .filter(|k| {
                    let to_camera = Vector3::from(camera) - Vector3::from(all.points[*k]);
                    to_camera.normalize().dot(&Vector3::from(all.normals[*k])) > 0.2
                })
                .collect();
            let off = if i == 0 { 0.0 } else { 1.0 };
            let nudge =
                exp(&Vector6::from_fn(|k, _| (rng.f64() - 0.5) * off * if k < 3 { 0.01 } else { 0.06 }));
            let cloud = PointCloud { normals: Vec::new(), ..all.select(&seen) };
            let view = SourceView {
                name: format!("{i:03}"),
                cloud_in_world: cloud.transformed(&nudge),
                camera_in_world: camera,
            };
            (view, nudge)
        })
        .unzip()
}

fn worst_error(nudges: &[Pose], corrections: &[Pose]) -> f64 {
    let centre = Point3::new(0.0, 0.0, 0.06);
    nudges.iter().zip(corrections).map(|(n, c)| (c * n * centre - centre).norm()).fold(0.0, f64::max)
}

#[test]
fn places_views_better_than_the_markers_did_and_counts_everything() {
    let (views, nudges) = views(&[0.0, 0.5, 1.0, 1.5]);
    let result = register_views(&views, &SourceConfig::default()).unwrap();
    let before = worst_error(&nudges, &vec![Pose::identity(); 4]);
    let after = worst_error(&nudges, &result.corrections);
    assert!(after < 0.004 && after < before, "{before} {after} {:#?}", result.report);
    let report = &result.report;
    assert_eq!(report.pairs.len(), 3);
    assert_eq!(report.points_model, views.iter().map(|v| v.cloud_in_world.len()).sum::<usize>());
    assert_eq!(report.points_model, result.model.len());
    for (pair, view) in report.pairs.iter().zip(&views[1..]) {
        assert_eq!((pair.points, &pair.view), (view.cloud_in_world.len(), &view.name));
        assert!(pair.points_down_sampled < pair.points && pair.key_points < pair.points_down_sampled);
        assert!(pair.key_points > 50 && pair.matches == pair.key_points && pair.ransac_inliers >= 3);
        assert!(pair.icp_iterations > 0 && pair.icp_rmse_metres > 0.0 && pair.icp_rmse_metres < 0.008);
        assert!(pair.failure.is_none());
    }
    assert_eq!(report.icp_iterations(), report.pairs.iter().map(|p| p.icp_iterations).sum::<usize>());
    let json = serde_json::to_string(report).unwrap();
    assert_eq!(serde_json::from_str::<SourceReport>(&json).unwrap().pairs.len(), 3);
}

#[test]
fn a_view_without_key_points_keeps_its_marker_pose() {
    let (mut views, _) = views(&[0.0, 0.5]);
    let flat = (0..900).map(|i| [(i % 30) as f32 * 0.003, (i / 30) as f32 * 0.003, 0.0]).collect();
    views[1].cloud_in_world = PointCloud { points: flat, ..PointCloud::default() };
    let result = register_views(&views, &SourceConfig::default()).unwrap();
    assert_eq!(result.corrections[1], Pose::identity());
    assert!(result.report.pairs[0].failure.is_some());
    assert_eq!(register_views(&[], &SourceConfig::default()), Err(SourceError::NoView));
    views[1].cloud_in_world = PointCloud::default();
    assert!(register_views(&views, &SourceConfig::default()).is_ok());
}
