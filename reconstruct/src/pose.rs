//! Rigid transforms, always named `a_from_b`: `p_in_a = a_from_b * p_in_b`. Metres and radians.

use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};

/// A rigid transform in metres.
pub type Pose = Isometry3<f64>;

/// How far a 3x3 block may be from a rotation before it is refused.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Pose of 16 row-major numbers; `None` where they are not finite or not a rigid transform.
pub fn from_row_major(rows: &[f64; 16]) -> Option<Pose> {
    if rows.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let m = Matrix4::from_row_slice(rows);
    let r: Matrix3<f64> = m.fixed_view::<3, 3>(0, 0).into();
    let rigid = (r * r.transpose() - Matrix3::identity()).norm() < ROTATION_TOLERANCE
        && (r.determinant() - 1.0).abs() < ROTATION_TOLERANCE
        && m.fixed_view::<1, 4>(3, 0).iter().zip([0.0, 0.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-9);
    if !rigid {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&r));
    Some(Pose::from_parts(Translation3::new(rows[3], rows[7], rows[11]), rotation))
}

/// The 16 row-major numbers of a pose.
pub fn to_row_major(pose: &Pose) -> [f64; 16] {
    let m = pose.to_homogeneous();
    std::array::from_fn(|i| m[(i / 4, i % 4)])
}

/// Pose of a twist `(translation, rotation vector)`: the rotation vector is exponentiated, the translation taken as it is.
///
/// Small steps of the optimisers are applied on the left: `pose <- exp(step) * pose`.
pub fn exp(twist: &Vector6<f64>) -> Pose {
    Pose::new(Vector3::new(twist[0], twist[1], twist[2]), Vector3::new(twist[3], twist[4], twist[5]))
}

/// The twist `(translation, rotation vector)` whose [`exp`] is the pose.
pub fn log(pose: &Pose) -> Vector6<f64> {
    let t = pose.translation.vector;
    let r = pose.rotation.scaled_axis();
    Vector6::new(t.x, t.y, t.z, r.x, r.y, r.z)
}

/// Angle in radians between the rotations of two poses.
pub fn rotation_error_radians(a: &Pose, b: &Pose) -> f64 {
    a.rotation.angle_to(&b.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exp_log_round_trip(v in prop::array::uniform6(-1.5f64..1.5)) {
            let twist = Vector6::from_row_slice(&v);
            prop_assert!((log(&exp(&twist)) - twist).norm() < 1e-9);
        }

        #[test]
        fn row_major_round_trip(v in prop::array::uniform6(-1.5f64..1.5)) {
            let pose = exp(&Vector6::from_row_slice(&v));
            let back = from_row_major(&to_row_major(&pose)).unwrap();
            prop_assert!((log(&(back.inverse() * pose))).norm() < 1e-9);
        }
    }

    #[test]
    fn what_is_not_rigid_is_refused() {
        let mut rows = to_row_major(&Pose::identity());
        rows[0] = 2.0;
        assert!(from_row_major(&rows).is_none());
        rows[0] = f64::NAN;
        assert!(from_row_major(&rows).is_none());
    }
}
