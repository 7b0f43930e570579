//! The picture for the listing, drawn in software: the product on a plain light ground with a soft contact shadow.
//!
//! Triangles are filled, points without a surface drawn as discs that close the gaps (surface splatting after Zwicker et
//! al. 2001, with a first pass for the depth). Drawn at twice the size and averaged in linear light.

mod camera;
mod canvas;
mod shadow;
mod splat;
mod tone;
mod triangle;

use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::image::ColorImage;
use crate::knn::Tree;
use crate::mesh::Mesh;
use crate::normals::{self, Neighbourhood};
use camera::Camera;
use canvas::Canvas;

/// How the picture is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosterConfig {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Where the camera stands, radians counter-clockwise seen from above; 0 looks along +y.
    pub azimuth: f64,
    /// How high the camera stands, radians above the horizon, -1.5 to 1.5.
    pub elevation: f64,
    /// Ground and background, sRGB.
    pub background: [u8; 3],
}

impl Default for PosterConfig {
    fn default() -> Self {
        let (azimuth, elevation) = (35f64.to_radians(), 24f64.to_radians());
        Self { width: 640, height: 640, azimuth, elevation, background: [246, 247, 249] }
    }
}

/// A model whose surface faces one side by this much on the mean was not measured all round.
const ONE_SIDED: f64 = 0.2;

impl PosterConfig {
    /// The usual picture; of a model that was measured from one side only, the picture from that side.
    pub fn facing(mesh: &Mesh) -> Self {
        let normals = &mesh.vertices.normals;
        let count = normals.len().max(1) as f64;
        let [x, y, z] = [0, 1, 2].map(|k| normals.iter().map(|n| f64::from(n[k])).sum::<f64>() / count);
        if x.hypot(y) < ONE_SIDED {
            return Self::default();
        }
        // The camera stands at (sin azimuth, -cos azimuth).
        let elevation = z.atan2(x.hypot(y)).clamp(0.3, 1.2);
        Self { azimuth: x.atan2(-y), elevation, ..Self::default() }
    }
}

/// Draws more pixels than this a side and averages them.
const SUPERSAMPLING: usize = 2;
/// Neighbours whose distance gives a disc its radius.
const NEIGHBOURS: usize = 7;
/// Colour of a model without colours, sRGB.
const CLAY: [u8; 3] = [196, 190, 182];

/// A vertex as it is drawn: camera frame (x right, y down, z forward), linear light.
#[derive(Debug, Clone, Copy)]
struct Dot {
    place: [f32; 3],
    normal: [f32; 3],
    light: [f32; 3],
}

/// Draws a model given in metres, z up. An empty model gives the empty ground.
pub fn draw(mesh: &Mesh, config: &PosterConfig) -> ColorImage {
    let (width, height) = (config.width.max(1) * SUPERSAMPLING, config.height.max(1) * SUPERSAMPLING);
    let Some(camera) = Camera::framing(&mesh.vertices, config, width, height) else {
        return ColorImage::filled(config.width.max(1), config.height.max(1), config.background);
    };
    let mut canvas = Canvas::new(width, height);
    let normals = normals_of(mesh, &camera);
    let dots = dots(&mesh.vertices, &normals, &camera);
    if mesh.triangles.is_empty() {
        splat::draw(&dots, &radii(&mesh.vertices), &camera, &mut canvas);
    } else {
        triangle::draw(&dots, &mesh.triangles, &camera, &mut canvas);
    }
    let ground = shadow::Ground::under(mesh);
    canvas.finish(SUPERSAMPLING, |x, y| {
        let dark = ground.as_ref().map_or(0.0, |ground| ground.darkness(&camera, x, y));
        config.background.map(|v| tone::linear(v) * (1.0 - dark))
    })
}

/// The model's normals, or estimated ones turned to the camera; none where a mesh has faces to take them from.
fn normals_of(mesh: &Mesh, camera: &Camera) -> Vec<[f32; 3]> {
    if mesh.vertices.has_normals() {
        return mesh.vertices.normals.clone();
    }
    if !mesh.triangles.is_empty() {
        return Vec::new();
    }
    let points = &mesh.vertices.points;
    let tree = Tree::new(points);
    normals::estimate(points, &tree, Neighbourhood::Nearest(16), &camera.position()).normals
}

/// Vertices in the camera frame with the light they send there.
fn dots(vertices: &PointCloud, normals: &[[f32; 3]], camera: &Camera) -> Vec<Dot> {
    let colored = vertices.has_colors();
    let gain = if colored { tone::gain(&vertices.colors) } else { 1.0 };
    let dot = |i: usize| {
        let normal = normals.get(i).map_or([0.0; 3], |n| camera.turn(*n));
        let color = if colored { vertices.colors[i] } else { CLAY };
        let shade = tone::shade(normal, colored) * gain;
        Dot { place: camera.place(vertices.points[i]), normal, light: color.map(|v| tone::linear(v) * shade) }
    };
    (0..vertices.len()).into_par_iter().map(dot).collect()
}

/// Radius of every point's disc, metres: to its neighbours, held near the usual one so that strays stay small.
fn radii(vertices: &PointCloud) -> Vec<f32> {
    let tree = Tree::new(&vertices.points);
    let reach = |p: &[f32; 3]| tree.nearest_n(p, NEIGHBOURS).last().map_or(0.0, |n| n.sq_dist.sqrt());
    let mut radii: Vec<f32> = vertices.points.par_iter().map(reach).collect();
    let mut sorted = radii.clone();
    let middle = sorted.len() / 2;
    let usual = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
    for radius in &mut radii {
        *radius = radius.clamp(0.6 * usual, 1.8 * usual);
    }
    radii
}

#[cfg(test)]
mod tests;
