//! What a sensor saw, as a picture of distances from its place: tells free space from what is hidden.

use nalgebra::{Matrix3, Vector3};

use super::super::surfel::Surfels;
use crate::pose::Pose;

/// Pixels along a side at most.
const MOST_PIXELS: f32 = 400.0;
/// Cells before the surface from where on a point stands in free space.
const IN_FRONT: f32 = 3.0;
/// Least cosine between the normals of one surface.
const ALIKE: f32 = 0.5;
const NOTHING: u32 = u32::MAX;

/// A picture of a view from its sensor's place; a pixel is as wide as a cell at the view's distance.
pub(super) struct RangeMap {
    /// Camera axes as rows, of coordinates relative to the surfels' centre.
    rotation: Matrix3<f32>,
    sensor: Vector3<f32>,
    focal: f32,
    width: usize,
    height: usize,
    corner: [f32; 2],
    /// Depth of the nearest point, infinite where there is none.
    depths: Vec<f32>,
    cell: f32,
    /// Depth beyond which every pixel around sees (infinite where all are empty).
    nearest_around: Vec<f32>,
    /// The surfel of the pixel, where it has one.
    surfels: Vec<u32>,
}

/// How the points of a view lie in another's picture.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counts {
    pub(super) all: usize,
    pub(super) on_surface: usize,
    /// The same, each weighed 1 to 0 by its distance from the surface.
    fit: f64,
    pub(super) in_front: usize,
    pub(super) beside: usize,
}

impl Counts {
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            all: self.all + other.all,
            on_surface: self.on_surface + other.on_surface,
            fit: self.fit + other.fit,
            in_front: self.in_front + other.in_front,
            beside: self.beside + other.beside,
        }
    }

    pub(super) fn share(&self, part: usize) -> f64 {
        part as f64 / self.all.max(1) as f64
    }

    pub(super) fn score(&self) -> f64 {
        self.fit / self.all.max(1) as f64 - 2.0 * self.share(self.in_front + self.beside)
    }
}

impl RangeMap {
    /// The picture of `points` (in the view's frame, as `sensor`), with the view's surfels.
    pub(super) fn new(surfels: &Surfels, points: &[[f32; 3]], sensor: &[f32; 3], cell: f32) -> Self {
        let centre: Vector3<f32> = surfels.centre.coords.map(|v| v as f32);
        let sensor = Vector3::from(*sensor) - centre;
        let distance = sensor.norm().max(cell);
        let forward = -sensor / distance;
        let side = if forward.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
        let right = forward.cross(&side).normalize();
        let rotation =
            Matrix3::from_rows(&[right.transpose(), forward.cross(&right).transpose(), forward.transpose()]);
        let mut map = Self {
            rotation,
            sensor,
            focal: distance / cell,
            width: 0,
            height: 0,
            corner: [0.0; 2],
            depths: Vec::new(),
            cell,
            nearest_around: Vec::new(),
            surfels: Vec::new(),
        };
        let seen: Vec<[f32; 3]> =
            points.iter().filter_map(|p| map.plane(&(Vector3::from(*p) - centre))).collect();
        let (mut lo, mut hi) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for p in &seen {
            for k in 0..2 {
                lo[k] = lo[k].min(p[k]);
                hi[k] = hi[k].max(p[k]);
            }
        }
        if seen.is_empty() {
            return map;
        }
        let pixels = |k: usize| (hi[k] - lo[k] + 5.0).min(MOST_PIXELS) as usize;
        (map.width, map.height, map.corner) = (pixels(0), pixels(1), lo.map(|v| v - 2.0));
        map.depths = vec![f32::INFINITY; map.width * map.height];
        map.surfels = vec![NOTHING; map.width * map.height];
        for p in &seen {
            for pixel in map.four(p) {
                map.depths[pixel] = map.depths[pixel].min(p[2]);
            }
        }
        let mut surfel_depths = vec![f32::INFINITY; map.depths.len()];
        for (index, p) in (0u32..).zip(&surfels.points) {
            let Some(p) = map.plane(&Vector3::from(*p)) else { continue };
            for pixel in map.four(&p) {
                if p[2] < surfel_depths[pixel] {
                    surfel_depths[pixel] = p[2];
                    map.surfels[pixel] = index;
                }
            }
        }
        map.nearest_around = map.minimum_of_neighbours();
        map
    }

    /// Pixel coordinates (not rounded, without the corner) and depth.
    fn plane(&self, p: &Vector3<f32>) -> Option<[f32; 3]> {
        let c = self.rotation * (p - self.sensor);
        (c.z > 1e-3).then(|| [c.x / c.z * self.focal, c.y / c.z * self.focal, c.z])
    }

    /// The four pixels around a place, those inside the picture.
    fn four(&self, p: &[f32; 3]) -> impl Iterator<Item = usize> + use<> {
        let (u, v) = ((p[0] - self.corner[0]).floor(), (p[1] - self.corner[1]).floor());
        let (width, height) = (self.width, self.height);
        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().filter_map(move |(du, dv)| {
            let (u, v) = (u + du, v + dv);
            (u >= 0.0 && v >= 0.0 && u < width as f32 && v < height as f32)
                .then(|| v as usize * width + u as usize)
        })
    }

    fn minimum_of_neighbours(&self) -> Vec<f32> {
        let mut result = vec![f32::INFINITY; self.depths.len()];
        for v in 0..self.height {
            for u in 0..self.width {
                let mut least = f32::INFINITY;
                for y in v.saturating_sub(1)..(v + 2).min(self.height) {
                    for x in u.saturating_sub(1)..(u + 2).min(self.width) {
                        least = least.min(self.depths[y * self.width + x]);
                    }
                }
                result[v * self.width + u] = least;
            }
        }
        result
    }

    /// How every `step`-th surfel of another view lies in this picture; `own` are this view's surfels. What is less than
    /// `width` metres off a surface lies on it.
    pub(super) fn counts(
        &self,
        other: &Surfels,
        own: &Surfels,
        pose: &Pose,
        step: usize,
        width: f32,
    ) -> Counts {
        let rotation: Matrix3<f32> = pose.rotation.to_rotation_matrix().matrix().map(|v| v as f32);
        let translation: Vector3<f32> = (pose * other.centre - own.centre).map(|v| v as f32);
        let mut counts = Counts::default();
        for i in (0..other.len()).step_by(step.max(1)) {
            counts.all += 1;
            let p = rotation * Vector3::from(other.points[i]) + translation;
            let Some(at) = self.plane(&p) else { continue };
            let (u, v) = ((at[0] - self.corner[0]).round(), (at[1] - self.corner[1]).round());
            if !(u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32) {
                counts.beside += 1;
                continue;
            }
            let pixel = v as usize * self.width + u as usize;
            let around = self.nearest_around[pixel];
            if around == f32::INFINITY {
                counts.beside += 1;
            } else if at[2] < around - IN_FRONT * self.cell {
                counts.in_front += 1;
            } else if self.surfels[pixel] != NOTHING {
                let j = self.surfels[pixel] as usize;
                let n = Vector3::from(own.normals[j]);
                let off = n.dot(&(p - Vector3::from(own.points[j]))).abs();
                let alike = n.dot(&(rotation * Vector3::from(other.normals[i])));
                if off < width
                    && (at[2] - self.depths[pixel]).abs() < 2.0 * IN_FRONT * self.cell
                    && alike > ALIKE
                {
                    counts.on_surface += 1;
                    counts.fit += f64::from(1.0 - (off / width).powi(2));
                }
            }
        }
        counts
    }
}
