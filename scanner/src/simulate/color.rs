//! The colour camera: shaded, super-sampled, blurred, noisy pictures.
//!
//! Light is summed in sRGB values, so a tag's edge keeps its place under blur; the shift that a camera's tone curve gives to edges
//! between black and white is not modelled.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use reconstruct::camera::Intrinsics;
use reconstruct::image::ColorImage;
use reconstruct::pose::Pose;

use super::noise::{blur, mix_seed, normal};
use super::raster::{Facet, Hits};
use super::scene::{Material, Scene};
use super::texture::Rgb;

/// Side of the shadow map, pixels, and half of what it covers, metres.
const SHADOW_SIDE: u32 = 720;
const SHADOW_REACH: f64 = 0.62;
/// A surface this much behind the shadow map's is in shadow, metres.
const SHADOW_BIAS: f64 = 0.005;

/// Where around a point the shadow map is asked, pixels: the lamp has a size.
const SHADOW_TAPS: [(f64, f64); 5] = [(0.0, 0.0), (2.2, 0.7), (-0.7, 2.2), (-2.2, -0.7), (0.7, -2.2)];

/// How a picture comes out.
#[derive(Debug, Clone, Copy)]
pub struct Exposure {
    /// Gain of red, green and blue.
    pub gain: [f32; 3],
    /// Width of the lens blur, pixels.
    pub blur_px: f32,
    /// Noise of a pixel, in grey levels of 255.
    pub noise_levels: f32,
    /// Stream of chance for the noise.
    pub seed: u64,
}

impl Exposure {
    /// Exposure of one view: gain and white balance drift by a few percent.
    pub fn of_view(seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(mix_seed(&[seed, 0xe4b0]));
        let gain = 0.92 + 0.14 * rng.f32();
        Self {
            gain: std::array::from_fn(|_| gain * (0.985 + 0.03 * rng.f32())),
            blur_px: 0.5 + 0.2 * rng.f32(),
            noise_levels: 2.5,
            seed: mix_seed(&[seed, 0xe4b1]),
        }
    }
}

/// A lamp with the shadows it throws.
pub struct Lamp {
    place: Point3<f64>,
    shadows: Hits,
}

impl Lamp {
    /// The lamp of a scene; its place follows from the seed.
    pub fn over(scene: &Scene, seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(mix_seed(&[seed, 0x1a3f]));
        let angle = std::f64::consts::TAU * rng.f64();
        let place = Point3::new(0.8 * angle.cos(), 0.8 * angle.sin(), 1.5);
        let distance = place.coords.norm();
        let f = 0.5 * f64::from(SHADOW_SIDE) * distance / SHADOW_REACH;
        let middle = 0.5 * f64::from(SHADOW_SIDE) - 0.5;
        let camera = Intrinsics::pinhole(SHADOW_SIDE, SHADOW_SIDE, f, f, middle, middle);
        let shadows = Hits::draw(scene, &camera, &look_at(&place, &Point3::origin()), 1);
        Self { place, shadows }
    }

    /// Share of the lamp seen from a point, 0..1.
    fn seen_from(&self, p: &Point3<f64>) -> f32 {
        let q = self.shadows.world_from_camera.inverse_transform_point(p);
        let c = &self.shadows.camera;
        let (u, v) = (c.fx * q.x / q.z + c.cx, c.fy * q.y / q.z + c.cy);
        let free = SHADOW_TAPS.iter().filter(|(du, dv)| {
            self.shadows.at(u + du, v + dv).is_none_or(|hit| hit.depth > q.z - SHADOW_BIAS)
        });
        free.count() as f32 / SHADOW_TAPS.len() as f32
    }
}

/// Pose of a camera at `eye` that looks at `target`, upright in the world.
pub fn look_at(eye: &Point3<f64>, target: &Point3<f64>) -> Pose {
    // nalgebra's face_towards turns +z to the target and +y to "up"; the image's y runs down.
    Isometry3::face_towards(eye, target, &-Vector3::z())
}

/// The picture a camera takes of a scene it was drawn for.
pub fn picture(scene: &Scene, hits: &Hits, lamp: &Lamp, exposure: &Exposure) -> ColorImage {
    let (width, height) = (hits.camera.width as usize, hits.camera.height as usize);
    let mut light = vec![[0.0f32; 3]; width * height];
    light.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            *pixel = Shader { scene, hits, lamp }.pixel(x, y);
        }
    });
    blur(&mut light, width, height, exposure.blur_px);
    let mut data = vec![[0u8; 3]; width * height];
    data.par_chunks_mut(width).zip(light.par_chunks(width)).enumerate().for_each(|(y, (row, light))| {
        let mut rng = fastrand::Rng::with_seed(mix_seed(&[exposure.seed, y as u64]));
        for (out, light) in row.iter_mut().zip(light) {
            // Noise that red, green and blue share is the larger part after a sensor's colour interpolation.
            let shared = 0.7 * normal(&mut rng);
            for c in 0..3 {
                let noise = exposure.noise_levels * (shared + 0.7 * normal(&mut rng));
                out[c] = (light[c] * exposure.gain[c] * 255.0 + noise + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
    });
    ColorImage { width, height, data }
}

struct Shader<'a> {
    scene: &'a Scene<'a>,
    hits: &'a Hits,
    lamp: &'a Lamp,
}

impl Shader<'_> {
    fn pixel(&self, x: usize, y: usize) -> Rgb {
        let mut ids = self.hits.samples(x, y).map(|(_, _, id)| id.map(|i| self.facet(i).object));
        let first = ids.next().flatten();
        let (u, v) = (x as f64, y as f64);
        let same = ids.all(|object| object == first);
        match (same, first.and_then(|_| self.hits.at(u, v))) {
            (true, Some(hit)) => self.uniform_pixel(x, y, hit.facet, hit.depth),
            (true, None) if first.is_none() => [0.0; 3],
            _ => self.mean(x, y, |facet, p| {
                let shadow = self.shadow(facet, p);
                self.shade(facet, p, shadow)
            }),
        }
    }

    /// A pixel that lies on one object: the lamp is looked for once, the paint at every sample where it has fine detail.
    fn uniform_pixel(&self, x: usize, y: usize, facet: u32, depth: f64) -> Rgb {
        let p = self.hits.world_point(x as f64, y as f64, depth);
        let facet = self.facet(facet);
        let shadow = self.shadow(facet, &p);
        match self.scene.material(facet.object) {
            Material::Product => self.mean(x, y, |facet, p| self.shade(facet, p, shadow)),
            Material::Sheet => {
                let bright = self.brightness(facet, &p, shadow);
                self.mean(x, y, |facet, p| self.scene.color(facet.object, p).map(|c| c * bright))
            }
            _ => self.shade(facet, &p, shadow),
        }
    }

    fn mean(&self, x: usize, y: usize, shade: impl Fn(&Facet, &Point3<f64>) -> Rgb) -> Rgb {
        let mut sum = [0.0f32; 3];
        let mut count = 0.0f32;
        for (u, v, id) in self.hits.samples(x, y) {
            if let Some(id) = id {
                let facet = self.facet(id);
                let color = shade(facet, &self.hits.world_point(u, v, facet.depth(u, v)));
                (0..3).for_each(|k| sum[k] += color[k]);
            }
            count += 1.0;
        }
        sum.map(|v| v / count)
    }

    fn facet(&self, id: u32) -> &Facet {
        &self.hits.facets[id as usize]
    }

    fn shadow(&self, facet: &Facet, p: &Point3<f64>) -> f32 {
        let away = Vector3::from(facet.normal).dot(&(self.lamp.place - p).cast()) <= 0.0;
        if away || self.scene.material(facet.object) == Material::Room { 1.0 } else { self.lamp.seen_from(p) }
    }

    /// Ambient and direct light on a surface.
    fn brightness(&self, facet: &Facet, p: &Point3<f64>, shadow: f32) -> f32 {
        let n = Vector3::from(facet.normal);
        let to_lamp: Vector3<f32> = (self.lamp.place - p).cast().normalize();
        0.50 + 0.13 * n.z + 0.42 * shadow * n.dot(&to_lamp).max(0.0)
    }

    fn shade(&self, facet: &Facet, p: &Point3<f64>, shadow: f32) -> Rgb {
        let paint = self.scene.color(facet.object, p);
        let bright = self.brightness(facet, p, shadow);
        let gloss = self.scene.gloss(facet.object, p);
        let shine = if gloss > 0.0 { gloss * shadow * self.highlight(facet, p) } else { 0.0 };
        paint.map(|c| c * bright + shine)
    }

    /// Mirror image of the lamp, spread over a few degrees (Blinn 1977).
    fn highlight(&self, facet: &Facet, p: &Point3<f64>) -> f32 {
        let to_lamp = (self.lamp.place - p).normalize();
        let to_eye = (self.hits.world_from_camera.translation.vector - p.coords).normalize();
        let half = (to_lamp + to_eye).normalize().cast::<f32>();
        0.7 * Vector3::from(facet.normal).dot(&half).max(0.0).powi(60)
    }
}
