//! Joint refinement of all views: one Gauss–Newton over every pose, in the world (board) frame.
//!
//! Residuals: symmetric point-to-plane between overlapping views (Rusinkiewicz 2019), found by projection, and each
//! view's marker pose as a prior with its covariance. The prior stands **inside** the cost, so that directions the
//! surfaces do not hold (a bottle turned about its axis) are held by the markers and cannot slide.

use std::ops::AddAssign;

use nalgebra::{DMatrix, DVector, Matrix6, Point3, Vector3, Vector6};
use rayon::prelude::*;

use crate::pose::{self, Pose};
use crate::view::DepthView;

/// Settings of the refinement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineConfig {
    /// Points of a view that look for partners in each other view.
    pub points_per_pair: usize,
    /// Each view is tied to this many others.
    pub neighbours: usize,
    /// Rounds of finding partners anew, each with one Gauss–Newton step.
    pub rounds: usize,
    /// Partners farther apart than this are none, metres, in the first and the last round.
    pub gate_metres: [f64; 2],
    /// Least cosine between the normals of partners.
    pub min_normal_cosine: f64,
    /// Standard deviation of a point's distance to its partner's plane, metres.
    pub sigma_metres: f64,
    /// Neighbouring points err alike: a pair of views never counts more than this many independent points.
    pub independent_points: f64,
}

impl Default for RefineConfig {
    fn default() -> Self {
        Self {
            points_per_pair: 1200,
            neighbours: 6,
            rounds: 6,
            gate_metres: [0.010, 0.004],
            min_normal_cosine: 0.8,
            sigma_metres: 0.001,
            independent_points: 40.0,
        }
    }
}

/// What is known of a view's pose before its surface is looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct PosePrior {
    /// Where the markers put the camera.
    pub world_from_camera: Pose,
    /// Inverse covariance of a left step `exp(step) * world_from_camera`, order translation, rotation; world frame.
    pub information: Matrix6<f64>,
}

impl PosePrior {
    /// Prior of a marker pose: `covariance` is of a left step on `camera_from_world`, camera frame.
    ///
    /// A left step d on `camera_from_world` is the left step `-Ad(world_from_camera) d` on its inverse.
    pub fn from_marker_pose(camera_from_world: &Pose, covariance: &Matrix6<f64>) -> Self {
        let world_from_camera = camera_from_world.inverse();
        let adjoint = adjoint(&world_from_camera);
        // No marker pose is better than this: print, paper and lens have errors the corners do not show.
        let floor =
            Matrix6::from_diagonal(&Vector6::new(1e-4, 1e-4, 1e-4, 2e-4, 2e-4, 2e-4).map(|s: f64| s * s));
        let in_world = adjoint * covariance * adjoint.transpose() + floor;
        Self { world_from_camera, information: in_world.try_inverse().unwrap_or_else(Matrix6::zeros) }
    }
}

/// Adjoint of a pose for twists in the order translation, rotation.
fn adjoint(a_from_b: &Pose) -> Matrix6<f64> {
    let rotation = a_from_b.rotation.to_rotation_matrix().into_inner();
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&(a_from_b.translation.vector.cross_matrix() * rotation));
    out
}

/// Refined poses and how well they fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Poses in the order of the views.
    pub world_from_camera: Vec<Pose>,
    /// Covariances of left steps on them, world frame.
    pub covariance: Vec<Matrix6<f64>>,
    /// Agreement of the pairs that share surface.
    pub pairs: Vec<PairFit>,
}

/// How the surfaces of two views agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairFit {
    /// The view whose points looked for partners.
    pub source: usize,
    /// The view in which they were looked for.
    pub target: usize,
    /// Points that have a partner.
    pub inliers: usize,
    /// Root mean square distance to the partner's plane, metres.
    pub inlier_rmse_metres: f64,
}

/// Refines the poses of all views together; `priors` are in the order of `views`.
pub fn refine(views: &[&DepthView], priors: &[PosePrior], config: &RefineConfig) -> Refined {
    let mut poses: Vec<Pose> = priors.iter().map(|p| p.world_from_camera).collect();
    let samples: Vec<Vec<usize>> = views.iter().map(|v| spread_samples(v, config.points_per_pair)).collect();
    let pairs = choose_pairs(&poses, config.neighbours);
    let mut fits = Vec::new();
    let mut normal = DMatrix::zeros(0, 0);
    for round in 0..config.rounds {
        let t = round as f64 / (config.rounds.max(2) - 1) as f64;
        let gate = config.gate_metres[0] * (1.0 - t) + config.gate_metres[1] * t;
        let blocks: Vec<PairBlock> = pairs
            .par_iter()
            .map(|&(i, j)| linearise(views, &poses, &samples[i], (i, j), gate, config))
            .collect();
        fits = blocks.iter().map(|b| b.fit).collect();
        let right;
        (normal, right) = assemble(&blocks, priors, &poses);
        let Some(step) = normal.clone().cholesky().map(|c| c.solve(&right)) else { break };
        for (i, pose) in poses.iter_mut().enumerate() {
            *pose = pose::exp(&step.fixed_rows::<6>(6 * i).into_owned()) * *pose;
        }
        if step.amax() < 1e-6 {
            break;
        }
    }
    let inverse = normal.clone().cholesky().map(|c| c.inverse());
    let block = |i: usize| {
        inverse.as_ref().map_or_else(Matrix6::zeros, |m| m.fixed_view::<6, 6>(6 * i, 6 * i).into_owned())
    };
    Refined { covariance: (0..poses.len()).map(block).collect(), world_from_camera: poses, pairs: fits }
}

/// Product pixels of a view, evenly taken.
fn spread_samples(view: &DepthView, count: usize) -> Vec<usize> {
    let all: Vec<usize> = view.product_pixels().filter(|&i| view.incidence_cosine(i) > 0.3).collect();
    let stride = (all.len() / count.max(1)).max(1);
    all.into_iter().step_by(stride).collect()
}

/// Ordered pairs of views that look at the product from the nearest sides.
fn choose_pairs(poses: &[Pose], neighbours: usize) -> Vec<(usize, usize)> {
    let towards = |p: &Pose| p.translation.vector.normalize();
    let mut pairs = Vec::new();
    for (i, a) in poses.iter().enumerate() {
        let mut others: Vec<(f64, usize)> = poses
            .iter()
            .enumerate()
            .filter(|&(j, _)| j != i)
            .map(|(j, b)| (towards(a).dot(&towards(b)), j))
            .filter(|&(cosine, _)| cosine > -0.2)
            .collect();
        others.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        pairs.extend(others.into_iter().take(neighbours).map(|(_, j)| (i, j)));
    }
    pairs
}

/// Contribution of one pair to the normal equations.
struct PairBlock {
    /// `J^T J` of the 12 parameters (source step, target step).
    hessian: nalgebra::SMatrix<f64, 12, 12>,
    gradient: nalgebra::SVector<f64, 12>,
    fit: PairFit,
}

/// Finds partners of the source's samples in the target by projection and linearises their distances.
fn linearise(
    views: &[&DepthView],
    poses: &[Pose],
    samples: &[usize],
    (i, j): (usize, usize),
    gate_metres: f64,
    config: &RefineConfig,
) -> PairBlock {
    let (source, target) = (views[i], views[j]);
    let target_from_source = poses[j].inverse() * poses[i];
    let mut hessian = nalgebra::SMatrix::<f64, 12, 12>::zeros();
    let mut gradient = nalgebra::SVector::<f64, 12>::zeros();
    let (mut inliers, mut squares) = (0usize, 0.0f64);
    for &s in samples {
        let p_in_source = Point3::from(source.points[s]).cast::<f64>();
        let Some(t) = target.pixel_of(&(target_from_source * p_in_source)) else { continue };
        if !target.mask[t] || target.normals[t] == [0.0; 3] {
            continue;
        }
        let p = poses[i] * p_in_source;
        let q = poses[j] * Point3::from(target.points[t]).cast::<f64>();
        let n_p = poses[i].rotation * Vector3::from(source.normals[s]).cast::<f64>();
        let n_q = poses[j].rotation * Vector3::from(target.normals[t]).cast::<f64>();
        if n_p.dot(&n_q) < config.min_normal_cosine || (p - q).norm() > 2.0 * gate_metres {
            continue;
        }
        // Rusinkiewicz 2019, eq. 9: distance along the sum of both normals
        let n = (n_p + n_q).normalize();
        let r = n.dot(&(p - q));
        if r.abs() > gate_metres {
            continue;
        }
        inliers += 1;
        squares += r * r;
        // Geman–McClure weight
        let scale = 2.5 * config.sigma_metres;
        let weight = (1.0 / (1.0 + (r / scale).powi(2))).powi(2);
        // d(exp(step) p)/d(step) = [I, -p x]: n·(t + w × p) = n·t + (p × n)·w
        let (a, b) = (p.coords.cross(&n), q.coords.cross(&n));
        let row = nalgebra::SVector::<f64, 12>::from_row_slice(&[
            n.x, n.y, n.z, a.x, a.y, a.z, -n.x, -n.y, -n.z, -b.x, -b.y, -b.z,
        ]);
        hessian += weight * row * row.transpose();
        gradient -= weight * r * row;
    }
    let dilution = (config.independent_points / inliers.max(1) as f64).min(1.0);
    let scale = dilution / (config.sigma_metres * config.sigma_metres);
    let rmse = (squares / inliers.max(1) as f64).sqrt();
    PairBlock {
        hessian: hessian * scale,
        gradient: gradient * scale,
        fit: PairFit { source: i, target: j, inliers, inlier_rmse_metres: rmse },
    }
}

/// Normal equations of all pairs and priors, summed in the order of the pairs.
fn assemble(blocks: &[PairBlock], priors: &[PosePrior], poses: &[Pose]) -> (DMatrix<f64>, DVector<f64>) {
    let n = 6 * poses.len();
    let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for block in blocks {
        let at = [6 * block.fit.source, 6 * block.fit.target];
        for (bi, &i) in at.iter().enumerate() {
            let g = block.gradient.fixed_rows::<6>(6 * bi);
            right.fixed_rows_mut::<6>(i).add_assign(&g);
            for (bj, &j) in at.iter().enumerate() {
                let h = block.hessian.fixed_view::<6, 6>(6 * bi, 6 * bj);
                normal.fixed_view_mut::<6, 6>(i, j).add_assign(&h);
            }
        }
    }
    for (i, prior) in priors.iter().enumerate() {
        let off = pose::log(&(poses[i] * prior.world_from_camera.inverse()));
        normal.fixed_view_mut::<6, 6>(6 * i, 6 * i).add_assign(&prior.information);
        right.fixed_rows_mut::<6>(6 * i).add_assign(&(-(prior.information * off)));
    }
    (normal, right)
}
