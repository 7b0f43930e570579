//! Vertices take colour and deviation from the nearest point; far from every point they are invented.

use rayon::prelude::*;

use super::samples::{Samples, cells};
use super::solve::Field;
use crate::cloud::PointCloud;
use crate::knn::Tree;
use crate::mesh::{INVENTED, Mesh};
use crate::surface::attributes::vertex_normals;

/// Farther from the nearest point than so many of its spacings a vertex is invented.
const SPACINGS: f32 = 2.0;
/// Points of cells so many levels coarser than the finest tell together how much they scatter.
const COARSER: u32 = 3;
/// Integral of the squared quadratic B-spline: a kernel averages over its width by this, along either axis.
const OF_KERNEL: f32 = 0.55;

/// Fills in colours, normals and deviations.
pub(super) fn take_from_points(
    mesh: &mut Mesh,
    cloud: &PointCloud,
    samples: &Samples,
    field: &Field,
    iso: f32,
) {
    mesh.vertices.normals = vertex_normals(mesh);
    let points: Vec<[f32; 3]> = samples.order.iter().map(|&i| cloud.points[i as usize]).collect();
    let nearest = Tree::new(&points).nearest_n_each(&mesh.vertices.points, 1);
    if cloud.has_colors() {
        let color = |n: &crate::knn::Neighbour| cloud.colors[samples.order[n.index] as usize];
        mesh.vertices.colors = nearest.iter().map(color).collect();
    }
    let deviations = deviations(samples, field, iso);
    let cell = 1.0 / (1u32 << field.depth()) as f32;
    let side = samples.side as f32;
    let deviation = |n: &crate::knn::Neighbour| {
        let spacing = samples.list[n.index].area.sqrt().max(cell) * side;
        if n.sq_dist.sqrt() > SPACINGS * spacing { INVENTED } else { deviations[n.index] }
    };
    mesh.deviations_metres = nearest.iter().map(deviation).collect();
}

/// Standard deviation of the surface at each sample, metres: how far the points around scatter from it, averaged by the
/// kernel that they share.
fn deviations(samples: &Samples, field: &Field, iso: f32) -> Vec<f32> {
    // u - iso over the slope is the distance, as far as u is straight
    let off: Vec<f32> = samples
        .list
        .par_iter()
        .map(|s| ((field.value(s) - iso) / field.slope(s).max(1e-6)).clamp(-s.width, s.width))
        .collect();
    let mut deviations = Vec::with_capacity(off.len());
    let mut first = 0;
    for cell in cells(&samples.list, field.depth().saturating_sub(COARSER)) {
        let square: f32 = off[first..first + cell.len()].iter().map(|d| d * d).sum();
        let scatter = (square / cell.len() as f32).sqrt();
        deviations.extend(cell.iter().map(|s| {
            let finest = 1.0 / (1u32 << field.depth()) as f32;
            let kernel = (s.width.max(finest).powi(2) + finest * finest) / OF_KERNEL.powi(2);
            let sharing = (kernel / s.area).max(1.0);
            scatter / sharing.sqrt() * samples.side as f32
        }));
        first += cell.len();
    }
    deviations
}
