//! Voxel-grid down-sampling (source slides 20–21): the points of each cubic cell become one, their centroid.
//!
//! Any frame, metres. The grid is aligned with the origin, so two clouds of one frame share their cells.
//! The result is sorted by cell (z, then y, then x) and does not depend on the order of threads.

use nalgebra::Vector3;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thiserror::Error;

use crate::cloud::PointCloud;
use crate::radix::sort_by_bits;
use crate::simd::run;

/// Points a parallel task takes.
const CHUNK: usize = 1 << 14;
/// Highest bits by which keys are shared among threads.
const SHARE_BITS: u32 = 12;
/// Key of a point that is not finite.
const NOWHERE: u64 = u64::MAX;

/// Why a cloud can't be down-sampled.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum VoxelError {
    /// The cell's edge is not a positive finite length.
    #[error("the voxel size must be a positive length, not {0} m")]
    BadCell(f32),
    /// More cells along the axes together than a 64-bit key can tell apart.
    #[error("voxels of {cell_metres} m are too small for a cloud {extent_metres} m across")]
    TooFine {
        /// Edge of a cell, metres.
        cell_metres: f32,
        /// Longest side of the cloud's box, metres.
        extent_metres: f64,
    },
    /// More points than 32-bit indices.
    #[error("{0} points are more than can be down-sampled")]
    TooManyPoints(usize),
}

/// A down-sampled cloud.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Downsampled {
    /// One point a cell that held any: centroid, mean colour, mean normal (unit, or zero where normals cancelled).
    pub cloud: PointCloud,
    /// How many points each came from.
    pub counts: Vec<u32>,
    /// Input points dropped because a coordinate is not finite.
    pub dropped: usize,
}

/// Replaces the points of every cell with edge `cell_metres` by their centroid.
pub fn downsample(cloud: &PointCloud, cell_metres: f32) -> Result<Downsampled, VoxelError> {
    if !(cell_metres.is_finite() && cell_metres > 0.0) {
        return Err(VoxelError::BadCell(cell_metres));
    }
    if u32::try_from(cloud.len()).is_err() {
        return Err(VoxelError::TooManyPoints(cloud.len()));
    }
    let Some(lattice) = Lattice::over(&cloud.points, cell_metres)? else {
        return Ok(Downsampled { dropped: cloud.len(), ..Downsampled::default() });
    };
    let index_bits = bits_of(cloud.len() as u64);
    let parts: Vec<Downsampled> = if index_bits + lattice.key_bits < 64 {
        let keys = packed_keys(&cloud.points, &lattice, index_bits);
        let parts = shares(keys, index_bits + lattice.key_bits, rayon::current_num_threads());
        let centroids = |mut keys: Vec<u64>| {
            sort_by_bits(&mut keys, index_bits, lattice.key_bits);
            let index_mask = (1 << index_bits) - 1;
            centroids(cloud, &keys, |key| key >> index_bits, |key| (key & index_mask) as usize)
        };
        parts.into_par_iter().map(centroids).collect()
    } else {
        let finite = (0u32..).zip(&cloud.points).filter(|(_, p)| is_finite(p));
        let mut keys: Vec<(u64, u32)> = finite.map(|(index, p)| (lattice.key(p), index)).collect();
        keys.sort_unstable();
        vec![centroids(cloud, &keys, |key| key.0, |key| key.1 as usize)]
    };
    let mut out = joined(parts);
    out.dropped = cloud.len() - out.counts.iter().map(|&count| count as usize).sum::<usize>();
    Ok(out)
}

fn is_finite(p: &[f32; 3]) -> bool {
    p.iter().all(|v| v.is_finite())
}

/// Bits that hold every number below `count`.
fn bits_of(count: u64) -> u32 {
    u64::BITS - count.saturating_sub(1).leading_zeros()
}

/// Cells around a cloud, numbered along x, then y, then z.
struct Lattice {
    cell: f64,
    per_cell: f64,
    /// Lowest cell along each axis.
    low: [f64; 3],
    /// Cells along x and y.
    size: [u64; 2],
    /// Bits of the highest number.
    key_bits: u32,
}

impl Lattice {
    /// `None` where no point is finite.
    fn over(points: &[[f32; 3]], cell_metres: f32) -> Result<Option<Self>, VoxelError> {
        let cell = f64::from(cell_metres);
        let (low, high) = points
            .par_chunks(CHUNK)
            .map(|points| run(Bounds(points)))
            .reduce(|| (NO_BOUNDS.0, NO_BOUNDS.1), |a, b| (lower(&a.0, &b.0), upper(&a.1, &b.1)));
        if low[0] > high[0] {
            return Ok(None);
        }
        let [low, high] = [low, high].map(|p| p.map(|v| (f64::from(v) / cell).floor()));
        // Cells along each axis; beyond 2^53 doubles skip integers and beyond 2^64 in all keys would collide.
        let cells: [f64; 3] = std::array::from_fn(|k| high[k] - low[k] + 1.0);
        let magnitude = low.iter().chain(&high).fold(0.0f64, |m, v| m.max(v.abs()));
        if magnitude > 2f64.powi(52) || cells.iter().map(|c| c.log2()).sum::<f64>() > 63.0 {
            let extent_metres = cells.iter().fold(0.0f64, |m, c| m.max(*c)) * cell;
            return Err(VoxelError::TooFine { cell_metres, extent_metres });
        }
        let [x, y, z] = cells.map(|c| c as u64);
        let key_bits = bits_of(x.saturating_mul(y).saturating_mul(z));
        Ok(Some(Self { cell, per_cell: 1.0 / cell, low, size: [x, y], key_bits }))
    }

    #[inline(always)]
    fn key(&self, p: &[f32; 3]) -> u64 {
        let [x, y, z]: [u64; 3] = std::array::from_fn(|k| (self.cell_along(p[k]) - self.low[k]) as u64);
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// The quotient rounded down. Multiplying by the inverse is quicker and wrong only beside an integer.
    #[inline(always)]
    fn cell_along(&self, v: f32) -> f64 {
        let v = f64::from(v);
        let quick = v * self.per_cell;
        let floor = quick.floor();
        let beside = (quick - floor - 0.5).abs() > 0.499_999 || quick.abs() > 1e9;
        if beside { (v / self.cell).floor() } else { floor }
    }
}

const NO_BOUNDS: ([f32; 3], [f32; 3]) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);

fn lower(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k].min(b[k]))
}

fn upper(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k].max(b[k]))
}

/// Lowest and highest coordinates of the finite points.
struct Bounds<'a>(&'a [[f32; 3]]);

impl WithSimd for Bounds<'_> {
    type Output = ([f32; 3], [f32; 3]);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let (mut low, mut high) = NO_BOUNDS;
        for p in self.0 {
            let finite = (p[0] - p[0]) + (p[1] - p[1]) + (p[2] - p[2]) == 0.0;
            for k in 0..3 {
                let (a, b) = if finite { (p[k], p[k]) } else { (f32::INFINITY, f32::NEG_INFINITY) };
                low[k] = if a < low[k] { a } else { low[k] };
                high[k] = if b > high[k] { b } else { high[k] };
            }
        }
        (low, high)
    }
}

/// Writes the cell above the index of every point; what is not finite gets [`NOWHERE`].
struct PackedKeys<'a> {
    points: &'a [[f32; 3]],
    keys: &'a mut [u64],
    lattice: &'a Lattice,
    first: u64,
    index_bits: u32,
}

impl WithSimd for PackedKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for ((index, p), key) in (self.first..).zip(self.points).zip(self.keys) {
            let finite = p.iter().all(|v| v.is_finite());
            *key = if finite { (self.lattice.key(p) << self.index_bits) | index } else { NOWHERE };
        }
    }
}

/// The cell above the index of every finite point, in the order of the points.
fn packed_keys(points: &[[f32; 3]], lattice: &Lattice, index_bits: u32) -> Vec<u64> {
    let mut keys = vec![0; points.len()];
    keys.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).enumerate().for_each(|(i, (keys, points))| {
        run(PackedKeys { points, keys, lattice, first: (i * CHUNK) as u64, index_bits });
    });
    if keys.contains(&NOWHERE) {
        keys.retain(|&key| key != NOWHERE);
    }
    keys
}

/// The keys cut by value into about equal shares, lowest first; each keeps its order.
fn shares(keys: Vec<u64>, bits: u32, count: usize) -> Vec<Vec<u64>> {
    if count < 2 || keys.len() < CHUNK {
        return vec![keys];
    }
    let shift = bits.saturating_sub(SHARE_BITS);
    let mut counts = vec![0usize; 1 << SHARE_BITS];
    for key in &keys {
        counts[(key >> shift) as usize] += 1;
    }
    let mut cuts = vec![0];
    let mut below = 0;
    for (digit, count_here) in (0u64..).zip(&counts) {
        below += count_here;
        if below * count >= cuts.len() * keys.len() {
            cuts.push((digit + 1) << shift);
        }
    }
    cuts.dedup();
    let share = |cut: &[u64]| {
        let mut share = Vec::with_capacity(keys.len() / count + CHUNK);
        share.extend(keys.iter().copied().filter(|key| (cut[0]..cut[1]).contains(key)));
        share
    };
    cuts.par_windows(2).map(share).collect()
}

/// One point a run of equal cells; sums run in the order of the indices.
fn centroids<K>(
    cloud: &PointCloud,
    keys: &[K],
    cell: impl Fn(&K) -> u64,
    index: impl Fn(&K) -> usize,
) -> Downsampled {
    let mut out = Downsampled::default();
    out.cloud.points.reserve(keys.len());
    out.counts.reserve(keys.len());
    let (colors, normals) = (cloud.has_colors(), cloud.has_normals());
    for run in keys.chunk_by(|a, b| cell(a) == cell(b)) {
        let mean = |value: &dyn Fn(usize) -> [f32; 3]| mean_of(run, |key| value(index(key)));
        out.cloud.points.push(match run {
            [only] => cloud.points[index(only)],
            _ => mean_of(run, |key| cloud.points[index(key)]).map(|v| v as f32),
        });
        if colors {
            let mean = mean(&|i| cloud.colors[i].map(f32::from));
            out.cloud.colors.push(mean.map(|v| v.round() as u8));
        }
        if normals {
            let mean = Vector3::from(mean(&|i| cloud.normals[i]));
            let unit = mean.try_normalize(1e-6).unwrap_or_default();
            out.cloud.normals.push(unit.map(|v| v as f32).into());
        }
        out.counts.push(run.len() as u32);
    }
    out
}

#[inline(always)]
fn mean_of<K>(run: &[K], value: impl Fn(&K) -> [f32; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for key in run {
        let v = value(key);
        for k in 0..3 {
            sum[k] += f64::from(v[k]);
        }
    }
    sum.map(|v| v / run.len() as f64)
}

fn joined(mut parts: Vec<Downsampled>) -> Downsampled {
    if parts.len() == 1 {
        return parts.swap_remove(0);
    }
    let mut out = Downsampled::default();
    out.cloud.points.reserve(parts.iter().map(|part| part.cloud.len()).sum());
    for part in parts {
        out.cloud.points.extend(part.cloud.points);
        out.cloud.colors.extend(part.cloud.colors);
        out.cloud.normals.extend(part.cloud.normals);
        out.counts.extend(part.counts);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        #[test]
        fn agrees_with_a_map_of_cells(points in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 0..200)) {
            let cell = 0.3f32;
            let mut cells: BTreeMap<[i64; 3], (Vector3<f64>, u32)> = BTreeMap::new();
            for p in &points {
                let mut key = p.map(|v| (f64::from(v) / f64::from(cell)).floor() as i64);
                key.reverse();
                let entry = cells.entry(key).or_default();
                entry.0 += Vector3::from(p.map(f64::from));
                entry.1 += 1;
            }
            let out = downsample(&PointCloud { points, ..PointCloud::default() }, cell).unwrap();
            prop_assert_eq!(out.cloud.len(), cells.len());
            for ((p, n), (sum, count)) in out.cloud.points.iter().zip(&out.counts).zip(cells.values()) {
                prop_assert_eq!(n, count);
                prop_assert!((Vector3::from(p.map(f64::from)) - sum / f64::from(*count)).norm() < 1e-6);
            }
        }

        #[test]
        fn no_finite_or_other_input_panics(points in prop::collection::vec(prop::array::uniform3(any::<f32>()), 0..30), cell in any::<f32>()) {
            let len = points.len();
            if let Ok(out) = downsample(&PointCloud { points, ..PointCloud::default() }, cell) {
                prop_assert_eq!(out.counts.iter().sum::<u32>() as usize + out.dropped, len);
            }
        }
    }

    #[test]
    fn attributes_are_averaged_and_bad_points_counted() {
        let cloud = PointCloud {
            points: vec![[0.1, 0.1, 0.1], [f32::NAN, 0.0, 0.0], [0.3, 0.1, 0.1]],
            colors: vec![[0, 10, 255], [9; 3], [100, 20, 255]],
            normals: vec![[1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]],
        };
        let out = downsample(&cloud, 1.0).unwrap();
        assert_eq!((out.cloud.len(), out.dropped, out.counts[0]), (1, 1, 2));
        assert_eq!(out.cloud.colors, vec![[50, 15, 255]]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert!(
            (out.cloud.normals[0][0] - half).abs() < 1e-6 && (out.cloud.normals[0][1] - half).abs() < 1e-6
        );
    }

    #[test]
    fn cells_too_small_for_the_cloud_are_refused() {
        let cloud = PointCloud { points: vec![[-3e38; 3], [3e38; 3]], ..PointCloud::default() };
        assert!(matches!(downsample(&cloud, 1e-3), Err(VoxelError::TooFine { .. })));
        assert!(matches!(downsample(&cloud, 0.0), Err(VoxelError::BadCell(_))));
    }
}
