//! Relaxation: bricks of even place, then those of odd place; within a brick rows of corners in two colours, a row at once.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::level::{Brick, Level, NONE};
use super::screen::Pins;
use crate::simd;
use crate::surface::blocks::{CORNERS, SIDE};

/// Rows are swept so often while a brick is at hand.
const SWEEPS: usize = 2;
/// Weight that holds a corner at 0, and the part of a cell within which a corner counts as on a wall.
const HELD: f32 = 1e30;
const NEAREST: f32 = 1e-3;
/// Stride of the rows, and of the layers, with the neighbours' corners around.
const ROW: usize = 16;
const LAYER: usize = ROW * (SIDE + 2);
/// Place of the brick's first corner.
const FIRST: usize = LAYER + ROW + 4;

const ZERO: &Brick = &[0.0; CORNERS];

/// The equations of a level's solved bricks: `(6 + m + wall) u_i - Σ u_neighbour = b + pull + m u_i(last)`.
pub(super) struct Equations {
    pub(super) right: Vec<Brick>,
    weight: Vec<Brick>,
    beside: Vec<[u32; 6]>,
    /// Of the bricks along each axis.
    walls: [Vec<[f32; SIDE]>; 3],
    pub(super) pins: Pins,
}

impl Equations {
    /// The walls lie at these distances from the cube's middle, where its side is 1.
    pub(super) fn new(level: &Level, right: Vec<Brick>, pins: Pins, walls: [f32; 3]) -> Self {
        let weight = (0..level.solved).into_par_iter().map(|slot| pins.diagonal(level, slot)).collect();
        let beside = (0..level.solved).map(|slot| level.beside(slot)).collect();
        let walls = walls.map(|wall| along_axis(level, wall));
        Self { right, weight, beside, walls, pins }
    }
}

/// What the walls add to the diagonal, corner by corner along an axis: those on a wall and beyond are held at 0, and those less than
/// a cell from one feel it the more the nearer it is.
fn along_axis(level: &Level, wall: f32) -> Vec<[f32; SIDE]> {
    let (scale, middle) = (level.scale(), 0.5 * level.scale());
    let of_corner = |corner: usize| {
        let left = wall * scale - (corner as f32 - middle).abs();
        if left < NEAREST { HELD } else { (1.0 / left - 1.0).max(0.0) }
    };
    (0..level.per_axis).map(|place| std::array::from_fn(|i| of_corner(SIDE * place + i))).collect()
}

/// One sweep over all solved bricks.
pub(super) fn sweep(level: &mut Level, equations: &mut Equations) {
    equations.pins.look(level);
    let (even, solved) = (level.even, level.solved);
    let places = &level.places;
    let (evens, others) = level.values.split_at_mut(even);
    evens.par_iter_mut().enumerate().for_each(|(slot, brick)| {
        relax(brick, slot, places[slot], equations, |slot| &others[slot - even]);
    });
    let (odds, ghosts) = others.split_at_mut(solved - even);
    let evens = &*evens;
    odds.par_iter_mut().enumerate().for_each(|(i, brick)| {
        let slot = even + i;
        let other = |slot: usize| if slot < even { &evens[slot] } else { &ghosts[slot - solved] };
        relax(brick, slot, places[slot], equations, other);
    });
}

fn relax<'a>(
    brick: &mut Brick,
    slot: usize,
    place: [u16; 3],
    equations: &Equations,
    other: impl Fn(usize) -> &'a Brick,
) {
    let beside = equations.beside[slot].map(|slot| if slot == NONE { ZERO } else { other(slot as usize) });
    let mut right = equations.right[slot];
    equations.pins.pull(place.map(i32::from), slot, &mut right);
    let walls = std::array::from_fn(|k| equations.walls[k][usize::from(place[k])]);
    simd::run(Relax {
        brick,
        beside: &beside,
        right: &mut right,
        weight: &equations.weight[slot],
        walls: &walls,
    });
}

/// One brick among its neighbours.
struct Relax<'a> {
    brick: &'a mut Brick,
    beside: &'a [&'a Brick; 6],
    right: &'a mut Brick,
    weight: &'a Brick,
    walls: &'a [[f32; SIDE]; 3],
}

impl WithSimd for Relax<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { brick, beside, right, weight, walls } = self;
        let mut u = [0.0; LAYER * (SIDE + 2)];
        let mut inverse = [0.0; CORNERS];
        for z in 0..SIDE {
            for y in 0..SIDE {
                for x in 0..SIDE {
                    let i = (z * SIDE + y) * SIDE + x;
                    inverse[i] = 1.0 / (6.0 + weight[i] + (walls[0][x] + walls[1][y] + walls[2][z]));
                    right[i] += weight[i] * brick[i];
                }
            }
        }
        gather(&mut u, brick, beside);
        for _ in 0..SWEEPS {
            for color in 0..2 {
                for z in 0..SIDE {
                    for y in ((z + color) % 2..SIDE).step_by(2) {
                        relax_row(
                            &mut u,
                            (z * SIDE + y) * SIDE,
                            FIRST + z * LAYER + y * ROW,
                            right,
                            &inverse,
                        );
                    }
                }
            }
        }
        for z in 0..SIDE {
            for y in 0..SIDE {
                let from = FIRST + z * LAYER + y * ROW;
                brick[(z * SIDE + y) * SIDE..][..SIDE].copy_from_slice(&u[from..from + SIDE]);
            }
        }
    }
}

#[inline(always)]
fn relax_row(u: &mut [f32; LAYER * (SIDE + 2)], i: usize, at: usize, right: &Brick, inverse: &Brick) {
    let mut new = [0.0f32; SIDE];
    {
        let row = |from: usize| -> &[f32; SIDE] { (&u[from..from + SIDE]).try_into().expect("a row") };
        let (left, after) = (row(at - 1), row(at + 1));
        let (below, above) = (row(at - ROW), row(at + ROW));
        let (under, over) = (row(at - LAYER), row(at + LAYER));
        let right: &[f32; SIDE] = (&right[i..i + SIDE]).try_into().expect("a row");
        let inverse: &[f32; SIDE] = (&inverse[i..i + SIDE]).try_into().expect("a row");
        for x in 0..SIDE {
            let sum = (left[x] + after[x]) + (below[x] + above[x]) + (under[x] + over[x]);
            new[x] = (right[x] + sum) * inverse[x];
        }
    }
    u[at..at + SIDE].copy_from_slice(&new);
}

/// The brick with the nearest corners of its six neighbours around.
#[inline(always)]
fn gather(u: &mut [f32; LAYER * (SIDE + 2)], brick: &Brick, beside: &[&Brick; 6]) {
    let [left, after, below, above, under, over] = beside;
    let row = |y: usize, z: usize| (z * SIDE + y) * SIDE;
    for z in 0..SIDE {
        for y in 0..SIDE {
            let (from, to) = (row(y, z), FIRST + z * LAYER + y * ROW);
            u[to..to + SIDE].copy_from_slice(&brick[from..from + SIDE]);
            u[to - 1] = left[from + SIDE - 1];
            u[to + SIDE] = after[from];
        }
        let (low, high) = (FIRST + z * LAYER - ROW, FIRST + z * LAYER + SIDE * ROW);
        u[low..low + SIDE].copy_from_slice(&below[row(SIDE - 1, z)..][..SIDE]);
        u[high..high + SIDE].copy_from_slice(&above[row(0, z)..][..SIDE]);
        let (low, high) = (FIRST - LAYER + z * ROW, FIRST + SIDE * LAYER + z * ROW);
        u[low..low + SIDE].copy_from_slice(&under[row(z, SIDE - 1)..][..SIDE]);
        u[high..high + SIDE].copy_from_slice(&over[row(z, 0)..][..SIDE]);
    }
}
