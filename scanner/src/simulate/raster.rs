//! What a camera sees where: triangles drawn into a buffer of inverse depth and triangle numbers.
//!
//! The buffer has `supersample` × `supersample` samples a pixel. Depth at any place between them is exact: a sample names the
//! triangle, and the triangle's plane gives the depth (inverse depth is linear in the image).

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use reconstruct::camera::Intrinsics;
use reconstruct::pose::Pose;

use super::scene::Scene;

/// Nearest distance drawn, metres.
const NEAR: f64 = 0.05;
/// Rows of samples drawn by one task: fixed, so that results do not depend on the number of threads.
const BAND: usize = 48;
/// Marks a sample that no triangle covers.
const NOTHING: u32 = u32::MAX;

/// One triangle as the camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Inverse depth at pixel `(u, v)`: `plane[0] * u + plane[1] * v + plane[2]`.
    plane: [f64; 3],
    /// Nearest and farthest inverse depth of its corners.
    inv_range: [f32; 2],
    /// Shading normal in the world.
    pub normal: [f32; 3],
    /// Index of its object in the scene.
    pub object: u16,
}

/// What a ray hits first.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Depth along the camera's z, metres.
    pub depth: f64,
    /// Index of the facet.
    pub facet: u32,
}

/// A drawn view.
#[derive(Debug)]
pub struct Hits {
    /// The camera it was drawn for.
    pub camera: Intrinsics,
    /// Its pose.
    pub world_from_camera: Pose,
    /// Samples a pixel along each side.
    pub supersample: usize,
    /// Triangles that `ids` names.
    pub facets: Vec<Facet>,
    ids: Vec<u32>,
}

/// A triangle ready to be drawn: corners in samples, inverse depth as a plane over samples.
struct Drawn {
    corners: [[f64; 2]; 3],
    plane: [f64; 3],
    facet: u32,
}

impl Hits {
    /// Draws a scene. The camera's distortion is not applied.
    pub fn draw(scene: &Scene, camera: &Intrinsics, world_from_camera: &Pose, supersample: usize) -> Self {
        let (mut facets, mut drawn) = (Vec::new(), Vec::new());
        for (object, part) in scene.objects.iter().enumerate() {
            let camera_from_world = world_from_camera.inverse();
            let corners: Vec<Point3<f64>> = part
                .vertices
                .par_iter()
                .map(|p| camera_from_world * Point3::from(*p).cast::<f64>())
                .collect();
            for (triangle, normal) in part.triangles.iter().zip(&part.normals) {
                let corners = triangle.map(|i| corners[i as usize]);
                let Some(facet) = facet(&corners, camera, *normal, object as u16) else { continue };
                let outline = project(&corners, camera, supersample);
                if outline.is_empty() {
                    continue;
                }
                let plane = over_samples(facet.plane, supersample);
                for k in 1..outline.len() - 1 {
                    let corners = [outline[0], outline[k], outline[k + 1]];
                    drawn.push(Drawn { corners, plane, facet: facets.len() as u32 });
                }
                facets.push(facet);
            }
        }
        let ids = fill(&drawn, camera.width as usize * supersample, camera.height as usize * supersample);
        Self { camera: *camera, world_from_camera: *world_from_camera, supersample, facets, ids }
    }

    /// What lies at a place in the image, pixels; `None` outside the image and where nothing was drawn.
    pub fn at(&self, u: f64, v: f64) -> Option<Hit> {
        let s = self.supersample as f64;
        let (x, y) = ((u + 0.5) * s, (v + 0.5) * s);
        let (wide, tall) =
            (self.camera.width as usize * self.supersample, self.camera.height as usize * self.supersample);
        if x < 0.0 || y < 0.0 || x >= wide as f64 || y >= tall as f64 {
            return None;
        }
        let facet = self.ids[y as usize * wide + x as usize];
        if facet == NOTHING {
            return None;
        }
        Some(Hit { depth: self.facets[facet as usize].depth(u, v), facet })
    }

    /// Point in the world of a hit at pixel `(u, v)`.
    pub fn world_point(&self, u: f64, v: f64, depth: f64) -> Point3<f64> {
        let c = &self.camera;
        self.world_from_camera * Point3::new((u - c.cx) / c.fx * depth, (v - c.cy) / c.fy * depth, depth)
    }

    /// Facet numbers of a pixel's samples, row by row, with each sample's place in pixels.
    pub fn samples(&self, x: usize, y: usize) -> impl Iterator<Item = (f64, f64, Option<u32>)> + '_ {
        let s = self.supersample;
        let wide = self.camera.width as usize * s;
        (0..s * s).map(move |k| {
            let (sx, sy) = (x * s + k % s, y * s + k / s);
            let id = self.ids[sy * wide + sx];
            let place = |sample: usize| (sample as f64 + 0.5) / s as f64 - 0.5;
            (place(sx), place(sy), (id != NOTHING).then_some(id))
        })
    }
}

impl Facet {
    /// Depth of its plane at a pixel, kept within the triangle's own range.
    pub fn depth(&self, u: f64, v: f64) -> f64 {
        let inv = self.plane[0] * u + self.plane[1] * v + self.plane[2];
        1.0 / inv.clamp(f64::from(self.inv_range[0]), f64::from(self.inv_range[1]))
    }
}

/// The facet of a triangle in the camera frame; `None` where it shows its back, is behind the camera or has no area.
fn facet(corners: &[Point3<f64>; 3], camera: &Intrinsics, normal: [f32; 3], object: u16) -> Option<Facet> {
    let [a, b, c] = corners;
    let n = (b - a).cross(&(c - a));
    let offset = n.dot(&a.coords);
    let in_front = corners.iter().any(|p| p.z > NEAR);
    // The camera is at the origin: a front shows where the outward normal points to it.
    if offset >= -1e-18 || !in_front {
        return None;
    }
    let slope = Vector3::new(n.x / offset / camera.fx, n.y / offset / camera.fy, n.z / offset);
    let plane = [slope.x, slope.y, slope.z - slope.x * camera.cx - slope.y * camera.cy];
    let inverse = |p: &Point3<f64>| (1.0 / p.z.max(NEAR)) as f32;
    let inv = [inverse(a), inverse(b), inverse(c)];
    let inv_range = [inv[0].min(inv[1]).min(inv[2]), inv[0].max(inv[1]).max(inv[2])];
    Some(Facet { plane, inv_range, normal, object })
}

/// The same plane over sample coordinates.
fn over_samples(plane: [f64; 3], supersample: usize) -> [f64; 3] {
    let s = supersample as f64;
    let shift = 0.5 / s - 0.5;
    [plane[0] / s, plane[1] / s, plane[2] + (plane[0] + plane[1]) * shift]
}

/// Outline in samples of a triangle cut at the near plane: empty, or 3 to 4 corners.
fn project(corners: &[Point3<f64>; 3], camera: &Intrinsics, supersample: usize) -> Vec<[f64; 2]> {
    let s = supersample as f64;
    let place = |p: &Point3<f64>| {
        let (u, v) = (camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy);
        [(u + 0.5) * s - 0.5, (v + 0.5) * s - 0.5]
    };
    let mut outline = Vec::with_capacity(4);
    for k in 0..3 {
        let (a, b) = (&corners[k], &corners[(k + 1) % 3]);
        if a.z > NEAR {
            outline.push(place(a));
        }
        if (a.z > NEAR) != (b.z > NEAR) {
            outline.push(place(&(a + (b - a) * ((NEAR - a.z) / (b.z - a.z)))));
        }
    }
    outline
}

/// Draws all triangles, band by band; the nearest wins, the earlier one on a tie.
fn fill(drawn: &[Drawn], wide: usize, tall: usize) -> Vec<u32> {
    let mut of_band = vec![Vec::new(); tall.div_ceil(BAND)];
    for (i, triangle) in drawn.iter().enumerate() {
        let ys = triangle.corners.map(|c| c[1]);
        let low = ys[0].min(ys[1]).min(ys[2]).ceil().max(0.0);
        let high = ys[0].max(ys[1]).max(ys[2]).ceil().min(tall as f64);
        if low < high {
            for band in low as usize / BAND..=(high as usize - 1) / BAND {
                of_band[band].push(i as u32);
            }
        }
    }
    let mut ids = vec![NOTHING; wide * tall];
    ids.par_chunks_mut(wide * BAND).zip(&of_band).enumerate().for_each(|(band, (rows, members))| {
        let mut inverse = vec![0.0f32; rows.len()];
        for &i in members {
            fill_triangle(&drawn[i as usize], wide, band * BAND, rows, &mut inverse);
        }
    });
    ids
}

fn fill_triangle(triangle: &Drawn, wide: usize, first_row: usize, ids: &mut [u32], inverse: &mut [f32]) {
    let rows = ids.len() / wide;
    let ys = triangle.corners.map(|c| c[1]);
    let low = ys[0].min(ys[1]).min(ys[2]).ceil().max(first_row as f64) as usize;
    let high = ys[0].max(ys[1]).max(ys[2]).ceil().min((first_row + rows) as f64);
    if high <= 0.0 {
        return;
    }
    for y in low..high as usize {
        let Some((from, to)) = span(&triangle.corners, y as f64) else { continue };
        let (from, to) = (from.ceil().max(0.0), to.ceil().min(wide as f64));
        if from >= to {
            continue;
        }
        let start = (y - first_row) * wide;
        let base = triangle.plane[1] * y as f64 + triangle.plane[2];
        let (step, mut value) = (triangle.plane[0] as f32, (base + triangle.plane[0] * from) as f32);
        for x in start + from as usize..start + to as usize {
            if value > inverse[x] {
                inverse[x] = value;
                ids[x] = triangle.facet;
            }
            value += step;
        }
    }
}

/// Where a row enters and leaves a triangle. Edges are walked from their lower to their higher end, so that two triangles that
/// share an edge agree on it to the last bit.
fn span(corners: &[[f64; 2]; 3], y: f64) -> Option<(f64, f64)> {
    let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
    for k in 0..3 {
        let (mut a, mut b) = (corners[k], corners[(k + 1) % 3]);
        if a[1] > b[1] {
            std::mem::swap(&mut a, &mut b);
        }
        if a[1] <= y && y < b[1] {
            let x = a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1]));
            from = from.min(x);
            to = to.max(x);
        }
    }
    (from < to).then_some((from, to))
}
