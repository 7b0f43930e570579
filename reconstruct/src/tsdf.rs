//! A volume into which depth pictures are averaged one after the other (Curless and Levoy 1996), on sparse blocks after
//! Nießner et al. 2013: for a stream of pictures of a whole scene.
//!
//! World frame, metres. A voxel keeps the mean of its signed distances along the viewing rays, cut at
//! `truncation_metres` in front of the surface; farther behind it than that a picture says nothing. A product's own surface
//! is made by [`crate::surface`], which knows its points' normals and separates the sides of thin walls.

use std::collections::HashMap;

use nalgebra::{Matrix3, Vector3};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::camera::Intrinsics;
use crate::mesh::Mesh;
use crate::pose::Pose;
use crate::simd;
use crate::surface::blocks::{Blocks, CORNERS, MAX_PLACE, SIDE, key, place};
use crate::surface::cubes;

/// Settings of a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeConfig {
    /// Side of a voxel, metres.
    pub voxel_metres: f32,
    /// Distances are cut at this, metres; at most the side of a block of eight voxels.
    pub truncation_metres: f32,
    /// Farther depth is not used, metres.
    pub max_depth_metres: f32,
}

impl Default for VolumeConfig {
    fn default() -> Self {
        Self { voxel_metres: 0.002, truncation_metres: 0.008, max_depth_metres: 1.2 }
    }
}

/// Every second pixel of every second row tells which blocks a picture touches.
const STRIDE: usize = 2;
/// Weights stop growing here, so that what changes in the scene is believed in the end.
const MAX_WEIGHT: f32 = 255.0;
/// The world's origin is at this block on every axis, so that places stay positive. A power of two: the first block's place is
/// then exact in single precision.
const MIDDLE: i32 = 1 << 19;

/// Added to a number below it, this leaves a whole one in the last bits: a conversion without the checks that a cast has. Pictures have
/// fewer pixels.
const WHOLE: f32 = 8_388_608.0;

#[derive(Debug, Clone)]
struct Block {
    distance: [f32; CORNERS],
    weight: [f32; CORNERS],
}

/// The volume.
#[derive(Debug, Clone)]
pub struct Volume {
    config: VolumeConfig,
    index: HashMap<u64, u32>,
    keys: Vec<u64>,
    blocks: Vec<Block>,
}

/// A depth picture with its camera.
#[derive(Debug, Clone, Copy)]
pub struct DepthPicture<'a> {
    /// Metres, row-major, 0 or less where nothing was measured.
    pub depth_metres: &'a [f32],
    /// The camera; its distortion is not used.
    pub camera: &'a Intrinsics,
    /// Its pose.
    pub world_from_camera: &'a Pose,
}

/// What a row of voxels needs to know of a picture.
struct Projection<'a> {
    picture: DepthPicture<'a>,
    camera_from_world: Matrix3<f32>,
    origin_in_camera: Vector3<f32>,
    focal: [f32; 2],
    middle: [f32; 2],
}

impl Volume {
    /// An empty volume.
    pub fn new(config: VolumeConfig) -> Self {
        Self { config, index: HashMap::new(), keys: Vec::new(), blocks: Vec::new() }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// Averages a picture in. Pictures of another size than their camera's, or of more than eight million pixels, are left aside.
    pub fn integrate(&mut self, picture: &DepthPicture) {
        let camera = picture.camera;
        let pixels = camera.width as usize * camera.height as usize;
        if picture.depth_metres.len() != pixels || pixels >= WHOLE as usize {
            return;
        }
        let mut touched = vec![false; self.blocks.len()];
        for key in touched_blocks(picture, &self.config) {
            let next = self.blocks.len() as u32;
            let block = *self.index.entry(key).or_insert(next);
            if block == next {
                self.keys.push(key);
                self.blocks.push(Block { distance: [0.0; CORNERS], weight: [0.0; CORNERS] });
                touched.push(false);
            }
            touched[block as usize] = true;
        }
        let camera_from_world = picture.world_from_camera.inverse().cast::<f32>();
        let projection = Projection {
            picture: *picture,
            camera_from_world: camera_from_world.rotation.to_rotation_matrix().into_inner(),
            origin_in_camera: camera_from_world.translation.vector,
            focal: [camera.fx as f32, camera.fy as f32],
            middle: [camera.cx as f32, camera.cy as f32],
        };
        let config = self.config;
        self.blocks.par_iter_mut().zip(&self.keys).zip(&touched).filter(|(_, touched)| **touched).for_each(
            |((block, key), _)| {
                simd::run(Update { block, key: *key, projection: &projection, config: &config });
            },
        );
    }

    /// The field of all voxels that at least `min_weight` pictures saw.
    pub fn field(&self, min_weight: f32) -> Blocks {
        let mut order: Vec<u32> = (0..self.keys.len() as u32).collect();
        order.par_sort_unstable_by_key(|&b| self.keys[b as usize]);
        let values = |&b: &u32| {
            let block = &self.blocks[b as usize];
            std::array::from_fn(|c| if block.weight[c] < min_weight { f32::NAN } else { block.distance[c] })
        };
        Blocks {
            origin: [-(MIDDLE as f32) * SIDE as f32 * self.config.voxel_metres; 3],
            voxel_metres: self.config.voxel_metres,
            keys: order.iter().map(|&b| self.keys[b as usize]).collect(),
            values: order.par_iter().map(values).collect(),
        }
    }

    /// The surface, without colours.
    pub fn mesh(&self, min_weight: f32) -> Mesh {
        cubes::triangulate(&self.field(min_weight))
    }
}

/// Blocks within the truncation of a picture's surface, ascending.
fn touched_blocks(picture: &DepthPicture, config: &VolumeConfig) -> Vec<u64> {
    let (width, height) = (picture.camera.width as usize, picture.camera.height as usize);
    let world_from_camera = picture.world_from_camera.cast::<f32>();
    let rotation = world_from_camera.rotation.to_rotation_matrix();
    let eye = world_from_camera.translation.vector;
    let size = config.voxel_metres * SIDE as f32;
    let (fx, fy) = (picture.camera.fx as f32, picture.camera.fy as f32);
    let (cx, cy) = (picture.camera.cx as f32, picture.camera.cy as f32);
    let mut touched: Vec<u64> = (0..height.div_ceil(STRIDE))
        .into_par_iter()
        .flat_map_iter(|row| {
            let v = row * STRIDE;
            let mut keys: Vec<u64> = Vec::new();
            let mut last = [u64::MAX; 3];
            for u in (0..width).step_by(STRIDE) {
                let z = picture.depth_metres[v * width + u];
                if !(z > 0.0 && z < config.max_depth_metres) {
                    continue;
                }
                let ray = rotation * Vector3::new((u as f32 - cx) / fx, (v as f32 - cy) / fy, 1.0);
                for (k, last) in last.iter_mut().enumerate() {
                    let depth = z + (k as f32 - 1.0) * config.truncation_metres;
                    let p = (eye + ray * depth) / size;
                    let at = [p.x, p.y, p.z].map(block_place);
                    let key = key(at);
                    if key != *last {
                        *last = key;
                        keys.push(key);
                    }
                }
            }
            keys.sort_unstable();
            keys.dedup();
            keys
        })
        .collect();
    touched.par_sort_unstable();
    touched.dedup();
    touched
}

/// Place of the block that holds a coordinate, counted in blocks from the world's origin.
fn block_place(coordinate: f32) -> u32 {
    (coordinate.floor() as i32).saturating_add(MIDDLE).clamp(0, MAX_PLACE as i32) as u32
}

/// Averages a picture into one block, a row of eight voxels at a time.
struct Update<'a> {
    block: &'a mut Block,
    key: u64,
    projection: &'a Projection<'a>,
    config: &'a VolumeConfig,
}

impl WithSimd for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { block, key, projection, config } = self;
        let at = place(key);
        let first = Vector3::from(at.map(|c| (c as i32 - MIDDLE) as f32 * SIDE as f32 * config.voxel_metres));
        let corner = projection.camera_from_world * first + projection.origin_in_camera;
        let step = projection.camera_from_world * config.voxel_metres;
        for z in 0..SIDE {
            for y in 0..SIDE {
                let row = corner + step.column(1) * y as f32 + step.column(2) * z as f32;
                let c = (z * SIDE + y) * SIDE;
                let distance: &mut [f32; SIDE] =
                    (&mut block.distance[c..c + SIDE]).try_into().expect("a row");
                let weight: &mut [f32; SIDE] = (&mut block.weight[c..c + SIDE]).try_into().expect("a row");
                update_row(distance, weight, row.into(), step.column(0).into(), projection, config);
            }
        }
    }
}

#[expect(clippy::needless_bitwise_bool, reason = "lanes without branches")]
#[inline(always)]
fn update_row(
    distance: &mut [f32; SIDE],
    weight: &mut [f32; SIDE],
    row: [f32; 3],
    step: [f32; 3],
    projection: &Projection,
    config: &VolumeConfig,
) {
    let camera = projection.picture.camera;
    let (width, height) = (camera.width as f32, camera.height as f32);
    let (mut z, mut pixel, mut inside) = ([0.0f32; SIDE], [0u32; SIDE], [0.0f32; SIDE]);
    for i in 0..SIDE {
        let at = i as f32;
        z[i] = row[2] + at * step[2];
        let inverse = 1.0 / z[i].max(1e-6);
        let u = (row[0] + at * step[0]) * inverse * projection.focal[0] + projection.middle[0];
        let v = (row[1] + at * step[1]) * inverse * projection.focal[1] + projection.middle[1];
        let ok = (u >= -0.5) & (u < width - 0.5) & (v >= -0.5) & (v < height - 0.5) & (z[i] > 0.0);
        inside[i] = if ok { 1.0 } else { 0.0 };
        let whole = |x: f32, end: f32| (x.clamp(0.0, end - 1.0) + WHOLE) - WHOLE;
        pixel[i] =
            (whole(v, height) * width + whole(u, width) + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits());
    }
    let mut depth = [0.0f32; SIDE];
    for i in 0..SIDE {
        depth[i] = projection.picture.depth_metres.get(pixel[i] as usize).copied().unwrap_or(0.0);
    }
    for i in 0..SIDE {
        let d = depth[i];
        let signed = d - z[i];
        let seen = (d > 0.0) & (d < config.max_depth_metres) & (signed > -config.truncation_metres);
        let w = if seen { inside[i] } else { 0.0 };
        let cut = signed.min(config.truncation_metres);
        let sum = weight[i] + w;
        let mean = (distance[i] * weight[i] + cut * w) / sum.max(1.0);
        distance[i] = if w > 0.0 { mean } else { distance[i] };
        weight[i] = sum.min(MAX_WEIGHT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::topology::{Defects, defects};

    #[test]
    fn a_tilted_plane_becomes_a_true_mesh_from_two_sides() {
        let camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
        let rays = camera.ray_table();
        let normal = Vector3::new(0.2f64, -0.1, -1.0).normalize();
        let mut volume = Volume::new(VolumeConfig::default());
        for shift in [-0.05, 0.05] {
            let world_from_camera = Pose::translation(shift, 0.0, 0.0);
            let eye = world_from_camera.translation.vector;
            let depth: Vec<f32> = rays
                .iter()
                .map(|r| {
                    let ray = Vector3::new(f64::from(r[0]), f64::from(r[1]), 1.0);
                    ((-0.6 - normal.dot(&eye)) / normal.dot(&ray)) as f32
                })
                .collect();
            volume.integrate(&DepthPicture {
                depth_metres: &depth,
                camera: &camera,
                world_from_camera: &world_from_camera,
            });
        }
        let mesh = volume.mesh(2.0);
        assert!(mesh.triangles.len() > 50_000, "{}", mesh.triangles.len());
        let found = defects(&mesh);
        assert_eq!((found.crowded_edges, found.degenerate), (0, Defects::default().degenerate));
        let off = |p: &[f32; 3]| (Vector3::from(*p).cast::<f64>().dot(&normal) + 0.6).abs();
        // a pixel is 1.1 mm wide there, and the nearest one counts
        let worst = mesh.vertices.points.iter().map(off).fold(0.0, f64::max);
        let mean = mesh.vertices.points.iter().map(off).sum::<f64>() / mesh.vertices.len() as f64;
        assert!(worst < 0.0009 && mean < 0.0003, "{worst} {mean}");
        let facing = mesh.triangles.iter().filter(|t| mesh.twice_area_vector(t).dot(&normal) > 0.0).count();
        assert_eq!(facing, mesh.triangles.len());
    }

    #[test]
    fn a_picture_of_the_wrong_size_changes_nothing() {
        let camera = Intrinsics::pinhole(16, 12, 13.0, 13.0, 7.5, 5.5);
        let mut volume = Volume::new(VolumeConfig::default());
        let world_from_camera = Pose::identity();
        volume.integrate(&DepthPicture {
            depth_metres: &[0.5; 7],
            camera: &camera,
            world_from_camera: &world_from_camera,
        });
        assert_eq!(volume.blocks(), 0);
        assert!(volume.mesh(1.0).triangles.is_empty());
    }
}
