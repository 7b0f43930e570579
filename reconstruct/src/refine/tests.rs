use nalgebra::{Point2, Rotation3, UnitQuaternion, Vector6};

use super::*;
use crate::camera::Intrinsics;
use crate::image::ColorImage;
use crate::marker::SeenCorner;

const FOCAL_BASELINE: f64 = 525.0 * 0.075;

/// A can of 60 mm radius and 150 mm height on the board, painted so that its sides differ.
struct Can {
    camera: Intrinsics,
    poses: Vec<Pose>,
    views: Vec<DepthView>,
    lights: Vec<Luminance>,
    corners: Vec<Vec<SeenCorner>>,
    board: Vec<Vec<BoardSample>>,
}

/// A camera 0.7 m from the can's middle, looking at it from `azimuth`, 35 degrees above the board.
fn camera_at(azimuth: f64, distance: f64) -> Pose {
    let elevation = 0.6f64;
    let towards =
        Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
    let middle = Point3::new(0.0, 0.0, 0.07);
    let forward = -towards;
    let right = forward.cross(&Vector3::z()).normalize();
    let rotation = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Pose::from_parts((middle + distance * towards).coords.into(), rotation)
}

/// Depth along a ray to the can's side, its top, or the board, and whether it is the can.
fn cast(from: &Point3<f64>, along: &Vector3<f64>) -> Option<(f64, bool)> {
    let (a, b, c) = (
        along.x.powi(2) + along.y.powi(2),
        from.x * along.x + from.y * along.y,
        from.x.powi(2) + from.y.powi(2) - 0.06f64.powi(2),
    );
    let root = b * b - a * c;
    let side = (root > 0.0)
        .then(|| (-b - root.sqrt()) / a)
        .filter(|t| (0.0..0.15).contains(&(from.z + t * along.z)));
    let top = (0.15 - from.z) / along.z;
    let on_top = (from + top * along).coords.xy().norm() < 0.06;
    match (side, on_top) {
        (Some(t), _) => Some((t, true)),
        (None, true) => Some((top, true)),
        _ => Some((-from.z / along.z, false)).filter(|(t, _)| *t > 0.0),
    }
}

impl Can {
    /// Views all round; `sensor` changes every disparity as a wrong depth camera does.
    fn seen_from(azimuths: &[f64], sensor: impl Fn(f64, f64, f64) -> f64) -> Self {
        let camera = Intrinsics::pinhole(320, 240, 262.5, 262.5, 159.5, 119.5);
        let rays = camera.ray_table();
        let mut can =
            Self { camera, poses: vec![], views: vec![], lights: vec![], corners: vec![], board: vec![] };
        for (k, &azimuth) in azimuths.iter().enumerate() {
            let pose = camera_at(azimuth, 0.6 + 0.08 * (k % 3) as f64);
            let mut depth = vec![0.0f32; rays.len()];
            let (mut mask, mut board) = (vec![false; rays.len()], Vec::new());
            let mut picture = ColorImage::filled(320, 240, [250; 3]);
            for (i, ray) in rays.iter().enumerate() {
                let along = pose.rotation * Vector3::new(f64::from(ray[0]), f64::from(ray[1]), 1.0);
                let from = Point3::from(pose.translation.vector);
                let Some((z, is_can)) = cast(&from, &along) else { continue };
                let (u, v) = ((i % 320) as f64, (i / 320) as f64);
                let read = sensor(u, v, FOCAL_BASELINE / z);
                depth[i] = (FOCAL_BASELINE / read) as f32;
                mask[i] = is_can;
                let hit = from + z * along;
                if is_can {
                    let paint =
                        128.0 + 80.0 * (12.0 * hit.y.atan2(hit.x)).sin() + 40.0 * (90.0 * hit.z).sin();
                    picture.data[i] = [paint as u8; 3];
                } else if hit.coords.xy().norm() < 0.2 && i % 7 == 0 {
                    board.push(BoardSample {
                        pixel: [u as f32, v as f32],
                        measured_px: read as f32,
                        expected_px: (FOCAL_BASELINE / z) as f32,
                    });
                }
            }
            let mut view = DepthView::new(camera, &rays, &depth);
            view.set_product(mask);
            can.views.push(view);
            can.lights.push(Luminance::of(&picture));
            can.board.push(board);
            can.poses.push(pose);
            can.corners.push(can.corners_of(&pose, 12));
        }
        can
    }

    fn corners_of(&self, pose: &Pose, count: usize) -> Vec<SeenCorner> {
        let at = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / count as f64;
            Point3::new(0.15 * angle.cos(), 0.15 * angle.sin(), 0.0)
        };
        let seen = |in_board: Point3<f64>| {
            let pixel: Point2<f64> = self.camera.project(&(pose.inverse() * in_board))?;
            Some(SeenCorner { in_board, pixel, sigma_px: 0.1 })
        };
        (0..count).filter_map(|k| seen(at(k))).collect()
    }

    fn views<'a>(&'a self, starts: &'a [Pose], anchors: &[Anchor<'a>]) -> Vec<RefineView<'a>> {
        (0..self.views.len())
            .map(|i| RefineView {
                geometry: &self.views[i],
                luminance: Some(&self.lights[i]),
                start: starts[i],
                anchor: anchors[i],
                board: &self.board[i],
            })
            .collect()
    }

    /// How far a pose puts the can's points from where they are, metres: the farthest of some.
    fn off(&self, view: usize, found: &Pose) -> f64 {
        let change = found * self.poses[view].inverse();
        let spots = [[0.06, 0.0, 0.15], [-0.06, 0.0, 0.0], [0.0, 0.06, 0.07], [0.0, -0.06, 0.15]];
        spots.iter().map(|p| (change * Point3::from(*p) - Point3::from(*p)).norm()).fold(0.0, f64::max)
    }
}

fn all_round(count: usize) -> Vec<f64> {
    (0..count).map(|k| std::f64::consts::TAU * k as f64 / count as f64).collect()
}

/// The poses, each off by some millimetres and a degree.
fn disturbed(poses: &[Pose], metres: f64, radians: f64) -> Vec<Pose> {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut off = |size: f64| size * (2.0 * rng.f64() - 1.0);
    poses
        .iter()
        .map(|pose| {
            let step =
                Vector6::new(off(metres), off(metres), off(metres), off(radians), off(radians), off(radians));
            pose::exp(&step) * pose
        })
        .collect()
}

#[test]
fn corners_and_surfaces_bring_every_view_home() {
    let can = Can::seen_from(&all_round(6), |_, _, d| d);
    let starts = disturbed(&can.poses, 0.002, 0.003);
    let anchors: Vec<Anchor<'_>> = can.corners.iter().map(|c| Anchor::Corners(c)).collect();
    let found = refine(&can.views(&starts, &anchors), None, &RefineConfig::default());
    for i in 0..6 {
        assert!(can.off(i, &starts[i]) > 0.0008, "the start is no test");
        assert!(
            can.off(i, &found.world_from_camera[i]) < 0.0002,
            "{}",
            can.off(i, &found.world_from_camera[i])
        );
        let (place, turn) = found.standard_deviation(i);
        assert!(place > 1e-5 && place < 5e-4 && turn > 1e-5 && turn < 2e-3, "{place} {turn}");
    }
    assert!(found.pairs.iter().all(|p| p.inlier_rmse_metres < 5e-4));
}

#[test]
fn colour_holds_the_turn_that_the_surfaces_leave_open() {
    let can = Can::seen_from(&all_round(8), |_, _, d| d);
    // The first view is held; the others are turned about the can's axis, by up to 1 mm on its side, and hardly held.
    let mut rng = fastrand::Rng::with_seed(5);
    let mut starts = can.poses.clone();
    for pose in &mut starts[1..] {
        let turn = 0.016 * (2.0 * rng.f64() - 1.0);
        *pose = pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, turn)) * *pose;
    }
    let prior = |i: usize| PosePrior {
        world_from_camera: starts[i],
        information: Matrix6::identity() * if i == 0 { 1e12 } else { 1e2 },
    };
    let priors: Vec<PosePrior> = (0..8).map(prior).collect();
    let anchors: Vec<Anchor<'_>> = priors.iter().map(Anchor::Prior).collect();
    let worst = |use_color: bool| {
        let config = RefineConfig { use_color, rounds: 12, ..RefineConfig::default() };
        let found = refine(&can.views(&starts, &anchors), None, &config);
        assert!(found.loosest_by_surface_metres.iter().all(|&m| m > 0.0005), "a can holds no turn");
        (0..8).map(|i| can.off(i, &found.world_from_camera[i])).fold(0.0, f64::max)
    };
    let (with, without) = (worst(true), worst(false));
    assert!(without > 0.0007, "the surfaces alone should leave the turn: {without}");
    assert!(with < 0.2 * without, "{with} against {without}");
}

#[test]
fn a_depth_that_reads_wrong_is_found_out_by_the_board() {
    let can = Can::seen_from(&all_round(6), |u, _, d| (d - 0.05 - 0.1 * (u / 160.0 - 1.0)) / 1.01);
    let anchors: Vec<Anchor<'_>> = can.corners.iter().map(|c| Anchor::Corners(c)).collect();
    let applied = DepthCalibration::identity(320, 240);
    let model = DepthModel::new(&applied, &CalibrationPrior::of_any_kinect(), FOCAL_BASELINE);
    let found = refine(&can.views(&can.poses, &anchors), Some(&model), &RefineConfig::default());
    let step = applied.then(&found.depth.unwrap().coefficients);
    for (u, v, d) in [(160.0, 120.0, 60.0), (80.0, 60.0, 55.0), (240.0, 180.0, 70.0)] {
        let read = (d - 0.05 - 0.1 * (u / 160.0 - 1.0)) / 1.01;
        let corrected = step.correct(u, v, read);
        assert!(
            (corrected - d).abs() < 0.06 && (corrected - d).abs() < 0.2 * (read - d).abs(),
            "{u} {corrected} {d}"
        );
    }
    for i in 0..6 {
        assert!(
            can.off(i, &found.world_from_camera[i]) < 0.0003,
            "{}",
            can.off(i, &found.world_from_camera[i])
        );
    }
}

#[test]
fn the_result_is_the_same_whatever_the_number_of_threads() {
    let can = Can::seen_from(&all_round(5), |_, _, d| d);
    let starts = disturbed(&can.poses, 0.001, 0.002);
    let anchors: Vec<Anchor<'_>> = can.corners.iter().map(|c| Anchor::Corners(c)).collect();
    let model = DepthModel::new(
        &DepthCalibration::identity(320, 240),
        &CalibrationPrior::of_any_kinect(),
        FOCAL_BASELINE,
    );
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| refine(&can.views(&starts, &anchors), Some(&model), &RefineConfig::default()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn nothing_and_one_view_alone_are_no_trouble() {
    assert!(refine(&[], None, &RefineConfig::default()).world_from_camera.is_empty());
    let can = Can::seen_from(&[0.3], |_, _, d| d);
    let starts = disturbed(&can.poses, 0.002, 0.003);
    let anchors = [Anchor::Corners(&can.corners[0])];
    let found = refine(&can.views(&starts, &anchors), None, &RefineConfig::default());
    assert!(can.off(0, &found.world_from_camera[0]) < 1e-5);
}
