//! Corners of a quadrilateral from its four fitted sides.

use nalgebra::{Matrix2, Point2, Vector2};

use super::edge::{Lens, Side, fit_side};
use super::quad::Line;
use crate::image::GrayImage;

/// Reach of the final fit in cells: it must end before the next cell does.
const REACH_CELLS: f64 = 0.9;
/// Shortest reach of the final fit, pixels: a blurred step has to fit in.
const MIN_REACH_PX: f64 = 1.3;
/// Longest reach of the final fit, pixels.
const MAX_REACH_PX: f64 = 2.5;
/// How much further the first fit looks, whose start is the outline's.
const FIRST_REACH_FACTOR: f64 = 1.3;
/// Most a side may differ from a blurred step, as a share of its contrast.
const MAX_MISFIT: f64 = 0.3;
/// Uncertainty of a side that could not be fitted and stays where the outline has it, pixels.
const OUTLINE_SIGMA_PX: f64 = 0.5;
/// What no fit can know: the lens model, print, quantisation.
const CORNER_SIGMA_FLOOR_PX: f64 = 0.03;
/// A side this near to the picture's border is where the picture ends, not the tag. Pixels.
const BORDER_PX: f64 = 2.0;

/// Corners after the sides' fit, clockwise from any, straightened pixels.
pub(super) struct RefinedQuad {
    pub(super) corners: [Point2<f64>; 4],
    /// Standard deviation of a corner's coordinate; infinite at sides cut by the picture's border.
    pub(super) sigma_px: [f64; 4],
    /// Sides that are not a blurred step and stay where the outline has them.
    pub(super) unfitted_sides: usize,
}

/// Fits the four sides twice and intersects them; `None` where they run away from the outline.
pub(super) fn refine(
    image: &GrayImage,
    lens: Lens<'_>,
    start: &[Point2<f64>; 4],
    cells: usize,
    min_contrast: f64,
) -> Option<RefinedQuad> {
    let cut: [bool; 4] = std::array::from_fn(|k| {
        [start[k], start[(k + 1) % 4]].iter().all(|p| is_at_border(image, &lens.bend(p)))
    });
    let mut sides: [Side; 4] = std::array::from_fn(|k| outline_side(start[k], start[(k + 1) % 4]));
    let mut fitted = [false; 4];
    let mut refined = RefinedQuad { corners: *start, sigma_px: [OUTLINE_SIGMA_PX; 4], unfitted_sides: 4 };
    for factor in [FIRST_REACH_FACTOR, 1.0] {
        let c = refined.corners;
        for k in (0..4).filter(|&k| !cut[k]) {
            let cell_px = depth_of(&c, k) / cells as f64;
            let reach_px = (REACH_CELLS * cell_px).clamp(MIN_REACH_PX, MAX_REACH_PX) * factor;
            let side = fit_side(image, lens, c[k], c[(k + 1) % 4], reach_px);
            if let Some(side) = side.filter(|s| s.misfit <= MAX_MISFIT && s.contrast >= min_contrast) {
                (sides[k], fitted[k]) = (side, true);
            }
        }
        for k in 0..4 {
            let before = (k + 3) % 4;
            refined.corners[k] = sides[before].line.intersection(&sides[k].line)?;
            let seen = !cut[before] && !cut[k];
            refined.sigma_px[k] = if seen { corner_sigma(&sides[before], &sides[k]) } else { f64::INFINITY };
        }
    }
    refined.unfitted_sides = fitted.iter().filter(|&&f| !f).count();
    let side_px = (0..4).map(|k| (start[(k + 1) % 4] - start[k]).norm()).sum::<f64>() / 4.0;
    let moved = (0..4).map(|k| (refined.corners[k] - start[k]).norm()).fold(0.0, f64::max);
    (moved <= 2.5 + 0.04 * side_px).then_some(refined)
}

fn is_at_border(image: &GrayImage, p: &Point2<f64>) -> bool {
    let (right, bottom) = (image.width as f64 - 1.0, image.height as f64 - 1.0);
    p.x.min(p.y).min(right - p.x).min(bottom - p.y) < BORDER_PX
}

/// A side as the outline has it.
fn outline_side(a: Point2<f64>, b: Point2<f64>) -> Side {
    let direction = (b - a) / (b - a).norm().max(1e-9);
    Side { line: Line { point: a, direction }, end_sd_px: [OUTLINE_SIGMA_PX; 2], contrast: 0.0, misfit: 1.0 }
}

/// How far the opposite side lies behind a side: foreshortened tags have flat cells.
fn depth_of(c: &[Point2<f64>; 4], k: usize) -> f64 {
    let (a, b) = (c[k], c[(k + 1) % 4]);
    let opposite = nalgebra::center(&c[(k + 2) % 4], &c[(k + 3) % 4]);
    (b - a).perp(&(opposite - a)).abs() / (b - a).norm().max(1e-9)
}

/// Standard deviation a coordinate of the corner where two sides meet.
fn corner_sigma(before: &Side, after: &Side) -> f64 {
    let normal = |s: &Side| Vector2::new(s.line.direction.y, -s.line.direction.x);
    let (a, b) = (normal(before), normal(after));
    let Some(inverse) = Matrix2::new(a.x, a.y, b.x, b.y).try_inverse() else {
        return f64::INFINITY;
    };
    let variances = Matrix2::new(before.end_sd_px[1].powi(2), 0.0, 0.0, after.end_sd_px[0].powi(2));
    let covariance = inverse * variances * inverse.transpose();
    (0.5 * covariance.trace()).sqrt().hypot(CORNER_SIGMA_FLOOR_PX)
}
