//! Signed distance to the surface that oriented points describe, on voxel corners near them.
//!
//! At a corner x: `f(x) = sum g n·(x - p) / sum g`, with compact bells along the normal and across it,
//! `g = (1 - d²/D²)⁴ (1 - t²/T²)⁴`: the one along makes the nearest sheet of a thin wall decide. A corner is known only where points carry it from all sides along the surface.

use rayon::prelude::*;

use super::SurfaceConfig;
use super::blocks::{Blocks, CORNERS, MAX_PLACE, SIDE, key, place};
use crate::cloud::PointCloud;

/// Length of the mean of unit normals at which they are not, and surely are, of one side of a wall.
const ONE_SIDED: [f32; 2] = [0.5, 0.8];

/// Sums at the corners of one block.
struct Sums {
    /// Of the bell, and of the bell times distance, times normal and times the way from the point to the corner.
    bell: [f32; CORNERS],
    distance: [f32; CORNERS],
    normal: [[f32; 3]; CORNERS],
    way: [[f32; 3]; CORNERS],
    /// Of the support, and of the support times the offset along the surface.
    support: [f32; CORNERS],
    offset: [[f32; 3]; CORNERS],
}

/// The field of a cloud with normals; empty for a cloud without.
pub fn signed_distance(cloud: &PointCloud, config: &SurfaceConfig) -> Blocks {
    let Some((low, _)) = cloud.bounds().filter(|_| cloud.has_normals()) else { return Blocks::default() };
    let voxel = config.voxel_metres;
    let margin = config.reach_metres.max(config.support_metres) + voxel;
    let origin = low.map(|v| v - margin);
    let touched = touched_blocks(cloud, &origin, config);
    let groups: Vec<&[(u64, u32)]> = touched.chunk_by(|a, b| a.0 == b.0).collect();
    let (keys, values): (Vec<u64>, Vec<[f32; CORNERS]>) =
        groups.into_par_iter().map(|group| (group[0].0, values_of(group, cloud, &origin, config))).unzip();
    Blocks { origin, voxel_metres: voxel, keys, values }
}

/// Block and point for every block that a point reaches, sorted.
fn touched_blocks(cloud: &PointCloud, origin: &[f32; 3], config: &SurfaceConfig) -> Vec<(u64, u32)> {
    let size = config.voxel_metres * SIDE as f32;
    let block = |v: f32, k: usize| ((v - origin[k]) / size).clamp(0.0, MAX_PLACE as f32) as u32;
    let reach = config.reach_metres.max(config.support_metres);
    let mut touched: Vec<(u64, u32)> = cloud
        .points
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, p)| {
            let from: [u32; 3] = std::array::from_fn(|k| block(p[k] - reach, k));
            let to: [u32; 3] = std::array::from_fn(|k| block(p[k] + reach, k));
            let mut blocks = Vec::with_capacity(8);
            for z in from[2]..=to[2] {
                for y in from[1]..=to[1] {
                    blocks.extend((from[0]..=to[0]).map(|x| (key([x, y, z]), i as u32)));
                }
            }
            blocks
        })
        .collect();
    touched.par_sort_unstable();
    touched
}

/// Values at the corners of one block, from the points that reach it, in their order.
fn values_of(
    group: &[(u64, u32)],
    cloud: &PointCloud,
    origin: &[f32; 3],
    config: &SurfaceConfig,
) -> [f32; CORNERS] {
    let at = place(group[0].0);
    let first: [f32; 3] =
        std::array::from_fn(|k| origin[k] + (at[k] * SIDE as u32) as f32 * config.voxel_metres);
    let mut sums = Box::new(Sums {
        bell: [0.0; CORNERS],
        distance: [0.0; CORNERS],
        normal: [[0.0; 3]; CORNERS],
        way: [[0.0; 3]; CORNERS],
        support: [0.0; CORNERS],
        offset: [[0.0; 3]; CORNERS],
    });
    for &(_, i) in group {
        sums.add(&cloud.points[i as usize], &cloud.normals[i as usize], &first, config);
    }
    sums.values(config)
}

impl Sums {
    fn add(&mut self, p: &[f32; 3], n: &[f32; 3], first: &[f32; 3], config: &SurfaceConfig) {
        let (voxel, reach, support2) =
            (config.voxel_metres, config.reach_metres, config.support_metres * config.support_metres);
        let span = reach.max(config.support_metres);
        let range = |k: usize| {
            let from = ((p[k] - span - first[k]) / voxel).ceil().max(0.0) as usize;
            let to = ((p[k] + span - first[k]) / voxel).floor().min(SIDE as f32 - 1.0);
            from..(to + 1.0).max(0.0) as usize
        };
        for z in range(2) {
            let dz = first[2] + z as f32 * voxel - p[2];
            for y in range(1) {
                let dy = first[1] + y as f32 * voxel - p[1];
                for x in range(0) {
                    let dx = first[0] + x as f32 * voxel - p[0];
                    let along = n[0] * dx + n[1] * dy + n[2] * dz;
                    let t2 = (dx * dx + dy * dy + dz * dz - along * along).max(0.0);
                    if along.abs() > reach || t2 > support2 {
                        continue;
                    }
                    let c = (z * SIDE + y) * SIDE + x;
                    let carry = (1.0 - t2 / support2).powi(2);
                    let nearness = 1.0 - along * along / (reach * reach);
                    let bell = carry * carry * nearness.powi(4) + 1e-9;
                    self.bell[c] += bell;
                    self.distance[c] += bell * along;
                    self.support[c] += carry;
                    let way = [dx, dy, dz];
                    for k in 0..3 {
                        self.normal[c][k] += bell * n[k];
                        self.way[c][k] += bell * way[k];
                        self.offset[c][k] += carry * (way[k] - along * n[k]);
                    }
                }
            }
        }
    }

    /// Weighted means; NaN where the points carry too little or lie all on one side.
    fn values(&self, config: &SurfaceConfig) -> [f32; CORNERS] {
        let farthest = config.max_offset * config.support_metres;
        std::array::from_fn(|c| {
            let support = self.support[c];
            if support < config.min_support || self.bell[c] < 1e-6 {
                return f32::NAN;
            }
            let o = self.offset[c].map(|v| v / support);
            let off2 = o[0] * o[0] + o[1] * o[1] + o[2] * o[2];
            if off2 > farthest * farthest { f32::NAN } else { self.distance(c) }
        })
    }

    /// Mean over the points of `(n + normal here)·(x - p) / 2`. Tangent planes alone lie outside a bulge, by the more the farther their points
    /// are; with the normal here, which is the points' mean, that cancels to second order. Between the two sides of a wall there is none, and the planes decide.
    fn distance(&self, c: usize) -> f32 {
        let (bell, n, way) = (self.bell[c], &self.normal[c], &self.way[c]);
        let by_planes = self.distance[c] / bell;
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        let by_normal_here = (n[0] * way[0] + n[1] * way[1] + n[2] * way[2]) / (length * bell).max(1e-12);
        let agreement = ((length / bell - ONE_SIDED[0]) / (ONE_SIDED[1] - ONE_SIDED[0])).clamp(0.0, 1.0);
        by_planes + 0.5 * agreement * (by_normal_here - by_planes)
    }
}
