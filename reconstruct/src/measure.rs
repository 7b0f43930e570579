//! The product's size, honestly: length, width and height with what they may be off (95 %).
//!
//! World frame, z up, metres. Length and width are the sides of the smallest rectangle around the product seen from above.
//! Extremes of noisy points grow with the noise, so each side is taken at the middle of the outermost few points.

use crate::cloud::PointCloud;
use crate::segment::convex_hull;

/// Size with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimensions {
    /// Length, width, height, metres; length is the longer side.
    pub metres: [f64; 3],
    /// Half width of the 95 % interval of each, metres.
    pub uncertainty_metres: [f64; 3],
}

/// Uncertainty of a surface's place (standard deviation), metres.
const SURFACE_SD_METRES: f64 = 0.0004;

/// Measures a cloud. `scale_sd` is the relative standard deviation of the scale; `stands_on_floor`: z = 0 is what it stands
/// on, else its height goes from its lowest to its highest point.
pub fn dimensions(cloud: &PointCloud, scale_sd: f64, stands_on_floor: bool) -> Option<Dimensions> {
    if cloud.len() < 100 {
        return None;
    }
    let heights: Vec<f64> = cloud.points.iter().map(|p| f64::from(p[2])).collect();
    let depths: Vec<f64> = heights.iter().map(|z| -z).collect();
    let height = outermost(&heights)? + if stands_on_floor { 0.0 } else { outermost(&depths)? };
    let flat: Vec<[f64; 2]> = cloud.points.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
    let hull = convex_hull(&flat);
    let side = |angle: f64| {
        let (s, c) = angle.sin_cos();
        let extent = |x: f64, y: f64| {
            let along: Vec<f64> = flat.iter().map(|p| p[0] * x + p[1] * y).collect();
            let against: Vec<f64> = along.iter().map(|v| -v).collect();
            Some(outermost(&along)? + outermost(&against)?)
        };
        Some([extent(c, s)?, extent(-s, c)?])
    };
    let angle = smallest_rectangle_angle(&hull);
    let [a, b] = side(angle)?;
    let metres = [a.max(b), a.min(b), height];
    // two surfaces bound each size, but the board bounds the height from below
    let uncertainty = |size: f64, surfaces: f64| {
        2.0 * ((size * scale_sd).powi(2) + surfaces * SURFACE_SD_METRES.powi(2)).sqrt()
    };
    let uncertainty_metres =
        [uncertainty(metres[0], 2.0), uncertainty(metres[1], 2.0), uncertainty(height, 1.0)];
    Some(Dimensions { metres, uncertainty_metres })
}

/// Length, width and height above z = 0 of exact points: the sides of the smallest rectangle around them from above.
pub fn extent(points: &[[f32; 3]]) -> [f64; 3] {
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
    let hull = convex_hull(&flat);
    let (s, c) = smallest_rectangle_angle(&hull).sin_cos();
    let span = |x: f64, y: f64| {
        let along = hull.iter().map(|p| p[0] * x + p[1] * y);
        let (low, high) = along.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        (high - low).max(0.0)
    };
    let (a, b) = (span(c, s), span(-s, c));
    [a.max(b), a.min(b), points.iter().map(|p| f64::from(p[2])).fold(0.0, f64::max)]
}

/// Middle of the outermost points: at most twenty, and no more than one in two thousand.
fn outermost(values: &[f64]) -> Option<f64> {
    let count = (values.len() / 2000).clamp(3, 20).min(values.len());
    let mut sorted = values.to_vec();
    let at = count / 2;
    (at < sorted.len()).then(|| *sorted.select_nth_unstable_by(at, |a, b| b.total_cmp(a)).1)
}

/// Direction of the hull's edge along which the surrounding rectangle is smallest (rotating calipers, by trying all edges).
fn smallest_rectangle_angle(hull: &[[f64; 2]]) -> f64 {
    let edges = hull.iter().zip(hull.iter().cycle().skip(1));
    let mut best = (f64::INFINITY, 0.0);
    for (a, b) in edges {
        let angle = (b[1] - a[1]).atan2(b[0] - a[0]);
        let (s, c) = angle.sin_cos();
        let span = |x: f64, y: f64| {
            let (lo, hi) = hull
                .iter()
                .map(|p| p[0] * x + p[1] * y)
                .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            hi - lo
        };
        let area = span(c, s) * span(-s, c);
        if area < best.0 {
            best = (area, angle);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_box_has_its_own_sizes() {
        let mut rng = fastrand::Rng::with_seed(2);
        let (s, c) = 0.6f32.sin_cos();
        let points = (0..60_000)
            .map(|_| {
                // a point on the surface of a 120 x 60 x 200 mm box
                let mut p = [0.12 * (rng.f32() - 0.5), 0.06 * (rng.f32() - 0.5), 0.2 * rng.f32()];
                match rng.u8(0..5) {
                    0 => p[0] = 0.06,
                    1 => p[0] = -0.06,
                    2 => p[1] = 0.03,
                    3 => p[1] = -0.03,
                    _ => p[2] = 0.2,
                }
                [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]]
            })
            .collect();
        let cloud = PointCloud { points, ..PointCloud::default() };
        let found = dimensions(&cloud, 0.001, true).unwrap();
        for (found, truth) in found.metres.iter().zip([0.12, 0.06, 0.2]) {
            assert!((found - truth).abs() < 0.001, "{found} {truth}");
        }
        assert!(found.uncertainty_metres.iter().all(|&u| u > 0.0005 && u < 0.003));
    }

    #[test]
    fn nothing_has_no_size() {
        assert_eq!(dimensions(&PointCloud::default(), 0.001, true), None);
    }
}
