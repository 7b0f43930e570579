//! Whether the product may go on beyond where its points end: space that no view saw to be free may hold more of it.

use nalgebra::{Point3, Vector3};

use super::{Dimensions, Measured};
use crate::fuse::PlacedView;
use crate::mesh::Mesh;

/// Points within this depth below an end are its slice, metres.
const SLICE_METRES: f64 = 0.004;
/// Points of a slice that are looked at, evenly taken.
const MOST_PROBES: usize = 60;
/// Points nearer to the floor are not looked at: the floor beyond them is hardly farther away than they are, metres.
const ABOVE_FLOOR_METRES: f32 = 0.008;
/// Space beyond a point is looked at from here on, in steps, up to there, metres.
const FIRST_METRES: f64 = 0.004;
const STEP_METRES: f64 = 0.002;
const LAST_METRES: f64 = 0.05;
/// A view sees through a place if it sees so much farther, metres.
const THROUGH_METRES: f64 = 0.0025;

/// How much longer, wider and higher than measured the product may be at least, metres: beyond a quarter of an end lies space that no view
/// saw. Parts that nothing measured borders on may reach farther still.
pub fn unseen_beyond(mesh: &Mesh, size: &Dimensions, views: &[PlacedView]) -> [f64; 3] {
    let points = Measured::of(mesh);
    std::array::from_fn(|k| {
        let ends = [1.0, -1.0].map(|sign| Vector3::from(size.directions[k]) * sign);
        // What it stands on is known.
        let ends = ends.iter().filter(|d| k < 2 || !size.stands_on_floor || d.z > 0.0);
        let low = if size.stands_on_floor { ABOVE_FLOOR_METRES } else { f32::MIN };
        ends.map(|direction| beyond(&points, direction, low, views)).sum()
    })
}

fn beyond(points: &Measured, direction: &Vector3<f64>, low: f32, views: &[PlacedView]) -> f64 {
    let along = points.along((*direction).into());
    let Some(at) = super::edge::outermost(&along) else { return 0.0 };
    let is_in_slice = |&i: &usize| f64::from(at - along[i]) < SLICE_METRES && points.places[i][2] > low;
    let in_slice: Vec<usize> = (0..along.len()).filter(is_in_slice).collect();
    let stride = in_slice.len().div_ceil(MOST_PROBES).max(1);
    let mut unseen: Vec<f64> = in_slice
        .iter()
        .step_by(stride)
        .map(|&i| {
            let place = Vector3::from(points.places[i]).cast::<f64>();
            let to_end = f64::from(at - along[i]);
            unseen_from(&(place + direction * to_end), direction, views)
        })
        .collect();
    unseen.sort_unstable_by(f64::total_cmp);
    unseen.get(unseen.len() * 3 / 4).copied().unwrap_or(0.0)
}

/// From a place outwards, how far it is to the first place that a view sees to be free; 0 where that is the first one looked at.
fn unseen_from(place: &Vector3<f64>, direction: &Vector3<f64>, views: &[PlacedView]) -> f64 {
    let is_free = |at: &Point3<f64>| {
        views.iter().any(|view| {
            let in_camera = view.world_from_camera.inverse_transform_point(at);
            view.geometry.nearest_gap(&in_camera).is_some_and(|gap| gap > THROUGH_METRES)
        })
    };
    let mut metres = FIRST_METRES;
    while metres < LAST_METRES && !is_free(&Point3::from(place + direction * metres)) {
        metres += STEP_METRES;
    }
    if metres > FIRST_METRES { metres } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Intrinsics;
    use crate::cloud::PointCloud;
    use crate::image::ColorImage;
    use crate::measure::dimensions;
    use crate::pose::Pose;
    use crate::view::DepthView;

    /// A plate of 60 x 200 mm stands 0.7 m before a camera that looks along y, and a wall half a metre behind it.
    fn plate_before_a_wall(wall_is_seen: bool) -> [f64; 3] {
        let camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
        let world_from_camera = Pose::from_parts(
            nalgebra::Translation3::new(0.0, -0.7, 0.1),
            nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2),
        );
        let rays = camera.ray_table();
        let on_plate = |r: &[f32; 2]| (0.7 * r[0]).abs() <= 0.03 && (0.0..=0.2).contains(&(0.1 - 0.7 * r[1]));
        let behind = if wall_is_seen { 1.2 } else { 0.0 };
        let depth: Vec<f32> = rays.iter().map(|r| if on_plate(r) { 0.7 } else { behind }).collect();
        let geometry = DepthView::new(camera, &rays, &depth);
        let color = ColorImage::filled(640, 480, [0; 3]);
        let view = PlacedView { geometry: &geometry, color: &color, world_from_camera };
        let points: Vec<[f32; 3]> = (0..61 * 200)
            .map(|i| [0.001 * (i % 61) as f32 - 0.03, 0.0, 0.001 * (i / 61 + 1) as f32])
            .collect();
        let deviations_metres = vec![0.0003; points.len()];
        let vertices = PointCloud { points, ..PointCloud::default() };
        let mesh = Mesh { vertices, triangles: Vec::new(), deviations_metres };
        let size = dimensions(&mesh, 0.001, true).unwrap();
        assert!((size.metres[0] - 0.06).abs() < 0.002 && size.metres[1] < 0.002, "{:?}", size.metres);
        unseen_beyond(&mesh, &size, &[view])
    }

    #[test]
    fn only_what_lies_behind_may_go_on() {
        let [length, width, height] = plate_before_a_wall(true);
        assert_eq!([length, height], [0.0, 0.0]);
        assert!((width - LAST_METRES).abs() < 0.003, "{width}");
    }

    #[test]
    fn where_no_view_sees_anything_every_end_may_go_on() {
        assert!(plate_before_a_wall(false).iter().all(|&unseen| unseen > 0.04));
    }
}
