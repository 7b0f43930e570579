//! Depth calibration inside the scan: the board is flat and its place is known from its markers, so its own pixels
//! tell how the depth camera errs.
//!
//! Model, in disparity (pixels) with image coordinates x, y scaled to -1..1:
//! `d' = d (1 + a) + c0 + c1 x + c2 y + c3 x² + c4 y² + c5 xy + cubic terms`. One set for all views. Maximum a posteriori:
//! every coefficient has a prior, so that what the views do not show (an orbit at one height cannot tell scale from
//! offset) stays near what sensors usually do instead of running away.

use nalgebra::{Point2, SMatrix, SVector};
use rayon::prelude::*;

use crate::average::DisparityMap;
use crate::camera::Intrinsics;
use crate::pose::Pose;

/// Number of coefficients: scale, constant, 2 linear, 3 quadratic, 4 cubic terms.
pub const TERMS: usize = 11;

/// Prior standard deviations: what Kinects are seen to do (a few percent of scale, a few tenths of a pixel of warp).
const PRIOR_SD: [f64; TERMS] = [0.03, 0.25, 0.15, 0.15, 0.12, 0.12, 0.12, 0.06, 0.06, 0.06, 0.06];

/// How far a sensor drifts from its calibration: some tenths of a percent of scale, hundredths of a pixel of warp.
const DRIFT_SD: [f64; TERMS] = [0.003, 0.04, 0.02, 0.02, 0.02, 0.02, 0.02, 0.01, 0.01, 0.01, 0.01];

/// Neighbouring pixels err alike, all pixels of a view share its pose's error, and cameras are never quite as modelled:
/// this many pixels tell as much as one independent one.
pub(crate) const CORRELATED_PIXELS: f64 = 400.0;

/// Rounds of fitting and trimming.
const ROUNDS: usize = 6;
/// Samples that are summed by themselves before the sums are: whatever the number of threads, in the same order.
const CHUNK: usize = 4096;

/// A correction of disparity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthCalibration {
    /// `a, c0..`: see the module's head.
    pub coefficients: [f64; TERMS],
    /// Standard deviations of the coefficients.
    pub standard_deviations: [f64; TERMS],
    /// Board pixels that took part.
    pub samples: usize,
    /// Residual on the board, pixels of disparity, robust standard deviation.
    pub residual_px: f64,
    /// Median depth error on the board before and after, metres (positive: reads too far).
    pub error_metres: [f64; 2],
    /// Half the image size, for scaling coordinates.
    half: [f64; 2],
}

/// What is known of a sensor's errors before the scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationPrior {
    /// `a, c0..`: see the module's head.
    pub coefficients: [f64; TERMS],
    /// How far they may be off.
    pub standard_deviations: [f64; TERMS],
}

impl CalibrationPrior {
    /// What Kinects are seen to do, each of its own.
    pub fn of_any_kinect() -> Self {
        Self { coefficients: [0.0; TERMS], standard_deviations: PRIOR_SD }
    }

    /// What one sensor did when it was calibrated: it drifts with its temperature, so that much stays open.
    pub fn of_this_sensor(coefficients: [f64; TERMS], standard_deviations: [f64; TERMS]) -> Self {
        let with_drift = |i: usize| standard_deviations[i].hypot(DRIFT_SD[i]).min(PRIOR_SD[i]);
        Self { coefficients, standard_deviations: std::array::from_fn(with_drift) }
    }
}

/// One board pixel: where, what was measured, what the markers say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardSample {
    /// Pixel.
    pub pixel: [f32; 2],
    /// Measured disparity, pixels.
    pub measured_px: f32,
    /// Disparity of the board's plane there, pixels.
    pub expected_px: f32,
}

impl DepthCalibration {
    /// Changes nothing.
    pub fn identity(width: usize, height: usize) -> Self {
        Self {
            coefficients: [0.0; TERMS],
            standard_deviations: PRIOR_SD,
            samples: 0,
            residual_px: 0.0,
            error_metres: [0.0; 2],
            half: [width as f64 / 2.0, height as f64 / 2.0],
        }
    }

    /// What is believed before a scan shows anything.
    pub fn from_prior(prior: &CalibrationPrior, width: usize, height: usize) -> Self {
        Self {
            coefficients: prior.coefficients,
            standard_deviations: prior.standard_deviations,
            ..Self::identity(width, height)
        }
    }

    /// Corrected disparity of a pixel.
    pub fn correct(&self, u: f64, v: f64, disparity_px: f64) -> f64 {
        let terms = basis(u, v, disparity_px, self.half);
        disparity_px + terms.iter().zip(&self.coefficients).map(|(t, c)| t * c).sum::<f64>()
    }

    /// Corrects a whole map in place.
    pub fn apply(&self, map: &mut DisparityMap) {
        let width = map.width.max(1);
        for (i, d) in map.disparity_px.iter_mut().enumerate().filter(|(_, d)| **d > 0.0) {
            *d = self.correct((i % width) as f64, (i / width) as f64, f64::from(*d)).max(1e-3) as f32;
        }
    }

    /// Corrects what was measured at board pixels.
    pub fn apply_to_samples(&self, samples: &mut [BoardSample]) {
        for s in samples {
            let corrected =
                self.correct(f64::from(s.pixel[0]), f64::from(s.pixel[1]), f64::from(s.measured_px));
            s.measured_px = corrected as f32;
        }
    }

    /// The correction that first does this one, then another's coefficients: the terms are closed under that.
    pub fn then(&self, step: &[f64; TERMS]) -> Self {
        let with_step = |i: usize| match i {
            0 => (1.0 + self.coefficients[0]) * (1.0 + step[0]) - 1.0,
            _ => self.coefficients[i] * (1.0 + step[0]) + step[i],
        };
        Self { coefficients: std::array::from_fn(with_step), ..*self }
    }

    /// A correction of the same pictures by these coefficients alone.
    pub fn only(&self, coefficients: &[f64; TERMS]) -> Self {
        Self { coefficients: *coefficients, ..*self }
    }

    /// Half the image's size, by which pixels are scaled to -1..1.
    pub(crate) fn half(&self) -> [f64; 2] {
        self.half
    }

    /// Factor from measured to corrected depth, from the scale term alone.
    pub fn depth_scale(&self) -> f64 {
        1.0 / (1.0 + self.coefficients[0])
    }
}

/// What each coefficient adds to the disparity `d` of pixel (u, v): the correction's derivative.
pub(crate) fn basis(u: f64, v: f64, d: f64, half: [f64; 2]) -> [f64; TERMS] {
    let (x, y) = ((u - half[0]) / half[0], (v - half[1]) / half[1]);
    [d, 1.0, x, y, x * x, y * y, x * y, x * x * x, x * x * y, x * y * y, y * y * y]
}

/// Disparity at which a pixel's ray meets the board's plane z = 0; `None` where it does not, in front of the camera.
pub fn board_disparity(
    camera: &Intrinsics,
    world_from_camera: &Pose,
    pixel: [f64; 2],
    focal_baseline: f64,
) -> Option<f64> {
    let ray = camera.ray(&Point2::new(pixel[0], pixel[1]));
    let direction = world_from_camera.rotation * nalgebra::Vector3::new(ray.x, ray.y, 1.0);
    let depth = -world_from_camera.translation.z / direction.z;
    (depth.is_finite() && depth > 0.1).then(|| focal_baseline / depth)
}

/// Fits the calibration to board pixels, trimming what does not lie on the board.
///
/// `width`, `height` are the image's. With too few samples the prior comes back.
pub fn fit(
    samples: &[BoardSample],
    width: usize,
    height: usize,
    prior: &CalibrationPrior,
) -> DepthCalibration {
    let believed = DepthCalibration::from_prior(prior, width, height);
    let mut calibration = believed;
    if samples.len() < 500 {
        return calibration;
    }
    let mut residuals = residuals_of(samples, &calibration);
    let mut gate = f64::INFINITY;
    for _ in 0..ROUNDS {
        let Some((coefficients, variances)) = solve(samples, &residuals, &calibration, prior, gate) else {
            return believed;
        };
        calibration.coefficients = coefficients;
        calibration.standard_deviations = variances.map(f64::sqrt);
        residuals = residuals_of(samples, &calibration);
        calibration.residual_px = spread(&residuals).max(0.02);
        gate = 2.5 * calibration.residual_px;
    }
    calibration.samples = residuals.iter().filter(|r| r.abs() <= gate).count();
    calibration.error_metres = median_errors(samples, &residuals, gate);
    calibration
}

/// What the calibration leaves of every sample's error, pixels.
fn residuals_of(samples: &[BoardSample], calibration: &DepthCalibration) -> Vec<f64> {
    let residual = |s: &BoardSample| {
        let corrected =
            calibration.correct(f64::from(s.pixel[0]), f64::from(s.pixel[1]), f64::from(s.measured_px));
        f64::from(s.expected_px) - corrected
    };
    samples.par_iter().with_min_len(CHUNK).map(residual).collect()
}

type Terms = SVector<f64, TERMS>;
type Products = SMatrix<f64, TERMS, TERMS>;

/// Sums of the samples inside the gate: their terms' products (lower triangle), and terms times what is missing.
fn sums(samples: &[BoardSample], residuals: &[f64], half: [f64; 2], gate: f64) -> (Products, Terms) {
    let (mut products, mut right) = (Products::zeros(), Terms::zeros());
    for (s, _) in samples.iter().zip(residuals).filter(|(_, residual)| residual.abs() <= gate) {
        let terms = basis(f64::from(s.pixel[0]), f64::from(s.pixel[1]), f64::from(s.measured_px), half);
        let missing = f64::from(s.expected_px - s.measured_px);
        for i in 0..TERMS {
            right[i] += terms[i] * missing;
            for j in 0..=i {
                products[(i, j)] += terms[i] * terms[j];
            }
        }
    }
    (products, right)
}

/// One weighted least-squares solution over the samples inside the gate: coefficients and their variances.
fn solve(
    samples: &[BoardSample],
    residuals: &[f64],
    at: &DepthCalibration,
    prior: &CalibrationPrior,
    gate: f64,
) -> Option<([f64; TERMS], [f64; TERMS])> {
    let sigma = if at.residual_px > 0.0 { at.residual_px } else { 0.1 };
    let weight = 1.0 / (sigma * sigma * CORRELATED_PIXELS);
    let parts: Vec<(Products, Terms)> = samples
        .par_chunks(CHUNK)
        .zip(residuals.par_chunks(CHUNK))
        .map(|(samples, residuals)| sums(samples, residuals, at.half, gate))
        .collect();
    let (products, sum) =
        parts.iter().fold((Products::zeros(), Terms::zeros()), |(n, r), part| (n + part.0, r + part.1));
    let (mut normal, mut right) = (products * weight, sum * weight);
    for i in 0..TERMS {
        let weight = 1.0 / prior.standard_deviations[i].powi(2);
        normal[(i, i)] += weight;
        right[i] += weight * prior.coefficients[i];
    }
    normal.fill_upper_triangle_with_lower_triangle();
    let cholesky = normal.cholesky()?;
    let solution = cholesky.solve(&right);
    let covariance = cholesky.inverse();
    Some((std::array::from_fn(|i| solution[i]), std::array::from_fn(|i| covariance[(i, i)])))
}

/// Robust standard deviation of the residuals, pixels.
fn spread(residuals: &[f64]) -> f64 {
    let mut magnitudes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    1.4826 * median(&mut magnitudes)
}

/// Median depth error on the board in metres, before and after.
fn median_errors(samples: &[BoardSample], residuals: &[f64], gate: f64) -> [f64; 2] {
    let focal_baseline = 40.0; // about 525 px times 75 mm: the figure is for people
    let inside = || samples.iter().zip(residuals).filter(|(_, r)| r.abs() <= gate);
    let depth_error = |measured: f64, expected: f64| focal_baseline / measured - focal_baseline / expected;
    let mut before: Vec<f64> =
        inside().map(|(s, _)| depth_error(f64::from(s.measured_px), f64::from(s.expected_px))).collect();
    let mut after: Vec<f64> =
        inside().map(|(s, r)| depth_error(f64::from(s.expected_px) - r, f64::from(s.expected_px))).collect();
    [median(&mut before), median(&mut after)]
}

fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(
        a: f64,
        warp: impl Fn(f64, f64) -> f64,
        disparities: std::ops::Range<f64>,
    ) -> Vec<BoardSample> {
        let mut rng = fastrand::Rng::with_seed(1);
        let sample = |rng: &mut fastrand::Rng| {
            let (u, v) = (rng.f64() * 640.0, rng.f64() * 480.0);
            let expected = disparities.start + rng.f64() * (disparities.end - disparities.start);
            let measured = (expected - warp(u, v)) / (1.0 + a) + 0.08 * (rng.f64() - 0.5);
            BoardSample {
                pixel: [u as f32, v as f32],
                measured_px: measured as f32,
                expected_px: expected as f32,
            }
        };
        (0..20_000).map(|_| sample(&mut rng)).collect()
    }

    #[test]
    fn scale_and_warp_are_found() {
        let warp = |u: f64, v: f64| 0.1 + 0.1 * (u / 320.0 - 1.0) - 0.08 * (v / 240.0 - 1.0).powi(2);
        let found = fit(&samples(-0.015, warp, 40.0..75.0), 640, 480, &CalibrationPrior::of_any_kinect());
        assert!((found.coefficients[0] + 0.015).abs() < 4e-4, "{:?}", found.coefficients);
        for (u, v) in [(100.0, 100.0), (320.0, 240.0), (500.0, 400.0)] {
            let measured = (50.0 - warp(u, v)) / 0.985;
            assert!((found.correct(u, v, measured) - 50.0).abs() < 0.01);
        }
    }

    #[test]
    fn right_depth_stays_right() {
        let found = fit(&samples(0.0, |_, _| 0.0, 40.0..75.0), 640, 480, &CalibrationPrior::of_any_kinect());
        assert!((found.correct(320.0, 240.0, 50.0) - 50.0).abs() < 0.01);
    }

    #[test]
    fn outliers_and_too_few_samples_do_no_harm() {
        let mut some = samples(0.01, |_, _| 0.0, 40.0..75.0);
        some.iter_mut().step_by(8).for_each(|s| s.measured_px += 4.0);
        let found = fit(&some, 640, 480, &CalibrationPrior::of_any_kinect());
        assert!((found.correct(320.0, 240.0, 50.0) - 50.5).abs() < 0.02);
        let few = fit(&some[..100], 640, 480, &CalibrationPrior::of_any_kinect());
        assert_eq!(few.coefficients, [0.0; TERMS]);
    }

    #[test]
    fn a_calibrated_sensor_keeps_its_scale_where_one_distance_tells_nothing_of_it() {
        // The sensor reads 0.2 pixels short everywhere; seen from one distance, that looks like a wrong scale as well.
        let short = |disparities| samples(0.0, |_, _| 0.2, disparities);
        let anyones = CalibrationPrior::of_any_kinect();
        let anyone = fit(&short(49.0..51.0), 640, 480, &anyones);
        let many_heights = fit(&short(35.0..80.0), 640, 480, &anyones);
        let prior =
            CalibrationPrior::of_this_sensor(many_heights.coefficients, many_heights.standard_deviations);
        let known = fit(&short(49.0..51.0), 640, 480, &prior);
        let off = |c: &DepthCalibration| (c.correct(320.0, 240.0, 79.8) - 80.0).abs();
        assert!(off(&known) < 0.03 && off(&known) < 0.5 * off(&anyone), "{} {}", off(&known), off(&anyone));
        assert!(known.standard_deviations[0] < 0.5 * anyone.standard_deviations[0]);
        let none = fit(&[], 640, 480, &prior);
        assert_eq!(none.coefficients, many_heights.coefficients);
    }
}
