//! The rigid transform that brings paired points closest together, by singular value decomposition.
//!
//! Arun, Huang and Blostein (1987) with the reflection guard of Umeyama (1991): minimises `Σ w |T p - q|²` (source slide 24).

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::pose::Pose;

/// Second singular value, relative to the first, below which the points count as lying on one line.
const COLLINEAR: f64 = 1e-9;

/// Least-squares `target_from_source` of weighted pairs `(source, target, weight)` in metres.
///
/// `None` with fewer than three pairs of positive weight, with points on one line, or with anything not finite.
pub fn rigid_transform<I>(pairs: I) -> Option<Pose>
where
    I: IntoIterator<Item = ([f32; 3], [f32; 3], f64)> + Clone,
{
    let (mut count, mut weight) = (0usize, 0.0);
    let (mut source_mean, mut target_mean) = (Vector3::zeros(), Vector3::zeros());
    for (p, q, w) in pairs.clone().into_iter().filter(|(_, _, w)| *w > 0.0) {
        count += 1;
        weight += w;
        source_mean += Vector3::from(p.map(f64::from)) * w;
        target_mean += Vector3::from(q.map(f64::from)) * w;
    }
    if count < 3 {
        return None;
    }
    source_mean /= weight;
    target_mean /= weight;
    // Umeyama eq. 38: the cross-covariance of the centred sets.
    let mut covariance = Matrix3::zeros();
    for (p, q, w) in pairs.into_iter().filter(|(_, _, w)| *w > 0.0) {
        let p = Vector3::from(p.map(f64::from)) - source_mean;
        let q = Vector3::from(q.map(f64::from)) - target_mean;
        covariance += (q * p.transpose()) * w;
    }
    if !covariance.iter().all(|v| v.is_finite()) {
        return None;
    }
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    if svd.singular_values[0] <= 0.0 || svd.singular_values[1] < COLLINEAR * svd.singular_values[0] {
        return None;
    }
    // Umeyama eq. 39–40: S turns a reflection into the nearest rotation.
    let sign = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let translation = target_mean - rotation * source_mean; // eq. 41
    Some(Pose::from_parts(translation.into(), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::{exp, log};
    use nalgebra::{Point3, Vector6};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn recovers_any_motion(
            twist in prop::array::uniform6(-2.0f64..2.0),
            points in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 4..30),
        ) {
            let truth = exp(&Vector6::from_row_slice(&twist));
            let moved: Vec<[f32; 3]> =
                points.iter().map(|p| (truth * Point3::from(p.map(f64::from))).map(|v| v as f32).into()).collect();
            let Some(found) = rigid_transform(points.iter().zip(&moved).map(|(p, q)| (*p, *q, 1.0))) else {
                return Ok(());
            };
            // Only as good as the points are spread: judge where the points land, not the pose.
            for (p, q) in points.iter().zip(&moved) {
                let landed = found * Point3::from(p.map(f64::from));
                prop_assert!((landed - Point3::from(q.map(f64::from))).norm() < 1e-5);
            }
        }
    }

    #[test]
    fn a_mirror_image_still_gives_a_rotation() {
        let points = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
        let mirrored = points.map(|p| [-p[0], p[1], p[2]]);
        let found = rigid_transform(points.iter().zip(&mirrored).map(|(p, q)| (*p, *q, 1.0))).unwrap();
        assert!((found.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn weight_zero_is_no_pair_and_lines_are_refused() {
        let line: Vec<[f32; 3]> = (0..9).map(|i| [i as f32, 0.0, 0.0]).collect();
        assert!(rigid_transform(line.iter().map(|p| (*p, *p, 1.0))).is_none());
        assert!(rigid_transform(line[..2].iter().map(|p| (*p, *p, 1.0))).is_none());
        let mut pairs = vec![([9.0f32; 3], [1.0f32, 5.0, -3.0], 0.0)];
        for p in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            pairs.push((p, p, 1.0));
        }
        assert!(log(&rigid_transform(pairs).unwrap()).norm() < 1e-9);
    }
}
