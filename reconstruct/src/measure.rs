//! The product's size, honestly: length, width and height with what they may be off (95 %).
//!
//! World frame, z up, metres. Length and width are the sides of the smallest rectangle around the product seen from above; where it is
//! round, both are its mean diameter.
//! Extremes of noisy points grow with the noise and with the number of points, so each end is taken from how the points thin out
//! towards it, given the noise they are stated to have.

mod edge;
mod end;
mod rectangle;
mod round;
mod unseen;

use edge::edge;
use end::{End, end};
pub use unseen::unseen_beyond;

use crate::mesh::Mesh;
use crate::segment::convex_hull;

/// Size with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimensions {
    /// Length, width, height, metres; length is the longer side.
    pub metres: [f64; 3],
    /// Half width of the 95 % interval of each, metres.
    pub uncertainty_metres: [f64; 3],
    /// Unit direction of each in the world.
    pub directions: [[f64; 3]; 3],
    /// Whether the height begins at z = 0.
    pub stands_on_floor: bool,
}

/// Uncertainty of a side's edge beside the points' own deviation (standard deviation), metres: rims come out too low or too high by that.
/// Chosen on simulated scans so that nineteen of twenty sizes lie within what is stated.
const SIDE_SD_METRES: f64 = 0.000_22;
/// The same of the upper edge, on which all views look from above and err alike.
const UPPER_SD_METRES: f64 = 0.000_37;
/// Part of the deviation that all points of an edge share.
const SHARED_DEVIATION: f64 = 0.5;
/// Deviation of points of which nothing is known, metres.
const UNKNOWN_DEVIATION: f32 = 0.0004;
/// What the product stands on is exactly known.
const BOARD: End = End { at: 0.0, deviation: 0.0, spread: 0.0 };
/// Points among which directions are compared.
const SEARCHED_POINTS: usize = 30_000;

/// Measures the measured vertices of a mesh. `scale_sd` is the relative standard deviation of the scale; `stands_on_floor`: z = 0
/// is what it stands on, else its height goes from its lowest to its highest point.
pub fn dimensions(mesh: &Mesh, scale_sd: f64, stands_on_floor: bool) -> Option<Dimensions> {
    let points = Measured::of(mesh);
    if points.places.len() < 100 {
        return None;
    }
    let towards = |direction: [f64; 3]| end(&points.along(direction), &points.deviations);
    let up = towards([0.0, 0.0, 1.0])?;
    let floor = if stands_on_floor { BOARD } else { towards([0.0, 0.0, -1.0])? };
    let searched = points.thinned(SEARCHED_POINTS);
    let (s, c) = smallest_rectangle_angle(&searched).sin_cos();
    let side = |x: f64, y: f64| {
        let (one, other) = rayon::join(|| towards([x, y, 0.0]), || towards([-x, -y, 0.0]));
        Some([one?, other?])
    };
    let (mut sides, height) = ([side(c, s)?, side(-s, c)?], [up, floor]);
    let mut directions = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]];
    if length(&sides[0]) < length(&sides[1]) {
        sides.swap(0, 1);
        directions.swap(0, 1);
    }
    let all = [sides[0], sides[1], height];
    let mut metres = all.map(|ends| length(&ends));
    if round::is_round(|x, y| edge(&searched.along([x, y, 0.0]), &searched.deviations)) {
        let diameter = round::diameter(|x, y| Some(length(&side(x, y)?)))?;
        metres = [diameter, diameter, metres[2]];
    }
    Some(Dimensions {
        metres,
        uncertainty_metres: [
            uncertainty(&sides[0], scale_sd, SIDE_SD_METRES),
            uncertainty(&sides[1], scale_sd, SIDE_SD_METRES),
            uncertainty(&height, scale_sd, UPPER_SD_METRES),
        ],
        directions,
        stands_on_floor,
    })
}

fn length(ends: &[End; 2]) -> f64 {
    ends[0].at + ends[1].at
}

/// Half width of the 95 % interval of a length between two edges; the board is no edge of its own.
fn uncertainty(ends: &[End; 2], scale_sd: f64, edge_sd: f64) -> f64 {
    let of_edge = |e: &End| {
        if e.deviation > 0.0 {
            edge_sd.powi(2) + e.spread.powi(2) + (SHARED_DEVIATION * e.deviation).powi(2)
        } else {
            0.0
        }
    };
    2.0 * ((length(ends) * scale_sd).powi(2) + ends.iter().map(of_edge).sum::<f64>()).sqrt()
}

/// What was measured, with its deviations.
struct Measured {
    places: Vec<[f32; 3]>,
    deviations: Vec<f32>,
}

impl Measured {
    fn of(mesh: &Mesh) -> Self {
        let kept: Vec<usize> = (0..mesh.vertices.len()).filter(|&i| !mesh.is_invented(i)).collect();
        let deviation = |i: usize| mesh.deviations_metres.get(i).copied().unwrap_or(UNKNOWN_DEVIATION);
        Self {
            places: kept.iter().map(|&i| mesh.vertices.points[i]).collect(),
            deviations: kept.into_iter().map(deviation).collect(),
        }
    }

    fn along(&self, towards: [f64; 3]) -> Vec<f32> {
        let [x, y, z] = towards.map(|v| v as f32);
        self.places.iter().map(|p| p[0] * x + p[1] * y + p[2] * z).collect()
    }

    fn thinned(&self, most: usize) -> Self {
        let stride = self.places.len().div_ceil(most).max(1);
        Self {
            places: self.places.iter().step_by(stride).copied().collect(),
            deviations: self.deviations.iter().step_by(stride).copied().collect(),
        }
    }
}

/// Direction of one side of the smallest rectangle around the points seen from above, radians.
fn smallest_rectangle_angle(points: &Measured) -> f64 {
    let area = |angle: f64| {
        let (s, c) = angle.sin_cos();
        let end = |x: f64, y: f64| edge(&points.along([x, y, 0.0]), &points.deviations).unwrap_or(0.0);
        (end(c, s) + end(-c, -s)) * (end(-s, c) + end(s, -c))
    };
    rectangle::smallest(area)
}

/// Length, width and height above z = 0 of exact points: the sides of the smallest rectangle around them from above.
pub fn extent(points: &[[f32; 3]]) -> [f64; 3] {
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
    let hull = convex_hull(&flat);
    let (s, c) = exact_rectangle_angle(&hull).sin_cos();
    let span = |x: f64, y: f64| {
        let along = hull.iter().map(|p| p[0] * x + p[1] * y);
        let (low, high) = along.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        (high - low).max(0.0)
    };
    let (a, b) = (span(c, s), span(-s, c));
    [a.max(b), a.min(b), points.iter().map(|p| f64::from(p[2])).fold(0.0, f64::max)]
}

/// Direction of the hull's edge along which the surrounding rectangle is smallest (rotating calipers, by trying all edges).
fn exact_rectangle_angle(hull: &[[f64; 2]]) -> f64 {
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
mod tests;
