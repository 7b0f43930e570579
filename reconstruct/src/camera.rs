//! Pinhole camera with radial and tangential distortion (Brown 1971, OpenCV's order `k1 k2 p1 p2 k3`).
//!
//! Pixels: (0, 0) is the **centre** of the top-left pixel. Camera frame: x right, y down, z forward, metres.

use nalgebra::{Point2, Point3};
use serde::{Deserialize, Serialize};

/// One camera's geometry, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, pixels from the centre of the top-left pixel.
    pub cx: f64,
    /// Principal point, pixels from the centre of the top-left pixel.
    pub cy: f64,
    /// `k1 k2 p1 p2 k3`; all zero for an ideal pinhole.
    #[serde(default)]
    pub distortion: [f64; 5],
}

impl Intrinsics {
    /// An ideal pinhole without distortion.
    pub fn pinhole(width: u32, height: u32, fx: f64, fy: f64, cx: f64, cy: f64) -> Self {
        Self { width, height, fx, fy, cx, cy, distortion: [0.0; 5] }
    }

    /// Whether the numbers describe a camera at all.
    pub fn is_valid(&self) -> bool {
        let finite =
            [self.fx, self.fy, self.cx, self.cy].iter().chain(&self.distortion).all(|v| v.is_finite());
        finite && self.fx > 0.0 && self.fy > 0.0 && self.width > 0 && self.height > 0
    }

    /// Whether the lens bends rays.
    pub fn is_distorted(&self) -> bool {
        self.distortion.iter().any(|&k| k != 0.0)
    }

    /// Pixel of a point in the camera frame; `None` at or behind the camera.
    pub fn project(&self, point: &Point3<f64>) -> Option<Point2<f64>> {
        if point.z <= 1e-9 {
            return None;
        }
        let (x, y) = self.distort(point.x / point.z, point.y / point.z);
        Some(Point2::new(self.fx * x + self.cx, self.fy * y + self.cy))
    }

    /// Ray through a pixel as the undistorted point on the plane z = 1.
    pub fn ray(&self, pixel: &Point2<f64>) -> Point2<f64> {
        let (x, y) = self.undistort((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy);
        Point2::new(x, y)
    }

    /// Point in the camera frame at `depth` metres along z through a pixel.
    pub fn unproject(&self, pixel: &Point2<f64>, depth: f64) -> Point3<f64> {
        let ray = self.ray(pixel);
        Point3::new(ray.x * depth, ray.y * depth, depth)
    }

    /// Rays of all pixels, row-major, as [`Self::ray`]: computed once where a whole image is unprojected.
    pub fn ray_table(&self) -> Vec<[f32; 2]> {
        let pixels = (0..self.height).flat_map(|v| (0..self.width).map(move |u| (u, v)));
        pixels
            .map(|(u, v)| {
                let r = self.ray(&Point2::new(f64::from(u), f64::from(v)));
                [r.x as f32, r.y as f32]
            })
            .collect()
    }

    /// Normalised coordinates bent by the lens.
    fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// Inverse of [`Self::distort`] by fixed-point iteration.
    fn undistort(&self, xd: f64, yd: f64) -> (f64, f64) {
        if !self.is_distorted() {
            return (xd, yd);
        }
        let (mut x, mut y) = (xd, yd);
        for _ in 0..60 {
            let (px, py) = self.distort(x, y);
            let (ex, ey) = (xd - px, yd - py);
            x += ex;
            y += ey;
            if ex * ex + ey * ey < 1e-24 {
                break;
            }
        }
        (x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn project_undoes_unproject(u in 20.0f64..620.0, v in 20.0f64..460.0, depth in 0.3f64..3.0) {
            let mut camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
            camera.distortion = [0.1, -0.15, 0.001, -0.002, 0.05];
            let pixel = Point2::new(u, v);
            let back = camera.project(&camera.unproject(&pixel, depth)).unwrap();
            prop_assert!((back - pixel).norm() < 1e-6, "{back} {pixel}");
        }
    }

    #[test]
    fn nothing_behind_the_camera_is_seen() {
        let camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
        assert!(camera.project(&Point3::new(0.0, 0.0, -1.0)).is_none());
    }
}
