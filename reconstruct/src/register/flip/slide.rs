//! Directions in which surfaces slide on themselves, a bottle about its axis: there the paint decides.

use nalgebra::{Matrix6, Point3, SymmetricEigen, Vector3, Vector6};
use rayon::prelude::*;

use super::Pair;
use crate::pose::{Pose, exp};

/// Held less than this, as a share of the direction held best, a direction counts as free.
const FREE: f64 = 0.03;
/// Placements that are moved.
const CLIMBERS: usize = 12;
/// Steps of the search, metres at the product's radius, and how many to either side.
const STEPS: [(f64, i32); 3] = [(0.0025, 6), (0.0008, 4), (0.0003, 3)];
/// How often a search goes on from where the last one ended.
const ANEW: usize = 4;

/// Directions that surfaces do not hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Weak {
    /// The middle of the common surface, first recording's frame, metres.
    pub middle: Point3<f64>,
    /// Its radius, metres.
    pub radius: f64,
    /// Unit steps (shift, turn times radius) about the middle.
    pub directions: Vec<Vector6<f64>>,
}

impl Weak {
    /// The part of a left step on `a_from_b` that the surfaces hold.
    pub fn held_part(&self, step: &Vector6<f64>) -> Vector6<f64> {
        let mut local = self.about_middle(step);
        for direction in &self.directions {
            local -= direction * direction.dot(&local);
        }
        self.about_origin(&local)
    }

    /// From a step about the frame's origin to one about the middle, turns in metres.
    fn about_middle(&self, step: &Vector6<f64>) -> Vector6<f64> {
        let turn: Vector3<f64> = step.fixed_rows::<3>(3).into();
        let shift = step.fixed_rows::<3>(0) + turn.cross(&self.middle.coords);
        stacked(&shift, &(turn * self.radius))
    }

    fn about_origin(&self, local: &Vector6<f64>) -> Vector6<f64> {
        let turn: Vector3<f64> = local.fixed_rows::<3>(3) / self.radius;
        let shift = local.fixed_rows::<3>(0) - turn.cross(&self.middle.coords);
        stacked(&shift, &turn)
    }

    /// A placement moved by a step about the middle, turns in metres.
    pub(super) fn moved(&self, pose: &Pose, along: &Vector6<f64>) -> Pose {
        let turn: Vector3<f64> = along.fixed_rows::<3>(3) / self.radius;
        let step = exp(&stacked(&along.fixed_rows::<3>(0).into(), &turn));
        let to = nalgebra::Translation3::from(self.middle.coords);
        to * step * to.inverse() * pose
    }
}

/// A step of its two parts.
pub(super) fn stacked(shift: &Vector3<f64>, turn: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// The directions in which the surfaces of a placement slide on each other.
pub(super) fn weak_directions(pair: &Pair<'_>, pose: &Pose) -> Weak {
    let pairs = pair.judge.pairs(pose);
    let n = pairs.len().max(1) as f64;
    let middle = pairs.iter().fold(Vector3::zeros(), |sum, row| sum + row.place / n);
    let radius =
        (pairs.iter().map(|row| (row.place - middle).norm_squared()).sum::<f64>() / n).sqrt().max(1e-3);
    let information = pairs.iter().fold(Matrix6::zeros(), |sum, pair| {
        let row = stacked(&pair.along, &((pair.place - middle).cross(&pair.along) / radius));
        sum + row * row.transpose()
    });
    let eigen = SymmetricEigen::new(information);
    let best = eigen.eigenvalues.max();
    let directions = (0..6)
        .filter(|&k| eigen.eigenvalues[k] < FREE * best)
        .map(|k| eigen.eigenvectors.column(k).into_owned())
        .collect();
    Weak { middle: Point3::from(middle), radius, directions }
}

/// Every placement moved along the free directions to where shape and paint fit best around.
pub(super) fn along_weak(pair: &Pair<'_>, weak: &Weak, poses: Vec<Pose>) -> Vec<Pose> {
    if weak.directions.is_empty() {
        return poses;
    }
    poses
        .into_par_iter()
        .enumerate()
        .map(|(rank, pose)| if rank < CLIMBERS { climbed(pair, weak, pose, &STEPS) } else { pose })
        .collect()
}

/// One placement moved the last fractions of a millimetre.
pub(super) fn finely(pair: &Pair<'_>, weak: &Weak, pose: Pose) -> Pose {
    climbed(pair, weak, pose, &STEPS[1..])
}

fn climbed(pair: &Pair<'_>, weak: &Weak, start: Pose, steps: &[(f64, i32)]) -> Pose {
    let score = |pose: &Pose| pair.judge.closeness(pose);
    let (mut best, mut at) = (score(&start), start);
    for &(step, reach) in steps {
        for _ in 0..ANEW {
            let before = best;
            for direction in &weak.directions {
                let from = at;
                for k in (-reach..=reach).filter(|k| *k != 0) {
                    let pose = weak.moved(&from, &(direction * (f64::from(k) * step)));
                    let value = score(&pose);
                    if value > best {
                        (best, at) = (value, pose);
                    }
                }
            }
            if best <= before {
                break;
            }
        }
    }
    at
}
