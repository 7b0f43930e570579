//! Sides of a tag to sub-pixel accuracy: a blurred step is fitted to the grey values in a band along each side.
//!
//! Like AprilTag's edge refinement the whole side counts, not its corners; here by least squares on the grey values
//! themselves (offset, tilt, both levels and blur), which has no bias from interpolation. With a bent lens the band is
//! fitted in undistorted pixels, where sides are straight.

use nalgebra::{Point2, Point3, SMatrix, SVector, Vector2};

use super::quad::Line;
use crate::camera::Intrinsics;
use crate::image::GrayImage;

/// Logistic slope that is nearest to the normal distribution's.
const LOGISTIC: f64 = 1.702;
/// Fewest pixels in the band.
const MIN_SAMPLES: usize = 12;
/// Blur stays between these, pixels.
const BLUR_RANGE: [f64; 2] = [0.25, 2.5];

/// Maps between picture pixels and pixels of a camera without lens distortion.
#[derive(Clone, Copy)]
pub(super) struct Lens<'a>(Option<&'a Intrinsics>);

impl<'a> Lens<'a> {
    pub(super) fn of(camera: Option<&'a Intrinsics>) -> Self {
        Self(camera.filter(|c| c.is_distorted() && c.is_valid()))
    }

    /// Straightened pixel of a picture pixel.
    pub(super) fn straighten(self, p: &Point2<f64>) -> Point2<f64> {
        self.0.map_or(*p, |c| {
            let ray = c.ray(p);
            Point2::new(c.fx * ray.x + c.cx, c.fy * ray.y + c.cy)
        })
    }

    /// Picture pixel of a straightened pixel.
    pub(super) fn bend(self, p: &Point2<f64>) -> Point2<f64> {
        let bent = |c: &Intrinsics| c.project(&Point3::new((p.x - c.cx) / c.fx, (p.y - c.cy) / c.fy, 1.0));
        self.0.and_then(bent).unwrap_or(*p)
    }
}

/// A side after the fit, in straightened pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    pub(super) line: Line,
    /// Standard deviations of the line's offset at both of the side's ends, pixels.
    pub(super) end_sd_px: [f64; 2],
    /// Bright minus dark, grey levels.
    pub(super) contrast: f64,
    /// Root mean square of what the step does not explain, as a share of the contrast.
    pub(super) misfit: f64,
}

/// A pixel of the band: along the side from -1 to 1, outwards in pixels, grey value.
struct Sample {
    along: f64,
    outward: f64,
    value: f64,
}

/// Fits the side from `a` to `b` (straightened pixels, dark on the right of the walk), looking `reach_px` to both sides.
pub(super) fn fit_side(
    image: &GrayImage,
    lens: Lens<'_>,
    a: Point2<f64>,
    b: Point2<f64>,
    reach_px: f64,
) -> Option<Side> {
    let length = (b - a).norm();
    let along = (b - a) / length.max(1e-9);
    let frame = Frame { middle: nalgebra::center(&a, &b), along, half: 0.5 * length, reach_px };
    let samples = frame.collect(image, lens);
    if samples.len() < MIN_SAMPLES {
        return None;
    }
    let step = fit_step(&samples, reach_px)?;
    let outward = frame.outward();
    let point = |t: f64| frame.middle + along * (t * frame.half) + outward * (step.offset + step.tilt * t);
    Some(Side {
        line: Line { point: point(0.0), direction: (point(1.0) - point(-1.0)).normalize() },
        end_sd_px: step.end_sd_px,
        contrast: step.contrast,
        misfit: step.misfit,
    })
}

/// The side's own coordinates.
struct Frame {
    middle: Point2<f64>,
    along: Vector2<f64>,
    half: f64,
    reach_px: f64,
}

impl Frame {
    /// Away from the tag: corners run clockwise in a picture whose y points down.
    fn outward(&self) -> Vector2<f64> {
        Vector2::new(self.along.y, -self.along.x)
    }

    /// Pixels of the band without the ends, where the corners are rounded.
    fn collect(&self, image: &GrayImage, lens: Lens<'_>) -> Vec<Sample> {
        let usable = self.half - 1.5f64.min(0.4 * self.half);
        let outward = self.outward();
        let ends = [-usable, usable].map(|u| lens.bend(&(self.middle + self.along * u)));
        let bow = (lens.bend(&self.middle) - nalgebra::center(&ends[0], &ends[1])).norm();
        let mut samples = Vec::with_capacity((4.0 * usable * (self.reach_px + 1.0)) as usize);
        // Rows where the side is steep, columns where it is flat: each gets the stretch that the band covers.
        let steep = (ends[1].y - ends[0].y).abs() > (ends[1].x - ends[0].x).abs();
        let turn = |p: &Point2<f64>| if steep { (p.y, p.x) } else { (p.x, p.y) };
        let ((s0, c0), (s1, c1)) = (turn(&ends[0]), turn(&ends[1]));
        let (slices, cross) = if steep { (image.height, image.width) } else { (image.width, image.height) };
        let slope = (c1 - c0) / (s1 - s0);
        let width = (self.reach_px + bow) * slope.hypot(1.0) + 0.5;
        let first = (s0.min(s1) - self.reach_px).ceil().max(0.0) as usize;
        let last = (s0.max(s1) + self.reach_px).floor().min(slices as f64 - 1.0);
        if last < 0.0 {
            return samples;
        }
        for s in first..=last as usize {
            let centre = c0 + slope * (s as f64 - s0);
            let from = (centre - width).ceil().max(0.0) as usize;
            let to = (centre + width).floor().min(cross as f64 - 1.0);
            if to < 0.0 {
                continue;
            }
            for c in from..=to as usize {
                let (x, y) = if steep { (c, s) } else { (s, c) };
                let d = lens.straighten(&Point2::new(x as f64, y as f64)) - self.middle;
                let (u, v) = (d.dot(&self.along), d.dot(&outward));
                if u.abs() <= usable && v.abs() <= self.reach_px {
                    let value = f64::from(image.data[y * image.width + x]);
                    samples.push(Sample { along: u / self.half, outward: v, value });
                }
            }
        }
        samples
    }
}

/// Result of the fit in the side's coordinates.
struct Step {
    offset: f64,
    tilt: f64,
    end_sd_px: [f64; 2],
    contrast: f64,
    misfit: f64,
}

/// Gauss-Newton with Huber weights over offset, tilt, dark, bright, ln blur.
fn fit_step(samples: &[Sample], reach_px: f64) -> Option<Step> {
    let (dark, bright) = outer_means(samples, 0.5 * reach_px)?;
    let mut x = SVector::<f64, 5>::new(0.0, 0.0, dark, bright, -0.3);
    let mut damping = 1e-3;
    let (mut normal, mut gradient, mut cost) = linearize(samples, &x);
    for _ in 0..12 {
        let mut damped = normal;
        for k in 0..5 {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&gradient);
        let mut next = x - step;
        next[4] = next[4].clamp(BLUR_RANGE[0].ln(), BLUR_RANGE[1].ln());
        let (next_normal, next_gradient, next_cost) = linearize(samples, &next);
        if next_cost <= cost {
            let moved = step[0].abs() + step[1].abs();
            (x, normal, gradient, cost) = (next, next_normal, next_gradient, next_cost);
            damping *= 0.1;
            if moved < 2e-3 {
                break;
            }
        } else {
            damping = (damping * 10.0).max(1e-3);
            if damping > 1e3 {
                break;
            }
        }
    }
    let contrast = x[3] - x[2];
    if x[0].abs() + x[1].abs() > reach_px || contrast <= 0.0 {
        return None;
    }
    let variance = (2.0 * cost / (samples.len() - 5).max(1) as f64).max(0.25);
    let covariance = normal.try_inverse()? * variance;
    let end_sd = |t: f64| {
        (covariance[(0, 0)] + 2.0 * t * covariance[(0, 1)] + t * t * covariance[(1, 1)]).max(0.0).sqrt()
    };
    let misfit = (2.0 * cost / samples.len() as f64).sqrt() / contrast;
    Some(Step { offset: x[0], tilt: x[1], end_sd_px: [end_sd(-1.0), end_sd(1.0)], contrast, misfit })
}

/// Mean grey value well inside and well outside.
fn outer_means(samples: &[Sample], beyond: f64) -> Option<(f64, f64)> {
    let mean = |keep: &dyn Fn(&Sample) -> bool| {
        let (mut sum, mut n) = (0.0, 0.0);
        for s in samples.iter().filter(|s| keep(s)) {
            sum += s.value;
            n += 1.0;
        }
        (n > 0.0).then_some(sum / n)
    };
    let (dark, bright) = (mean(&|s| s.outward < -beyond)?, mean(&|s| s.outward > beyond)?);
    (bright - dark >= 5.0).then_some((dark, bright))
}

/// Normal matrix, gradient and Huber cost of the step model.
fn linearize(samples: &[Sample], x: &SVector<f64, 5>) -> (SMatrix<f64, 5, 5>, SVector<f64, 5>, f64) {
    let contrast = x[3] - x[2];
    let slope = LOGISTIC / x[4].exp();
    let huber = 4.0 + 0.06 * contrast.abs();
    let mut normal = [[0.0; 5]; 5];
    let mut gradient = [0.0; 5];
    let mut cost = 0.0;
    for s in samples {
        let z = slope * (s.outward - x[0] - x[1] * s.along);
        let rise = 1.0 / (1.0 + (-z).exp());
        let bend = contrast * rise * (1.0 - rise);
        let residual = x[2] + contrast * rise - s.value;
        let size = residual.abs();
        let weight = if size <= huber { 1.0 } else { huber / size };
        cost += if size <= huber { 0.5 * size * size } else { huber * (size - 0.5 * huber) };
        let row = [-bend * slope, -bend * slope * s.along, 1.0 - rise, rise, -bend * z];
        for i in 0..5 {
            let weighted = weight * row[i];
            gradient[i] += weighted * residual;
            for j in 0..=i {
                normal[i][j] += weighted * row[j];
            }
        }
    }
    let full = SMatrix::<f64, 5, 5>::from_fn(|i, j| normal[i.max(j)][i.min(j)]);
    (full, SVector::from(gradient), cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vertical soft step at x = `edge`, bright on the left.
    fn step_image(edge: f64, blur: f64) -> GrayImage {
        let value = |x: usize| 200.0 - 150.0 / (1.0 + (-(x as f64 - edge) * LOGISTIC / blur).exp());
        let row: Vec<u8> = (0..40).map(|x| value(x).round() as u8).collect();
        GrayImage { width: 40, height: 40, data: row.repeat(40) }
    }

    #[test]
    fn a_soft_step_is_found_to_a_fiftieth_of_a_pixel() {
        for (edge, blur) in [(20.0, 0.5), (20.3, 0.8), (19.6, 1.2)] {
            let image = step_image(edge, blur);
            // Walking up with the dark side on the right.
            let (a, b) = (Point2::new(20.6, 35.0), Point2::new(19.8, 5.0));
            let side = fit_side(&image, Lens::of(None), a, b, 3.0).unwrap();
            let line = side.line;
            let at_row = |y: f64| line.point.x + (y - line.point.y) / line.direction.y * line.direction.x;
            for y in [5.0, 35.0] {
                assert!((at_row(y) - edge).abs() < 0.02, "{} {edge}", at_row(y));
            }
            assert!((side.contrast - 150.0).abs() < 5.0 && side.misfit < 0.02);
        }
    }

    #[test]
    fn a_flat_picture_has_no_side() {
        let image = GrayImage { width: 40, height: 40, data: vec![90; 1600] };
        let side = fit_side(&image, Lens::of(None), Point2::new(20.0, 35.0), Point2::new(20.0, 5.0), 3.0);
        assert!(side.is_none());
    }
}
