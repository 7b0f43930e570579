//! Background removal by the marker region: what rises above the board from inside it is the product.
//!
//! In the world (board) frame: seeds are pixels above the inner region; they grow through touching pixels inside the wider
//! prism above the whole board, so that overhanging parts survive. The board itself and all else is background.

use nalgebra::Point3;

use crate::board::KnownBoard;
use crate::pose::Pose;
use crate::view::DepthView;

/// Where the product may be, world frame, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Polygon in which the product stands.
    pub inner: Vec<[f64; 2]>,
    /// Convex polygon beyond which nothing belongs to the product.
    pub outer: Vec<[f64; 2]>,
}

/// Settings of the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentConfig {
    /// What lies lower is the board, metres.
    pub floor_metres: f64,
    /// Seeds are at least this high, metres.
    pub seed_metres: f64,
    /// Nothing higher is looked at, metres.
    pub ceiling_metres: f64,
    /// Pixels this near in space belong together, metres.
    pub link_metres: f32,
    /// The outer prism reaches this far beyond the markers, metres.
    pub overhang_metres: f64,
    /// Smaller pieces are dropped, as a share of the largest.
    pub min_piece_ratio: f64,
}

impl Default for SegmentConfig {
    fn default() -> Self {
        Self {
            floor_metres: 0.0022,
            seed_metres: 0.006,
            ceiling_metres: 0.8,
            link_metres: 0.008,
            overhang_metres: 0.08,
            min_piece_ratio: 0.005,
        }
    }
}

/// What the cut found in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// Whether each pixel belongs to the product.
    pub mask: Vec<bool>,
    /// Pixels of the product.
    pub product_pixels: usize,
    /// Pixels standing above the board but outside its inner region and not touching the product.
    pub outside_pixels: usize,
}

impl Region {
    /// The region of a board: its inner polygon, and the hull of its tags grown by the overhang.
    pub fn of_board(board: &KnownBoard, config: &SegmentConfig) -> Self {
        let corners: Vec<[f64; 2]> =
            board.tags.iter().flat_map(|t| t.corners_m).map(|c| [c[0], c[1]]).collect();
        let outer = grown(&convex_hull(&corners), config.overhang_metres);
        Self { inner: board.inner_region_m.clone(), outer }
    }
}

/// Marks the product's pixels of one view.
pub fn cut(view: &DepthView, world_from_camera: &Pose, region: &Region, config: &SegmentConfig) -> Cut {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let world_from_camera = world_from_camera.cast::<f32>();
    let outer = Polygon::new(&region.outer);
    let inner = Polygon::new(&region.inner);
    // 0 background, 1 may be grown into, 2 seed
    let classes: Vec<u8> = view
        .points
        .iter()
        .map(|p| {
            if p[2] <= 0.0 {
                return 0;
            }
            let w = world_from_camera * Point3::from(*p);
            let high = f64::from(w.z) > config.floor_metres && f64::from(w.z) < config.ceiling_metres;
            if !high || !outer.contains(w.x, w.y) {
                0
            } else {
                1 + u8::from(f64::from(w.z) > config.seed_metres && inner.contains(w.x, w.y))
            }
        })
        .collect();
    let (labels, pieces) = connected(&classes, &view.points, width, height, config.link_metres);
    let largest = pieces.iter().filter(|p| p.seeds > 0).map(|p| p.pixels).max().unwrap_or(0);
    let least = ((largest as f64 * config.min_piece_ratio) as usize).max(30);
    let keep: Vec<bool> =
        pieces.iter().map(|p| p.seeds * 20 >= p.pixels && p.seeds > 0 && p.pixels >= least).collect();
    let mask: Vec<bool> = labels.iter().map(|&l| l != 0 && keep[l as usize - 1]).collect();
    let product_pixels = mask.iter().filter(|&&m| m).count();
    let outside_pixels = pieces.iter().filter(|p| p.seeds == 0 && p.pixels > 200).map(|p| p.pixels).sum();
    Cut { mask, product_pixels, outside_pixels }
}

struct Piece {
    pixels: usize,
    seeds: usize,
}

/// Labels (from 1) of connected pixels: neighbours up to two pixels apart whose points are near each other.
fn connected(
    classes: &[u8],
    points: &[[f32; 3]],
    width: usize,
    height: usize,
    link: f32,
) -> (Vec<u32>, Vec<Piece>) {
    const STEPS: [(isize, isize); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (2, 0), (-2, 0), (0, 2), (0, -2)];
    let mut labels = vec![0u32; classes.len()];
    let mut pieces = Vec::new();
    let mut queue = Vec::new();
    let link_squared = link * link;
    for start in 0..classes.len() {
        if classes[start] == 0 || labels[start] != 0 {
            continue;
        }
        let label = pieces.len() as u32 + 1;
        let mut piece = Piece { pixels: 0, seeds: 0 };
        labels[start] = label;
        queue.push(start);
        while let Some(i) = queue.pop() {
            piece.pixels += 1;
            piece.seeds += usize::from(classes[i] == 2);
            let (u, v) = ((i % width) as isize, (i / width) as isize);
            for (du, dv) in STEPS {
                let (x, y) = (u + du, v + dv);
                if x < 0 || y < 0 || x >= width as isize || y >= height as isize {
                    continue;
                }
                let j = y as usize * width + x as usize;
                if classes[j] != 0 && labels[j] == 0 && squared_distance(points[i], points[j]) < link_squared
                {
                    labels[j] = label;
                    queue.push(j);
                }
            }
        }
        pieces.push(piece);
    }
    (labels, pieces)
}

fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

/// A polygon for fast point tests.
struct Polygon {
    corners: Vec<[f32; 2]>,
}

impl Polygon {
    fn new(corners: &[[f64; 2]]) -> Self {
        Self { corners: corners.iter().map(|c| [c[0] as f32, c[1] as f32]).collect() }
    }

    /// Even-odd rule.
    fn contains(&self, x: f32, y: f32) -> bool {
        let mut inside = false;
        let Some(&(mut previous)) = self.corners.last() else { return false };
        for &c in &self.corners {
            if (c[1] > y) != (previous[1] > y)
                && x < (previous[0] - c[0]) * (y - c[1]) / (previous[1] - c[1]) + c[0]
            {
                inside = !inside;
            }
            previous = c;
        }
        inside
    }
}

/// Convex hull, counter-clockwise (Andrew's monotone chain).
pub fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let turn =
        |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// A convex polygon grown outwards from its centroid by about `by` metres.
fn grown(polygon: &[[f64; 2]], by: f64) -> Vec<[f64; 2]> {
    let n = polygon.len().max(1) as f64;
    let centre = polygon.iter().fold([0.0, 0.0], |s, c| [s[0] + c[0] / n, s[1] + c[1] / n]);
    let move_out = |c: &[f64; 2]| {
        let (dx, dy) = (c[0] - centre[0], c[1] - centre[1]);
        let length = dx.hypot(dy).max(1e-9);
        let factor = (length + by * std::f64::consts::SQRT_2) / length;
        [centre[0] + dx * factor, centre[1] + dy * factor]
    };
    polygon.iter().map(move_out).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Intrinsics;

    #[test]
    fn a_hull_leaves_out_what_is_inside() {
        let hull = convex_hull(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0]]);
        assert_eq!(hull, [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
    }

    /// A camera looking straight down from 1 m on a board with a block on it and another block beside the region.
    #[test]
    fn the_block_inside_is_kept_and_all_else_is_not() {
        let camera = Intrinsics::pinhole(200, 200, 200.0, 200.0, 99.5, 99.5);
        let rays = camera.ray_table();
        let block = |x: f32, y: f32, cx: f32| (x - cx).abs() < 0.05 && y.abs() < 0.05;
        let depth: Vec<f32> = rays
            .iter()
            .map(|r| {
                let (x, y) = (r[0] * 0.9, r[1] * 0.9);
                if block(x, y, 0.0) || block(x, y, 0.2) { 0.9 } else { 1.0 }
            })
            .collect();
        let view = DepthView::new(camera, &rays, &depth);
        // looking down: camera x = world x, camera y = -world y, camera z = -world z
        let world_from_camera = Pose::new(
            nalgebra::Vector3::new(0.0, 0.0, 1.0),
            nalgebra::Vector3::new(std::f64::consts::PI, 0.0, 0.0),
        );
        let square = |s: f64| vec![[-s, -s], [s, -s], [s, s], [-s, s]];
        let region = Region { inner: square(0.1), outer: square(0.3) };
        let cut = cut(&view, &world_from_camera, &region, &SegmentConfig::default());
        let expected = rays.iter().filter(|r| block(r[0] * 0.9, r[1] * 0.9, 0.0)).count();
        assert_eq!(cut.product_pixels, expected);
        assert!(cut.outside_pixels > 200);
    }
}
