//! The board's plane in a view's depth: white pixels of the paper lie at z = 0 of the world.
//!
//! Residual in pixels of disparity: what the view reads, corrected, less the plane's disparity from the view's pose.

use nalgebra::{Point2, Vector3};

use super::DepthModel;
use super::system::{Row, ViewBlock};
use crate::calibrate::{BoardSample, CORRELATED_PIXELS, TERMS, basis};
use crate::camera::Intrinsics;
use crate::pose::Pose;

/// Board pixels of a view that are looked at.
const MOST_SAMPLES: usize = 600;
/// Residuals of this many standard deviations count half (Geman-McClure).
const SCALE_SIGMAS: f64 = 2.5;

/// Adds a view's board pixels to its block; gives how many were looked at.
pub(super) fn add(
    block: &mut ViewBlock,
    samples: &[BoardSample],
    world_from_camera: &Pose,
    camera: &Intrinsics,
    depth: &DepthModel,
    step: &[f64; TERMS],
) -> usize {
    let stride = samples.len().div_ceil(MOST_SAMPLES).max(1);
    let looked_at = samples.len().div_ceil(stride);
    // Pixels that were left out speak through those that were not; neighbours err alike.
    let share = samples.len() as f64 / looked_at.max(1) as f64;
    let sigma = depth.residual_px;
    let information = share / (sigma * sigma * CORRELATED_PIXELS);
    let t = world_from_camera.translation.vector;
    for sample in samples.iter().step_by(stride) {
        let (pixel, measured) = (sample.pixel.map(f64::from), f64::from(sample.measured_px));
        let terms = basis(pixel[0], pixel[1], measured, depth.half);
        let corrected = measured + terms.iter().zip(step).map(|(b, s)| b * s).sum::<f64>();
        let on_one = camera.ray(&Point2::from(pixel));
        let ray = world_from_camera.rotation * Vector3::new(on_one.x, on_one.y, 1.0);
        let expected = -depth.focal_baseline * ray.z / t.z;
        let residual = corrected - expected;
        if !residual.is_finite() {
            continue;
        }
        // expected = -fb r_z / t_z; a left step (s, w) moves r by w x r and t by s + w x t.
        let (by_ray, by_place) = (depth.focal_baseline / t.z, expected / t.z);
        let row = Row {
            by_pose: [
                0.0,
                0.0,
                by_place,
                by_ray * ray.y + by_place * t.y,
                -by_ray * ray.x - by_place * t.x,
                0.0,
            ],
            by_depth: terms,
        };
        let weight = information * (1.0 + (residual / (SCALE_SIGMAS * sigma)).powi(2)).powi(-2);
        block.add(&row.flat(), residual, weight);
    }
    looked_at
}
