//! Quadrilaterals in outlines: corners by farthest points, sides by total least squares through the cracks.

use nalgebra::{Point2, Vector2};

use super::outline::Outline;

/// Most the cracks of a side may scatter about it: a digital line has about 0.3 px of its own.
const MAX_SIDE_RMS_PX: f64 = 0.8;
/// The same, growing with the side: lenses bend long sides.
const MAX_SIDE_RMS_SHARE: f64 = 0.012;
/// Share of a side left out at both ends, where corners are rounded.
const END_SHARE: f64 = 0.1;

/// A quadrilateral in the picture, corners clockwise, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quad {
    pub(super) corners: [Point2<f64>; 4],
}

impl Quad {
    /// Whether the corners are those of another quadrilateral, give or take an outline's roughness.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        (0..4).any(|shift| (0..4).all(|k| (self.corners[k] - other.corners[(k + shift) % 4]).norm() < 2.0))
    }
}

/// An infinite line through a point along a unit direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    pub(super) point: Point2<f64>,
    pub(super) direction: Vector2<f64>,
}

impl Line {
    /// Where two lines meet; `None` where they are nearly parallel.
    pub(super) fn intersection(&self, other: &Self) -> Option<Point2<f64>> {
        let cross = self.direction.perp(&other.direction);
        if cross.abs() < 0.05 {
            return None;
        }
        let along = (other.point - self.point).perp(&other.direction) / cross;
        Some(self.point + self.direction * along)
    }
}

/// The quadrilateral an outline draws, if it draws one with sides of at least `min_side_px`.
pub(super) fn fit_quad(outline: &Outline, min_side_px: f64) -> Option<Quad> {
    if !looks_compact(outline, min_side_px) {
        return None;
    }
    let sums = Moments::of(outline);
    let mut breaks = four_breaks(outline, &sums)?;
    let mut corners = [Point2::origin(); 4];
    for _ in 0..2 {
        let sides = sums.sides(&breaks)?;
        for k in 0..4 {
            corners[k] = sides[(k + 3) % 4].intersection(&sides[k])?;
        }
        breaks = nearest_breaks(outline, &corners, &breaks)?;
    }
    plausible(&corners, min_side_px).then_some(Quad { corners })
}

fn looks_compact(outline: &Outline, min_side_px: f64) -> bool {
    let mut low = [i32::MAX; 2];
    let mut high = [i32::MIN; 2];
    for p in outline {
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let (w, h) = (f64::from(high[0] - low[0]), f64::from(high[1] - low[1]));
    w.max(h) >= min_side_px && w.min(h) >= 0.5 * min_side_px && (outline.len() as f64) < 1.4 * 2.0 * (w + h)
}

/// Convex, clockwise, long enough sides, no side vanishing beside the others.
fn plausible(corners: &[Point2<f64>; 4], min_side_px: f64) -> bool {
    (0..4).all(|k| {
        let (a, b, c) = (corners[k], corners[(k + 1) % 4], corners[(k + 2) % 4]);
        let (ab, bc) = (b - a, c - b);
        ab.norm() >= min_side_px && ab.perp(&bc) > 0.15 * ab.norm() * bc.norm()
    })
}

/// Four vertices of the outline that span it: two far apart, then twice the one farthest from the polygon so far.
fn four_breaks(outline: &Outline, sums: &Moments) -> Option<[usize; 4]> {
    let centre = sums.mean();
    let farthest = |from: Point2<f64>| {
        let distance = |i: usize| (vertex(outline, i) - from).norm_squared();
        (0..outline.len()).max_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    };
    let first = farthest(centre)?;
    let second = farthest(vertex(outline, first))?;
    let mut breaks = vec![first.min(second), first.max(second)];
    while breaks.len() < 4 {
        let (_, slot, index) = (0..breaks.len())
            .filter_map(|slot| {
                let (from, to) = (breaks[slot], breaks[(slot + 1) % breaks.len()]);
                farthest_from_chord(outline, from, to).map(|(distance, index)| (distance, slot, index))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        breaks.insert(slot + 1, index);
    }
    breaks.sort_unstable();
    breaks.try_into().ok()
}

/// The vertex between two others farthest from their chord.
fn farthest_from_chord(outline: &Outline, from: usize, to: usize) -> Option<(f64, usize)> {
    let n = outline.len();
    let (a, b) = (vertex(outline, from), vertex(outline, to));
    let chord = (b - a).try_normalize(1e-9)?;
    let count = (to + n - from) % n;
    (1..count)
        .map(|k| (from + k) % n)
        .map(|i| (chord.perp(&(vertex(outline, i) - a)).abs(), i))
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

/// The outline's vertex nearest to every corner; `None` where a corner ran away or two share a vertex.
fn nearest_breaks(outline: &Outline, corners: &[Point2<f64>; 4], old: &[usize; 4]) -> Option<[usize; 4]> {
    let n = outline.len();
    let mut breaks = [0; 4];
    for k in 0..4 {
        let reach = (n / 8).max(3);
        let near = (0..=2 * reach).map(|j| (old[k] + n - reach + j) % n);
        let distance = |i: usize| (vertex(outline, i) - corners[k]).norm_squared();
        let best = near.min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        if distance(best) > (2.0 + 0.03 * n as f64 / 4.0).powi(2) {
            return None;
        }
        breaks[k] = best;
    }
    let spans: usize = (0..4).map(|k| (breaks[(k + 1) % 4] + n - breaks[k]) % n).sum();
    (spans == n && (0..4).all(|k| breaks[k] != breaks[(k + 1) % 4])).then_some(breaks)
}

fn vertex(outline: &Outline, i: usize) -> Point2<f64> {
    Point2::new(f64::from(outline[i][0]) - 0.5, f64::from(outline[i][1]) - 0.5)
}

/// Running sums over the cracks' middles, so that any stretch is fitted in constant time.
struct Moments {
    /// `[x, y, xx, xy, yy]` of the cracks before each index.
    sums: Vec<[f64; 5]>,
}

impl Moments {
    fn of(outline: &Outline) -> Self {
        let n = outline.len();
        let mut total = [0.0; 5];
        let mut sums = Vec::with_capacity(n + 1);
        sums.push(total);
        for i in 0..n {
            let middle = nalgebra::center(&vertex(outline, i), &vertex(outline, (i + 1) % n));
            let (x, y) = (middle.x, middle.y);
            for (t, v) in total.iter_mut().zip([x, y, x * x, x * y, y * y]) {
                *t += v;
            }
            sums.push(total);
        }
        Self { sums }
    }

    fn len(&self) -> usize {
        self.sums.len() - 1
    }

    fn mean(&self) -> Point2<f64> {
        let (n, all) = (self.len() as f64, self.sums[self.len()]);
        Point2::new(all[0] / n, all[1] / n)
    }

    fn sides(&self, breaks: &[usize; 4]) -> Option<[Line; 4]> {
        let side = |k: usize| self.side(breaks[k], breaks[(k + 1) % 4]);
        Some([side(0)?, side(1)?, side(2)?, side(3)?])
    }

    /// Line through the cracks between two vertices, without the ends; `None` where they do not lie on one.
    fn side(&self, from: usize, to: usize) -> Option<Line> {
        let n = self.len();
        let count = (to + n - from) % n;
        let skip = (count as f64 * END_SHARE).ceil() as usize;
        let inner = count.checked_sub(2 * skip).filter(|&c| c >= 3)?;
        let (start, end) = (from + skip, from + skip + inner);
        let prefix = |i: usize| -> [f64; 5] {
            if i <= n { self.sums[i] } else { std::array::from_fn(|k| self.sums[n][k] + self.sums[i - n][k]) }
        };
        let (a, b) = (prefix(start), prefix(end));
        let [x, y, xx, xy, yy] = std::array::from_fn(|k| (b[k] - a[k]) / inner as f64);
        let (vxx, vxy, vyy) = (xx - x * x, xy - x * y, yy - y * y);
        let half = 0.5 * (vxx - vyy);
        let root = half.hypot(vxy);
        let rms = (0.5 * (vxx + vyy) - root).max(0.0).sqrt();
        let angle = 0.5 * vxy.atan2(half);
        let length = (12.0 * (0.5 * (vxx + vyy) + root)).sqrt();
        (rms <= MAX_SIDE_RMS_PX.max(MAX_SIDE_RMS_SHARE * length))
            .then(|| Line { point: Point2::new(x, y), direction: Vector2::new(angle.cos(), angle.sin()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outline of the pixels inside a convex polygon given clockwise.
    fn outline_of(polygon: &[[f64; 2]]) -> Outline {
        use super::super::outline::{Connected, for_each_outline};
        use super::super::threshold::BlackMask;
        let (stride, rows) = (102, 102);
        let mut data = vec![0; stride * rows];
        for y in 0..100 {
            for x in 0..100 {
                let inside = (0..polygon.len()).all(|k| {
                    let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                    (b[0] - a[0]) * (f64::from(y) - a[1]) - (b[1] - a[1]) * (f64::from(x) - a[0]) > 0.0
                });
                data[(y as usize + 1) * stride + x as usize + 1] = u8::from(inside);
            }
        }
        let mut found = Vec::new();
        for_each_outline(&BlackMask { stride, data }, Connected::Sides, 1, 10_000, |o| found.push(o.clone()));
        found.swap_remove(0)
    }

    fn check(polygon: [[f64; 2]; 4]) {
        let quad = fit_quad(&outline_of(&polygon), 8.0).expect("a quadrilateral");
        for corner in polygon {
            let nearest = quad
                .corners
                .iter()
                .map(|c| (c - Point2::from(corner)).norm())
                .min_by(f64::total_cmp)
                .unwrap();
            assert!(nearest < 0.7, "{corner:?} {:?}", quad.corners);
        }
    }

    #[test]
    fn corners_of_quadrilaterals_are_found() {
        check([[10.2, 10.3], [60.4, 10.1], [60.3, 50.2], [10.1, 50.4]]);
        check([[50.0, 8.0], [88.0, 47.0], [51.0, 90.0], [12.0, 48.0]]);
        check([[20.0, 40.0], [80.0, 42.0], [95.0, 60.0], [5.0, 58.0]]);
        check([[30.0, 20.0], [45.0, 25.0], [44.0, 80.0], [29.0, 78.0]]);
    }

    #[test]
    fn other_shapes_are_not() {
        assert!(fit_quad(&outline_of(&[[50.0, 10.0], [90.0, 80.0], [10.0, 80.0]]), 8.0).is_none());
        let disc: Vec<[f64; 2]> = (0..60)
            .map(|k| f64::from(k) * std::f64::consts::TAU / 60.0)
            .map(|a| [50.0 + 30.0 * a.cos(), 50.0 + 30.0 * a.sin()])
            .collect();
        assert!(fit_quad(&outline_of(&disc), 8.0).is_none());
    }
}
