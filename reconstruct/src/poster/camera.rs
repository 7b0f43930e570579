//! The camera of the poster: perspective, the product filling the frame.

use nalgebra::Vector3;

use super::PosterConfig;
use crate::cloud::PointCloud;

/// Distance of the camera in half diagonals of the product: a portrait lens.
const DISTANCE: f64 = 5.0;
/// How much of the frame the product fills.
const FILLED: f64 = 0.82;
/// Part of the points that may lie outside of the frame on either side: strays must not shrink the product.
const STRAYS: f64 = 0.001;

#[derive(Debug, Clone)]
pub(super) struct Camera {
    position: Vector3<f32>,
    right: Vector3<f32>,
    down: Vector3<f32>,
    forward: Vector3<f32>,
    /// Pixels.
    pub(super) focal: f32,
    pub(super) center: [f32; 2],
}

impl Camera {
    /// A camera that sees all but the strays of the points; `None` without points.
    pub(super) fn framing(
        cloud: &PointCloud,
        config: &PosterConfig,
        width: usize,
        height: usize,
    ) -> Option<Self> {
        let ranges: Vec<(f32, f32)> =
            (0..3).filter_map(|k| range(cloud.points.iter().map(|p| p[k]))).collect();
        let [x, y, z] = ranges.as_slice() else { return None };
        let middle = Vector3::new(x.0 + x.1, y.0 + y.1, z.0 + z.1) / 2.0;
        let size = Vector3::new(x.1 - x.0, y.1 - y.0, z.1 - z.0).norm().max(1e-6);
        let (sa, ca) = config.azimuth.sin_cos();
        let (se, ce) = config.elevation.clamp(-1.5, 1.5).sin_cos();
        let away = Vector3::new(sa * ce, -ca * ce, se).cast::<f32>();
        let right = Vector3::new(ca, sa, 0.0).cast::<f32>();
        let forward = -away;
        let position = middle + away * (size * 0.5 * DISTANCE as f32);
        let down = forward.cross(&right);
        let mut camera = Self { position, right, down, forward, focal: 1.0, center: [0.0; 2] };
        let seen = |k: usize| {
            range(cloud.points.iter().map(|p| camera.place(*p)).filter(|p| p[2] > 0.0).map(|p| p[k] / p[2]))
        };
        let (h, v) = (seen(0)?, seen(1)?);
        let scale =
            |range: (f32, f32), side: usize| side as f32 * FILLED as f32 / (range.1 - range.0).max(1e-6);
        camera.focal = scale(h, width).min(scale(v, height));
        let center = |range: (f32, f32), side: usize| {
            (side as f32 - 1.0) / 2.0 - camera.focal * (range.0 + range.1) / 2.0
        };
        camera.center = [center(h, width), center(v, height)];
        Some(camera)
    }

    /// Where it stands, world frame.
    pub(super) fn position(&self) -> [f32; 3] {
        self.position.into()
    }

    /// A world point in the camera frame.
    pub(super) fn place(&self, point: [f32; 3]) -> [f32; 3] {
        self.turn((Vector3::from(point) - self.position).into())
    }

    /// A world direction in the camera frame.
    pub(super) fn turn(&self, direction: [f32; 3]) -> [f32; 3] {
        let d = Vector3::from(direction);
        [self.right.dot(&d), self.down.dot(&d), self.forward.dot(&d)]
    }

    /// Pixel of a place in the camera frame; `None` behind the camera.
    pub(super) fn project(&self, place: [f32; 3]) -> Option<[f32; 2]> {
        let scale = self.focal / place[2];
        (place[2] > 1e-6).then(|| [place[0] * scale + self.center[0], place[1] * scale + self.center[1]])
    }

    /// Where the ray of a pixel meets the level `z`, world frame.
    pub(super) fn on_level(&self, pixel: [f32; 2], z: f32) -> Option<[f32; 2]> {
        let [u, v] = [(pixel[0] - self.center[0]) / self.focal, (pixel[1] - self.center[1]) / self.focal];
        let ray = self.right * u + self.down * v + self.forward;
        let t = (z - self.position.z) / ray.z;
        (ray.z < -1e-6 && t > 0.0).then(|| [self.position.x + t * ray.x, self.position.y + t * ray.y])
    }
}

/// Lowest and highest of the values but for the strays.
fn range(values: impl Iterator<Item = f32>) -> Option<(f32, f32)> {
    let mut values: Vec<f32> = values.collect();
    if values.is_empty() {
        return None;
    }
    let last = values.len() - 1;
    let strays = (last as f64 * STRAYS) as usize;
    let low = *values.select_nth_unstable_by(strays, f32::total_cmp).1;
    let high = *values.select_nth_unstable_by(last - strays, f32::total_cmp).1;
    Some((low, high))
}
