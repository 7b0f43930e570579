//! Gauss-Newton on corners: reprojection error with Huber weights, steps on the left of the pose.

use nalgebra::{Matrix6, Point2, Point3, Vector6};

use super::super::projection::{by_left_step, with_derivative};
use crate::camera::Intrinsics;
use crate::pose::{Pose, exp};

/// What every corner is off by beside its own uncertainty: print, lens model, flatness. Pixels.
const COMMON_SIGMA_PX: f64 = 0.1;
/// The residuals' standard deviation is never taken as smaller than this, pixels.
const MIN_SIGMA_PX: f64 = 0.05;
/// Difference of the squared residuals, in variances, from which the better of two poses is certain.
const CERTAIN: f64 = 25.0;
const MAX_ITERATIONS: usize = 30;

/// A corner on the board and in the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) in_board: Point3<f64>,
    pub(super) pixel: Point2<f64>,
    pub(super) sigma_px: f64,
}

impl Corner {
    /// 1 for a corner without uncertainty of its own.
    pub(super) fn weight(&self) -> f64 {
        1.0 / (1.0 + (self.sigma_px / COMMON_SIGMA_PX).powi(2))
    }
}

#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub(super) pose: Pose,
    /// Sum of weighted squared distances with Huber's bend, square pixels.
    pub(super) cost: f64,
    pub(super) rms_px: f64,
    /// Of a step on the left.
    pub(super) covariance: Matrix6<f64>,
    /// Variance of a coordinate, square pixels.
    pub(super) variance: f64,
}

/// Whether the corners cannot tell the second pose from the best.
pub(super) fn undecided(best: &Solution, second: &Solution) -> bool {
    second.cost - best.cost < CERTAIN * best.variance
}

/// Root mean square distance of the corners, pixels; `None` where one is behind the camera or there is none.
pub(super) fn rms_px(
    corners: impl Iterator<Item = Corner>,
    camera_from_board: &Pose,
    camera: &Intrinsics,
) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for c in corners {
        sum += (camera.project(&(camera_from_board * c.in_board))? - c.pixel).norm_squared();
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// The pose of least cost near a start; `None` where the corners do not determine it.
pub(super) fn solve(corners: &[Corner], start: Pose, camera: &Intrinsics, huber_px: f64) -> Option<Solution> {
    if corners.len() < 4 {
        return None;
    }
    let mut pose = start;
    let (mut normal, mut gradient, mut cost) = linearize(corners, &pose, camera, huber_px)?;
    let mut damping = 1e-6;
    for _ in 0..MAX_ITERATIONS {
        let mut damped = normal;
        for k in 0..6 {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step: Vector6<f64> = -damped.cholesky()?.solve(&gradient);
        let next = exp(&step) * pose;
        match linearize(corners, &next, camera, huber_px) {
            Some((n, g, c)) if c <= cost => {
                (pose, normal, gradient, cost) = (next, n, g, c);
                damping *= 0.1;
                if step.norm() < 1e-9 {
                    break;
                }
            }
            _ if damping > 1e6 => break,
            _ => damping = (damping * 10.0).max(1e-6),
        }
    }
    let freedom = (2 * corners.len()).saturating_sub(6).max(1) as f64;
    let variance = (cost / freedom).max(MIN_SIGMA_PX * MIN_SIGMA_PX);
    let covariance = normal.cholesky()?.inverse() * variance;
    let rms_px = rms_px(corners.iter().copied(), &pose, camera)?;
    Some(Solution { pose, cost, rms_px, covariance, variance })
}

/// Normal matrix, gradient (half of the derivative) and cost.
fn linearize(
    corners: &[Corner],
    pose: &Pose,
    camera: &Intrinsics,
    huber_px: f64,
) -> Option<(Matrix6<f64>, Vector6<f64>, f64)> {
    let (mut normal, mut gradient, mut cost) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
    for c in corners {
        let in_camera = pose * c.in_board;
        let (pixel, by_point) = with_derivative(camera, &in_camera)?;
        let residual = pixel - c.pixel;
        let size = residual.norm();
        let bend = if size <= huber_px { 1.0 } else { huber_px / size };
        let squared = if size <= huber_px { size * size } else { huber_px * (2.0 * size - huber_px) };
        let weight = c.weight() * bend;
        let jacobian = by_left_step(&by_point, &in_camera);
        normal += jacobian.transpose() * jacobian * weight;
        gradient += jacobian.transpose() * residual * weight;
        cost += c.weight() * squared;
    }
    cost.is_finite().then_some((normal, gradient, cost))
}
