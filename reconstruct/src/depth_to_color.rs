//! Registers depth to colour: a depth map seen from the depth camera becomes one seen from the colour camera.
//!
//! Every depth pixel is brought into the colour camera's frame; neighbours on one surface span triangles that are drawn
//! with a depth buffer, so that nothing tears where the picture grows and what is hidden stays hidden. Depth is along z
//! of the camera in which it is given, metres; NaN or 0 = no value.

use nalgebra::Point3;

use crate::camera::Intrinsics;
use crate::image::DepthImage;
use crate::pose::Pose;
use crate::recording::Rig;

/// Neighbours whose depths differ by more than this part belong to different surfaces.
const JUMP: f32 = 0.03;

/// Whether depth must be registered before a pixel of both images is the same ray.
pub fn is_needed(rig: &Rig) -> bool {
    rig.color != rig.depth || rig.color_from_depth != Pose::identity()
}

/// Rays of the depth camera's pixels, worked out once for all frames of a recording.
#[derive(Debug, Clone)]
pub struct Registration {
    rig: Rig,
    rays: Vec<[f32; 2]>,
}

/// A depth pixel in the colour picture: column, row, depth; NaN where there is none.
type Seen = [f32; 3];

impl Registration {
    /// Prepares for a rig's cameras.
    pub fn new(rig: &Rig) -> Self {
        Self { rig: *rig, rays: rig.depth.ray_table() }
    }

    /// The depth map in the colour camera's geometry (`color.width * color.height`, NaN = none) of one in the depth
    /// camera's (`depth.width * depth.height`); metres. Rows that are missing count as not measured.
    pub fn register(&self, depth_metres: &[f32]) -> Vec<f32> {
        let (width, height) = (self.rig.depth.width as usize, self.rig.depth.height as usize);
        let seen: Vec<Seen> =
            (0..width * height).map(|i| self.see(i, depth_metres.get(i).copied())).collect();
        let mut out = Buffer::new(&self.rig.color);
        for y in 1..height {
            for x in 1..width {
                let [a, b, c, d] =
                    [(x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y)].map(|(x, y)| seen[y * width + x]);
                // The diagonal between the more alike corners; either half may stand alone.
                if (a[2] - d[2]).abs() <= (b[2] - c[2]).abs() || b[2].is_nan() || c[2].is_nan() {
                    out.draw([a, b, d]);
                    out.draw([a, d, c]);
                } else {
                    out.draw([a, b, c]);
                    out.draw([b, d, c]);
                }
            }
        }
        for &seen in &seen {
            out.mark(seen);
        }
        out.depth.iter().map(|&d| if d.is_finite() { d } else { f32::NAN }).collect()
    }

    /// As [`Self::register`] on raw images; the values keep their unit.
    pub fn register_image(&self, depth: &DepthImage) -> DepthImage {
        let units = depth.units_per_metre;
        let metres: Vec<f32> = depth.data.iter().map(|&raw| (f64::from(raw) / units) as f32).collect();
        let raw = |metres: f32| {
            let raw = (f64::from(metres) * units).round();
            if raw >= 1.0 && raw <= f64::from(u16::MAX) { raw as u16 } else { 0 }
        };
        let data = self.register(&metres).into_iter().map(raw).collect();
        let (width, height) = (self.rig.color.width as usize, self.rig.color.height as usize);
        DepthImage { width, height, data, units_per_metre: units }
    }

    fn see(&self, i: usize, metres: Option<f32>) -> Seen {
        const NOTHING: Seen = [f32::NAN; 3];
        let Some(z) = metres.filter(|z| z.is_finite() && *z > 0.0).map(f64::from) else { return NOTHING };
        let [x, y] = self.rays[i].map(f64::from);
        let point = self.rig.color_from_depth * Point3::new(x * z, y * z, z);
        let pixel = self.rig.color.project(&point);
        pixel.map_or(NOTHING, |pixel| [pixel.x as f32, pixel.y as f32, point.z as f32])
    }
}

/// The colour camera's depth buffer.
struct Buffer {
    width: usize,
    height: usize,
    depth: Vec<f32>,
}

impl Buffer {
    fn new(camera: &Intrinsics) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        Self { width, height, depth: vec![f32::INFINITY; width * height] }
    }

    /// Draws the triangle of three neighbours where they lie on one surface.
    fn draw(&mut self, corners: [Seen; 3]) {
        let depths = corners.map(|c| c[2]);
        let (near, far) = (depths[0].min(depths[1]).min(depths[2]), depths[0].max(depths[1]).max(depths[2]));
        // NaN fails the comparison: `min` and `max` skip it, so it is asked for.
        if depths.iter().any(|d| d.is_nan()) || far - near > JUMP * near {
            return;
        }
        let low =
            |k: usize| corners.iter().map(|c| c[k]).fold(f32::INFINITY, f32::min).ceil().max(0.0) as usize;
        let high = |k: usize, side: usize| {
            let most = corners.iter().map(|c| c[k]).fold(f32::NEG_INFINITY, f32::max).floor();
            (most + 1.0).clamp(0.0, side as f32) as usize
        };
        let edge = |a: Seen, b: Seen, x: f32, y: f32| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
        let [a, b, c] = corners;
        let area = edge(a, b, c[0], c[1]);
        if area.abs() < 1e-6 {
            return;
        }
        for y in low(1)..high(1, self.height) {
            for x in low(0)..high(0, self.width) {
                let (u, v) = (x as f32, y as f32);
                let weights = [edge(b, c, u, v), edge(c, a, u, v), edge(a, b, u, v)].map(|w| w / area);
                if weights.iter().all(|&w| w >= 0.0) {
                    // On a plane the inverse of the depth is linear in the picture.
                    let inverse: f32 = weights.iter().zip(depths).map(|(w, d)| w / d).sum();
                    let old = &mut self.depth[y * self.width + x];
                    *old = old.min(1.0 / inverse);
                }
            }
        }
    }

    /// Marks the nearest pixel where no surface was drawn, or one clearly behind: edges and lone pixels.
    fn mark(&mut self, [u, v, depth]: Seen) {
        let (x, y) = (u.round(), v.round());
        if x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32 {
            let old = &mut self.depth[y as usize * self.width + x as usize];
            if depth < *old * (1.0 - JUMP) {
                *old = depth;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose;
    use nalgebra::{Point2, Vector3, Vector6};

    /// A Kinect's cameras: shifted, slightly turned, distorted.
    fn rig() -> Rig {
        let mut color = Intrinsics::pinhole(320, 240, 264.0, 262.0, 164.0, 133.0);
        color.distortion = [0.26, -0.84, -0.002, 0.0014, 0.91];
        let mut depth = Intrinsics::pinhole(320, 240, 297.0, 295.0, 169.0, 121.0);
        depth.distortion = [-0.26, 1.0, -0.0008, 0.005, -1.3];
        let color_from_depth = pose::exp(&Vector6::new(0.02, -0.0007, -0.011, 0.01, -0.02, 0.005));
        Rig { color, depth, color_from_depth }
    }

    /// Depth of a plane `normal . p = distance` (depth camera's frame) as a camera sees it.
    fn plane(camera: &Intrinsics, normal: &Vector3<f64>, distance: f64) -> Vec<f32> {
        let pixels = (0..camera.height).flat_map(|v| (0..camera.width).map(move |u| (u, v)));
        let depth = |(u, v): (u32, u32)| {
            let ray = camera.ray(&Point2::new(f64::from(u), f64::from(v)));
            (distance / normal.dot(&Vector3::new(ray.x, ray.y, 1.0))) as f32
        };
        pixels.map(depth).collect()
    }

    #[test]
    fn a_plane_arrives_where_the_colour_camera_sees_it() {
        let rig = rig();
        let (normal, distance) = (Vector3::new(0.3, -0.2, 1.0).normalize(), 0.9);
        let registered = Registration::new(&rig).register(&plane(&rig.depth, &normal, distance));
        let turned = rig.color_from_depth.rotation * normal;
        let moved = distance + turned.dot(&rig.color_from_depth.translation.vector);
        let truth = plane(&rig.color, &turned, moved);
        let mut inside = 0;
        for (i, (&found, &expected)) in registered.iter().zip(&truth).enumerate() {
            let (x, y) = (i % 320, i / 320);
            if (40..280).contains(&x) && (40..200).contains(&y) {
                assert!((found - expected).abs() < 2e-4, "{x} {y}: {found} for {expected}");
                inside += 1;
            }
        }
        assert_eq!(inside, 240 * 160);
    }

    #[test]
    fn what_is_in_front_hides_what_is_behind() {
        let mut rig = rig();
        (rig.color.distortion, rig.depth.distortion) = ([0.0; 5], [0.0; 5]);
        (rig.color, rig.color_from_depth) = (rig.depth, Pose::translation(0.05, 0.0, 0.0));
        let near = |i: usize| if (100..200).contains(&(i % 320)) { 0.5 } else { 1.0 };
        let depth: Vec<f32> = (0..320 * 240).map(near).collect();
        let out = Registration::new(&rig).register(&depth);
        let row = &out[120 * 320..121 * 320];
        // 5 cm to the side move the near part by 29.7 pixels, the far one by 14.85.
        assert!(row[131..229].iter().all(|&d| (d - 0.5).abs() < 1e-6));
        assert!(row[231..310].iter().all(|&d| (d - 1.0).abs() < 1e-6));
        // What the near part uncovers on its left was never measured.
        assert!(row[117..128].iter().all(|d| d.is_nan()), "{:?}", &row[110..135]);
    }

    #[test]
    fn nothing_measured_gives_nothing() {
        let rig = rig();
        let registration = Registration::new(&rig);
        assert!(registration.register(&[]).iter().all(|d| d.is_nan()));
        let image = DepthImage { width: 320, height: 240, data: vec![0; 320 * 240], units_per_metre: 1000.0 };
        assert!(registration.register_image(&image).data.iter().all(|&raw| raw == 0));
        assert!(is_needed(&rig));
        let same = Rig { color: rig.depth, color_from_depth: Pose::identity(), ..rig };
        assert!(!is_needed(&same));
    }

    #[test]
    fn registered_images_keep_their_unit() {
        let color = Intrinsics::pinhole(64, 48, 60.0, 60.0, 31.5, 23.5);
        let rig = Rig { color, depth: color, color_from_depth: Pose::translation(0.0, 0.0, 0.1) };
        let image = DepthImage { width: 64, height: 48, data: vec![5000; 64 * 48], units_per_metre: 5000.0 };
        let out = Registration::new(&rig).register_image(&image);
        assert_eq!(out.data[24 * 64 + 32], 5500);
        assert_eq!(out.units_per_metre, 5000.0);
    }
}
