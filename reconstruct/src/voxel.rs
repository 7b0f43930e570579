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
/// Points and coordinates looked at together: whole registers.
const GROUP_POINTS: usize = 8;
const GROUP: usize = 3 * GROUP_POINTS;
/// Adding 2^52 to a smaller whole number shows it in the lowest bits.
const ROUNDER: f64 = 4_503_599_627_370_496.0;
const ROUNDER_BITS: u32 = 52;
/// Places fetched at a time.
const FETCHED: usize = 128;
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
        if is_beside(quick, floor) { (v / self.cell).floor() } else { floor }
    }
}

/// Whether a quotient is so near to an integer, or so large, that its last bits decide; so is what is not finite.
#[inline(always)]
fn is_beside(quick: f64, floor: f64) -> bool {
    let inside = ((quick - floor - 0.5).abs() <= 0.499_999) & (quick.abs() <= 1e9);
    !inside
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
        let (groups, rest) = self.0.as_flattened().as_chunks::<GROUP>();
        let (mut low, mut high) = ([f32::INFINITY; GROUP], [f32::NEG_INFINITY; GROUP]);
        let mut odd = [0u32; GROUP];
        for group in groups {
            for i in 0..GROUP {
                let v = group[i];
                low[i] = if v < low[i] { v } else { low[i] };
                high[i] = if v > high[i] { v } else { high[i] };
                odd[i] |= u32::from(!v.is_finite());
            }
        }
        let bounds = |points: &[[f32; 3]], start| {
            let finite = points.iter().filter(|p| is_finite(p));
            finite.fold(start, |(a, b), p| (lower(&a, p), upper(&b, p)))
        };
        if odd.iter().any(|&odd| odd != 0) {
            return bounds(self.0, NO_BOUNDS);
        }
        let (low, high) = (low.as_chunks::<3>().0, high.as_chunks::<3>().0);
        let grouped = (
            low.iter().fold(NO_BOUNDS.0, |a, b| lower(&a, b)),
            high.iter().fold(NO_BOUNDS.1, |a, b| upper(&a, b)),
        );
        bounds(rest.as_chunks::<3>().0, grouped)
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

impl PackedKeys<'_> {
    #[inline(always)]
    fn careful(&self, index: u64, p: &[f32; 3]) -> u64 {
        if is_finite(p) { (self.lattice.key(p) << self.index_bits) | index } else { NOWHERE }
    }
}

impl WithSimd for PackedKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let keys = std::mem::take(&mut self.keys);
        let groups = if self.lattice.key_bits < ROUNDER_BITS { self.points.len() / GROUP_POINTS } else { 0 };
        let (grouped, rest) = self.points.split_at(groups * GROUP_POINTS);
        let (keys, rest_keys) = keys.split_at_mut(grouped.len());
        let low: [f64; GROUP] = std::array::from_fn(|i| self.lattice.low[i % 3]);
        let [nx, ny] = self.lattice.size.map(|size| size as f64);
        let places = (self.first..).step_by(GROUP_POINTS);
        let chunks = grouped.as_flattened().as_chunks::<GROUP>().0;
        for ((first, group), keys) in places.zip(chunks).zip(keys.as_chunks_mut::<GROUP_POINTS>().0) {
            let mut cells = [0.0; GROUP];
            let mut beside = [0u32; GROUP];
            for i in 0..GROUP {
                let quick = f64::from(group[i]) * self.lattice.per_cell;
                let floor = quick.floor();
                beside[i] = u32::from(is_beside(quick, floor));
                cells[i] = floor - low[i];
            }
            if beside.iter().fold(0, |any, beside| any | beside) == 0 {
                for (p, key) in keys.iter_mut().enumerate() {
                    let number = (cells[3 * p + 2] * ny + cells[3 * p + 1]) * nx + cells[3 * p];
                    let number = (number + ROUNDER).to_bits() & ((1 << ROUNDER_BITS) - 1);
                    *key = (number << self.index_bits) | (first + p as u64);
                }
            } else {
                for ((index, p), key) in (first..).zip(group.as_chunks::<3>().0).zip(keys) {
                    *key = self.careful(index, p);
                }
            }
        }
        let first = self.first + grouped.len() as u64;
        for ((index, p), key) in (first..).zip(rest).zip(rest_keys) {
            *key = self.careful(index, p);
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
    if !colors && !normals {
        place_centroids(&cloud.points, keys, cell, index, &mut out);
        return out;
    }
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

/// The same of places alone: fetched some at a time, so that the memory's answers come together.
fn place_centroids<K>(
    points: &[[f32; 3]],
    keys: &[K],
    cell: impl Fn(&K) -> u64,
    index: impl Fn(&K) -> usize,
    out: &mut Downsampled,
) {
    let mut fetched = [[0.0; 3]; FETCHED];
    let (mut here, mut count, mut only, mut sum) = (u64::MAX, 0u32, [0.0; 3], [0.0f64; 3]);
    for keys in keys.chunks(FETCHED) {
        for (place, key) in fetched.iter_mut().zip(keys) {
            *place = points[index(key)];
        }
        for (key, p) in keys.iter().zip(&fetched) {
            if cell(key) != here || count == 0 {
                finish(&mut out.cloud.points, &mut out.counts, count, only, sum);
                (here, count, only, sum) = (cell(key), 0, *p, [0.0; 3]);
            }
            count += 1;
            for k in 0..3 {
                sum[k] += f64::from(p[k]);
            }
        }
    }
    finish(&mut out.cloud.points, &mut out.counts, count, only, sum);
}

#[inline(always)]
fn finish(points: &mut Vec<[f32; 3]>, counts: &mut Vec<u32>, count: u32, only: [f32; 3], sum: [f64; 3]) {
    if count > 0 {
        points.push(if count == 1 { only } else { sum.map(|v| (v / f64::from(count)) as f32) });
        counts.push(count);
    }
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
mod tests;
