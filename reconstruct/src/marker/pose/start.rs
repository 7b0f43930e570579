//! First poses: homographies of the tags' planes, scored by how many tags agree.

use nalgebra::{Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::solve::{Corner, rms_px, solve};
use super::{PoseConfig, SeenTag};
use crate::board::KnownBoard;
use crate::camera::Intrinsics;
use crate::marker::homography;
use crate::pose::Pose;

/// Corners of a flat board lie this near to one height, metres.
const FLAT_M: f64 = 1e-6;
/// Farthest a tag counts when a start is scored, in allowed tag errors.
const SCORE_LIMIT: f64 = 6.0;
/// Pairs of tags that are tried.
const MAX_PAIRS: usize = 60;

/// The candidate with which the tags agree best.
pub(super) fn best_start(
    seen: &[SeenTag],
    board: &KnownBoard,
    camera: &Intrinsics,
    config: &PoseConfig,
) -> Option<Pose> {
    let limit = SCORE_LIMIT * config.max_tag_error_px;
    let score = |pose: &Pose| -> f64 {
        seen.iter().map(|s| rms_px(s.corners(), pose, camera).map_or(limit, |e| e.min(limit))).sum()
    };
    let mut best: Option<(f64, Pose)> = None;
    for group in groups(seen.len(), is_flat(board)) {
        let tags: Vec<SeenTag> = group.iter().map(|&i| seen[i]).collect();
        for candidate in from_group(&tags, camera, config) {
            let s = score(&candidate);
            if best.is_none_or(|(b, _)| s < b) {
                best = Some((s, candidate));
            }
        }
        if best.is_some_and(|(b, _)| b < 0.5 * config.max_tag_error_px * seen.len() as f64) {
            break;
        }
    }
    best.map(|(_, pose)| pose)
}

/// Both poses that some tags of one plane allow, refined on these tags: a homography of small tags is far off.
pub(super) fn from_group(tags: &[SeenTag], camera: &Intrinsics, config: &PoseConfig) -> Vec<Pose> {
    let corners = all_corners(tags);
    let refine = |pose: Pose| Some(solve(&corners, pose, camera, config.huber_px)?.pose);
    let first = from_plane(tags, camera).and_then(refine);
    let second = first.and_then(|pose| flipped(&corners, &pose)).and_then(refine);
    first.into_iter().chain(second).collect()
}

/// Groups of tags that lie in one plane: all, pairs, single ones; only single ones where the board is not flat.
fn groups(count: usize, flat: bool) -> Vec<Vec<usize>> {
    let single = (0..count).map(|i| vec![i]);
    if !flat || count < 2 {
        return single.collect();
    }
    // Far pairs first: they determine the pose best.
    let pairs = (1..count).rev().flat_map(|gap| (0..count - gap).map(move |i| vec![i, i + gap]));
    std::iter::once((0..count).collect()).chain(pairs.take(MAX_PAIRS)).chain(single).collect()
}

fn is_flat(board: &KnownBoard) -> bool {
    let mut heights = board.tags.iter().flat_map(|t| t.corners_m.iter().map(|c| c[2]));
    heights.next().is_none_or(|first| heights.all(|z| (z - first).abs() < FLAT_M))
}

fn all_corners(seen: &[SeenTag]) -> Vec<Corner> {
    seen.iter().flat_map(SeenTag::corners).collect()
}

/// Pose from the homography between the plane of some tags and the rays (Zhang 2000, section 3.1).
fn from_plane(tags: &[SeenTag], camera: &Intrinsics) -> Option<Pose> {
    let board_from_plane = plane_frame(tags.first()?);
    let plane_from_board = board_from_plane.inverse();
    let corners = all_corners(tags);
    let flat: Vec<Point2<f64>> = corners.iter().map(|c| (plane_from_board * c.in_board).xy()).collect();
    let rays: Vec<Point2<f64>> = corners.iter().map(|c| camera.ray(&c.pixel)).collect();
    let h = homography::fit(&flat, &rays)?;
    let scale = (h.column(0).norm() * h.column(1).norm()).sqrt();
    if scale < 1e-12 {
        return None;
    }
    // The plane lies in front of the camera.
    let middle = flat.iter().fold(Vector3::zeros(), |sum, p| sum + Vector3::new(p.x, p.y, 1.0));
    let sign = if (h * middle).z < 0.0 { -1.0 } else { 1.0 };
    let h = h * (sign / scale);
    let (x, y) = (h.column(0).into_owned(), h.column(1).into_owned());
    let svd = Matrix3::from_columns(&[x, y, x.cross(&y)]).svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    if rotation.determinant() < 0.0 {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let camera_from_plane = Pose::from_parts(Translation3::from(h.column(2).into_owned()), rotation);
    Some(camera_from_plane * plane_from_board)
}

/// Frame of a tag: origin in its bottom-left corner, x along its bottom side, z out of it.
fn plane_frame(seen: &SeenTag) -> Pose {
    let c = seen.tag.corners_m.map(Point3::from);
    let x = (c[2] - c[3]).normalize();
    let z = x.cross(&(c[0] - c[3])).normalize();
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Pose::from_parts(Translation3::from(c[3].coords), UnitQuaternion::from_rotation_matrix(&axes))
}

/// The other pose of a flat board: its normal mirrored at the line of sight to its middle.
pub(super) fn flipped(corners: &[Corner], camera_from_board: &Pose) -> Option<Pose> {
    let sum = corners.iter().fold(Vector3::zeros(), |sum, c| sum + c.in_board.coords);
    let middle_in_board = Point3::from(sum / corners.len() as f64);
    let middle = camera_from_board * middle_in_board;
    let sight = middle.coords.try_normalize(1e-9)?;
    let normal = camera_from_board.rotation * Vector3::z();
    let mirrored = sight * (2.0 * normal.dot(&sight)) - normal;
    let turn = UnitQuaternion::rotation_between(&normal, &mirrored)?;
    let rotation = turn * camera_from_board.rotation;
    let translation = middle.coords - rotation * middle_in_board.coords;
    Some(Pose::from_parts(Translation3::from(translation), rotation))
}
