//! Vertices take colour, normal and deviation from the fused points around them that face the same way.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::SurfaceConfig;
use crate::fuse::Fused;
use crate::fuse::grid::Grid;
use crate::mesh::Mesh;

/// Least cosine between a point's and the surface's normal for the point to belong to this side of a wall.
const SAME_SIDE: f32 = 0.3;

/// Fills in the attributes of all vertices.
pub(super) fn take_from_points(mesh: &mut Mesh, fused: &Fused, config: &SurfaceConfig) {
    let facing = vertex_normals(mesh);
    let grid = Grid::new(&fused.cloud.points, config.support_metres);
    let taken: Vec<([u8; 3], [f32; 3], f32)> = mesh
        .vertices
        .points
        .par_iter()
        .zip(&facing)
        .map(|(p, n)| of_vertex(p, n, fused, &grid, config.support_metres))
        .collect();
    mesh.vertices.colors = taken.iter().map(|t| t.0).collect();
    mesh.vertices.normals = taken.iter().map(|t| t.1).collect();
    mesh.deviations_metres = taken.iter().map(|t| t.2).collect();
}

/// Unit normals of the vertices from the triangles around them, weighted by area.
pub(super) fn vertex_normals(mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut sums = vec![Vector3::<f64>::zeros(); mesh.vertices.len()];
    for triangle in &mesh.triangles {
        let normal = mesh.twice_area_vector(triangle);
        for &v in triangle {
            sums[v as usize] += normal;
        }
    }
    sums.into_iter().map(|s| s.try_normalize(1e-30).unwrap_or_else(Vector3::z).cast::<f32>().into()).collect()
}

fn of_vertex(
    p: &[f32; 3],
    facing: &[f32; 3],
    fused: &Fused,
    grid: &Grid,
    reach: f32,
) -> ([u8; 3], [f32; 3], f32) {
    let (mut color, mut normal) = ([0.0f32; 3], [0.0f32; 3]);
    let (mut narrow_sum, mut wide_sum, mut deviation) = (0.0f32, 0.0f32, 0.0f32);
    grid.around(p, |i| {
        let (q, n) = (fused.cloud.points[i], fused.cloud.normals[i]);
        let d2: f32 = (0..3).map(|k| (q[k] - p[k]).powi(2)).sum();
        let cosine: f32 = (0..3).map(|k| n[k] * facing[k]).sum();
        if d2 > reach * reach || cosine < SAME_SIDE {
            return;
        }
        let wide = (1.0 - d2 / (reach * reach)).powi(2);
        let narrow = wide.powi(4) + 1e-6;
        narrow_sum += narrow;
        wide_sum += wide;
        deviation += wide * fused.deviations_metres[i];
        for k in 0..3 {
            color[k] += narrow * f32::from(fused.cloud.colors[i][k]);
            normal[k] += wide * n[k];
        }
    });
    if wide_sum <= 0.0 {
        return ([176; 3], *facing, crate::mesh::INVENTED);
    }
    let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-12);
    let color = color.map(|v| (v / narrow_sum).round().clamp(0.0, 255.0) as u8);
    (color, normal.map(|v| v / length), deviation / wide_sum)
}
