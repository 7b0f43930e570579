//! Fusion: the product's pixels of all used views become one clean cloud, each point with its uncertainty.
//!
//! World frame, metres. Points that other views see through are carved away; the rest is thinned to a voxel grid that
//! keeps the two sides of a thin wall apart, and every remaining point is moved along its normal onto the weighted mean
//! of its neighbours facing the same way (a moving-least-squares step, Levin 2004), which averages the views' noise. Its colour is that of
//! the pixels beside it.

mod clean;
mod color;
mod gains;
pub(crate) mod grid;
mod samples;
mod smooth;
mod spot;

use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::image::ColorImage;
use crate::pose::Pose;
use crate::view::DepthView;
use grid::{Grid, Walk};
use samples::{Sample, samples_of};
use spot::{Smoothed, Spot, spots_of, thin};

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
    let smoothed = colored(smoothed(&spots_of(&samples, config.voxel_metres), config), &samples, config);
    let thinned = thin(&smoothed, config.voxel_metres);
    let has_floor = config.floor_metres.is_finite();
    let kept = if has_floor { clean::drop_board_remains(thinned, config) } else { thinned };
    to_fused(&clean::drop_small_clusters(kept))
}

/// The spots on the surface that their neighbours make.
fn smoothed(spots: &[Spot], config: &FuseConfig) -> Vec<Smoothed> {
    let points: Vec<[f32; 3]> = spots.par_iter().map(|s| s.point).collect();
    let (grid, order) = Grid::new(&points, config.radius_metres).in_order();
    let spots: Vec<Spot> = order.into_par_iter().map(|i| spots[i as usize]).collect();
    let onto_surface = |near: &mut Walk<'_>, spot: &Spot| smooth::smooth(spot, &spots, near, config);
    spots.par_iter().map_init(|| grid.walk(), onto_surface).flatten_iter().collect()
}

/// The points with the colours of the pixels beside them.
fn colored(points: Vec<Smoothed>, samples: &[Sample], config: &FuseConfig) -> Vec<Smoothed> {
    let places: Vec<[f32; 3]> = samples.par_iter().map(|s| s.point).collect();
    let (grid, order) = Grid::new(&places, color::REACH_METRES).in_order();
    let samples: Vec<Sample> = order.into_par_iter().map(|i| samples[i as usize]).collect();
    let with_color = |near: &mut Walk<'_>, at: Smoothed| Smoothed {
        color: color::color_at(&at, &samples, near, config.same_side_cosine),
        ..at
    };
    points.into_par_iter().map_init(|| grid.walk(), with_color).collect()
}

fn to_fused(points: &[Smoothed]) -> Fused {
    let cloud = PointCloud {
        points: points.iter().map(|s| s.point).collect(),
        colors: points.iter().map(|s| s.color.map(|c| c.round().clamp(0.0, 255.0) as u8)).collect(),
        normals: points.iter().map(|s| s.normal).collect(),
    };
    Fused { cloud, deviations_metres: points.iter().map(|s| s.deviation).collect() }
}
