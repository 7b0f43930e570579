//! Colour gradients on a surface: in the tangent plane of each point, the linear change of each channel that fits its
//! neighbours best (Park, Zhou and Koltun 2017, eq. 10–11), for all three channels rather than for intensity alone.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::knn::Tree;

/// Change of red, green and blue (0 to 1) per metre, each a vector in the tangent plane.
pub type ColorGradient = [[f32; 3]; 3];

/// Gradients of a cloud with colours and normals from the neighbours within `radius` metres.
/// Zero where a point has no normal or fewer than five neighbours.
pub fn color_gradients(cloud: &PointCloud, tree: &Tree, radius: f32) -> Vec<ColorGradient> {
    if !cloud.has_colors() || !cloud.has_normals() {
        return Vec::new();
    }
    (0..cloud.len()).into_par_iter().with_min_len(256).map(|i| gradient_at(cloud, tree, radius, i)).collect()
}

fn gradient_at(cloud: &PointCloud, tree: &Tree, radius: f32, i: usize) -> ColorGradient {
    let (p, n) = (Vector3::from(cloud.points[i]), Vector3::from(cloud.normals[i]));
    let found = tree.within_radius_unsorted(&cloud.points[i], radius);
    if n == Vector3::zeros() || found.len() < 5 {
        return [[0.0; 3]; 3];
    }
    let mut normal_matrix = Matrix3::zeros();
    let mut right = Matrix3::zeros();
    let here = Vector3::from(channels(cloud.colors[i]));
    for other in found {
        let offset = Vector3::from(cloud.points[other.index]) - p;
        let offset = offset - n * n.dot(&offset); // projection to the tangent plane
        let change = Vector3::from(channels(cloud.colors[other.index])) - here;
        normal_matrix += offset * offset.transpose();
        right += offset * change.transpose();
    }
    // The constraint that the gradient lies in the tangent plane (their eq. 11), as strong as the data.
    let weight = normal_matrix.trace();
    normal_matrix += n * n.transpose() * weight;
    normal_matrix += Matrix3::identity() * (weight * 1e-4);
    let Some(solution) = normal_matrix.try_inverse().map(|inverse| inverse * right) else {
        return [[0.0; 3]; 3];
    };
    std::array::from_fn(|c| solution.column(c).into_owned().into())
}

/// A colour with channels 0 to 1.
pub(crate) fn channels(color: [u8; 3]) -> [f32; 3] {
    color.map(|v| f32::from(v) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_ramp_has_its_slope_as_gradient() {
        let mut cloud = PointCloud::default();
        for i in -20..=20 {
            for j in -20..=20 {
                let (x, y) = (i as f32 * 0.002, j as f32 * 0.002);
                cloud.points.push([x, y, 0.5]);
                cloud.normals.push([0.0, 0.0, -1.0]);
                cloud.colors.push([(128.0 + 2000.0 * x) as u8, 100, (128.0 - 1000.0 * y) as u8]);
            }
        }
        let gradients = color_gradients(&cloud, &Tree::new(&cloud.points), 0.008);
        let [red, green, blue] = gradients[20 * 41 + 20];
        let expected = [[2000.0 / 255.0, 0.0, 0.0], [0.0; 3], [0.0, -1000.0 / 255.0, 0.0]];
        for (found, expected) in [red, green, blue].iter().zip(expected) {
            assert!((Vector3::from(*found) - Vector3::from(expected)).norm() < 0.3, "{found:?} {expected:?}");
        }
    }
}
