//! Fusion: the product's pixels of all used views become one clean cloud, each point with its uncertainty.
//!
//! World frame, metres. Points that other views see through are carved away; the rest is thinned to a voxel grid that
//! keeps the two sides of a thin wall apart, and every remaining point is moved along its normal onto the weighted mean
//! of its neighbours facing the same way (a moving-least-squares step, Levin 2004), which averages the views' noise.

mod clean;
mod gains;
pub(crate) mod grid;
mod samples;
mod smooth;

use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::image::ColorImage;
use crate::pose::Pose;
use crate::view::DepthView;
use grid::Grid;
use samples::{Sample, samples_of};

/// Settings of the fusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FuseConfig {
    /// Spacing of the final points, metres.
    pub voxel_metres: f32,
    /// Neighbours within this distance smooth a point, metres.
    pub radius_metres: f32,
    /// Least cosine between normals of the same side of a wall.
    pub same_side_cosine: f32,
    /// A view that sees this much farther than a point sees through it, metres.
    pub see_through_metres: f64,
    /// Pixels seen flatter than this cosine are not used.
    pub min_incidence_cosine: f32,
    /// Least weight of neighbours for a point to stay (1 = one pixel seen straight on).
    pub min_support: f32,
    /// Points are kept above this height only, metres; minus infinity where there is no floor and the product was seen from all
    /// sides.
    pub floor_metres: f32,
}

impl Default for FuseConfig {
    fn default() -> Self {
        Self {
            voxel_metres: 0.001,
            radius_metres: 0.005,
            same_side_cosine: 0.6,
            see_through_metres: 0.010,
            min_incidence_cosine: 0.25,
            min_support: 2.0,
            floor_metres: 0.0018,
        }
    }
}

/// A view ready to be fused.
#[derive(Debug, Clone, Copy)]
pub struct PlacedView<'a> {
    /// Its geometry.
    pub geometry: &'a DepthView,
    /// Its colours, same pixels.
    pub color: &'a ColorImage,
    /// Its pose.
    pub world_from_camera: Pose,
}

/// The clean cloud.
#[derive(Debug, Clone, Default)]
pub struct Fused {
    /// Points on the measured surface with colours and outward normals, world frame, metres.
    pub cloud: PointCloud,
    /// Standard deviation of each point along its normal, metres, as far as the views' own spread tells.
    pub deviations_metres: Vec<f32>,
}

/// Fuses the views.
pub fn fuse(views: &[PlacedView], config: &FuseConfig) -> Fused {
    let gains = gains::color_gains(views);
    let samples: Vec<Sample> = (0..views.len())
        .into_par_iter()
        .map(|i| samples_of(views, i, gains[i], config))
        .collect::<Vec<_>>()
        .concat();
    let points: Vec<[f32; 3]> = samples.iter().map(|s| s.point).collect();
    let (grid, order) = Grid::new(&points, config.radius_metres).in_order();
    let samples: Vec<Sample> = order.into_par_iter().map(|i| samples[i as usize]).collect();
    let seeds = smooth::thin(&samples, config.voxel_metres);
    let smoothed: Vec<Sample> = seeds
        .par_iter()
        .map_init(|| grid.walk(), |near, s| smooth::smooth(s, &samples, near, config))
        .flatten_iter()
        .collect();
    let thinned = smooth::thin(&smoothed, config.voxel_metres);
    let has_floor = config.floor_metres.is_finite();
    let kept = if has_floor { clean::drop_board_remains(thinned, config) } else { thinned };
    to_fused(&clean::drop_small_clusters(kept))
}

fn to_fused(samples: &[Sample]) -> Fused {
    let cloud = PointCloud {
        points: samples.iter().map(|s| s.point).collect(),
        colors: samples.iter().map(|s| s.color.map(|c| c.round().clamp(0.0, 255.0) as u8)).collect(),
        normals: samples.iter().map(|s| s.normal).collect(),
    };
    Fused { cloud, deviations_metres: samples.iter().map(|s| s.deviation).collect() }
}
