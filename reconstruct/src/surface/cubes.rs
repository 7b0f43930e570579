//! Marching cubes (Lorensen and Cline 1987) over sparse blocks.
//!
//! The 256 cases are worked out instead of listed: on every face of a cube the crossed edges are joined so that negative
//! corners are kept apart. Two cubes see the same signs on their common face, so the triangles meet without gaps; and no
//! triangle has an inner edge on a face, where the neighbour could have the same. Each crossed voxel edge has one vertex.

use std::sync::LazyLock;

use rayon::prelude::*;

use super::blocks::{Blocks, CORNERS, SIDE, key, place};
use crate::cloud::PointCloud;
use crate::mesh::Mesh;

/// Vertices keep this share of a voxel edge from its ends, so that no triangle is without area.
const FROM_END: f32 = 0.02;
/// Corners of a block along an axis, with the neighbours' first.
const PADDED: usize = SIDE + 1;
/// A surface has about so many triangles a vertex.
const TRIANGLES_A_VERTEX: usize = 2;
/// No vertex on this edge.
const NONE: u16 = u16::MAX;

/// Triangles of every case, three edges each. Corner c is at (c & 1, c >> 1 & 1, c >> 2); its bit is set where negative.
static CASES: LazyLock<Vec<Vec<[u8; 3]>>> = LazyLock::new(|| (0..256).map(triangles_of_case).collect());

/// First corner of edge `4 * axis + b + 2 * c`: the edge runs along `axis`, b and c are its places on the next two axes.
const fn edge_corner(edge: u8) -> [usize; 3] {
    let (axis, rest) = ((edge / 4) as usize, edge % 4);
    let mut at = [0; 3];
    at[(axis + 1) % 3] = (rest & 1) as usize;
    at[(axis + 2) % 3] = (rest >> 1) as usize;
    at
}

/// The edge between two corners that differ along one axis.
fn edge_between(a: usize, b: usize) -> u8 {
    let axis = (a ^ b).trailing_zeros() as usize;
    let bit = |k: usize| (a >> (k % 3)) & 1;
    (4 * axis + bit(axis + 1) + 2 * bit(axis + 2)) as u8
}

/// The four corners of a face, counter-clockwise seen from outside the cube.
fn face_corners(axis: usize, side: usize) -> [usize; 4] {
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    let corner = |u: usize, v: usize| (side << axis) | (u << b) | (v << c);
    let around = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    if side == 1 { around } else { [around[0], around[3], around[2], around[1]] }
}

fn faces() -> impl Iterator<Item = (usize, usize)> {
    (0..3).flat_map(|axis| [(axis, 0), (axis, 1)])
}

/// Triangles of one case.
fn triangles_of_case(case: usize) -> Vec<[u8; 3]> {
    let inside = |corner: usize| (case >> corner) & 1 == 1;
    let mut next = [u8::MAX; 12];
    for (axis, side) in faces() {
        let corners = face_corners(axis, side);
        for leave in 0..4 {
            // going round, from inside to outside here; back to where this run of inside corners began
            if inside(corners[leave]) && !inside(corners[(leave + 1) % 4]) {
                let mut first = leave;
                while inside(corners[(first + 3) % 4]) {
                    first = (first + 3) % 4;
                }
                let enter = edge_between(corners[(first + 3) % 4], corners[first]);
                next[enter as usize] = edge_between(corners[leave], corners[(leave + 1) % 4]);
            }
        }
    }
    let mut triangles = Vec::new();
    let mut done = [false; 12];
    for start in 0..12u8 {
        let mut polygon = Vec::new();
        let mut at = start;
        while next[at as usize] != u8::MAX && !done[at as usize] {
            done[at as usize] = true;
            polygon.push(at);
            at = next[at as usize];
        }
        if polygon.len() >= 3 {
            cut_polygon(&polygon, &mut triangles);
        }
    }
    triangles
}

/// Whether two edges of the cube lie on a common face.
fn share_face(a: u8, b: u8) -> bool {
    faces().any(|(axis, side)| {
        let corners = face_corners(axis, side);
        let on = |e: u8| (0..4).any(|i| edge_between(corners[i], corners[(i + 1) % 4]) == e);
        on(a) && on(b)
    })
}

/// Cuts a polygon into triangles without inner edges on a face of the cube where that is possible.
fn cut_polygon(polygon: &[u8], triangles: &mut Vec<[u8; 3]>) {
    if polygon.len() == 3 {
        triangles.push([polygon[0], polygon[1], polygon[2]]);
        return;
    }
    let n = polygon.len();
    let ear = |i: usize| (polygon[(i + n - 1) % n], polygon[i], polygon[(i + 1) % n]);
    let rest = |i: usize| -> Vec<u8> { (0..n).filter(|&j| j != i).map(|j| polygon[j]).collect() };
    let free = (0..n).find(|&i| {
        let (before, _, after) = ear(i);
        !share_face(before, after) && can_be_cut(&rest(i))
    });
    let i = free.unwrap_or(0);
    let (before, tip, after) = ear(i);
    triangles.push([before, tip, after]);
    cut_polygon(&rest(i), triangles);
}

fn can_be_cut(polygon: &[u8]) -> bool {
    let n = polygon.len();
    n == 3
        || (0..n).any(|i| {
            !share_face(polygon[(i + n - 1) % n], polygon[(i + 1) % n])
                && can_be_cut(&(0..n).filter(|&j| j != i).map(|j| polygon[j]).collect::<Vec<_>>())
        })
}

/// Vertices of one block's edges.
struct BlockVertices {
    points: Vec<[f32; 3]>,
    /// Number within the block of the vertex on the edge along axis a from corner c, at `a * CORNERS + c`.
    on_edge: Vec<u16>,
}

/// The zero level of a field: vertices without attributes, triangles counter-clockwise seen from the positive side.
pub fn triangulate(field: &Blocks) -> Mesh {
    let padded = |block: usize| padded_values(field, block);
    let vertices: Vec<BlockVertices> = (0..field.keys.len())
        .into_par_iter()
        .map(|block| block_vertices(&padded(block), field.corner_of(block), field.voxel_metres))
        .collect();
    let mut first = Vec::with_capacity(vertices.len());
    let mut count = 0u32;
    for block in &vertices {
        first.push(count);
        count += block.points.len() as u32;
    }
    let triangles: Vec<Vec<[u32; 3]>> = (0..field.keys.len())
        .into_par_iter()
        .map(|block| {
            if vertices[block].points.is_empty() && !has_crossed_neighbour(field, block, &vertices) {
                return Vec::new();
            }
            block_triangles(field, block, &padded(block), &vertices, &first)
        })
        .collect();
    let points = vertices.into_iter().flat_map(|b| b.points).collect();
    let mesh = Mesh {
        vertices: PointCloud { points, ..PointCloud::default() },
        triangles: triangles.concat(),
        ..Mesh::default()
    };
    if mesh.triangles.is_empty() { Mesh::default() } else { mesh.without_loose_vertices() }
}

/// The block and its seven neighbours towards higher x, y and z, by dx + 2 dy + 4 dz.
fn neighbours(field: &Blocks, block: usize) -> [Option<usize>; 8] {
    let at = place(field.keys[block]);
    std::array::from_fn(|d| {
        let to = [at[0] + (d as u32 & 1), at[1] + (d as u32 >> 1 & 1), at[2] + (d as u32 >> 2)];
        if d == 0 { Some(block) } else { field.find(key(to)) }
    })
}

fn has_crossed_neighbour(field: &Blocks, block: usize, vertices: &[BlockVertices]) -> bool {
    neighbours(field, block).iter().flatten().any(|&b| !vertices[b].points.is_empty())
}

/// Values of a block with the first corners of the next blocks; NaN where there is none.
fn padded_values(field: &Blocks, block: usize) -> Vec<f32> {
    let near = neighbours(field, block);
    let mut out = vec![f32::NAN; PADDED * PADDED * PADDED];
    for z in 0..PADDED {
        for y in 0..PADDED {
            let row = (z / SIDE) * 4 + (y / SIDE) * 2;
            let from = ((z % SIDE) * SIDE + y % SIDE) * SIDE;
            let to = (z * PADDED + y) * PADDED;
            if let Some(b) = near[row] {
                out[to..to + SIDE].copy_from_slice(&field.values[b][from..from + SIDE]);
            }
            if let Some(b) = near[row + 1] {
                out[to + SIDE] = field.values[b][from];
            }
        }
    }
    out
}

const STEP: [usize; 3] = [1, PADDED, PADDED * PADDED];

fn block_vertices(values: &[f32], corner: [f32; 3], voxel: f32) -> BlockVertices {
    let mut out = BlockVertices { points: Vec::new(), on_edge: Vec::new() };
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 0..SIDE {
                let here = (z * PADDED + y) * PADDED + x;
                let a = values[here];
                if a.is_nan() {
                    continue;
                }
                for (axis, step) in STEP.into_iter().enumerate() {
                    let b = values[here + step];
                    if b.is_nan() || (a < 0.0) == (b < 0.0) {
                        continue;
                    }
                    if out.on_edge.is_empty() {
                        out.on_edge = vec![NONE; 3 * CORNERS];
                    }
                    out.on_edge[axis * CORNERS + (z * SIDE + y) * SIDE + x] = out.points.len() as u16;
                    let t = (a / (a - b)).clamp(FROM_END, 1.0 - FROM_END);
                    let mut at = [x as f32, y as f32, z as f32];
                    at[axis] += t;
                    out.points.push(std::array::from_fn(|k| corner[k] + at[k] * voxel));
                }
            }
        }
    }
    out
}

fn block_triangles(
    field: &Blocks,
    block: usize,
    values: &[f32],
    vertices: &[BlockVertices],
    first: &[u32],
) -> Vec<[u32; 3]> {
    let near = neighbours(field, block);
    let vertex = |x: usize, y: usize, z: usize, edge: u8| -> u32 {
        let d = edge_corner(edge);
        let at = [x + d[0], y + d[1], z + d[2]];
        let b = near[at[0] / SIDE + 2 * (at[1] / SIDE) + 4 * (at[2] / SIDE)];
        let b = b.expect("a corner with a value is in a block");
        let c = ((at[2] % SIDE) * SIDE + at[1] % SIDE) * SIDE + at[0] % SIDE;
        first[b] + u32::from(vertices[b].on_edge[edge as usize / 4 * CORNERS + c])
    };
    let mut out = Vec::with_capacity(TRIANGLES_A_VERTEX * vertices[block].points.len());
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 0..SIDE {
                let Some(case) = case_of(values, (z * PADDED + y) * PADDED + x) else { continue };
                out.extend(CASES[case].iter().map(|t| t.map(|edge| vertex(x, y, z, edge))));
            }
        }
    }
    out
}

/// Which corners of a cube are negative; `None` where one is not known or all have one sign.
fn case_of(values: &[f32], here: usize) -> Option<usize> {
    let mut case = 0;
    let mut sum = 0.0;
    for corner in 0..8 {
        let v = values[here + (corner & 1) + (corner >> 1 & 1) * PADDED + (corner >> 2) * PADDED * PADDED];
        sum += v;
        case |= usize::from(v < 0.0) << corner;
    }
    (case != 0 && case != 255 && !sum.is_nan()).then_some(case)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::topology::{Defects, borders, defects};

    #[test]
    fn no_case_has_an_inner_edge_on_a_face() {
        for case in 0..256 {
            let triangles = &CASES[case];
            for (t, triangle) in triangles.iter().enumerate() {
                for k in 0..3 {
                    let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                    let inner = triangles
                        .iter()
                        .enumerate()
                        .any(|(u, other)| u != t && (0..3).any(|j| (other[j], other[(j + 1) % 3]) == (b, a)));
                    assert!(!inner || !share_face(a, b), "case {case}: {triangles:?}");
                }
            }
        }
    }

    #[test]
    fn one_corner_gives_one_triangle_facing_away_from_it() {
        let [t] = CASES[1][..] else { panic!("{:?}", CASES[1]) };
        let middle = |e: u8| {
            let mut p = edge_corner(e).map(|v| v as f64);
            p[e as usize / 4] += 0.5;
            nalgebra::Vector3::from(p)
        };
        let [a, b, c] = t.map(middle);
        assert!((b - a).cross(&(c - a)).sum() > 0.0);
    }

    /// Any signs at all: whatever the noise, the surface inside the known voxels is manifold and closed.
    #[test]
    fn random_signs_give_a_closed_manifold_surface() {
        let mut rng = fastrand::Rng::with_seed(9);
        let mut field = Blocks { voxel_metres: 1.0, ..Blocks::default() };
        for z in 0..2 {
            for y in 0..2 {
                for x in 0..2 {
                    field.keys.push(key([x, y, z]));
                    let mut values = [1.0f32; CORNERS];
                    for (i, v) in values.iter_mut().enumerate() {
                        let at = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
                        let shell = (0..3).any(|k| {
                            let c = at[k] + SIDE * [x, y, z][k] as usize;
                            c == 0 || c == 2 * SIDE - 1
                        });
                        if !shell {
                            *v = rng.f32() - 0.5;
                        }
                    }
                    field.values.push(values);
                }
            }
        }
        let mesh = triangulate(&field);
        assert!(mesh.triangles.len() > 2000);
        assert_eq!(borders(&mesh.triangles), Vec::<Vec<u32>>::new());
        assert_eq!(defects(&mesh), Defects::default());
    }
}
