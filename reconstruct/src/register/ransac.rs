//! RANSAC over matched points: three pairs, a rigid transform by SVD, as many agreeing pairs as possible (source slide 24).
//!
//! Two triangles can only be one another's image where their edges are as long; that is checked before the SVD, which
//! throws nearly all wrong samples away for nothing. Deterministic by seed.

use nalgebra::{Point3, Vector3};

use super::svd::rigid_transform;
use crate::pose::Pose;

/// A match: index of a source point and of a target point.
pub type Match = [usize; 2];

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RansacConfig {
    /// Samples at most.
    pub iterations: usize,
    /// A pair agrees where it lies this close after the transform, metres.
    pub inlier_distance: f64,
    /// Shortest to longest of two edges that may be one, 0 to 1.
    pub edge_similarity: f64,
    /// Edges shorter than this say nothing about a rotation, metres.
    pub min_edge: f64,
    /// Stop once a better transform is this improbable to have been missed, 0 to 1.
    pub confidence: f64,
    /// Seed of the random choices.
    pub seed: u64,
}

impl Default for RansacConfig {
    fn default() -> Self {
        Self {
            iterations: 100_000,
            inlier_distance: 0.0075,
            edge_similarity: 0.9,
            min_edge: 0.01,
            confidence: 0.999,
            seed: 0,
        }
    }
}

/// The best transform found.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// Least squares over all inliers.
    pub target_from_source: Pose,
    /// Indices into the matches of those that agree, ascending.
    pub inliers: Vec<usize>,
    /// Root mean square distance of the inliers, metres.
    pub inlier_rmse_metres: f64,
    /// Samples drawn.
    pub samples: usize,
    /// Samples that passed the edge check and were solved.
    pub solved: usize,
}

/// The transform that most matches agree with; `None` where no sample of three gives one.
pub fn consensus(
    source: &[[f32; 3]],
    target: &[[f32; 3]],
    matches: &[Match],
    config: &RansacConfig,
) -> Option<Consensus> {
    let pairs: Vec<([f32; 3], [f32; 3])> =
        matches.iter().filter_map(|[s, t]| Some((*source.get(*s)?, *target.get(*t)?))).collect();
    if pairs.len() < 3 || pairs.len() != matches.len() {
        return None;
    }
    let mut rng = fastrand::Rng::with_seed(config.seed);
    let (mut best, mut best_score): (Option<Pose>, _) = (None, (0usize, f64::NEG_INFINITY));
    let (mut samples, mut solved, mut needed) = (0, 0, config.iterations);
    while samples < needed {
        samples += 1;
        let sample = [(); 3].map(|()| pairs[rng.usize(0..pairs.len())]);
        if !edges_agree(&sample, config) {
            continue;
        }
        let Some(pose) = rigid_transform(sample.map(|(p, q)| (p, q, 1.0))) else { continue };
        solved += 1;
        let score = score(&pose, &pairs, config.inlier_distance);
        if score.0 > best_score.0 || (score.0 == best_score.0 && score.1 > best_score.1) {
            best_score = score;
            best = Some(pose);
            needed = samples_needed(score.0, pairs.len(), config).max(samples);
        }
    }
    let pose = polish(best?, &pairs, config.inlier_distance);
    let (inliers, rmse) = inliers(&pose, &pairs, config.inlier_distance);
    Some(Consensus { target_from_source: pose, inliers, inlier_rmse_metres: rmse, samples, solved })
}

/// Whether the three edges are as long in both clouds.
fn edges_agree(sample: &[([f32; 3], [f32; 3]); 3], config: &RansacConfig) -> bool {
    (0..3).all(|i| {
        let (a, b) = (&sample[i], &sample[(i + 1) % 3]);
        let (s, t) = (distance(&a.0, &b.0), distance(&a.1, &b.1));
        s.min(t) >= config.min_edge && s.min(t) >= config.edge_similarity * s.max(t)
    })
}

fn distance(a: &[f32; 3], b: &[f32; 3]) -> f64 {
    f64::from((Vector3::from(*a) - Vector3::from(*b)).norm())
}

fn sq_residual(pose: &Pose, (p, q): &([f32; 3], [f32; 3])) -> f64 {
    (pose * Point3::from(p.map(f64::from)) - Point3::from(q.map(f64::from))).norm_squared()
}

/// Number of inliers, and minus their summed square to decide between equals.
fn score(pose: &Pose, pairs: &[([f32; 3], [f32; 3])], distance: f64) -> (usize, f64) {
    let limit = distance * distance;
    pairs
        .iter()
        .map(|pair| sq_residual(pose, pair))
        .filter(|r| *r <= limit)
        .fold((0, 0.0), |(n, sum), r| (n + 1, sum - r))
}

fn inliers(pose: &Pose, pairs: &[([f32; 3], [f32; 3])], distance: f64) -> (Vec<usize>, f64) {
    let limit = distance * distance;
    let mut sum = 0.0;
    let mut kept = Vec::new();
    for (i, pair) in pairs.iter().enumerate() {
        let r = sq_residual(pose, pair);
        if r <= limit {
            sum += r;
            kept.push(i);
        }
    }
    let rmse = if kept.is_empty() { 0.0 } else { (sum / kept.len() as f64).sqrt() };
    (kept, rmse)
}

/// Least squares over the inliers, while that gains inliers.
fn polish(mut pose: Pose, pairs: &[([f32; 3], [f32; 3])], distance: f64) -> Pose {
    let mut kept = inliers(&pose, pairs, distance).0;
    for _ in 0..5 {
        let Some(next) = rigid_transform(kept.iter().map(|i| (pairs[*i].0, pairs[*i].1, 1.0))) else { break };
        let next_kept = inliers(&next, pairs, distance).0;
        if next_kept.len() < kept.len() {
            break;
        }
        let same = next_kept == kept;
        (pose, kept) = (next, next_kept);
        if same {
            break;
        }
    }
    pose
}

/// Fischler and Bolles (1981): samples until one of inliers alone was drawn with the wanted confidence.
fn samples_needed(inliers: usize, all: usize, config: &RansacConfig) -> usize {
    let good = (inliers as f64 / all as f64).powi(3);
    if good >= 1.0 {
        return 0;
    }
    let needed = (1.0 - config.confidence).ln() / (1.0 - good).ln();
    if needed.is_finite() { (needed.ceil() as usize).min(config.iterations) } else { config.iterations }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::{exp, log};
    use nalgebra::Vector6;

    /// Matches of which `good` follow the truth within 1 mm and the rest are random.
    fn scene(good: usize, bad: usize, truth: &Pose, seed: u64) -> (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<Match>) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut place = || [(); 3].map(|()| rng.f32() * 0.2);
        let source: Vec<[f32; 3]> = (0..good + bad).map(|_| place()).collect();
        let target = source
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let noise = place().map(|v| (v - 0.1) * 0.01);
                if i >= good {
                    return place();
                }
                let q = truth * Point3::from(p.map(f64::from));
                std::array::from_fn(|k| q[k] as f32 + noise[k])
            })
            .collect();
        (source, target, (0..good + bad).map(|i| [i, i]).collect())
    }

    fn check(good: usize, bad: usize, found: bool) {
        let truth = exp(&Vector6::new(0.1, -0.2, 0.3, 0.9, -0.4, 0.2));
        let (source, target, matches) = scene(good, bad, &truth, 7);
        let config = RansacConfig { inlier_distance: 0.003, iterations: 20_000, ..RansacConfig::default() };
        let result = consensus(&source, &target, &matches, &config).expect("enough matches");
        let error = log(&(truth.inverse() * result.target_from_source)).norm();
        assert_eq!(error < 0.02, found, "{good} of {}: {error}", good + bad);
        assert_eq!(result.inliers.iter().filter(|i| **i < good).count() >= good * 9 / 10, found);
        assert_eq!(consensus(&source, &target, &matches, &config), Some(result));
    }

    #[test]
    fn finds_the_motion_among_wrong_matches() {
        check(100, 0, true);
        check(60, 140, true);
        check(30, 270, true);
    }

    #[test]
    fn too_few_matches_or_wrong_indices_give_nothing() {
        let points = [[0.0; 3], [1.0; 3], [0.5; 3]];
        assert!(consensus(&points, &points, &[[0, 0], [1, 1]], &RansacConfig::default()).is_none());
        assert!(consensus(&points, &points, &[[0, 0], [1, 1], [9, 2]], &RansacConfig::default()).is_none());
        // On one line no rotation can be found.
        let config = RansacConfig { iterations: 1000, ..RansacConfig::default() };
        assert!(consensus(&points, &points, &[[0, 0], [1, 1], [2, 2]], &config).is_none());
    }

    #[test]
    fn stops_early_when_all_agree() {
        let truth = Pose::identity();
        let (source, target, matches) = scene(80, 0, &truth, 1);
        let result = consensus(&source, &target, &matches, &RansacConfig::default()).unwrap();
        assert!(result.samples < 200, "{}", result.samples);
    }
}
