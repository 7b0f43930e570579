//! The right side of the equations: what the normals ask of u's gradient.
//!
//! A sample's normal times its area is spread over the cells' edges by kernels k: `V = -Σ a N k`; k is a quadratic
//! B-spline as wide as the sample's kernel, at least a cell, spread by that of the cells themselves. At corner i the equation is `6 u_i - Σ u_neighbour = V_before - V_after` along the three axes.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::level::{Brick, Level};
use super::samples::Sample;
use super::touches::Touches;
use crate::simd;
use crate::surface::blocks::{CORNERS, SIDE};

/// Kernels are never wider than this many cells.
const WIDEST: f32 = 4.0;
/// Width of the cells' own.
const OF_CELLS: f32 = 1.0;

/// Right sides of all solved bricks.
pub(super) fn right_sides(level: &Level, samples: &[Sample]) -> Vec<Brick> {
    let scale = level.scale();
    let touches = Touches::new(level, samples.len(), |i| {
        let half = 1.5 * width(&samples[i], scale) + 0.5;
        let at = samples[i].at.map(|v| v * scale);
        Some((at.map(|v| (v - half).ceil() as i32), at.map(|v| (v + half).floor() as i32)))
    });
    (0..level.solved)
        .into_par_iter()
        .map(|slot| {
            let first = level.place(slot).map(|v| (SIDE as i32 * v) as f32);
            let mut brick = [0.0; CORNERS];
            simd::run(Splat { brick: &mut brick, samples, touching: touches.of(slot), first, scale });
            brick
        })
        .collect()
}

/// The samples that touch a brick with the first corner `first`.
struct Splat<'a> {
    brick: &'a mut Brick,
    samples: &'a [Sample],
    touching: &'a [u32],
    first: [f32; 3],
    scale: f32,
}

impl WithSimd for Splat<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for &i in self.touching {
            add(self.brick, &self.samples[i as usize], self.first, self.scale);
        }
    }
}

/// Width of a sample's kernel on a level, cells: squares add up where a kernel is spread by another.
fn width(s: &Sample, scale: f32) -> f32 {
    let own = (s.width * scale).clamp(1.0, WIDEST);
    (own * own + OF_CELLS * OF_CELLS).sqrt().min(WIDEST)
}

/// Adds a sample to the brick with the first corner `first`.
#[inline(always)]
fn add(brick: &mut Brick, s: &Sample, first: [f32; 3], scale: f32) {
    let narrow = 1.0 / width(s, scale);
    let mut on_corner = [[0.0; SIDE]; 3];
    let mut step = [[0.0; SIDE]; 3];
    for k in 0..3 {
        let at = s.at[k] * scale - first[k];
        let mut on_edge = [0.0; SIDE + 1];
        for i in 0..=SIDE {
            on_edge[i] = narrow * bell((i as f32 - 0.5 - at) * narrow);
        }
        for i in 0..SIDE {
            on_corner[k][i] = narrow * bell((i as f32 - at) * narrow);
            step[k][i] = on_edge[i] - on_edge[i + 1];
        }
    }
    // facing = a N in units of the cube; a cell's face is 1 / scale²
    let facing = s.facing.map(|v| -v * scale * scale);
    for z in 0..SIDE {
        let (kz, dz) = (on_corner[2][z], step[2][z]);
        if kz == 0.0 && dz == 0.0 {
            continue;
        }
        for y in 0..SIDE {
            let (ky, dy) = (on_corner[1][y], step[1][y]);
            let along = facing[0] * ky * kz;
            let across = facing[1] * dy * kz + facing[2] * ky * dz;
            let row = &mut brick[(z * SIDE + y) * SIDE..][..SIDE];
            for x in 0..SIDE {
                row[x] += along * step[0][x] + across * on_corner[0][x];
            }
        }
    }
}

/// The quadratic B-spline.
#[inline(always)]
fn bell(t: f32) -> f32 {
    let t = t.abs();
    let outer = (1.5 - t).max(0.0);
    let inner = (0.5 - t).max(0.0);
    0.5 * outer * outer - 1.5 * inner * inner
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bell_is_the_quadratic_spline() {
        assert!((bell(0.0) - 0.75).abs() < 1e-6 && bell(1.5) == 0.0);
        for x in [-0.5f32, -0.31, 0.0, 0.2] {
            let sum: f32 = (-3..=3).map(|i| bell(i as f32 - x)).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
    }
}
