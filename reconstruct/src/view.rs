//! One view as geometry: depth, normals and product mask of every pixel of the colour camera.

use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::camera::Intrinsics;

/// Organised geometry in the colour camera's frame, row-major, metres.
#[derive(Debug, Clone)]
pub struct DepthView {
    /// The colour camera.
    pub camera: Intrinsics,
    /// Points `[x, y, z]`; z = 0 where nothing was measured.
    pub points: Vec<[f32; 3]>,
    /// Unit normals towards the camera; all zero where none could be told.
    pub normals: Vec<[f32; 3]>,
    /// Whether the pixel belongs to the product.
    pub mask: Vec<bool>,
}

/// Half side of the window in which normals are fitted, pixels.
const NORMAL_RADIUS_PX: isize = 3;

impl DepthView {
    /// Geometry of a depth map (metres, 0 = none) seen through `rays` (one a pixel, on z = 1).
    pub fn new(camera: Intrinsics, rays: &[[f32; 2]], depth_metres: &[f32]) -> Self {
        let points: Vec<[f32; 3]> =
            rays.iter().zip(depth_metres).map(|(r, &z)| [r[0] * z, r[1] * z, z]).collect();
        let (normals, mask) = (vec![[0.0; 3]; points.len()], vec![false; points.len()]);
        Self { camera, points, normals, mask }
    }

    /// Takes `mask` as the product's pixels and fits their normals.
    pub fn set_product(&mut self, mask: Vec<bool>) {
        self.normals = normals(&self.points, &mask, self.camera.width as usize, self.camera.height as usize);
        self.mask = mask;
    }

    /// Moves every measured point along its ray to the depth of its corrected disparity: `correct` gives that of a pixel's (u, v, disparity).
    /// For corrections too small to turn a normal.
    pub fn correct(&mut self, focal_baseline: f64, correct: impl Fn(f64, f64, f64) -> f64) {
        let width = (self.camera.width as usize).max(1);
        for (i, p) in self.points.iter_mut().enumerate().filter(|(_, p)| p[2] > 0.0) {
            let disparity = focal_baseline / f64::from(p[2]);
            let corrected = correct((i % width) as f64, (i / width) as f64, disparity).max(1e-3);
            *p = p.map(|v| (f64::from(v) * disparity / corrected) as f32);
        }
    }

    /// Index of the pixel that a point in this camera's frame falls on.
    pub fn pixel_of(&self, p_in_camera: &Point3<f64>) -> Option<usize> {
        self.index_of(&self.camera.project(p_in_camera)?)
    }

    /// Index of the pixel nearest to a place in the picture; `None` beyond it.
    pub fn index_of(&self, pixel: &Point2<f64>) -> Option<usize> {
        // Rounded by hand: `round` is a call where the processor is not known.
        let (u, v) = (pixel.x + 0.5, pixel.y + 0.5);
        let inside =
            u >= 0.0 && v >= 0.0 && u < f64::from(self.camera.width) && v < f64::from(self.camera.height);
        inside.then(|| v as usize * self.camera.width as usize + u as usize)
    }

    /// How much farther than a point (in this camera's frame) the view sees in its direction, metres, by the nearest of 3x3
    /// pixels; `None` where one of them has no depth.
    pub fn nearest_gap(&self, p_in_camera: &Point3<f64>) -> Option<f64> {
        let centre = self.pixel_of(p_in_camera)?;
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let (u, v) = (centre % width, centre / width);
        let mut best: Option<f64> = None;
        for y in v.saturating_sub(1)..=(v + 1).min(height - 1) {
            for x in u.saturating_sub(1)..=(u + 1).min(width - 1) {
                let z = f64::from(self.points[y * width + x][2]);
                if z <= 0.0 {
                    return None;
                }
                let gap = z - p_in_camera.z;
                if best.is_none_or(|b| gap.abs() < b.abs()) {
                    best = Some(gap);
                }
            }
        }
        best
    }

    /// Indices of the product's pixels that have a normal.
    pub fn product_pixels(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.points.len()).filter(|&i| self.mask[i] && self.normals[i] != [0.0; 3])
    }

    /// Cosine between normal and viewing ray, 0 where there is no normal.
    pub fn incidence_cosine(&self, index: usize) -> f32 {
        let (p, n) = (self.points[index], self.normals[index]);
        let length = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt().max(1e-6);
        (-(p[0] * n[0] + p[1] * n[1] + p[2] * n[2]) / length).max(0.0)
    }
}

/// Normals by a plane fitted to inverse depth in a window: 1/z is linear in the pixel on a plane, and noise is even there.
fn normals(points: &[[f32; 3]], wanted: &[bool], width: usize, height: usize) -> Vec<[f32; 3]> {
    let mut out = vec![[0.0f32; 3]; points.len()];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, out)| {
        for (u, out) in out.iter_mut().enumerate() {
            if wanted[row * width + u]
                && let Some(n) = normal_at(points, width, height, u, row)
            {
                *out = n;
            }
        }
    });
    out
}

/// Least squares of `1/z = a x' + b y' + c` over the window's rays; the plane's normal is along `(a, b, c)`.
fn normal_at(points: &[[f32; 3]], width: usize, height: usize, u: usize, v: usize) -> Option<[f32; 3]> {
    let [px, py, z] = points[v * width + u];
    if z <= 0.0 {
        return None;
    }
    let (x0, y0) = (px / z, py / z);
    // A surface may fall away by this much a pixel before it counts as another one (about 75 degrees at 525 px).
    let edge = 0.0075 * z;
    let (mut xx, mut xy, mut yy, mut sx, mut sy, mut n) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
    let (mut sw, mut xw, mut yw) = (0.0f32, 0.0f32, 0.0f32);
    let w0 = 1.0 / z;
    for dv in -NORMAL_RADIUS_PX..=NORMAL_RADIUS_PX {
        for du in -NORMAL_RADIUS_PX..=NORMAL_RADIUS_PX {
            let (x, y) = (u as isize + du, v as isize + dv);
            if x < 0 || y < 0 || x >= width as isize || y >= height as isize {
                continue;
            }
            let q = points[y as usize * width + x as usize];
            let reach = du.abs().max(dv.abs()).max(1) as f32;
            if q[2] <= 0.0 || (q[2] - z).abs() > edge * reach {
                continue;
            }
            let inverse = 1.0 / q[2];
            let (rx, ry, w) = (q[0] * inverse - x0, q[1] * inverse - y0, inverse - w0);
            xx += rx * rx;
            xy += rx * ry;
            yy += ry * ry;
            sx += rx;
            sy += ry;
            n += 1.0;
            sw += w;
            xw += rx * w;
            yw += ry * w;
        }
    }
    if n < 12.0 {
        return None;
    }
    let (xx, xy, yy) = (xx - sx * sx / n, xy - sx * sy / n, yy - sy * sy / n);
    let (xw, yw) = (xw - sx * sw / n, yw - sy * sw / n);
    let det = xx * yy - xy * xy;
    if det <= 1e-4 * xx * yy || det <= 0.0 {
        return None;
    }
    let a = (yy * xw - xy * yw) / det;
    let b = (xx * yw - xy * xw) / det;
    let c = w0 + (sw - a * sx - b * sy) / n - a * x0 - b * y0;
    let length = (a * a + b * b + c * c).sqrt();
    // n·p = 1 on the plane, so towards the camera it is the negative.
    Some([-a / length, -b / length, -c / length])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_of_a_tilted_plane_is_found() {
        let camera = Intrinsics::pinhole(64, 48, 525.0, 525.0, 31.5, 23.5);
        let normal = nalgebra::Vector3::new(0.5, -0.3, -0.8).normalize();
        let rays = camera.ray_table();
        let depth: Vec<f32> = rays
            .iter()
            .map(|r| {
                (-0.6 / normal.dot(&nalgebra::Vector3::new(f64::from(r[0]), f64::from(r[1]), 1.0))) as f32
            })
            .collect();
        let mut view = DepthView::new(camera, &rays, &depth);
        view.set_product(vec![true; depth.len()]);
        let found = view.normals[24 * 64 + 32];
        let dot =
            normal.x * f64::from(found[0]) + normal.y * f64::from(found[1]) + normal.z * f64::from(found[2]);
        assert!(dot > 0.9999, "{found:?}");
        assert!(view.incidence_cosine(24 * 64 + 32) > 0.7);
    }

    #[test]
    fn a_point_falls_on_its_own_pixel() {
        let camera = Intrinsics::pinhole(64, 48, 525.0, 525.0, 31.5, 23.5);
        let view = DepthView::new(camera, &camera.ray_table(), &vec![0.7; 64 * 48]);
        let p = view.points[10 * 64 + 5];
        assert_eq!(view.pixel_of(&Point3::from(p).cast()), Some(10 * 64 + 5));
    }
}
