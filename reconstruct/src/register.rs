//! Registration of clouds: the stages of the source document (slides 18–26) and the better choices.
//!
//! Voxel grid → normals → key points of large curvature → FPFH → nearest matches → RANSAC of three samples with SVD → ICP.
//! Every stage can be called alone; transforms are `target_from_source`, lengths metres.

pub mod extrapolate;
pub mod fine;
pub mod flip;
pub mod fpfh;
pub mod global;
pub mod gradient;
pub mod graph;
pub mod icp;
pub mod kernel;
pub mod keypoints;
pub mod link;
pub mod matching;
mod near_field;
pub mod pairwise;
pub mod plane;
pub mod ransac;
pub mod source_chain;
pub mod stills;
pub mod surfel;
pub mod svd;
pub mod verify;
pub mod view;
