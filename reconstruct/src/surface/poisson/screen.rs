//! Screening: u is drawn to a half at the samples.
//!
//! The term `a Σ w (u(p) - 1/2)²` couples the eight corners of a sample's cell. It is bounded from above by one that does not couple
//! them (its rows' sums on the diagonal), and the rest is taken from the last values: `w φ_i (1/2 - u(p))`. So each step lessens the
//! energy, and the fixed point is the same.

use rayon::prelude::*;

use super::level::{Brick, Level};
use super::samples::Sample;
use super::touches::Touches;
use crate::surface::blocks::{CORNERS, SIDE};

/// A sample stands for at most so many faces of a cell: alone among fine cells it would pull like a rope.
const MOST_FACES: f32 = 4.0;

/// A sample on its level.
struct Pin {
    /// Lowest corner of its cell.
    cell: [i32; 3],
    /// Place in the cell, 0 to 1.
    part: [f32; 3],
    weight: f32,
}

/// The samples that pull on a level.
pub(super) struct Pins {
    list: Vec<Pin>,
    touches: Touches,
    /// `w (1/2 - u)` of each.
    pulls: Vec<f32>,
}

impl Pins {
    pub(super) fn new(level: &Level, samples: &[Sample], point_weight: f32) -> Self {
        let scale = level.scale();
        let pins: Vec<Pin> = samples.iter().map(|s| pin(s, scale, point_weight)).collect();
        let known = |i: usize| {
            let (low, high) = (pins[i].cell, pins[i].cell.map(|v| v + 1));
            let all = (0..8).all(|c| level.slot(corner(low, c).map(|v| v >> 3)).is_some());
            all.then_some((low, high))
        };
        let touches = Touches::new(level, pins.len(), known);
        let pulls = vec![0.0; pins.len()];
        Self { list: pins, touches, pulls }
    }

    /// The bound's diagonal for every corner of a solved brick.
    pub(super) fn diagonal(&self, level: &Level, slot: usize) -> Brick {
        let mut brick = [0.0; CORNERS];
        self.spread(level.place(slot), slot, &mut brick, |pin| pin.weight);
        brick
    }

    /// Takes u at the samples.
    pub(super) fn look(&mut self, level: &Level) {
        self.pulls.par_iter_mut().zip(&self.list).for_each(|(pull, pin)| {
            *pull = pin.value(level).map_or(0.0, |u| pin.weight * (0.5 - u));
        });
    }

    /// Adds the pulls to the corners of a solved brick.
    pub(super) fn pull(&self, place: [i32; 3], slot: usize, brick: &mut Brick) {
        for &i in self.touches.of(slot) {
            self.list[i as usize].spread(place, self.pulls[i as usize], brick);
        }
    }

    fn spread(&self, place: [i32; 3], slot: usize, brick: &mut Brick, value: impl Fn(&Pin) -> f32) {
        for &i in self.touches.of(slot) {
            let pin = &self.list[i as usize];
            pin.spread(place, value(pin), brick);
        }
    }
}

fn pin(s: &Sample, scale: f32, point_weight: f32) -> Pin {
    let at = s.at.map(|v| v * scale);
    let cell = at.map(|v| v as i32);
    Pin {
        cell,
        part: std::array::from_fn(|k| at[k] - cell[k] as f32),
        weight: point_weight * (s.area * scale * scale).min(MOST_FACES),
    }
}

fn corner(cell: [i32; 3], c: usize) -> [i32; 3] {
    std::array::from_fn(|k| cell[k] + (c >> k & 1) as i32)
}

impl Pin {
    fn share(&self, c: usize) -> f32 {
        (0..3).map(|k| if c >> k & 1 == 1 { self.part[k] } else { 1.0 - self.part[k] }).product()
    }

    fn value(&self, level: &Level) -> Option<f32> {
        let within = self.cell.map(|v| (v & 7) as usize);
        if within.iter().all(|&v| v < SIDE - 1) {
            let values = &level.values[level.slot(self.cell.map(|v| v >> 3))?];
            let first = (within[2] * SIDE + within[1]) * SIDE + within[0];
            let at = |c: usize| first + (c & 1) + (c >> 1 & 1) * SIDE + (c >> 2) * SIDE * SIDE;
            return Some((0..8).map(|c| self.share(c) * values[at(c)]).sum());
        }
        let mut sum = 0.0;
        for c in 0..8 {
            sum += self.share(c) * level.value(corner(self.cell, c))?;
        }
        Some(sum)
    }

    fn spread(&self, place: [i32; 3], value: f32, brick: &mut Brick) {
        let first: [i32; 3] = std::array::from_fn(|k| self.cell[k] - SIDE as i32 * place[k]);
        for c in 0..8 {
            let [x, y, z] = corner(first, c);
            if (x | y | z) & !(SIDE as i32 - 1) == 0 {
                brick[(z as usize * SIDE + y as usize) * SIDE + x as usize] += self.share(c) * value;
            }
        }
    }
}

/// u at a place of a level; `None` where one of its cell's corners has no brick.
pub(super) fn value_at(level: &Level, s: &Sample) -> Option<f32> {
    pin(s, level.scale(), 0.0).value(level)
}

/// Length of u's gradient there, per side of the cube.
pub(super) fn slope_at(level: &Level, s: &Sample) -> Option<f32> {
    let pin = pin(s, level.scale(), 0.0);
    let mut values = [0.0; 8];
    for (c, value) in values.iter_mut().enumerate() {
        *value = level.value(corner(pin.cell, c))?;
    }
    let along = |k: usize| -> f32 {
        let beside = |c: usize| -> f32 {
            (0..3)
                .filter(|&j| j != k)
                .map(|j| if c >> j & 1 == 1 { pin.part[j] } else { 1.0 - pin.part[j] })
                .product()
        };
        (0..8).map(|c| if c >> k & 1 == 1 { beside(c) * values[c] } else { -beside(c) * values[c] }).sum()
    };
    Some((0..3).map(|k| along(k).powi(2)).sum::<f32>().sqrt() * level.scale())
}
