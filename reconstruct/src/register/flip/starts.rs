//! Where to begin: turns from everywhere, laid middle on middle, and what feature matches agree on.

use nalgebra::{Matrix3, Point3, Quaternion, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};

use super::super::fpfh::describe;
use super::super::matching::{MatchConfig, match_descriptors};
use super::super::pairwise::{PairwiseConfig, Seen, starts_of_matches};
use super::side::Prepared;
use crate::knn::Tree;
use crate::pose::Pose;

/// Turns spread over all rotations: neighbours are about 14 degrees apart, within reach of the refinement.
const TURNS: usize = 3600;
/// Points of a cloud whose extent is taken for every turn.
const EXTENT_POINTS: usize = 400;
/// Radius of the descriptors, metres.
const FEATURE_RADIUS: f32 = 0.022;
/// Placements taken from matches.
const OF_MATCHES: usize = 150;

/// All starts, `a_from_b`.
pub(super) fn starts(a: &Prepared, b: &Prepared) -> Vec<Pose> {
    let middle_a = middle(&corners(&a.cloud.points, &UnitQuaternion::identity()));
    let some: Vec<[f32; 3]> =
        b.cloud.points.iter().step_by(b.len().div_ceil(EXTENT_POINTS).max(1)).copied().collect();
    let laid = |turn: UnitQuaternion<f64>| {
        let to = middle_a - middle(&corners(&some, &turn));
        Pose::from_parts(to.into(), turn)
    };
    let turns = principal_turns(a, b).into_iter().chain(spread_turns(TURNS));
    let mut all: Vec<Pose> = turns.map(laid).collect();
    all.extend(matched(a, b));
    all
}

/// Lowest and highest coordinates of turned points.
fn corners(points: &[[f32; 3]], turn: &UnitQuaternion<f64>) -> [Vector3<f64>; 2] {
    points
        .iter()
        .map(|p| turn * Vector3::from(p.map(f64::from)))
        .fold([Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)], |[low, high], p| {
            [low.inf(&p), high.sup(&p)]
        })
}

fn middle([low, high]: &[Vector3<f64>; 2]) -> Vector3<f64> {
    (low + high) * 0.5
}

/// The 24 turns that lay the principal axes of one cloud on those of the other.
fn principal_turns(a: &Prepared, b: &Prepared) -> Vec<UnitQuaternion<f64>> {
    let (axes_a, axes_b) = (principal_axes(a), principal_axes(b));
    let mut turns = Vec::new();
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for signs in 0..8u8 {
            let column = |k: usize| {
                let sign = if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
                axes_a.column(order[k]) * sign
            };
            let onto = Matrix3::from_columns(&[column(0), column(1), column(2)]);
            let turn = onto * axes_b.transpose();
            if turn.determinant() > 0.0 {
                turns.push(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&turn)));
            }
        }
    }
    turns
}

/// Columns: directions of largest to smallest spread.
fn principal_axes(side: &Prepared) -> Matrix3<f64> {
    let centre = side.surfels.points.iter().map(|p| Vector3::from(p.map(f64::from)));
    let spread = centre.fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose());
    let eigen = SymmetricEigen::new(spread);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    Matrix3::from_columns(&order.map(|k| eigen.eigenvectors.column(k).into_owned()))
}

/// Rotations spread evenly over all there are (super-Fibonacci spirals, Alexa 2022).
fn spread_turns(count: usize) -> impl Iterator<Item = UnitQuaternion<f64>> {
    const PSI: f64 = 1.533_751_168_755_204_3;
    (0..count).map(move |i| {
        let s = i as f64 + 0.5;
        let t = s / count as f64;
        let (alpha, beta) =
            (std::f64::consts::TAU * s / std::f64::consts::SQRT_2, std::f64::consts::TAU * s / PSI);
        let (r, big) = (t.sqrt(), (1.0 - t).sqrt());
        UnitQuaternion::new_normalize(Quaternion::new(
            big * beta.cos(),
            r * alpha.sin(),
            r * alpha.cos(),
            big * beta.sin(),
        ))
    })
}

/// Placements that several feature matches agree on.
fn matched(a: &Prepared, b: &Prepared) -> Vec<Pose> {
    let described = |side: &Prepared| {
        let tree = Tree::new(&side.cloud.points);
        let all: Vec<usize> = (0..side.len()).collect();
        describe(&side.cloud, &tree, FEATURE_RADIUS, &all)
    };
    let matches = match_descriptors(&described(b), &described(a), MatchConfig::default());
    let seen =
        |side: &'_ Prepared| -> [f32; 3] { Point3::from(side.surfels.centre).coords.cast::<f32>().into() };
    let (source, target) = (
        Seen { points: &b.cloud.points, normals: &b.cloud.normals, sensor: seen(b) },
        Seen { points: &a.cloud.points, normals: &a.cloud.normals, sensor: seen(a) },
    );
    let config = PairwiseConfig { cell: 0.004, hypotheses: OF_MATCHES, ..PairwiseConfig::default() };
    starts_of_matches(&source, &target, &matches, &config)
}
