//! Surface nets (Gibson 1998): a signed distance becomes a closed triangle mesh, counter-clockwise seen from outside.
//!
//! Space is walked in blocks; a block whose centre is farther from the surface than its own radius is skipped,
//! so the cost follows the surface.

use std::collections::HashMap;

use rayon::prelude::*;

use super::sdf::Vec3;

/// Cells along a block's side.
const BLOCK: usize = 8;
/// Corners along a block's side.
const SIDE: usize = BLOCK + 1;
/// How much steeper than 1 a distance may be before a block is skipped wrongly.
const STEEPNESS: f32 = 1.5;

/// Positions in metres and triangles between them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Net {
    /// Vertices.
    pub vertices: Vec<Vec3>,
    /// Indices into the vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// What one block of cells adds: the cells the surface crosses, and the grid edges it crosses.
struct BlockNet {
    cells: Vec<CellNet>,
    crossings: Vec<(usize, [usize; 3], bool)>,
}

/// The sheets of surface in one cell: a vertex for each, so that two sheets that pass through one cell stay apart and the mesh
/// stays manifold (Nielson 2004).
struct CellNet {
    key: u64,
    /// Which sheet crosses each of the cell's edges.
    sheet_of_edge: [u8; 12],
    /// A vertex a sheet, in cells from the cell's first corner.
    vertices: Vec<Vec3>,
}

/// A regular grid of cells over a box.
struct Grid {
    origin: Vec3,
    cell: f32,
    cells: [usize; 3],
}

impl Grid {
    fn corner(&self, index: [usize; 3]) -> Vec3 {
        self.origin + Vec3::new(index[0] as f32, index[1] as f32, index[2] as f32) * self.cell
    }

    fn key(&self, index: [usize; 3]) -> u64 {
        ((index[2] * self.cells[1] + index[1]) * self.cells[0] + index[0]) as u64
    }
}

/// Mesh of the zero level of `distance` inside the box `low..high`, with cells of `cell` metres.
///
/// The surface must keep at least two cells away from the sides of the box.
pub fn surface_net(distance: &(dyn Fn(Vec3) -> f32 + Sync), low: Vec3, high: Vec3, cell: f32) -> Net {
    let count = |k: usize| (((high[k] - low[k]) / cell).ceil() as usize).next_multiple_of(BLOCK);
    // Half a cell of offset keeps flat undersides at z = 0 between two layers of corners.
    let grid = Grid { origin: low - Vec3::repeat(cell * 0.5), cell, cells: [count(0), count(1), count(2)] };
    let blocks = grid.cells.map(|n| n / BLOCK);
    let parts: Vec<BlockNet> = (0..blocks.iter().product::<usize>())
        .into_par_iter()
        .filter_map(|i| {
            let block = [i % blocks[0], i / blocks[0] % blocks[1], i / (blocks[0] * blocks[1])];
            block_net(distance, &grid, block)
        })
        .collect();
    assemble(&grid, &parts)
}

fn block_net(distance: &(dyn Fn(Vec3) -> f32 + Sync), grid: &Grid, block: [usize; 3]) -> Option<BlockNet> {
    let first = block.map(|b| b * BLOCK);
    let half = BLOCK as f32 * 0.5 * grid.cell;
    let centre = grid.corner(first) + Vec3::repeat(half);
    if distance(centre).abs() > STEEPNESS * (half * 1.733 + grid.cell) {
        return None;
    }
    let at = |x: usize, y: usize, z: usize| (z * SIDE + y) * SIDE + x;
    let mut values = vec![0.0f32; SIDE * SIDE * SIDE];
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 0..SIDE {
                values[at(x, y, z)] = distance(grid.corner([first[0] + x, first[1] + y, first[2] + z]));
            }
        }
    }
    let mut net = BlockNet { cells: Vec::new(), crossings: Vec::new() };
    for z in 0..BLOCK {
        for y in 0..BLOCK {
            for x in 0..BLOCK {
                let corners: [f32; 8] =
                    std::array::from_fn(|c| values[at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))]);
                let index = [first[0] + x, first[1] + y, first[2] + z];
                let Some(cell) = cell_net(&corners, grid.key(index)) else { continue };
                net.cells.push(CellNet {
                    vertices: cell.vertices.iter().map(|v| grid.corner(index) + v * grid.cell).collect(),
                    ..cell
                });
                for axis in 0..3 {
                    if (corners[0] < 0.0) != (corners[1 << axis] < 0.0) {
                        net.crossings.push((axis, index, corners[0] < 0.0));
                    }
                }
            }
        }
    }
    Some(net)
}

/// Number of the cell's edge that runs along `axis` from a corner.
fn edge(corner: usize, axis: usize) -> usize {
    axis * 4 + (corner >> ((axis + 1) % 3) & 1) + 2 * (corner >> ((axis + 2) % 3) & 1)
}

/// The sheets of surface in a cell; `None` where no edge is crossed.
fn cell_net(corners: &[f32; 8], key: u64) -> Option<CellNet> {
    let inside = corners.map(|v| v < 0.0);
    if inside.iter().all(|&i| i == inside[0]) {
        return None;
    }
    let sheets = join_edges(&inside);
    let mut net = CellNet { key, sheet_of_edge: [u8::MAX; 12], vertices: Vec::new() };
    let (mut names, mut counts) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for a in (0..8usize).filter(|a| a & (1 << axis) == 0) {
            let b = a | (1 << axis);
            if inside[a] == inside[b] {
                continue;
            }
            let e = edge(a, axis);
            let sheet = names.iter().position(|&n| n == sheets[e]).unwrap_or_else(|| {
                names.push(sheets[e]);
                net.vertices.push(Vec3::zeros());
                counts.push(0.0f32);
                names.len() - 1
            });
            let mut p = Vec3::new((a & 1) as f32, (a >> 1 & 1) as f32, (a >> 2) as f32);
            p[axis] += corners[a] / (corners[a] - corners[b]);
            net.vertices[sheet] += p;
            counts[sheet] += 1.0;
            net.sheet_of_edge[e] = sheet as u8;
        }
    }
    net.vertices.iter_mut().zip(counts).for_each(|(v, n)| *v /= n);
    Some(net)
}

/// A name for every edge of a cell; edges that one sheet of surface crosses get the same name. On a face, the surface cuts off the
/// corners inside, each by itself where two lie across from each other: both cells of a face see it the same way.
fn join_edges(inside: &[bool; 8]) -> [u8; 12] {
    let mut names: [u8; 12] = std::array::from_fn(|e| e as u8);
    let mut join = |a: usize, b: usize| {
        let (keep, drop) = (names[a], names[b]);
        names.iter_mut().filter(|n| **n == drop).for_each(|n| *n = keep);
    };
    for axis in 0..3 {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        for base in [0, 1usize << axis] {
            let face = [base, base | 1 << b, base | 1 << b | 1 << c, base | 1 << c];
            let side = |k: usize| edge(face[k] & !(1 << [b, c, b, c][k]), [b, c, b, c][k]);
            let crossed: Vec<usize> =
                (0..4).filter(|&k| inside[face[k]] != inside[face[(k + 1) % 4]]).collect();
            match crossed.len() {
                2 => join(side(crossed[0]), side(crossed[1])),
                // Sides k - 1 and k meet at corner k.
                4 => (0..4).filter(|&k| inside[face[k]]).for_each(|k| join(side((k + 3) % 4), side(k))),
                _ => {}
            }
        }
    }
    names
}

/// Joins the blocks: every crossed grid edge becomes a quad between the four cells around it.
fn assemble(grid: &Grid, parts: &[BlockNet]) -> Net {
    let mut net = Net::default();
    let mut cells = HashMap::new();
    for cell in parts.iter().flat_map(|part| &part.cells) {
        cells.insert(cell.key, (net.vertices.len() as u32, &cell.sheet_of_edge));
        net.vertices.extend_from_slice(&cell.vertices);
    }
    for &(axis, index, starts_inside) in parts.iter().flat_map(|part| &part.crossings) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        if index[b] == 0 || index[c] == 0 {
            continue;
        }
        let vertex = |db: usize, dc: usize| {
            let mut cell = index;
            cell[b] -= db;
            cell[c] -= dc;
            let (first, sheet_of_edge) = cells.get(&grid.key(cell))?;
            Some(first + u32::from(sheet_of_edge[edge(db << b | dc << c, axis)]))
        };
        let corners = (vertex(0, 0), vertex(1, 0), vertex(1, 1), vertex(0, 1));
        let (Some(p), Some(q), Some(r), Some(s)) = corners else { continue };
        let quad = if starts_inside { [p, q, r, s] } else { [p, s, r, q] };
        split_quad(&mut net, quad);
    }
    net
}

/// Cuts a quad along its shorter diagonal.
fn split_quad(net: &mut Net, [p, q, r, s]: [u32; 4]) {
    let length = |a: u32, b: u32| (net.vertices[a as usize] - net.vertices[b as usize]).norm_squared();
    if length(p, r) <= length(q, s) {
        net.triangles.extend([[p, q, r], [p, r, s]]);
    } else {
        net.triangles.extend([[q, r, s], [q, s, p]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::sdf::sphere;

    #[test]
    fn a_ball_has_its_volume_outside_out() {
        let (r, side) = (0.03, Vec3::repeat(0.04));
        let net = surface_net(&|p| sphere(p, r), -side, side, 0.0013);
        let corner = |i: u32| net.vertices[i as usize].cast::<f64>();
        let volume: f64 =
            net.triangles.iter().map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))) / 6.0).sum();
        let expected = 4.0 / 3.0 * std::f64::consts::PI * f64::from(r).powi(3);
        assert!((volume / expected - 1.0).abs() < 0.01, "{volume} {expected}");
    }
}
