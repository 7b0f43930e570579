//! Iterative closest point: pair every source point with its nearest target point, move, repeat (Besl and McKay 1992).
//!
//! Metrics: point-to-point with SVD as in the source (slide 25, there with a RANSAC over the pairs), point-to-plane
//! (Chen and Medioni 1992), symmetric (Rusinkiewicz 2019), each of the last two with colour (Park 2017) or without.
//! Source and target may be in any frames; `target_from_source`, metres. Sums run in chunks of fixed size, so the result does
//! not depend on the number of threads.

mod linear;
mod point_to_point;

use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use rayon::prelude::*;
use thiserror::Error;

use super::extrapolate::Extrapolation;
use super::gradient::{ColorGradient, color_gradients};
use super::kernel::Kernel;
use super::ransac::RansacConfig;
use crate::cloud::PointCloud;
use crate::knn::Tree;
use crate::pose::{Pose, exp, log};

/// Points a parallel task sums up; fixed, so that sums always run in the same order.
const CHUNK: usize = 512;

/// Why two clouds can't be registered.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum IcpError {
    /// A cloud with fewer points than determine a motion.
    #[error("the {cloud} cloud has {found} points, {needed} are needed")]
    TooFewPoints {
        /// `source` or `target`.
        cloud: &'static str,
        /// Points there.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// The metric needs normals which the cloud has not.
    #[error("the {0} cloud has no normals")]
    NoNormals(&'static str),
    /// The colour term needs colours which the cloud has not.
    #[error("the {0} cloud has no colours")]
    NoColors(&'static str),
    /// The start is not a finite transform.
    #[error("the starting transform is not finite")]
    BadStart,
}

/// What is made small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Metric {
    /// Distance between the points.
    PointToPoint,
    /// Distance from the target point's tangent plane.
    PointToPlane,
    /// Distance along the mean of both normals.
    Symmetric,
}

/// How to register.
#[derive(Debug, Clone, PartialEq)]
pub struct IcpConfig {
    /// What is made small.
    pub metric: Metric,
    /// Pairs farther apart are no pairs, metres.
    pub max_distance: f32,
    /// Pairs whose normals' cosine is lower are no pairs (where both clouds have normals).
    pub min_normal_cosine: Option<f32>,
    /// Robust kernel on the geometric residual, metres.
    pub kernel: Kernel,
    /// Standard deviation of a geometric residual, metres: weighs geometry against colour.
    pub sigma_metres: f64,
    /// Standard deviation of a colour channel (0 to 1) where colour is used; needs a [`Target::with_colors`].
    pub sigma_color: Option<f64>,
    /// Every how many-th source point is used while iterating; the result is always judged on all.
    pub stride: usize,
    /// Iterations at most.
    pub iterations: usize,
    /// Converged when a step moves the source by less than this, metres.
    pub tolerance_metres: f64,
    /// Point-to-point only: drop outlier pairs by RANSAC as the source does.
    pub outlier_ransac: Option<RansacConfig>,
    /// Point-to-point only: Besl and McKay's extrapolation.
    pub extrapolate: bool,
}

impl Default for IcpConfig {
    fn default() -> Self {
        Self {
            metric: Metric::PointToPlane,
            max_distance: 0.01,
            min_normal_cosine: Some(0.75),
            kernel: Kernel::LeastSquares,
            sigma_metres: 0.001,
            sigma_color: None,
            stride: 1,
            iterations: 50,
            tolerance_metres: 2e-6,
            outlier_ransac: None,
            extrapolate: false,
        }
    }
}

/// Result of a registration.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// Carries source points to target points.
    pub target_from_source: Pose,
    /// Share of source points that have a pair, 0 to 1.
    pub fitness: f64,
    /// Root mean square residual of the pairs along the metric (distance between points for point-to-point), metres.
    pub inlier_rmse_metres: f64,
    /// Iterations done.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
    /// `JᵀJ` of the whitened residuals for a left twist `(translation, rotation)` of `target_from_source`.
    pub information: Matrix6<f64>,
}

/// What registration needs of the fixed cloud, built once.
#[derive(Debug)]
pub struct Target<'a> {
    /// The cloud.
    pub cloud: &'a PointCloud,
    /// Its search tree.
    pub tree: Tree,
    gradients: Vec<ColorGradient>,
}

impl<'a> Target<'a> {
    /// A target for geometry alone.
    pub fn new(cloud: &'a PointCloud) -> Self {
        Self { cloud, tree: Tree::new(&cloud.points), gradients: Vec::new() }
    }

    /// A target with colour gradients over neighbours within `radius` metres.
    pub fn with_colors(cloud: &'a PointCloud, radius: f32) -> Self {
        let tree = Tree::new(&cloud.points);
        let gradients = color_gradients(cloud, &tree, radius);
        Self { cloud, tree, gradients }
    }
}

/// A source point and its target, with what the metrics need.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Source point, moved into the target's frame.
    p: Vector3<f64>,
    /// Target point.
    q: Vector3<f64>,
    source: usize,
    target: usize,
}

/// Moves `source` onto `target`, starting at `start`.
pub fn register(
    source: &PointCloud,
    target: &Target<'_>,
    start: &Pose,
    config: &IcpConfig,
) -> Result<Registration, IcpError> {
    check_input(source, target, start, config)?;
    let extent = source_extent(source);
    let mut pose = *start;
    let mut extrapolation = Extrapolation::default();
    let (mut iterations, mut converged) = (0, false);
    while iterations < config.iterations && !converged {
        let pairs = pair_up(source, target, &pose, config, config.stride.max(1));
        let next = match config.metric {
            Metric::PointToPoint => point_to_point::step(&pairs, &pose, config),
            Metric::PointToPlane | Metric::Symmetric => {
                linear::step(&pairs, source, target, &pose, config).map(|step| exp(&step) * pose)
            }
        };
        let Some(next) = next else { break };
        iterations += 1;
        let moved = motion(&pose, &next, &extent);
        converged = moved.norm() < config.tolerance_metres;
        pose = next;
        if config.extrapolate && config.metric == Metric::PointToPoint && !converged {
            let factor = extrapolation.factor(&moved, point_to_point::mean_square(&pairs));
            if factor > 1.0 {
                pose = lengthen(&moved, factor - 1.0, &extent) * pose;
            }
        }
    }
    pose.rotation.renormalize();
    let (fitness, inlier_rmse_metres, information) = judge(source, target, &pose, config);
    Ok(Registration {
        target_from_source: pose,
        fitness,
        inlier_rmse_metres,
        iterations,
        converged,
        information,
    })
}

/// Registers in several rounds, coarse to fine, each starting where the last one ended; iterations are summed up.
pub fn register_in_rounds(
    source: &PointCloud,
    target: &Target<'_>,
    start: &Pose,
    rounds: &[IcpConfig],
) -> Result<Registration, IcpError> {
    let (mut pose, mut iterations, mut last) = (*start, 0, None);
    for config in rounds {
        let result = register(source, target, &pose, config)?;
        pose = result.target_from_source;
        iterations += result.iterations;
        last = Some(result);
    }
    match last {
        Some(result) => Ok(Registration { iterations, ..result }),
        None => register(source, target, start, &IcpConfig { iterations: 0, ..IcpConfig::default() }),
    }
}

/// Share of the source points with a pair, residual and information at a given transform.
pub fn evaluate(
    source: &PointCloud,
    target: &Target<'_>,
    pose: &Pose,
    config: &IcpConfig,
) -> Result<Registration, IcpError> {
    register(source, target, pose, &IcpConfig { iterations: 0, ..config.clone() })
}

fn check_input(
    source: &PointCloud,
    target: &Target<'_>,
    start: &Pose,
    config: &IcpConfig,
) -> Result<(), IcpError> {
    const NEEDED: usize = 6;
    for (cloud, name) in [(source, "source"), (target.cloud, "target")] {
        if cloud.len() < NEEDED {
            return Err(IcpError::TooFewPoints { cloud: name, found: cloud.len(), needed: NEEDED });
        }
    }
    if config.metric != Metric::PointToPoint && !target.cloud.has_normals() {
        return Err(IcpError::NoNormals("target"));
    }
    if config.metric == Metric::Symmetric && !source.has_normals() {
        return Err(IcpError::NoNormals("source"));
    }
    if config.sigma_color.is_some() && config.metric != Metric::PointToPoint {
        if !source.has_colors() {
            return Err(IcpError::NoColors("source"));
        }
        if target.gradients.len() != target.cloud.len() {
            return Err(IcpError::NoColors("target"));
        }
    }
    if log(start).iter().all(|v| v.is_finite()) { Ok(()) } else { Err(IcpError::BadStart) }
}

/// Centre and radius of the source, to measure rotations in metres.
struct Extent {
    centre: Point3<f64>,
    radius: f64,
}

fn source_extent(source: &PointCloud) -> Extent {
    let finite = PointCloud {
        points: source.points.iter().copied().filter(|p| p.iter().all(|v| v.is_finite())).collect(),
        ..PointCloud::default()
    };
    let (lo, hi) = finite.bounds().unwrap_or_default();
    let (lo, hi) = (Vector3::from(lo.map(f64::from)), Vector3::from(hi.map(f64::from)));
    Extent { centre: ((lo + hi) / 2.0).into(), radius: ((hi - lo).norm() / 2.0).max(1e-9) }
}

/// How the source moved between two poses: of its centre, and of its rim by rotation, metres.
fn motion(before: &Pose, after: &Pose, extent: &Extent) -> Vector6<f64> {
    let centre = after * extent.centre - before * extent.centre;
    let turn = (after.rotation * before.rotation.inverse()).scaled_axis() * extent.radius;
    Vector6::new(centre.x, centre.y, centre.z, turn.x, turn.y, turn.z)
}

/// The motion times a factor, as a transform in the target's frame around where the centre is now.
fn lengthen(moved: &Vector6<f64>, factor: f64, extent: &Extent) -> Pose {
    let mut twist = moved * factor;
    twist.fixed_rows_mut::<3>(3).scale_mut(1.0 / extent.radius);
    exp(&twist)
}

/// Nearest neighbours within reach and, where both have normals, facing alike.
fn pair_up(
    source: &PointCloud,
    target: &Target<'_>,
    pose: &Pose,
    config: &IcpConfig,
    stride: usize,
) -> Vec<Pair> {
    let normals = config.min_normal_cosine.filter(|_| source.has_normals() && target.cloud.has_normals());
    let count = source.len().div_ceil(stride);
    let chunks: Vec<Vec<Pair>> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            (chunk * CHUNK..((chunk + 1) * CHUNK).min(count))
                .filter_map(|i| {
                    let source_index = i * stride;
                    let p = pose * Point3::from(source.points[source_index].map(f64::from));
                    let found = target
                        .tree
                        .nearest_within(&p.coords.map(|v| v as f32).into(), config.max_distance)?;
                    if let Some(cosine) = normals {
                        let n = pose.rotation * Vector3::from(source.normals[source_index].map(f64::from));
                        let m = Vector3::from(target.cloud.normals[found.index].map(f64::from));
                        if n.dot(&m) < f64::from(cosine) {
                            return None;
                        }
                    }
                    let q = Vector3::from(target.cloud.points[found.index].map(f64::from));
                    Some(Pair { p: p.coords, q, source: source_index, target: found.index })
                })
                .collect()
        })
        .collect();
    chunks.concat()
}

/// Fitness, residual and information over all source points.
fn judge(
    source: &PointCloud,
    target: &Target<'_>,
    pose: &Pose,
    config: &IcpConfig,
) -> (f64, f64, Matrix6<f64>) {
    let pairs = pair_up(source, target, pose, config, 1);
    let sums = linear::sums(&pairs, source, target, pose, config);
    let fitness = pairs.len() as f64 / source.len() as f64;
    let rmse = if pairs.is_empty() { 0.0 } else { (sums.square / pairs.len() as f64).sqrt() };
    (fitness, rmse, sums.hessian)
}

#[cfg(test)]
mod tests;
