//! Surface normals and curvature by principal component analysis of neighbouring points.
//!
//! The normal is the direction of least spread; the curvature is the surface variation
//! `λ0 / (λ0 + λ1 + λ2)` of Pauly, Gross and Kobbelt (2002), the measure by which the source picks key points (slide 22).
//! Any frame, metres; normals point to the viewpoint.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::knn::{Neighbour, Tree};
use crate::simd::run;

mod eigen;
mod organised;
mod orient;
mod scattered;

pub use orient::orient;

/// Which points are neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Neighbourhood {
    /// The k nearest, the point itself included.
    Nearest(usize),
    /// All within a radius in metres.
    Radius(f32),
}

impl Neighbourhood {
    /// The neighbours of a place.
    pub fn of(self, tree: &Tree, query: &[f32; 3]) -> Vec<Neighbour> {
        match self {
            Self::Nearest(count) => tree.nearest_n(query, count),
            Self::Radius(radius) => tree.within_radius_unsorted(query, radius),
        }
    }
}

/// Normals and curvatures, one a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// Unit normals; zero where there are too few neighbours to tell.
    pub normals: Vec<[f32; 3]>,
    /// Surface variation 0 (flat) to 1/3 (no direction); 0 where there is no normal.
    pub curvatures: Vec<f32>,
}

/// Normals and curvatures of points, the normals turned to `viewpoint`; `tree` is that of the same points.
pub fn estimate(
    points: &[[f32; 3]],
    tree: &Tree,
    neighbourhood: Neighbourhood,
    viewpoint: &[f32; 3],
) -> Surface {
    let leaves = tree.leaves();
    let chunks: Vec<_> = leaves
        .par_chunks(scattered::LEAVES)
        .map(|leaves| run(scattered::Chunk { tree, leaves, neighbourhood, viewpoint: *viewpoint }))
        .collect();
    let mut surface = Surface { normals: vec![[0.0; 3]; points.len()], curvatures: vec![0.0; points.len()] };
    for (&index, (normal, curvature)) in tree.indices().iter().zip(chunks.into_iter().flatten()) {
        surface.normals[index as usize] = normal;
        surface.curvatures[index as usize] = curvature;
    }
    surface
}

/// How far two neighbouring pixels may differ in depth and still lie on one surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthJump {
    /// Metres at any depth.
    pub metres: f32,
    /// Metres per square metre of depth: the sensor's steps grow with z².
    pub per_square_metre: f32,
}

impl Default for DepthJump {
    fn default() -> Self {
        Self { metres: 0.006, per_square_metre: 0.012 }
    }
}

/// Normals of an organised depth map in the camera frame; the camera is at the origin.
///
/// `points` has `width * height` rows, row-major, NaN where there is no depth. A pixel's neighbours are those of its column
/// within `radius_px` that don't jump in depth from it, and of their rows those that don't jump from them; where these are less
/// than half of the square window, those of the window that don't jump from the pixel. Fewer than a third of the window, or
/// pixels on one line, give no normal.
pub fn normals_of_depth(
    points: &[[f32; 3]],
    width: usize,
    height: usize,
    radius_px: usize,
    jump: DepthJump,
) -> Surface {
    if width == 0 || points.len() != width.saturating_mul(height) {
        return Surface { normals: vec![[0.0; 3]; points.len()], curvatures: vec![0.0; points.len()] };
    }
    organised::surface(points, width, radius_px, jump)
}

/// Sums for a covariance, relative to a nearby origin so that nothing cancels.
struct Moments {
    count: usize,
    sum: [f32; 3],
    products: [f32; 6],
}

impl Moments {
    /// Of the coordinates' sums and those of their products.
    fn of_sums(count: usize, sums: [f32; 9]) -> Self {
        let [x, y, z, products @ ..] = sums;
        Self { count, sum: [x, y, z], products }
    }

    #[cfg(test)]
    fn of_points(origin: &[f32; 3], points: impl Iterator<Item = [f32; 3]>) -> Self {
        let (mut count, mut sums) = (0, [0.0; 9]);
        for p in points {
            let [x, y, z] = [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]];
            count += 1;
            for (sum, v) in sums.iter_mut().zip([x, y, z, x * x, x * y, x * z, y * y, y * z, z * z]) {
                *sum += v;
            }
        }
        Self::of_sums(count, sums)
    }

    fn surface(&self, p: &[f32; 3], viewpoint: &[f32; 3]) -> ([f32; 3], f32) {
        let nothing = ([0.0; 3], 0.0);
        if self.count < 3 {
            return nothing;
        }
        let n = self.count as f64;
        let [mx, my, mz] = self.sum.map(|v| f64::from(v) / n);
        let [xx, xy, xz, yy, yz, zz] = self.products.map(|v| f64::from(v) / n);
        let covariance = [xx - mx * mx, xy - mx * my, xz - mx * mz, yy - my * my, yz - my * mz, zz - mz * mz];
        let Some((normal, curvature)) = least_direction(&covariance) else { return nothing };
        let to_viewer = Vector3::from(*viewpoint) - Vector3::from(*p);
        let normal: Vector3<f32> = normal.map(|v| v as f32);
        let normal = if normal.dot(&to_viewer) < 0.0 { -normal } else { normal };
        (normal.into(), curvature as f32)
    }
}

/// Unit eigenvector of the smallest eigenvalue of `[xx, xy, xz, yy, yz, zz]`, and that eigenvalue's share of the trace.
/// `None` where the points are one or lie on a line, so that the direction is not defined.
///
/// Eigenvalues by the trigonometric solution of the characteristic cubic (Smith 1961); the eigenvector is the largest
/// cross product of two rows of `C - λI`, all of which are orthogonal to it.
pub(crate) fn least_direction(c: &[f64; 6]) -> Option<(Vector3<f64>, f64)> {
    let trace = c[0] + c[3] + c[5];
    if !(trace.is_finite() && trace > 1e-18) {
        return None;
    }
    let [xx, xy, xz, yy, yz, zz] = c.map(|v| v / trace);
    let mean = 1.0 / 3.0;
    let off = xy * xy + xz * xz + yz * yz;
    let spread = ((xx - mean).powi(2) + (yy - mean).powi(2) + (zz - mean).powi(2) + 2.0 * off).max(0.0) / 6.0;
    let p = spread.sqrt();
    if p < 1e-9 {
        return None;
    }
    let b = Matrix3::new(xx - mean, xy, xz, xy, yy - mean, yz, xz, yz, zz - mean) / p;
    let phi = (b.determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    let third = 2.0 * std::f64::consts::FRAC_PI_3;
    let least = (mean + 2.0 * p * (phi + third).cos()).max(0.0);
    let middle = mean + 2.0 * p * (phi - third).cos();
    if middle - least < 1e-6 {
        return None;
    }
    let rows = [
        Vector3::new(xx - least, xy, xz),
        Vector3::new(xy, yy - least, yz),
        Vector3::new(xz, yz, zz - least),
    ];
    let candidates = [rows[0].cross(&rows[1]), rows[0].cross(&rows[2]), rows[1].cross(&rows[2])];
    let best = candidates.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    best.try_normalize(1e-12).map(|normal| (normal, least))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::on_every_path;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvector_agrees_with_nalgebra(v in prop::array::uniform9(-1.0f64..1.0)) {
            let a = Matrix3::from_row_slice(&v);
            let c = a * a.transpose();
            let eigen = c.symmetric_eigen();
            let mut order = [0, 1, 2];
            order.sort_by(|i, j| eigen.eigenvalues[*i].total_cmp(&eigen.eigenvalues[*j]));
            let gap = (eigen.eigenvalues[order[1]] - eigen.eigenvalues[order[0]]) / c.trace();
            prop_assume!(gap > 1e-3);
            let (normal, share) =
                least_direction(&[c[(0, 0)], c[(0, 1)], c[(0, 2)], c[(1, 1)], c[(1, 2)], c[(2, 2)]]).unwrap();
            prop_assert!(normal.dot(&eigen.eigenvectors.column(order[0])).abs() > 1.0 - 1e-6);
            prop_assert!((share - eigen.eigenvalues[order[0]] / c.trace()).abs() < 1e-7);
        }
    }

    fn sphere(radius: f32, count: usize) -> Vec<[f32; 3]> {
        let golden = 2.399_963_2f32;
        (0..count)
            .map(|i| {
                let z = 1.0 - (2 * i + 1) as f32 / count as f32;
                let (r, a) = ((1.0 - z * z).sqrt(), golden * i as f32);
                [radius * r * a.cos(), radius * r * a.sin(), radius * z]
            })
            .collect()
    }

    #[test]
    fn normals_of_a_sphere_are_radial_and_face_the_viewer() {
        let points = sphere(0.1, 4000);
        let tree = Tree::new(&points);
        for neighbourhood in [Neighbourhood::Nearest(20), Neighbourhood::Radius(0.01)] {
            let surface = estimate(&points, &tree, neighbourhood, &[0.0; 3]);
            for (p, n) in points.iter().zip(&surface.normals) {
                let radial = -Vector3::from(*p).normalize();
                assert!(radial.dot(&Vector3::from(*n)) > 0.99);
            }
        }
    }

    #[test]
    fn a_line_and_a_lone_point_have_no_normal() {
        let points: Vec<[f32; 3]> = (0..20).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
        let surface = estimate(&points, &Tree::new(&points), Neighbourhood::Nearest(8), &[0.0, 0.0, 1.0]);
        assert!(surface.normals.iter().all(|n| *n == [0.0; 3]));
        let one = estimate(&points[..1], &Tree::new(&points[..1]), Neighbourhood::Nearest(8), &[0.0; 3]);
        assert_eq!(one.normals, vec![[0.0; 3]]);
    }

    #[test]
    fn curvature_is_largest_at_an_edge() {
        let points: Vec<[f32; 3]> = (-20..=20)
            .flat_map(|i| {
                (-20..=20).map(move |j| [i as f32 * 0.01, j as f32 * 0.01, -(i as f32 * 0.01).abs()])
            })
            .collect();
        let surface = estimate(&points, &Tree::new(&points), Neighbourhood::Radius(0.03), &[0.0, 0.0, 9.0]);
        let at = |i: i32| surface.curvatures[((i + 20) * 41 + 20) as usize];
        assert!(at(0) > 0.05 && at(10) < 1e-4 && at(0) > at(2));
    }

    #[test]
    fn organised_normals_do_not_bridge_a_depth_jump() {
        let (width, height) = (40usize, 30usize);
        let points: Vec<[f32; 3]> = (0..width * height)
            .map(|i| {
                let (u, v) = ((i % width) as f32, (i / width) as f32);
                let z = if u < 20.0 { 0.8 } else { 1.0 };
                if v < 1.0 { [f32::NAN; 3] } else { [(u - 20.0) / 500.0 * z, (v - 15.0) / 500.0 * z, z] }
            })
            .collect();
        let surface = normals_of_depth(&points, width, height, 3, DepthJump::default());
        assert_eq!(surface.normals[5], [0.0; 3]);
        for u in [10, 19, 20, 30] {
            let n = surface.normals[15 * width + u];
            assert!(n[2] < -0.999, "{n:?} at {u}");
        }
        assert_eq!(normals_of_depth(&points, 7, 7, 3, DepthJump::default()).normals.len(), points.len());
    }

    /// Present or not alike, and less than `limit` radians apart.
    #[track_caller]
    fn assert_alike(a: &[[f32; 3]], b: &[[f32; 3]], limit: f32) {
        for (a, b) in a.iter().zip(b) {
            let (a, b) = (Vector3::from(*a), Vector3::from(*b));
            assert_eq!(a.norm() > 0.0, b.norm() > 0.0);
            assert!(a.cross(&b).norm() < limit, "{a} {b}");
        }
    }

    #[test]
    fn all_paths_agree_and_so_does_any_number_of_threads() {
        let points = sphere(0.1, 3000);
        let tree = Tree::new(&points);
        for neighbourhood in [Neighbourhood::Nearest(20), Neighbourhood::Radius(0.01)] {
            let leaves = tree.leaves();
            let chunk = || scattered::Chunk {
                tree: &tree,
                leaves: &leaves,
                neighbourhood,
                viewpoint: [0.0, 0.0, 1.0],
            };
            let normals =
                |rows: Vec<([f32; 3], f32)>| -> Vec<[f32; 3]> { rows.iter().map(|r| r.0).collect() };
            let paths: Vec<_> = on_every_path(chunk).into_iter().map(normals).collect();
            for path in &paths[1..] {
                assert_alike(&paths[0], path, 1e-4);
            }
            let on = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| estimate(&points, &tree, neighbourhood, &[0.0; 3]))
            };
            assert!(on(1) == on(3));
        }
    }

    #[test]
    fn the_nearest_are_found_among_equal_distances_and_far_strays() {
        // A lattice has many equal distances; of those as far as the last the lowest indices count.
        let mut points: Vec<[f32; 3]> =
            (0..900).map(|i| [(i % 30) as f32, (i / 30) as f32, (i % 7) as f32 * 0.01]).collect();
        points.extend([[500.0, 3.0, 1.0], [500.0, 4.0, 2.0], [-9000.0, 1.0, 5.0]]);
        let tree = Tree::new(&points);
        let found = estimate(&points, &tree, Neighbourhood::Nearest(12), &[0.0, 0.0, 1e5]);
        for (i, p) in points.iter().enumerate() {
            let near = tree.nearest_n(p, 12);
            let moments = Moments::of_points(p, near.iter().map(|n| points[n.index]));
            let (expected, _) = moments.surface(p, &[0.0, 0.0, 1e5]);
            assert_alike(&[found.normals[i]], &[expected], 1e-3);
        }
    }

    #[test]
    fn organised_normals_are_those_of_the_plain_window() {
        let (width, height, radius) = (61usize, 43usize, 3usize);
        let mut rng = fastrand::Rng::with_seed(8);
        let points: Vec<[f32; 3]> = (0..width * height)
            .map(|i| {
                let (u, v) = ((i % width) as f32 - 30.0, (i / width) as f32 - 21.0);
                let z = if u < 5.0 { 0.8 + 0.001 * u } else { 1.0 + 0.002 * v } + 0.001 * rng.f32();
                if rng.u8(..) < 8 { [f32::NAN; 3] } else { [u / 525.0 * z, v / 525.0 * z, z] }
            })
            .collect();
        let jump = DepthJump::default();
        let found = normals_of_depth(&points, width, height, radius, jump);
        let mut angles = Vec::new();
        for (i, p) in points.iter().enumerate().filter(|(_, p)| p[2].is_finite()) {
            let (u, v) = (i % width, i / width);
            let limit = jump.metres + jump.per_square_metre * p[2] * p[2];
            let rows = v.saturating_sub(radius)..(v + radius + 1).min(height);
            let columns = u.saturating_sub(radius)..(u + radius + 1).min(width);
            let window = rows.flat_map(|y| columns.clone().map(move |x| y * width + x)).map(|at| points[at]);
            let moments = Moments::of_points(p, window.filter(|q| (q[2] - p[2]).abs() <= limit));
            let (expected, _) = moments.surface(p, &[0.0; 3]);
            if found.normals[i] != [0.0; 3] {
                angles.push(Vector3::from(expected).cross(&Vector3::from(found.normals[i])).norm());
            }
        }
        angles.sort_by(f32::total_cmp);
        assert!(angles.len() > 2300, "{}", angles.len());
        assert!(angles[angles.len() / 2] < 0.005 && angles[angles.len() * 99 / 100] < 0.08);
    }
}
