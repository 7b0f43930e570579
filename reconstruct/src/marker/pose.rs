//! Pose of the camera on the board from all corners of all tags.
//!
//! Start: homographies (Zhang 2000) of all tags and of pairs of tags; the one with which most tags agree wins, so that
//! wrong ids do no harm. Then Gauss-Newton on the corners with Huber weights. The second pose that a plane allows
//! (Schweighofer & Pinz 2006) is tried as well and kept where the corners cannot tell.

mod solve;
mod start;

use nalgebra::{Matrix6, Point2, Point3, Vector4};
use thiserror::Error;

use super::detect::{DetectConfig, Detection, detect, other_families};
use super::dictionary::Dictionary;
use crate::board::{Family, KnownBoard, Tag};
use crate::camera::Intrinsics;
use crate::image::GrayImage;
use crate::pose::Pose;

use solve::{Corner, Solution};

/// How a board's pose is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseConfig {
    /// Residual from which a corner counts less, pixels.
    pub huber_px: f64,
    /// A tag whose corners lie farther off than this (root mean square, pixels) does not agree with the others.
    pub max_tag_error_px: f64,
    /// Whether one tag is enough. Its pose is ten times worse than a board's.
    pub allow_single_tag: bool,
}

impl Default for PoseConfig {
    fn default() -> Self {
        Self { huber_px: 1.0, max_tag_error_px: 2.0, allow_single_tag: false }
    }
}

/// Where the camera stands on the board.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardPose {
    /// The camera's frame from the board's.
    pub camera_from_board: Pose,
    /// Covariance of a step on the left, `exp(step) * camera_from_board`: translation (metres), then rotation
    /// (radians); scaled by the residuals' variance.
    pub covariance: Matrix6<f64>,
    /// Root mean square distance of the used corners, pixels.
    pub reprojection_px: f64,
    /// Ids that were used, ascending.
    pub used: Vec<u32>,
    /// Their corners, for whoever fits more than this one pose to them.
    pub corners: Vec<SeenCorner>,
    /// Ids that were not, and why.
    pub rejected: Vec<(u32, Rejection)>,
    /// The other pose that the corners allow nearly as well.
    pub alternative: Option<Pose>,
}

/// A corner of the board as one picture shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenCorner {
    /// Where it is on the board, metres.
    pub in_board: Point3<f64>,
    /// Where it is in the picture.
    pub pixel: Point2<f64>,
    /// Standard deviation of either coordinate, pixels: its own, scaled by how well the picture's corners agree.
    pub sigma_px: f64,
}

/// Why a detected tag was not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Rejection {
    /// The board has no such tag.
    #[error("the board has no tag with this id")]
    NotOnBoard,
    /// Two tags with this id were seen.
    #[error("two tags with this id were seen")]
    SeenTwice,
    /// Its place does not fit the other tags'.
    #[error("it does not lie where the other tags say it should")]
    Disagrees,
    /// Fewer than two of its corners were seen.
    #[error("it is cut off")]
    CutOff,
}

/// Why there is no pose.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BoardPoseError {
    /// Nothing was found.
    #[error("no tag of the board was found")]
    NoTags,
    /// One tag alone gives a poor pose.
    #[error("only one tag was found (id {0}); at least two must be seen")]
    OneTag(u32),
    /// Tags were found, none of them on the board.
    #[error("the tags that were found (ids {0:?}) are not on this board")]
    NoneOnBoard(Vec<u32>),
    /// Another board was used.
    #[error("the board in the picture is of family {}, the recording says {}", found.name(), expected.name())]
    OtherFamily {
        /// What the picture shows.
        found: Family,
        /// What the board file says.
        expected: Family,
    },
    /// A tag was seen twice, and nothing else is left.
    #[error("two tags with id {0} were found: every tag must be there once only")]
    SameIdTwice(u32),
    /// No two tags fit the board together.
    #[error("the tags do not lie as the board file says")]
    TagsDisagree,
    /// The board file names an id twice.
    #[error("the board file has id {0} twice")]
    BoardHasIdTwice(u32),
    /// Tags of the board are not finite squares, or the camera's numbers are not a camera's.
    #[error("the board file or the intrinsics hold impossible numbers")]
    Unusable,
}

/// Pose of the board from the tags seen in one picture.
pub fn board_pose(
    detections: &[Detection],
    board: &KnownBoard,
    camera: &Intrinsics,
    config: &PoseConfig,
) -> Result<BoardPose, BoardPoseError> {
    check(board, camera)?;
    let (seen, mut rejected) = usable(detections, board);
    if seen.is_empty() {
        return Err(nothing_usable(detections, &rejected));
    }
    if seen.len() == 1 && !config.allow_single_tag {
        return Err(BoardPoseError::OneTag(seen[0].tag.id));
    }
    let start = start::best_start(&seen, board, camera, config).ok_or(BoardPoseError::TagsDisagree)?;
    let (agreeing, solution) = consensus(&seen, start, camera, config)?;
    let used: Vec<u32> = agreeing.iter().map(|s| s.tag.id).collect();
    rejected
        .extend(seen.iter().filter(|s| !used.contains(&s.tag.id)).map(|s| (s.tag.id, Rejection::Disagrees)));
    rejected.sort_by_key(|r| r.0);
    let (camera_from_board, alternative) = both_poses(&agreeing, &solution, camera, config);
    let reprojection_px = camera_from_board.rms_px;
    Ok(BoardPose {
        camera_from_board: camera_from_board.pose,
        covariance: camera_from_board.covariance,
        reprojection_px,
        corners: agreeing
            .iter()
            .flat_map(SeenTag::corners)
            .map(|c| SeenCorner {
                in_board: c.in_board,
                pixel: c.pixel,
                sigma_px: (camera_from_board.variance / c.weight()).sqrt(),
            })
            .collect(),
        used,
        rejected,
        alternative,
    })
}

/// Poses that one tag allows, at most two, its own frame's origin in its middle: camera from tag.
pub(super) fn tag_poses(corners: &[Point2<f64>; 4], size: f64, camera: &Intrinsics) -> Vec<Pose> {
    let h = 0.5 * size;
    let tag = Tag { id: 0, corners_m: [[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]] };
    let seen = SeenTag { tag, corners: *corners, sigma_px: [0.0; 4] };
    start::from_group(&[seen], camera, &PoseConfig::default())
}

/// Says why a picture without a usable tag of the board has none: tries the other families.
pub fn explain_no_tags(
    image: &GrayImage,
    expected: Family,
    camera: Option<&Intrinsics>,
    config: &DetectConfig,
) -> BoardPoseError {
    let own = detect(image, Dictionary::of(expected), camera, config).len();
    match other_families(image, expected, camera, config).first() {
        // One tag of a small dictionary may be chance.
        Some(&(found, count)) if count >= 2 && count > own => BoardPoseError::OtherFamily { found, expected },
        _ => BoardPoseError::NoTags,
    }
}

/// Of the two poses that a plane allows, the one whose board lies along a plane measured in the camera frame.
///
/// `plane_in_camera`: (a, b, c, d) with `a x + b y + c z + d = 0`; only its direction counts, since depth may be biased.
pub fn choose_by_plane(pose: &BoardPose, plane_in_camera: &Vector4<f64>) -> Pose {
    let normal = plane_in_camera.xyz();
    let along = |p: &Pose| (p.rotation * nalgebra::Vector3::z()).dot(&normal).abs();
    match pose.alternative {
        Some(other) if along(&other) > along(&pose.camera_from_board) => other,
        _ => pose.camera_from_board,
    }
}

/// A tag that was seen and is on the board.
#[derive(Debug, Clone, Copy)]
struct SeenTag {
    tag: Tag,
    corners: [Point2<f64>; 4],
    sigma_px: [f64; 4],
}

impl SeenTag {
    fn corners(&self) -> impl Iterator<Item = Corner> + '_ {
        (0..4).filter(|&k| self.sigma_px[k].is_finite()).map(|k| Corner {
            in_board: Point3::from(self.tag.corners_m[k]),
            pixel: self.corners[k],
            sigma_px: self.sigma_px[k],
        })
    }
}

fn check(board: &KnownBoard, camera: &Intrinsics) -> Result<(), BoardPoseError> {
    let mut ids: Vec<u32> = board.tags.iter().map(|t| t.id).collect();
    ids.sort_unstable();
    if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(BoardPoseError::BoardHasIdTwice(pair[0]));
    }
    let sound = |t: &Tag| {
        let c = t.corners_m.map(Point3::from);
        let normal = (c[1] - c[0]).cross(&(c[3] - c[0]));
        c.iter().all(|p| p.coords.iter().all(|v| v.is_finite() && v.abs() < 100.0)) && normal.norm() > 1e-8
    };
    if camera.is_valid() && board.tags.iter().all(sound) { Ok(()) } else { Err(BoardPoseError::Unusable) }
}

fn usable(detections: &[Detection], board: &KnownBoard) -> (Vec<SeenTag>, Vec<(u32, Rejection)>) {
    let mut seen = Vec::new();
    let mut rejected = Vec::new();
    for d in detections {
        let count = detections.iter().filter(|other| other.id == d.id).count();
        let corners = d.corner_sigma_px.iter().filter(|s| s.is_finite()).count();
        match board.tags.iter().find(|t| t.id == d.id) {
            None => rejected.push((d.id, Rejection::NotOnBoard)),
            Some(_) if count > 1 => rejected.push((d.id, Rejection::SeenTwice)),
            Some(_) if corners < 2 => rejected.push((d.id, Rejection::CutOff)),
            Some(&tag) => {
                seen.push(SeenTag { tag, corners: d.corners, sigma_px: d.corner_sigma_px });
            }
        }
    }
    seen.sort_by_key(|s| s.tag.id);
    rejected.sort_by_key(|r| r.0);
    rejected.dedup();
    (seen, rejected)
}

fn nothing_usable(detections: &[Detection], rejected: &[(u32, Rejection)]) -> BoardPoseError {
    if let Some(&(id, _)) = rejected.iter().find(|r| r.1 == Rejection::SeenTwice) {
        return BoardPoseError::SameIdTwice(id);
    }
    if rejected.iter().any(|r| r.1 == Rejection::NotOnBoard) {
        return BoardPoseError::NoneOnBoard(detections.iter().map(|d| d.id).collect());
    }
    BoardPoseError::NoTags
}

/// Refines on the tags that agree, until the same tags agree.
fn consensus(
    seen: &[SeenTag],
    start: Pose,
    camera: &Intrinsics,
    config: &PoseConfig,
) -> Result<(Vec<SeenTag>, Solution), BoardPoseError> {
    let needed = if config.allow_single_tag { 1 } else { 2 };
    let (mut pose, mut agreeing) = (start, Vec::new());
    // The start may be some pixels off at the far end of the board.
    for limit_px in [5.0, 2.0, 1.0, 1.0].map(|f| f * config.max_tag_error_px) {
        agreeing = seen
            .iter()
            .copied()
            .filter(|s| solve::rms_px(s.corners(), &pose, camera).is_some_and(|rms| rms <= limit_px))
            .collect::<Vec<_>>();
        if agreeing.len() < needed {
            return Err(BoardPoseError::TagsDisagree);
        }
        let solution = solve_tags(&agreeing, pose, camera, config).ok_or(BoardPoseError::TagsDisagree)?;
        pose = solution.pose;
    }
    let solution = solve_tags(&agreeing, pose, camera, config).ok_or(BoardPoseError::TagsDisagree)?;
    Ok((agreeing, solution))
}

fn solve_tags(tags: &[SeenTag], start: Pose, camera: &Intrinsics, config: &PoseConfig) -> Option<Solution> {
    let corners: Vec<Corner> = tags.iter().flat_map(SeenTag::corners).collect();
    solve::solve(&corners, start, camera, config.huber_px)
}

/// The better of the two poses that a plane allows, and the other where the corners cannot tell.
fn both_poses(
    tags: &[SeenTag],
    found: &Solution,
    camera: &Intrinsics,
    config: &PoseConfig,
) -> (Solution, Option<Pose>) {
    let corners: Vec<Corner> = tags.iter().flat_map(SeenTag::corners).collect();
    let other = start::flipped(&corners, &found.pose)
        .and_then(|flipped| solve::solve(&corners, flipped, camera, config.huber_px))
        .filter(|other| other.pose.rotation.angle_to(&found.pose.rotation) > 0.01);
    match other {
        None => (found.clone(), None),
        Some(other) => {
            let (best, second) = if other.cost < found.cost { (&other, found) } else { (found, &other) };
            (best.clone(), solve::undecided(best, second).then_some(second.pose))
        }
    }
}

#[cfg(test)]
mod tests;
