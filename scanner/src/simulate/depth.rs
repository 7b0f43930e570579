//! The depth camera of a Kinect v1: true depth goes through the errors of a sensor that measures disparity in steps of 1/8 px.
//!
//! Order, as in the sensor: lateral jitter picks the ray, the ray gives the depth, depth becomes disparity `d = f b / z`, scale
//! error, smooth warp and noise are added to it, it is rounded to 1/8 px and comes out as whole millimetres. Part of the noise stays
//! while nothing moves ("frozen"), the rest is drawn anew each frame; both agree between neighbours because the sensor matches
//! windows. Sizes of the noise: Khoshelham & Elberink 2012 (low), Nguyen, Izadi & Lovell 2012 (high).

use nalgebra::Vector3;
use rayon::prelude::*;
use reconstruct::camera::Intrinsics;
use reconstruct::image::DepthImage;
use serde::{Deserialize, Serialize};

use super::noise::{correlated, mix_seed};
use super::raster::{Facet, Hits};
use super::scene::{Material, Scene};

mod shadow;
mod warp;

pub use warp::warp_field;

/// Distance between the infrared camera and its projector, metres.
pub const BASELINE: f64 = 0.075;
/// Disparity steps in a pixel.
const STEPS: f64 = 8.0;
/// Share of the noise's variance that stays the same while nothing moves.
const FROZEN: f32 = 0.5;
/// Width of the window in which noise agrees, pixels.
const CORRELATION_PX: f32 = 1.2;
/// Measured range, metres.
const RANGE: (f64, f64) = (0.4, 4.5);
/// Columns at the right border that the sensor's window never fills.
const BLIND_COLUMNS: usize = 8;
/// Depth jump that makes an edge, metres, and how often the window mixes its two sides.
const EDGE: f64 = 0.03;
const MIXED_SHARE: f32 = 0.08;

/// How noisy the sensor is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum NoiseLevel {
    /// Random error after Khoshelham & Elberink: 0.9 mm at 0.8 m.
    Low,
    /// Random and lateral error after Nguyen et al.: 1.5 mm at 0.8 m, more on slopes.
    High,
}

impl NoiseLevel {
    /// Standard deviation of a depth value, metres, of a surface at `z` metres seen at `theta` radians from its normal.
    pub fn sigma_z(self, z: f64, theta: f64) -> f64 {
        match self {
            Self::Low => 1.425e-3 * z * z,
            Self::High => {
                let tilt = theta.min(1.4);
                let slope = 0.0001 / z.sqrt() * (tilt / (std::f64::consts::FRAC_PI_2 - tilt)).powi(2);
                0.0012 + 0.0019 * (z - 0.4).powi(2) + slope
            }
        }
    }

    /// Standard deviation of the sideways jitter of a ray, pixels.
    pub fn sigma_lateral_px(self) -> f32 {
        match self {
            Self::Low => 0.25,
            Self::High => 0.5,
        }
    }
}

/// A depth camera with its errors.
#[derive(Debug, Clone)]
pub struct DepthSensor {
    /// Geometry.
    pub camera: Intrinsics,
    /// Random errors.
    pub noise: NoiseLevel,
    /// Smooth error of disparity, pixels, row-major; empty for none.
    pub warp_px: Vec<f32>,
    /// How much too long depth reads: 0.015 for 1.5 %.
    pub scale_error: f64,
}

/// One static view through a depth camera.
pub struct DepthView<'a> {
    sensor: &'a DepthSensor,
    hits: &'a Hits,
    seed: u64,
    /// Per pixel: noise of disparity before rounding, pixels.
    sigma: Vec<f32>,
    /// Per pixel: how likely it has no value.
    dropout: Vec<f32>,
    frozen: [Vec<f32>; 3],
}

impl<'a> DepthView<'a> {
    /// Prepares a view of a scene that was drawn for the sensor's camera.
    pub fn new(scene: &Scene, hits: &'a Hits, sensor: &'a DepthSensor, seed: u64) -> Self {
        let (width, height) = (sensor.camera.width as usize, sensor.camera.height as usize);
        let truth = true_depth(hits);
        let lit = shadow::lit_by_projector(&truth, &sensor.camera, BASELINE);
        let mut pixels = vec![(0.0f32, 1.0f32); width * height];
        pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = pixel_errors(scene, hits, sensor, x, y);
                if !lit[y * width + x] || x + BLIND_COLUMNS >= width {
                    pixel.1 = 1.0;
                }
            }
        });
        let (sigma, dropout) = pixels.into_iter().unzip();
        let frozen = fields(width, height, mix_seed(&[seed, 0xf0]));
        Self { sensor, hits, seed, sigma, dropout, frozen }
    }

    /// The depth image of a frame, millimetres.
    pub fn frame(&self, index: usize) -> DepthImage {
        let (width, height) = (self.sensor.camera.width as usize, self.sensor.camera.height as usize);
        let seed = mix_seed(&[self.seed, 0xf1, index as u64]);
        let fresh = fields(width, height, seed);
        let mut data = vec![0u16; width * height];
        data.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            // What is frozen about dropouts is drawn from a stream that all frames share.
            let mut stays = fastrand::Rng::with_seed(mix_seed(&[self.seed, 0xd0, y as u64]));
            let mut passes = fastrand::Rng::with_seed(mix_seed(&[seed, 0xd1, y as u64]));
            for (x, out) in row.iter_mut().enumerate() {
                let (kept, drawn) = (stays.f32(), passes.f32());
                let i = y * width + x;
                let drop = self.dropout[i];
                if drop < 1.0 && kept >= 0.8 * drop && drawn >= 0.25 * drop {
                    *out = self.value(x, y, &fresh, drawn);
                }
            }
        });
        DepthImage { width, height, data, units_per_metre: 1000.0 }
    }

    fn value(&self, x: usize, y: usize, fresh: &[Vec<f32>; 3], chance: f32) -> u16 {
        let i = y * self.sensor.camera.width as usize + x;
        let noise = |k: usize| FROZEN.sqrt() * self.frozen[k][i] + (1.0 - FROZEN).sqrt() * fresh[k][i];
        let lateral = self.sensor.noise.sigma_lateral_px();
        let (u, v) = (x as f64, y as f64);
        let (ju, jv) = (f64::from(lateral * noise(1)), f64::from(lateral * noise(2)));
        let Some(hit) = self.hits.at(u + ju, v + jv).or_else(|| self.hits.at(u, v)) else { return 0 };
        let depth = self.mixed_at_edges(u, v, hit.depth, chance);
        let fb = self.sensor.camera.fx * BASELINE;
        let warp = self.sensor.warp_px.get(i).copied().unwrap_or(0.0);
        let disparity =
            fb / (depth * (1.0 + self.sensor.scale_error)) + f64::from(warp + self.sigma[i] * noise(0));
        // Both are positive: cutting off after adding a half rounds.
        let rounded = f64::from((disparity * STEPS + 0.5) as u32) / STEPS;
        let measured = fb / rounded.max(1.0 / STEPS);
        if measured < RANGE.0 || measured > RANGE.1 { 0 } else { (measured * 1000.0 + 0.5) as u16 }
    }

    /// Where the jitter jumped over an edge, the matching window sometimes sees both sides: a flying pixel.
    fn mixed_at_edges(&self, u: f64, v: f64, depth: f64, chance: f32) -> f64 {
        match self.hits.at(u, v) {
            Some(own) if (own.depth - depth).abs() > EDGE && chance.rem_euclid(0.1) < 0.1 * MIXED_SHARE => {
                let share = f64::from(chance * 997.0).rem_euclid(1.0);
                own.depth + (depth - own.depth) * share
            }
            _ => depth,
        }
    }
}

/// Depth along z at the pixel centres, metres, row-major; 0 where nothing is.
pub fn true_depth(hits: &Hits) -> Vec<f32> {
    let (width, height) = (hits.camera.width as usize, hits.camera.height as usize);
    let mut depth = vec![0.0; width * height];
    depth.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, out) in row.iter_mut().enumerate() {
            *out = hits.at(x as f64, y as f64).map_or(0.0, |hit| hit.depth as f32);
        }
    });
    depth
}

fn fields(width: usize, height: usize, seed: u64) -> [Vec<f32>; 3] {
    [0u64, 1, 2].map(|k| correlated(width, height, CORRELATION_PX, mix_seed(&[seed, k])))
}

/// Noise of disparity and probability of a dropout at a pixel.
fn pixel_errors(scene: &Scene, hits: &Hits, sensor: &DepthSensor, x: usize, y: usize) -> (f32, f32) {
    let (u, v) = (x as f64, y as f64);
    let Some(hit) = hits.at(u, v) else { return (0.0, 1.0) };
    let facet = &hits.facets[hit.facet as usize];
    let p = hits.world_point(u, v, hit.depth);
    let to_eye = (hits.world_from_camera.translation.vector - p.coords).normalize();
    let cos = to_eye.dot(&Vector3::from(facet.normal).cast()).clamp(0.0, 1.0);
    let theta = cos.acos();
    let fb = sensor.camera.fx * BASELINE;
    let total = sensor.noise.sigma_z(hit.depth, theta) * fb / (hit.depth * hit.depth);
    // Rounding adds a variance of step²/12 of its own; the model's figure is the sum.
    let before = (total * total - (1.0 / STEPS).powi(2) / 12.0).max(0.0004).sqrt();
    let grazing = ((theta.to_degrees() - 69.0) / 7.0).clamp(0.0, 1.0);
    (before as f32, (grazing as f32).max(material_dropout(scene, facet, &p, cos as f32)))
}

/// Dark paint swallows the pattern; a shiny surface square to the sensor blinds it.
fn material_dropout(scene: &Scene, facet: &Facet, p: &nalgebra::Point3<f64>, cos: f32) -> f32 {
    if !matches!(scene.material(facet.object), Material::Product | Material::Sheet) {
        return 0.0;
    }
    let [r, g, b] = scene.color(facet.object, p);
    // Infrared is nearest to red.
    let infrared = 0.6 * r + 0.25 * g + 0.15 * b;
    let dark = 0.3 * (1.0 - infrared / 0.18).clamp(0.0, 1.0);
    let mirror = 0.6 * scene.gloss(facet.object, p) * ((cos - 0.990) / 0.008).clamp(0.0, 1.0);
    dark.max(mirror) + 0.002
}

#[cfg(test)]
mod tests {
    use reconstruct::pose::Pose;

    use super::*;
    use crate::simulate::scene::Object;

    /// A wall across the view, turned by 3 degrees so that it meets all phases of the disparity steps.
    fn wall(z: f32) -> Scene<'static> {
        let (tilt, half) = (3.0f32.to_radians().tan(), 2.0);
        let vertices = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]: [f32; 2]| [x * half, y * half, z + tilt * x * half]);
        let normal = Vector3::new(tilt, 0.0, -1.0).normalize().into();
        Scene::of_objects(vec![Object {
            vertices: vertices.to_vec(),
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            normals: vec![normal; 2],
            material: Material::Table,
        }])
    }

    fn sensor(noise: NoiseLevel) -> DepthSensor {
        let camera = Intrinsics::pinhole(320, 240, 525.0, 525.0, 159.5, 119.5);
        DepthSensor { camera, noise, warp_px: Vec::new(), scale_error: 0.0 }
    }

    /// Depth values of every pixel over the frames, beside the true depth; metres.
    fn measure(sensor: &DepthSensor, z: f32, frames: usize) -> Vec<(f64, Vec<f64>)> {
        let scene = wall(z);
        let hits = Hits::draw(&scene, &sensor.camera, &Pose::identity(), 2);
        let truth = true_depth(&hits);
        let view = DepthView::new(&scene, &hits, sensor, 7);
        let images: Vec<DepthImage> = (0..frames).map(|k| view.frame(k)).collect();
        let values = |i: usize| images.iter().map(|d| f64::from(d.data[i]) / 1000.0).collect::<Vec<_>>();
        let all = truth.iter().enumerate().map(|(i, &t)| (f64::from(t), values(i)));
        all.filter(|(_, values)| values.iter().all(|&v| v > 0.0)).collect()
    }

    fn rms(errors: impl Iterator<Item = f64>) -> f64 {
        let (sum, count) = errors.fold((0.0, 0.0), |(s, n), e| (s + e * e, n + 1.0));
        f64::sqrt(sum / count)
    }

    #[test]
    fn a_plane_has_the_noise_of_the_model() {
        for noise in [NoiseLevel::Low, NoiseLevel::High] {
            for z in [0.6f32, 0.8, 1.0] {
                let pixels = measure(&sensor(noise), z, 4);
                assert!(pixels.len() > 60_000, "{}", pixels.len());
                let found = rms(pixels.iter().flat_map(|(t, values)| values.iter().map(move |v| v - t)));
                // Whole millimetres add their own 0.29 mm.
                let expected = noise.sigma_z(f64::from(z), 0.05).hypot(0.001 / 12f64.sqrt());
                assert!((found / expected - 1.0).abs() < 0.07, "{noise:?} {z} m: {found} {expected}");
            }
        }
    }

    #[test]
    fn averaging_helps_until_the_frozen_part_and_beats_the_median() {
        let pixels = measure(&sensor(NoiseLevel::Low), 0.8, 15);
        let mean = |values: &[f64]| values.len() as f64 / values.iter().map(|v| 1.0 / v).sum::<f64>();
        let median = |values: &[f64]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted[sorted.len() / 2]
        };
        let one = rms(pixels.iter().map(|(t, v)| v[0] - t));
        let of_mean = rms(pixels.iter().map(|(t, v)| mean(v) - t));
        let of_median = rms(pixels.iter().map(|(t, v)| median(v) - t));
        assert!(of_mean < of_median && of_median < one, "{of_mean} {of_median} {one}");
        // Half of the variance is frozen: averages stop at 0.71 of one frame's error.
        assert!((0.6..0.85).contains(&(of_mean / one)), "{of_mean} {one}");
    }

    #[test]
    fn scale_error_and_warp_do_what_they_say() {
        let mut sensor = sensor(NoiseLevel::Low);
        sensor.scale_error = 0.02;
        let ratio = |pixels: &[(f64, Vec<f64>)]| {
            pixels.iter().map(|(t, v)| v[0] / t).sum::<f64>() / pixels.len() as f64
        };
        let scaled = ratio(&measure(&sensor, 0.8, 1));
        assert!((scaled - 1.02).abs() < 2e-4, "{scaled}");
        sensor.scale_error = 0.0;
        sensor.warp_px = vec![0.2; 320 * 240];
        let warped = ratio(&measure(&sensor, 0.8, 1));
        let disparity = 525.0 * BASELINE / 0.8;
        assert!((warped - disparity / (disparity + 0.2)).abs() < 4e-4, "{warped}");
    }

    #[test]
    fn values_are_whole_millimetres_of_eighth_pixels() {
        for (_, values) in measure(&sensor(NoiseLevel::High), 0.9, 1).iter().step_by(97) {
            let steps = (8.0 * 525.0 * BASELINE / values[0]).round();
            assert_eq!((8.0 * 525.0 * BASELINE / steps * 1000.0).round(), (values[0] * 1000.0).round());
        }
    }
}
