//! Surface: the fused points become one triangle mesh that says of every vertex how well it was measured.
//!
//! World frame, z up, metres. The points' tangent planes give a signed distance on sparse blocks of voxels (implicit
//! moving least squares, Shen et al. 2004; blocks after Nießner et al. 2013), whose zero level is drawn by marching cubes
//! (Lorensen and Cline 1987, with cases that fit together on every face). Distances reach only [`SurfaceConfig::reach_metres`],
//! less than a thin wall, and near points count most, so both sides of a mug's wall survive. What no view measured is then
//! closed where it is small or faces the floor, and marked; what is large stays open and is listed.

mod attributes;
mod base;
pub mod blocks;
pub mod cubes;
mod distance;
mod fill;
mod holes;
pub mod poisson;
mod zip;

use serde::{Deserialize, Serialize};

use crate::fuse::{Fused, PlacedView};
use crate::mesh::{Mesh, topology};
pub use distance::signed_distance;

/// Settings of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceConfig {
    /// Side of a voxel, metres.
    pub voxel_metres: f32,
    /// Distances are known this far from the points, metres; at least 1.75 voxels, and less than a thin wall.
    pub reach_metres: f32,
    /// Points within this distance along the surface carry it, metres.
    pub support_metres: f32,
    /// Least support, in points straight below.
    pub min_support: f32,
    /// Beyond the points' edge by more than this share of `support_metres` there is no surface.
    pub max_offset: f32,
    /// Pieces smaller than this share of the whole are dropped.
    pub min_piece: f64,
    /// Holes with a shorter rim are closed, metres.
    pub closed_rim_metres: f64,
    /// So are cracks: longer holes whose two sides are nearer to each other than this, metres.
    pub crack_metres: f64,
    /// A view that sees this much farther than a hole's middle looks through it, metres.
    pub see_through_metres: f64,
    /// Holes that lie lower and face the floor are the side it stands on, metres.
    pub base_metres: f64,
}

impl Default for SurfaceConfig {
    fn default() -> Self {
        Self {
            voxel_metres: 0.001,
            reach_metres: 0.002,
            support_metres: 0.003,
            min_support: 0.8,
            max_offset: 0.29,
            min_piece: 0.005,
            closed_rim_metres: 0.06,
            crack_metres: 0.005,
            see_through_metres: 0.008,
            base_metres: 0.010,
        }
    }
}

/// What happened to a place without measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HoleKind {
    /// Small, closed with invented surface.
    Closed,
    /// The side it stands on, closed flat with invented surface.
    Base,
    /// Too large to be closed: nobody knows what is there.
    Unseen,
    /// Views look through it: a real opening, or an inside that no view reaches.
    Opening,
}

/// A place without measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Hole {
    /// What happened to it.
    pub kind: HoleKind,
    /// Middle of its rim, world frame, metres.
    pub center_m: [f64; 3],
    /// Direction it faces, unit vector.
    pub facing: [f64; 3],
    /// Length of its rim, metres.
    pub rim_m: f64,
    /// Area it spans, square metres.
    pub area_m2: f64,
}

/// The surface with what is missing.
#[derive(Debug, Clone, Default)]
pub struct Surface {
    /// Triangles; vertices with colours, normals and deviations.
    pub mesh: Mesh,
    /// Places without measurement, the largest first.
    pub holes: Vec<Hole>,
}

/// Makes the surface of fused points. `stands_on_floor`: z = 0 is what the product stands on.
pub fn surface(
    fused: &Fused,
    views: &[PlacedView],
    stands_on_floor: bool,
    config: &SurfaceConfig,
) -> Surface {
    let field = signed_distance(&fused.cloud, config);
    let of_the_whole = |areas: &[f64]| config.min_piece * areas.iter().sum::<f64>();
    let mut mesh = topology::without_small_pieces(&cubes::triangulate(&field), of_the_whole);
    topology::split_touching_vertices(&mut mesh);
    attributes::take_from_points(&mut mesh, fused, config);
    let holes = holes::close(&mut mesh, views, stands_on_floor, config);
    Surface { mesh, holes }
}

#[cfg(test)]
mod tests;
