//! What every stage of the source's chain did, in the terms of its tables (slides 31–33).

use serde::{Deserialize, Serialize};

/// Counts and errors of the whole chain. Lengths in metres.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SourceReport {
    /// Points of the first view, which starts the model.
    pub points_first_view: usize,
    /// One entry a further view, in order.
    pub pairs: Vec<PairReport>,
    /// Points of the model at the end.
    pub points_model: usize,
}

impl SourceReport {
    /// ICP iterations of all pairs (the source's "Number of Iteration").
    pub fn icp_iterations(&self) -> usize {
        self.pairs.iter().map(|pair| pair.icp_iterations).sum()
    }

    /// Largest ICP error of all pairs, metres (the source's "Minimized Error"); `None` where no pair got so far.
    pub fn worst_icp_rmse_metres(&self) -> Option<f64> {
        self.pairs.iter().filter(|p| p.failure.is_none()).map(|p| p.icp_rmse_metres).reduce(f64::max)
    }
}

/// One view against the model so far. Lengths in metres.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PairReport {
    /// The view's name.
    pub view: String,
    /// Points of the view.
    pub points: usize,
    /// Points of the model before this view.
    pub model_points: usize,
    /// Points of the view after the voxel grid.
    pub points_down_sampled: usize,
    /// Points of the model after the voxel grid.
    pub model_points_down_sampled: usize,
    /// Key points of the view.
    pub key_points: usize,
    /// Key points of the model.
    pub model_key_points: usize,
    /// Nearest matches of FPFH.
    pub matches: usize,
    /// Samples of three that RANSAC drew.
    pub ransac_samples: usize,
    /// Matches that agree with the best.
    pub ransac_inliers: usize,
    /// Root mean square distance of these.
    pub ransac_rmse_metres: f64,
    /// Iterations of ICP.
    pub icp_iterations: usize,
    /// Whether ICP reached its acceptable error.
    pub icp_converged: bool,
    /// Root mean square distance of the key points that ICP paired at the end.
    pub icp_rmse_metres: f64,
    /// Share of the view's key points that it paired.
    pub icp_fitness: f64,
    /// How far the view's centre was moved from its marker pose.
    pub moved_metres: f64,
    /// By how much it was turned.
    pub turned_radians: f64,
    /// Why the view kept its marker pose, where it did.
    pub failure: Option<String>,
}
