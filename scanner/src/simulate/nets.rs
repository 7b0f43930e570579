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

/// What one block of cells adds: a vertex for every cell the surface crosses, and where edges cross.
struct BlockNet {
    vertices: Vec<(u64, Vec3)>,
    crossings: Vec<(usize, [usize; 3], bool)>,
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
    let mut net = BlockNet { vertices: Vec::new(), crossings: Vec::new() };
    for z in 0..BLOCK {
        for y in 0..BLOCK {
            for x in 0..BLOCK {
                let corners: [f32; 8] =
                    std::array::from_fn(|c| values[at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))]);
                let Some(offset) = cell_vertex(&corners) else { continue };
                let index = [first[0] + x, first[1] + y, first[2] + z];
                net.vertices.push((grid.key(index), grid.corner(index) + offset * grid.cell));
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

/// Mean of the places where the surface crosses the cell's twelve edges, in cells; `None` where it crosses none.
fn cell_vertex(corners: &[f32; 8]) -> Option<Vec3> {
    let (mut sum, mut count) = (Vec3::zeros(), 0.0f32);
    for axis in 0..3 {
        for a in (0..8usize).filter(|a| a & (1 << axis) == 0) {
            let (va, vb) = (corners[a], corners[a | (1 << axis)]);
            if (va < 0.0) == (vb < 0.0) {
                continue;
            }
            let mut p = Vec3::new((a & 1) as f32, (a >> 1 & 1) as f32, (a >> 2) as f32);
            p[axis] += va / (va - vb);
            sum += p;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}

/// Joins the blocks: every crossed grid edge becomes a quad between the four cells around it.
fn assemble(grid: &Grid, parts: &[BlockNet]) -> Net {
    let mut net = Net::default();
    let mut vertex_of = HashMap::new();
    for (key, p) in parts.iter().flat_map(|part| &part.vertices) {
        vertex_of.insert(*key, net.vertices.len() as u32);
        net.vertices.push(*p);
    }
    for &(axis, index, starts_inside) in parts.iter().flat_map(|part| &part.crossings) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        if index[b] == 0 || index[c] == 0 {
            continue;
        }
        let step = |db: usize, dc: usize| {
            let mut cell = index;
            cell[b] -= db;
            cell[c] -= dc;
            vertex_of.get(&grid.key(cell)).copied()
        };
        let (Some(p), Some(q), Some(r), Some(s)) = (step(0, 0), step(1, 0), step(1, 1), step(0, 1)) else {
            continue;
        };
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
