//! Pairs and normal equations in one pass. With the left twist `(t, ω)` a source place moves by `t + ω × p`.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use super::super::near_field::NearField;
use super::super::surfel::Surfels;
use super::{Cost, FineConfig, Round};
use crate::pose::Pose;

/// Surfels a parallel task sums up; fixed.
const CHUNK: usize = 2048;
/// Damping of directions that the pairs hardly determine, as a share of the strongest.
const DAMPING: f64 = 1e-6;
/// Variance along a plane over the variance across it.
const ALONG: f32 = 30.0;

/// Normal equations over some pairs.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    hessian: [f64; 21],
    gradient: [f64; 6],
    /// Sum of weighted squared residuals, and of the weights.
    pub(super) square: f64,
    pub(super) weight: f64,
    cost: f64,
    pub(super) count: usize,
    tried: usize,
}

impl Sums {
    pub(super) fn new() -> Self {
        Self {
            hessian: [0.0; 21],
            gradient: [0.0; 6],
            square: 0.0,
            weight: 0.0,
            cost: 0.0,
            count: 0,
            tried: 0,
        }
    }

    /// Mean robust cost; what has no pair costs as much as one out of reach.
    pub(super) fn mean_cost(&self) -> f64 {
        (self.cost + (self.tried - self.count) as f64) / self.tried.max(1) as f64
    }

    /// A pair's robust cost, 0 to 1 (Geman–McClure's for every kernel), at a squared distance relative to the reach.
    fn note(&mut self, residual: f64, weight: f64, relative: f64) {
        self.square += weight * residual * residual;
        self.weight += weight;
        self.count += 1;
        self.cost += relative / (1.0 + relative);
    }

    fn add(&mut self, row: &[f64; 6], residual: f64, weight: f64) {
        let mut k = 0;
        for r in 0..6 {
            let scaled = weight * row[r];
            for c in r..6 {
                self.hessian[k] += scaled * row[c];
                k += 1;
            }
            self.gradient[r] += scaled * residual;
        }
    }

    fn merge(mut self, other: &Self) -> Self {
        for (a, b) in self.hessian.iter_mut().zip(&other.hessian) {
            *a += b;
        }
        for (a, b) in self.gradient.iter_mut().zip(&other.gradient) {
            *a += b;
        }
        self.square += other.square;
        self.weight += other.weight;
        self.cost += other.cost;
        self.count += other.count;
        self.tried += other.tried;
        self
    }

    /// The twist that makes the linearised residuals least, rotations weighed as lengths at `radius`.
    pub(super) fn step(&self, radius: f64) -> Option<Vector6<f64>> {
        if self.count < 6 {
            return None;
        }
        let mut h = Matrix6::zeros();
        let mut k = 0;
        for r in 0..6 {
            for c in r..6 {
                h[(r, c)] = self.hessian[k];
                h[(c, r)] = self.hessian[k];
                k += 1;
            }
        }
        let scale = Vector6::new(1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius, 1.0 / radius);
        let scaled = Matrix6::from_fn(|r, c| h[(r, c)] * scale[r] * scale[c]);
        let damped = scaled + Matrix6::identity() * (DAMPING * scaled.diagonal().max());
        let right = Vector6::from_fn(|r, _| -self.gradient[r] * scale[r]);
        let step = damped.cholesky()?.solve(&right).component_mul(&scale);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

/// Sums over the source's surfels.
pub(super) fn sums(
    source: &Surfels,
    target: &Surfels,
    field: &NearField,
    pose: &Pose,
    round: &Round,
    config: &FineConfig,
) -> Sums {
    let stride = round.stride.max(1);
    let count = source.len().div_ceil(stride);
    let rotation: Matrix3<f32> = pose.rotation.to_rotation_matrix().matrix().map(|v| v as f32);
    let translation: Vector3<f32> = pose.translation.vector.map(|v| v as f32);
    let parts: Vec<Sums> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut sums = Sums::new();
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                let i = i * stride;
                sums.tried += 1;
                let p = rotation * Vector3::from(source.points[i]) + translation;
                let Some(j) = field.nearest(&p.into()) else { continue };
                let q = Vector3::from(target.points[j]);
                let offset = p - q;
                let n_q = Vector3::from(target.normals[j]);
                let n_p = rotation * Vector3::from(source.normals[i]);
                let apart = offset.norm_squared();
                if apart > round.reach * round.reach || n_p.dot(&n_q) < config.min_normal_cosine {
                    continue;
                }
                let trust = source.weights[i] * target.weights[j];
                pair(&mut sums, &p, &q, &n_p, &n_q, trust, round, config);
            }
            sums
        })
        .collect();
    parts.iter().fold(Sums::new(), Sums::merge)
}

#[allow(clippy::too_many_arguments)] // one inner loop, spread over two functions
#[inline]
fn pair(
    sums: &mut Sums,
    p: &Vector3<f32>,
    q: &Vector3<f32>,
    n_p: &Vector3<f32>,
    n_q: &Vector3<f32>,
    trust: f32,
    round: &Round,
    config: &FineConfig,
) {
    let offset = p - q;
    let relative = f64::from(offset.norm_squared() / (round.reach * round.reach));
    match config.cost {
        Cost::PointToPoint => {
            let size = f64::from(offset.norm());
            let weight = f64::from(trust) * round.kernel.weight(size);
            for axis in 0..3 {
                let direction = Vector3::ith(axis, 1.0f32);
                sums.add(&row(&direction, &p.cross(&direction)), f64::from(offset[axis]), weight);
            }
            sums.note(size, weight, relative);
        }
        Cost::PointToPlane => {
            let residual = f64::from(n_q.dot(&offset));
            let weight = f64::from(trust) * round.kernel.weight(residual);
            sums.add(&row(n_q, &p.cross(n_q)), residual, weight);
            sums.note(residual, weight, relative);
        }
        Cost::Symmetric => {
            // Rusinkiewicz (2019) with n_p turning along: d/dω of n_p·(p - q) is q × n_p.
            let n = (n_p + n_q) * 0.5;
            let residual = f64::from(n.dot(&offset));
            let weight = f64::from(trust) * round.kernel.weight(residual);
            let turn = (p.cross(n_q) + q.cross(n_p)) * 0.5;
            sums.add(&row(&n, &turn), residual, weight);
            sums.note(residual, weight, relative);
        }
        Cost::PlaneToPlane => {
            // Variance 1 across each plane and ALONG along it: M = ((2·ALONG) I - (ALONG - 1)(n_p n_pᵀ + n_q n_qᵀ))⁻¹.
            let c = Matrix3::identity() * (2.0 * ALONG)
                - (n_p * n_p.transpose() + n_q * n_q.transpose()) * (ALONG - 1.0);
            let Some(inverse) = c.try_inverse() else { return };
            let whitened = inverse * 2.0;
            let size = f64::from(offset.dot(&(whitened * offset)).max(0.0)).sqrt();
            let weight = f64::from(trust) * round.kernel.weight(size);
            // Upper triangular square root, so that three plain rows do.
            let Some(root) = whitened.cholesky() else { return };
            let root = root.l().transpose();
            for axis in 0..3 {
                let direction: Vector3<f32> = root.row(axis).transpose();
                let residual = f64::from(direction.dot(&offset));
                sums.add(&row(&direction, &p.cross(&direction)), residual, weight);
            }
            sums.note(size, weight, relative);
        }
    }
}

#[inline]
fn row(translation: &Vector3<f32>, rotation: &Vector3<f32>) -> [f64; 6] {
    [translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z].map(f64::from)
}
