//! The surface's blocks: the finest corners wherever the surface passes, found by following it from the points.

use rayon::prelude::*;

use super::level::{per_axis, region};
use super::samples::Samples;
use super::solve::Field;
use crate::surface::blocks::{Blocks, CORNERS, SIDE, key};

/// With the next bricks' nearest corners.
const PADDED: usize = SIDE + 2;
/// More cells with surface in them are no surface of a product.
const MOST_CELLS: usize = 1 << 23;

/// A brick the surface passes.
struct Passed {
    values: [f32; CORNERS],
    /// Bit 9 dz + 3 dy + dx: the brick there (-1, 0, 1 each, plus 1) shares a cell that the surface crosses.
    shared: u32,
    /// Crossed cells.
    cells: usize,
}

/// `iso - u` on the finest corners near its zero level; `None` where that is too large.
pub(super) fn zero_level(field: &Field, samples: &Samples, iso: f32) -> Option<Blocks> {
    let n = per_axis(field.depth());
    let mut seen = vec![false; n * n * n];
    let at = |p: [i32; 3]| (p[2] as usize * n + p[1] as usize) * n + p[0] as usize;
    let mut waiting = Vec::new();
    for s in &samples.list {
        let place = s.at.map(|v| (v * (1u32 << field.depth()) as f32) as i32 / SIDE as i32);
        if !std::mem::replace(&mut seen[at(place)], true) {
            waiting.push(place);
        }
    }
    let mut passed: Vec<(u64, [f32; CORNERS])> = Vec::new();
    let mut cells = 0;
    while !waiting.is_empty() {
        let found: Vec<Option<Passed>> = waiting.par_iter().map(|&place| pass(field, place, iso)).collect();
        let mut next = Vec::new();
        for (place, found) in waiting.iter().zip(found) {
            let Some(found) = found else { continue };
            for step in (0..27).filter(|step| found.shared >> step & 1 == 1) {
                let to: [i32; 3] = std::array::from_fn(|k| place[k] + step / [1, 3, 9][k] % 3 - 1);
                let inside = to.iter().all(|&v| (0..n as i32).contains(&v));
                if inside && !std::mem::replace(&mut seen[at(to)], true) {
                    next.push(to);
                }
            }
            cells += found.cells;
            passed.push((key(place.map(|v| v as u32)), found.values));
        }
        if cells > MOST_CELLS {
            return None;
        }
        waiting = next;
    }
    passed.sort_unstable_by_key(|p| p.0);
    let (keys, values) = passed.into_iter().unzip();
    let voxel = samples.side / f64::from(1u32 << field.depth());
    Some(Blocks { origin: samples.low.map(|v| v as f32), voxel_metres: voxel as f32, keys, values })
}

/// A brick with its cells' signs; `None` where the surface crosses no cell that touches it.
fn pass(field: &Field, place: [i32; 3], iso: f32) -> Option<Passed> {
    let mut padded = [0.0; PADDED * PADDED * PADDED];
    region(&field.levels, place.map(|v| SIDE as i32 * v - 1), PADDED, &mut padded);
    let inside = padded.iter().filter(|&&u| iso - u < 0.0).count();
    if inside == 0 || inside == padded.len() {
        return None;
    }
    let (mut shared, mut cells) = (0, 0);
    for z in 0..PADDED - 1 {
        for y in 0..PADDED - 1 {
            for x in 0..PADDED - 1 {
                let first = (z * PADDED + y) * PADDED + x;
                let below = |c: usize| {
                    let step = (c & 1) + (c >> 1 & 1) * PADDED + (c >> 2) * PADDED * PADDED;
                    iso - padded[first + step] < 0.0
                };
                let count = (0..8).filter(|&c| below(c)).count();
                if count != 0 && count != 8 {
                    shared |= bricks_of_cell([x, y, z]);
                    cells += usize::from(x > 0 && y > 0 && z > 0);
                }
            }
        }
    }
    let values = std::array::from_fn(|i| {
        let [x, y, z] = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        iso - padded[((z + 1) * PADDED + y + 1) * PADDED + x + 1]
    });
    (shared != 0).then_some(Passed { values, shared, cells })
}

/// Which bricks the corners of a cell belong to; the cell is counted from the corner before the brick's first.
fn bricks_of_cell(cell: [usize; 3]) -> u32 {
    let mut bricks = 0;
    for c in 0..8 {
        // -1 for the brick before, 0 for this, 1 for the next, plus 1
        let along = |k: usize| (cell[k] + (c >> k & 1)).div_ceil(SIDE).min(2);
        let step = |k: usize| if cell[k] + (c >> k & 1) == 0 { 0 } else { along(k).max(1) };
        bricks |= 1u32 << (step(0) + 3 * step(1) + 9 * step(2));
    }
    bricks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_at_a_bricks_ends_belong_to_the_neighbours_too() {
        let bit = |x: i32, y: i32, z: i32| 1u32 << (x + 1 + 3 * (y + 1) + 9 * (z + 1));
        assert_eq!(bricks_of_cell([1, 1, 1]), bit(0, 0, 0));
        assert_eq!(bricks_of_cell([7, 7, 7]), bit(0, 0, 0));
        assert_eq!(bricks_of_cell([0, 1, 1]), bit(0, 0, 0) | bit(-1, 0, 0));
        assert_eq!(bricks_of_cell([4, 8, 1]), bit(0, 0, 0) | bit(0, 1, 0));
        assert_eq!(bricks_of_cell([8, 8, 8]).count_ones(), 8);
    }
}
