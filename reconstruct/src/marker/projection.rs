//! Projection with its derivative, for the least-squares problems of this module.

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Point2, Point3};

use crate::camera::Intrinsics;

/// Pixel of a point in the camera frame and its derivative by the point; `None` behind the camera.
///
/// The lens makes the exact derivative long; central differences are good to nine digits here.
pub(crate) fn with_derivative(
    camera: &Intrinsics,
    point: &Point3<f64>,
) -> Option<(Point2<f64>, Matrix2x3<f64>)> {
    let pixel = camera.project(point)?;
    if !camera.is_distorted() {
        let (iz, x, y) = (1.0 / point.z, point.x / point.z, point.y / point.z);
        let d = Matrix2x3::new(
            camera.fx * iz,
            0.0,
            -camera.fx * x * iz,
            0.0,
            camera.fy * iz,
            -camera.fy * y * iz,
        );
        return Some((pixel, d));
    }
    let h = 1e-5 * point.z;
    let mut derivative = Matrix2x3::zeros();
    for k in 0..3 {
        let (mut ahead, mut behind) = (*point, *point);
        ahead[k] += h;
        behind[k] -= h;
        let slope = (camera.project(&ahead)? - camera.project(&behind)?) / (2.0 * h);
        derivative.set_column(k, &slope);
    }
    Some((pixel, derivative))
}

/// Derivative of a pixel by a step of the pose on its left, `exp(step) * pose`, at a point in the camera frame.
pub(super) fn by_left_step(by_point: &Matrix2x3<f64>, point: &Point3<f64>) -> Matrix2x6<f64> {
    let turn = Matrix3::new(0.0, point.z, -point.y, -point.z, 0.0, point.x, point.y, -point.x, 0.0);
    let mut derivative = Matrix2x6::zeros();
    derivative.fixed_view_mut::<2, 3>(0, 0).copy_from(by_point);
    derivative.fixed_view_mut::<2, 3>(0, 3).copy_from(&(by_point * turn));
    derivative
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::{Pose, exp};
    use nalgebra::Vector6;

    #[test]
    fn derivatives_agree_with_differences() {
        for k1 in [0.0, 0.2] {
            let mut camera = Intrinsics::pinhole(640, 480, 520.0, 530.0, 320.0, 240.0);
            camera.distortion = [k1, -0.3 * k1, 0.01 * k1, 0.02 * k1, 0.0];
            let point = Point3::new(0.11, -0.07, 0.8);
            let (pixel, by_point) = with_derivative(&camera, &point).unwrap();
            let by_step = by_left_step(&by_point, &point);
            for k in 0..6 {
                let mut step = Vector6::zeros();
                step[k] = 1e-6;
                let moved = camera.project(&((exp(&step) * Pose::identity()) * point)).unwrap();
                let slope = (moved - pixel) / 1e-6;
                assert!((slope - by_step.column(k)).norm() < 0.01, "{k} {slope} {by_step}");
            }
        }
    }
}
