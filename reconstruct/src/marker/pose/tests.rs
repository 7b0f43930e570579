use super::*;
use crate::pose::{exp, log};
use nalgebra::Vector6;

fn square(id: u32, x: f64, y: f64, side: f64) -> Tag {
    let h = 0.5 * side;
    Tag {
        id,
        corners_m: [[x - h, y + h, 0.0], [x + h, y + h, 0.0], [x + h, y - h, 0.0], [x - h, y - h, 0.0]],
    }
}

/// Twelve tags of 45 mm around an empty middle.
fn ring() -> KnownBoard {
    let place = |k: u32| {
        let angle = f64::from(k) * std::f64::consts::TAU / 12.0;
        square(k, 0.17 * angle.cos(), 0.12 * angle.sin(), 0.045)
    };
    let inner_region_m = vec![[-0.1, -0.07], [0.1, -0.07], [0.1, 0.07], [-0.1, 0.07]];
    KnownBoard { version: 1, family: Family::Aruco4x4_50, tags: (0..12).map(place).collect(), inner_region_m }
}

fn camera() -> Intrinsics {
    let mut camera = Intrinsics::pinhole(640, 480, 525.0, 520.0, 318.0, 243.0);
    camera.distortion = [0.1, -0.2, 0.001, -0.001, 0.05];
    camera
}

/// A camera above the board that looks at its middle.
fn true_pose(elevation: f64, azimuth: f64, distance: f64) -> Pose {
    let (se, ce) = elevation.sin_cos();
    let eye = Point3::new(ce * azimuth.cos(), ce * azimuth.sin(), se) * distance;
    let up = nalgebra::Vector3::z();
    // Computer vision's camera: y down, z forward.
    Pose::face_towards(&eye, &Point3::origin(), &-up).inverse()
}

fn see(board: &KnownBoard, pose: &Pose, noise_px: f64, seed: u64) -> Vec<Detection> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut noise = || noise_px * (rng.f64() + rng.f64() + rng.f64() + rng.f64() - 2.0) * 1.73;
    let tag = |t: &Tag| Detection {
        id: t.id,
        corners: t.corners_m.map(|c| {
            let p = camera().project(&(pose * Point3::from(c))).unwrap();
            Point2::new(p.x + noise(), p.y + noise())
        }),
        corner_sigma_px: [0.05; 4],
        bit_errors: 0,
        clarity: 1.0,
    };
    board.tags.iter().map(tag).collect()
}

fn pose_of(detections: &[Detection]) -> Result<BoardPose, BoardPoseError> {
    board_pose(detections, &ring(), &camera(), &PoseConfig::default())
}

#[test]
fn exact_corners_give_the_exact_pose() {
    for (elevation, azimuth) in [(0.4, 0.0), (0.7, 2.0), (1.2, 4.0), (1.57, 1.0)] {
        let truth = true_pose(elevation, azimuth, 0.75);
        let found = pose_of(&see(&ring(), &truth, 0.0, 1)).unwrap();
        let error = log(&(found.camera_from_board * truth.inverse()));
        assert!(error.norm() < 1e-6, "{error}");
        assert!(found.reprojection_px < 1e-5 && found.used.len() == 12 && found.rejected.is_empty());
    }
}

#[test]
fn the_covariance_is_that_of_the_errors() {
    let truth = true_pose(0.7, 0.5, 0.75);
    let mut normalised = 0.0;
    let runs = 200;
    for seed in 0..runs {
        let found = pose_of(&see(&ring(), &truth, 0.2, seed)).unwrap();
        let error: Vector6<f64> = log(&(truth * found.camera_from_board.inverse()));
        normalised += error.dot(&(found.covariance.try_inverse().unwrap() * error));
    }
    let mean = normalised / runs as f64 / 6.0;
    assert!((0.8..1.25).contains(&mean), "squared errors are {mean} times what the covariance says");
}

#[test]
fn wrong_ids_are_rejected_and_named() {
    let truth = true_pose(0.6, 1.0, 0.75);
    let mut seen = see(&ring(), &truth, 0.1, 5);
    // Two tags read as each other, one from another board, one seen twice.
    (seen[2].id, seen[7].id) = (7, 2);
    seen[4].id = 33;
    seen[9].id = 10;
    let found = pose_of(&seen).unwrap();
    let error = log(&(found.camera_from_board * truth.inverse()));
    assert!(error.norm() < 3e-3, "{error}");
    assert_eq!(found.used, [0, 1, 3, 5, 6, 8, 11]);
    let expected = [
        (2, Rejection::Disagrees),
        (7, Rejection::Disagrees),
        (10, Rejection::SeenTwice),
        (33, Rejection::NotOnBoard),
    ];
    assert_eq!(found.rejected, expected);
}

#[test]
fn a_far_small_tag_keeps_its_second_pose_and_a_plane_decides() {
    let truth = true_pose(1.0, 0.3, 1.6);
    let config = PoseConfig { allow_single_tag: true, ..PoseConfig::default() };
    let plane = truth.rotation * nalgebra::Vector3::z();
    let mut kept = 0;
    for seed in 0..30 {
        let one = &see(&ring(), &truth, 0.3, seed)[..1];
        let found = board_pose(one, &ring(), &camera(), &config).unwrap();
        kept += usize::from(found.alternative.is_some());
        let chosen = choose_by_plane(&found, &plane.push(0.0));
        let angle = chosen.rotation.angle_to(&truth.rotation).to_degrees();
        assert!(angle < 25.0, "seed {seed}: {angle} degrees");
    }
    assert!(kept >= 20, "a tag of 15 px cannot tell its two poses apart, yet {kept} of 30 kept both");
    assert!(pose_of(&see(&ring(), &truth, 0.1, 3)).unwrap().alternative.is_none());
}

#[test]
fn every_bad_input_has_its_own_error() {
    let seen = see(&ring(), &true_pose(0.7, 0.5, 0.75), 0.0, 1);
    assert_eq!(pose_of(&[]), Err(BoardPoseError::NoTags));
    assert_eq!(pose_of(&seen[3..4]), Err(BoardPoseError::OneTag(3)));
    assert_eq!(pose_of(&[seen[3], seen[3]]), Err(BoardPoseError::SameIdTwice(3)));
    let foreign = [Detection { id: 40, ..seen[0] }, Detection { id: 41, ..seen[1] }];
    assert_eq!(pose_of(&foreign), Err(BoardPoseError::NoneOnBoard(vec![40, 41])));
    let swapped = [Detection { id: 6, ..seen[0] }, Detection { id: 0, ..seen[6] }, seen[3]];
    assert!(pose_of(&swapped).is_err() || pose_of(&swapped).unwrap().used.len() >= 2);
    let mut twice = ring();
    twice.tags[1].id = 0;
    let config = PoseConfig::default();
    assert_eq!(board_pose(&seen, &twice, &camera(), &config), Err(BoardPoseError::BoardHasIdTwice(0)));
    let mut broken = ring();
    broken.tags[1].corners_m = [[f64::NAN; 3]; 4];
    assert_eq!(board_pose(&seen, &broken, &camera(), &config), Err(BoardPoseError::Unusable));
}

#[test]
fn tags_standing_up_from_the_board_are_used() {
    let mut board = ring();
    let lift = exp(&Vector6::new(0.0, 0.0, 0.03, 0.9, 0.0, 0.0));
    for tag in &mut board.tags[4..6] {
        tag.corners_m = tag.corners_m.map(|c| (lift * Point3::from(c)).into());
    }
    let truth = true_pose(0.7, 0.5, 0.75);
    let found = board_pose(&see(&board, &truth, 0.0, 1), &board, &camera(), &PoseConfig::default()).unwrap();
    assert!(log(&(found.camera_from_board * truth.inverse())).norm() < 1e-6);
    assert_eq!(found.used.len(), 12);
}
