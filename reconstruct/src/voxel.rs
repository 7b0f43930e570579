//! Voxel-grid down-sampling (source slides 20–21): the points of each cubic cell become one, their centroid.
//!
//! Any frame, metres. The grid is aligned with the origin, so two clouds of one frame share their cells.
//! The result is sorted by cell (z, then y, then x) and does not depend on the order of threads.

use nalgebra::Vector3;
use thiserror::Error;

use crate::cloud::PointCloud;

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
    let keys = sorted_keys(&cloud.points, cell_metres)?;
    let mut out = Downsampled { dropped: cloud.len() - keys.len(), ..Downsampled::default() };
    let (colors, normals) = (cloud.has_colors(), cloud.has_normals());
    for cell in keys.chunk_by(|a, b| a.0 == b.0) {
        let mean = mean_of(cell, |i| cloud.points[i].map(f64::from));
        out.cloud.points.push(mean.map(|v| v as f32));
        if colors {
            let mean = mean_of(cell, |i| cloud.colors[i].map(f64::from));
            out.cloud.colors.push(mean.map(|v| v.round() as u8));
        }
        if normals {
            let mean = Vector3::from(mean_of(cell, |i| cloud.normals[i].map(f64::from)));
            let unit = mean.try_normalize(1e-6).unwrap_or_default();
            out.cloud.normals.push(unit.map(|v| v as f32).into());
        }
        out.counts.push(cell.len() as u32);
    }
    Ok(out)
}

fn mean_of(cell: &[(u64, u32)], value: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (_, index) in cell {
        let v = value(*index as usize);
        for k in 0..3 {
            sum[k] += v[k];
        }
    }
    sum.map(|v| v / cell.len() as f64)
}

/// Cell key and index of every finite point, sorted.
fn sorted_keys(points: &[[f32; 3]], cell_metres: f32) -> Result<Vec<(u64, u32)>, VoxelError> {
    let cell = f64::from(cell_metres);
    let cell_of = |p: &[f32; 3]| p.map(|v| (f64::from(v) / cell).floor());
    let finite = |p: &[f32; 3]| p.iter().all(|v| v.is_finite());
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points.iter().filter(|p| finite(p)) {
        let c = cell_of(p);
        for k in 0..3 {
            lo[k] = lo[k].min(c[k]);
            hi[k] = hi[k].max(c[k]);
        }
    }
    if lo[0] > hi[0] {
        return Ok(Vec::new());
    }
    // Cells along each axis; beyond 2^53 doubles skip integers and beyond 2^64 in all keys would collide.
    let cells: [f64; 3] = std::array::from_fn(|k| hi[k] - lo[k] + 1.0);
    let magnitude = lo.iter().chain(&hi).fold(0.0f64, |m, v| m.max(v.abs()));
    if magnitude > 2f64.powi(52) || cells.iter().map(|c| c.log2()).sum::<f64>() > 63.0 {
        let extent_metres = cells.iter().fold(0.0f64, |m, c| m.max(*c)) * cell;
        return Err(VoxelError::TooFine { cell_metres, extent_metres });
    }
    let [nx, ny, _] = cells.map(|c| c as u64);
    let mut keys = Vec::with_capacity(points.len());
    for (index, p) in (0u32..).zip(points).filter(|(_, p)| finite(p)) {
        let c = cell_of(p);
        let [x, y, z]: [u64; 3] = std::array::from_fn(|k| (c[k] - lo[k]) as u64);
        keys.push(((z * ny + y) * nx + x, index));
    }
    keys.sort_unstable();
    Ok(keys)
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
