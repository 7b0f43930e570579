//! Plain versions of what is measured, to judge the results by: slow, in double precision, without any cleverness.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

/// Centroid and number of points of every cell, in the order z, y, x of the cells.
pub(crate) fn voxels(points: &[[f32; 3]], cell: f32) -> Vec<([f64; 3], u32)> {
    let mut cells: BTreeMap<[i64; 3], (Vector3<f64>, u32)> = BTreeMap::new();
    for p in points {
        let key = [2, 1, 0].map(|k| (f64::from(p[k]) / f64::from(cell)).floor() as i64);
        let entry = cells.entry(key).or_default();
        entry.0 += Vector3::from(p.map(f64::from));
        entry.1 += 1;
    }
    cells.into_values().map(|(sum, count)| ((sum / f64::from(count)).into(), count)).collect()
}

/// Squared distances in single precision, in the fixed order x, y, z: ties mean the same to everyone.
pub(crate) fn sq_dist(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

/// The k nearest by comparing with every point: index and squared distance, nearest first, ties by index.
pub(crate) fn nearest(points: &[[f32; 3]], query: &[f32; 3], k: usize) -> Vec<(usize, f32)> {
    let mut all: Vec<(usize, f32)> = points.iter().enumerate().map(|(i, p)| (i, sq_dist(p, query))).collect();
    let order = |a: &(usize, f32), b: &(usize, f32)| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0));
    let k = k.min(all.len());
    if k > 0 && k < all.len() {
        all.select_nth_unstable_by(k - 1, order);
    }
    all.truncate(k);
    all.sort_unstable_by(order);
    all
}

/// Direction of least spread of some points.
pub(crate) fn normal(points: &[[f32; 3]]) -> Vector3<f64> {
    let points: Vec<Vector3<f64>> = points.iter().map(|p| Vector3::from(p.map(f64::from))).collect();
    let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
}

/// Angle between two directions whatever their sign, degrees.
pub(crate) fn degrees(a: &Vector3<f64>, b: &[f32; 3]) -> f64 {
    let b = Vector3::from(b.map(f64::from));
    let length = a.norm() * b.norm();
    if length < 1e-12 { 90.0 } else { (a.cross(&b).norm() / length).min(1.0).asin().to_degrees() }
}

/// A share of sorted values: 0.5 is the median.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}
