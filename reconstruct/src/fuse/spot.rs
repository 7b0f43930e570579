//! Thinning: what lies in a voxel and faces the same way becomes one.
//!
//! A spot carries what the smoothing needs of the samples it stands for, so that the smoothing's work grows with the product's surface
//! and hardly with the number of views.

use rayon::prelude::*;

use super::grid::{cell_of, lowest};
use super::samples::{Sample, dot};

/// Samples of a voxel and side as one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Weighted mean.
    pub point: [f32; 3],
    /// Unit.
    pub normal: [f32; 3],
    /// Mean by the squared weight, as pixels seen straight on and from near show the truest colour.
    pub color: [f32; 3],
    /// Sum of the weights and of their squares.
    pub weight: f32,
    pub squared_weight: f32,
    /// Of the samples along the normal, square metres.
    pub variance: f32,
    /// One bit a view, modulo 64.
    pub views: u64,
}

/// A point on the smoothed surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smoothed {
    pub point: [f32; 3],
    pub normal: [f32; 3],
    pub color: [f32; 3],
    pub weight: f32,
    /// Standard deviation along the normal, metres.
    pub deviation: f32,
}

/// One spot a voxel and side, in the order of the voxels.
pub(super) fn spots_of(samples: &[Sample], voxel_metres: f32) -> Vec<Spot> {
    by_voxel(samples, voxel_metres, |s| (s.point, s.normal), |run| spot(samples, run))
}

/// One mean point a voxel and side, in the order of the voxels.
pub(super) fn thin(points: &[Smoothed], voxel_metres: f32) -> Vec<Smoothed> {
    by_voxel(points, voxel_metres, |p| (p.point, p.normal), |run| mean(points, run))
}

/// What `one` makes of the items that lie in a voxel and face the same way: their order in the voxel's run is theirs in `items`.
fn by_voxel<T: Sync, U: Send>(
    items: &[T],
    voxel_metres: f32,
    place: impl Fn(&T) -> ([f32; 3], [f32; 3]) + Sync + Send,
    one: impl Fn(&[(u64, u32)]) -> U + Sync + Send,
) -> Vec<U> {
    let points: Vec<[f32; 3]> = items.par_iter().map(|item| place(item).0).collect();
    let low = lowest(&points);
    let keyed = |(i, item): (usize, &T)| {
        let (point, normal) = place(item);
        (key(cell_of(&point, &low, voxel_metres), side(&normal)), i as u32)
    };
    let mut keyed: Vec<(u64, u32)> = items.par_iter().enumerate().map(keyed).collect();
    keyed.par_sort_unstable();
    let runs: Vec<&[(u64, u32)]> = keyed.chunk_by(|a, b| a.0 == b.0).collect();
    runs.into_par_iter().map(one).collect()
}

/// A cell and a side in one number; far outliers share the last cell.
fn key(cell: [u64; 3], side: u64) -> u64 {
    let [x, y, z] = cell.map(|c| c.min((1 << 20) - 1));
    ((z << 40 | y << 20 | x) << 3) | side
}

/// Which of six directions a normal points to most: keeps the sides of a thin wall in different voxels.
fn side(n: &[f32; 3]) -> u64 {
    let axis = (0..3).fold(0, |best, k| if n[k].abs() > n[best].abs() { k } else { best });
    (2 * axis + usize::from(n[axis] < 0.0)) as u64
}

fn spot(samples: &[Sample], run: &[(u64, u32)]) -> Spot {
    let of_run = || run.iter().map(|&(_, i)| &samples[i as usize]);
    let (mut point, mut normal, mut color) = ([0.0f32; 3], [0.0f32; 3], [0.0f32; 3]);
    let (mut weight, mut squared_weight, mut views) = (0.0f32, 0.0f32, 0u64);
    for s in of_run() {
        let squared = s.weight * s.weight;
        for k in 0..3 {
            point[k] += s.weight * s.point[k];
            normal[k] += s.weight * s.normal[k];
            color[k] += squared * s.color[k];
        }
        weight += s.weight;
        squared_weight += squared;
        views |= 1 << (s.view % 64);
    }
    let (point, normal) = (point.map(|v| v / weight.max(1e-12)), unit(normal));
    let off = |s: &Sample| dot(&std::array::from_fn(|k| s.point[k] - point[k]), &normal);
    let squares: f32 = of_run().map(|s| s.weight * off(s) * off(s)).sum();
    let color = color.map(|v| v / squared_weight.max(1e-12));
    Spot { point, normal, color, weight, squared_weight, variance: squares / weight.max(1e-12), views }
}

fn mean(points: &[Smoothed], run: &[(u64, u32)]) -> Smoothed {
    let mut sum =
        Smoothed { point: [0.0; 3], normal: [0.0; 3], color: [0.0; 3], weight: 0.0, deviation: 0.0 };
    for p in run.iter().map(|&(_, i)| &points[i as usize]) {
        for k in 0..3 {
            sum.point[k] += p.weight * p.point[k];
            sum.normal[k] += p.weight * p.normal[k];
            sum.color[k] += p.weight * p.color[k];
        }
        sum.weight += p.weight;
        sum.deviation += p.weight * p.deviation;
    }
    let per = 1.0 / sum.weight.max(1e-12);
    Smoothed {
        point: sum.point.map(|v| v * per),
        normal: unit(sum.normal),
        color: sum.color.map(|v| v * per),
        weight: sum.weight,
        deviation: sum.deviation * per,
    }
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(&v, &v).sqrt().max(1e-12);
    v.map(|v| v / length)
}
