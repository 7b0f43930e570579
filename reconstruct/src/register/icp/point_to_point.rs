//! One step of point-to-point ICP: the rigid transform of the pairs by SVD (source slide 25).

use super::super::ransac::{Match, consensus};
use super::super::svd::rigid_transform;
use super::{IcpConfig, Pair};
use crate::pose::Pose;

/// The next pose; `None` where the pairs don't determine one.
pub(super) fn step(pairs: &[Pair], pose: &Pose, config: &IcpConfig) -> Option<Pose> {
    let places: Vec<([f32; 3], [f32; 3])> =
        pairs.iter().map(|pair| (pair.p.map(|v| v as f32).into(), pair.q.map(|v| v as f32).into())).collect();
    let mut kept: Vec<usize> = (0..pairs.len()).collect();
    if let Some(ransac) = &config.outlier_ransac {
        let source: Vec<[f32; 3]> = places.iter().map(|p| p.0).collect();
        let target: Vec<[f32; 3]> = places.iter().map(|p| p.1).collect();
        let matches: Vec<Match> = (0..pairs.len()).map(|i| [i, i]).collect();
        if let Some(found) = consensus(&source, &target, &matches, ransac) {
            kept = found.inliers;
        }
    }
    let step = rigid_transform(kept.iter().map(|&i| {
        let residual = (pairs[i].p - pairs[i].q).norm();
        (places[i].0, places[i].1, config.kernel.weight(residual))
    }))?;
    Some(step * pose)
}

/// Mean square distance of the pairs, as they were before the step: Besl and McKay's `d`.
pub(super) fn mean_square(pairs: &[Pair]) -> f64 {
    let sum: f64 = pairs.iter().map(|pair| (pair.p - pair.q).norm_squared()).sum();
    sum / pairs.len().max(1) as f64
}
