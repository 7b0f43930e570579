//! The points in a cube of side 1, sorted along a Morton curve, and merged cell by cell for coarser levels.

use super::{MIN_POINTS, PoissonError};
use crate::cloud::PointCloud;
use crate::radix::sort_by_bits;

/// The points' box with this margin is the middle half of the cube, which has the depth's cells.
const MARGIN: f64 = 1.1;
const CUBE: f64 = 2.0 * MARGIN;
/// Distance of the walls, where u is 0, from the points' box; the cube's side is 1. Far walls let the surface bulge out where no
/// point holds it, near ones press it in; this is between.
const WALL: f64 = 0.0305;
/// Cells along an axis of the middle half that the curve tells apart, as a power of two.
const CURVE_BITS: u32 = 10;
/// Bits of a place along the curve.
const CODE_BITS: u32 = 3 * CURVE_BITS;
/// Vertices lie at least this share of a cell apart (see marching cubes), and must stay apart in single precision.
const LEAST_STEP: f64 = 0.02;

/// A point, or the mean of a cell's points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Place in the cube.
    pub(super) at: [f32; 3],
    /// Outward normal times the area that it stands for; the cube's side is 1.
    pub(super) facing: [f32; 3],
    /// Area that it stands for.
    pub(super) area: f32,
    /// Width of its kernel: the side of a cell with as many points as one should have.
    pub(super) width: f32,
    /// Place along the curve.
    code: u32,
}

/// All samples and where their cube is.
pub(super) struct Samples {
    /// In the order of the curve.
    pub(super) list: Vec<Sample>,
    /// Index of each in the cloud.
    pub(super) order: Vec<u32>,
    /// The cube's lowest corner, metres.
    pub(super) low: [f64; 3],
    /// The cube's side, metres.
    pub(super) side: f64,
    /// Distance of the walls from the cube's middle along each axis, where the side is 1.
    pub(super) walls: [f32; 3],
    /// Finest level of the cube that makes sense: one more than the depth of the middle half.
    pub(super) depth: u32,
}

/// The usable points of a cloud; areas and widths are not known yet.
pub(super) fn of_cloud(cloud: &PointCloud, depth: u32) -> Result<Samples, PoissonError> {
    let usable = usable(cloud);
    let few = PoissonError::TooFewPoints { found: usable.len() };
    let (low, high) = bounds(cloud, &usable).filter(|_| usable.len() >= MIN_POINTS).ok_or(few)?;
    let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let far = low.iter().chain(&high).fold(0.0, |far: f64, v| far.max(v.abs()));
    let side = extent * CUBE;
    let step = 2.0 * far * f64::from(f32::EPSILON) / LEAST_STEP;
    let fits = |depth: &u32| side / f64::from(2u32 << depth) >= step.max(1e-12);
    let depth = (*super::DEPTHS.start()..=depth).rev().find(fits);
    let depth = depth.ok_or(PoissonError::TooNearTogether { distance_metres: far, extent_metres: extent })?;
    let walls = std::array::from_fn(|k| (0.5 * (high[k] - low[k]) / side + WALL).min(0.5) as f32);
    let low: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k] - side));
    let in_cube = |p: [f32; 3]| -> [f32; 3] {
        std::array::from_fn(|k| (((f64::from(p[k]) - low[k]) / side) as f32).clamp(0.0, 0.999_999))
    };
    let mut keys: Vec<u64> = usable
        .iter()
        .map(|&i| (u64::from(code_of(in_cube(cloud.points[i as usize]))) << 32) | u64::from(i))
        .collect();
    sort_by_bits(&mut keys, 32, CODE_BITS);
    let sample = |&key: &u64| {
        let i = key as u32 as usize;
        Sample {
            at: in_cube(cloud.points[i]),
            facing: unit(cloud.normals[i]).unwrap_or_default(),
            area: 0.0,
            width: 0.0,
            code: (key >> 32) as u32,
        }
    };
    let order = keys.iter().map(|&key| key as u32).collect();
    Ok(Samples { list: keys.iter().map(sample).collect(), order, low, side, walls, depth: depth + 1 })
}

/// Indices of the points with a finite place and a direction.
fn usable(cloud: &PointCloud) -> Vec<u32> {
    let known = cloud.points.iter().zip(&cloud.normals).enumerate();
    known
        .filter(|(_, (p, n))| p.iter().all(|v| v.is_finite()) && unit(**n).is_some())
        .map(|(i, _)| i as u32)
        .collect()
}

fn unit(n: [f32; 3]) -> Option<[f32; 3]> {
    let length = n.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    (1e-6..1e6).contains(&length).then(|| n.map(|v| (f64::from(v) / length) as f32))
}

fn bounds(cloud: &PointCloud, usable: &[u32]) -> Option<([f64; 3], [f64; 3])> {
    let first = cloud.points[*usable.first()? as usize];
    let (low, high) = usable.iter().fold((first, first), |(low, high), &i| {
        let p = cloud.points[i as usize];
        (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
    });
    Some((low.map(f64::from), high.map(f64::from)))
}

/// Place along the curve in the middle half: the bits of z, y and x take turns.
fn code_of(at: [f32; 3]) -> u32 {
    let spread = |v: f32| {
        let mut v = (((v - 0.25) * (2 << CURVE_BITS) as f32).max(0.0) as u32).min((1 << CURVE_BITS) - 1);
        v = (v | (v << 16)) & 0x0300_00FF;
        v = (v | (v << 8)) & 0x0300_F00F;
        v = (v | (v << 4)) & 0x030C_30C3;
        (v | (v << 2)) & 0x0924_9249
    };
    spread(at[0]) | (spread(at[1]) << 1) | (spread(at[2]) << 2)
}

/// Whether two samples lie in one cell of a level.
fn share_cell(depth: u32) -> impl Fn(&Sample, &Sample) -> bool {
    let shift = CODE_BITS - 3 * (depth - 1);
    move |a, b| a.code >> shift == b.code >> shift
}

/// The cells' samples of a level, in the order of the curve.
pub(super) fn cells(samples: &[Sample], depth: u32) -> impl Iterator<Item = &[Sample]> {
    samples.chunk_by(share_cell(depth))
}

/// One sample a cell of a level: places and widths are means weighted by area, areas and facings are sums.
pub(super) fn merged(samples: &[Sample], depth: u32) -> Vec<Sample> {
    cells(samples, depth).map(mean).collect()
}

fn mean(cell: &[Sample]) -> Sample {
    if let [one] = cell {
        return *one;
    }
    let area: f32 = cell.iter().map(|s| s.area).sum();
    let sum = |value: &dyn Fn(&Sample) -> f32| cell.iter().map(value).sum::<f32>();
    Sample {
        at: std::array::from_fn(|k| sum(&|s| s.area * s.at[k]) / area),
        facing: std::array::from_fn(|k| sum(&|s| s.facing[k])),
        area,
        width: sum(&|s| s.area * s.width) / area,
        code: cell[0].code,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_cell_by_cell() {
        assert_eq!(code_of([0.25; 3]), 0);
        assert_eq!(code_of([0.749_999; 3]), (1 << CODE_BITS) - 1);
        assert_eq!(code_of([0.5, 0.25, 0.25]), 1 << (CODE_BITS - 3));
        assert_eq!(code_of([0.25, 0.5, 0.2505]), (1 << (CODE_BITS - 2)) | 4);
    }

    #[test]
    fn merging_keeps_area_and_middle() {
        let mut rng = fastrand::Rng::with_seed(3);
        let points: Vec<[f32; 3]> = (0..500).map(|_| std::array::from_fn(|_| rng.f32())).collect();
        let cloud = PointCloud { normals: vec![[0.0, 0.0, 2.0]; 500], points, colors: Vec::new() };
        let mut samples = of_cloud(&cloud, 8).unwrap();
        for s in &mut samples.list {
            (s.area, s.facing) = (0.5, s.facing.map(|v| 0.5 * v));
        }
        let coarse = merged(&samples.list, 3);
        assert!((27..=64).contains(&coarse.len()));
        assert!((coarse.iter().map(|s| s.area).sum::<f32>() - 250.0).abs() < 1e-3);
        let middle = |list: &[Sample]| list.iter().map(|s| s.area * s.at[1]).sum::<f32>();
        assert!((middle(&coarse) - middle(&samples.list)).abs() < 1e-3);
        assert!(coarse.iter().all(|s| (s.facing[2] - s.area).abs() < 1e-3));
    }
}
