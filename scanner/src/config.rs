//! All settings of a build in one place, with their defaults derived from the few things a user says.

use reconstruct::average::AverageConfig;
use reconstruct::calibrate::CalibrationPrior;
use reconstruct::consistency::ConsistencyConfig;
use reconstruct::fuse::FuseConfig;
use reconstruct::marker::{DetectConfig, PoseConfig};
use reconstruct::refine::RefineConfig;
use reconstruct::segment::SegmentConfig;
use reconstruct::surface::SurfaceConfig;

/// Which way the views are brought together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Method {
    /// The accurate way: the board corrects the depth, and all views are fitted together
    #[default]
    Joint,
    /// The source document's chain with its tables, for comparison: key points, FPFH, RANSAC, ICP
    Source,
}

/// Settings of a build.
#[derive(Debug, Clone, Default)]
pub struct Config {
    /// How the views are brought together.
    pub method: Method,
    /// Work without the board even where there is one.
    pub no_board: bool,
    /// Seed of every random choice.
    pub seed: u64,
    /// Averaging of a view's frames.
    pub average: AverageConfig,
    /// Marker detection.
    pub detect: DetectConfig,
    /// Pose on the board.
    pub pose: PoseConfig,
    /// The cut.
    pub segment: SegmentConfig,
    /// Joint refinement.
    pub refine: RefineConfig,
    /// Which views fit.
    pub consistency: ConsistencyConfig,
    /// What is known of this sensor's depth errors from its calibration; none for any Kinect.
    pub depth_prior: Option<CalibrationPrior>,
    /// Fusion.
    pub fuse: FuseConfig,
    /// Surface.
    pub surface: SurfaceConfig,
}
