//! One Gauss–Newton step on the linearised metrics, with colour where asked for.
//!
//! With the left twist `(t, ω)`, a source point moves by `t + ω × p`. Residuals are divided by their standard deviations, so
//! that metres and colours can be added.

use nalgebra::{Matrix6, SymmetricEigen, UnitQuaternion, Vector3, Vector6};
use rayon::prelude::*;

use super::super::gradient::channels;
use super::{CHUNK, IcpConfig, Metric, Pair, Target};
use crate::cloud::PointCloud;
use crate::pose::Pose;

/// Directions whose curvature is this much weaker than the strongest are not moved along.
const DEGENERATE: f64 = 1e-7;
/// A colour residual this many standard deviations off weighs half (Huber).
const COLOR_HUBER: f64 = 2.0;

/// Normal equations of some pairs.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    pub(super) hessian: Matrix6<f64>,
    gradient: Vector6<f64>,
    /// Sum of squared geometric residuals, square metres.
    pub(super) square: f64,
}

impl Sums {
    fn new() -> Self {
        Self { hessian: Matrix6::zeros(), gradient: Vector6::zeros(), square: 0.0 }
    }

    fn add(&mut self, row: &Vector6<f64>, residual: f64, weight: f64) {
        // Lower triangle only; mirrored at the end.
        for c in 0..6 {
            let scaled = weight * row[c];
            for r in c..6 {
                self.hessian[(r, c)] += scaled * row[r];
            }
            self.gradient[c] += scaled * residual;
        }
    }

    fn merge(mut self, other: &Self) -> Self {
        self.hessian += other.hessian;
        self.gradient += other.gradient;
        self.square += other.square;
        self
    }
}

/// Sums over all pairs in chunks of fixed size, so that threads don't change the result.
pub(super) fn sums(
    pairs: &[Pair],
    source: &PointCloud,
    target: &Target<'_>,
    pose: &Pose,
    config: &IcpConfig,
) -> Sums {
    let parts: Vec<Sums> = pairs
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut sums = Sums::new();
            for pair in chunk {
                add_pair(&mut sums, pair, source, target, &pose.rotation, config);
            }
            sums
        })
        .collect();
    let mut total = parts.iter().fold(Sums::new(), Sums::merge);
    total.hessian.fill_upper_triangle_with_lower_triangle();
    total
}

fn add_pair(
    sums: &mut Sums,
    pair: &Pair,
    source: &PointCloud,
    target: &Target<'_>,
    rotation: &UnitQuaternion<f64>,
    config: &IcpConfig,
) {
    let whiten = 1.0 / config.sigma_metres;
    let offset = pair.p - pair.q;
    let target_normal = || Vector3::from(target.cloud.normals[pair.target].map(f64::from));
    match config.metric {
        Metric::PointToPoint => {
            let weight = config.kernel.weight(offset.norm()) * whiten * whiten;
            for axis in 0..3 {
                let direction = Vector3::ith(axis, 1.0);
                sums.add(&row(&direction, &pair.p.cross(&direction)), offset[axis], weight);
            }
            sums.square += offset.norm_squared();
        }
        Metric::PointToPlane => {
            let n = target_normal();
            let residual = n.dot(&offset);
            sums.add(&row(&n, &pair.p.cross(&n)), residual, config.kernel.weight(residual) * whiten * whiten);
            sums.square += residual * residual;
        }
        Metric::Symmetric => {
            // Rusinkiewicz (2019) eq. 7: (n_p + n_q)·(p - q), here halved; n_p turns with the source, hence the row.
            let n_q = target_normal() * 0.5;
            let n_p = rotation * Vector3::from(source.normals[pair.source].map(f64::from)) * 0.5;
            let residual = (n_p + n_q).dot(&offset);
            let turn = pair.p.cross(&n_q) + pair.q.cross(&n_p);
            sums.add(&row(&(n_p + n_q), &turn), residual, config.kernel.weight(residual) * whiten * whiten);
            sums.square += residual * residual;
        }
    }
    if let Some(sigma) = config.sigma_color.filter(|_| config.metric != Metric::PointToPoint) {
        add_color(sums, pair, source, target, &target_normal(), sigma);
    }
}

/// Park (2017) eq. 12 for each channel: the colour that the target's tangent plane predicts where the source point falls,
/// less the source point's colour.
fn add_color(
    sums: &mut Sums,
    pair: &Pair,
    source: &PointCloud,
    target: &Target<'_>,
    normal: &Vector3<f64>,
    sigma: f64,
) {
    let offset = pair.p - pair.q;
    let in_plane = offset - normal * normal.dot(&offset);
    let (from, to) = (channels(source.colors[pair.source]), channels(target.cloud.colors[pair.target]));
    for channel in 0..3 {
        let slope = Vector3::from(target.gradients[pair.target][channel].map(f64::from));
        let slope = slope - normal * normal.dot(&slope);
        let residual = f64::from(to[channel] - from[channel]) + slope.dot(&in_plane);
        let whitened = residual.abs() / sigma;
        let weight = if whitened <= COLOR_HUBER { 1.0 } else { COLOR_HUBER / whitened };
        sums.add(&row(&slope, &pair.p.cross(&slope)), residual, weight / (sigma * sigma));
    }
}

fn row(translation: &Vector3<f64>, rotation: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z)
}

/// The twist that makes the linearised residuals least; `None` with too few pairs.
pub(super) fn step(
    pairs: &[Pair],
    source: &PointCloud,
    target: &Target<'_>,
    pose: &Pose,
    config: &IcpConfig,
) -> Option<Vector6<f64>> {
    if pairs.len() < 6 {
        return None;
    }
    let sums = sums(pairs, source, target, pose, config);
    solve_centred(&sums.hessian, &sums.gradient, pairs)
}

/// Solves `H x = -g` around the pairs' centre with rotations in units of their radius, where the curvatures of all
/// directions can be compared, and leaves degenerate directions alone.
fn solve_centred(hessian: &Matrix6<f64>, gradient: &Vector6<f64>, pairs: &[Pair]) -> Option<Vector6<f64>> {
    let centre: Vector3<f64> = pairs.iter().map(|pair| pair.p).sum::<Vector3<f64>>() / pairs.len() as f64;
    let square: f64 = pairs.iter().map(|pair| (pair.p - centre).norm_squared()).sum();
    let radius = (square / pairs.len() as f64).sqrt().max(1e-9);
    // x = A y with y = (motion of the centre, rotation * radius): t = t_c - ω × c = t_c + c × ω.
    let mut change = Matrix6::identity();
    change.fixed_view_mut::<3, 3>(0, 3).copy_from(&(centre.cross_matrix() / radius));
    change.fixed_view_mut::<3, 3>(3, 3).scale_mut(1.0 / radius);
    let eigen = SymmetricEigen::new(change.transpose() * hessian * change);
    let right = change.transpose() * gradient;
    let largest = eigen.eigenvalues.max();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let mut y = Vector6::zeros();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > DEGENERATE * largest {
            y -= vector * (vector.dot(&right) / value);
        }
    }
    let x = change * y;
    x.iter().all(|v| v.is_finite()).then_some(x)
}
