//! How much area each point stands for, from the points around it (Kazhdan, Bolitho and Hoppe 2006, §5: adaptive sampling).

use rayon::prelude::*;

use super::samples::{Sample, Samples, cells};

/// So many points a cell make the count steady.
const POINTS_PER_CELL: usize = 8;
/// The count's cells are at least so many levels coarser than the finest, and no finer than this.
const COARSER: u32 = 2;
const COARSEST: u32 = 3;
const FINEST: u32 = 8;
/// A plane with one point a cell face gives this at its points, on average over its place in the cells: the quadratic kernel's
/// square, integrated (the quintic B-spline's middle).
const OF_A_PLANE: f32 = 0.55;

/// Fills in areas and widths, and turns unit normals into facings.
pub(super) fn measure(samples: &mut Samples, samples_per_node: f32) {
    let level = level(samples);
    let grid = Counts::new(&samples.list, level);
    let cell_area = 0.25f32.powi(level as i32) * thinned(scatter(&samples.list, level), level);
    samples.list.par_iter_mut().for_each(|s| {
        s.area = cell_area * OF_A_PLANE / grid.at(&s.at);
        s.width = (samples_per_node * s.area).sqrt();
        s.facing = s.facing.map(|v| v * s.area);
    });
}

/// How much less a plane's points count where they scatter across it: variances of both kernels and of both points add up.
fn thinned(scatter: f32, level: u32) -> f32 {
    let of_kernels = 0.5 * 0.25f32.powi(level as i32);
    (of_kernels / (of_kernels + 2.0 * scatter)).sqrt()
}

/// Variance of the points across the surface: the middle one of the cells'.
fn scatter(samples: &[Sample], level: u32) -> f32 {
    let mut variances: Vec<f32> = cells(samples, level).filter_map(across).collect();
    let middle = variances.len() / 2;
    if variances.is_empty() { 0.0 } else { *variances.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

/// Variance of a cell's points along its mean normal; `None` for few points or no such normal. Facings are unit normals yet.
fn across(cell: &[Sample]) -> Option<f32> {
    let sum = |of: fn(&Sample) -> [f32; 3]| -> [f32; 3] {
        cell.iter().map(of).fold([0.0; 3], |sum, v| std::array::from_fn(|k| sum[k] + v[k]))
    };
    let count = cell.len() as f32;
    let (normal, middle) = (sum(|s| s.facing), sum(|s| s.at).map(|v| v / count));
    let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
    if cell.len() < POINTS_PER_CELL || length < 0.5 * count {
        return None;
    }
    let off = |s: &Sample| (0..3).map(|k| normal[k] * (s.at[k] - middle[k])).sum::<f32>() / length;
    Some(cell.iter().map(|s| off(s).powi(2)).sum::<f32>() / (count - 1.0))
}

/// Finest level whose cells hold enough points.
fn level(samples: &Samples) -> u32 {
    let finest = (samples.depth - COARSER).min(FINEST);
    let enough = |&level: &u32| samples.list.len() >= POINTS_PER_CELL * cells(&samples.list, level).count();
    (COARSEST..=finest).rev().find(enough).unwrap_or(COARSEST)
}

/// Counts of points round the corners of a grid in the cube's middle half, spread by quadratic B-splines.
struct Counts {
    scale: f32,
    side: usize,
    values: Vec<f32>,
}

/// First corner and the weights of it and the next two.
fn weights(x: f32) -> (usize, [f32; 3]) {
    let middle = x.round();
    let t = x - middle;
    // corner -1 is kept at 0
    (middle as usize, [0.5 * (0.5 - t).powi(2), 0.75 - t * t, 0.5 * (0.5 + t).powi(2)])
}

impl Counts {
    fn new(samples: &[Sample], level: u32) -> Self {
        let side = (1usize << (level - 1)) + 3;
        let mut grid = Self { scale: (1u32 << level) as f32, side, values: vec![0.0; side * side * side] };
        for s in samples {
            let (at, w) = grid.place(&s.at);
            grid.rows(at, |row, y, z| {
                for x in 0..3 {
                    row[x] += w[0][x] * w[1][y] * w[2][z];
                }
            });
        }
        grid
    }

    fn place(&self, at: &[f32; 3]) -> (usize, [[f32; 3]; 3]) {
        let [(x, wx), (y, wy), (z, wz)] = at.map(|v| weights((v - 0.25) * self.scale));
        ((z * self.side + y) * self.side + x, [wx, wy, wz])
    }

    fn rows(&mut self, first: usize, mut each: impl FnMut(&mut [f32], usize, usize)) {
        for z in 0..3 {
            for y in 0..3 {
                let row = first + (z * self.side + y) * self.side;
                each(&mut self.values[row..row + 3], y, z);
            }
        }
    }

    fn at(&self, at: &[f32; 3]) -> f32 {
        let (first, w) = self.place(at);
        let mut sum = 0.0;
        for z in 0..3 {
            for y in 0..3 {
                let row = first + (z * self.side + y) * self.side;
                let along: f32 = (0..3).map(|x| w[0][x] * self.values[row + x]).sum();
                sum += w[1][y] * w[2][z] * along;
            }
        }
        sum
    }
}
