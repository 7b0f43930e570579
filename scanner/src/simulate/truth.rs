//! Judging against the truth: exact distances to a mesh, and pose errors as the checking tool defines them.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use reconstruct::mesh::Mesh;
use reconstruct::pose::{Pose, rotation_error_radians};

/// Side of the cells in which triangles are looked up, metres.
const CELL: f32 = 0.004;
/// Distances are not measured farther than this, metres.
pub const FARTHEST: f32 = 0.05;

/// A mesh that answers how far a point is from its surface.
pub struct Surface {
    corners: Vec<[Vector3<f32>; 3]>,
    low: Vector3<f32>,
    count: [usize; 3],
    /// Triangles that touch each cell: those of cell `i` are `members[start[i]..start[i + 1]]`.
    start: Vec<u32>,
    members: Vec<u32>,
}

impl Surface {
    /// Sorts the triangles of a mesh into cells. `None` where the mesh has no triangle or is larger than 2 m.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let (low, high) = mesh.vertices.bounds()?;
        let (low, high) = (Vector3::from(low), Vector3::from(high));
        if mesh.triangles.is_empty() || (high - low).max() > 2.0 {
            return None;
        }
        let point = |i: u32| Vector3::from(mesh.vertices.points[i as usize]);
        let corners: Vec<_> = mesh.triangles.iter().map(|t| t.map(point)).collect();
        let count: [usize; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / CELL) as usize + 1);
        let mut surface = Self { corners, low, count, start: Vec::new(), members: Vec::new() };
        let mut of_cell = vec![Vec::new(); count.iter().product()];
        for (i, triangle) in surface.corners.iter().enumerate() {
            let [a, b, c] = triangle.map(|p| surface.cell(p));
            let range = |k: usize| a[k].min(b[k]).min(c[k])..=a[k].max(b[k]).max(c[k]);
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        of_cell[surface.index([x, y, z])].push(i as u32);
                    }
                }
            }
        }
        surface.start.push(0);
        for cell in of_cell {
            surface.members.extend(cell);
            surface.start.push(surface.members.len() as u32);
        }
        Some(surface)
    }

    /// Distance in metres from a point to the surface, at most [`FARTHEST`].
    pub fn distance(&self, point: [f32; 3]) -> f32 {
        let p = Vector3::from(point);
        let home = self.cell(p);
        // Distance from the point to the grid's box: cells are no nearer than that.
        let outside = (0..3)
            .map(|k| {
                let high = self.low[k] + self.count[k] as f32 * CELL;
                (self.low[k] - p[k]).max(p[k] - high).max(0.0)
            })
            .fold(0.0, f32::max);
        let mut best = FARTHEST * FARTHEST;
        for ring in 0..=(FARTHEST / CELL) as usize + 1 {
            let reach = outside.max((ring as f32 - 1.0) * CELL);
            if ring > 0 && reach * reach > best {
                break;
            }
            self.each_in_ring(home, ring, |triangle| {
                best = best.min(squared_distance(p, &self.corners[triangle as usize]));
            });
        }
        best.sqrt()
    }

    /// Visits the triangles of all cells whose largest step from `home` is `ring`.
    fn each_in_ring(&self, home: [usize; 3], ring: usize, mut visit: impl FnMut(u32)) {
        let range = |k: usize| home[k].saturating_sub(ring)..=(home[k] + ring).min(self.count[k] - 1);
        for z in range(2) {
            for y in range(1) {
                let inner = z.abs_diff(home[2]).max(y.abs_diff(home[1])) < ring;
                for x in range(0) {
                    if inner && x.abs_diff(home[0]) < ring {
                        continue;
                    }
                    let i = self.index([x, y, z]);
                    self.members[self.start[i] as usize..self.start[i + 1] as usize]
                        .iter()
                        .for_each(|&t| visit(t));
                }
            }
        }
    }

    fn cell(&self, p: Vector3<f32>) -> [usize; 3] {
        std::array::from_fn(|k| (((p[k] - self.low[k]) / CELL).max(0.0) as usize).min(self.count[k] - 1))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.count[1] + y) * self.count[0] + x
    }
}

/// Squared distance from a point to a triangle (Ericson 2004, section 5.1.5).
fn squared_distance(p: Vector3<f32>, [a, b, c]: &[Vector3<f32>; 3]) -> f32 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.norm_squared();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.norm_squared();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (ap - ab * (d1 / (d1 - d3))).norm_squared();
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.norm_squared();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (ap - ac * (d2 / (d2 - d6))).norm_squared();
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (bp - (c - b) * t).norm_squared();
    }
    let scale = 1.0 / (va + vb + vc);
    (ap - ab * (vb * scale) - ac * (vc * scale)).norm_squared()
}

/// Distances in metres of a model's points, one point for every cell of 1 mm so that duplicates weigh nothing; sorted.
pub fn surface_errors(surface: &Surface, points: &[[f32; 3]]) -> Vec<f32> {
    let mut one_a_cell = BTreeMap::new();
    for p in points.iter().filter(|p| p.iter().all(|v| v.is_finite())) {
        one_a_cell.entry(p.map(|v| (v / 0.001).floor() as i32)).or_insert(*p);
    }
    let mut errors: Vec<f32> = one_a_cell.values().map(|p| surface.distance(*p)).collect();
    errors.sort_by(f32::total_cmp);
    errors
}

/// Error of one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseError {
    /// Between the rotations, degrees.
    pub degrees: f64,
    /// How far the pose displaces the product's centre, metres.
    pub metres: f64,
}

/// Compares an estimated `world_from_camera` with the true one; `centre` is the mean of the product's vertices.
pub fn pose_error(truth: &Pose, estimate: &Pose, centre: &Point3<f64>) -> PoseError {
    PoseError {
        degrees: rotation_error_radians(truth, estimate).to_degrees(),
        metres: (truth * estimate.inverse() * centre - centre).norm(),
    }
}

/// Mean of a mesh's vertices, metres.
pub fn centre(mesh: &Mesh) -> Point3<f64> {
    let sum: Vector3<f64> = mesh.vertices.points.iter().map(|p| Vector3::from(*p).cast::<f64>()).sum();
    Point3::from(sum / mesh.vertices.len().max(1) as f64)
}

/// The value below which a share of sorted values lies; NaN for none.
pub fn percentile(sorted: &[f32], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = share.clamp(0.0, 1.0) * last as f64;
    let (below, t) = (at.floor() as usize, at.fract());
    let above = (below + 1).min(last);
    f64::from(sorted[below]) * (1.0 - t) + f64::from(sorted[above]) * t
}

#[cfg(test)]
mod tests {
    use reconstruct::cloud::PointCloud;

    use super::*;
    use crate::simulate::product::{Kind, Product};

    #[test]
    fn distances_agree_with_the_slow_way() {
        let mesh = Product::new(Kind::Mug, 1).mesh();
        let surface = Surface::of(&mesh).unwrap();
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..60 {
            let p: [f32; 3] = std::array::from_fn(|_| 0.14 * rng.f32() - 0.05);
            let slow =
                surface.corners.iter().map(|t| squared_distance(p.into(), t)).fold(f32::INFINITY, f32::min);
            let expected = slow.sqrt().min(FARTHEST);
            assert!((surface.distance(p) - expected).abs() < 1e-6, "{p:?} {expected}");
        }
        assert_eq!(surface.distance([1.0, 1.0, 1.0]), FARTHEST);
        assert_eq!(surface.distance([-3.0, 0.0, 0.05]), FARTHEST);
    }

    #[test]
    fn the_nearest_part_may_be_face_edge_or_corner() {
        let points = vec![[0.0; 3], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]];
        let vertices = PointCloud { points, ..PointCloud::default() };
        let surface = Surface::of(&Mesh { vertices, triangles: vec![[0, 1, 2]], ..Mesh::default() }).unwrap();
        for (p, expected) in [
            ([0.002, 0.002, 0.003], 0.003),
            ([-0.003, -0.004, 0.0], 0.005),
            ([0.005, -0.002, 0.0], 0.002),
            ([0.01, 0.01, 0.0], 0.005 * std::f32::consts::SQRT_2),
        ] {
            assert!((surface.distance(p) - expected).abs() < 1e-6, "{p:?}");
        }
    }

    #[test]
    fn a_slide_of_the_camera_moves_the_product_by_as_much() {
        let truth = Pose::translation(0.1, 0.2, 0.3);
        let error = pose_error(&truth, &(Pose::translation(0.003, 0.0, 0.004) * truth), &Point3::origin());
        assert!((error.metres - 0.005).abs() < 1e-12 && error.degrees < 1e-9);
    }
}
