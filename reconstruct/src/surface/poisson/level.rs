//! One level of the octree: bricks of 8 x 8 x 8 corners where the points are, and the values of u on them.
//!
//! A level of depth d has corners 0 to 2^d along an axis; those on the cube's walls, and what lies beyond in the last bricks, are 0.
//! Solved bricks come first, those of even place (x + y + z) before the odd ones, so that either half touches only the other and
//! can be worked on at once; then the ghosts, solved bricks' neighbours that hold the coarser level's values.

use crate::surface::blocks::{CORNERS, SIDE};

/// Values at a brick's corners, x fastest.
pub(super) type Brick = [f32; CORNERS];

/// No brick.
pub(super) const NONE: u32 = u32::MAX;

/// A level's bricks.
pub(super) struct Level {
    pub(super) depth: u32,
    /// Bricks along an axis.
    pub(super) per_axis: usize,
    /// Slot of the brick at each place.
    index: Vec<u32>,
    /// Place of each slot.
    pub(super) places: Vec<[u16; 3]>,
    /// How many solved bricks are of even place, and how many there are.
    pub(super) even: usize,
    pub(super) solved: usize,
    /// Values of u.
    pub(super) values: Vec<Brick>,
}

/// Bricks along an axis of a level.
pub(super) fn per_axis(depth: u32) -> usize {
    (1 << depth) / SIDE + 1
}

impl Level {
    /// The level with bricks where `wanted`, in the order x, y, z of their places, x fastest.
    pub(super) fn new(depth: u32, wanted: &[bool]) -> Self {
        let per_axis = per_axis(depth);
        let mut level = Self {
            depth,
            per_axis,
            index: vec![NONE; wanted.len()],
            places: Vec::new(),
            even: 0,
            solved: 0,
            values: Vec::new(),
        };
        for odd in [0, 1] {
            for at in (0..wanted.len()).filter(|&at| wanted[at]) {
                let place = [at % per_axis, at / per_axis % per_axis, at / per_axis / per_axis];
                if place.iter().sum::<usize>() % 2 == odd {
                    level.index[at] = level.places.len() as u32;
                    level.places.push(place.map(|v| v as u16));
                }
            }
            level.even = if odd == 0 { level.places.len() } else { level.even };
        }
        level.solved = level.places.len();
        for slot in 0..level.solved {
            for beside in beside(level.place(slot)) {
                if level.is_inside(beside) && level.slot(beside).is_none() {
                    let at = level.at(beside);
                    level.index[at] = level.places.len() as u32;
                    level.places.push(beside.map(|v| v as u16));
                }
            }
        }
        level.values = vec![[0.0; CORNERS]; level.places.len()];
        level
    }

    /// Highest corner along an axis: the cube's wall.
    pub(super) fn last_corner(&self) -> i32 {
        1 << self.depth
    }

    pub(super) fn scale(&self) -> f32 {
        self.last_corner() as f32
    }

    fn at(&self, place: [i32; 3]) -> usize {
        (place[2] as usize * self.per_axis + place[1] as usize) * self.per_axis + place[0] as usize
    }

    /// Whether a brick may be there.
    pub(super) fn is_inside(&self, place: [i32; 3]) -> bool {
        place.iter().all(|&v| (0..self.per_axis as i32).contains(&v))
    }

    /// The brick at a place.
    pub(super) fn slot(&self, place: [i32; 3]) -> Option<usize> {
        let slot = if self.is_inside(place) { self.index[self.at(place)] } else { NONE };
        (slot != NONE).then_some(slot as usize)
    }

    pub(super) fn place(&self, slot: usize) -> [i32; 3] {
        self.places[slot].map(i32::from)
    }

    /// Slots of the six neighbours: below and above along x, y and z.
    pub(super) fn beside(&self, slot: usize) -> [u32; 6] {
        beside(self.place(slot)).map(|place| self.slot(place).map_or(NONE, |slot| slot as u32))
    }

    /// The value at a corner; `None` where there is no brick.
    pub(super) fn value(&self, corner: [i32; 3]) -> Option<f32> {
        let slot = self.slot(corner.map(|v| v >> 3))?;
        Some(self.values[slot][local(corner)])
    }
}

/// Place of a corner in its brick.
fn local(corner: [i32; 3]) -> usize {
    let [x, y, z] = corner.map(|v| (v & 7) as usize);
    (z * SIDE + y) * SIDE + x
}

fn beside(place: [i32; 3]) -> [[i32; 3]; 6] {
    std::array::from_fn(|side| {
        let mut to = place;
        to[side / 2] += if side % 2 == 0 { -1 } else { 1 };
        to
    })
}

/// Values at the corners `first .. first + n` along each axis of the last level, x fastest; those without a brick are
/// interpolated from the coarser levels, and 0 outside of the cube. The first level must be whole.
pub(super) fn region(levels: &[Level], first: [i32; 3], n: usize, out: &mut [f32]) {
    let Some((level, coarser)) = levels.split_last() else { return out.fill(0.0) };
    let last = first.map(|v| (v + n as i32 - 1) >> 3);
    let mut missing = Vec::new();
    for z in first[2] >> 3..=last[2] {
        for y in first[1] >> 3..=last[1] {
            for x in first[0] >> 3..=last[0] {
                let overlap = Overlap::new([x, y, z], first, n);
                match level.slot([x, y, z]) {
                    Some(slot) => overlap.copy(&level.values[slot], out),
                    None if level.is_inside([x, y, z]) => missing.push(overlap),
                    None => overlap.fill(out, |_| 0.0),
                }
            }
        }
    }
    if missing.is_empty() {
        return;
    }
    let parent_first = first.map(|v| v >> 1);
    let parent_n = n / 2 + 2;
    let mut parent = vec![0.0; parent_n.pow(3)];
    region(coarser, parent_first, parent_n, &mut parent);
    let wall = level.last_corner();
    for overlap in missing {
        overlap.fill(out, |corner| {
            if corner.iter().any(|&v| v <= 0 || v >= wall) {
                return 0.0;
            }
            let low: [usize; 3] = std::array::from_fn(|k| ((corner[k] >> 1) - parent_first[k]) as usize);
            let odd = corner.map(|v| (v & 1) as usize);
            let value = |x: usize, y: usize, z: usize| parent[(z * parent_n + y) * parent_n + x];
            let along_x = |y: usize, z: usize| 0.5 * (value(low[0], y, z) + value(low[0] + odd[0], y, z));
            let along_y = |z: usize| 0.5 * (along_x(low[1], z) + along_x(low[1] + odd[1], z));
            0.5 * (along_y(low[2]) + along_y(low[2] + odd[2]))
        });
    }
}

/// Corners that a brick and a region share, counted from the region's first.
struct Overlap {
    place: [i32; 3],
    first: [i32; 3],
    n: usize,
    from: [usize; 3],
    to: [usize; 3],
}

impl Overlap {
    fn new(place: [i32; 3], first: [i32; 3], n: usize) -> Self {
        let from = std::array::from_fn(|k| (8 * place[k] - first[k]).max(0) as usize);
        let to = std::array::from_fn(|k| ((8 * place[k] + 8 - first[k]) as usize).min(n));
        Self { place, first, n, from, to }
    }

    fn rows(&self) -> impl Iterator<Item = (usize, usize)> {
        (self.from[2]..self.to[2]).flat_map(|z| (self.from[1]..self.to[1]).map(move |y| (y, z)))
    }

    fn copy(&self, brick: &Brick, out: &mut [f32]) {
        let length = self.to[0] - self.from[0];
        for (y, z) in self.rows() {
            let corner: [i32; 3] =
                std::array::from_fn(|k| self.first[k] + [self.from[0], y, z][k] as i32 - 8 * self.place[k]);
            let from = local(corner);
            let to = (z * self.n + y) * self.n + self.from[0];
            out[to..to + length].copy_from_slice(&brick[from..from + length]);
        }
    }

    fn fill(&self, out: &mut [f32], value: impl Fn([i32; 3]) -> f32) {
        for (y, z) in self.rows() {
            for x in self.from[0]..self.to[0] {
                let corner = std::array::from_fn(|k| self.first[k] + [x, y, z][k] as i32);
                out[(z * self.n + y) * self.n + x] = value(corner);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// u = x + 2 y - z at every corner off the walls, as cells of the coarse level.
    fn linear(level: &mut Level) {
        let h = 1.0 / level.scale();
        for slot in 0..level.values.len() {
            let place = level.place(slot);
            for (i, v) in level.values[slot].iter_mut().enumerate() {
                let at = [i % 8, i / 8 % 8, i / 64];
                let [x, y, z]: [f32; 3] = std::array::from_fn(|k| (8 * place[k] + at[k] as i32) as f32 * h);
                *v = x + 2.0 * y - z;
            }
        }
    }

    #[test]
    fn bricks_that_are_missing_are_interpolated() {
        let mut coarse = Level::new(4, &[true; 27]);
        linear(&mut coarse);
        let mut wanted = vec![false; 125];
        wanted[2 * 25 + 2 * 5 + 2] = true;
        let mut fine = Level::new(5, &wanted);
        assert_eq!((fine.even, fine.solved, fine.places.len()), (1, 1, 7));
        assert_eq!(fine.beside(0).map(|s| (1..7).contains(&s)), [true; 6]);
        linear(&mut fine);
        let levels = [coarse, fine];
        let mut out = vec![f32::NAN; 1000];
        let first = [7, 15, 13];
        region(&levels, first, 10, &mut out);
        for (i, v) in out.iter().enumerate() {
            let [x, y, z]: [f32; 3] =
                std::array::from_fn(|k| (first[k] + [i % 10, i / 10 % 10, i / 100][k] as i32) as f32 / 32.0);
            assert!((v - (x + 2.0 * y - z)).abs() < 1e-5, "{i}: {v}");
        }
        region(&levels, [-3, 4, 28], 10, &mut out);
        assert!(out.iter().all(|v| v.is_finite()) && out[0] == 0.0);
    }
}
