//! The levels from coarse to fine.

use rayon::prelude::*;

use super::level::{Level, per_axis, region};
use super::relax::{Equations, sweep};
use super::samples::{Sample, Samples, merged};
use super::screen::{Pins, slope_at, value_at};
use super::splat;
use crate::surface::blocks::{CORNERS, SIDE};

/// Coarsest level; it and those up to `WHOLE` have all bricks.
const BASE: u32 = 3;
const WHOLE: u32 = 6;
/// Cells are smaller than a sample's kernel by no more than this.
const FINER: f32 = 2.0;
/// Corners round a sample's cell that its level must have.
const AROUND: i32 = 3;
/// A level with more bricks is left out, and all finer ones: half a gigabyte.
const MOST_BRICKS: usize = 1 << 16;

/// Corners of the coarser level under a brick, along an axis.
const HALF: usize = SIDE / 2 + 1;

/// u on all levels.
pub(super) struct Field {
    pub(super) levels: Vec<Level>,
}

/// Sweeps of a level: coarse ones are cheap and carry the shape as a whole.
fn sweeps(depth: u32) -> usize {
    match depth {
        0..=3 => 60,
        4 => 40,
        5 => 24,
        6 => 16,
        _ => 10,
    }
}

/// Solves for u.
pub(super) fn solve(samples: &Samples, point_weight: f32) -> Field {
    let mut merged_samples = vec![merged(&samples.list, samples.depth)];
    for depth in (BASE..samples.depth).rev() {
        let coarser = merged(&merged_samples[merged_samples.len() - 1], depth);
        merged_samples.push(coarser);
    }
    merged_samples.reverse();
    let wanted = wanted(&merged_samples, samples.depth);
    let mut levels: Vec<Level> = Vec::new();
    for (depth, wanted) in (BASE..).zip(&wanted) {
        let mut level = Level::new(depth, wanted);
        start_from_coarser(&levels, &mut level);
        let list = &merged_samples[(depth - BASE) as usize];
        let pins = Pins::new(&level, list, point_weight);
        let right = splat::right_sides(&level, list);
        let mut equations = Equations::new(&level, right, pins, samples.walls);
        for _ in 0..sweeps(depth) {
            sweep(&mut level, &mut equations);
        }
        levels.push(level);
    }
    Field { levels }
}

/// Which bricks each level has, the coarsest first; no more levels than have bricks.
fn wanted(samples: &[Vec<Sample>], depth: u32) -> Vec<Vec<bool>> {
    let mut all: Vec<Vec<bool>> = Vec::new();
    for depth in (BASE..=depth).rev() {
        let mut here = vec![depth <= WHOLE; per_axis(depth).pow(3)];
        mark_samples(&mut here, &samples[(depth - BASE) as usize], depth);
        if let Some(finer) = all.last() {
            mark_parents(&mut here, finer, depth);
        }
        let count = here.iter().filter(|w| **w).count();
        if count > MOST_BRICKS {
            all.clear();
        } else if count > 0 {
            all.push(here);
        }
    }
    all.reverse();
    all
}

fn mark_samples(wanted: &mut [bool], samples: &[Sample], depth: u32) {
    let scale = (1u32 << depth) as f32;
    for s in samples.iter().filter(|s| s.width * scale < FINER) {
        let cell = s.at.map(|v| (v * scale) as i32);
        mark(wanted, depth, cell.map(|v| v - AROUND), cell.map(|v| v + 1 + AROUND));
    }
}

/// The bricks under finer ones and their neighbours.
fn mark_parents(wanted: &mut [bool], finer: &[bool], depth: u32) {
    let n = per_axis(depth + 1);
    for at in (0..finer.len()).filter(|&at| finer[at]) {
        let place = [at % n, at / n % n, at / n / n].map(|v| v as i32);
        let half = SIDE as i32 / 2;
        mark(wanted, depth, place.map(|v| half * (v - 1)), place.map(|v| half * (v + 2)));
    }
}

/// Marks the bricks of all corners from `low` to `high`.
fn mark(wanted: &mut [bool], depth: u32, low: [i32; 3], high: [i32; 3]) {
    let n = per_axis(depth);
    let low = low.map(|v| (v.max(0) / SIDE as i32) as usize);
    let high = high.map(|v| (v.max(0) as usize / SIDE).min(n - 1));
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            wanted[(z * n + y) * n + low[0]..=(z * n + y) * n + high[0]].fill(true);
        }
    }
}

/// Fills all bricks of a level with what the coarser ones say.
fn start_from_coarser(levels: &[Level], level: &mut Level) {
    if levels.is_empty() {
        return;
    }
    let wall = level.last_corner();
    let places = &level.places;
    level.values.par_iter_mut().zip(places).for_each(|(brick, place)| {
        let place = place.map(i32::from);
        let mut parent = [0.0; HALF * HALF * HALF];
        region(levels, place.map(|v| SIDE as i32 / 2 * v), HALF, &mut parent);
        let value = |x: usize, y: usize, z: usize| parent[(z * HALF + y) * HALF + x];
        for i in 0..CORNERS {
            let at = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
            let corner: [i32; 3] = std::array::from_fn(|k| SIDE as i32 * place[k] + at[k] as i32);
            if corner.iter().any(|&v| v <= 0 || v >= wall) {
                continue;
            }
            let (low, odd) = (at.map(|v| v / 2), at.map(|v| v % 2));
            let along_x = |y: usize, z: usize| 0.5 * (value(low[0], y, z) + value(low[0] + odd[0], y, z));
            let along_y = |z: usize| 0.5 * (along_x(low[1], z) + along_x(low[1] + odd[1], z));
            brick[i] = 0.5 * (along_y(low[2]) + along_y(low[2] + odd[2]));
        }
    });
}

impl Field {
    /// Depth of the finest level.
    pub(super) fn depth(&self) -> u32 {
        self.levels.last().map_or(BASE, |level| level.depth)
    }

    /// u at a sample, on the finest level there.
    pub(super) fn value(&self, s: &Sample) -> f32 {
        self.levels.iter().rev().find_map(|level| value_at(level, s)).unwrap_or_default()
    }

    /// Length of u's gradient at a sample, per side of the cube.
    pub(super) fn slope(&self, s: &Sample) -> f32 {
        self.levels.iter().rev().find_map(|level| slope_at(level, s)).unwrap_or_default()
    }

    /// Mean of u at the samples, weighted by their areas; `None` where it is no value between outside and inside.
    pub(super) fn mean_at(&self, samples: &[Sample]) -> Option<f32> {
        let values: Vec<f32> = samples.par_iter().map(|s| self.value(s)).collect();
        let (mut sum, mut weight) = (0.0f64, 0.0f64);
        for (s, u) in samples.iter().zip(values) {
            sum += f64::from(s.area) * f64::from(u);
            weight += f64::from(s.area);
        }
        let mean = (sum / weight) as f32;
        (0.01..1.0).contains(&mean).then_some(mean)
    }
}
