//! What holds a view in the world before its surface is looked at: the corners of the board's tags, or a pose that is
//! known so well.

use nalgebra::{Matrix3, Matrix6, RowVector3, Vector3, Vector6};

use crate::camera::Intrinsics;
use crate::marker::{SeenCorner, projection};
use crate::pose::{self, Pose};

/// From this residual on, in standard deviations, a corner counts less (Huber).
const HUBER_SIGMAS: f64 = 3.0;

/// What no corner shows: the print, the paper and the lens are never quite as modelled, and all corners of a view suffer from it together.
/// Standard deviations of a view's pose from that alone, metres and radians.
const COMMON_SD: [f64; 6] = [1e-4, 1e-4, 1e-4, 2e-4, 2e-4, 2e-4];

/// What is known of a view's pose before its surface is looked at.
#[derive(Debug, Clone, Copy)]
pub enum Anchor<'a> {
    /// The board's corners in its picture.
    Corners(&'a [SeenCorner]),
    /// A pose and how well it is known.
    Prior(&'a PosePrior),
}

/// A pose and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct PosePrior {
    /// Where the camera should stand.
    pub world_from_camera: Pose,
    /// Inverse covariance of a left step `exp(step) * world_from_camera`, order translation, rotation; world frame.
    pub information: Matrix6<f64>,
}

impl PosePrior {
    /// The same in another world frame.
    #[must_use]
    pub fn moved(&self, new_from_old: &Pose) -> Self {
        let old_from_new = new_from_old.inverse();
        let rotation = old_from_new.rotation.to_rotation_matrix().into_inner();
        // A step d in the new world is Ad(old_from_new) d in the old one.
        let mut back = Matrix6::zeros();
        back.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
        back.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
        let shifted = old_from_new.translation.vector.cross_matrix() * rotation;
        back.fixed_view_mut::<3, 3>(0, 3).copy_from(&shifted);
        Self {
            world_from_camera: new_from_old * self.world_from_camera,
            information: back.transpose() * self.information * back,
        }
    }
}

impl Anchor<'_> {
    /// Normal matrix and right side of a left step on `world_from_camera`.
    pub(super) fn normal_equations(
        &self,
        world_from_camera: &Pose,
        camera: &Intrinsics,
    ) -> (Matrix6<f64>, Vector6<f64>) {
        match self {
            Anchor::Prior(prior) => {
                let off = pose::log(&(world_from_camera * prior.world_from_camera.inverse()));
                (prior.information, -(prior.information * off))
            }
            Anchor::Corners(corners) => {
                with_common_error(corner_equations(corners, world_from_camera, camera))
            }
        }
    }
}

/// Reprojection errors of the corners.
fn corner_equations(
    corners: &[SeenCorner],
    world_from_camera: &Pose,
    camera: &Intrinsics,
) -> (Matrix6<f64>, Vector6<f64>) {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    let camera_from_world = world_from_camera.inverse();
    let rotation: Matrix3<f64> = *camera_from_world.rotation.to_rotation_matrix().matrix();
    for corner in corners {
        let Some((pixel, by_point)) =
            projection::with_derivative(camera, &(camera_from_world * corner.in_board))
        else {
            continue;
        };
        let residual = pixel - corner.pixel;
        let sigmas = residual.norm() / corner.sigma_px;
        let weight = (HUBER_SIGMAS / sigmas.max(HUBER_SIGMAS)) / corner.sigma_px.powi(2);
        for k in 0..2 {
            // A left step (t, w) on world_from_camera moves the corner in the camera by -R^T (t + w x X).
            let along: RowVector3<f64> = -(by_point.row(k) * rotation);
            let along: Vector3<f64> = along.transpose();
            let turn = corner.in_board.coords.cross(&along);
            let row = Vector6::new(along.x, along.y, along.z, turn.x, turn.y, turn.z);
            normal += weight * row * row.transpose();
            right -= weight * residual[k] * row;
        }
    }
    (normal, right)
}

/// The equations after an error of the pose that all corners share has been eliminated (Schur complement).
fn with_common_error((normal, right): (Matrix6<f64>, Vector6<f64>)) -> (Matrix6<f64>, Vector6<f64>) {
    let common = Matrix6::from_diagonal(&Vector6::from(COMMON_SD).map(|sd| 1.0 / (sd * sd)));
    let Some(inverse) = (normal + common).try_inverse() else { return (normal, right) };
    let kept = Matrix6::identity() - normal * inverse;
    (kept * normal, kept * right)
}
