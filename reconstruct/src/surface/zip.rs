//! Cracks are closed across: again and again the shortest new edge between two vertices next but one on the rim, then a
//! new vertex in the middle of every triangle, so that what is invented can be told from what was measured.

use std::collections::BTreeSet;

use super::fill::{add_between, mean};
use crate::mesh::Mesh;

/// Triangles below this area count as lines, square metres.
const LEAST_AREA_M2: f64 = 1e-10;
/// How far the middle of a line is moved outwards, metres.
const LIFT_METRES: f32 = 0.00003;

/// Closes a border with invented surface that keeps close to it; `taken` are the edges that must not be made again.
pub(super) fn zip(mesh: &mut Mesh, border: &[u32], taken: &BTreeSet<(u32, u32)>) {
    let mut rim = border.to_vec();
    let mut triangles = Vec::new();
    while rim.len() > 3 {
        let Some(tip) = best_ear(mesh, &rim, taken) else { break };
        let n = rim.len();
        triangles.push([rim[(tip + 1) % n], rim[tip], rim[(tip + n - 1) % n]]);
        rim.remove(tip);
    }
    for [a, b, c] in triangles.into_iter().chain((rim.len() == 3).then(|| [rim[2], rim[1], rim[0]])) {
        let middle = off_the_line(mesh, [a, b, c], mean(mesh, &[a, b, c]));
        let m = add_between(mesh, a as usize, &middle, 1.0);
        mesh.triangles.extend([[a, b, m], [b, c, m], [c, a, m]]);
    }
    if rim.len() > 3 {
        super::fill::fill(mesh, &rim);
    }
}

/// The middle of three corners, moved a little outwards where these lie on one line, so that no triangle is without area.
fn off_the_line(mesh: &Mesh, corners: [u32; 3], middle: [f32; 3]) -> [f32; 3] {
    if mesh.area(&corners) > LEAST_AREA_M2 {
        return middle;
    }
    let outward = mesh.vertices.normals[corners[0] as usize];
    std::array::from_fn(|k| middle[k] + LIFT_METRES * outward[k])
}

/// Edges that the surface already has between vertices of its borders.
pub(super) fn edges_between_borders(mesh: &Mesh, borders: &[Vec<u32>]) -> BTreeSet<(u32, u32)> {
    let mut on_border = vec![false; mesh.vertices.len()];
    for &v in borders.iter().flatten() {
        on_border[v as usize] = true;
    }
    let edges = mesh.triangles.iter().flat_map(|t| (0..3).map(|k| (t[k], t[(k + 1) % 3])));
    let both = edges.filter(|&(a, b)| on_border[a as usize] && on_border[b as usize]);
    both.map(|(a, b)| (a.min(b), a.max(b))).collect()
}

/// Vertex of the rim whose neighbours are nearest to each other and not joined yet.
fn best_ear(mesh: &Mesh, rim: &[u32], taken: &BTreeSet<(u32, u32)>) -> Option<usize> {
    let n = rim.len();
    let length2 = |i: usize| {
        let (a, b) = (rim[(i + n - 1) % n], rim[(i + 1) % n]);
        let (p, q) = (mesh.vertices.points[a as usize], mesh.vertices.points[b as usize]);
        let free = !taken.contains(&(a.min(b), a.max(b)));
        free.then(|| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f32>())
    };
    let ears = (0..n).filter_map(|i| Some((length2(i)?, i)));
    ears.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, i)| i)
}
