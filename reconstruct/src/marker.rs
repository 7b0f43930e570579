//! Square markers: published codes, detection with sub-pixel corners, pose of the board.
//!
//! Detection works on one grey picture: threshold by tiles, outlines of black regions, quadrilaterals, edge model
//! fitted to every side, code read through the homography. Corners are in image pixels, (0, 0) = centre of the
//! top-left pixel, in the order top-left, top-right, bottom-right, bottom-left of the upright tag as OpenCV draws it.

mod decode;
mod detect;
mod dictionary;
mod edge;
mod homography;
mod layout;
mod outline;
mod pose;
pub(crate) mod projection;
mod quad;
mod refine;
#[cfg(test)]
mod rendering;
mod tables;
mod threshold;

pub use detect::{DetectConfig, Detection, detect, other_families};
pub use dictionary::{Decoded, Dictionary};
pub use layout::{LayoutConfig, LayoutError, SheetLayout, place_sheets};
pub use pose::{
    BoardPose, BoardPoseError, PoseConfig, Rejection, SeenCorner, board_pose, choose_by_plane,
    explain_no_tags,
};
